"""The command line."""

from __future__ import annotations

import gc
import os

__all__ = ["main"]


def main(words: list[str] | None = None) -> int:
    """Run the command line; returns the exit status (see `symcheck --help`)."""
    # Matrices are small for a BLAS: its threads wait longer than they compute. numpy reads this
    # variable when it is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Modules live as long as the process: the garbage collector need not visit them.
    gc.disable()
    from symcheck.cli.entry_point import run_safely

    gc.freeze()
    gc.enable()
    return run_safely(words)
