"""Models from a function in Python that gives the successors of a state."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from fractions import Fraction
from math import inf
from numbers import Integral, Real
from typing import Any, TypeVar, Unpack

import numpy as np

from symcheck.api.arguments import takes_options
from symcheck.api.model import Model
from symcheck.errors import (
    Diagnostic,
    InputError,
    ModelFault,
    NameFault,
    ResourceError,
    SymcheckError,
    UsageError,
    converts_memory_error,
)
from symcheck.exchange.api_io import explicit_model
from symcheck.exchange.explicit_data import ExplicitData, reward_structure
from symcheck.exchange.python.from_matrix import (
    identifier,
    label,
    named,
    number_array,
    numbered_actions,
    plain_type,
)
from symcheck.explicit.explored import RACE
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.options import Options, OptionValues, make_options
from symcheck.semantics.features import require_type
from symcheck.semantics.state_faults import sums_to_one
from symcheck.syntax.ast import ModelType, Type
from symcheck.syntax.parse import parse_model

__all__ = ["from_function", "model_of_steps"]

S = TypeVar("S", bound=Hashable)
Weight = float | Fraction
Distribution = Mapping[S, Weight] | Iterable[tuple[Weight, S]]
Step = Callable[[S], Distribution[S] | Iterable[tuple[str | None, Distribution[S]]] | None]
StateReward = Callable[[S], Weight]
TransitionReward = Callable[[S, str | None, S], Weight]
_LARGEST = 1 << 61  # of the values of a variable


@takes_options
def from_function(
    initial: S | list[S],
    step: Step[S],
    *,
    labels: Mapping[str, Callable[[S], bool]] | None = None,
    rewards: Mapping[str, StateReward[S] | tuple[StateReward[S] | None, TransitionReward[S] | None]]
    | None = None,
    type: ModelType | str | None = None,
    max_states: int = 1_000_000,
    **options: Unpack[OptionValues],
) -> Model:
    """A model of the states that a function reaches from the initial ones.

    The fields of named tuples and dataclasses are the variables. Other states have the variable
    `s`: their value if they are integers, else their number in the order in which they are found.
    A field with other values than integers or truth values is numbered in the same way.

    Args:
        initial: the initial state, or a list of several.
        step: from a state to its distribution: a mapping of states to probabilities (rates of a
            CTMC), or pairs (probability, state); in an MDP pairs (action, distribution), where the
            action may be None. In a Markov automaton, a state has a distribution of rates, or pairs
            (action, distribution) of probabilities. Nothing or None: the state is a deadlock.
        labels: name to a predicate on states.
        rewards: name to a function of states, or to a pair of it (or None) and a function of
            (state, action, successor).
        type: 'dtmc', 'ctmc', 'mdp' or 'ma'; None: an MDP if `step` gives actions, else a DTMC.
        max_states: the most states that are explored.
        options: see `symcheck.Options`.

    Raises:
        ModelFault: a function raises, or gives something wrong; the message names the state.
        ResourceError: there are more than `max_states` states.
        UsageError: an argument has a wrong value.

    Examples:
        >>> import symcheck
        >>> def step(x):
        ...     return {x + 1: 0.5, x - 1: 0.5} if 0 < x < 4 else {x: 1}
        >>> symcheck.from_function(1, step).check("P=? [ F s=4 ]").value
        0.25
    """
    return model_of_steps(
        initial if isinstance(initial, list) else [initial],
        step,
        labels,
        rewards,
        plain_type(type, told=True),
        max_states,
        make_options(options),
    )


@converts_memory_error()
def model_of_steps(
    start: list[S],
    step: Step[S],
    labels: Mapping[str, Callable[[S], bool]] | None,
    rewards: Mapping[str, StateReward[S] | tuple[StateReward[S] | None, TransitionReward[S] | None]]
    | None,
    model_kind: ModelType | None,
    max_states: int,
    settings: Options,
    node_of: Mapping[S, Hashable] | None = None,
) -> Model:
    """See `from_function`; `node_of`: how messages name a state of a graph."""
    has_rates = model_kind is not None and model_kind.continuous_time
    mixed = model_kind is not None and model_kind.immediate_choices
    if model_kind is not None:
        require_type(model_kind)
    weighted = (has_rates and not mixed) or not settings.check_sums
    explored, choices, racing, has_actions = _explore(
        start, step, max_states, weighted, mixed, node_of
    )
    kind = model_kind or ModelType.with_properties(has_choices=has_actions)
    if has_actions and not kind.has_choices:
        raise UsageError(f"step gives actions, which only an MDP has, not a {kind.name}")
    columns = _columns(explored)
    order = np.lexsort([values for _, _, values in reversed(columns)])
    position = np.argsort(order).tolist()
    choices.sort(key=lambda choice: position[choice[0]])
    sources = [position[number] for number, _, _ in choices]
    lengths = np.array([len(successors) for _, _, successors in choices], np.int64)
    groups, actions = None, None
    if kind.has_choices:
        groups = starts_of(np.bincount(sources, minlength=len(explored)))
        actions = [action for _, action, _ in choices]
    else:
        lengths = np.bincount(sources, lengths, len(explored)).astype(np.int64)
    moves = [
        (explored[number], action, position[target], weight)
        for number, action, successors in choices
        for target, weight in sorted(successors.items(), key=lambda move: position[move[0]])
    ]
    matrix = SparseMatrix(
        starts_of(lengths),
        np.array([target for _, _, target, _ in moves], np.int32),
        number_array([weight for *_, weight in moves], "the probabilities"),
        len(explored),
        groups,
    )
    states = [explored[i] for i in order.tolist()]
    structures = []
    for name, given in named("rewards", rewards).items():
        what = f"rewards[{name!r}]"
        of_states, of_moves = given if isinstance(given, tuple) else (given, None)
        state_rewards = [_call(what, of_states, s) if of_states else 0 for s in states]
        earned = of_moves and [_call(what, of_moves, s, a, states[t]) for s, a, t, _ in moves]
        structures.append(
            reward_structure(
                identifier("a reward structure", name),
                kind,
                matrix,
                number_array(state_rewards, what),
                None if earned is None else number_array(earned, what),
            )
        )
    members = {
        label(name): np.array([bool(_call(f"labels[{name!r}]", holds, s)) for s in states])
        for name, holds in named("labels", labels).items()
    }
    members["init"] = order < len(set(start))
    names, codes = numbered_actions(actions, matrix)
    if mixed:
        codes[np.isin([number for number, _, _ in choices], racing)] = RACE
    data = ExplicitData(
        kind,
        [(name, type_, values[order]) for name, type_, values in columns],
        matrix,
        names,
        codes,
        members,
        structures,
    )
    return explicit_model(data, settings, states)


# ----------------------------------------------------------------------------------- exploration


def _explore(
    initial: list[S],
    step: Step[S],
    max_states: int,
    weighted: bool,
    mixed: bool,
    node_of: Mapping[S, Hashable] | None,
) -> tuple[list[S], list[tuple[int, str | None, dict[int, Weight]]], list[int], bool]:
    """Explore breadth first; `weighted`: the numbers need not sum to 1; `mixed`: only those of
    actions do.

    Returns:
        The states; the number of the state, the action and the successors of each choice; the
        numbers of the states whose distribution belongs to no action; whether there are actions.

    Raises:
        ModelFault, ResourceError, UsageError: see `from_function`.
    """
    numbers: dict[S, int] = {}
    for state in initial:
        _number(numbers, state, "initial")
    if not initial:
        raise UsageError("initial: the list of initial states is empty")
    states, choices, has_actions = list(numbers), [], False
    racing: list[int] = []
    for number, state in enumerate(states):  # which grows meanwhile
        if number >= max_states:
            raise ResourceError(
                f"there are more than {max_states:,} states",
                hint="is the number of states finite? max_states allows more",
            )
        who = f"step({state!r})" if node_of is None else f"node {node_of[state]!r}"
        given = _call("step", step, state)
        pairs = _pairs(who, given)
        distributions: list[tuple[str | None, list[tuple[Any, Any]]]] = (
            [(None, pairs)] if pairs else []
        )
        free = isinstance(given, Mapping) or all(isinstance(p, Real) for p, _ in pairs)
        if free:
            racing.append(number)
        else:
            has_actions = True
            distributions = [
                (a and identifier("an action", a), _pairs(who, chosen)) for a, chosen in pairs
            ]
        for action, distribution in distributions:
            successors: dict[int, Weight] = {}
            if _swapped(distribution):
                raise _fault(
                    f"{who} gives pairs (state, probability)",
                    "expected pairs (probability, state), or {state: probability}",
                )
            for weight, target in distribution:
                valid = isinstance(weight, Real) and 0 <= float(weight) < inf
                if not valid:
                    goal = target if node_of is None else node_of[target]
                    raise _fault(
                        f"{who} gives {weight!r} as the probability or rate of {goal!r}",
                        "expected a finite number that is not negative",
                    )
                if weight:
                    at = _number(numbers, target, who)
                    successors[at] = successors.get(at, 0) + weight
                    if at == len(states):
                        states.append(target)
            total = sum(successors.values())
            if not (weighted or (mixed and free)) and not sums_to_one(total):
                of = f" for {action!r}" if action else ""
                raise _fault(f"the probabilities of {who}{of} sum to {total}, not to 1")
            choices.append((number, action, successors))
    return states, choices, racing, has_actions


def _pairs(who: str, given: Any) -> list[tuple[Any, Any]]:
    """Pairs (probability, state), or (action, distribution). Raises ModelFault."""
    if isinstance(given, Mapping):
        return [(weight, target) for target, weight in given.items()]
    items = [given]
    if given is None or isinstance(given, Iterable):
        items = _call(who, list, given or ())
    if not all(isinstance(i, tuple) and len(i) == 2 for i in items):
        raise _fault(
            f"{who} gives {given if items[0] is given else items!r}",
            "expected {state: probability}, pairs (probability, state), or, in an MDP, pairs "
            "(action, distribution)",
        )
    return items


def _swapped(distribution: Sequence[tuple[Any, Any]]) -> bool:
    """Whether the states look like probabilities, and the probabilities like states."""
    integers = all(isinstance(weight, Integral) for weight, _ in distribution)
    shares = [target for _, target in distribution if isinstance(target, float) and 0 < target < 1]
    return integers and len(shares) == len(distribution) > 0 and sums_to_one(sum(shares))


def _number(numbers: dict[S, int], state: S, who: str) -> int:
    try:
        return numbers.setdefault(state, len(numbers))
    except TypeError:
        raise _fault(
            f"{who}: the state {state!r} is not hashable", "use tuples, named tuples or frozen data"
        ) from None


def _call(what: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """The value of a function of the user. Raises ModelFault."""
    try:
        return function(*arguments)
    except (SymcheckError, MemoryError):
        raise
    except Exception as error:
        call = what if function is list else f"{what}({', '.join(map(repr, arguments))})"
        raise _fault(f"{call} raised {type(error).__name__}: {error}") from error


def _fault(message: str, hint: str | None = None) -> ModelFault:
    return ModelFault(Diagnostic(message, code="python", hint=hint))


# ------------------------------------------------------------------------------------- variables


def _columns(states: Sequence[Any]) -> list[tuple[str, Type, Int64s]]:
    """The variables and their values."""
    first = states[0]
    names: tuple[str, ...] = getattr(first, "_fields", ())
    if is_dataclass(first):
        names = tuple(f.name for f in fields(first))
    if not names or any(type(s) is not type(first) for s in states):
        return [("s", *_column(states))]
    for name in names:
        try:
            parse_model(f"dtmc const int {name};")
        except InputError:
            message = f"{name!r}, a field of the states, cannot be the name of a variable"
            raise NameFault(Diagnostic(message, code="name", hint="rename the field")) from None
    return [(name, *_column([getattr(s, name) for s in states])) for name in names]


def _column(values: Sequence[Any]) -> tuple[Type, Int64s]:
    """The type of a variable, and its value in each state."""
    if all(isinstance(v, bool | np.bool_) for v in values):
        return Type.BOOL, np.array(values, np.int64)
    if not all(isinstance(v, Integral) and abs(int(v)) < _LARGEST for v in values):
        number = {v: i for i, v in enumerate(dict.fromkeys(values))}
        values = [number[v] for v in values]
    return Type.INT, np.array(values, np.int64)
