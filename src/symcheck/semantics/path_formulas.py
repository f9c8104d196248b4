"""Path formulas as they are interpreted: next, until with bounds, and LTL formulas for automata.

They are generic in their leaves: state formulas, or the sets of states that satisfy them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import Generic, TypeVar, assert_never

from symcheck.errors import NO_SPAN, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_normal_form import (
    Connected,
    Extent,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    normal_form,
    state_formulas,
    with_leaves,
)
from symcheck.semantics.time_bounds import RewardWindow, Window
from symcheck.syntax import ast
from symcheck.syntax.ast import Expression

__all__ = [
    "LtlPathFormula",
    "NextPath",
    "PathFormula",
    "RewardPath",
    "StatePath",
    "UntilPath",
    "as_ltl",
    "negated",
    "over_leaves",
    "path_formula",
]

L = TypeVar("L")
M = TypeVar("M")


@dataclass(frozen=True, slots=True)
class StatePath(Generic[L]):
    """A formula about the first state only."""

    states: L
    negative: bool = False


@dataclass(frozen=True, slots=True)
class NextPath(Generic[L]):
    """The second state is in `target`, and the step is in the window."""

    target: L
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class UntilPath(Generic[L]):
    """`left U right` within the window."""

    left: L
    right: L
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class RewardPath(Generic[L]):
    """A path formula without time bounds, with bounds on the rewards that are earned.

    See `symcheck.check.measures.reward_bounded_until`.
    """

    path: NextPath[L] | UntilPath[L]
    counts: tuple[RewardWindow, ...]
    negative: bool = False


@dataclass(frozen=True, slots=True)
class LtlPathFormula(Generic[L]):
    """Any other LTL formula. The leaves of its normal form are the numbers of its atoms."""

    form: NormalForm[int]
    atoms: tuple[L, ...]
    negative: bool = False
    span: Span = NO_SPAN


PathFormula = StatePath[L] | NextPath[L] | UntilPath[L] | RewardPath[L] | LtlPathFormula[L]
"""A path formula; `negative` stands for its negation."""


def path_formula(path: ast.PathFormula, model: BoundModel) -> PathFormula[Expression]:
    """The path formula that a bound syntax tree writes.

    Raises InputError: a bound is negative or cannot be satisfied.
    """
    return _read(normal_form(path, model), path.span)


def _read(form: NormalForm[Expression], span: Span) -> PathFormula[Expression]:
    match form:
        case StateFormula(formula):
            return StatePath(formula)
        case Negated(operand):
            return negated(_read(operand, span))
        case NextState(StateFormula(target), extent):
            return _within(NextPath(target), extent)
        case UntilReached(StateFormula(left), StateFormula(right), extent):
            return _within(UntilPath(left, right), extent)
        case Connected() | NextState() | UntilReached():
            atoms = {atom: i for i, atom in enumerate(dict.fromkeys(state_formulas(form)))}
            numbered = with_leaves(form, atoms.__getitem__)
            return LtlPathFormula(numbered, tuple(atoms), span=span)
        case _:
            assert_never(form)


def _within(path: NextPath[L] | UntilPath[L], extent: Extent) -> PathFormula[L]:
    return replace(path, window=extent) if isinstance(extent, Window) else RewardPath(path, extent)


def negated(path: PathFormula[L]) -> PathFormula[L]:
    """The negation."""
    return replace(path, negative=not path.negative)


def over_leaves(path: PathFormula[L], leaf: Callable[[L], M]) -> PathFormula[M]:
    """The path formula with `leaf` of each state formula in its place."""
    match path:
        case StatePath(states, negative):
            return StatePath(leaf(states), negative)
        case NextPath() | UntilPath():
            return _step_over_leaves(path, leaf)
        case RewardPath(inner, counts, negative):
            return RewardPath(_step_over_leaves(inner, leaf), counts, negative)
        case LtlPathFormula(form, atoms, negative, span):
            return LtlPathFormula(form, tuple(map(leaf, atoms)), negative, span)
        case _:
            assert_never(path)


def _step_over_leaves(
    path: NextPath[L] | UntilPath[L], leaf: Callable[[L], M]
) -> NextPath[M] | UntilPath[M]:
    match path:
        case NextPath(target, window, negative):
            return NextPath(leaf(target), window, negative)
        case UntilPath(left, right, window, negative):
            return UntilPath(leaf(left), leaf(right), window, negative)
        case _:
            assert_never(path)


def as_ltl(path: PathFormula[L]) -> LtlPathFormula[L]:
    """A path formula of any form as an LTL formula that is not `negative`."""
    form: NormalForm[int]
    atoms: tuple[L, ...]
    span = NO_SPAN
    match path:
        case StatePath(states):
            form, atoms = StateFormula(0), (states,)
        case NextPath() | UntilPath():
            form, atoms = _as_step(path, path.window)
        case RewardPath(inner, counts):
            form, atoms = _as_step(inner, counts)
        case LtlPathFormula(form, atoms):
            span = path.span
        case _:
            assert_never(path)
    return LtlPathFormula(Negated(form) if path.negative else form, atoms, span=span)


def _as_step(
    path: NextPath[L] | UntilPath[L], extent: Extent
) -> tuple[NormalForm[int], tuple[L, ...]]:
    match path:
        case NextPath(target):
            return NextState(StateFormula(0), extent), (target,)
        case UntilPath(left, right):
            return UntilReached(StateFormula(0), StateFormula(1), extent), (left, right)
        case _:
            assert_never(path)
