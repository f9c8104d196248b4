"""The computation of until probabilities and of expected rewards: the states that graph analysis
decides, and the iterates of the linear system of the others.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.base import Engine, Equations, StateSet
from symcheck.errors import UsageError
from symcheck.numerics.linear.mec_quotient import MecQuotient, collapse
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem, Progress, Solution
from symcheck.options import Options
from symcheck.page.document import JsonObject
from symcheck.semantics.rewards import Reward, Structure
from symcheck.tables import counted
from symcheck.teach.board import Board, Show, played
from symcheck.teach.source import direction_of
from symcheck.view.choice_graph import GivenModel, engine_of, set_of

if TYPE_CHECKING:
    from fractions import Fraction

    from symcheck.matrices.rows import Int64s

__all__ = [
    "EquationsTrace",
    "RewardTrace",
    "UntilTrace",
    "equations_show",
    "plain",
    "reward_trace",
    "until_trace",
]

_MOST_FRAMES = 40
"""Iterations that a page shows: the first ones, and later ones with growing gaps."""


@dataclass(frozen=True, eq=False)
class Decided:
    """States whose value graph analysis decides.

    Attributes:
        states: the states.
        value: their value.
        text: what they are, as "probability 0".
        mark: how a page marks them.
    """

    states: StateSet
    value: float
    text: str
    mark: str


@dataclass(frozen=True, eq=False)
class EquationsTrace:
    """Graph analysis, the equations of the other states, and the iterations of their solution.

    Attributes:
        decided: the states that graph analysis decides.
        unknown: the other states.
        problem: x = A x + b over the unknown states (None if there are none).
        solution: the solution of the problem; None if the trace ended before.
        steps: the iterations of the numerical method, with copies of the vectors, float64[unknown],
            and of the policy, the chosen row of the problem for each unknown state.
        rows: the row of the whole matrix for each row of the problem, int64[rows].
        relative: whether the widths of the steps are relative to the values.
    """

    decided: tuple[Decided, Decided]
    unknown: StateSet
    problem: LinearProblem | None = field(repr=False)
    solution: Solution | None = field(repr=False)
    steps: tuple[Progress, ...] = field(repr=False)
    rows: Int64s = field(repr=False)
    engine: Engine = field(repr=False)
    relative: bool = True

    title = "Equations, iteration by iteration"

    def _repr_html_(self) -> str:
        from symcheck.page.document import fragment

        board = Board(self.engine, numbers="0.000…0.000")
        return fragment(played(board, equations_show(self.title, self, board)))


class UntilTrace(EquationsTrace):
    """The probability of an until formula in three steps (see `EquationsTrace`)."""

    title = "Until, iteration by iteration"

    @property
    def zero(self) -> StateSet:
        """The states with probability 0, by graph analysis."""
        return self.decided[0].states

    @property
    def one(self) -> StateSet:
        """The states with probability 1, by graph analysis."""
        return self.decided[1].states


class RewardTrace(EquationsTrace):
    """The expected reward until a target in three steps (see `EquationsTrace`)."""

    title = "Expected reward, iteration by iteration"

    @property
    def target(self) -> StateSet:
        """The states to be reached: reward 0."""
        return self.decided[0].states

    @property
    def infinite(self) -> StateSet:
        """The states with infinite expected reward, by graph analysis."""
        return self.decided[1].states


class _EnoughError(Exception):
    """Ends a method whose trace is long enough."""


def until_trace(
    model: GivenModel | Engine,
    left: str | StateSet,
    right: str | StateSet,
    options: Options | None = None,
    direction: Direction | None = None,
    *,
    max_steps: int | None = None,
) -> UntilTrace:
    """Trace the computation of the probability of `left U right`.

    The trace keeps a copy of each iterate: use it for small models.

    Args:
        model: the model, or an engine.
        left: a formula such as "true", or a set of states of the engine.
        right: a formula such as "d=6", or a set of states of the engine.
        options: `options.method` names the method; 'interval' has both bounds, and 'policy' the
            policies of an MDP. None: 'interval'.
        direction: minimise or maximise over strategies, "min" or "max"; None for a chain.
        max_steps: the trace ends after so many iterations.

    Raises:
        SymcheckError: as the method.
        UsageError: the direction is missing, of an MDP, or is no direction.
    """
    engine = engine_of(model)
    direction = direction_of(engine, direction)
    left, right = set_of(engine, left), set_of(engine, right)
    zero = engine.graph.prob0(left, right, direction)
    one = engine.graph.prob1(left, right, direction)
    unknown = ~(zero | one)
    decided = (
        Decided(zero, 0.0, "probability 0", "zero"),
        Decided(one, 1.0, "probability 1", "one"),
    )
    equations = engine.system(unknown, direction).reachability(one)
    options = options or Options(method="interval")
    return UntilTrace(
        decided,
        unknown,
        *_iterations(equations, options, max_steps),
        engine,
        options.relative,
    )


def reward_trace(
    model: GivenModel | Engine,
    target: str | StateSet,
    reward: str | Reward = "",
    options: Options | None = None,
    direction: Direction | None = None,
    *,
    max_steps: int | None = None,
) -> RewardTrace:
    """Trace the computation of the expected reward until `target` is reached.

    The trace keeps a copy of each iterate: use it for small models.

    Args:
        model: the model, or an engine.
        target: a formula such as "s=7", or a set of states of the engine.
        reward: the name of a reward structure ('': the first one), or `Steps()` or `Time()` of
            `symcheck.semantics.rewards`.
        options: `options.method` names the method; 'policy' has the policies of an MDP. None:
            'optimistic'.
        direction: minimise or maximise over strategies, "min" or "max"; None for a chain.
        max_steps: the trace ends after so many iterations.

    Raises:
        SymcheckError: as the method.
        UsageError: the model has no such reward structure, or the direction is missing, of an MDP,
            or is no direction.

    Examples:
        >>> teach.reward_trace(die, "s=7", "tosses").infinite  # doctest: +SKIP
    """
    engine = engine_of(model)
    direction = direction_of(engine, direction)
    requested = _structure(engine, reward) if isinstance(reward, str) else reward
    target = set_of(engine, target)
    infinite = ~engine.finite_reward(requested, target, direction)
    unknown = ~(infinite | target)
    decided = (
        Decided(target - infinite, 0.0, "reward 0, the target", "one"),
        Decided(infinite, np.inf, "infinite reward", "zero"),
    )
    equations = engine.system(unknown, direction).expected_reward(requested, infinite=infinite)
    options = options or Options(method="optimistic")
    return RewardTrace(
        decided,
        unknown,
        *_iterations(equations, options, max_steps),
        engine,
        options.relative,
    )


def _structure(engine: Engine, name: str) -> Structure:
    names = [r.name for r in engine.model.rewards]
    if names and not name:
        return Structure(0)
    if name not in names:
        listed = ", ".join(f'"{n}"' for n in names if n) or "none with a name"
        raise UsageError(f'the model has no reward structure "{name}"; it has {listed}')
    return Structure(names.index(name))


def _iterations(
    equations: Equations, options: Options, max_steps: int | None
) -> tuple[LinearProblem | None, Solution | None, tuple[Progress, ...], Int64s]:
    """The problem of equations, its solution, the iterations, and the numbers of its rows."""
    if not equations.n:
        return None, None, (), np.zeros(0, np.int64)
    problem, usable = equations.problem(), equations.usable_rows
    rows = np.arange(len(problem.constant)) if usable is None else np.flatnonzero(usable)
    quotient = None if problem.matrix is None else collapse(problem)
    steps: list[Progress] = []

    def watch(step: Progress) -> None:
        steps.append(_expanded(step, quotient))
        if len(steps) == max_steps:
            raise _EnoughError

    try:
        solution = solve_linear(problem, options, watch)
    except _EnoughError:
        solution = None
    return problem, solution, tuple(steps), rows


def _expanded(step: Progress, quotient: MecQuotient | None) -> Progress:
    """A copy of an iteration, with a value for each state where end components are collapsed."""
    if quotient is None or step.lower is None or len(step.lower) != quotient.problem.n:
        lower, upper = (None if v is None else np.array(v) for v in (step.lower, step.upper))
        policy = None if step.policy is None else np.array(step.policy)
        return replace(step, lower=lower, upper=upper, policy=policy)
    upper = step.lower if step.upper is None else step.upper
    solution = quotient.expand(Solution(step.lower, upper, step.method, strategy=step.policy))
    high = None if step.upper is None else solution.upper
    return replace(step, lower=solution.lower, upper=high, policy=solution.strategy)


def equations_show(name: str, trace: EquationsTrace, board: Board) -> Show:
    """Graph analysis and the iterations on the state graph."""
    engine, board_ids = trace.engine, board.listed
    unknown = engine.to_bools(trace.unknown)
    start = np.full(engine.states, np.nan)
    marks = []
    for part in trace.decided:
        members = engine.to_bools(part.states)
        marks += board.marks(part.mark, board.names(members))
        start[members] = part.value
    parts = [(part.text, part.states) for part in trace.decided] + [("unknown", trace.unknown)]
    counts = "; ".join(f"{text}: {counted(states.count, 'state')}" for text, states in parts)
    first: JsonObject = {
        "title": "Graph analysis",
        "note": f"{counts}.",
        "marks": marks,
        "low": [None if np.isnan(v) else plain(v) for v in start[board_ids]],
    }
    rows = _rows(trace, board)
    frames = [first]
    for step in (trace.steps[i] for i in _spread(len(trace.steps), _MOST_FRAMES)):
        frame: JsonObject = {"title": f"Iteration {step.iteration}", "marks": marks}
        if step.policy is not None:
            frame["title"] = f"Policy {step.iteration}"
            frame["rows"] = rows[step.policy[step.policy >= 0]].tolist()
        elif np.isfinite(step.width):
            frame["note"] = f"{'relative ' if trace.relative else ''}width {step.width:.3g}"
        for key, vector in (("low", step.lower), ("high", step.upper)):
            if vector is not None:
                values = start.copy()
                values[unknown] = vector
                frame[key] = [plain(v) for v in values[board_ids]]
        frames.append(frame)
    some = len(frames) - 1 < len(trace.steps)
    left_out = f"; {len(frames) - 1} of them are shown" if some else ""
    return {
        "name": name,
        "note": f"{counted(len(trace.steps), 'iteration')}{left_out}."
        if trace.steps
        else "Graph analysis decides every state: there is nothing to iterate.",
        "panes": board.panes,
        "frames": frames,
        "keys": [
            *([part.mark, part.text] for part in trace.decided),
            *([["chosen", "the policy"]] if any("rows" in f for f in frames) else []),
        ],
    }


def plain(value: float | Fraction | np.floating) -> float | str:
    """A number with six digits, or the text of one that JSON does not have."""
    number = float(value)
    return float(f"{number:.6g}") if isfinite(number) else "∞" if number > 0 else str(number)


def _rows(trace: EquationsTrace, board: Board) -> Int64s:
    """The row of the whole matrix for each row of the problem."""
    groups = board.graph.matrix.groups
    unknown = trace.engine.to_bools(trace.unknown)
    every = np.flatnonzero(unknown if groups is None else np.repeat(unknown, np.diff(groups)))
    return every[trace.rows]


def _spread(count: int, most: int) -> list[int]:
    """At most `most` of the numbers from 0 to count - 1: the first ones, then growing gaps."""
    if count <= most:
        return list(range(count))
    later = np.geomspace(most // 2, count - 1, most - most // 2).astype(int)
    return sorted({*range(most // 2), *later.tolist()})
