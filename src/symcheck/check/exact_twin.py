"""The model in rational arithmetic, where floating point cannot decide a comparison."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.engines.base import Engine, erased
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.syntax.ast import LabelReference
from symcheck.syntax.traversal import nodes, reads_rewards

__all__ = ["exact_twin"]


def exact_twin(context: Context) -> Context:
    """The context over the model in rational arithmetic.

    Raises:
        UnsupportedError: the model cannot be explored in rational arithmetic.
    """
    return context.on(_exact_engine(context))


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
    if not _may_read_rewards(context):  # they may have no rational values
        model = replace(model, rewards=tuple(replace(r, items=()) for r in model.rewards))
    orbits = None
    represents = context.engine.capability(RepresentsOrbits)
    if represents is not None and represents.represented is not None:
        from symcheck.explicit.orbits import StateOrbits
        from symcheck.explicit.states import StateLayout

        layout = StateLayout.of(model.variables)
        orbits = StateOrbits.of(layout, represents.represented.symmetries)
    explored = None
    if orbits is None:
        from symcheck.engines.rational.whole_numbers import explore_in_whole_numbers

        explored = explore_in_whole_numbers(model, context.options)
    if explored is None:
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


def _may_read_rewards(context: Context) -> bool:
    return context.formula is None or any(
        reads_rewards(node)
        or (isinstance(node, LabelReference) and node.name in context.properties)
        for node in nodes(context.formula)
    )
