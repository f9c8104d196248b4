"""Checking a formula on the quotient by strong bisimulation, which keeps what the formula speaks of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

from symcheck.check.bisimulation.atomic_observations import Observed, observed, together
from symcheck.check.bisimulation.quotient import (
    BothQuotient,
    DiagramQuotient,
    ListedQuotient,
    Quotient,
    WrittenQuotient,
)
from symcheck.check.context import Context
from symcheck.check.filters import Outcome, apply_filter
from symcheck.check.state_formulas import is_plain, modern_filter, numbers, satisfying, states_of
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import InputError, NumericalError, UnsupportedError
from symcheck.numerics.bisimulation import lump
from symcheck.options import Options
from symcheck.syntax.ast import Expression, Filter, LabelReference, Name, StateFilter, Type

if TYPE_CHECKING:
    from symcheck.engines.symbolic.bisimulation import LumpedDiagrams
    from symcheck.engines.symbolic.engine import SymbolicEngine

__all__ = ["Common", "common", "filtered", "quotient"]

_ENTRY_BYTES = 12
_ROWS_BYTES = 2**30  # of compressed rows that are written out where diagrams do not lump
_ROWS_STATES = 20_000_000
_LONG = 1_000_000  # listed states above which diagrams, where they are there, are asked first
_ALIKE = 4  # states per block, on average, below which listing them is cheaper
_GAIN = 2  # states per block, on average, below which a common quotient is not worth having
_PATIENCE = 20.0  # seconds of processor time for a partition on diagrams where listed states are the alternative
_LONG_PATIENCE = 600.0  # where the alternative is none


@dataclass(frozen=True, eq=False)
class Common:
    """One quotient for several formulas: coarse enough to be a gain, fine enough for whatever one of them speaks of.

    formulas: how many it was made for, of how many `asked`.
    """

    quotient: Quotient
    observed: Observed
    formulas: int
    asked: int
    states: int
    seconds: float

    def __str__(self) -> str:
        served = "all" if self.formulas == self.asked else f"{self.formulas} of"
        cost = f"{self.quotient.cost}; {self.seconds:.2f} s in all"
        return f"{self.states} states -> {self.quotient.engine.states}, common to {served} {self.asked} properties ({cost})"


def common(
    engine: Engine,
    formulas: Sequence[tuple[Expression, Mapping[str, Expression]]],
    options: Options,
) -> Common | None:
    """One quotient for all formulas (bound, each with the labels of its file) that have one: strong bisimulation keeps them all.

    None where fewer than two have one, or it would be no gain: then each formula is better off with its own, or with none.
    Raises ResourceError.
    """
    started = perf_counter()
    seen, context = [], Context(engine, options)
    for formula, labels in formulas:
        try:
            seen.append(observed(replace(context, labels=labels), formula))
        except (UnsupportedError, InputError):
            continue  # it is told of where the formula is checked
    if len(seen) < 2:
        return None
    every = together(seen)
    try:
        smaller = _quotient(context, every)
    except (UnsupportedError, NumericalError, InputError):
        return None
    if smaller.engine.states * _GAIN > engine.states:
        return None
    return Common(smaller, every, len(seen), len(formulas), engine.states, perf_counter() - started)


def quotient(context: Context, formula: Expression, shared: Common | None = None) -> Quotient:
    """The quotient that is good enough for a formula: the shared one if it is, else one on diagrams or of listed states.

    Raises UnsupportedError for formulas with filters, A, E or multi(...) within, and for engines that have neither diagrams
    nor listed states.
    """
    seen = observed(context, formula)
    return (
        shared.quotient
        if shared is not None and seen <= shared.observed
        else _quotient(context, seen)
    )


def _quotient(context: Context, observed: Observed) -> Quotient:
    if context.options.fairness:
        raise UnsupportedError("-bisim is not for fair strategies")
    engine: Any = context.engine
    if isinstance(engine, ExplicitEngine):
        source = getattr(engine, "source", None)
        if source is not None and engine.states > _LONG:
            try:
                return BothQuotient(
                    source, _lumped(context, source, observed, engine.states // _ALIKE)
                )
            except UnsupportedError:
                pass
        return _listed(context, engine, observed, ListedQuotient)
    if getattr(engine, "diagrams", None) is None:
        raise UnsupportedError("-bisim works on listed states (-ex) and on diagrams")
    return _on_diagrams(context, engine, observed)


def filtered(context: Context, smaller: Quotient, formula: Filter | StateFilter) -> Outcome:
    """What a filter says of all states, with the values of the formula within computed on a quotient."""
    node = formula if isinstance(formula, Filter) else modern_filter(formula)
    inner = replace(context, engine=smaller.engine)
    kind = context.type(node.formula)
    states = (
        context.engine.all if node.states is None else _condition(context, smaller, node.states)
    )
    if kind is Type.BOOL:
        return apply_filter(
            context,
            node,
            smaller.lift_set(satisfying(inner, node.formula, inner.engine.all)),
            states,
            kind,
        )
    return apply_filter(
        context, node, smaller.lift(numbers(inner, node.formula, inner.engine.all)), states, kind
    )


def _condition(context: Context, smaller: Quotient, condition: Expression) -> StateSet:
    if is_plain(condition) or isinstance(condition, LabelReference):
        return states_of(context)(condition)
    found: StateSet = smaller.lift_set(
        states_of(replace(context, engine=smaller.engine))(condition)
    )
    return found


def _listed(
    context: Context,
    engine: ExplicitEngine,
    observed: Observed,
    make: Callable[..., ListedQuotient],
    **more: Any,
) -> ListedQuotient:
    sets, values = _apart(context, engine, observed)
    colours: list[Any] = [
        *(s.members for s in sets),
        *(engine.values(part, context.type(part)).lower for part in values),
    ]
    rewards = [engine.rewards(i) for i in sorted(observed.structures)]
    colours += [states for states, _ in rewards]
    return make(engine, lump(engine.matrix, colours, [rows for _, rows in rewards]), **more)


def _on_diagrams(context: Context, engine: SymbolicEngine, observed: Observed) -> Quotient:
    """On diagrams; where few states are alike and their rows fit into memory, these are written out."""
    from symcheck.engines.symbolic.materialized import written_out

    fits = engine.states <= _ROWS_STATES and engine.transitions * _ENTRY_BYTES <= _ROWS_BYTES
    try:
        return DiagramQuotient(
            engine, _lumped(context, engine, observed, engine.states // _ALIKE if fits else None)
        )
    except UnsupportedError:
        if not fits:
            raise
    return _listed(context, written_out(engine), observed, WrittenQuotient, source=engine)


def _lumped(
    context: Context, engine: SymbolicEngine, observed: Observed, most: int | None
) -> LumpedDiagrams:
    from symcheck.engines.symbolic.bisimulation import lump_diagrams

    sets, values = _apart(context, engine, observed)
    colours: list[Any] = [s.bdd for s in sets]
    for part in values:
        colours += [engine.space.values(part), engine.space.symbolic.translator.undefined(part)]
    patience = _PATIENCE if most is not None else _LONG_PATIENCE
    limit = context.options.time_limit
    seconds = patience if limit is None else min(limit, patience)
    return lump_diagrams(
        engine.diagrams, colours, sorted(observed.structures), most=most, seconds=seconds
    )


def _apart(
    context: Context, engine: Engine, observed: Observed
) -> tuple[list[Any], list[Expression]]:
    """What tells states apart: sets of the engine, and expressions for numbers."""
    sets: list[Any] = [engine.initial] if "init" in observed.names else []
    sets += [engine.deadlocks] if "deadlock" in observed.names else []
    values = []
    for part in observed.expressions.values():
        if _is_set(context, part):
            sets.append(satisfying(replace(context, engine=engine), part, engine.all))
        else:
            values.append(part)
    return sets, values


def _is_set(context: Context, part: Expression) -> bool:
    # A model that was read has labels that are names of sets of states, which are no variables.
    return (isinstance(part, Name) and part.name.startswith('"')) or context.type(part) is Type.BOOL
