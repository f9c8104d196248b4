"""Building of parametric models: the states by compiled search, their rows as functions.

The graph does not depend on the parameters where no probability is 0. So the compiled search
explores the model with weight 1 for each probability that is another function than 0, and rows are
found by evaluating commands in all states at once. Few probabilities are distinct: sums and
products of functions are made once per pair.
"""

from __future__ import annotations

import operator as op
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from random import Random

import numpy as np

from symcheck.engines.parametric.functions import function_of
from symcheck.engines.rational.explore import StateList
from symcheck.engines.rational.whole_numbers import CompiledModel
from symcheck.errors import ModelFault, NumericalError
from symcheck.explicit.build import explore
from symcheck.explicit.model import ExplicitModel, evaluate_states
from symcheck.explicit.states import Rows, StateTable
from symcheck.matrices.function_table import FunctionTable, run_starts
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.options import Options
from symcheck.semantics import state_faults
from symcheck.semantics.binding.parameters import Ranges, check_function
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, Event, Value
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names, substitute

__all__ = ["ParametricModel", "explore_parametric", "random_point"]

_ATTEMPTS = 20
_ZERO, _ONE = 0, 1
"""The numbers of these functions in a table."""


@dataclass(frozen=True, eq=False)
class ParametricModel(CompiledModel):
    """An explored model whose numbers are rational functions.

    weights: the distinct probabilities (rates) of the matrix.
    """

    field: FunctionField
    weights: tuple[RationalFunction, ...]

    def evaluate(self, expression: Expression) -> Numbers:
        """The value of an expression in each state."""
        if self.model.parameters.keys().isdisjoint(names(expression)):
            return super().evaluate(expression)
        check_function(self.field.names, expression)
        table = _Functions(self.field, self.model)
        columns = _columns(self.model, self.states)
        return table.of(table.values(expression, columns, len(self.states)))


def random_point(box: Ranges, random: Random) -> dict[str, Fraction]:
    """A point inside a box of parameters."""
    return {
        name: low + (high - low) * Fraction(random.randrange(1, 1024), 1024)
        for name, (low, high) in box.items()
    }


def explore_parametric(model: BoundModel, options: Options) -> ParametricModel:
    """The reachable states of a model with parameters, and their rows as functions.

    Args:
        model: a model that was bound with parameters.
        options: limits of the search.

    Raises:
        ModelFault, ResourceError: see `symcheck.explicit.build.explore`.
    """
    field, random = FunctionField(list(model.parameters)), Random(0)
    for _ in range(_ATTEMPTS):
        point = random_point(model.parameters, random)
        field.sample(point)
        found = explore(_support(model, point), replace(options, check_sums=False))
        try:
            return _Rows(model, found, field, options.check_sums).model()
        except KeyError:
            continue  # a function other than 0 is 0 at this point
    raise NumericalError("no point was found at which all probabilities are positive")


def _support(model: BoundModel, point: dict[str, Fraction]) -> BoundModel:
    """The model with weight 1 in place of each function that is not 0 at a point."""
    values = {n: Literal(v, Type.DOUBLE) for n, v in point.items()}
    zero, one = (Literal(Fraction(v), Type.DOUBLE) for v in (0, 1))

    def weight(expression: Expression) -> Expression:
        if values.keys().isdisjoint(names(expression)):
            return expression
        at_point = substitute(expression, values)
        return Conditional(Binary(Operator.NE, at_point, zero), one, zero, span=expression.span)

    def supported(command: BoundCommand) -> BoundCommand:
        updates = (replace(u, probability=weight(u.probability)) for u in command.updates)
        return replace(command, updates=tuple(updates))

    events = tuple(
        Event(e.action, tuple(tuple(map(supported, part)) for part in e.participants))
        for e in model.events
    )
    return replace(model, events=events, rewards=(), is_rational=False, parameters={})


