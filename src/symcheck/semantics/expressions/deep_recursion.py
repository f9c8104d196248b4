"""Recursion over expressions of any depth."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TypeVar

__all__ = ["deeply"]

T = TypeVar("T")
_LIMIT = 400_000


def deeply(f: Callable[[], T]) -> T:
    """The result of f(); where Python's recursion limit is too low for it, f is called again with a much higher one.

    Since Python 3.11, calls from Python to Python do not use the C stack, so that this is safe for plain recursion.
    """
    try:
        return f()
    except RecursionError:
        old = sys.getrecursionlimit()
        if old >= _LIMIT:
            raise
        sys.setrecursionlimit(_LIMIT)
        try:
            return f()
        finally:
            sys.setrecursionlimit(old)
