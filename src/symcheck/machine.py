"""The memory that this process may use."""

from __future__ import annotations

import os
from collections.abc import Sequence

__all__ = ["memory"]

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files with the limit of a container, in the second and first version of control groups."""


def memory(limits: Sequence[str] = _LIMITS) -> int:
    """Bytes of memory that this process may use: those of the machine, or the limit of its
    container.
    """
    size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for name in limits:
        try:
            with open(name, encoding="ascii") as file:
                size = min(size, int(file.read()))
        except (OSError, ValueError):  # no such file, or no limit in it
            pass
    return size
