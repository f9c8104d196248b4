"""The path quantifiers A and E of CTL, by graph analysis alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.paths import NextPath, Path, RewardPath, StatePath, TemporalPath, UntilPath, negated
from symcheck.engines.base import StateSet
from symcheck.errors import UnsupportedError

__all__ = ["exists", "forall", "witness"]


def forall(context: Context, path: Path) -> StateSet:
    """States all of whose paths satisfy the formula."""
    return ~exists(context, negated(path))


def exists(context: Context, path: Path) -> StateSet:
    """States with a path that satisfies the formula (of an MDP: under some choices)."""
    engine = context.engine
    match path:
        case StatePath(states, negative):
            return ~states if negative else states
        case RewardPath():
            raise UnsupportedError("A and E with a bound on a reward are not supported; P>0 and P>=1 are")
        case TemporalPath():
            raise UnsupportedError("A and E take one temporal operator (X, F, G, U, W, R) over state formulas; nest A and E instead")
        case NextPath(window=window) | UntilPath(window=window) if not window.trivial:
            raise UnsupportedError("A and E with a bound on steps or time are not supported; P>0 and P>=1 are")
        case NextPath(target, _, negative):
            return engine.graph.predecessors(~target if negative else target)
        case UntilPath(left, right, _, False):
            return engine.graph.exists_until(left, right)
        case UntilPath(left, right):
            # Not (left U right): for ever without `right`, or `left` ends before `right` comes.
            globally = engine.graph.exists_globally(~right)
            return globally | engine.graph.exists_until(~right, ~(left | right))
        case _:
            assert_never(path)


def witness(context: Context, path: Path) -> Sequence[Mapping[str, int | bool]] | None:
    """A shortest finite path from an initial state that shows E [ path ]; None where there is none, or only infinite ones."""
    match path:
        case UntilPath(left, right, window, False) if window.trivial:
            return context.engine.graph.witness(left, right)
        case UntilPath(left, right, window, True) if window.trivial:
            return context.engine.graph.witness(~right, ~(left | right))
        case _:
            return None
