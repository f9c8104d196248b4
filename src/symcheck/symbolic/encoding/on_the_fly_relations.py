"""Expressions that are encoded on the fly: those that read too many valuations to be encoded in
full.

Before the image of a frontier is taken, the frontier is projected onto the variables that such an
expression reads. New valuations are enumerated, the expression is evaluated on them (vectorised),
and these rows are added to its diagram. So the work grows with the valuations that are reached, not
with the product of the domains.

Source: Blom, van de Pol and Weber (2010), LTSmin: distributed and symbolic reachability
(partitioned next-state functions); here for values, probabilities and guards.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.odd import Odd
from symcheck.errors import UnsupportedError
from symcheck.semantics.expressions.vectorised import Lanes, evaluate_columns
from symcheck.symbolic import tuning
from symcheck.symbolic.encoding.variables import EncodedVariable, Encoding, decode
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd

__all__ = ["OnTheFly", "OnTheFlyAssignment", "OnTheFlyCondition", "OnTheFlyNumber"]


@dataclass(eq=False)
class OnTheFly:
    """An expression and the diagram of its values on the valuations evaluated so far; subclasses
    hold the diagram.

    Args:
        names: the variables that the expression reads.

    Attributes:
        known: the valuations evaluated so far, over the row bits of `variables`.
        evaluated: their number.
        faults: those of them where the expression has no value.
    """

    manager: DiagramManager
    encoding: Encoding
    names: Iterable[str]
    expression: Expression
    evaluated: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.variables = self.encoding.sorted(self.names)
        self.bits = tuple(bit for v in self.variables for bit in v.rows)
        bits = set(self.bits)
        self.others = self.manager.cube([bit for bit in self.encoding.rows if bit not in bits])
        self.known: Bdd = self.manager.false
        self.faults: Bdd = self.manager.false

    def extend(self, states: Bdd) -> bool:
        """Evaluate the expression on the new valuations in `states`; whether there were any.

        Raises UnsupportedError where there are too many at once.
        """
        new = states.exists(self.others) - self.known
        if not new:
            return False
        odd = Odd(self.manager, new, self.bits)
        if odd.count > tuning.MAX_VALUATIONS:
            raise UnsupportedError(
                f"an expression would have to be evaluated for {odd.count} valuations of the "
                f"{len(self.variables)} variables that it reads ({self.expression.span}): "
                "use the explicit engine (-ex)"
            )
        rows = odd.unrank(np.arange(odd.count))
        lanes = evaluate_columns(self.expression, decode(self.variables, rows)).spread(
            rows.shape[:1]
        )
        if lanes.faults is not None:
            self.faults = self.faults | self.manager.bdd_from_rows(self.bits, rows[lanes.faults])
        self.add(rows, lanes)
        self.known = self.known | new
        self.evaluated += rows.shape[0]
        return True

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """Add the values of the expression to the diagram.

        rows: uint8[n, bits], lexicographic; lanes: n values.
        """
        raise NotImplementedError


@dataclass(eq=False)
class OnTheFlyCondition(OnTheFly):
    """A condition; `holds` is right on known valuations and false elsewhere."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.holds: Bdd = self.manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `OnTheFly.add`."""
        self.holds = self.holds | self.manager.bdd_from_rows(
            self.bits, rows[lanes.values.astype(np.bool_)]
        )


@dataclass(eq=False)
class OnTheFlyNumber(OnTheFly):
    """A number; `value` is right on known valuations, and 0 elsewhere and where `undefined`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.value: Mtbdd = self.manager.zero
        self.undefined: Bdd = self.manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `OnTheFly.add`."""
        numbers = lanes.numbers()
        nan = np.isnan(numbers)
        if nan.any():
            self.undefined = self.undefined | self.manager.bdd_from_rows(self.bits, rows[nan])
        self.value = self.value + self.manager.mtbdd_from_rows(
            self.bits, rows, np.where(nan, 0.0, numbers)
        )


@dataclass(eq=False)
class OnTheFlyAssignment(OnTheFly):
    """An assignment to `target`; `relation` and `in_range` hold known valuations only."""

    target: EncodedVariable

    def __post_init__(self) -> None:
        super().__post_init__()
        self.relation: Bdd = self.manager.false
        self.in_range: Bdd = self.manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `OnTheFly.add`."""
        codes, valid = code_values(self.target, lanes)
        shifts = np.arange(self.target.width - 1, -1, -1)
        code_bits = (codes[:, None] >> shifts & 1).astype(np.uint8)
        moves = np.concatenate([rows, code_bits], axis=1)[valid]
        self.relation = self.relation | self.manager.bdd_from_rows(
            (*self.bits, *self.target.columns), moves
        )
        self.in_range = self.in_range | self.manager.bdd_from_rows(self.bits, rows[valid])


def code_values(
    target: EncodedVariable, lanes: Lanes
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Codes of values assigned to `target` (0 where out of range), and which values are in its
    range.
    """
    whole = lanes.values.astype(np.int64)
    valid = (whole >= target.low) & (whole <= target.high)
    if lanes.faults is not None:
        valid &= ~lanes.faults
    return np.where(valid, whole - target.low, 0), valid
