"""Recursion over expressions of any depth."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

__all__ = ["with_deep_recursion"]

P = ParamSpec("P")
T = TypeVar("T")
_LIMIT = 400_000


def with_deep_recursion(f: Callable[P, T]) -> Callable[P, T]:
    """The function, which is called again with a higher limit if it raises RecursionError.

    This is safe for recursion in plain Python, which does not use the C stack since Python 3.11.
    """

    @wraps(f)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return f(*args, **kwargs)
        except RecursionError:
            old = sys.getrecursionlimit()
            if old >= _LIMIT:
                raise
            sys.setrecursionlimit(_LIMIT)
            try:
                return f(*args, **kwargs)
            finally:
                sys.setrecursionlimit(old)

    return call
