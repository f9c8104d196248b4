"""Signals that end a run: Ctrl-C, SIGTERM (from a scheduler, for example), and the time limit."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from symcheck.errors import TimeLimitError

__all__ = ["StopSignals", "limited"]

_GRACE = 5.0  # seconds in which compiled code has to notice that the limit was reached
_PATIENCE = 1.0  # seconds until a signal without effect is repeated
_HANDLED: dict[signal.Signals, Any] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
}


class StopSignals:
    """A context in which Ctrl-C and SIGTERM raise KeyboardInterrupt until it takes effect.

    The code that they interrupt may be unable to raise, such as a destructor. Signals with another
    handler are left alone.
    """

    def __init__(self) -> None:
        self.signal = signal.SIGINT
        """The last signal."""
        self._timers: list[threading.Timer] = []
        self._taken: list[signal.Signals] = []

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is threading.main_thread():
            self._taken = [
                number for number, usual in _HANDLED.items() if signal.getsignal(number) == usual
            ]
        for number in self._taken:
            signal.signal(number, self._raise)
        return self

    def __exit__(self, *_: object) -> None:
        for timer in self._timers:
            timer.cancel()
        for number in self._taken:
            signal.signal(number, _HANDLED[number])

    def _raise(self, number: int, _: FrameType | None) -> None:
        self.signal = signal.Signals(number)
        again = threading.Timer(_PATIENCE, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()
        self._timers.append(again)
        raise KeyboardInterrupt

    @property
    def name(self) -> str:
        """The name of the signal for the user."""
        return "Ctrl-C" if self.signal is signal.SIGINT else self.signal.name

    @property
    def advice(self) -> str:
        """A hint to append to a message, if the signal did not come from the keyboard."""
        if self.signal is signal.SIGINT:
            return ""
        return (
            f"\n  hint: {self.name} was sent by another process, such as a scheduler; "
            "-timeout and -cuddmaxmem end a run earlier, with a message"
        )

    @property
    def status(self) -> int:
        """The exit status of a run that the signal has stopped: 130 or 143, as in shells."""
        return 128 + self.signal


@contextmanager
def limited(seconds: float | None, last_resort: Callable[[], None]) -> Iterator[None]:
    """Raise TimeLimitError after some seconds; call `last_resort` if that has no effect."""
    if seconds is None or threading.current_thread() is not threading.main_thread():
        yield
        return

    def expired(_: int, __: FrameType | None) -> None:
        raise TimeLimitError(
            "the time limit was reached\n  hint: -timeout gives more; finished results are kept"
        )

    watchdog = threading.Timer(seconds + _GRACE, last_resort)
    watchdog.daemon = True
    previous = signal.signal(signal.SIGALRM, expired)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    watchdog.start()
    try:
        yield
    finally:
        watchdog.cancel()
        signal.setitimer(signal.ITIMER_REAL, 0)
        with suppress(ValueError):
            signal.signal(signal.SIGALRM, previous)
