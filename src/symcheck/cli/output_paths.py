"""Names of files that are written once for every choice of constants."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

__all__ = ["NOTHING", "Values", "own_file"]

Values = Mapping[str, str]

NOTHING: Values = MappingProxyType({})
"""No constants."""


def own_file(path: str, varying: Values) -> str:
    """The file for one choice of the constants that vary: `out.tra` becomes `out_N=3_p=0.5.tra`; 'stdout' stays."""
    if path == "stdout" or not varying:
        return path
    whole = Path(path)
    choice = "".join(
        f"_{name}={re.sub(r'[^-+.,=0-9A-Za-z]', '_', value)}" for name, value in varying.items()
    )
    return str(whole.with_name(f"{whole.stem}{choice}{whole.suffix}"))
