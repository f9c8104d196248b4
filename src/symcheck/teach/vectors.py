"""The computation of until probabilities: prob0, prob1, and the iterates of the linear system."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.base import Engine, StateSet
from symcheck.numerics.linear.mec_quotient import MecQuotient, collapse
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem, Progress, Solution
from symcheck.options import Options
from symcheck.teach.board import Board, Show, played
from symcheck.view.choice_graph import GivenModel, engine_of, set_of

if TYPE_CHECKING:
    from symcheck.matrices.rows import Int64s

__all__ = ["UntilTrace", "until_show", "until_trace"]

_MOST_FRAMES = 40
"""Iterations that a page shows: the first ones, and later ones with growing gaps."""


@dataclass(frozen=True, eq=False)
class UntilTrace:
    """The probability of an until formula in three steps.

    Attributes:
        zero, one: the states with probability 0 and 1, by graph analysis.
        unknown: the other states.
        problem: x = A x + b over the unknown states (None if there are none).
        solution: the solution of the problem; None if the trace ended before.
        steps: the iterations of the numerical method, with copies of the vectors, float64[unknown],
            and of the policy, the chosen row of the problem for each unknown state.
    """

    zero: StateSet
    one: StateSet
    unknown: StateSet
    problem: LinearProblem | None = field(repr=False)
    solution: Solution | None = field(repr=False)
    steps: tuple[Progress, ...] = field(repr=False)
    engine: Engine = field(repr=False)

    def _repr_html_(self) -> str:
        from symcheck.page.document import fragment

        board = Board(self.engine, numbers="0.000…0.000")
        return fragment(played(board, until_show("Until, iteration by iteration", self, board)))


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
        left, right: formulas such as "true" and "d=6", or sets of states of the engine.
        options: `options.method` names the method; 'interval' has both bounds, and 'policy' the
            policies of an MDP. None: 'interval'.
        direction: minimise or maximise over strategies; None for a chain.
        max_steps: the trace ends after so many iterations.

    Raises:
        SymcheckError: as the method.
    """
    engine = engine_of(model)
    left, right = set_of(engine, left), set_of(engine, right)
    zero = engine.graph.prob0(left, right, direction)
    one = engine.graph.prob1(left, right, direction)
    unknown = ~(zero | one)
    if not unknown:
        return UntilTrace(zero, one, unknown, None, None, (), engine)
    problem = engine.system(unknown, direction).reachability(one).problem()
    quotient = None if problem.matrix is None else collapse(problem)
    steps: list[Progress] = []

    def watch(step: Progress) -> None:
        steps.append(_expanded(step, quotient))
        if len(steps) == max_steps:
            raise _EnoughError

    try:
        solution = solve_linear(problem, options or Options(method="interval"), watch)
    except _EnoughError:
        solution = None
    return UntilTrace(zero, one, unknown, problem, solution, tuple(steps), engine)


def _expanded(step: Progress, quotient: MecQuotient | None) -> Progress:
    """A copy of an iteration, with a value for each state where end components are collapsed."""
    if quotient is None or step.lower is None or len(step.lower) != quotient.problem.n:
        lower, upper = (None if v is None else np.array(v) for v in (step.lower, step.upper))
        policy = None if step.policy is None else np.array(step.policy)
        return replace(step, lower=lower, upper=upper, policy=policy)
    upper = step.lower if step.upper is None else step.upper
    found = quotient.expand(Solution(step.lower, upper, step.method, strategy=step.policy))
    high = None if step.upper is None else found.upper
    return replace(step, lower=found.lower, upper=high, policy=found.strategy)


def until_show(name: str, trace: UntilTrace, board: Board) -> Show:
    """prob0, prob1 and the iterations on the state graph."""
    engine, board_ids = trace.engine, board.drawn
    zero, one, unknown = map(engine.to_bools, (trace.zero, trace.one, trace.unknown))
    marks = [*board.marks("zero", board.names(zero)), *board.marks("one", board.names(one))]
    start: list[float | None] = [1.0 if one[s] else 0.0 if zero[s] else None for s in board_ids]
    counts = f"{trace.zero.count} states have probability 0, {trace.one.count} have probability 1"
    first: dict[str, Any] = {
        "title": "Graph analysis",
        "note": f"{counts}, {trace.unknown.count} are unknown.",
        "marks": marks,
        "low": start,
    }
    place = np.cumsum(unknown) - 1
    rows = _rows(trace, board)
    frames = [first]
    for step in (trace.steps[i] for i in _spread(len(trace.steps), _MOST_FRAMES)):
        frame: dict[str, Any] = {"title": f"Iteration {step.iteration}", "marks": marks}
        if step.policy is not None:
            frame["title"] = f"Policy {step.iteration}"
            frame["rows"] = rows[step.policy[step.policy >= 0]].tolist()
        elif np.isfinite(step.width):
            frame["note"] = f"width {step.width:.3g}"
        for key, vector in (("low", step.lower), ("high", step.upper)):
            if vector is not None:
                frame[key] = [
                    float(f"{vector[place[s]]:.5g}") if unknown[s] else known
                    for s, known in zip(board_ids.tolist(), start, strict=True)
                ]
        frames.append(frame)
    return {
        "name": name,
        "note": f"{len(trace.steps)} iterations; {len(frames) - 1} of them are shown."
        if trace.steps
        else "Graph analysis decides every state: there is nothing to iterate.",
        "panes": board.panes,
        "frames": frames,
        "keys": [
            ["zero", "probability 0"],
            ["one", "probability 1"],
            *([["chosen", "the policy"]] if any("rows" in f for f in frames) else []),
        ],
    }


def _rows(trace: UntilTrace, board: Board) -> Int64s:
    """The row of the whole matrix for each row of the problem."""
    groups = board.graph.matrix.groups
    unknown = trace.engine.to_bools(trace.unknown)
    return np.flatnonzero(unknown if groups is None else np.repeat(unknown, np.diff(groups)))


def _spread(count: int, most: int) -> list[int]:
    """At most `most` of the numbers from 0 to count - 1: the first ones, then growing gaps."""
    if count <= most:
        return list(range(count))
    later = np.geomspace(most // 2, count - 1, most - most // 2).astype(int)
    return sorted({*range(most // 2), *later.tolist()})
