"""Values of constants as users give them: `x=1,N=2:4,p=0.1:0.1:0.9,K={2,5}`, or a mapping.

The one parser of such texts: for -const, for `symcheck.load(…, constants=…)`, and for times of
-transient.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Protocol, TypeVar, cast, runtime_checkable

from symcheck.errors import UsageError

V = TypeVar("V")

__all__ = [
    "ConstantValue",
    "GivenConstants",
    "GivenValues",
    "combinations",
    "constant_values",
    "listed_items",
    "parse_constants",
    "typed_value",
    "value_lists",
]

ConstantValue = bool | int | float | Fraction | str
"""A value of a constant; a text is an expression, such as "1/3" or "2*N"."""

GivenConstants = Mapping[str, ConstantValue]
"""One value for each constant."""


GivenValues = Mapping[str, object] | str
"""Values of constants: a text such as "N=3:6,p=0.5", or for each constant a value, a text such as
"1:2:9", or an iterable of values, such as a range, a list or an array."""


@runtime_checkable
class _Array(Protocol):
    """An array of numpy, or one of its scalars."""

    def tolist(self) -> object: ...


def parse_constants(texts: Sequence[str], source: str = "-const") -> dict[str, tuple[str, ...]]:
    """The values of each constant as texts, in the order given.

    A range `low:step:high` is computed in exact decimals: 0.1:0.1:0.9 ends with 0.9.

    Args:
        texts: each some items `NAME=VALUE`, `NAME=LOW:HIGH`, `NAME=LOW:STEP:HIGH` or `NAME={V,W}`,
            with commas between.
        source: where the texts come from, for messages.

    Raises:
        UsageError: an item has another form, a range is empty, or a constant is given twice.
    """
    values: dict[str, tuple[str, ...]] = {}
    for item in itertools.chain.from_iterable(map(listed_items, texts)):
        name, equals, text = (part.strip() for part in item.partition("="))
        if ";" in text or text.startswith("="):
            raise UsageError(
                f"{source}: cannot read '{item}'", hint="constants are given as N=3,p=0.5"
            )
        if not equals or not name or not text:
            raise UsageError(
                f"{source}: '{item}' is not of the form NAME=VALUE, NAME=LOW:HIGH, "
                "NAME=LOW:STEP:HIGH or NAME={V,W}"
            )
        if name in values:
            raise UsageError(f"{source}: {name} is given twice")
        try:
            values[name] = _values(name, text)
        except ValueError as error:
            raise UsageError(f"{source}: {error}") from None
    return values


def constant_values(constants: GivenConstants | str | None) -> GivenConstants:
    """One value for each constant, from a mapping or from a text such as "N=3,p=0.5".

    Raises:
        UsageError: the text cannot be understood, or a constant has several values or none.
    """
    if constants is None:
        return {}
    if isinstance(constants, str):
        parsed = parse_constants([constants], "constants")
        for name, values in parsed.items():
            if len(values) > 1:
                raise _not_one(name, f"{len(values)} values ({', '.join(values)})")
        return {name: values[0] for name, values in parsed.items()}
    if not isinstance(constants, Mapping):
        raise UsageError(
            f"constants: expected a mapping or a text such as 'N=3,p=0.5', not {constants!r}"
        )
    for name, value in cast(Mapping[str, object], constants).items():
        if value is None or (isinstance(value, Iterable) and not isinstance(value, str)):
            raise _not_one(name, repr(value))
    return constants


def value_lists(constants: GivenValues | None) -> dict[str, tuple[ConstantValue, ...]]:
    """The values of each constant, without repetitions, in the order given.

    Raises:
        UsageError: a text cannot be understood, a constant has no value, or one of another type.
    """
    match constants:
        case None:
            return {}
        case str():
            return dict(parse_constants([constants], "constants"))
        case Mapping():
            return {name: _value_list(name, given) for name, given in constants.items()}
        case _:
            raise UsageError(
                f"constants: expected a mapping or a text such as 'N=3:6,p=0.5', not {constants!r}"
            )


def _value_list(name: str, given: object) -> tuple[ConstantValue, ...]:
    if isinstance(given, _Array):
        given = given.tolist()
    if isinstance(given, str):
        try:
            return _values(name, given)
        except ValueError as error:
            raise UsageError(f"constants: {error}") from None
    values = list(given) if isinstance(given, Iterable) else [given]
    checked: list[ConstantValue] = []
    for value in values:
        value = value.tolist() if isinstance(value, _Array) else value
        if not isinstance(value, ConstantValue):
            raise UsageError(
                f"constants: {name} is given {value!r}; expected a bool, a number or a text"
            )
        checked.append(value)
    if not checked:
        raise UsageError(f"constants: {name} has no value")
    return tuple(dict.fromkeys(checked))


def typed_value(value: ConstantValue) -> ConstantValue:
    """The value that a text denotes: a bool, an int, a float or a Fraction.

    Another text, such as "2*N", stays as it is.
    """
    if not isinstance(value, str):
        return value
    if value in ("true", "false"):
        return value == "true"
    readers: tuple[Callable[[str], ConstantValue], ...] = (int, float, Fraction)
    for read in readers:
        try:
            return read(value)
        except (ValueError, ZeroDivisionError):
            continue
    return value


def _not_one(name: str, given: str) -> UsageError:
    return UsageError(
        f"constants: {name} is given {given}, and one value is expected",
        hint="symcheck.experiment checks a model for many values",
    )


def combinations(values: Mapping[str, Sequence[V]]) -> Iterator[dict[str, V]]:
    """Every combination of one value for each constant; the last constant changes fastest."""
    for choice in itertools.product(*values.values()):
        yield dict(zip(values, choice, strict=True))


def parameter_ranges(
    parameters: Mapping[str, tuple[object, object]] | Iterable[str], source: str = "parametric"
) -> dict[str, tuple[Fraction, Fraction]]:
    """The ranges of parameters, from a mapping, names, or a text such as "p=0.1:0.9,q" (q=0:1).

    Raises UsageError.
    """
    try:
        given: list[tuple[str, Sequence[object]]]
        if isinstance(parameters, Mapping):
            given = [(name, list(ends)) for name, ends in parameters.items()]
        else:
            texts = listed_items(parameters) if isinstance(parameters, str) else parameters
            items = (text.partition("=") for text in texts)
            given = [(n.strip(), ends.split(":") if sign else (0, 1)) for n, sign, ends in items]
        ranges = {n: (Fraction(str(low)), Fraction(str(high))) for n, (low, high) in given}
        if "" in ranges or len(ranges) < len(given):
            raise ValueError("a name is missing or repeated")
    except (ValueError, TypeError, AttributeError, ZeroDivisionError):
        raise UsageError(
            f"{source}: {parameters!r} is not NAME=LOW:HIGH,…", hint="such as p=0.1:0.9,q"
        ) from None
    empty = [name for name, (low, high) in ranges.items() if not low < high]
    if empty or not ranges:
        raise UsageError(f"{source}: the range of {empty or 'parameters'} is empty")
    return ranges


def listed_items(text: str) -> Iterator[str]:
    """The parts between the commas outside of brackets."""
    depth, start = 0, 0
    for i, c in enumerate(text):
        depth += (c in "({") - (c in ")}")
        if c == "," and depth == 0:
            yield text[start:i]
            start = i + 1
    if text[start:].strip():
        yield text[start:]


def _values(name: str, text: str) -> tuple[str, ...]:
    """The values of a constant. Raises ValueError."""
    if text.startswith("{") and text.endswith("}"):
        values = tuple(part.strip() for part in text[1:-1].split(",") if part.strip())
        if not values:
            raise ValueError(f"the list of values of {name} is empty")
        return values
    if text.startswith("{") or text.endswith("}"):
        raise ValueError(f"'{name}={text}' lacks a bracket: a list is written as {{V,W}}")
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1:
        return (text,)
    if len(parts) > 3:
        raise ValueError(f"'{name}={text}' has more than LOW:STEP:HIGH")
    try:
        numbers = [Fraction(part) for part in parts]
    except (ValueError, ZeroDivisionError):
        raise ValueError(f"the range '{name}={text}' needs plain numbers") from None
    low, high = numbers[0], numbers[-1]
    step = numbers[1] if len(numbers) == 3 else Fraction(1)
    if step <= 0:
        raise ValueError(f"the step of the range '{name}={text}' is not above 0")
    if high < low:
        raise ValueError(f"the range '{name}={text}' is empty")
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
    # A fraction without a finite decimal expansion stays a fraction.
    return repr(float(value)) if denominator == 1 else f"{value.numerator}/{value.denominator}"
