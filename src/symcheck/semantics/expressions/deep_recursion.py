"""Recursion over expressions of any depth."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TypeVar

__all__ = ["with_deep_recursion"]

T = TypeVar("T")
_LIMIT = 400_000


def with_deep_recursion(f: Callable[[], T]) -> T:
    """The result of f(), which is called again with a higher limit if it raises RecursionError.

    This is safe for recursion in plain Python, which does not use the C stack since Python 3.11.
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
