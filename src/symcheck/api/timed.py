"""Timed automata: the model that decides a property, and what lets no time pass in it."""

from __future__ import annotations

from dataclasses import replace
from math import inf

from symcheck.check.checker import check
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.direction import Direction
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.registry import build
from symcheck.engines.zones.automaton import is_non_zeno
from symcheck.engines.zones.engine import zone_model
from symcheck.errors import Diagnostic, ModelFault, UnsupportedError
from symcheck.numerics.linear.problem import Observer as IterationObserver
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind_property
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundCommand, BoundModel, Value
from symcheck.semantics.timed.constraints import check_clocks, clocks_of
from symcheck.semantics.timed.digital import (
    Asked,
    DigitalClocks,
    NotDigital,
    common_unit,
    digital_clocks,
    limits_of,
)
from symcheck.semantics.timed.properties import Reach, asked_of, measures, on_digital_clocks
from symcheck.semantics.timed.stopped_time import Stop, time_stops
from symcheck.syntax.ast import (
    Bound,
    Eventually,
    Expression,
    Globally,
    Literal,
    Measure,
    Name,
    ProbabilityOperator,
    Type,
)
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names, transform

__all__ = ["check_timed", "deciding_model", "displayed_model"]

_ONE = Literal(1, Type.INT)
_MOST_LOCATIONS = 5000
"""Locations, without clocks, up to which a search for cycles that take no time pays."""


def displayed_model(automaton: BoundModel) -> BoundModel:
    """The model whose states are shown: that with digital clocks, or else the automaton itself.

    Raises InputError: a clock is read or set where it may not be.
    """
    check_clocks(automaton)
    try:
        return digital_clocks(automaton)
    except NotDigital:
        return automaton


def deciding_model(
    automaton: BoundModel, instance: PropertyInstance, options: Options
) -> BoundModel:
    """The model on which a property of a timed automaton is checked.

    Raises:
        InputError: the property is faulty.
        UnsupportedError: it is not supported for timed automata, or by the method.
    """
    bound, labels = bind_property(instance.file, instance.index, automaton, instance.constants)
    reached = list(measures(bound.formula, automaton, labels))
    refusal = _not_on_zones(automaton, bound.formula, reached)
    by_zones = options.timed_method in ("backwards", "games")
    if by_zones and refusal is None:
        return zone_model(automaton, reached[0])
    try:
        asked = asked_of(reached, clocks_of(automaton))
        digital = digital_clocks(automaton, _without_zeno(automaton, asked))
    except NotDigital as found:
        if options.timed_method == "auto" and refusal is None:
            return zone_model(automaton, reached[0])
        hint = "-ptamethod backwards (zones) takes it"
        if refusal is not None:
            hint = f"zones, which would take it, {refusal.message}"
        raise NotDigital(replace(found.args[0], hint=hint)) from None
    if by_zones and refusal is not None:
        raise UnsupportedError(replace(refusal, message=f"zones {refusal.message}"))
    return digital


def _without_zeno(automaton: BoundModel, asked: Asked) -> Asked:
    """What a property needs, without ticks if time goes on whatever a strategy does."""
    if not asked.ticks:
        return asked
    limits, _ = limits_of(automaton, ())
    unit = common_unit(c for values in limits.values() for c in values)
    return replace(asked, ticks=not is_non_zeno(automaton, unit, _MOST_LOCATIONS))


def _not_on_zones(
    automaton: BoundModel, formula: Expression, reached: list[Reach]
) -> Diagnostic | None:
    """Why zones do not decide a property that digital clocks may decide: they …; None if they do.

    Its place is what zones do not take.
    """
    hint = "-ptamethod digital, the default, takes it"
    opposed = any(reach.query.coalition is not None for reach in reached)
    if automaton.type.partially_observed or opposed:
        message = f"are not available for {automaton.type.called}"
        return Diagnostic(message, formula.span, "zones", hint)
    for reach in reached:
        if reach.path is None:
            message = "do not give expected rewards and times"
            return Diagnostic(message, reach.measure.span, "zones", hint)
    outside = transform(formula, lambda node: _ONE if isinstance(node, Measure) else node)
    if len(reached) != 1 or names(outside):
        message = "decide one operator P, without a condition beside it"
        return Diagnostic(message, formula.span, "zones", hint)
    return None


