"""Vectors of numbers: float64, or exact rationals as arrays of Fraction objects (infinities and NaN
stay floats).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from math import inf, isfinite, isinf
from typing import Any, Literal, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Bools, Floats, Int32s, Int64s
from symcheck.kernels.rows.shared_objects import group_identical
from symcheck.matrices.rational_functions import RationalFunction

__all__ = [
    "N",
    "Numbers",
    "Rationals",
    "at_sample",
    "distinct",
    "distinct_integers",
    "doubles",
    "full",
    "is_infinite",
    "is_rational",
    "nonzero",
    "numbers",
    "of_pairs",
    "rationals",
    "shared",
    "shared_sum",
    "sum_segments",
]

Numbers = NDArray[Any]
"""float64, or Fractions as objects: numpy has no type for an array of one or the other."""
Rationals = NDArray[np.object_]
N = TypeVar("N", Floats, Rationals)
"""One of the two types, for functions that keep it."""


def is_rational(values: Numbers) -> bool:
    """Whether the numbers are rationals."""
    return values.dtype == object


def rationals(values: Iterable[float | Fraction]) -> Rationals:
    """Numbers of any kind as rationals; a finite float is the binary fraction that it holds."""
    converted = [_rational(v) for v in values]
    out = np.empty(len(converted), dtype=object)
    out[:] = converted
    return out


@overload
def numbers(values: Numbers, *, rational: Literal[True]) -> Rationals: ...
@overload
def numbers(values: Numbers, *, rational: Literal[False]) -> Floats: ...
@overload
def numbers(values: Numbers, *, rational: bool) -> Numbers: ...
def numbers(values: Numbers, *, rational: bool) -> Numbers:
    """An array of bools or numbers as a vector of one of the two types."""
    if rational:
        return rationals(values.tolist())
    return np.asarray(values, dtype=np.float64)


def _rational(value: float | int | Fraction) -> Fraction | float:
    if isinstance(value, Fraction | RationalFunction):
        return value
    return value if isinstance(value, float) and not isfinite(value) else Fraction(value)


@overload
def full(n: int, value: float | Fraction, *, rational: Literal[True]) -> Rationals: ...
@overload
def full(n: int, value: float | Fraction, *, rational: Literal[False]) -> Floats: ...
@overload
def full(n: int, value: float | Fraction, *, rational: bool) -> Numbers: ...
def full(n: int, value: float | Fraction, *, rational: bool) -> Numbers:
    """A vector with one value everywhere, of either type."""
    if not rational:
        return np.full(n, float(value))
    out = np.empty(n, dtype=object)
    out[:] = _rational(value)
    return out


def is_infinite(values: Numbers) -> Bools:
    """Which of the numbers are infinite (either sign)."""
    if is_rational(values):
        objects, codes = shared(values)
        return np.array([isinstance(v, float) and isinf(v) for v in objects], np.bool_)[codes]
    return np.asarray(np.abs(values) == np.inf, dtype=np.bool_)


def nonzero(values: Numbers) -> Bools:
    """Which of the numbers are not 0; each object is compared once."""
    if is_rational(values):
        objects, codes = shared(values)
        return np.array([v != 0 for v in objects], np.bool_)[codes]
    return np.asarray(values != 0)


def shared(values: Numbers) -> tuple[list[Any], Int32s]:
    """The objects of an array, each once, and the number of that of each entry.

    Rationals of a model are mostly shared.
    """
    objects = values.tolist()
    codes, firsts = group_identical(objects)
    return [objects[i] for i in firsts.tolist()], codes


def distinct(values: Numbers) -> list[Any]:
    """The objects of an array, each once."""
    return shared(values)[0]


def shared_sum(one: Numbers, other: Numbers) -> Numbers:
    """The sum of two vectors; the same two rationals are added once."""
    if not (is_rational(one) and is_rational(other)):
        return one + other
    (ones, of_one), (others, of_other) = shared(one), shared(other)
    return of_pairs(lambda i, j: ones[i] + others[j], of_one, of_other, len(others))


def of_pairs(
    make: Callable[[int, int], Any], first: Int32s | Int64s, second: Int32s | Int64s, count: int
) -> Numbers:
    """What is made of pairs of numbers, which equal pairs share.

    Args:
        make: takes a pair.
        first: the first number of each pair, int[n].
        second: the second one, below `count`.
        count: see `second`.
    """
    keys = first.astype(np.int64) * count + second
    pairs = distinct_integers(keys)
    made = np.empty(len(pairs), object)
    made[:] = [make(*divmod(key, count)) for key in pairs.tolist()]
    return np.asarray(made[np.searchsorted(pairs, keys)])


def distinct_integers(values: Int64s) -> Int64s:
    """The distinct integers, ascending; np.unique would import numpy.ma."""
    ordered = np.sort(values)
    return np.asarray(ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]])


def at_sample(values: Rationals) -> Rationals:
    """Rationals and functions of parameters as rationals, at the sample point."""
    return rationals(v.value if isinstance(v, RationalFunction) else v for v in values)


def sum_segments(values: Rationals, starts: Int64s) -> Rationals:
    """The sum of each segment `values[starts[i]:starts[i+1]]` of rationals; 0 where it is empty."""
    out = full(len(starts) - 1, 0, rational=True)
    some = starts[1:] > starts[:-1]
    if some.any():
        out[some] = np.add.reduceat(values, starts[:-1][some])
    return out


def doubles(values: Numbers) -> Floats:
    """The nearest doubles; infinite beyond their range.

    Raises UnsupportedError: a number is a function of parameters.
    """
    if not is_rational(values):
        return np.asarray(values, dtype=np.float64)
    objects, codes = shared(values)
    return np.array([_nearest(v) for v in objects], np.float64)[codes]


def _nearest(value: float | Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf
