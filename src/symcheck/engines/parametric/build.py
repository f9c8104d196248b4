"""Building of parametric models: the states by compiled search, their rows as functions.

The graph does not depend on the parameters where no probability is 0. So the compiled search
explores the model with weight 1 for each probability that is another function than 0, and rows are
found by evaluating commands in all states at once. Few probabilities are distinct: sums and
products of functions are made once per pair.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from random import Random
from typing import TypeVar

import numpy as np

from symcheck.engines.rational.whole_numbers import CompiledModel
from symcheck.errors import Diagnostic, ModelFault, NumericalError
from symcheck.explicit.build import explore
from symcheck.explicit.model import ExplicitModel, evaluate_states
from symcheck.explicit.states import Rows, StateTable
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.options import Options
from symcheck.semantics import state_faults
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, Event, Value
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
        columns = _columns(self.model, self.states)
        table = _Functions(self.field, self.model)
        return table.of(table.values(expression, columns, len(self.states)))


def random_point(model: BoundModel, random: Random) -> dict[str, Fraction]:
    """A point within the ranges of the parameters."""
    return {
        name: low + (high - low) * Fraction(random.randrange(1, 1000), 1000)
        for name, (low, high) in model.parameters.items()
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
        point = random_point(model, random)
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


class _Functions:
    """Distinct functions by number, with a cache of operations."""

    def __init__(self, field: FunctionField, model: BoundModel) -> None:
        self.field, self.model = field, model
        self.table: list[RationalFunction] = []
        self._numbers: dict[RationalFunction, int] = {}
        self._sums: dict[tuple[int, ...], int] = {}
        self.parameters = {n: field.parameter(n) for n in model.parameters}
        for value in (0, 1):
            self.number(field.constant(value))

    def number(self, function: RationalFunction) -> int:
        known = self._numbers.setdefault(function, len(self.table))
        if known == len(self.table):
            self.table.append(function)
        return known

    def of(self, numbers: Int64s) -> Numbers:
        """The functions with these numbers, as objects."""
        table = np.empty(len(self.table), object)
        table[:] = self.table
        return table[numbers]

    def sum(self, numbers: Sequence[int]) -> int:
        key = tuple(sorted(numbers))
        if len(key) == 1:
            return key[0]
        if key not in self._sums:
            zero = self.table[_ZERO]
            self._sums[key] = self.number(sum((self.table[i] for i in key), zero))
        return self._sums[key]

    def pairs(
        self,
        operation: Callable[[RationalFunction, RationalFunction], RationalFunction],
        a: Int64s,
        b: Int64s,
    ) -> Int64s:
        """An operation on two functions each, by their numbers."""
        size = len(self.table)
        distinct, inverse = np.unique(a * size + b, return_inverse=True)
        results = (
            self.number(operation(self.table[i // size], self.table[i % size]))
            for i in distinct.tolist()
        )
        return np.fromiter(results, np.int64, len(distinct))[inverse]

    def product(self, a: Int64s, b: Int64s) -> Int64s:
        return np.where(a == _ONE, b, self.pairs(lambda f, g: f * g, a, b))

    def values(self, expression: Expression, columns: dict[str, Column], n: int) -> Int64s:
        """The numbers of an expression's functions in n states."""
        read = [name for name in columns if name in names(expression)]
        if not read:
            return np.full(n, self.number(self.function(expression, {})), np.int64)
        table = np.stack([np.asarray(columns[name], np.int64) for name in read], axis=1)
        distinct, inverse = np.unique(table, axis=0, return_inverse=True)
        kinds = {v.name: v.type for v in self.model.variables}
        found = []
        for row in distinct.tolist():
            pairs = zip(read, row, strict=True)
            values: dict[str, Value] = {
                k: bool(v) if kinds[k] is Type.BOOL else v for k, v in pairs
            }
            found.append(self.number(self.function(expression, values)))
        return np.array(found, np.int64)[inverse.reshape(-1)]

    def function(self, expression: Expression, values: dict[str, Value]) -> RationalFunction:
        """The function of an expression in a state."""
        if self.parameters.keys().isdisjoint(names(expression)):
            value = evaluate(expression, values, exact=True)
            if isinstance(value, float):
                raise ModelFault(Diagnostic(f"this number is {value}", expression.span, "number"))
            return self.field.constant(value)
        match expression:
            case Name(name):
                return self.parameters[name]
            case Unary(_, operand):
                return -self.function(operand, values)
            case Conditional(condition, then, otherwise):
                holds = evaluate(condition, values, exact=True)
                return self.function(then if holds else otherwise, values)
            case Binary(operator, left, right) if operator is not Operator.POWER:
                f, g = self.function(left, values), self.function(right, values)
                match operator:
                    case Operator.PLUS:
                        return f + g
                    case Operator.MINUS:
                        return f - g
                    case Operator.TIMES:
                        return f * g
                    case _:
                        return f / g
            case Binary(_, base, exponent) | Call(_, (base, exponent)):
                power = evaluate(exponent, values, exact=True)
                return self.function(base, values) ** int(power)
        raise TypeError(f"no rational function: {type(expression).__name__}")


