"""Signals that end a run: Ctrl-C, SIGTERM (from a scheduler, for example), and the time limit."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

from symcheck.errors import Interrupted, ResourceError, TimeLimitError, out_of_memory
from symcheck.machine import below_limit, limit_memory, memory_ended
from symcheck.operating_system import ALARM, SignalChannel, interrupt_main_thread, set_alarm
from symcheck.time_limit import PATIENCE, ThreadTimer, limit_time

__all__ = ["StopSignals"]

_GRACE = 0.5  # seconds until a process that the signal does not stop is ended
_GRACE_FOR_FILES = 20.0  # the same while finished results are written

_LOW_MEMORY = 32 << 20  # bytes below the limit at which a run is stopped

Handler = Callable[[int, FrameType | None], object] | int | signal.Handlers | None
_HANDLED: dict[signal.Signals, Handler] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
    ALARM: signal.SIG_DFL,
}
"""The signals, and their usual handlers."""


class StopSignals:
    """A context in which Ctrl-C, SIGTERM and the time limit raise KeyboardInterrupt.

    The code that they interrupt may be unable to raise, such as a destructor, or return to Python
    late, such as a compiled loop: Python calls handlers of signals in the main thread only. A
    thread is told at once. It repeats the signal until `acknowledge` is called, and calls `end`
    when its time is over. Signals that the caller ignores or handles are left alone. In a run in
    another thread than the main one, there is only the time limit.

    Args:
        end: ends the process, which is that of the command line. None: the process is another one,
            and signals are repeated without end.
    """

    def __init__(self, end: Callable[[], object] | None = None) -> None:
        self.signal: signal.Signals | None = None
        """The first signal that arrived; None: nothing has stopped the run."""
        self._end = end
        self._acknowledged = False
        self._deadline = 0.0
        self._low_memory = 0
        self._memory_ended = False
        self._over = threading.Event()
        self._timer: ThreadTimer | None = None
        self._previous: dict[signal.Signals, Handler] = {}

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is not threading.main_thread():
            return self
        for number, usual in _HANDLED.items():
            handler = signal.getsignal(number)
            if handler == usual or (self._end is not None and handler is not signal.SIG_IGN):
                self._previous[number] = handler
        self._channel = SignalChannel()
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        self._unraisable = sys.unraisablehook
        sys.unraisablehook = self._on_unraisable
        self._thread_fault = threading.excepthook
        threading.excepthook = self._on_thread_fault
        for number in self._previous:
            signal.signal(number, self._raise)
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.end()
        if threading.current_thread() is not threading.main_thread():
            limit_time(None)
            return
        self._acknowledged = True
        limit_time(None)
        if ALARM in self._previous:
            set_alarm(0)
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        sys.unraisablehook = self._unraisable
        threading.excepthook = self._thread_fault
        self._over.set()
        self._channel.wake()
        self._watcher.join()
        self._channel.close()

    def limit_memory(self, size: int) -> None:
        """Let allocations beyond so many more bytes fail, and stop the run a little before.

        Python cannot report that memory ends within its own small objects: it would abort.
        """
        limit_memory(size)
        self._low_memory = min(size // 8, _LOW_MEMORY)

    def limit_time(self, seconds: float | None) -> None:
        """Stop the run after so many seconds; None: no limit."""
        if seconds is None:
            return
        limit_time(seconds)
        if ALARM in self._previous:
            set_alarm(max(seconds, 1e-6))
            return
        self._timer = ThreadTimer(max(seconds, 0.0), self.note_timeout)
        self._timer.start()

    def note_timeout(self) -> None:
        """The time limit was reached, which what computes may notice before the signal comes."""
        self.signal = self.signal or ALARM

    def acknowledge(self) -> None:
        """The signal has taken effect, and is not repeated."""
        self._acknowledged = True
        if self._timer is not None:
            self._timer.end()

    @contextmanager
    def writing(self) -> Iterator[None]:
        """A context that writes finished results: the process has more time to end."""
        self._deadline = monotonic() + _GRACE_FOR_FILES
        try:
            yield
        finally:
            self._deadline = monotonic() + _GRACE

    @property
    def error(self) -> ResourceError:
        """The error that a signal means."""
        if self._memory_ended:
            return out_of_memory()
        if self.signal is ALARM:
            return TimeLimitError(
                "the time limit was reached", hint="-timeout gives more; finished results are kept"
            )
        if self.signal is signal.SIGTERM:
            return Interrupted(
                "interrupted by SIGTERM",
                hint="another process sent it, such as a scheduler; "
                "-timeout and -cuddmaxmem end a run earlier, with a message",
            )
        return Interrupted("interrupted by Ctrl-C")

    @property
    def status(self) -> int:
        """The exit status of a run that was stopped: 3 by a limit, 130 or 143 as in shells."""
        if self.signal is None or self.signal is ALARM:
            return 3
        return 128 + self.signal

    def _raise(self, number: int, _: FrameType | None) -> None:
        self.signal = self.signal or signal.Signals(number)
        if not self._acknowledged:
            raise KeyboardInterrupt

    def _on_unraisable(self, event: sys.UnraisableHookArgs) -> None:
        """A destructor that a signal has interrupted is no fault, nor is one without memory."""
        if self.signal is None and not issubclass(event.exc_type, MemoryError):
            self._unraisable(event)

    def _on_thread_fault(self, event: threading.ExceptHookArgs) -> None:
        """Without memory, a thread of a pool of processes ends, and the main thread would wait for
        it. The futures of a pool that is stopped are in a state that it does not expect.
        """
        try:
            ended = event.exc_value is not None and memory_ended(event.exc_value)
        except MemoryError:
            ended = True
        if ended:
            self._stop_for_memory()
        elif self.signal is None and event.exc_type.__name__ != "InvalidStateError":
            self._thread_fault(event)

    def _stop_for_memory(self) -> None:
        self._memory_ended = True
        if ALARM in self._previous:  # otherwise it is the caller's
            interrupt_main_thread(ALARM)

    def _memory_is_low(self) -> bool:
        try:
            return below_limit() < self._low_memory
        except (MemoryError, RuntimeError):  # there is not even enough for the question
            return True

    def _watch(self) -> None:
        """Wait for a signal or the end of the memory, repeat the signal, and end the process."""
        while (number := self._channel.wait(PATIENCE)) not in self._previous:
            if self._over.is_set():
                return
            if self._low_memory and self._memory_is_low():
                self._low_memory = 0
                self._stop_for_memory()
        self.signal = self.signal or signal.Signals(number)
        self._deadline = monotonic() + _GRACE
        while not self._over.wait(PATIENCE):
            if self._end is not None and monotonic() > self._deadline:
                self._end()
            elif not self._acknowledged:
                interrupt_main_thread(number)
