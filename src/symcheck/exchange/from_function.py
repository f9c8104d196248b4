"""Models from a function in Python that gives the successors of a state."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from fractions import Fraction
from math import inf, isfinite
from numbers import Integral, Real
from typing import Any, Generic, TypeVar, Unpack, cast

import numpy as np

from symcheck.api import Model, model_type, takes_options
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
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards, reward_structure
from symcheck.exchange.from_matrix import check_rows, identifier, label
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.options import OptionValues, make_options
from symcheck.syntax.ast import ModelType, Type
from symcheck.syntax.parse import parse_model

__all__ = ["from_function"]

S = TypeVar("S", bound=Hashable)
Weight = float | Fraction
Distribution = Mapping[S, Weight] | Iterable[tuple[Weight, S]]
Step = Callable[[S], Distribution[S] | Iterable[tuple[str | None, Distribution[S]]] | None]
StateReward = Callable[[S], Weight]
TransitionReward = Callable[[S, str | None, S], Weight]
_LARGEST = 1 << 61  # of the values of a variable


@takes_options
@converts_memory_error()
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
            action may be None. Nothing or None: the state is a deadlock.
        labels: name to a predicate on states.
        rewards: name to a function of states, or to a pair of it (or None) and a function of
            (state, action, successor).
        type: 'dtmc', 'ctmc' or 'mdp'; None: an MDP if `step` gives actions, else a DTMC.
        max_states: the most states that are explored.
        options: see `symcheck.Options`.

    Raises:
        ModelFault: a function raises, or gives something wrong; the message names the state.
        ResourceError: there are more than `max_states` states.
        UsageError: an argument has a wrong value.

    Example:
        >>> import symcheck
        >>> def step(x):
        ...     return {x + 1: 0.5, x - 1: 0.5} if 0 < x < 4 else {x: 1}
        >>> symcheck.from_function(1, step).check("P=? [ F s=4 ]").value
        0.25
    """
    settings = make_options(options)
    asked = model_type(type)
    found = _explore(initial if isinstance(initial, list) else [initial], step, max_states)
    kind = asked or (ModelType.MDP if found.has_actions else ModelType.DTMC)
    if found.has_actions and kind is not ModelType.MDP:
        raise UsageError(f"step gives actions, which only an MDP has, not a {kind.name}")
    columns = _columns(found.states)
    order = np.lexsort([values for _, _, values in reversed(columns)])
    matrix, rows = _matrix(found, kind, order)

    def describe(row: int) -> str:
        state, action = rows[row]
        return f"the distribution of {action or 'step'} in state {state!r}"

    check_rows(kind, matrix, settings.check_sums, describe, deadlocks=kind is not ModelType.MDP)
    states = [found.states[i] for i in order.tolist()]
    members = {
        label(name): np.array([bool(_call(f"labels[{name!r}]", holds, s)) for s in states])
        for name, holds in (labels or {}).items()
    }
    names = tuple(dict.fromkeys(a for _, a in rows if a is not None))
    number: dict[str | None, int] = {None: -1}
    number |= {name: i for i, name in enumerate(names)}
    data = ExplicitData(
        kind,
        [(name, type_, values[order]) for name, type_, values in columns],
        matrix,
        names,
        np.array([number[a] for _, a in rows], np.int32),
        members | {"init": order < found.initial},
        [_rewards(n, given, kind, matrix, states, rows) for n, given in (rewards or {}).items()],
    )
    return explicit_model(data, settings, states)


# ----------------------------------------------------------------------------------- exploration


@dataclass
class _Explored(Generic[S]):
    """States in the order in which they are found, and their choices.

    Attributes:
        initial: how many of the states, the first ones, are initial.
        choices: number of the state, action, and successors by number.
    """

    states: list[S]
    initial: int
    choices: list[tuple[int, str | None, dict[int, Weight]]] = field(default_factory=list)
    has_actions: bool = False


def _explore(initial: Sequence[S], step: Step[S], max_states: int) -> _Explored[S]:
    """Explore breadth first. Raises ModelFault, ResourceError."""
    if not initial:
        raise UsageError("initial: the list of initial states is empty")
    numbers: dict[S, int] = {}
    for state in initial:
        _number_of(numbers, state, "initial")
    found = _Explored(list(numbers), len(numbers))
    for number, state in enumerate(found.states):  # which grows meanwhile
        if number >= max_states:
            raise ResourceError(
                f"there are more than {max_states:,} states"
                "\n  hint: is the number of states finite? max_states allows more"
            )
        who = f"step({state!r})"
        given = _call("step", step, state)
        pairs = _pairs(who, given)
        if isinstance(given, Mapping) or all(isinstance(first, Real) for first, _ in pairs):
            choices: list[tuple[str | None, list[tuple[Any, Any]]]]
            choices = [(None, pairs)] if pairs else []
        else:
            found.has_actions = True
            choices = [
                (None if action is None else identifier("an action", action), _pairs(who, chosen))
                for action, chosen in pairs
            ]
        for action, distribution in choices:
            successors: dict[int, Weight] = {}
            for weight, target in distribution:
                if (
                    not isinstance(weight, float | int | np.number | Fraction)
                    or not 0 <= weight < inf
                ):
                    raise _fault(
                        f"{who} gives {weight!r} as the probability or rate of {target!r}",
                        "expected a finite number that is not negative",
                    )
                if weight != 0:
                    at = _number_of(numbers, target, who)
                    successors[at] = successors.get(at, 0) + cast(Weight, weight)
                    if at == len(found.states):
                        found.states.append(target)
            found.choices.append((number, action, successors))
    return found