def _columns(model: BoundModel, states: StateTable) -> dict[str, Column]:
    return {
        v.name: states.column(i).astype(bool) if v.type is Type.BOOL else states.column(i)
        for i, v in enumerate(model.variables)
    }


def _keys(rows: Rows) -> np.ndarray:
    """Packed states as bytes that are in the same order."""
    return np.ascontiguousarray(rows.astype(">u8")).view(f"S{8 * rows.shape[1]}").reshape(-1)


T = TypeVar("T")


@dataclass
class _Branches:
    """Branches of the choices of an event: state, combination of commands, weight and target."""

    state: Int64s
    choice: Int64s
    weight: Int64s
    target: Rows

    def taken(self, chosen: Int64s) -> _Branches:
        return _Branches(*(a[chosen] for a in (self.state, self.choice, self.weight, self.target)))


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
        found, functions = self.found, self.functions
        states, kinds, choices, weights, targets = [], [], [], [], []
        for number, event in enumerate(self.bound.events):
            part = self.branches(event)
            keys = _keys(part.target)
            target = np.minimum(np.searchsorted(self.keys, keys), self.n - 1)
            if not (self.keys[target] == keys).all():
                raise KeyError("a state that was not found")
            states.append(part.state)
            kinds.append(np.full(len(target), number))
            choices.append(part.choice)
            weights.append(part.weight)
            targets.append(target)
        state, kind, choice, weight, target = map(
            np.concatenate, (states, kinds, choices, weights, targets)
        )
        order = np.lexsort((target, choice, kind, state))
        state, kind, choice, weight, target = (
            a[order] for a in (state, kind, choice, weight, target)
        )
        # Choices: their sums, and the rewards of their actions.
        starts = _changes(state, kind, choice)
        owner, of_kind = state[starts], kind[starts]
        sums = self._sums(weight, starts)
        if self.check_sums:
            self._check(owner, of_kind, sums)
        earned = [self._earned(items, owner, of_kind, sums) for items in self._by_transitions()]
        has_choices = self.bound.type.has_choices
        choice_of = np.repeat(np.arange(len(starts)), np.diff([*starts, len(state)]))
        if self.bound.type.chooses_uniformly:
            count = np.bincount(owner, minlength=self.n)[owner]
            share = np.array(
                [
                    functions.number(self.field.constant(Fraction(1, c or 1)))
                    for c in range(count.max(initial=0) + 1)
                ]
            )[count]
            weight = functions.product(share[choice_of], weight)
            earned = [functions.product(share, e) for e in earned]
        row = choice_of if has_choices else state
        order = np.lexsort((target, row))
        row, target, weight = row[order], target[order], weight[order]
        first = _changes(row, target)
        merged = self._sums(weight, first)
        row, target = row[first], target[first]
        return self._assembled(row, target, merged, owner, of_kind, earned)

    def _assembled(
        self,
        row: Int64s,
        target: Int64s,
        weight: Int64s,
        owner: Int64s,
        kind: Int64s,
        earned: Sequence[Int64s],
    ) -> ParametricModel:
        """The model from merged branches, with loops at deadlocks."""
        found, functions, n = self.found, self.functions, self.n
        has_choices = self.bound.type.has_choices
        number = {name: i for i, name in enumerate(self.bound.actions)}
        of_kind = np.array([number.get(e.action or "", -1) for e in self.bound.events], np.int64)
        rows_of = np.bincount(owner, minlength=n) if has_choices else np.ones(n, np.int64)
        dead = np.bincount(owner, minlength=n) == 0
        groups = starts_of(np.where(dead, 1, rows_of))
        if has_choices:  # rows in the order of states; that of a deadlock is new
            place = groups[owner] + np.arange(len(owner)) - starts_of(rows_of)[owner]
        else:
            place = owner
        if has_choices:
            row = place[row]
        loops = np.flatnonzero(dead)
        row = np.concatenate([row, groups[loops]])
        target = np.concatenate([target, loops])
        weight = np.concatenate([weight, np.full(len(loops), _ONE)])
        order = np.argsort(row, kind="stable")
        count = int(groups[-1])
        indptr = starts_of(np.bincount(row, minlength=count))
        numbers = weight[order]
        actions = np.full(count, -1, np.int32)
        if has_choices:
            actions[place] = of_kind[kind]
        per_row = []
        for values in earned:
            sums = [_ZERO] * count
            for at in range(len(values)):
                if values[at]:
                    sums[place[at]] = functions.sum([sums[place[at]], int(values[at])])
            per_row.append(functions.of(np.array(sums, np.int64)))
        on_states = [
            [item for item in structure.items if item.on_states] for structure in self.bound.rewards
        ]
        all_states = np.arange(n)
        state_rewards = [functions.of(self._items(items, all_states)) for items in on_states]
        matrix = SparseMatrix(
            indptr,
            target[order].astype(np.int32),
            functions.of(numbers),
            n,
            groups if has_choices else None,
        )
        return ParametricModel(
            self.bound,
            found.states,
            matrix,
            actions,
            found.initial,
            loops,
            state_rewards,
            per_row,
            self.field,
            tuple(functions.table[i] for i in np.unique(numbers).tolist()),
        )

    def _sums(self, weight: Int64s, starts: Int64s) -> Int64s:
        """The sum of each run of weights."""
        ends = [*starts[1:].tolist(), len(weight)]
        out = weight[starts]
        for i in np.flatnonzero(np.diff([*starts, len(weight)]) > 1).tolist():
            out[i] = self.functions.sum(weight[starts[i] : ends[i]].tolist())
        return out

    def _check(self, owner: Int64s, kind: Int64s, sums: Int64s) -> None:
        """Raises ModelFault unless the probabilities of each choice sum to 1."""
        wrong = np.flatnonzero(sums != _ONE)
        for i in wrong[:1].tolist():
            total = self.functions.table[sums[i]]
            state = state_faults.describe_state(
                self.bound.variables, self.found.states.row(int(owner[i]))
            )
            commands = self.bound.events[kind[i]].participants[0]
            raise ModelFault(state_faults.function_sum(commands[0], str(total), state))

    def _by_transitions(self) -> Iterator[list[BoundReward]]:
        for structure in self.bound.rewards:
            yield [item for item in structure.items if not item.on_states]

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
            total[there] = self.functions.pairs(lambda f, g: f + g, total[there], values)
        return total


def _changes(*keys: Int64s) -> Int64s:
    """Where runs of equal keys begin, in arrays that are sorted by them."""
    if not len(keys[0]):
        return np.zeros(0, np.int64)
    differs = np.zeros(len(keys[0]), bool)
    differs[0] = True
    for key in keys:
        differs[1:] |= key[1:] != key[:-1]
    return np.flatnonzero(differs)
