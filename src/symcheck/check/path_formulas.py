"""Path formulas, read: the simple ones brought to next or until over sets of states, the others left to automata.

Dualities used: G a = !(F !a), a R b = !(!a U !b), a W b = !((a & !b) U (!a & !b)), each with its bound carried over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from symcheck.check.time_bounds import Count, Window, counts, window
from symcheck.engines.base import Engine, StateSet
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Eventually,
    Expression,
    Globally,
    Next,
    PathFormula,
    Release,
    RewardBound,
    RewardBounds,
    TimeBound,
    Unary,
    Until,
    WeakUntil,
)
from symcheck.syntax.operators import UnaryOperator
from symcheck.syntax.traversal import children

__all__ = [
    "NextPath",
    "Path",
    "RewardPath",
    "StatePath",
    "StatesOf",
    "TemporalPath",
    "UntilPath",
    "is_state_formula",
    "negated",
    "resolve",
    "temporal",
]

StatesOf = Callable[[Expression], StateSet]


@dataclass(frozen=True, slots=True)
class StatePath:
    """A formula about the first state only."""

    states: StateSet
    negative: bool = False


@dataclass(frozen=True, slots=True)
class NextPath:
    """The second state is in `target`, and the step happens within the window."""

    target: StateSet
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class UntilPath:
    """`right` within the window, `left` until then."""

    left: StateSet
    right: StateSet
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class TemporalPath:
    """Any other formula of linear time, as it was written, and the states of its largest state formulas."""

    formula: PathFormula
    letters: tuple[tuple[Expression, StateSet], ...] = ()
    negative: bool = False


@dataclass(frozen=True, slots=True)
class RewardPath:
    """A path without bounds on time, during which the rewards gathered are within bounds: see `symcheck.check.measures.reward_bounded_until`."""

    path: NextPath | UntilPath
    counts: tuple[Count, ...]
    negative: bool = False


Path = StatePath | NextPath | UntilPath | TemporalPath | RewardPath
"""A path formula over sets of states; `negative` says that its negation is meant."""


def negated(path: Path) -> Path:
    """The negation."""
    return replace(path, negative=not path.negative)


def is_state_formula(path: PathFormula) -> bool:
    """Whether no temporal operator stands outside of the state operators."""
    match path:
        case Next() | Eventually() | Globally() | Until() | WeakUntil() | Release():
            return False
        case Unary(UnaryOperator.NOT, operand):
            return is_state_formula(operand)
        case Binary(operator, left, right) if operator.is_logical:
            return is_state_formula(left) and is_state_formula(right)
        case Conditional(condition, then, otherwise):
            return all(is_state_formula(p) for p in (condition, then, otherwise))
        case _:
            return True


def temporal(path: PathFormula, states_of: StatesOf) -> TemporalPath:
    """A path formula of any form, with the states of its largest state formulas."""
    letters: dict[Expression, StateSet] = {}
    todo = [path]
    while todo:
        part = todo.pop()
        if not is_state_formula(part):
            bounds = TimeBound | RewardBound | RewardBounds
            todo.extend(p for p in children(part) if not isinstance(p, bounds))  # type: ignore[misc]
        elif part not in letters:
            letters[part] = states_of(part)  # type: ignore[index,arg-type]
    return TemporalPath(path, tuple(letters.items()))


def resolve(path: PathFormula, states_of: StatesOf, engine: Engine) -> Path:
    """Read a path formula, asking `states_of` for the states of its state formulas."""
    if is_state_formula(path):
        return StatePath(states_of(path))  # type: ignore[arg-type]
    parts = [getattr(path, name) for name in ("operand", "left", "right") if hasattr(path, name)]
    if isinstance(path, Unary):
        return negated(resolve(path.operand, states_of, engine))
    if isinstance(path, Binary | Conditional) or not all(is_state_formula(p) for p in parts):
        return temporal(path, states_of)
    bound = getattr(path, "bound", None)
    if isinstance(bound, RewardBound | RewardBounds):
        inner = resolve(replace(path, bound=None), states_of, engine)  # type: ignore[arg-type]
        assert isinstance(inner, NextPath | UntilPath)
        return RewardPath(
            replace(inner, negative=False), counts(bound, engine.model), inner.negative
        )
    sets = [states_of(p) for p in parts]
    match path:
        case Next(_, bound):
            return NextPath(sets[0], window(bound))
        case Eventually(_, bound):
            return UntilPath(engine.all, sets[0], window(bound))
        case Globally(_, bound):
            return UntilPath(engine.all, ~sets[0], window(bound), negative=True)
        case Until(_, _, bound):
            return UntilPath(sets[0], sets[1], window(bound))
        case WeakUntil(_, _, bound):
            return UntilPath(sets[0] - sets[1], ~(sets[0] | sets[1]), window(bound), negative=True)
        case Release(_, _, bound):
            return UntilPath(~sets[0], ~sets[1], window(bound), negative=True)
        case _:
            raise AssertionError(f"not a path formula: {type(path).__name__}")
