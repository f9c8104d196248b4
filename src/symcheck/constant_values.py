"""`x=1,N=2:4,p=0.1:0.1:0.9,K={2,5}`: values to try, for each constant."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from symcheck.errors import UsageError

__all__ = ["combinations", "parse_constants"]


def parse_constants(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """For each constant, the values as text, in the order given. Raises UsageError.

    A range `low:step:high` is computed in exact decimals, so that 0.1:0.1:0.9 ends with 0.9.
    """
    values: dict[str, tuple[str, ...]] = {}
    for item in itertools.chain.from_iterable(map(_split, texts)):
        name, equals, text = (part.strip() for part in item.partition("="))
        if not equals or not name or not text:
            raise UsageError(
                f"-const: '{item}' is not of the form NAME=VALUE, NAME=LOW:HIGH, NAME=LOW:STEP:HIGH or NAME={{V,W}}"
            )
        if name in values:
            raise UsageError(f"-const: {name} is given twice")
        values[name] = _values(name, text)
    return values


def combinations(values: Mapping[str, Sequence[str]]) -> Iterator[dict[str, str]]:
    """Every choice of one value each, the last constant changing fastest."""
    for choice in itertools.product(*values.values()):
        yield dict(zip(values, choice, strict=True))


def _split(text: str) -> Iterator[str]:
    """The parts between the commas that stand outside of any brackets."""
    depth, start = 0, 0
    for i, c in enumerate(text):
        depth += (c in "({") - (c in ")}")
        if c == "," and depth == 0:
            yield text[start:i]
            start = i + 1
    if text[start:].strip():
        yield text[start:]


def _values(name: str, text: str) -> tuple[str, ...]:
    if text.startswith("{") and text.endswith("}"):
        values = tuple(part.strip() for part in text[1:-1].split(",") if part.strip())
        if not values:
            raise UsageError(f"-const: the list of values of {name} is empty")
        return values
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1:
        return (text,)
    if len(parts) > 3:
        raise UsageError(f"-const: '{name}={text}' has more than LOW:STEP:HIGH")
    try:
        numbers = [Fraction(part) for part in parts]
    except (ValueError, ZeroDivisionError):
        raise UsageError(f"-const: the range '{name}={text}' needs plain numbers") from None
    low, high = numbers[0], numbers[-1]
    step = numbers[1] if len(numbers) == 3 else Fraction(1)
    if step <= 0 or high < low:
        raise UsageError(f"-const: the range '{name}={text}' is empty")
    integral = all(n.denominator == 1 for n in (low, step)) and not any(
        "." in part or "e" in part.lower() for part in parts
    )
    count = (high - low) // step + 1
    return tuple(_decimal(low + i * step, integral) for i in range(count))


def _decimal(value: Fraction, integral: bool) -> str:
    if integral:
        return str(int(value))
    denominator = value.denominator
    for prime in (2, 5):
        while denominator % prime == 0:
            denominator //= prime
    # A fraction that no finite decimal writes stays a fraction.
    return repr(float(value)) if denominator == 1 else f"{value.numerator}/{value.denominator}"
