"""Quotients by strong bisimulation for one or several formulas.

Source: Baier & Katoen (2008), 10.4.2; Derisavi, Hermanns & Sanders (2003).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.check import tuning
from symcheck.check.bisimulation.atomic_observations import (
    AtomicObservations,
    atomic_observations,
    union,
)
from symcheck.check.bisimulation.quotient import (
    ArrayLifting,
    Lifting,
    MaterializedLifting,
    Quotient,
    lumped_diagrams_engine,
    lumped_engine,
)
from symcheck.check.context import Context
from symcheck.check.filters import AppliedFilter
from symcheck.check.state_formulas import is_plain, modern_filter, satisfying, states_of, values_of
from symcheck.engines.base import Engine, StateSet, V, erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import InputError, NumericalError, UnsupportedError
from symcheck.matrices.numbers import doubles
from symcheck.matrices.rows import Bools, Floats
from symcheck.numerics.bisimulation import lump
from symcheck.options import Options
from symcheck.semantics.features import Feature, require
from symcheck.semantics.rewards import Structure
from symcheck.syntax.ast import Expression, Filter, LabelReference, Name, StateFilter, Type
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd
    from symcheck.engines.symbolic.bisimulation import LumpedDiagrams
    from symcheck.engines.symbolic.engine import SymbolicEngine

__all__ = ["SharedQuotient", "applied_filter", "quotient", "shared_quotient"]


@dataclass(frozen=True, eq=False)
class SharedQuotient:
    """One quotient for several formulas: it keeps the atomic observations of all of them.

    Attributes:
        quotient: the quotient.
        observed: the observations that it keeps.
        formulas: the number of formulas that it serves.
        all_formulas: the number of formulas of the run.
        states: the number of states of the model.
        seconds: the time it took.
    """

    quotient: Quotient
    observed: AtomicObservations
    formulas: int
    all_formulas: int
    states: int
    seconds: float

    def __str__(self) -> str:
        served = "all" if self.formulas == self.all_formulas else f"{self.formulas} of"
        cost = f"{self.quotient.cost}; {self.seconds:.2f} s in all"
        return (
            f"{counted(self.states, 'state')} -> {self.quotient.engine.states}, "
            f"common to {served} {self.all_formulas} properties ({cost})"
        )


def shared_quotient(
    engine: Engine,
    formulas: Sequence[tuple[Expression, Mapping[str, Expression]]],
    options: Options,
) -> SharedQuotient | None:
    """One quotient for several formulas.

    Args:
        engine: the engine of the model.
        formulas: bound formulas, each with the labels of its file.
        options: the options of the check.

    Returns:
        The quotient. None if fewer than two formulas can use one, or if it has more than half as
        many states as the model: each formula then has a quotient of its own, or none.

    Raises:
        ResourceError: a limit of time or memory was reached.
    """
    started = perf_counter()
    seen, context = [], Context(engine, options)
    for formula, labels in formulas:
        try:
            seen.append(atomic_observations(replace(context, labels=labels), formula))
        except (UnsupportedError, InputError):
            continue  # the error is reported when the formula is checked
    if len(seen) < 2:
        return None
    every = union(seen)
    try:
        smaller = _quotient(context, every)
    except (UnsupportedError, NumericalError, InputError):
        return None
    if smaller.engine.states * tuning.SHARED_STATES_PER_BLOCK > engine.states:
        return None
    return SharedQuotient(
        smaller, every, len(seen), len(formulas), engine.states, perf_counter() - started
    )


def quotient(
    context: Context, formula: Expression, shared: SharedQuotient | None = None
) -> Quotient:
    """The quotient for a formula: the shared one if it keeps the observations of the formula.

    Raises:
        UnsupportedError: the formula contains a filter, A, E or multi(...), or the engine has
            neither diagrams nor explicit states.
    """
    require(context.engine.model, Feature.BISIMULATION)
    seen = atomic_observations(context, formula)
    return (
        shared.quotient
        if shared is not None and seen <= shared.observed
        else _quotient(context, seen)
    )


def _quotient(context: Context, observed: AtomicObservations) -> Quotient:
    if context.options.fairness:
        raise UnsupportedError("-bisim does not support fair strategies")
    engine = context.engine
    if engine.is_rational:
        raise UnsupportedError(
            "-bisim compares numbers in floating point, and -exact asks for rationals"
        )
    explicit = engine.capability(ExplicitEngine)
    if explicit is not None and engine.states <= tuning.DIAGRAMS_FIRST_STATES:
        return _on_rows(context, explicit, observed)
    from symcheck.engines.symbolic.engine import SymbolicEngine

    symbolic = engine.capability(SymbolicEngine)
    if explicit is None:
        if symbolic is None:
            raise UnsupportedError("-bisim works on explicit states (-ex) and on diagrams")
        return _on_diagrams(context, symbolic, observed)
    if symbolic is not None:
        try:
            lumped = _lump_diagrams(
                context, symbolic, observed, engine.states // tuning.STATES_PER_BLOCK
            )
            return _of_diagrams(symbolic, lumped, ArrayLifting(lumped.block_of_states()))
        except UnsupportedError:
            pass
    return _on_rows(context, explicit, observed)


def applied_filter(
    context: Context, smaller: Quotient, formula: Filter | StateFilter
) -> AppliedFilter:
    """A filter on all states, with the values of its formula computed on a quotient."""
    node = formula if isinstance(formula, Filter) else modern_filter(formula)
    inner = context.on(smaller.engine)
    states = (
        context.engine.all if node.states is None else _condition(context, smaller, node.states)
    )
    return AppliedFilter(
        context,
        node,
        states,
        lambda f: smaller.lift_set(satisfying(inner, f, inner.engine.all)),
        lambda f: smaller.lift(values_of(inner, f, inner.engine.all)),
    )


def _condition(context: Context, smaller: Quotient, condition: Expression) -> StateSet:
    if is_plain(condition) or isinstance(condition, LabelReference):
        return states_of(context)(condition)
    return smaller.lift_set(states_of(context.on(smaller.engine))(condition))


def _on_rows(
    context: Context,
    engine: ExplicitEngine,
    observed: AtomicObservations,
    source: SymbolicEngine | None = None,
) -> Quotient:
    """A quotient on rows. source: the engine that they were materialized from, if any."""
    erased_engine = erased(engine)
    sets, values = _observed_parts(context, erased_engine, observed)
    colours: list[Bools | Floats] = [
        *(erased_engine.to_bools(states) for states in sets),
        *(doubles(engine.values(part, context.type(part)).lower) for part in values),
    ]
    everything, structures = engine.system(engine.all), map(Structure, sorted(observed.structures))
    rewards = [(everything.state_rewards(r), everything.earned(r)) for r in structures]
    colours += [states for states, _ in rewards]
    lumping = lump(engine.weights, colours, [rows for _, rows in rewards])
    return Quotient.of(
        lumped_engine(engine, lumping),
        lumping.rounds,
        f"{lumping.rounds} rounds on explicit states",
        ArrayLifting(lumping.block)
        if source is None
        else MaterializedLifting(source, lumping.block),
    )


def _on_diagrams(
    context: Context, engine: SymbolicEngine, observed: AtomicObservations
) -> Quotient:
    """A quotient on diagrams; on materialized rows if few states are bisimilar and the rows fit."""
    from symcheck.engines.symbolic.materialized import materialize

    fits = (
        engine.states <= tuning.LUMPED_ROWS_STATES
        and engine.transitions * tuning.ENTRY_BYTES <= tuning.LUMPED_ROWS_BYTES
    )
    most = engine.states // tuning.STATES_PER_BLOCK if fits else None
    try:
        lumped = _lump_diagrams(context, engine, observed, most)
        return _of_diagrams(engine, lumped, lumped)
    except UnsupportedError:
        if not fits:
            raise
    return _on_rows(context, materialize(engine), observed, engine)


def _of_diagrams(
    source: SymbolicEngine, lumped: LumpedDiagrams, lifting: Lifting[StateSet, V]
) -> Quotient:
    cost = (
        f"{lumped.rounds} rounds on diagrams, {lumped.nodes:,} nodes and signatures, "
        f"{lumped.seconds:.2f} s"
    )
    return Quotient.of(lumped_diagrams_engine(source, lumped), lumped.rounds, cost, lifting)


def _lump_diagrams(
    context: Context, engine: SymbolicEngine, observed: AtomicObservations, most: int | None
) -> LumpedDiagrams:
    from symcheck.engines.symbolic.bisimulation import lump_diagrams
    from symcheck.engines.symbolic.sets import SymbolicSet

    if any(map(engine.reward_sums.cancels, observed.structures)):
        raise UnsupportedError(
            "-bisim on diagrams compares rewards that floating point cancels in some state"
        )
    sets, values = _observed_parts(context, erased(engine), observed)
    colours: list[Bdd | Mtbdd] = []
    for states in sets:
        assert isinstance(states, SymbolicSet)  # of this engine
        colours.append(states.bdd)
    for part in values:
        colours += [engine.space.values(part), engine.space.symbolic.translator.undefined(part)]
    budget = (
        tuning.LUMPING_OPERATIONS
        if most is not None
        else tuning.LUMPING_OPERATIONS_WITHOUT_ALTERNATIVE
    )
    return lump_diagrams(
        engine.diagrams, colours, sorted(observed.structures), most=most, budget=budget
    )


def _observed_parts(
    context: Context, engine: Engine, observed: AtomicObservations
) -> tuple[list[StateSet], list[Expression]]:
    """The observations as sets of the engine, and as numeric expressions."""
    sets = [engine.initial] if "init" in observed.names else []
    sets += [engine.deadlocks] if "deadlock" in observed.names else []
    values = []
    for part in observed.expressions.values():
        if _is_set(context, part):
            sets.append(satisfying(replace(context, engine=engine), part, engine.all))
        else:
            values.append(part)
    return sets, values


def _is_set(context: Context, part: Expression) -> bool:
    # Labels of a model that was read from explicit files are names of sets, not of variables.
    return (isinstance(part, Name) and part.name.startswith('"')) or context.type(part) is Type.BOOL
