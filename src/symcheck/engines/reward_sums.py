"""Rewards of opposite sign that are earned together: where floating point would cancel them, their
sum is computed in rational arithmetic.

A sum of doubles is accurate relative to the sum of the absolute values of its terms. Where that is
much larger than the sum itself, the digits of the sum are lost. An expression for the absolute
values finds these states on every engine; the interpreter evaluates the rewards there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from symcheck.engines import tuning
from symcheck.engines.capabilities import HasActions
from symcheck.errors import InputError, NeedsRationalsError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Floats, Int64s, per_row
from symcheck.numerics import rational_limits
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.semantics.entry_errors import expression_error
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, to_float
from symcheck.semantics.expressions.types import static_type
from symcheck.semantics.interpreter import State, action_rewards, state_rewards, transitions
from symcheck.semantics.model import BoundModel, BoundReward, Value
from symcheck.semantics.rewards import Structure
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Literal,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.traversal import nodes

if TYPE_CHECKING:
    from symcheck.engines.base import Engine, StateSet

__all__ = ["RewardSums"]

_Exactly = Callable[[BoundModel, int, State], Iterable[tuple[int, Value]]]
"""The numbers and the rational values of the rows of a state, by its number."""

_ZERO = Literal(Fraction(0), Type.DOUBLE)
_ONE = Literal(Fraction(1), Type.DOUBLE)


@dataclass(eq=False)
class RewardSums:
    """The sums of the reward structures of an engine that floating point gets wrong."""

    engine: Engine
    _rows: dict[int, Floats | None] = field(default_factory=dict, init=False, repr=False)
    _errors: dict[int, Floats] = field(default_factory=dict, init=False, repr=False)
    _states: dict[int, Floats | None] = field(default_factory=dict, init=False, repr=False)

    def cancels(self, index: int) -> bool:
        """Whether floating point loses digits of what a structure gives to some step."""
        if index not in self._rows:
            self._rows[index] = self._accurate_rows(index)
        return self._rows[index] is not None

    def per_row(self, index: int, states: StateSet) -> Floats | None:
        """What each row of some states earns by a structure, float64[rows].

        That is the state reward plus the transition rewards times probability (rate). None if
        floating point adds them accurately everywhere.
        """
        if not self.cancels(index):
            return None
        found, engine = self._rows[index], self.engine
        assert found is not None
        members = engine.to_bools(states)
        return found if members.all() else found[per_row(engine.system(engine.all).groups, members)]

    def errors(self, index: int, states: StateSet) -> Floats | None:
        """A bound on the rounding error of what each row earns, float64[rows]; None if it is
        relative to that, as the structure has no negative rewards.
        """
        self.cancels(index)
        if index not in self._errors:
            return None
        engine, members = self.engine, self.engine.to_bools(states)
        return self._errors[index][per_row(engine.system(engine.all).groups, members)]

    def relative_error(self, index: int) -> float:
        """A bound on the relative error of a sum of items of one sign; 0 if they are ints."""
        model = self.engine.model
        items, variables = model.rewards[index].items, model.variables
        if self.engine.is_rational:
            return 0.0
        if model.builder is not None or not items:
            return 2 * UNIT_ROUNDOFF
        if sum(map(self._most, items)) <= LARGEST_WHOLE:
            return 0.0
        errors = (expression_error(i.value, variables, tuning.TABLE_BITS) for i in items)
        return max(errors, default=0.0) + 2 * len(items) * UNIT_ROUNDOFF

    def _most(self, item: BoundReward) -> float:
        """The largest absolute value of an int; infinite for other numbers."""
        from symcheck.semantics.reduction.live_variables import int_bounds

        if isinstance(item.value, Literal):
            value = Fraction(item.value.value)
            return to_float(abs(value)) if value.denominator == 1 else inf
        if self._type(item.value) is not Type.INT:
            return inf
        return max(map(abs, int_bounds(item.value, self.engine.model.variables)))

    def on_transitions(self, index: int) -> bool:
        """Whether transitions may earn rewards of a structure."""
        model = self.engine.model
        items = model.rewards[index].items
        return model.builder is not None or not items or not all(i.on_states for i in items)

    def per_state(self, index: int, states: StateSet) -> Floats | None:
        """State rewards of a structure, float64[states]; None if floating point adds them
        accurately everywhere.
        """
        if index not in self._states:
            self._states[index] = self._accurate_states(index)
        found = self._states[index]
        return None if found is None else found[self.engine.to_bools(states)]

    # -------------------------------------------------------------------------------------- finding

    @cached_property
    def _types(self) -> Mapping[str, Type]:
        return {v.name: v.type for v in self.engine.model.variables}

    def _type(self, expression: Expression) -> Type:
        return static_type(expression, self._types.__getitem__)

    def _may_be_negative(self, item: BoundReward) -> bool:
        """Whether the value of an item may be negative, or a difference of doubles."""
        from symcheck.semantics.reduction.live_variables import int_bounds  # few models need it

        variables = self.engine.model.variables
        if self._type(item.value) is Type.INT:
            return int_bounds(item.value, variables)[0] < 0
        negative = {v.name for v in variables if v.low is None or v.low < 0}
        return any(
            (isinstance(node, Literal) and node.type is not Type.BOOL and node.value < 0)
            or (isinstance(node, Name) and node.name in negative)
            or (isinstance(node, Binary) and node.operator is Operator.MINUS)
            or (isinstance(node, Unary) and node.operator is UnaryOperator.MINUS)
            or (isinstance(node, Call) and node.function not in _NATURAL)
            for node in nodes(item.value)
        )

    def _items(self, index: int) -> tuple[BoundReward, ...]:
        """The items of a structure; none if floating point cannot cancel them."""
        engine = self.engine
        if engine.is_rational or engine.model.builder is not None:
            return ()
        items = engine.model.rewards[index].items
        return items if any(map(self._may_be_negative, items)) else ()

    def _magnitudes(self, items: Sequence[BoundReward]) -> Floats:
        """Per state, the sum of the absolute values of the terms of items; NaN where unknown."""
        total: Expression = _ZERO
        for item in items:
            value = Conditional(item.guard, self._magnitude(item.value), _ZERO)
            total = Binary(Operator.PLUS, total, value)
        engine = self.engine
        try:
            values: Floats = engine.values(total, Type.DOUBLE).at(engine.all)[0]
        except InputError:  # in some state, where perhaps no step earns it
            return np.full(engine.states, np.nan)
        return values

    def _magnitude(self, e: Expression) -> Expression:
        """An expression relative to whose value the rounding error of `e` is small."""
        if self._type(e) is Type.INT:
            return _absolute(e)
        match e:
            case Literal(Fraction() as value, kind):
                return Literal(abs(value), kind)
            case Unary(UnaryOperator.MINUS, operand):
                return self._magnitude(operand)
            case Binary(Operator.PLUS | Operator.MINUS, left, right):
                return Binary(Operator.PLUS, self._magnitude(left), self._magnitude(right))
            case Binary(Operator.TIMES, left, right):
                return Binary(Operator.TIMES, self._magnitude(left), self._magnitude(right))
            case Binary(Operator.DIVIDE, left, right):
                quotients = (
                    Binary(Operator.DIVIDE, self._magnitude(part), _absolute(right))
                    for part in (left, right)
                )
                return Binary(Operator.TIMES, *quotients)
            case Conditional(condition, then, otherwise):
                return Conditional(condition, self._magnitude(then), self._magnitude(otherwise))
            case Call(Function.MIN | Function.MAX, arguments):
                return Call(Function.MAX, tuple(map(self._magnitude, arguments)))
            case _:
                return _absolute(e)

    # ------------------------------------------------------------------------------------ computing

    def _accurate_states(self, index: int) -> Floats | None:
        items = [i for i in self._items(index) if i.on_states]
        if not items:
            return None
        engine = self.engine
        values: Floats = engine.system(engine.all).rewards(Structure(index))[0]
        magnitudes = self._magnitudes(items)
        lost = _is_lost(values, magnitudes)
        if self._are_whole(items, magnitudes):
            return None
        return self._corrected(
            index, values, lost, lambda model, n, state: ((n, state_rewards(model, state)[0]),)
        )

    def _accurate_rows(self, index: int) -> Floats | None:
        items = self._items(index)
        if not items:
            return None
        engine = self.engine
        system = engine.system(engine.all)
        groups = system.groups
        states, rows = system.rewards(Structure(index))
        on_states = [i for i in items if i.on_states]
        of_states = self._magnitudes(on_states)
        magnitudes = per_row(groups, of_states)
        if len(on_states) < len(items):
            of_transitions = self._magnitudes([i for i in items if not i.on_states])
            with np.errstate(over="ignore", invalid="ignore"):
                rates = system.exit_rates
                chances = system.one_step_probability(engine.all) if rates is None else rates
                magnitudes = magnitudes + per_row(groups, of_transitions) * chances
        total: Floats = per_row(groups, states) + rows
        if system.exit_rates is not None and groups is not None:
            raise NeedsRationalsError(
                f"rewards of both signs are not supported for {engine.model.type.called}"
            )
        lost = _is_lost(total, magnitudes)
        if len(on_states) == len(items) and self._are_whole(items, of_states):
            lost[:] = False
        if groups is None:
            out = self._corrected(
                index, total, lost, lambda model, n, state: ((n, _chain_reward(model, state)),)
            )
        else:
            out = self._corrected(index, total, lost, self._choices(groups), groups)
        unit = self.relative_error(index) + (system.operator.longest + 8) * UNIT_ROUNDOFF
        unit += engine.entry_error
        of_rows = np.abs(total if out is None else out)
        self._errors[index] = unit * np.where(lost, of_rows, magnitudes)
        return out

    def _choices(self, groups: Int64s) -> _Exactly:
        """What the rows of a state of an MDP earn."""
        engine = self.engine
        known = engine.capability(HasActions)
        if known is None:
            raise UnsupportedError(f"the {engine.name} engine does not know the actions of choices")
        actions, names = known.row_actions(), engine.model.actions
        deadlocks = engine.to_bools(engine.deadlocks)

        def of_state(model: BoundModel, n: int, state: State) -> Iterator[tuple[int, Value]]:
            on_state = state_rewards(model, state)[0]
            for row in range(groups[n], groups[n + 1]):
                action = None if actions[row] < 0 else names[actions[row]]
                earned = 0 if deadlocks[n] else action_rewards(model, state, action)[0]
                yield row, on_state + earned

        return of_state

    def _are_whole(self, items: Sequence[BoundReward], magnitudes: Floats) -> bool:
        """Whether sums of state rewards are exact, as those of ints below 2^53 are."""
        whole = all(self._type(i.value) is Type.INT for i in items)
        return whole and bool((magnitudes < LARGEST_WHOLE).all())

    def _corrected(
        self,
        index: int,
        values: Floats,
        lost: Bools,
        exactly: _Exactly,
        groups: Int64s | None = None,
    ) -> Floats | None:
        """The values, with rationals where digits are lost, rounded once; None if nowhere."""
        if not lost.any():
            return None
        engine = self.engine
        states = lost if groups is None else np.logical_or.reduceat(lost, groups[:-1])
        count = int(np.count_nonzero(states))
        if count > rational_limits.REWARD_STATES:
            raise UnsupportedError(
                f"rewards of opposite signs may cancel in {count:,} states; they are added in "
                f"rational arithmetic in up to {rational_limits.REWARD_STATES:,}",
                hint="write what is earned at once as one item without a difference",
            )
        exact = exactly_bound(engine.model)
        exact = replace(exact, rewards=(exact.rewards[index],))
        out = values.copy()
        found = engine.valuations(engine.from_bools(states))
        for number, state in zip(np.flatnonzero(states).tolist(), found, strict=True):
            try:
                for row, value in exactly(exact, number, state):
                    out[row] = to_float(value)
            except InputError as fault:
                shown = describe_state(engine.model.variables, state)
                raise UnsupportedError(
                    f"rewards of opposite signs cancel in state {shown}, and rational arithmetic "
                    f"does not add them: {fault.diagnostics[0].message}"
                ) from None
        return out


_NATURAL = frozenset(
    {
        *(Function.MIN, Function.MAX, Function.POW, Function.MOD),
        *(Function.FLOOR, Function.CEIL, Function.ROUND),
    }
)
"""The functions without negative values for arguments without them."""


def _absolute(e: Expression) -> Expression:
    real = Binary(Operator.TIMES, _ONE, e)  # an int may have no negative
    return Call(Function.MAX, (real, Unary(UnaryOperator.MINUS, real)))


def _is_lost(values: Floats, magnitudes: Floats) -> Bools:
    """Where a sum may have lost digits: its terms are much larger, or unknown."""
    with np.errstate(invalid="ignore"):
        return np.asarray(~(tuning.CANCELLATION * np.abs(values) >= magnitudes))


def _chain_reward(model: BoundModel, state: State) -> Value:
    """What a state of a chain earns, with its transitions weighted by probability (rate)."""
    rows = transitions(model, state, check_sums=False)
    return state_rewards(model, state)[0] + (rows[0].rewards[0] if rows else 0)
