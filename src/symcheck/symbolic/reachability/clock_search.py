"""Search where a clock drives everything: what changes little is closed at once, what changes most of the state goes step by step.

In models of timed systems one event, the tick of a clock, changes nearly every variable, and the others change a few each.
Saturation then visits sets of states at many different times, whose diagrams are large and forgotten again; a search breadth
first takes a step for each of the small events, and many more images. `Front` does neither: what a tick finds is closed under
the small events by saturation, and only that is moved on by the next tick. csma with 4 stations and 39 051 159 469 states
takes 18 million look-ups in CUDD's cache instead of 52 million breadth first, and more by saturation.

Elsewhere (firewire_impl_dl, whose deadline is a long clock) ticks are up to 40 times slower than saturation. Nothing that is
known before tells the two apart, so they take turns (`turns`): ticks go on where they stopped, saturation finds what it remembers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING

from symcheck.symbolic.model import Relation, SymbolicModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Saturation

__all__ = ["BUDGETS", "PROBE", "Front", "Turn", "advance", "begin", "clocks", "turns"]

BUDGETS = ((500_000, 3_000_000), (6_000_000, 18_000_000))
"""Look-ups in CUDD's cache of the turns of saturation and of ticks; two million are about a second.

They are counted so that a run takes the same turns on any machine. What saturation solves of PRISM's benchmark suite, it solves
within the second of its turns; the first turn of ticks is enough for csma with 3 stations.
"""

PROBE = 150_000
"""Look-ups after which the first turn of ticks ends, unless it has found a state or more with each.

csma has found 26 to 90 states with each by then; firewire_impl_dl and zeroconf, where saturation is better, 0.1 at most.
"""


@dataclass(frozen=True, eq=False)
class Front:
    """A search on its way. states: found, and closed under `local`. frontier: the last of them. news: what ticks made of these."""

    clocks: tuple[Relation, ...]
    local: Saturation
    states: Bdd
    frontier: Bdd
    news: Bdd

    @property
    def done(self) -> bool:
        """Whether all reachable states are found."""
        return not self.news


@dataclass(frozen=True, eq=False)
class Turn:
    """What is found after a tick or by saturation. frontier: what is new. complete: whether this is all that can be reached."""

    states: Bdd
    frontier: Bdd
    schedule: str
    complete: bool


def clocks(symbolic: SymbolicModel) -> tuple[Relation, ...]:
    """The relations that change more than half of the variables; none where all others do too, or there is nothing else."""
    variables = sum(1 for v in symbolic.encoding.variables if v.width)
    found = tuple(r for r in symbolic.relations if 2 * len(r.touched) > variables)
    return found if len(found) < len(symbolic.relations) else ()


def begin(symbolic: SymbolicModel) -> Front:
    """Before the first tick."""
    manager, ticking = symbolic.manager, clocks(symbolic)
    local = manager.saturation(
        [(r.relation, r.transition) for r in symbolic.relations if r not in ticking]
    )
    return Front(ticking, local, manager.false, manager.false, symbolic.initial)


def advance(symbolic: SymbolicModel, front: Front, steps: int | None = None) -> Front | None:
    """Close what is new under the local relations, and let the clocks tick once. None: it takes more than so many `steps`."""
    closed = front.local.saturate(front.news, max_lookups=steps)
    if closed is None:
        return None
    frontier = closed - front.states
    states = front.states | frontier
    ticked = symbolic.manager.disjunction([r.image(frontier) for r in front.clocks])
    return replace(front, states=states, frontier=frontier, news=ticked - states)


def turns(
    symbolic: SymbolicModel, whole: Saturation, budgets: Iterable[tuple[int, int]] = BUDGETS
) -> Iterator[Turn]:
    """Saturation by `whole` (all relations) and ticks in turn, each pair of turns for so many look-ups (and on: the last, doubled).

    It ends when one of them is complete, or both need more families of relations than a closure may have.
    """
    front, known = begin(symbolic), symbolic.initial
    for saturated, ticked in _doubling(budgets):
        states = whole.saturate(symbolic.initial, max_lookups=saturated)
        if states is not None:
            yield Turn(states, states - known, "saturation", complete=True)
            return
        for following in _ticking(symbolic, front, ticked):
            yield Turn(
                following.states, following.frontier - symbolic.initial, "ticks", following.done
            )
            front, known = following, following.states
        if front.done or (whole.exhausted and front.local.exhausted):
            return


def _doubling(budgets: Iterable[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    last = (1, 1)
    for last in budgets:
        yield last
    for power in count(1):
        yield last[0] << power, last[1] << power


def _ticking(symbolic: SymbolicModel, front: Front, steps: int) -> Iterator[Front]:
    """Ticks for so many look-ups; fewer where the first of them find few states."""
    begun, probing = _lookups(symbolic), not front.states
    while not front.done:
        used = _lookups(symbolic) - begun
        if probing and used >= PROBE:
            probing = False
            if symbolic.manager.count(front.states, symbolic.encoding.rows) < used:
                return
        following = advance(symbolic, front, steps - used) if used < steps else None
        if following is None:
            return
        front = following
        yield front


def _lookups(symbolic: SymbolicModel) -> int:
    return int(symbolic.manager.statistics().cache_lookups)
