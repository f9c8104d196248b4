"""Binding of a model and a formula in rational arithmetic, where floating point cannot decide."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.engines.base import Engine, erased
from symcheck.errors import UnsupportedError
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import nodes

__all__ = ["exact_twin", "exactly_bound"]


def exact_twin(context: Context, formula: Expression) -> tuple[Context, Expression]:
    """The context over the model in rational arithmetic, and the subformula bound to it.

    Raises:
        UnsupportedError: the model cannot be explored in rational arithmetic.
    """
    engine = _exact_engine(context)
    return replace(context, engine=engine, relevant_states=None), _twin(
        context, engine.model, formula
    )


def exactly_bound(model: BoundModel) -> BoundModel:
    """The model with the numbers of its text as rationals."""
    from symcheck.semantics.binding.bind import bind

    if model.exact:
        return model
    exact = bind(model.program, model.given, model_type=model.type, exact=True)
    return exact if model.derivation is None else model.derivation(exact)


def _exact_engine(context: Context) -> Engine:
    """The model explored in rational arithmetic, once per check."""
    if context.log.exact_engine is None:
        context.log.exact_engine = _explored(context)
    return context.log.exact_engine


def _explored(context: Context) -> Engine:
    from symcheck.engines.capabilities import HasRationalTwin, RepresentsOrbits
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.engines.rational.explore import explore_exactly
    from symcheck.engines.registry import build

    quotient = context.engine.capability(HasRationalTwin)
    if quotient is not None:
        return quotient.rational()
    if context.engine.model.builder is not None:  # there is no text to bind again
        return build(context.engine.model, replace(context.options, exact=True))
    model = exactly_bound(context.engine.model)
    orbits = None
    represents = context.engine.capability(RepresentsOrbits)
    if represents is not None and represents.represented is not None:
        from symcheck.explicit.orbits import StateOrbits
        from symcheck.explicit.states import StateLayout

        layout = StateLayout.of(model.variables)
        orbits = StateOrbits.of(layout, represents.represented.symmetries)
    explored = explore_exactly(
        model,
        check_sums=context.options.check_sums,
        limit=context.engine.states,
        orbits=orbits,
    )
    if len(explored.states) != context.engine.states:
        raise UnsupportedError(
            "the model has different states in rational arithmetic than in floating point"
        )
    return erased(ExplicitEngine(explored, "exact"))


def _twin(context: Context, model: BoundModel, formula: Expression) -> Expression:
    """The subformula of the formula bound in rational arithmetic that has the span of `formula`.

    Binding folds constants (1/6 becomes a double), so the formula is bound again.
    """
    if context.rebind is None:
        return formula
    whole = context.rebind(model)
    for node in nodes(whole):
        if type(node) is type(formula) and node.span == formula.span and node.span.text:
            return node
    return formula
