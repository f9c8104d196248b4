"""The command line."""

from __future__ import annotations

import gc
import os
import sys
from itertools import pairwise
from time import perf_counter

TYPE_CHECKING = False
if TYPE_CHECKING:  # the module takes ten milliseconds, in which Ctrl-C would be a traceback
    from typing import NoReturn

__all__ = ["main"]

# Python has imported it; the modules `signal` and `importlib` take milliseconds.
_signal = sys.modules["_signal"]

_ALARM: int = getattr(_signal, "SIGALRM", _signal.SIGTERM)
"""As in `operating_system`, which is imported later."""


def main(words: list[str] | None = None) -> int:
    """Run the command line; returns the exit status (see `symcheck --help`).

    Without `words`, the process is that of the command line: it ends here, without teardown.
    """
    started = perf_counter()
    if words is None:
        for number in (_signal.SIGINT, _signal.SIGTERM, _ALARM):
            if _signal.getsignal(number) != _signal.SIG_IGN:
                _signal.signal(number, _end)
        _limit_time(sys.argv[1:])
    # Matrices are small for a BLAS: its threads wait longer than they compute. numpy reads this
    # variable when it is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Modules live as long as the process: the garbage collector need not visit them.
    gc.disable()
    try:
        from symcheck.machine import imports_fit

        if words is None and not imports_fit():
            _leave("there is not enough memory\n  hint: see ulimit -v and ulimit -d", 3)
        from symcheck.cli.entry_point import run_safely

        gc.freeze()
        gc.enable()
        return run_safely(words, started)
    except Exception as error:  # the errors of a run are reported there
        try:
            from symcheck.machine import memory_ended

            ended = memory_ended(error)
        except Exception:  # there is no memory for this module either
            ended = True
        if words is None and ended:
            _leave("there is not enough memory", 3)
        raise


def _end(number: int, _: object) -> None:
    """End the process at once: before a run and after it, there is nothing to keep."""
    message, status = {
        _signal.SIGINT: ("interrupted by Ctrl-C", 130),
        _signal.SIGTERM: ("interrupted by SIGTERM", 143),
        _ALARM: ("the time limit was reached", 3),
    }[number]
    _leave(message, status)


def _leave(message: str, status: int) -> NoReturn:
    try:
        os.write(2, f"error: {message}\n".encode())
    finally:
        os._exit(status)


def _limit_time(words: list[str]) -> None:
    """Start the time limit, which counts from here on, before the imports of a run.

    Without an interval timer it starts after them. In a batch, it is that of each line.
    """
    in_batch = any(w.lstrip("-").partition("=")[0] == "batch" for w in words if w[:1] == "-")
    if in_batch or not hasattr(_signal, "setitimer"):
        return
    for switch, value in pairwise(words):
        if switch in ("-timeout", "--timeout"):
            from contextlib import suppress

            from symcheck.options import read_seconds

            with suppress(ValueError):  # reported with the other switches
                _signal.setitimer(_signal.ITIMER_REAL, read_seconds(value))
