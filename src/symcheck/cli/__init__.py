"""The command line."""

from __future__ import annotations

import os

__all__ = ["main"]


def main(words: list[str] | None = None) -> int:
    """Run the command line; gives the exit status (see `symcheck --help`)."""
    # Matrices here are small for a BLAS: its threads wait for each other longer than they work. numpy reads this when it is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from symcheck.cli.entry_point import run_safely

    return run_safely(words)
