"""Checking a formula on the quotient by strong bisimulation, which keeps what the formula speaks of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.check.context import Context
from symcheck.check.formulas import is_plain
from symcheck.check.rewards import structure_number
from symcheck.engines.arrays import ArraySet, ArrayValues
from symcheck.engines.base import OwnSet, OwnValues
from symcheck.engines.explicit import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.states import StateTable
from symcheck.numerics.lump import Lumping, lump
from symcheck.numerics.matrix import Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, Filter, LabelReference, MultiObjective, Name, PathQuantifier, RewardOperator, StateFilter, Type
from symcheck.syntax.walk import children

__all__ = ["Quotient", "quotient"]


@dataclass(frozen=True, eq=False)
class LumpedModel:
    """The blocks as states: what is asked of a block is asked of its first state, and must hold for all of them."""

    base: ExplicitEngine = field(repr=False)
    lumping: Lumping = field(repr=False)

    @property
    def model(self) -> BoundModel:
        """The base model, whose variables the blocks have."""
        return self.base.model

    @property
    def matrix(self) -> SparseMatrix:
        """The quotient's matrix."""
        return self.lumping.matrix

    def _blocks(self, states: ArraySet) -> Int64s:
        return np.unique(self.lumping.block[states.members]).astype(np.int64)

    @cached_property
    def initial(self) -> Int64s:
        """Blocks with an initial state."""
        return self._blocks(self.base.initial)

    @cached_property
    def deadlocks(self) -> Int64s:
        """Blocks with a deadlock state."""
        return self._blocks(self.base.deadlocks)

    @cached_property
    def states(self) -> StateTable:
        """The first state of each block."""
        table = self.base.explored.states
        return StateTable(table.layout, table.rows[self.lumping.first])

    @property
    def state_rewards(self) -> list[Floats]:
        """Per reward structure, the state reward of each block's first state."""
        return [r[self.lumping.first] for r in self.base.explored.state_rewards]

    @property
    def choice_rewards(self) -> list[Floats]:
        """Per reward structure, the transition reward of each row."""
        return [r[self.lumping.rows] for r in self.base.explored.choice_rewards]

    @property
    def choice_actions(self) -> Int32s:
        """The action of each row."""
        actions: Int32s = self.base.explored.choice_actions
        return actions[self.lumping.rows]

    def evaluate(self, expression: Expression) -> NDArray[Any]:
        """The value of an expression in each block; an AssertionError where its states differ in it."""
        value = np.asarray(self.base.explored.evaluate(expression))
        if value.ndim == 0:
            return value
        own = value[self.lumping.first]
        assert (own[self.lumping.block] == value).all(), "an expression that the partition does not respect"
        return own


@dataclass(frozen=True)
class LumpedEngine(ExplicitEngine):
    """The explicit engine on blocks."""

    base: ExplicitEngine | None = field(default=None, repr=False)
    lumping: Lumping | None = field(default=None, repr=False)

    def where(self, expression: Expression) -> ArraySet:
        """The blocks whose states satisfy an expression; an AssertionError where they differ in it."""
        assert self.base is not None
        assert self.lumping is not None
        members = self.base.where(expression).members
        own = members[self.lumping.first]
        assert (own[self.lumping.block] == members).all(), "an expression that the partition does not respect"
        return ArraySet(own)

    def rational(self) -> Any:
        """Not to be had: raises UnsupportedError, so that what only rationals decide is decided on the model itself."""
        raise UnsupportedError("a quotient is not computed in rational arithmetic")


@dataclass(frozen=True, eq=False)
class Quotient:
    """The quotient as an engine, and the way back."""

    engine: ExplicitEngine
    lumping: Lumping = field(repr=False)

    def lift(self, values: OwnValues | None) -> ArrayValues | None:
        """Values of blocks as values of states."""
        if values is None:
            return None
        block = self.lumping.block
        lower = values.lower[block]
        upper = lower if values.upper is values.lower else values.upper[block]
        return ArrayValues(lower, upper, None if values.computed is None else values.computed[block], values.slack)

    def lift_set(self, states: OwnSet | None) -> ArraySet | None:
        """Blocks as states."""
        return None if states is None else ArraySet(states.members[self.lumping.block])


def quotient(context: Context, formula: Expression) -> Quotient:
    """The quotient that is good enough for a formula.

    Raises UnsupportedError for formulas that speak of single states (filters), of several objectives, and for engines
    that do not list states.
    """
    engine = context.engine
    if not isinstance(engine, ExplicitEngine):
        raise UnsupportedError("-bisim works on listed states; use -ex")
    if context.options.fairness:
        raise UnsupportedError("-bisim is not for fair strategies")
    colours: list[NDArray[np.generic]] = []
    structures: set[int] = set()
    for part in _parts(context, formula):
        match part:
            case Filter() | StateFilter() | MultiObjective() | PathQuantifier():
                raise UnsupportedError("-bisim is not for filters, A and E, and multi(...)")
            case LabelReference("init"):
                colours.append(engine.initial.members)
            case LabelReference("deadlock"):
                colours.append(engine.deadlocks.members)
            case RewardOperator():
                structures.add(structure_number(context, part))
            case _ if is_plain(part):
                colours.append(_value(context, engine, part))
            case _:
                pass
    rows: list[Floats] = []
    for i in sorted(structures):
        states, choices = engine.rewards(i)
        colours.append(states)
        rows.append(choices)
    lumping = lump(engine.matrix, colours, rows)
    return Quotient(LumpedEngine(LumpedModel(engine, lumping), base=engine, lumping=lumping), lumping)  # type: ignore[arg-type]


def _value(context: Context, engine: ExplicitEngine, part: Expression) -> NDArray[np.generic]:
    """An expression over the variables at each state."""
    # A model that was read has labels that are names of sets of states, which are no variables.
    label = isinstance(part, Name) and part.name.startswith('"')
    if label or context.type(part) is Type.BOOL:
        return engine.where(part).members
    return engine.values(part, context.type(part)).lower


def _parts(context: Context, formula: Expression) -> Iterator[Expression]:
    """The largest expressions over variables only, the references to initial and deadlock states, and the operators above."""
    yield formula
    if isinstance(formula, LabelReference) and formula.name not in ("init", "deadlock"):
        yield from _parts(context.inside(formula), context.referred(formula))
    elif not is_plain(formula):
        for child in children(formula):
            yield from _parts(context, child)  # type: ignore[arg-type]