def check_timed(
    engine: Engine,
    instance: PropertyInstance,
    options: Options,
    observer: IterationObserver | None = None,
) -> Result:
    """Check a property on the model that was made for it. Raises SymcheckError."""
    model = engine.model
    clocks = model.clocks
    assert clocks is not None
    if isinstance(clocks, DigitalClocks) and engine.deadlocks:
        raise _stopped(engine, clocks, engine.deadlocks, Stop.TIMELOCK)
    if isinstance(clocks, DigitalClocks) and clocks.tick is not None:
        goes_on = Globally(Eventually(Name(clocks.tick)))
        everywhere = replace(options, everywhere=True, strategy=False)
        stops = ProbabilityOperator("max", Bound(Operator.LT, _ONE), goes_on)
        zeno = check(engine, stops, everywhere).satisfying.members
        if zeno:
            raise _stopped(engine, clocks, zeno, Stop.ZENO)
    bound, labels = instance.bind(model)
    result = check(engine, bound.formula, options, labels=labels, observer=observer)
    if not clocks.lists_states:  # values of zones are not those of states
        result = replace(result, values_or_none=None, satisfying_or_none=None)
    if result.value in (inf, True, False):
        _check_infinite_rewards(engine, instance, options)
    if options.timed_method == "games":
        note = "stochastic games are not built: zones are searched backwards instead"
        result = replace(result, warnings=(*result.warnings, note))
    return result


def _stopped(engine: Engine, clocks: DigitalClocks, states: StateSet, stop: Stop) -> ModelFault:
    """That time stops in some states, with one of them, and the invariant that time meets there."""
    model, state = engine.model, next(iter(engine.valuations(states, 1)))
    (waits,) = (e for e in model.events if e.action == clocks.time)
    limits: list[BoundCommand] = []
    names_of = [v.name for v in model.variables]
    before: dict[str, Value] = {}
    later: dict[str, Value] = dict(zip(names_of, state, strict=True))
    while later != before and not limits:
        commands = [commands[0] for commands in waits.participants]
        limits = [c for c in commands if not evaluate(c.guard, later)]
        before, later = later, dict(later)
        for i, value in (a for c in commands for a in c.updates[0].assignments):
            later[names_of[i]] = evaluate(value, before)
    return time_stops(stop, clocks.describe(state), limits[0].span if limits else None)


def _check_infinite_rewards(engine: Engine, instance: PropertyInstance, options: Options) -> None:
    """Refuse a greatest reward that is infinite because time may stop in infinitely many steps.

    It is so if the target may be missed, but not by strategies that let time go on.
    """
    clocks = engine.model.clocks
    if not isinstance(clocks, DigitalClocks) or clocks.asked is None:
        return
    bound, labels = bind_property(
        instance.file, instance.index, clocks.automaton, instance.constants
    )
    for reach in measures(bound.formula, clocks.automaton, labels):
        if reach.path is not None or reach.query.direction is not Direction.MAX:
            continue
        if not _without_zeno(clocks.automaton, Asked(ticks=True)).ticks:
            continue
        missed: Expression = ProbabilityOperator(
            "min", Bound(Operator.LT, _ONE), Eventually(reach.right)
        )
        if check(engine, clocks.condition(missed), options, labels=labels).value is not True:
            continue
        ticking = digital_clocks(clocks.automaton, replace(clocks.asked, ticks=True))
        missed = on_digital_clocks(missed, ticking, labels)
        if check(build(ticking, options), missed, options, labels=labels).value is not True:
            raise UnsupportedError(
                "a greatest reward is not supported where commands may follow each other for ever "
                "within a finite time before the target is reached",
                hint="let time pass in each cycle of locations",
            )
