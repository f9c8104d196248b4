"""Timed automata: the model that decides a property, and what lets no time pass in it."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.checker import check
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.engines.base import Engine
from symcheck.engines.states import States
from symcheck.errors import Diagnostic, ModelFault
from symcheck.numerics.linear.problem import Observer as IterationObserver
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind_property
from symcheck.semantics.model import BoundModel
from symcheck.semantics.timed.digital import NotDigital, digital_clocks
from symcheck.semantics.timed.properties import asked_of, measures
from symcheck.syntax.ast import (
    Bound,
    Eventually,
    Globally,
    Literal,
    Name,
    ProbabilityOperator,
    Type,
)
from symcheck.syntax.operators import Operator

__all__ = ["check_timed", "deciding_model", "displayed_model"]


def displayed_model(automaton: BoundModel) -> BoundModel:
    """The model whose states are shown: that with digital clocks, or else the automaton itself."""
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
    try:
        return digital_clocks(automaton, asked_of(reached))
    except NotDigital:
        if options.timed_method == "digital":
            raise
        raise


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
        message = "time stops: neither may it pass, nor is a command enabled"
        raise ModelFault(Diagnostic(f"{message}, for example in state {stuck[0]}", code="timelock"))
    if clocks.tick is not None:
        goes_on = Globally(Eventually(Name(clocks.tick)))
        one = Bound(Operator.LT, Literal(1, Type.INT))
        everywhere = replace(options, everywhere=True, strategy=False)
        zeno = check(engine, ProbabilityOperator("max", one, goes_on), everywhere).satisfying
        if len(zeno):
            message = "time cannot go on for ever: commands follow each other within finite time"
            raise ModelFault(Diagnostic(f"{message} from state {zeno[0]}", code="zeno"))
    bound, labels = instance.bind(model)
    return check(engine, bound.formula, options, labels=labels, observer=observer)
