"""Names of files that are written once for each combination of constants."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

__all__ = ["NO_CONSTANTS", "ConstantTexts", "instance_path"]

ConstantTexts = Mapping[str, str]
"""Values of constants, as they are printed."""

NO_CONSTANTS: ConstantTexts = MappingProxyType({})


def instance_path(path: str, varying: ConstantTexts) -> str:
    """The file for one combination of constants: `out_N=3.tra` for `out.tra`; 'stdout' stays."""
    if path == "stdout" or not varying:
        return path
    whole = Path(path)
    suffix = "".join(
        f"_{name}={re.sub(r'[^-+.,=0-9A-Za-z]', '_', value)}" for name, value in varying.items()
    )
    return str(whole.with_name(f"{whole.stem}{suffix}{whole.suffix}"))
