"""Calls of the operating system that only POSIX has, each with a twin for Windows.

The rest of symcheck uses what Python has everywhere. A twin is chosen when this module is imported,
by what the modules of Python offer. psutil serves Windows only: elsewhere a line of Python does the
same, without the ten milliseconds of its import, and it knows neither control groups nor alarms.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess

__all__ = [
    "ALARM",
    "CAN_FORK",
    "NO_LIMIT",
    "SignalChannel",
    "can_repeat_alarm",
    "end_with_children",
    "interrupt_blocked",
    "interrupt_main_thread",
    "limits_of_memory",
    "lock_file",
    "physical_memory",
    "processors",
    "set_alarm",
    "set_limit_of_data",
]

NO_LIMIT = sys.maxsize
"""What stands for a limit that is not set."""

ALARM: signal.Signals = getattr(signal, "SIGALRM", signal.SIGTERM)
"""The signal of the time limit. On Windows no other process can send SIGTERM, so it is free."""

CAN_FORK = hasattr(os, "fork")
"""Whether a process can be copied."""


class _Timer:
    """The time limit where there is no interval timer: a thread that waits."""

    thread: threading.Timer | None = None

    def start(self, seconds: float) -> None:
        if self.thread is not None:
            self.thread.cancel()
            self.thread = None
        if seconds > 0:
            self.thread = threading.Timer(seconds, interrupt_main, (ALARM,))
            self.thread.daemon = True
            self.thread.start()


_TIMER = _Timer()


def can_repeat_alarm() -> bool:
    """Whether `set_alarm` repeats ALARM."""
    return hasattr(signal, "setitimer")


def set_alarm(seconds: float, interval: float = 0.0) -> None:
    """Send ALARM to this process after so many seconds; 0: do not.

    Args:
        seconds: the time until then; 0: never.
        interval: seconds after which it is repeated; 0: it is not.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds, interval)
    else:
        _TIMER.start(seconds)


def interrupt_main_thread(number: int) -> None:
    """Send a signal to the main thread, which also ends a system call of it on POSIX."""
    if hasattr(signal, "pthread_kill"):
        ident = threading.main_thread().ident
        assert ident is not None
        signal.pthread_kill(ident, number)
    else:
        interrupt_main(signal.Signals(number))


@contextmanager
def interrupt_blocked() -> Iterator[None]:
    """A context whose new processes do not receive Ctrl-C, where this can be inherited."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


class SignalChannel:
    """Numbers of signals, which Python writes as they arrive and a thread reads.

    Windows can wait for sockets only, and needs longer to import them.
    """

    def __init__(self) -> None:
        if hasattr(signal, "pthread_kill"):
            self._reader, self._writer = os.pipe()
            os.set_blocking(self._writer, False)
            self._ends = None
        else:
            import socket

            self._ends = socket.socketpair()
            self._ends[1].setblocking(False)
            self._reader, self._writer = (end.fileno() for end in self._ends)
        self._previous = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)

    def wait(self, seconds: float) -> int:
        """The signal that arrives within so many seconds, or 0."""
        ready, _, _ = select.select([self._reader], [], [], seconds)
        if not ready:
            return 0
        return (os.read(self._reader, 1) if self._ends is None else self._ends[0].recv(1))[0]

    def wake(self) -> None:
        """Let the thread read a 0, and Python write elsewhere again."""
        signal.set_wakeup_fd(self._previous)
        if self._ends is None:
            os.write(self._writer, b"\0")
        else:
            self._ends[1].send(b"\0")

    def close(self) -> None:
        """Close both ends."""
        if self._ends is None:
            os.close(self._reader)
            os.close(self._writer)
        else:
            for end in self._ends:
                end.close()


def end_with_children(process: subprocess.Popen[str]) -> None:
    """End a process that was started in a session of its own, and on POSIX its children."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def lock_file(file: int) -> None:
    """Lock an open file for this process alone. Raises OSError if another one has locked it."""
    try:
        import fcntl
    except ImportError:
        pass
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return
    with suppress(ImportError):  # neither: files are not locked
        import msvcrt

        # A byte far behind the end: locked bytes cannot be read on Windows.
        at = os.lseek(file, 0, os.SEEK_CUR)
        os.lseek(file, 1 << 40, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        finally:
            os.lseek(file, at, os.SEEK_SET)


def processors() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def physical_memory() -> int:
    """Bytes of memory of the machine; on Windows of what is free."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    import psutil

    return int(psutil.virtual_memory().available)


def limits_of_memory() -> tuple[int, int]:
    """The limits of the process, in bytes: of its addresses and of its data."""
    try:
        import resource
    except ImportError:
        return NO_LIMIT, NO_LIMIT
    address, data = (
        resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)
    )
    return (
        NO_LIMIT if address == resource.RLIM_INFINITY else address,
        NO_LIMIT if data == resource.RLIM_INFINITY else data,
    )


def set_limit_of_data(size: int) -> None:
    """Let an allocation fail that would give the process more bytes of data than this.

    A stricter limit stays. Nothing happens where a process cannot be limited: on Windows, and on
    macOS, whose kernel does not keep the limit.
    """
    try:
        import resource
    except ImportError:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if all(size < bound for bound in (soft, hard) if bound != resource.RLIM_INFINITY):
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_DATA, (size, hard))
