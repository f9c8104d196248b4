"""Choosing an engine by what the model turns out to be.

1. A short explicit search, a little longer where there are few transitions. A model that ends within it is small: no diagram
   is worth its while.
2. Diagrams, with a budget of look-ups in their cache. If they compress the states, the model is explored with them. An MDP is then written out as
   compressed rows, where those fit well into memory: prob0 and prob1 are fixpoints within fixpoints, which diagrams are slow at.
   Of a chain, where they are closures, only the rows of what is asked are written; and blocks stand for rows that do not fit.
3. If the diagrams do not compress, or the budget is used up, the explicit search goes on where it stopped, up to a number of states;
   then the diagrams get a larger budget, and so on. In the end, or once they have found more states than the search would
   ever list, the diagrams have no limit any more; but where they were finished and compressed nothing, would have to learn
   what updates do, or found less with the large budget than the search had, the search goes on as far as memory reaches.

So a wrong guess costs a bounded share of the run, and what the search has explored is kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING, Any

from symcheck.engines.base import Engine
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError
from symcheck.machine import memory
from symcheck.options import Options
from symcheck.syntax.ast import Call, ModelType
from symcheck.syntax.traversal import names, nodes

if TYPE_CHECKING:
    from symcheck.explicit.build import Exploration
    from symcheck.semantics.model import BoundModel
    from symcheck.symbolic.model import StateSpace, Transitions
    from symcheck.symbolic.reachability.search import SearchState

__all__ = ["Choice", "choose"]

_SMALL = 50_000  # states that explicit search explores sooner than diagrams are loaded
_MORE = 1_000_000  # states that it goes on to where they have few transitions: it makes that many in half a second
_DENSE = 4_000_000  # transitions that are not few
_ENUMERATED = (
    10_000_000  # valuations that a search tries for the initial states of `init … endinit`
)
_TURNS = (
    (3_000_000, 4_000_000),
    (20_000_000, 30_000_000),
)  # look-ups in CUDD's cache for diagrams (two million take about a second), then states for the search; and so on in turn
_WRITTEN = (
    10_000_000  # states up to which an MDP that diagrams hold is written out and checked as arrays
)
_SPARSE_NODES = 0.5  # diagram nodes per state above which rows of bits are the better container
_ENTRY_BYTES = 12
_ROUNDED_BITS = 30  # read by the argument of one ceil or floor: no diagram of it will be small
_TOO_MUCH = "updates read too much for diagrams"
_ROWS_SHARE = 0.2  # of the machine's memory that compressed rows may take
_SEARCH_SHARE = 0.7  # of the machine's memory that a search may take where diagrams are no help


@dataclass(frozen=True, slots=True)
class Choice:
    """An engine that was chosen, and why."""

    engine: str
    reason: str

    def __str__(self) -> str:
        return f"{self.engine}: {self.reason}"


Observer = Callable[[object], None]


def choose(model: BoundModel, options: Options, observer: Observer | None = None) -> Engine:
    """Build a model on the engine that fits it; `observer` gets the Choice, besides what the builders tell.

    Raises ModelFault for a faulty model, and ResourceError.
    """
    from symcheck.explicit.build import Exploration
    from symcheck.kernels.explore.breadth_first import malloc_trim

    if model.initial is not None and _valuations(model) > _ENUMERATED:
        options = _ordered(model, options, observer)
        return _symbolic(
            _reach(model, options, None),
            options,
            observer,
            "a search would have to try too many initial states",
        )
    exploration = Exploration(model, options)
    if exploration.run(_SMALL) or _a_little_more(exploration):
        return _explicit(
            exploration, observer, f"the model has only {exploration.progress.states:,} states"
        )
    if any(v.low is None for v in model.variables):
        exploration.run(None, observer)
        return _explicit(exploration, observer, "there are integers without bounds")
    options = _ordered(model, options, observer)
    for turn, (lookups, states) in enumerate(_TURNS):
        if turn == 0 and _rounds_too_much(model):
            missed = _Missed(_TOO_MUCH)
        else:
            match _try_diagrams(model, options, lookups):
                case _Missed() as missed:
                    pass
                case space:
                    del exploration  # its states take memory that the diagrams' numbers want
                    return _symbolic(
                        space,
                        options,
                        observer,
                        f"{space.states.node_count:,} nodes hold {space.count:,} states",
                    )
        malloc_trim()  # what the diagrams took
        if missed.found > _TURNS[-1][1]:
            states = missed.found
            break
        if missed.hopeless or (
            turn == len(_TURNS) - 1 and 0 < missed.found < exploration.progress.states
        ):
            states = max(states, _that_fit(exploration))
        if missed.found <= states and exploration.run(states, observer):
            return _explicit(exploration, observer, missed.reason)
    del exploration
    return _symbolic(
        _reach(model, options, None), options, observer, f"there are more than {states:,} states"
    )


@dataclass(frozen=True, slots=True)
class _Missed:
    """Why diagrams missed their turn, whether more time would help them no more, and how many states they had found."""

    reason: str
    hopeless: bool = False
    found: int = 0


class _Unfinished(TimeLimitError):
    """Diagrams did not finish in their turn; so many states they had found."""

    def __init__(self, message: str, found: int) -> None:
        super().__init__(message)
        self.found = found


def _ordered(model: BoundModel, options: Any, observer: Observer | None) -> Any:
    """The options with the order that they ask for as names, so that it is looked for once, and only where diagrams are tried."""
    from symcheck.symbolic.build import chosen_order

    return (
        options
        if options.order is None
        else replace(options, order=chosen_order(model, options, observer))
    )


def _try_diagrams(model: BoundModel, options: Options, lookups: int) -> StateSpace | _Missed:
    """The states as a diagram that compresses them, made with so many look-ups in the cache."""
    unfinished = f"diagrams did not finish within {lookups / 1e6:g} million look-ups"
    try:
        space = _reach(model, options, lookups)
    except UnsupportedError as error:
        return _Missed(str(error), hopeless=True)
    except _Unfinished as error:
        return _Missed(unfinished, found=error.found)
    except TimeLimitError:  # before the search for states began
        return _Missed(unfinished, hopeless=lookups >= _TURNS[-1][0])
    except MemoryLimitError as error:
        return _Missed(str(error))
    nodes = space.states.node_count
    if nodes > _SPARSE_NODES * space.count:
        return _Missed(
            f"{nodes:,} nodes for {space.count:,} states compress nothing", hopeless=True
        )
    return space


def _that_fit(exploration: Exploration) -> int:
    """How many states a search may hold, going by what it has taken so far."""
    progress = exploration.progress
    return int(_SEARCH_SHARE * memory() * progress.states / max(progress.memory, 1))


class _Dense(Exception):
    """There are more transitions than a short search explores."""


def _a_little_more(exploration: Exploration) -> bool:
    """Whether the search ends at few states with few transitions."""

    def look(_: object) -> None:
        if exploration.progress.transitions > _DENSE:
            raise _Dense

    try:
        return exploration.run(_MORE, look)
    except _Dense:
        return exploration.complete


def _valuations(model: BoundModel) -> int:
    """How many valuations the variables have, reachable or not; 0 where an integer has no bounds."""
    return prod(
        0 if v.low is None or v.high is None else v.high - v.low + 1 for v in model.variables
    )


def _rounds_too_much(model: BoundModel) -> bool:
    """Whether some update rounds a real number that depends on so many bits that encoding it is not worth a first try."""
    bits = {
        v.name: 1 if v.low is None or v.high is None else (v.high - v.low).bit_length()
        for v in model.variables
    }
    updates = {id(u): u for e in model.events for p in e.participants for c in p for u in c.updates}
    parts = (n for u in updates.values() for _, value in u.assignments for n in nodes(value))
    rounded = (n for n in parts if isinstance(n, Call) and n.function in ("ceil", "floor", "round"))
    return any(sum(bits[x] for x in names(n)) > _ROUNDED_BITS for n in rounded)


def _explicit(exploration: Exploration, observer: Observer | None, reason: str) -> Engine:
    from symcheck.engines.explicit.engine import ExplicitEngine

    _tell(observer, "explicit", reason)
    return ExplicitEngine(exploration.finish())


def _reach(model: BoundModel, options: Options, lookups: int | None) -> StateSpace:
    """The states as a diagram. Raises TimeLimitError after `lookups`, and at the options' time limit.

    Within a limited turn, a model with updates that diagrams would have to learn state by state is left to the search:
    UnsupportedError says so.
    """
    from symcheck.dd.manager import DiagramManager
    from symcheck.symbolic.build import build
    from symcheck.symbolic.reachability.search import reach

    manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    manager.limit_lookups(lookups)
    symbolic = build(model, options, manager=manager)
    if lookups is not None and any(event.evaluated for event in symbolic.events):
        raise UnsupportedError(_TOO_MUCH)
    last: deque[SearchState] = deque(maxlen=1)
    try:
        space = reach(symbolic, watch=last.append)
    except TimeLimitError as error:
        manager.limit_time(None)
        manager.limit_lookups(None)
        found = sum(symbolic.manager.count(f.states, symbolic.encoding.rows) for f in last)
        raise _Unfinished(str(error), found) from error
    manager.limit_lookups(None)
    return space


def _symbolic(
    space: StateSpace, options: Options, observer: Observer | None, reason: str
) -> Engine:
    from symcheck.engines.symbolic.hybrid import HybridEngine
    from symcheck.engines.symbolic.materialized import written_out
    from symcheck.engines.symbolic.sparse import SparseEngine
    from symcheck.symbolic.matrix.transitions import transitions

    if observer is not None:
        observer(space)
    built: Transitions = transitions(space, options, observer)
    engine = SparseEngine.of(built)
    size = engine.transitions * _ENTRY_BYTES
    if (
        space.symbolic.model.type is ModelType.MDP
        and engine.states <= _WRITTEN
        and size <= _ROWS_SHARE * memory()
    ):
        _tell(
            observer,
            "sparse",
            f"{reason}, and its rows of {size / 1e6:,.0f} MB are soon written out",
        )
        return written_out(engine)
    if size <= _ROWS_SHARE * memory():
        _tell(observer, "sparse", f"{reason}, and the rows of what is asked fit into memory")
        return engine
    _tell(observer, "hybrid", f"{reason}, and rows of {size / 1e6:,.0f} MB are too many")
    return HybridEngine.of(built)


def _tell(observer: Observer | None, engine: str, reason: str) -> None:
    if observer is not None:
        observer(Choice(engine, reason))
