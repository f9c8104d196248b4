"""The command line."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["main"]


def main(words: list[str] | None = None) -> int:
    """Run the command line; gives the exit status (see `symcheck --help`). Without `words` those of the process, which is ours."""
    with _quick_start(ours=words is None):
        from symcheck.cli.entry import run_safely

    return run_safely(words)


@contextmanager
def _quick_start(*, ours: bool) -> Iterator[None]:
    """Import without what costs a third of the time of a small run and gives it nothing."""
    if ours:
        # numpy starts a thread for each core, which waits actively at first. What is multiplied by it is small here.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        # Nothing that imports make is garbage: it need not be looked through, neither now nor in later collections.
        gc.disable()
    yield
    if ours:
        gc.freeze()
        gc.enable()