class _Functions(FunctionTable):
    """The functions of a model: 0 and 1, and those of its expressions."""

    def __init__(self, field: FunctionField, model: BoundModel) -> None:
        super().__init__([field.constant(0), field.constant(1)])
        self.field = field
        self.kinds = {v.name: v.type for v in model.variables}

    def product(self, a: Int64s, b: Int64s) -> Int64s:
        return np.where(a == _ONE, b, self.pairs(op.mul, a, b))

    def values(self, expression: Expression, columns: dict[str, Column], n: int) -> Int64s:
        """The numbers of an expression's functions in n states."""
        used = names(expression)
        read = [name for name in columns if name in used]
        table = np.zeros((n, len(read)), np.int64)
        for i, name in enumerate(read):
            table[:, i] = columns[name]
        distinct, inverse = np.unique(table, axis=0, return_inverse=True)
        found = []
        for row in distinct.tolist():
            values: dict[str, Value] = {
                name: bool(v) if self.kinds[name] is Type.BOOL else v
                for name, v in zip(read, row, strict=True)
            }
            found.append(self.number(function_of(expression, self.field, values)))
        return np.array(found, np.int64)[inverse.reshape(-1)]


def _columns(model: BoundModel, states: StateList | StateTable) -> dict[str, Column]:
    return {
        v.name: states.column(i).astype(bool) if v.type is Type.BOOL else states.column(i)
        for i, v in enumerate(model.variables)
    }


def _keys(rows: Rows) -> np.ndarray:
    """Packed states as bytes that are in the same order."""
    return np.ascontiguousarray(rows.astype(">u8")).view(f"S{8 * rows.shape[1]}").reshape(-1)


@dataclass
class _Branches:
    """Branches of the choices of an event: state, combination of commands, weight and target."""

    state: Int64s
    choice: Int64s
    weight: Int64s
    target: Rows

    def taken(self, chosen: Int64s) -> _Branches:
        return _Branches(
            self.state[chosen], self.choice[chosen], self.weight[chosen], self.target[chosen]
        )


