"""The memory that this process may still take."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from symcheck.operating_system import (
    limits_of_memory,
    physical_memory,
    set_limit_of_data,
)

__all__ = [
    "FREE_MEMORY",
    "available_memory",
    "below_limit",
    "imports_fit",
    "limit_memory",
    "memory_ended",
    "read_bytes",
    "require_memory_for_scipy",
    "used_data",
]

FREE_MEMORY = "SYMCHECK_MEMORY"
"""The environment variable with the amount that counts as free, instead of what is measured."""

_WORDS = (
    "failed to map segment",
    "cannot map zero-fill pages",
    "annot allocate memory",
    "can't allocate",
    "can't start new thread",
)
"""What the loader of libraries, the system and Python say when memory ends."""

_FOR_IMPORTS = (112 << 20, 60 << 20)
"""Bytes of address space (RLIMIT_AS) and of data (RLIMIT_DATA) that the modules of a run take, and
a tenth more."""

_FOR_SCIPY = (144 << 20, 72 << 20)
"""The same for scipy's modules, the first time that one of them is imported."""

_UNITS = {"": 1 << 10, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30}


def read_bytes(text: str) -> int:
    """Bytes from PRISM's notation: 512m, 4g, 100k, or a plain number of kilobytes.

    Raises ValueError.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmg]?)b?", text.lower())
    if match is None:
        raise ValueError(f"'{text}' is not an amount of memory such as 512m or 4g")
    return int(float(match[1]) * _UNITS[match[2]])


def available_memory(root: str = "/") -> int:
    """Bytes that this process may still take, without being killed for it.

    That is the least of what is free on the machine, in each of its control groups (version 1 or
    2), and below the limits of the process. The environment variable SYMCHECK_MEMORY replaces the
    first two.

    Args:
        root: the folder with `proc` and `sys`.
    """
    given = os.environ.get(FREE_MEMORY)
    try:
        free = [] if given is None else [read_bytes(given)]
    except ValueError:  # a message would have no reader here
        free = []
    free = free or [_free_on_machine(Path(root)), *_free_in_groups(Path(root))]
    return max(0, min([*free, *_below_limits()]))


def limit_memory(size: int) -> None:
    """Let an allocation that would exceed so many more bytes fail, which is a MemoryError.

    A stricter limit of the process stays. Without this limit the kernel would kill the process,
    because it grants more memory than there is.
    """
    set_limit_of_data(_pages()[1] + size)


def used_data() -> int:
    """Bytes of data that the process has."""
    return _pages()[1]


def _free_on_machine(root: Path) -> int:
    """The kernel's estimate of what can be allocated without swapping."""
    match = re.search(r"^MemAvailable:\s+(\d+) kB", _text(root / "proc/meminfo"), re.MULTILINE)
    if match is None:
        return physical_memory()
    return int(match[1]) << 10


def _free_in_groups(root: Path) -> Iterator[int]:
    """What is free in each control group with a limit; file caches give way to data.

    The path of a group leads out of a container: only the folders that are visible count.
    """
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        mount = root / ("sys/fs/cgroup/memory" if controllers else "sys/fs/cgroup")
        group = Path(path.lstrip("/"))
        limit, used, cache = (
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
            if controllers
            else ("memory.max", "memory.current", "inactive_file")
        )
        for folder in (mount / group, *(mount / parent for parent in group.parents)):
            bound, taken = _text(folder / limit), _text(folder / used)
            if bound.strip().isdecimal() and taken.strip().isdecimal():
                match = re.search(rf"^{cache} (\d+)$", _text(folder / "memory.stat"), re.MULTILINE)
                yield int(bound) - int(taken) + (int(match[1]) if match else 0)


def _below_limits() -> tuple[int, int]:
    """Bytes that the limits of the process leave: of its addresses, and of its data."""
    (addresses, data), (taken, taken_data) = limits_of_memory(), _pages()
    return addresses - taken, data - taken_data


def below_limit() -> int:
    """Bytes that the process may still allocate below its limits of address space and of data."""
    return min(_below_limits())


def imports_fit() -> bool:
    """Whether the limits of the process leave enough for the modules of a run.

    With less, numpy's BLAS would end the process or never return, and Python's modules would
    print tracebacks.
    """
    return _fits(_FOR_IMPORTS)


def require_memory_for_scipy() -> None:
    """Raise MemoryError if the limits leave too little to import scipy's modules.

    Their BLAS would wait for memory without end, and no signal but SIGKILL would end the process.
    """
    if not {"scipy.linalg", "scipy.special"} & sys.modules.keys() and not _fits(_FOR_SCIPY):
        raise MemoryError("the modules of scipy")


def _fits(size: tuple[int, int]) -> bool:
    return all(left >= needed for left, needed in zip(_below_limits(), size, strict=True))


def memory_ended(error: BaseException) -> bool:
    """Whether an error means that memory ended: libraries and threads raise other exceptions."""
    match error:
        case MemoryError() | OSError(errno=errno.ENOMEM):
            return True
        case ImportError() | RuntimeError() if any(words in str(error) for words in _WORDS):
            return True
        case SystemError() if "without" in str(error) and "exception" in str(error):
            return True  # CPython has lost the MemoryError
        case _:
            return error.__context__ is not None and memory_ended(error.__context__)


def _pages() -> tuple[int, int]:
    """Bytes of addresses and of data that the process has; 0 where Linux does not tell them."""
    fields = _text(Path("/proc/self/statm")).split()
    if not fields:
        return 0, 0
    size = os.sysconf("SC_PAGE_SIZE")
    return int(fields[0]) * size, int(fields[5]) * size


def _text(path: Path) -> str:
    try:
        with path.open("rb", buffering=0) as file:  # a buffer would need memory, and a lock
            return file.read().decode("ascii")
    except (OSError, UnicodeDecodeError):
        return ""
