"""What a formula speaks of: which states it can tell apart before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from symcheck.check.context import Context
from symcheck.check.state_formulas import is_plain
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bound_conditions import reward_index
from symcheck.syntax.ast import (
    Binary,
    Expression,
    Filter,
    LabelReference,
    MultiObjective,
    PathQuantifier,
    RewardBound,
    RewardOperator,
    StateFilter,
    Unary,
)
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import children, names

__all__ = ["Observed", "observed", "together"]


@dataclass(frozen=True)
class Observed:
    """Expressions over the variables by their text, labels looked up; sets by name; and numbers of reward structures.

    What a formula combines into one condition is one expression: states that differ in a part only are not told apart.
    """

    expressions: Mapping[str, Expression] = field(default_factory=dict)
    names: frozenset[str] = frozenset()
    structures: frozenset[int] = frozenset()

    def __le__(self, other: Observed) -> bool:
        """Whether the other tells apart whatever this does."""
        return (
            self.expressions.keys() <= other.expressions.keys()
            and self.names <= other.names
            and self.structures <= other.structures
        )


def together(all: Iterable[Observed]) -> Observed:
    """What several formulas speak of."""
    every = list(all)
    expressions = {text: part for one in every for text, part in one.expressions.items()}
    return Observed(
        expressions,
        frozenset().union(*(o.names for o in every)),
        frozenset().union(*(o.structures for o in every)),
    )


def observed(context: Context, formula: Expression) -> Observed:
    """What a formula speaks of; of a filter as the outermost operator, the formula within and what is not plain in its condition.

    Raises UnsupportedError for formulas with filters, A, E or multi(...) within, NameFault for an unknown label.
    """
    parts: tuple[Expression | None, ...] = (formula,)
    if isinstance(formula, Filter | StateFilter):
        condition = formula.states
        looked_up = (
            condition is None or is_plain(condition) or isinstance(condition, LabelReference)
        )
        parts = (formula.formula, None if looked_up else condition)
    return together(o for part in parts if part is not None for o in _parts(context, part))


def _parts(context: Context, formula: Expression) -> Iterator[Observed]:
    """The largest expressions over variables only, the initial and deadlock states, and the rewards."""
    condition = _condition(context, formula)
    if condition is not None:
        if names(
            condition
        ):  # what is the same everywhere, such as a threshold, tells nothing apart
            yield Observed({pretty(condition): condition})
        return
    match formula:
        case Filter() | StateFilter() | MultiObjective() | PathQuantifier():
            raise UnsupportedError(
                "-bisim is not for filters within a formula, A and E, and multi(...)"
            )
        case LabelReference("init" | "deadlock"):
            yield Observed(names=frozenset([formula.name]))
            return
        case LabelReference():
            yield from _parts(context.inside(formula), context.referred(formula))
            return
        case RewardOperator() | RewardBound():
            if not (isinstance(formula, RewardBound) and formula.structure is None):
                yield Observed(
                    structures=frozenset([reward_index(formula.structure, context.engine.model)])
                )
        case _:
            pass
    for child in children(formula):
        yield from _parts(context, child)  # type: ignore[arg-type]


def _condition(context: Context, formula: Expression) -> Expression | None:
    """A formula that is about the variables only, with its labels looked up: then only the whole tells states apart."""
    match formula:
        case LabelReference("init" | "deadlock"):
            return None
        case LabelReference():
            return _condition(context.inside(formula), context.referred(formula))
        case Unary("!", operand):
            inner = _condition(context, operand)
            return None if inner is None else replace(formula, operand=inner)
        case Binary("&" | "|" | "=>" | "<=>", left, right):
            one, other = _condition(context, left), _condition(context, right)
            return None if one is None or other is None else replace(formula, left=one, right=other)
        case _:
            return formula if is_plain(formula) else None