def _pairs(who: str, given: Any) -> list[tuple[Any, Any]]:
    """Pairs (probability, state), or (action, distribution). Raises ModelFault."""
    if isinstance(given, Mapping):
        return [(weight, target) for target, weight in given.items()]
    items = (
        _call(who, list, given) if isinstance(given, Iterable) else [] if given is None else None
    )
    if items is None or not all(isinstance(i, tuple) and len(i) == 2 for i in items):
        shown = given if items is None else items
        raise _fault(
            f"{who} gives {shown!r}",
            "expected {state: probability}, pairs (probability, state), or, in an MDP, pairs "
            "(action, distribution)",
        )
    return items


def _number_of(numbers: dict[S, int], state: S, who: str) -> int:
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


# ---------------------------------------------------------------------------------------- arrays


def _columns(states: Sequence[Any]) -> list[tuple[str, Type, Int64s]]:
    """The variables and their values."""
    first = states[0]
    names: tuple[str, ...] = ()
    if len({type(s) for s in states}) == 1:
        names = getattr(first, "_fields", ())
        if is_dataclass(first):
            names = tuple(f.name for f in fields(first))
    for name in names:
        try:
            parse_model(f"dtmc const int {identifier('a variable', name)};")
        except InputError:
            message = f"{name!r}, a field of the states, cannot be the name of a variable"
            raise NameFault(Diagnostic(message, code="name", hint="rename the field")) from None
    if not names:
        return [("s", *_column(states))]
    return [(name, *_column([getattr(s, name) for s in states])) for name in names]


def _column(values: Sequence[Any]) -> tuple[Type, Int64s]:
    """The type of a variable, and its value in each state."""
    if all(isinstance(v, bool | np.bool_) for v in values):
        return Type.BOOL, np.array(values, np.int64)
    if not all(isinstance(v, Integral) and -_LARGEST < int(v) < _LARGEST for v in values):
        number = {v: i for i, v in enumerate(dict.fromkeys(values))}
        values = [number[v] for v in values]
    return Type.INT, np.array(values, np.int64)


def _matrix(
    found: _Explored[S], kind: ModelType, order: Int64s
) -> tuple[SparseMatrix, list[tuple[S, str | None]]]:
    """The matrix over states in this order, and the state and action of each row."""
    place = np.argsort(order).tolist()
    choices = sorted(found.choices, key=lambda choice: place[choice[0]])
    counts = np.bincount([place[c[0]] for c in choices], minlength=len(place))
    if kind is not ModelType.MDP:
        own = {c[0]: c[2] for c in choices}
        choices = [(i, None, own.get(i, {})) for i in order.tolist()]
    entries = [sorted((place[t], w) for t, w in c[2].items()) for c in choices]
    matrix = SparseMatrix(
        starts_of(np.array([len(row) for row in entries], np.int64)),
        np.array([t for row in entries for t, _ in row], np.int32),
        _vector([w for row in entries for _, w in row]),
        len(place),
        starts_of(counts) if kind is ModelType.MDP else None,
    )
    return matrix, [(found.states[i], action) for i, action, _ in choices]


def _vector(values: Sequence[Any]) -> Numbers:
    """float64, or objects if there are Fractions."""
    if not any(isinstance(v, Fraction) for v in values):
        return np.array(values, np.float64)
    out = np.empty(len(values), object)
    out[:] = values
    return out


def _rewards(
    name: str,
    given: Any,
    kind: ModelType,
    matrix: SparseMatrix,
    states: Sequence[S],
    rows: Sequence[tuple[S, str | None]],
) -> ExplicitRewards:
    what = f"rewards[{identifier('a reward structure', name)!r}]"
    of_states, of_moves = given if isinstance(given, tuple) else (given, None)

    def earned(function: Callable[..., Any], *arguments: Any) -> Any:
        value = _call(what, function, *arguments)
        if not isinstance(value, Real) or not isfinite(value):
            call = f"{what}({', '.join(map(repr, arguments))})"
            raise _fault(f"{call} is {value!r}: expected a finite number")
        return value

    own = (
        np.zeros(len(states))
        if of_states is None
        else _vector([earned(of_states, s) for s in states])
    )
    if of_moves is None:
        return reward_structure(name, kind, matrix, own)
    row = np.repeat(np.arange(matrix.rows), np.diff(matrix.indptr)).tolist()
    moves = zip(row, matrix.indices.tolist(), strict=True)
    entries = _vector([earned(of_moves, *rows[r], states[t]) for r, t in moves])
    return reward_structure(name, kind, matrix, own, entries)
