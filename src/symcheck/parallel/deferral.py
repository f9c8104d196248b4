"""Signals that wait until locks are released."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from symcheck.operating_system import ALARM

__all__ = ["deferred_signals"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM, ALARM)


@contextmanager
def deferred_signals() -> Iterator[None]:
    """A context in which signals wait; their handlers are called when it ends.

    Python calls a handler between any two instructions, also directly after a lock is taken. If
    Ctrl-C raised KeyboardInterrupt there, within the code of a pool, the lock would stay locked,
    and a thread of the pool would wait for it without end.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # handlers are called in the main thread only
        return
    arrived: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        arrived.append(number)

    handlers = {n: h for n in _SIGNALS if callable(h := signal.getsignal(n))}
    try:
        for number in handlers:
            signal.signal(number, note)
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for sent in arrived:
            handlers[signal.Signals(sent)](sent, None)
