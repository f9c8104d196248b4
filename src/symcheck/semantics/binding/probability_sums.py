"""Commands whose probabilities sum to almost 1: they are divided by their sum, with a warning.

Methods may use that a row sums to 1, or not; if it does not, they contradict each other. So every
engine reads probabilities that do, except for rounding. Rational arithmetic refuses such commands.
Where a sum differs from 1 by more than the tolerance, the command is left as it is: the engines
report it if a state has it. Where the variables have too many valuations to look at, the engines
report a sum that is almost 1, and the model is built again (`normalised_at`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from math import prod
from operator import is_not

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import InputError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate, evaluate_closely
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns, open_mesh
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundModule,
    BoundUpdate,
    Value,
    Variable,
)
from symcheck.semantics.state_faults import (
    SUM_TOLERANCE,
    AlmostOne,
    almost_one,
    describe_state,
    rounded_sum,
)
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import conjuncts, names

__all__ = ["NormalisedModules", "normalised_at", "normalised_modules"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

_VALUATIONS = 1 << 14
"""The most valuations of the variables of a command that are looked at."""
_ALL_VALUATIONS = 1 << 20
"""Likewise of all commands together."""
_RATIONAL_VALUATIONS = 1000
"""The most valuations whose sum is computed in rationals."""
_ONE = Literal(Fraction(1), Type.DOUBLE)


@dataclass(frozen=True, slots=True)
class NormalisedModules:
    """Modules whose probabilities sum to 1.

    Attributes:
        modules: the modules; the given ones, if nothing was divided.
        warnings: one for each command that was divided, and differs by more than rounding.
        gave_up: whether there are commands with too many valuations to know.
        right: the ids of the given modules whose sums are right in every valuation of the
            variables, and were found without looking at any.
    """

    modules: tuple[BoundModule, ...]
    warnings: tuple[str, ...] = ()
    gave_up: bool = False
    right: frozenset[int] = frozenset()


def normalised_modules(
    modules: tuple[BoundModule, ...], variables: Sequence[Variable], right: Set[int] = frozenset()
) -> NormalisedModules:
    """The modules with the probabilities of such commands divided by their sum.

    Args:
        modules: the modules of a DTMC or MDP.
        variables: those of the model.
        right: the ids of modules that are known to have none (`NormalisedModules.right`).
    """
    search = _Search({v.name: v for v in variables})
    found = set()

    def normalised(module: BoundModule) -> BoundModule:
        if id(module) not in right:
            before = search.budget, search.gave_up
            commands = tuple(map(search.normalised, module.commands))
            if any(map(is_not, commands, module.commands)):
                return replace(module, commands=commands)
            if before != (search.budget, search.gave_up):
                return module
        found.add(id(module))
        return module

    result = tuple(map(normalised, modules))
    changed = any(map(is_not, result, modules))
    return NormalisedModules(
        result if changed else modules,
        tuple(search.warnings),
        bool(search.gave_up),
        frozenset(found),
    )


def normalised_at(model: BoundModel, fault: AlmostOne) -> BoundModel:
    """A model with the probabilities of a command divided by their sum where that is almost 1.

    Copies of the command, in modules that are renamed, are treated alike.

    Raises:
        AlmostOne: the model has no such command.
    """
    done: dict[int, BoundCommand] = {}

    def of(command: BoundCommand) -> BoundCommand:
        if command.span != fault.command.span:
            return command
        return done.setdefault(id(command), _divided(command, near_everywhere=False))

    modules = tuple(replace(m, commands=tuple(map(of, m.commands))) for m in model.modules)
    events = tuple(
        replace(e, participants=tuple(tuple(map(of, p)) for p in e.participants))
        for e in model.events
    )
    if not done:
        raise fault
    warnings = (*model.warnings, fault.warning)
    return replace(model, modules=modules, events=events, warnings=warnings, sums_divided=True)


class _Search:
    def __init__(self, variables: Mapping[str, Variable]) -> None:
        self.variables = variables
        self.warnings: list[str] = []
        self.budget = _ALL_VALUATIONS
        self.gave_up = 0  # how many commands have too many valuations

    def normalised(self, command: BoundCommand) -> BoundCommand:
        """The command, with probabilities that sum to 1 where they almost do."""
        if any(u.upper is not None for u in command.updates):
            return command
        probabilities = [u.probability for u in command.updates]
        read = set().union(*map(names, probabilities))
        if command.is_markovian:
            return command
        if not read:
            return self._constant(command, probabilities)
        table = self._tabulate(command.guard, probabilities, read)
        if table is None:
            self.gave_up += 1
            return command
        columns, sums, holds = table
        near = np.abs(sums - 1) <= SUM_TOLERANCE
        odd = np.flatnonzero(holds & near & ~rounded_sum(sums, len(probabilities)))
        if not len(odd):
            return command
        for lane in odd[:_RATIONAL_VALUATIONS].tolist():
            valuation = self._valuation(columns, lane)
            total = _rational_sum(probabilities, valuation)
            if total is None or not rounded_sum(total, len(probabilities)):
                self._warn(command, sums[lane] if total is None else total, valuation)
                break
        return _divided(command, near_everywhere=bool(near[holds].all()))

    def _constant(self, command: BoundCommand, probabilities: Sequence[Expression]) -> BoundCommand:
        if len(probabilities) == 1 and probabilities[0] == _ONE:
            return command
        sums = sum(_doubles(probabilities))
        if rounded_sum(sums, len(probabilities)) or not abs(sums - 1) <= SUM_TOLERANCE:
            return command
        total = _rational_sum(probabilities, {})
        if total is None:  # it is irrational
            self._warn(command, sums, self._example(command.guard))
            return _divided(command, near_everywhere=True)
        if not rounded_sum(total, len(probabilities)):
            self._warn(command, total, self._example(command.guard))
        values = [Fraction(evaluate_closely(p, {})) / total for p in probabilities]
        return _with(
            command,
            [
                Literal(v, Type.DOUBLE, span=p.span)
                for v, p in zip(values, probabilities, strict=True)
            ],
        )

    # ----------------------------------------------------------------------------------- valuations

    def _tabulate(
        self, guard: Expression, probabilities: Sequence[Expression], read: set[str]
    ) -> tuple[Mapping[str, Column], Floats, Bools] | None:
        """Valuations of the variables, and for each the sum and whether the guard may hold; None if
        they are too many.

        Where the guard reads too many variables, its conditions on those of the probabilities
        remain.
        """
        conditions = list(conjuncts(guard))
        chosen = read | names(guard)
        if self._size(chosen) > _VALUATIONS:
            chosen = read
            conditions = [c for c in conditions if names(c) <= read]
        mesh = open_mesh(
            {n: v.domain for n, v in self.variables.items() if n in chosen},
            min(_VALUATIONS, self.budget),
        )
        if mesh is None:
            return None
        axes, shape = mesh
        size = prod(shape)
        self.budget -= size
        columns = {n: np.broadcast_to(axis, shape).reshape(-1) for n, axis in axes.items()}
        holds = np.ones(size, np.bool_)
        for condition in conditions:
            lanes = evaluate_columns(condition, axes).spread(shape)
            holds &= lanes.values.astype(np.bool_)
            if lanes.faults is not None:
                holds &= ~lanes.faults
        total = np.zeros(size)
        for p in probabilities:
            lanes = evaluate_columns(p, axes).spread(shape)
            with np.errstate(all="ignore"):
                total += lanes.numbers()
        return columns, total, holds

    def _size(self, chosen: set[str]) -> float:
        domains = [self.variables[name].domain for name in chosen]
        return prod(float("inf") if d is None else len(d) for d in domains)

    def _valuation(self, columns: Mapping[str, Column], lane: int) -> dict[str, Value]:
        return {name: column[lane].item() for name, column in columns.items()}

    def _example(self, guard: Expression) -> dict[str, Value]:
        """A valuation in which the guard holds; empty if none is found."""
        table = self._tabulate(guard, [_ONE], set())
        if table is None:
            return {}
        columns, _, holds = table
        lanes = np.flatnonzero(holds)
        return self._valuation(columns, int(lanes[0])) if len(lanes) else {}

    def _warn(self, command: BoundCommand, total: Value, valuation: Mapping[str, Value]) -> None:
        variables = [self.variables[name] for name in valuation]
        state = describe_state(variables, list(valuation.values())) if valuation else ""
        self.warnings.append(almost_one(command, total, state))


def _divided(command: BoundCommand, *, near_everywhere: bool) -> BoundCommand:
    """A command with its probabilities divided by their sum; where that is not near 1, it remains
    a fault.
    """
    probabilities = [u.probability for u in command.updates]
    total = reduce(lambda a, b: Binary(Operator.PLUS, a, b), probabilities)
    if not near_everywhere:
        bounds = (
            Binary(o, total, Literal(1 + sign * Fraction(SUM_TOLERANCE), Type.DOUBLE))
            for o, sign in ((Operator.GE, -1), (Operator.LE, 1))
        )
        total = Conditional(Binary(Operator.AND, *bounds), total, _ONE)
    return _with(command, [Binary(Operator.DIVIDE, p, total, span=p.span) for p in probabilities])


def _with(command: BoundCommand, probabilities: Sequence[Expression]) -> BoundCommand:
    updates: list[BoundUpdate] = [
        replace(u, probability=p) for u, p in zip(command.updates, probabilities, strict=True)
    ]
    return replace(command, updates=tuple(updates))


def _doubles(probabilities: Sequence[Expression]) -> Iterator[float]:
    for p in probabilities:
        try:
            yield to_float(evaluate(p, {}))
        except InputError:  # a fault only if a state has it
            yield float("nan")


def _rational_sum(
    probabilities: Sequence[Expression], valuation: Mapping[str, Value]
) -> Fraction | None:
    """The sum, in rational arithmetic or to 30 digits; None where it has no value."""
    minus_one: Expression = Literal(Fraction(-1), Type.DOUBLE)
    excess = reduce(lambda a, b: Binary(Operator.PLUS, a, b), probabilities, minus_one)
    try:
        value = evaluate_closely(excess, valuation)
    except InputError:
        return None
    return None if isinstance(value, float) else 1 + Fraction(value)
