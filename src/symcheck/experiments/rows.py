"""The rows of an experiment: one for each property and combination of constants."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction

from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Accuracy, Answer, Estimate, Result, show_value
from symcheck.constant_values import ConstantValue, GivenConstants, typed_value
from symcheck.engines.base import bracket
from symcheck.errors import SymcheckError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.semantics.expressions.literals import format_value, to_float

__all__ = ["Row", "answered", "constant_names", "constant_text", "error_text", "records", "row_of"]


@dataclass(frozen=True, slots=True)
class Row:
    """One result, or the error in its place.

    Attributes:
        name: that of the property, or its text if it has none.
        constants: the given values of the constants of the model, and of those constants of the
            properties on which this property depends.
        value: as in `Result`; None if there is an error.
        accuracy: how close the value is to the true one; None if there is an error.
        error: why there is no value; None if there is one.
        states, transitions: size of the built model; 0 if it was not built.
        build_seconds: elapsed time of building the model, which its properties share.
        seconds: elapsed time of checking the property.
        formula: text of the property.
    """

    name: str
    constants: Mapping[str, ConstantValue]
    value: Answer = None
    accuracy: Accuracy | None = None
    error: str | None = None
    states: int = 0
    transitions: int = 0
    build_seconds: float = 0.0
    seconds: float = 0.0
    formula: str = field(default="", compare=False)

    @property
    def number(self) -> float | None:
        """The value as a float: true is 1, of several initial states the midpoint."""
        match self.value:
            case bool() | int() | float() | Fraction():
                return to_float(self.value)
            case (RationalFunction(), _) | (_, RationalFunction()):
                return None
            case tuple((low, high)):
                return (to_float(low) + to_float(high)) / 2
            case _:
                return None

    @property
    def bounds(self) -> tuple[float, float] | None:
        """Lower and upper bound of a number; None if its error is unknown, or for other values."""
        try:
            low, high = Result(self.value, self.accuracy or Estimate()).bounds
        except (TypeError, UnsupportedError):
            return None
        return bracket(low)[0], bracket(high)[1]

    @property
    def text(self) -> str:
        """The value as text, or 'Error'."""
        return "Error" if self.error is not None else show_value(self.value)


def constant_text(value: ConstantValue) -> str:
    """The value of a constant as text."""
    return value if isinstance(value, str) else format_value(value)


def constant_names(rows: Iterable[Row]) -> list[str]:
    """The constants that have a value in some row."""
    return list(dict.fromkeys(n for r in rows for n in r.constants))


def records(rows: Iterable[Row]) -> list[dict[str, object]]:
    """The rows as dicts with the same keys: property, each constant, value, and the others.

    A constant with the name of another column is called 'constant NAME'.
    """
    rows = list(rows)
    names = constant_names(rows)
    return [_record(r, names) for r in rows]


def _record(row: Row, names: Sequence[str]) -> dict[str, object]:
    lower, upper = row.bounds or (None, None)
    others: dict[str, object] = {
        "value": row.value,
        "lower": lower,
        "upper": upper,
        "accuracy": None if row.accuracy is None else str(row.accuracy),
        "states": row.states,
        "transitions": row.transitions,
        "build_seconds": row.build_seconds,
        "seconds": row.seconds,
        "error": row.error,
    }
    constants = {
        f"constant {n}" if n in others or n == "property" else n: row.constants.get(n)
        for n in names
    }
    return {"property": row.name, **constants, **others}


def row_of(property: PropertyInstance, constants: GivenConstants) -> Row:
    """The row of a property before it is checked."""
    given = {**constants, **property.relevant}
    typed = {n: typed_value(v) for n, v in given.items()}
    return Row(property.title, typed, formula=property.text)


def answered(row: Row, result: Result) -> Row:
    """The row with the value of a result; one that differs by regions is an error that says it."""
    regions = result.regions_or_none
    if result.value is None and regions is not None:
        error = f"the value differs by regions: {regions.summary}"
        return replace(row, error=error, seconds=result.seconds)
    return replace(row, value=result.value, accuracy=result.accuracy, seconds=result.seconds)


def error_text(error: Exception) -> str:
    """The first line of an error; a defect of symcheck is called one."""
    if isinstance(error, SymcheckError):
        return str(error).splitlines()[0]
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    return f"internal error: {type(error).__name__}: {error}"
