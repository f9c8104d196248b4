"""The time limit of a call: KeyboardInterrupt where it computes, and TimeLimitError after it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from time import monotonic
from types import FrameType
from typing import Protocol, TypeVar

from symcheck.errors import ResourceError, TimeLimitError
from symcheck.operating_system import ALARM, can_repeat_alarm, set_alarm

__all__ = ["PATIENCE", "ThreadTimer", "limit_time", "seconds_left", "within"]

T = TypeVar("T")

PATIENCE = 0.1  # seconds until an interrupt without effect is repeated

_LOCKING = {"threading", "_weakrefset", "logging", "coverage"}
"""Modules in whose functions an interrupt may leave a lock held."""

_IMPORTING = {"importlib", "_frozen_importlib", "_frozen_importlib_external"}
"""Modules that import others: compiled ones, such as numpy's, cannot be imported again after an
interrupt."""

_MOST_DELAYS = 10
"""How often an interrupt is put off because of these modules; a thread may also wait in one, or
compute within an import."""


class _Deadline(threading.local):
    """When the time limit of the outermost call of a thread ends, by `monotonic`."""

    at: float | None = None


_DEADLINE = _Deadline()


def seconds_left() -> float | None:
    """What is left of the time limit of this thread; None without one."""
    return None if _DEADLINE.at is None else max(_DEADLINE.at - monotonic(), 0.0)


def limit_time(seconds: float | None) -> None:
    """Set the deadline of this thread without a timer: the caller enforces it, and `within` starts
    no timer. None clears the deadline.
    """
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
    the signal ALARM if that can be repeated and has no handler of the caller; otherwise, and in
    other threads, a ThreadTimer raises the interrupt at the next instruction of Python.

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
            _end(timer)
    except BaseException as error:
        _end(timer)
        # What computes may have noticed the end of the time before the timer.
        if timer.expired or isinstance(error, TimeLimitError):
            raise TimeLimitError(
                f"the time limit of {seconds:g} s was reached",
                hint="time_limit gives more",
                note=error.note if isinstance(error, ResourceError) else None,
            ) from None
        raise


def _end(timer: _Timer) -> None:
    """End a timer, which may interrupt this once more."""
    while True:
        try:
            timer.end()
            limit_time(None)
            return
        except KeyboardInterrupt:
            if not timer.expired:
                raise


def _is_unsafe_to_stop(frame: FrameType | None) -> bool:
    """Whether an interrupt in a function could leave a lock held, a timer running, or a module
    imported in part.
    """
    if frame is None:
        return False
    if frame.f_globals.get("__name__") == __name__ or _module(frame) in _LOCKING:
        return True
    while frame is not None:
        if _module(frame) in _IMPORTING:
            return True
        frame = frame.f_back
    return False


def _module(frame: FrameType) -> str:
    """The package whose code a frame executes."""
    return str(frame.f_globals.get("__name__", "")).split(".")[0]


def _alarm_is_free() -> bool:
    return (
        can_repeat_alarm()
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(ALARM) == signal.SIG_DFL
    )


class _Destructors:
    """Silences "Exception ignored in …" where a destructor is interrupted: Python drops that.

    It also drops the warning of a file that an interrupt leaves between its opening and its `with`.
    """

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
        expected = issubclass(event.exc_type, (KeyboardInterrupt, ResourceWarning))
        if not (expected and any(timer.expired for timer in self._timers)):
            self._previous(event)


_DESTRUCTORS = _Destructors()


class _AlarmTimer:
    """Interrupts by the signal ALARM, again and again: a destructor, for example, drops one."""

    def __init__(self, seconds: float) -> None:
        self.expired = False
        self._seconds = seconds
        self._ended = True
        self._delays = 0

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

    def _raise(self, _: int, frame: FrameType | None) -> None:
        if self._ended:
            return
        self.expired = True
        if _is_unsafe_to_stop(frame) and self._delays < _MOST_DELAYS:
            self._delays += 1
            return
        raise KeyboardInterrupt


class ThreadTimer:
    """A thread that interrupts the one that has made it, at one of its next instructions.

    A compiled loop executes no instructions of Python: long ones are given `seconds_left`.
    The threads share attributes and plain locks only, which single calls of C change: an interrupt
    could leave a lock that is written in Python, such as that of an Event, held for ever.

    Args:
        seconds: until the first interrupt.
        tell: is called before each interrupt.
    """

    def __init__(self, seconds: float, tell: Callable[[], object] = lambda: None) -> None:
        self.expired = False
        self._seconds = seconds
        self._tell = tell
        self._target = threading.get_ident()
        self._started = False
        self._stop_requested = False
        self._stop_lock = threading.Lock()  # held until the thread is to end
        self._thread_finished = False
        self._finished_lock = threading.Lock()  # held until it has ended

    def start(self) -> None:
        """Start the time."""
        _DESTRUCTORS.watch(self)
        self._stop_lock.acquire()
        self._finished_lock.acquire()
        self._started = True
        threading.Thread(target=self._interrupt, daemon=True).start()

    def _interrupt(self) -> None:
        # CPython 3.11 repeats a traced call for ever while an error is set for a thread that waits.
        sys.settrace(None)
        sys.setprofile(None)
        seconds = self._seconds
        patience = PATIENCE
        while not self._is_over_within(seconds):
            self.expired = True
            self._tell()
            self._wait_until_safe()
            if not self._stop_requested:
                self._raise()
            seconds = patience
            patience *= 2  # the thread may be busy with its clauses `finally`
        self._thread_finished = True
        self._finished_lock.release()

    def _is_over_within(self, seconds: float) -> bool:
        self._stop_lock.acquire(timeout=min(seconds, threading.TIMEOUT_MAX))
        return self._stop_requested

    def _wait_until_safe(self) -> None:
        """Wait until an interrupt does no harm, but not for long."""
        for _ in range(_MOST_DELAYS):
            if not _is_unsafe_to_stop(sys._current_frames().get(self._target)):
                return
            if self._is_over_within(PATIENCE):
                return

    def end(self) -> None:
        """End the thread, and receive the error that it may still have set for this one.

        A last one is set and raised here: withdrawing it would leave CPython 3.11 looking for an
        error at every call, and for ever where calls are traced.
        """
        if not self._started:
            return
        ended = False
        while True:
            try:
                self._stop_requested = True
                if self._stop_lock.locked():
                    self._stop_lock.release()
                if not self._thread_finished:
                    self._finished_lock.acquire()
                ended = True
                if not self.expired:
                    break
                self._raise()
                while True:
                    pass
            except KeyboardInterrupt:
                if ended:
                    break
        self._started = False
        _DESTRUCTORS.leave(self)

    def _raise(self) -> None:
        """Let the thread raise KeyboardInterrupt."""
        import ctypes  # takes milliseconds

        given = ctypes.py_object(KeyboardInterrupt)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._target), given)
