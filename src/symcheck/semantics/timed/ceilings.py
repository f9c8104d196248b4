"""Ceilings of clocks by location: what follows does not tell larger values apart.

At a location, a clock is compared with constants up to a limit until it is reset, there or where
commands lead without a reset; states in which it is beyond this limit are bisimilar. Where it is
not compared before its reset, it is inactive: all its values are alike. A location is a value of
one variable. Each variable gives limits, which do not grow along commands without a reset, so that
the least of them, which the caller takes, does not grow either. Time keeps locations. A clock that
enters a location above its ceiling keeps its value until time passes.
Sources: Daws & Yovine, Reducing the number of clock variables of timed automata, RTSS 1996;
Behrmann, Bouyer, Fleury & Larsen, Static guard analysis in timed automata verification, TACAS 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import partial, reduce

from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.reduction.control_locations import Locations
from symcheck.semantics.timed.constraints import clock_constraints, clocks_of, possible_values
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["local_ceilings"]

_MOST_VALUES = 100
"""Tell the values of a variable apart if there are at most this many."""

_NONE = Fraction(-1)
"""The limit of a clock that is not compared."""

Limits = dict[str, Fraction]
"""The largest constants with which clocks are compared."""


def local_ceilings(
    model: BoundModel, read: Iterable[Expression], unit: Fraction, tops: Mapping[str, int]
) -> dict[str, tuple[Expression, ...]]:
    """For some clocks, ceilings in units that depend on one variable each.

    Args:
        model: a timed automaton.
        read: conditions that are read in all states, besides guards and invariants.
        unit: the time that a clock counts; constants of labels may lie between its multiples.
        tops: the clocks, each with a ceiling in units for all locations.

    Raises:
        UnsupportedError: the bound of a clock depends on too many values.

    Sources: Daws & Yovine (RTSS 1996); Behrmann, Bouyer, Fleury & Larsen (TACAS 2003).
    """
    variables, clocks = {v.name: v for v in model.variables}, clocks_of(model)

    def limits_in(condition: Expression) -> Limits:
        found: Limits = {}
        for c, _ in clock_constraints(condition, clocks):
            values = possible_values(c.bound, variables)
            found[c.clock] = max([found.get(c.clock, _NONE), *values])
        return found

    lasting = [*read, *(m.invariant for m in model.modules if m.invariant is not None)]
    guards = [c.guard for m in model.modules for c in m.commands]
    compared = [(names(c), limits_in(c)) for c in (*lasting, *guards)]
    deciding = set[str]()
    for clock in tops:
        largest = max((at.get(clock, _NONE) for _, at in compared), default=_NONE)
        # A condition without a variable has its constant at all values of that: it gains nothing.
        needed = [used for used, at in compared if at.get(clock) == largest]
        deciding |= set.intersection(*needed) - clocks if needed else set()
    result: dict[str, tuple[Expression, ...]] = {}
    for i, variable in enumerate(model.variables):
        domain = variable.domain
        if variable.name not in deciding or domain is None or len(domain) > _MOST_VALUES:
            continue
        limits = _limits_by_value(model, i, lasting, limits_in)
        for clock, top in tops.items():
            ceilings = {x: int(of.get(clock, _NONE) // unit) + 1 for x, of in limits.items()}
            at = {x: min(max(ceiling, 0), top) for x, ceiling in ceilings.items()}
            if min(at.values()) < top:
                result[clock] = (*result.get(clock, ()), _by_value(variable, at, top))
    return result


def _limits_by_value(
    model: BoundModel,
    index: int,
    lasting: Iterable[Expression],
    limits_in: Callable[[Expression], Limits],
) -> dict[bool | int, Limits]:
    """The limits of clocks until they are reset, by the value of a variable."""
    locations = Locations(model, (index,))
    limits: dict[bool | int, Limits] = {}
    edges = set[tuple[bool | int, bool | int, frozenset[str]]]()
    for (value,), moves in locations.moves.items():
        limits[value] = {}
        guards = {id(e.command): e.command.guard for m in moves for p in m.effects for e in p}
        for condition in (*lasting, *guards.values()):
            _raise(limits[value], limits_in(locations.residual(condition, (value,))))
        for written, targets in (c for m in moves for c in m.combinations):
            reset = frozenset(model.variables[i].name for i in written)
            edges |= {(value, target, reset) for (target,) in targets}
    while sum(
        _raise(limits[x], {c: n for c, n in limits[y].items() if c not in reset})
        for x, y, reset in edges
    ):
        pass
    return limits


def _raise(limits: Limits, others: Limits) -> bool:
    """Whether some of the other limits are larger; they replace these."""
    larger = {c: n for c, n in others.items() if n > limits.get(c, _NONE)}
    limits.update(larger)
    return bool(larger)


def _by_value(variable: Variable, ceilings: Mapping[bool | int, int], top: int) -> Expression:
    """The ceiling that belongs to the value of a variable."""
    chosen: Expression = Literal(top, Type.INT)
    for ceiling in sorted({*ceilings.values()} - {top}):
        equal = (
            Binary(Operator.EQ, Name(variable.name), variable.literal(x))
            for x, at in ceilings.items()
            if at == ceiling
        )
        condition = reduce(partial(Binary, Operator.OR), equal)
        chosen = Conditional(condition, Literal(ceiling, Type.INT), chosen)
    return chosen