class _Rows:
    """Evaluates the commands of a model in all of its states."""

    def __init__(
        self, model: BoundModel, found: ExplicitModel, field: FunctionField, check_sums: bool
    ) -> None:
        self.bound, self.found, self.field = model, found, field
        self.functions = _Functions(field, model)
        self.columns = _columns(model, found.states)
        self.n = len(found.states)
        self.check_sums = check_sums and not model.type.continuous_time

    @cached_property
    def keys(self) -> np.ndarray:
        return _keys(self.found.states.rows)

    def guard(self, expression: Expression) -> Column:
        return np.broadcast_to(
            evaluate_states(self.bound, self.found.states, expression), (self.n,)
        )

    def branches(self, event: Event) -> _Branches:
        """The branches of all choices of an event, those with weight 0 left out."""
        layout, states = self.found.states.layout, np.arange(self.n)
        zero, one = np.zeros(self.n, np.int64), np.ones(self.n, np.int64)
        whole = _Branches(states, zero, one, self.found.states.rows)
        for commands in event.participants:
            parts = []
            for number, command in enumerate(commands):
                enabled = np.flatnonzero(self.guard(command.guard)[whole.state])
                if not len(enabled):
                    continue
                mine = whole.taken(enabled)
                mine.choice = mine.choice * len(commands) + number
                used = np.unique(mine.state)
                columns = {name: column[used] for name, column in self.columns.items()}
                at = np.searchsorted(used, mine.state)
                for update in command.updates:
                    own = self.functions.values(update.probability, columns, len(used))
                    product = self.functions.product(mine.weight, own[at])
                    some = np.flatnonzero(product != _ZERO)
                    branch = replace(mine, weight=product).taken(some)
                    rows = branch.target.copy()
                    for i, expression in update.assignments:
                        values = np.broadcast_to(
                            evaluate_columns(expression, columns).values, (len(used),)
                        )[at[some]]
                        _, word, shift, bits = layout.fields[i].tolist()
                        mask = np.uint64(((1 << bits) - 1) << shift)
                        offset = (values.astype(np.int64) - layout.lows[i]).astype(np.uint64)
                        rows[:, word] = (rows[:, word] & ~mask) | (offset << np.uint64(shift))
                    parts.append(replace(branch, target=rows))
            if not parts:
                return whole.taken(states[:0])
            whole = _Branches(
                *(
                    np.concatenate([getattr(p, name) for p in parts])
                    for name in ("state", "choice", "weight", "target")
                )
            )
        return whole

    def model(self) -> ParametricModel:
        """The explored model. Raises KeyError if a target is not among the states."""
        functions, n, events = self.functions, self.n, self.bound.events
        parts = []
        for number, event in enumerate(events):
            part = self.branches(event)
            keys = _keys(part.target)
            target = np.minimum(np.searchsorted(self.keys, keys), n - 1)
            if not (self.keys[target] == keys).all():
                raise KeyError("a state that was not found")
            parts.append(
                (part.state, np.full(len(target), number), part.choice, part.weight, target)
            )
        alive = np.zeros(n, bool)
        for states, *_ in parts:
            alive[states] = True
        dead = np.flatnonzero(~alive)  # with loops
        one = np.ones_like(dead)
        parts.append((dead, one * len(events), one, one * _ONE, dead))
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        order = np.lexsort(columns[2::-1])
        state, kind, choice, weight, target = (column[order] for column in columns)
        # Choices: their sums, and the rewards of their actions.
        starts = run_starts(state, kind, choice)
        owner, of_kind = state[starts], kind[starts]
        sums = functions.sums(weight, starts)
        if self.check_sums:
            self._check(owner, of_kind, sums)
        earned = [
            self._earned([i for i in r.items if not i.on_states], owner, of_kind, sums)
            for r in self.bound.rewards
        ]
        choice_of = np.repeat(np.arange(len(starts)), np.diff([*starts, len(state)]))
        counts = np.bincount(owner, minlength=n)
        if self.bound.type.chooses_uniformly:
            shares = (self.field.constant(Fraction(1, max(c, 1))) for c in range(counts.max() + 1))
            share = np.array([*map(functions.number, shares)], np.int64)[counts[owner]]
            weight = functions.product(share[choice_of], weight)
            earned = [functions.product(share, e) for e in earned]
        if self.bound.type.has_choices:
            row, groups = choice_of, starts_of(counts)
            number_of = {name: i for i, name in enumerate(self.bound.actions)}
            numbers = [number_of.get(e.action or "", -1) for e in events]
            actions = np.array([*numbers, -1], np.int32)[of_kind]
        else:
            row, groups, actions = state, None, np.full(n, -1, np.int32)
            earned = [functions.sums(e, run_starts(owner)) for e in earned]
        # Rows: branches that lead to the same state are added.
        row, target, merged = functions.merged(row, target, weight)
        indptr = starts_of(np.bincount(row))
        state_rewards = [
            functions.of(self._items([i for i in r.items if i.on_states], np.arange(n)))
            for r in self.bound.rewards
        ]
        return ParametricModel(
            self.bound,
            self.found.states,
            SparseMatrix(indptr, target.astype(np.int32), functions.of(merged), n, groups),
            actions,
            self.found.initial,
            dead,
            state_rewards,
            [functions.of(e) for e in earned],
            self.field,
            tuple(functions.functions[i] for i in np.unique(merged).tolist()),
        )

    def _check(self, owner: Int64s, kind: Int64s, sums: Int64s) -> None:
        """Raises ModelFault unless the probabilities of each choice sum to 1."""
        wrong = np.flatnonzero(sums != _ONE)
        for i in wrong[:1].tolist():
            total = self.functions.functions[sums[i]]
            state = state_faults.describe_state(
                self.bound.variables, self.found.states.row(int(owner[i]))
            )
            commands = self.bound.events[kind[i]].participants[0]
            raise ModelFault(state_faults.function_sum(commands[0], str(total), state))

    def _earned(
        self, items: Sequence[BoundReward], owner: Int64s, kind: Int64s, sums: Int64s
    ) -> Int64s:
        """The reward of each choice, times the sum of its weights."""
        out = np.zeros(len(owner), np.int64)
        for number, event in enumerate(self.bound.events):
            mine = np.flatnonzero(kind == number)
            of_action = [i for i in items if i.action == event.action]
            if len(mine) and of_action:
                rewards = self._items(of_action, owner[mine])
                out[mine] = self.functions.product(sums[mine], rewards)
        return out

    def _items(self, items: Sequence[BoundReward], states: Int64s) -> Int64s:
        """The sum of the items whose guards hold, in some states."""
        total = np.zeros(len(states), np.int64)
        for item in items:
            there = np.flatnonzero(self.guard(item.guard)[states])
            columns = {name: c[states[there]] for name, c in self.columns.items()}
            values = self.functions.values(item.value, columns, len(there))
            total[there] = self.functions.pairs(op.add, total[there], values)
        return total
