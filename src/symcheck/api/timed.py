"""Timed automata: the model that decides a property, and what lets no time pass in it."""

from __future__ import annotations

from dataclasses import replace
from math import inf

from symcheck.check.checker import check
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.direction import Direction
from symcheck.engines.base import Engine
from symcheck.engines.registry import build
from symcheck.engines.states import States
from symcheck.engines.zones.automaton import is_non_zeno
from symcheck.engines.zones.engine import TIMELOCK, ZENO, zone_model
from symcheck.errors import Diagnostic, ModelFault, UnsupportedError
from symcheck.numerics.linear.problem import Observer as IterationObserver
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind_property
from symcheck.semantics.model import BoundModel
from symcheck.semantics.timed.constraints import check_clocks
from symcheck.semantics.timed.digital import (
    Asked,
    DigitalClocks,
    NotDigital,
    common_unit,
    digital_clocks,
    limits_of,
)
from symcheck.semantics.timed.properties import Reach, asked_of, measures, on_digital_clocks
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
    if options.timed_method in ("auto", "digital"):
        try:
            return digital_clocks(automaton, _without_zeno(automaton, asked_of(reached)))
        except NotDigital as found:
            if automaton.type.partially_observed:
                hint = f"zones, which would take it, are not available for {automaton.type.called}"
                raise UnsupportedError(replace(found.args[0], hint=hint)) from None
            if options.timed_method == "digital":
                raise
    if automaton.type.partially_observed:
        raise UnsupportedError(
            f"zones are not available for {automaton.type.called}",
            hint="-ptamethod digital, the default",
        )
    return _on_zones(automaton, bound.formula, reached)


def _without_zeno(automaton: BoundModel, asked: Asked) -> Asked:
    """What a property needs, without ticks if time goes on whatever a strategy does."""
    if not asked.ticks:
        return asked
    limits, _ = limits_of(automaton, ())
    unit = common_unit(c for values in limits.values() for c in values)
    return replace(asked, ticks=not is_non_zeno(automaton, unit, _MOST_LOCATIONS))


def _on_zones(automaton: BoundModel, formula: Expression, reached: list[Reach]) -> BoundModel:
    outside = transform(formula, lambda node: _ONE if isinstance(node, Measure) else node)
    if len(reached) != 1 or reached[0].path is None or names(outside):
        raise UnsupportedError(
            "by zones, a property has one operator P, and no condition beside it; expected rewards "
            "and times need digital clocks, that is closed constraints that do not compare two "
            "clocks"
        )
    return zone_model(automaton, reached[0])


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
    stuck = States(engine, engine.deadlocks)
    if len(stuck):
        message = f"{TIMELOCK}, for example in state {stuck[0]}"
        raise ModelFault(Diagnostic(message, code="timelock"))
    if isinstance(clocks, DigitalClocks) and clocks.tick is not None:
        goes_on = Globally(Eventually(Name(clocks.tick)))
        everywhere = replace(options, everywhere=True, strategy=False)
        stops = ProbabilityOperator("max", Bound(Operator.LT, _ONE), goes_on)
        zeno = check(engine, stops, everywhere).satisfying
        if len(zeno):
            message = f"{ZENO}, for example from state {zeno[0]}"
            raise ModelFault(Diagnostic(message, code="zeno"))
    bound, labels = instance.bind(model)
    result = check(engine, bound.formula, options, labels=labels, observer=observer)
    if result.value in (inf, True, False):
        _check_infinite_rewards(engine, instance, options)
    if options.timed_method == "games":
        note = "stochastic games are not built: zones are searched backwards instead"
        result = replace(result, warnings=(*result.warnings, note))
    return result


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
