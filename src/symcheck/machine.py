"""What this process may have of the machine."""

from __future__ import annotations

import os
from collections.abc import Sequence

__all__ = ["memory"]

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Where a container's limit stands, in the second and the first version of control groups."""


def memory(limits: Sequence[str] = _LIMITS) -> int:
    """Bytes of memory that this process may have: the machine's, or what a container leaves of them."""
    found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for name in limits:
        try:
            with open(name, encoding="ascii") as file:
                found = min(found, int(file.read()))
        except (OSError, ValueError):  # there is no such file, or it says that there is no limit
            pass
    return found
