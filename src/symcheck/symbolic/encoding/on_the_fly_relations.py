"""Learned relations: an expression that reads too many valuations is encoded only for those that are reached.

Before an event's image of a frontier is taken, the frontier is projected onto the variables that such an expression
reads; valuations not seen before are enumerated, the expression is evaluated on them (vectorised), and exactly these
rows join its diagram. So the work is in the valuations reached, not in the domain's product. After Blom, van de Pol &
Weber (2010), "LTSmin: distributed and symbolic reachability" (partitioned next-state functions), here for values,
probabilities and guards alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import UnsupportedError
from symcheck.semantics.expressions.vectorised import Column, Lanes, evaluate_columns
from symcheck.symbolic.encoding.enumerate_states import minterms
from symcheck.symbolic.encoding.variables import EncodedVariable, Encoding
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd

__all__ = ["Learned", "LearnedAssignment", "LearnedBoolean", "LearnedNumber"]


MAX_VALUATIONS = 20_000_000  # of one expression, found at once: 1 GB while they are evaluated


class Learned:
    """What is known of one expression: `known` holds the valuations (row bits of `variables`) evaluated so far.

    `evaluated` counts them. Subclasses keep the diagram that grows with them.
    """

    def __init__(
        self,
        manager: DiagramManager,
        encoding: Encoding,
        names: Iterable[str],
        expression: Expression,
    ) -> None:
        self.manager = manager
        self.expression = expression
        self.variables = encoding.sorted(names)
        self.bits = tuple(bit for v in self.variables for bit in v.rows)
        self.others = manager.cube([bit for bit in encoding.rows if bit not in set(self.bits)])
        self.known: Bdd = manager.false
        self.faults: Bdd = manager.false
        self.evaluated = 0

    def extend(self, states: Bdd) -> bool:
        """Evaluate the expression on what `states` has of unseen valuations. True if there were any."""
        unseen = states.exists(self.others) - self.known
        if not unseen:
            return False
        if self.manager.count(unseen, self.bits) > MAX_VALUATIONS:
            raise UnsupportedError(
                f"an expression would have to be evaluated for {self.manager.count(unseen, self.bits)} valuations of the "
                f"{len(self.variables)} variables that it reads ({self.expression.span}): use the explicit engine (-ex)"
            )
        rows = minterms(self.manager, unseen, self.bits)
        lanes = evaluate_columns(self.expression, columns_of(self.variables, rows)).spread(
            rows.shape[:1]
        )
        if lanes.faults is not None:
            self.faults = self.faults | self.manager.bdd_from_rows(self.bits, rows[lanes.faults])
        self.add(rows, lanes)
        self.known = self.known | unseen
        self.evaluated += rows.shape[0]
        return True

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """Add the value of the expression on each row (minterms over `bits`, lexicographic)."""
        raise NotImplementedError


class LearnedBoolean(Learned):
    """A condition; `holds` is right on known valuations and false elsewhere."""

    def __init__(
        self,
        manager: DiagramManager,
        encoding: Encoding,
        names: Iterable[str],
        expression: Expression,
    ) -> None:
        super().__init__(manager, encoding, names, expression)
        self.holds: Bdd = manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `Learned.add`."""
        self.holds = self.holds | self.manager.bdd_from_rows(
            self.bits, rows[lanes.values.astype(np.bool_)]
        )


class LearnedNumber(Learned):
    """A number; `value` is right on known valuations and 0 elsewhere (and where it is `undefined`)."""

    def __init__(
        self,
        manager: DiagramManager,
        encoding: Encoding,
        names: Iterable[str],
        expression: Expression,
    ) -> None:
        super().__init__(manager, encoding, names, expression)
        self.value: Mtbdd = manager.zero
        self.undefined: Bdd = manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `Learned.add`."""
        numbers = lanes.numbers()
        nan = np.isnan(numbers)
        if nan.any():
            self.undefined = self.undefined | self.manager.bdd_from_rows(self.bits, rows[nan])
        self.value = self.value + self.manager.mtbdd_from_rows(
            self.bits, rows, np.where(nan, 0.0, numbers)
        )


class LearnedAssignment(Learned):
    """`target' = expression`; `relation` and `in_range` hold known valuations only."""

    def __init__(
        self,
        manager: DiagramManager,
        encoding: Encoding,
        names: Iterable[str],
        expression: Expression,
        target: EncodedVariable,
    ) -> None:
        super().__init__(manager, encoding, names, expression)
        self.target = target
        self.relation: Bdd = manager.false
        self.in_range: Bdd = manager.false

    def add(self, rows: NDArray[np.uint8], lanes: Lanes) -> None:
        """See `Learned.add`."""
        codes, valid = code_values(self.target, lanes)
        shifts = np.arange(self.target.width - 1, -1, -1)
        code_bits = (codes[:, None] >> shifts & 1).astype(np.uint8)
        moves = np.concatenate([rows, code_bits], axis=1)[valid]
        self.relation = self.relation | self.manager.bdd_from_rows(
            (*self.bits, *self.target.columns), moves
        )
        self.in_range = self.in_range | self.manager.bdd_from_rows(self.bits, rows[valid])


def columns_of(variables: Sequence[EncodedVariable], bits: NDArray[np.uint8]) -> dict[str, Column]:
    """Values from minterms: bit columns of the variables one after the other, most significant bit first."""
    columns: dict[str, Column] = {}
    start = 0
    for v in variables:
        code = np.zeros(bits.shape[0], dtype=np.int64)
        for position in range(start, start + v.width):
            code = 2 * code + bits[:, position]
        columns[v.name] = code.astype(np.bool_) if v.is_bool else v.low + code
        start += v.width
    return columns


def code_values(
    target: EncodedVariable, lanes: Lanes
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Codes of values assigned to `target`, and which values are in its range (the code is 0 where not)."""
    whole = lanes.values.astype(np.int64)
    valid = (whole >= target.low) & (whole <= target.high)
    if lanes.faults is not None:
        valid &= ~lanes.faults
    return np.where(valid, whole - target.low, 0), valid
