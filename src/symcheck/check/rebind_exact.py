"""Binding of a model and a formula in rational arithmetic, where floating point cannot decide."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.engines.base import Engine, erased
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, LabelReference
from symcheck.syntax.traversal import nodes, reads_rewards

__all__ = ["exact_twin"]


def exact_twin(context: Context, formula: Expression) -> tuple[Context, Expression]:
    """The context over the model in rational arithmetic, and the subformula bound to it.

    Raises:
        UnsupportedError: the model cannot be explored in rational arithmetic.
    """
    engine = _exact_engine(context)
    return replace(context, engine=engine, relevant_states=None), _twin(
        context, engine.model, formula
    )


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

    engine = context.engine
    if engine.model.builder is not None:  # there is no text to bind again
        engine = build(engine.model, replace(context.options, engine="explicit", exact=False))
    without_text = engine.capability(HasRationalTwin)
    if without_text is not None:
        return without_text.rational()
    model = exactly_bound(context.engine.model)
    if not _may_read_rewards(context, model):  # they may have no rational values
        model = replace(model, rewards=tuple(replace(r, items=()) for r in model.rewards))
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


def _may_read_rewards(context: Context, model: BoundModel) -> bool:
    if context.rebind is None:
        return True
    return any(
        reads_rewards(node)
        or (isinstance(node, LabelReference) and node.name in context.properties)
        for node in nodes(context.rebind(model))
    )


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
