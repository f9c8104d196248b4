"""A certificate: what is stated of a value, and its proof."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf
from typing import Any

from symcheck.engines.base import Engine, Number

__all__ = ["Certificate"]


@dataclass(frozen=True, eq=False, repr=False)
class Certificate:
    """A statement about the values of a property, and its proof.

    Attributes:
        model: the model that it is about, in rational arithmetic.
        formula: the text of the property.
        statement: what is stated: the measure, and bounds of its value in each initial state.
        evidence: the vectors, strategies and ranks that prove the lower and the upper bounds.

    States have the numbers of exported files.
    """

    model: Engine = field(repr=False)
    formula: str
    statement: Mapping[str, Any]
    evidence: Mapping[str, Any]

    def __repr__(self) -> str:
        return f"<Certificate of {self.formula}: {self.bounds}>"

    @property
    def bounds(self) -> Mapping[int, tuple[Number, Number]]:
        """The bounds of the value in each initial state, as rationals."""
        return {
            int(state): (_read_number(low), _read_number(high))
            for state, (low, high) in self.statement["bounds"].items()
        }


def _read_number(text: str) -> Number:
    return inf if text == "Infinity" else Fraction(text)
