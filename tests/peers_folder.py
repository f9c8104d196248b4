"""Where the models of other projects are, which this repository does not hold: tests only read them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

__all__ = ["PEERS", "needs_peers", "or_skipped"]

_DEFAULT = Path(__file__).resolve().parents[2] / "shared" / "peers"
_NAMED = os.environ.get("SYMCHECK_PEERS")
PEERS = Path(_NAMED) if _NAMED else _DEFAULT
"""The folder that SYMCHECK_PEERS names, or ../shared/peers beside the repository."""

if _NAMED and not PEERS.is_dir():
    raise FileNotFoundError(f"SYMCHECK_PEERS names {_NAMED}, which is no folder")

needs_peers = pytest.mark.skipif(
    not PEERS.is_dir(), reason="needs the peers' models: set SYMCHECK_PEERS"
)


def or_skipped(instances: list[object], arguments: int) -> list[object]:
    """The instances; where the folder is missing, one that is skipped: an empty list is an error."""
    return instances if PEERS.is_dir() else [pytest.param(*[None] * arguments, marks=needs_peers)]
