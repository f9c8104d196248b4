"""The automatic choice of an engine, by the size of the model and of its diagrams.

1. A short explicit exploration. A model that it explores completely is small, and diagrams would
   not pay. Diagrams with a very small budget then count the states of a very regular model. Unless
   they find many, the exploration goes on, longer if there are few transitions.
2. Diagrams, with a budget of look-ups in their cache. If they compress the states, the model is
   explored with them. The matrix of an MDP is then written as compressed rows if these fit well
   into memory, because prob0 and prob1 of an MDP are nested fixpoints, which are slow on diagrams.
   Of a chain, only the rows that a property needs are written. If the rows do not fit into memory,
   blocks replace them.
3. If the diagrams do not compress the states, or the budget is used up, the explicit exploration
   continues up to a number of states; then the diagrams get a larger budget, and so on. After the
   last turn, or once the diagrams have found more states than the exploration may visit, the
   diagrams have no budget. Three cases end with an explicit exploration limited by memory only: the
   diagrams were complete and did not compress; they would need relations made on the fly; or they
   found fewer states with the largest budget than the exploration had.

A wrong guess therefore costs a bounded share of the run, and the explored states are kept.

Where the properties do not depend on some variables of a large model, the diagrams only count its
states. The properties are checked on the model restricted to the cone of influence, if it has no
more states than the first exploration.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING

from symcheck.engines import tuning
from symcheck.engines.base import Engine, erased
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.machine import available_memory
from symcheck.options import Options
from symcheck.syntax.ast import Call
from symcheck.syntax.traversal import names, nodes

if TYPE_CHECKING:
    from symcheck.explicit.build import Exploration
    from symcheck.semantics.model import BoundModel
    from symcheck.semantics.reduction.symmetry import Symmetry
    from symcheck.symbolic.model import StateSpace, Transitions
    from symcheck.symbolic.reachability.search import SearchState

__all__ = ["EngineChoice", "choose"]

_TOO_MANY_READS = "updates read too many variables for diagrams"


@dataclass(frozen=True, slots=True)
class EngineChoice:
    """The name of the chosen engine, and the reason of the choice."""

    engine: str
    reason: str

    def __str__(self) -> str:
        return f"{self.engine}: {self.reason}"


Observer = Callable[[object], None]


def choose(model: BoundModel, options: Options, observer: Observer | None = None) -> Engine:
    """Build a model on the engine that suits it (see the steps above).

    Args:
        model: the bound model.
        options: limits of time and memory, and the order of the variables.
        observer: receives the events of the builders, and the EngineChoice.

    Returns:
        An explicit, sparse or hybrid engine.

    Raises:
        ModelFault: the model has a fault in some state.
        ResourceError: a limit of time or memory was reached.
    """
    from symcheck.kernels.explore.breadth_first import malloc_trim

    if model.initial is not None and _valuation_count(model) > tuning.INITIAL_CANDIDATES:
        options = _with_variable_order(model, options, observer)
        return _symbolic_engine(
            _explore_symbolically(model, options, None),
            options,
            observer,
            "explicit exploration would have to try too many initial states",
        )
    with suppress(_ExplorationMemoryError):  # the error holds the states until this block ends
        return _take_turns(model, options, observer)
    malloc_trim()
    options = _with_variable_order(model, options, observer)
    return _symbolic_engine(
        _explore_symbolically(model, options, None),
        options,
        observer,
        "the states of an explicit exploration exceed the memory limit",
    )


class _ExplorationMemoryError(Exception):
    """The states of the explicit exploration do not fit into memory."""


@contextmanager
def _diagrams_need_less(model: BoundModel) -> Iterator[None]:
    """A context in which memory ends for the explicit exploration alone."""
    try:
        yield
    except (MemoryLimitError, MemoryError) as error:
        from symcheck.dd.cudd_import import available

        if _is_unbounded(model) or not available():
            raise
        raise _ExplorationMemoryError from error


def _is_unbounded(model: BoundModel) -> bool:
    """Whether some integer has no bounds, so that diagrams are impossible."""
    return any(v.low is None for v in model.variables)


def _take_turns(model: BoundModel, options: Options, observer: Observer | None) -> Engine:
    """Explore explicitly and with diagrams in turn.

    Raises:
        _ExplorationMemoryError: the explicit exploration needs too much memory, and diagrams are
            possible.
        ModelFault, ResourceError: as for `choose`.
    """
    from symcheck.explicit.build import Exploration
    from symcheck.kernels.explore.breadth_first import malloc_trim

    exploration = Exploration(model, options)
    with _diagrams_need_less(model):
        exploration = _explore_first(exploration, model, options, observer)
        if exploration.complete:
            return _small_model(exploration, observer)
    if (reason := _why_no_diagrams(model)) is not None:
        exploration.run(None, observer)
        return _explicit_engine(exploration, observer, reason)
    with _diagrams_need_less(model):
        restricted = _restrict(model, options, exploration)
    found: StateSpace | str | None
    found = _large_regular_model(model, options, exploration, any_size=restricted is not None)
    if found is None:
        malloc_trim()  # returns the memory of the diagrams
        with _diagrams_need_less(model):
            if _explore_sparse_model(exploration, tuning.SPARSE_MODEL_TRANSITIONS):
                return _small_model(exploration, observer)
        options = _with_variable_order(model, options, observer)
        found = _alternate(model, options, exploration, observer)
        if exploration.complete and isinstance(found, str):
            return _explicit_engine(exploration, observer, found)
    del exploration  # frees the memory of its states
    if isinstance(found, str):
        space, reason = _explore_symbolically(model, options, None), found
    else:
        space, reason = found, _compression(found)
    return _symbolic_engine(space, options, observer, reason, restricted)


def _explore_first(
    exploration: Exploration, model: BoundModel, options: Options, observer: Observer | None
) -> Exploration:
    """Explore shortly, and longer where states are symmetric or have few transitions: then anew, up
    to symmetry.
    """
    if not exploration.run(tuning.SMALL_MODEL_STATES):
        from symcheck.explicit.build import Exploration
        from symcheck.semantics.reduction.symmetry import observed_symmetries

        if symmetries := observed_symmetries(model):
            exploration = Exploration(model, options, symmetries=symmetries)
            exploration.run(_states_up_to_symmetry(symmetries), observer)
        if not exploration.complete:
            _explore_sparse_model(exploration, tuning.FIRST_EXPLORATION_TRANSITIONS)
    return exploration


def _why_no_diagrams(model: BoundModel) -> str | None:
    """The reason why diagrams are impossible; None if they are possible."""
    from symcheck.dd.cudd_import import available

    if _is_unbounded(model):
        return "there are integers without bounds"
    return None if available() else "decision diagrams are not installed"


def _alternate(
    model: BoundModel, options: Options, exploration: Exploration, observer: Observer | None
) -> StateSpace | str:
    """Diagrams and the exploration in turn, with larger budgets in each turn.

    Returns:
        The states as a diagram; or the reason for the exploration, if it is complete, and
        otherwise for diagrams without a budget.
    """
    from symcheck.kernels.explore.breadth_first import malloc_trim

    _, most = tuning.SELECTION_TURNS[-1]
    for lookups, states in tuning.SELECTION_TURNS:
        first, last = lookups == tuning.SELECTION_TURNS[0][0], states == most
        match _try_diagrams(model, options, lookups, unless_rounding=first):
            case _DiagramFailure() as failure:
                malloc_trim()
            case space:
                return space
        found = failure.found_states
        if found > most:
            return f"there are more than {found:,} states"
        if failure.hopeless or (last and 0 < found < exploration.progress.states):
            states = max(states, _state_capacity(exploration))
        if found <= states:
            with _diagrams_need_less(model):
                if exploration.run(states, observer):
                    return failure.reason
    return f"there are more than {states:,} states"


@dataclass(frozen=True, slots=True)
class _DiagramFailure:
    """The reason why diagrams were not chosen in a turn.

    hopeless: whether a larger budget would not change that. found_states: number of states that
    were found before the budget was used up.
    """

    reason: str
    hopeless: bool = False
    found_states: int = 0


class _SearchInterrupted(TimeLimitError):
    """The search on diagrams used up its budget after it had found some states."""

    def __init__(self, message: str, found_states: int) -> None:
        super().__init__(message)
        self.found_states = found_states


def _with_variable_order(model: BoundModel, options: Options, observer: Observer | None) -> Options:
    """The options with the requested order as variable names, so that it is computed only once."""
    from symcheck.symbolic.build import chosen_order

    return (
        options
        if options.order is None
        else replace(options, order=chosen_order(model, options, observer))
    )


def _try_diagrams(
    model: BoundModel, options: Options, lookups: int, *, unless_rounding: bool = True
) -> StateSpace | _DiagramFailure:
    """The states as a diagram that compresses them, or the reason why there is none.

    unless_rounding: do not try a model that rounds numbers of many bits.
    """
    if unless_rounding and _rounds_many_bits(model):
        return _DiagramFailure(_TOO_MANY_READS)
    unfinished = f"diagrams did not finish within {lookups / 1e6:g} million look-ups"
    try:
        space = _explore_symbolically(model, options, lookups)
    except UnsupportedError as error:
        return _DiagramFailure(str(error), hopeless=True)
    except _SearchInterrupted as error:
        return _DiagramFailure(unfinished, found_states=error.found_states)
    except TimeLimitError:  # before the search for states began
        return _DiagramFailure(unfinished, hopeless=lookups >= tuning.SELECTION_TURNS[-1][0])
    except MemoryLimitError as error:
        return _DiagramFailure(str(error))
    nodes = space.states.node_count
    if nodes > tuning.MAX_NODES_PER_STATE * space.count:
        return _DiagramFailure(
            f"{nodes:,} nodes for {space.count:,} states compress nothing", hopeless=True
        )
    return space


def _state_capacity(exploration: Exploration) -> int:
    """The number of states that fit into memory, estimated from the memory used so far."""
    progress = exploration.progress
    memory = progress.memory + available_memory()
    return int(tuning.EXPLORATION_MEMORY_SHARE * memory * progress.states / max(progress.memory, 1))


def _states_up_to_symmetry(symmetries: Sequence[Symmetry]) -> int:
    """States up to which a model with these symmetries is explored before diagrams are tried."""
    permutations = prod(s.order for s in symmetries)
    return min(tuning.SYMMETRIC_STATES, tuning.SYMMETRIC_STATES_PER_PERMUTATION * permutations)


class _TooManyTransitionsError(Exception):
    """The model has too many transitions for the first explicit exploration."""


def _explore_sparse_model(exploration: Exploration, most_transitions: int) -> bool:
    """Explore up to SPARSE_MODEL_STATES states or a number of transitions; whether the exploration
    is complete.
    """

    def stop_if_dense(_: object) -> None:
        if exploration.progress.transitions > most_transitions:
            raise _TooManyTransitionsError

    try:
        return exploration.run(tuning.SPARSE_MODEL_STATES, stop_if_dense)
    except _TooManyTransitionsError:
        return exploration.complete


def _large_regular_model(
    model: BoundModel, options: Options, exploration: Exploration, *, any_size: bool
) -> StateSpace | None:
    """The states of a large model (or of one of any size), if diagrams find them with a very small
    budget.

    Not of orbits, whose number is unknown, nor in an order that has to be searched for.
    """
    if options.order is not None or exploration.orbits is not None:
        return None
    space = _try_diagrams(model, options, tuning.FIRST_LOOKUPS)
    if isinstance(space, _DiagramFailure):
        return None
    return space if any_size or _is_large(space.count, exploration) else None


def _is_large(states: int, exploration: Exploration) -> bool:
    """Whether a model with so many states is too large for `_explore_sparse_model`."""
    progress = exploration.progress
    transitions = states * progress.transitions / max(progress.explored, 1)
    return states > tuning.SPARSE_MODEL_STATES or transitions > tuning.SPARSE_MODEL_TRANSITIONS


@dataclass(frozen=True, slots=True)
class _Restricted:
    """The states of a model restricted to a cone of influence, and the variables outside."""

    exploration: Exploration
    outside: tuple[str, ...]


def _restrict(model: BoundModel, options: Options, exploration: Exploration) -> _Restricted | None:
    """Restrict a model to the cone of influence of what is asked.

    None if there is no variable outside, or if the restricted model has more states than were
    explored so far of the whole model.
    """
    from symcheck.explicit.build import Exploration
    from symcheck.semantics.features import Feature, offers
    from symcheck.semantics.reduction.cone_of_influence import outside_cone, restricted_to_cone
    from symcheck.semantics.reduction.symmetry import observed_symmetries

    observations = model.observations if offers(model, Feature.REDUCTION) else None
    outside = frozenset() if observations is None else outside_cone(model, observations)
    if not outside:
        return None
    smaller = restricted_to_cone(model, outside)
    restricted = Exploration(smaller, options, symmetries=observed_symmetries(smaller))
    if not restricted.run(exploration.progress.explored):
        return None
    return _Restricted(restricted, tuple(model.variables[i].name for i in sorted(outside)))


def _restricted_engine(
    restricted: _Restricted, whole: Engine, observer: Observer | None, reason: str
) -> Engine:
    """The engine of a restricted model, with the counts of the whole one."""
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.explicit.orbits import Represented

    explored, outside = restricted.exploration.finish(), ", ".join(restricted.outside)
    orbits = explored.represented
    represented = Represented(
        states=whole.states,
        initial=whole.initial.count,
        deadlocks=whole.deadlocks.count,
        choices=whole.choices,
        transitions=whole.transitions,
        symmetries=() if orbits is None else orbits.symmetries,
        initial_orbits=(whole.initial.count,),
        outside_cone=restricted.outside,
    )
    reason = f"the properties do not depend on {outside}; {reason}"
    _report_choice(observer, "explicit", reason)
    return erased(ExplicitEngine(explored, represented=represented))


def _small_model(exploration: Exploration, observer: Observer | None) -> Engine:
    reason = f"the model has only {_states(exploration.progress.states)}"
    return _explicit_engine(
        exploration,
        observer,
        reason + (" up to symmetry" if exploration.orbits is not None else ""),
    )


def _compression(space: StateSpace) -> str:
    """The reason for an engine with diagrams."""
    return f"a BDD of {space.states.node_count:,} nodes holds {space.count:,} states"


def _valuation_count(model: BoundModel) -> int:
    """Number of valuations of the variables, reachable or not; 0 if an integer is unbounded."""
    return prod(
        0 if v.low is None or v.high is None else v.high - v.low + 1 for v in model.variables
    )


def _rounds_many_bits(model: BoundModel) -> bool:
    """Whether some update rounds a number that depends on more than ROUNDED_BITS state bits."""
    bits = {
        v.name: 1 if v.low is None or v.high is None else (v.high - v.low).bit_length()
        for v in model.variables
    }
    updates = {id(u): u for e in model.events for p in e.participants for c in p for u in c.updates}
    subexpressions = (
        n for u in updates.values() for _, value in u.assignments for n in nodes(value)
    )
    rounded = (
        n
        for n in subexpressions
        if isinstance(n, Call) and n.function in ("ceil", "floor", "round")
    )
    return any(sum(bits[x] for x in names(n)) > tuning.ROUNDED_BITS for n in rounded)


def _states(number: int) -> str:
    return "1 state" if number == 1 else f"{number:,} states"


def _explicit_engine(exploration: Exploration, observer: Observer | None, reason: str) -> Engine:
    from symcheck.engines.explicit.engine import ExplicitEngine

    _report_choice(observer, "explicit", reason)
    explored = exploration.finish()
    return erased(ExplicitEngine(explored, represented=explored.represented))


def _explore_symbolically(model: BoundModel, options: Options, lookups: int | None) -> StateSpace:
    """The reachable states as a diagram.

    Raises:
        TimeLimitError: `lookups` cache look-ups, or the time limit of the options, are used up.
        UnsupportedError: `lookups` is not None, and some update needs a relation made on the fly.
    """
    from symcheck.dd.manager import DiagramManager
    from symcheck.symbolic.build import build
    from symcheck.symbolic.reachability.search import reach

    manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    manager.limit_lookups(lookups)
    symbolic = build(model, options, manager=manager)
    if lookups is not None and any(event.evaluated for event in symbolic.events):
        raise UnsupportedError(_TOO_MANY_READS)
    last: deque[SearchState] = deque(maxlen=1)
    try:
        space = reach(symbolic, watch=last.append)
    except TimeLimitError as error:
        manager.limit_time(None)
        manager.limit_lookups(None)
        found_states = sum(symbolic.manager.count(f.states, symbolic.encoding.rows) for f in last)
        raise _SearchInterrupted(str(error), found_states) from error
    manager.limit_lookups(None)
    return space


def _symbolic_engine(
    space: StateSpace,
    options: Options,
    observer: Observer | None,
    reason: str,
    restricted: _Restricted | None = None,
) -> Engine:
    """The engine of a model whose states are a diagram, or of its restriction."""
    from symcheck.engines.symbolic.forms import HybridEngine, SparseEngine
    from symcheck.engines.symbolic.materialized import materialize
    from symcheck.symbolic.matrix.transitions import transitions

    if observer is not None:
        observer(space)
    built: Transitions = transitions(space, options, observer)
    engine = SparseEngine.of(built)
    if restricted is not None:
        return _restricted_engine(restricted, erased(engine), observer, reason)
    size = engine.transitions * tuning.MATRIX_ENTRY_BYTES
    if (
        space.symbolic.model.type.has_choices
        and engine.states <= tuning.MATERIALIZED_STATES
        and size <= tuning.ROWS_MEMORY_SHARE * available_memory()
    ):
        _report_choice(
            observer,
            "sparse",
            f"{reason}, and its rows take only {size / 1e6:,.0f} MB",
        )
        return erased(materialize(engine))
    if size <= tuning.ROWS_MEMORY_SHARE * available_memory():
        _report_choice(
            observer, "sparse", f"{reason}, and the rows that properties need fit into memory"
        )
        return erased(engine)
    _report_choice(
        observer, "hybrid", f"{reason}, and rows of {size / 1e6:,.0f} MB exceed the limit"
    )
    return erased(HybridEngine.of(built))


def _report_choice(observer: Observer | None, engine: str, reason: str) -> None:
    if observer is not None:
        observer(EngineChoice(engine, reason))
