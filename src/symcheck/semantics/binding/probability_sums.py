"""Commands whose probabilities sum to almost 1: they are divided by their sum, with a warning.

Methods may use that a row sums to 1, or not; if it does not, they contradict each other. So every
engine reads probabilities that do, except for rounding. Rational arithmetic refuses such commands.
Where a sum differs from 1 by more than the tolerance, the command is left as it is: the engines
report it if a state has it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from math import prod

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import InputError
from symcheck.semantics.expressions.evaluate import evaluate, evaluate_closely
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns
from symcheck.semantics.model import BoundCommand, BoundModule, BoundUpdate, Value, Variable
from symcheck.semantics.state_faults import SUM_TOLERANCE, describe_state, rounded_sum
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["normalised_modules"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

_VALUATIONS = 1 << 14
"""The most valuations of the variables of a command that are looked at."""
_ALL_VALUATIONS = 1 << 20
"""Likewise of all commands together."""
_RATIONAL_VALUATIONS = 1000
"""The most valuations whose sum is computed in rationals."""
_SAMPLED = 1 << 12
"""Random valuations of variables that have more."""
_ONE = Literal(Fraction(1), Type.DOUBLE)


def normalised_modules(
    modules: Sequence[BoundModule], variables: Sequence[Variable]
) -> tuple[tuple[BoundModule, ...], tuple[str, ...]]:
    """The modules with the probabilities of such commands divided by their sum, and the warnings.

    Args:
        modules: the modules of a DTMC or MDP.
        variables: those of the model.
    """
    search = _Search({v.name: v for v in variables})
    result = tuple(
        replace(m, commands=tuple(search.normalised(c) for c in m.commands)) for m in modules
    )
    changed = any(
        a is not b
        for m, r in zip(modules, result, strict=True)
        for a, b in zip(m.commands, r.commands, strict=True)
    )
    return (result if changed else tuple(modules)), tuple(search.warnings)


class _Search:
    def __init__(self, variables: Mapping[str, Variable]) -> None:
        self.variables = variables
        self.warnings: list[str] = []
        self.budget = _ALL_VALUATIONS

    def normalised(self, command: BoundCommand) -> BoundCommand:
        """The command, with probabilities that sum to 1 where they almost do."""
        probabilities = [u.probability for u in command.updates]
        read = set().union(*map(names, probabilities))
        if not read:
            return self._constant(command, probabilities)
        columns, sums, holds = self._tabulate(command.guard, probabilities, read)
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
        total_of_all = reduce(lambda a, b: Binary(Operator.PLUS, a, b), probabilities)
        if not near[holds].all():  # where it is no sum near 1, it stays a fault
            bounds = (
                Binary(o, total_of_all, Literal(1 + sign * Fraction(SUM_TOLERANCE), Type.DOUBLE))
                for o, sign in ((Operator.GE, -1), (Operator.LE, 1))
            )
            close = Binary(Operator.AND, *bounds)
            total_of_all = Conditional(close, total_of_all, _ONE)
        return _with(
            command, [Binary(Operator.DIVIDE, p, total_of_all, span=p.span) for p in probabilities]
        )

    def _constant(self, command: BoundCommand, probabilities: Sequence[Expression]) -> BoundCommand:
        if len(probabilities) == 1 and probabilities[0] == _ONE:
            return command
        sums = sum(_doubles(probabilities))
        if rounded_sum(sums, len(probabilities)) or not abs(sums - 1) <= SUM_TOLERANCE:
            return command
        total = _rational_sum(probabilities, {})
        if total is None:
            return command
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
    ) -> tuple[Mapping[str, Column], Floats, Bools]:
        """Valuations of the variables, and for each the sum and whether the guard may hold.

        Where the guard reads too many variables, its conditions on those of the probabilities
        remain. Where there are too many valuations, they are a random sample.
        """
        conditions = list(_conjuncts(guard))
        chosen = read | names(guard)
        if self._size(chosen) > _VALUATIONS:
            chosen = read
            conditions = [c for c in conditions if names(c) <= read]
        size = self._size(chosen)
        ordered = [name for name in self.variables if name in chosen]
        if size <= min(_VALUATIONS, self.budget):
            self.budget -= int(size)
            domains = [np.asarray(self.variables[name].domain) for name in ordered]
            mesh = list(np.meshgrid(*domains, indexing="ij"))
        else:
            mesh, size = self._sampled(ordered), _SAMPLED
        columns = dict(zip(ordered, (axis.reshape(-1) for axis in mesh), strict=True))
        shape = (int(size),)
        holds = np.ones(int(size), np.bool_)
        for condition in conditions:
            lanes = evaluate_columns(condition, columns).spread(shape)
            holds &= lanes.values.astype(np.bool_)
            if lanes.faults is not None:
                holds &= ~lanes.faults
        total = np.zeros(int(size))
        for p in probabilities:
            lanes = evaluate_columns(p, columns).spread(shape)
            with np.errstate(all="ignore"):
                total += lanes.numbers()
        return columns, total, holds

    def _sampled(self, ordered: Sequence[str]) -> list[Column]:
        rng = np.random.default_rng(0)
        axes = []
        for variable in (self.variables[name] for name in ordered):
            low = -_SAMPLED if variable.low is None else variable.low
            high = _SAMPLED if variable.high is None else variable.high
            axis = rng.integers(low, high, _SAMPLED, endpoint=True)
            axes.append(axis.astype(np.bool_) if variable.type is Type.BOOL else axis)
        return axes

    def _size(self, chosen: set[str]) -> float:
        domains = [self.variables[name].domain for name in chosen]
        return prod(float("inf") if d is None else len(d) for d in domains)

    def _valuation(self, columns: Mapping[str, Column], lane: int) -> dict[str, Value]:
        return {name: column[lane].item() for name, column in columns.items()}

    def _example(self, guard: Expression) -> dict[str, Value]:
        """A valuation in which the guard holds; empty if none is found."""
        columns, _, holds = self._tabulate(guard, [_ONE], set())
        lanes = np.flatnonzero(holds)
        return self._valuation(columns, int(lanes[0])) if len(lanes) else {}

    def _warn(self, command: BoundCommand, total: Value, valuation: Mapping[str, Value]) -> None:
        where = ""
        if valuation:
            variables = [self.variables[name] for name in valuation]
            where = f", for example in state {describe_state(variables, list(valuation.values()))}"
        self.warnings.append(
            f"{command.span}: the probabilities sum to {to_float(total):.15g}, not 1{where}: they "
            "are divided by their sum"
        )


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


def _conjuncts(condition: Expression) -> Iterator[Expression]:
    if isinstance(condition, Binary) and condition.operator is Operator.AND:
        yield from _conjuncts(condition.left)
        yield from _conjuncts(condition.right)
    else:
        yield condition
