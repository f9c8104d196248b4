"""The time limit of a call: KeyboardInterrupt where it computes, and TimeLimitError after it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from time import monotonic
from types import FrameType
from typing import Protocol, TypeVar

from symcheck.errors import TimeLimitError
from symcheck.operating_system import ALARM, can_repeat_alarm, set_alarm

__all__ = ["PATIENCE", "ThreadTimer", "limit_time", "seconds_left", "within"]

T = TypeVar("T")

PATIENCE = 0.1  # seconds until an interrupt without effect is repeated


class _Deadline(threading.local):
    """When the time limit of the outermost call of a thread ends, by `monotonic`."""

    at: float | None = None


_DEADLINE = _Deadline()


def seconds_left() -> float | None:
    """What is left of the time limit of this thread; None without one."""
    return None if _DEADLINE.at is None else max(_DEADLINE.at - monotonic(), 0.0)


def limit_time(seconds: float | None) -> None:
    """Start a time limit that the caller keeps: `within` adds none. None: it ends."""
    _DEADLINE.at = None if seconds is None else monotonic() + seconds


class _Timer(Protocol):
    """Raises KeyboardInterrupt in a thread when the time is over, until it is ended."""

    @property
    def expired(self) -> bool:
        """Whether the time is over."""

    def start(self) -> None:
        """Start the time."""

    def end(self) -> None:
        """Nothing is raised any more."""


def within(seconds: float | None, compute: Callable[[], T]) -> T:
    """What a function returns, if it does not take longer than a number of seconds.

    A call within another one has the limit of the outer one. The main thread is interrupted by
    the signal ALARM, unless the caller has a use for it; other threads are at their next
    instruction of Python.

    Args:
        seconds: the limit; None: none.
        compute: may catch KeyboardInterrupt and raise another error.

    Raises:
        TimeLimitError: the time is over.
    """
    if seconds is None or _DEADLINE.at is not None:
        return compute()
    timer: _Timer = _AlarmTimer(seconds) if _alarm_is_free() else ThreadTimer(seconds)
    try:
        try:
            limit_time(seconds)
            timer.start()
            return compute()
        finally:
            timer.end()
            limit_time(None)
    except BaseException:
        timer.end()
        limit_time(None)
        if timer.expired:
            message = f"the time limit of {seconds:g} s was reached"
            raise TimeLimitError(f"{message}\n  hint: time_limit gives more") from None
        raise


def _alarm_is_free() -> bool:
    return (
        can_repeat_alarm()
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(ALARM) == signal.SIG_DFL
    )


class _Destructors:
    """A destructor that an interrupt reaches cannot raise, which is no fault."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._timers: list[_Timer] = []

    def watch(self, timer: _Timer) -> None:
        """Do not report what this timer does to destructors."""
        with self._lock:
            if not self._timers:
                self._previous = sys.unraisablehook
                sys.unraisablehook = self._report
            self._timers.append(timer)

    def leave(self, timer: _Timer) -> None:
        """The timer interrupts nothing any more."""
        with self._lock:
            self._timers.remove(timer)
            if not self._timers and sys.unraisablehook == self._report:
                sys.unraisablehook = self._previous

    def _report(self, event: sys.UnraisableHookArgs) -> None:
        expected = issubclass(event.exc_type, KeyboardInterrupt)
        if not (expected and any(timer.expired for timer in self._timers)):
            self._previous(event)


_DESTRUCTORS = _Destructors()


class _AlarmTimer:
    """The signal ALARM, repeated: a destructor, for example, cannot raise."""

    def __init__(self, seconds: float) -> None:
        self.expired = False
        self._seconds = seconds
        self._ended = True

    def start(self) -> None:
        self._ended = False
        _DESTRUCTORS.watch(self)
        signal.signal(ALARM, self._raise)
        set_alarm(self._seconds, PATIENCE)

    def end(self) -> None:
        if not self._ended:
            self._ended = True
            set_alarm(0)
            signal.signal(ALARM, signal.SIG_DFL)
            _DESTRUCTORS.leave(self)

    def _raise(self, _: int, __: FrameType | None) -> None:
        if not self._ended:
            self.expired = True
            raise KeyboardInterrupt


class ThreadTimer:
    """A thread that interrupts the one that has made it, at one of its next instructions.

    Compiled loops that last long watch the time limit themselves.

    Args:
        seconds: until then.
        tell: is called when the time is over, before the first interrupt.
    """

    def __init__(self, seconds: float, tell: Callable[[], object] = lambda: None) -> None:
        self.expired = False
        self._seconds = seconds
        self._tell = tell
        self._target = threading.get_ident()
        self._over = threading.Event()
        self._acknowledged = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the time."""
        _DESTRUCTORS.watch(self)
        self._thread = threading.Thread(target=self._interrupt, daemon=True)
        self._thread.start()

    def _interrupt(self) -> None:
        seconds = self._seconds
        while not self._over.wait(seconds):
            self.expired = True
            self._tell()
            if not self._acknowledged:
                self._raise()
            seconds = PATIENCE

    def acknowledge(self) -> None:
        """The interrupt has taken effect, and is not repeated."""
        self._acknowledged = True

    def end(self) -> None:
        """End the thread, and receive the error that it may still have set for this one.

        A last one is set and raised here: withdrawing it would leave CPython 3.11 looking for an
        error at every call, and for ever where calls are traced.
        """
        if self._thread is None:
            return
        ended = False
        while True:
            try:
                self._over.set()
                self._thread.join()
                ended = True
                if not self.expired:
                    break
                self._raise()
                while True:
                    pass
            except KeyboardInterrupt:
                if ended:
                    break
        self._thread = None
        _DESTRUCTORS.leave(self)

    def _raise(self) -> None:
        """Let the thread raise KeyboardInterrupt."""
        import ctypes  # takes milliseconds

        given = ctypes.py_object(KeyboardInterrupt)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._target), given)
