"""The rows of concurrent games as what several sides choose at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NoReturn

import numpy as np

from symcheck.errors import Diagnostic, ModelFault
from symcheck.explicit.explored import ExploredModel
from symcheck.matrices.rows import Int64s
from symcheck.numerics.concurrent_games import Game, Side
from symcheck.semantics.interpreter import Choice, choices, value
from symcheck.semantics.joint_actions import Picks, picks
from symcheck.semantics.model import BoundModel
from symcheck.semantics.state_faults import describe_state

__all__ = ["game_between", "require_joint_actions"]


def game_between(explored: ExploredModel, maximisers: frozenset[int]) -> Game:
    """The game of some players, who maximise, against all others.

    Args:
        explored: the rows of a concurrent game, which `require_joint_actions` accepts.
        maximisers: the players, numbered from 0.
    """
    matrix, picked = explored.matrix.doubles(), _picks_of_rows(explored)
    sides = []
    for side in (maximisers, set(range(picked.shape[1])) - maximisers):
        labels = np.zeros(matrix.rows, np.int64)
        for player in sorted(side):
            _, labels = np.unique(
                labels * (int(picked.max(initial=0)) + 1) + picked[:, player], return_inverse=True
            )
        sides.append(Side.of(labels, matrix.state_of_row, matrix.states))
    return Game(matrix, *sides)


def _picks_of_rows(explored: ExploredModel) -> Int64s:
    """By which action of each player a row is taken, as a number: int64[rows, players]."""
    model = explored.model
    numbers: dict[str | None, int] = {None: 0}
    of_events = {
        e.action: [numbers.setdefault(pick, len(numbers)) for pick in e.picks] for e in model.events
    }
    nothing = [0] * len(model.players)
    table = np.array([*(of_events[a] for a in model.actions), nothing], np.int64)
    return table[explored.choice_actions]


def require_joint_actions(explored: ExploredModel) -> None:
    """Refuse a concurrent game in which something is not decided by what players pick.

    Raises:
        ModelFault: in some state, several choices have the same joint action, or none has.
    """
    model, matrix = explored.model, explored.matrix
    assert matrix.groups is not None
    available = [picks(model.modules, p) for p in model.players]
    expected, able = np.ones(matrix.states, np.int64), np.zeros(matrix.states, np.bool_)
    for actions in available:
        count = np.zeros(matrix.states, np.int64)
        for guard in actions.values():
            count += np.asarray(explored.evaluate(guard), np.bool_)
        expected *= np.maximum(count, 1)
        able |= count > 0
    joint = matrix.state_of_row * (len(model.actions) + 1) + explored.choice_actions + 1
    _, first = np.unique(joint, return_index=True)
    repeated = np.setdiff1d(np.arange(matrix.rows), first)
    if len(repeated):
        _refuse_several(model, _state(explored, int(matrix.state_of_row[repeated[0]])))
    stuck = able & np.isin(np.arange(matrix.states), explored.deadlocks)
    missing = np.flatnonzero((np.diff(matrix.groups) != expected) | stuck)
    if len(missing):
        _refuse_missing(model, available, _state(explored, int(missing[0])))


def _state(explored: ExploredModel, number: int) -> tuple[bool | int, ...]:
    return next(explored.states.valuations(np.array([number])))


def _refuse_several(model: BoundModel, state: tuple[bool | int, ...]) -> NoReturn:
    known: dict[str | None, Choice] = {}
    for choice in choices(model, state):
        before = known.setdefault(choice.action, choice)
        for one, other in zip(before.commands, choice.commands, strict=True):
            if one is not other:
                module = model.modules[one.module].name
                raise ModelFault(
                    Diagnostic(
                        f"two commands of module {module} take part if {_named(choice.action)} is "
                        f"picked, for example in state {describe_state(model.variables, state)}",
                        other.span,
                        "joint-action",
                        "their guards or their actions have to exclude each other",
                    )
                )
    raise AssertionError("no joint action has several choices")


def _refuse_missing(
    model: BoundModel, available: Sequence[Picks], state: tuple[bool | int, ...]
) -> NoReturn:
    present = {c.action for c in choices(model, state)}
    enabled: list[list[str | None]] = [
        [a for a, guard in actions.items() if value(model, state, guard)] for actions in available
    ]
    for joint in product(*(actions or [None] for actions in enabled)):
        name = ",".join(a for a in joint if a) or None
        if name not in present:
            first = next(a for a in joint if a)
            commands = (c for m in model.modules for c in m.commands if c.action == first)
            raise ModelFault(
                Diagnostic(
                    f"no command of its player tells what follows if {_named(name)} is picked, "
                    f"for example in state {describe_state(model.variables, state)}",
                    next(commands).span,
                    "joint-action",
                    "a player may pick each action of an enabled command, whatever others pick",
                )
            )
    raise AssertionError("each joint action has a choice")


def _named(action: str | None) -> str:
    return "nothing" if action is None else f"[{action}]"
