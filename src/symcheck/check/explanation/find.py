"""Counterexamples and witnesses of `P bound [ path ]`: which paths, how likely, and what they show.

An upper bound is broken by paths that satisfy the path formula, a lower bound by paths that violate
it, if they have enough probability together (Han, Katoen & Damman 2009). In an MDP they are those
of a strategy that makes them as likely as possible; such a strategy also shows that a bound on the
best case holds, but no set of paths shows what holds under every strategy.

Paths that violate `left U right` reach a state from which it cannot be satisfied any more, or use
up the steps that it has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import islice, pairwise
from math import fsum

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.counterexample import CommandSet, Counterexample, LikelyPath
from symcheck.check.explanation.fewest_commands import fewest_commands
from symcheck.check.explanation.labelled_transitions import labelled_transitions
from symcheck.check.path_formulas import (
    NextPath,
    Path,
    RewardPath,
    StatePath,
    TemporalPath,
    UntilPath,
    negated,
    resolve,
)
from symcheck.check.rebind_exact import exactly_bound
from symcheck.check.state_formulas import satisfying, states_of, threshold_of
from symcheck.check.strategies.strategy import strategy_of
from symcheck.check.strategies.to_explicit import to_explicit
from symcheck.direction import Direction
from symcheck.engines.base import erased
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.states import State
from symcheck.errors import UnsupportedError
from symcheck.kernels.arrays import Int64s
from symcheck.matrices.numbers import sum_segments
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.likeliest_paths import (
    FoundPath,
    StepProblem,
    WalkProblem,
    likeliest_paths,
)
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.command_text import command_text
from symcheck.semantics.interpreter import choices
from symcheck.syntax.ast import Bound, Expression, ModelType, ProbabilityOperator
from symcheck.syntax.printer import pretty

__all__ = ["find_counterexample"]

_ROUNDINGS = 8
"""Rounding errors of an entry of the matrix and its multiplication, in units, or more."""
_NEARLY = Fraction(999_999_999, 1_000_000_000)
"""The sum is computed accurately once a plain sum reaches this part of the threshold."""


@dataclass(frozen=True, eq=False)
class _Question:
    """Which paths are asked for.

    satisfies: whether they satisfy the path formula. need, strict: the probability to be reached
    (exceeded). refutes: whether they show that the property is false. rows: the rows of the
    strategy of an MDP, for formulas without a bound on steps.
    """

    engine: ExplicitEngine
    problem: WalkProblem | StepProblem
    initial: int
    satisfies: bool
    refutes: bool
    need: Fraction
    strict: bool
    rows: Int64s | None


def find_counterexample(
    context: Context, formula: Expression, paths: int | None = None, *, commands: bool = True
) -> Counterexample:
    """Paths, and commands, that show why a bound on a probability is false, or true.

    Args:
        context: the model, on any engine.
        formula: `P bound [ path ]` with X, U, F, G, W or R, with or without a bound on steps.
        paths: the most paths; None for 1000.
        commands: also look for a small set of commands that suffices.

    Raises:
        UnsupportedError: the formula is of another kind, or no set of paths shows its value.
    """
    context = to_explicit(replace(context, relevant_states=None))
    asked = _question(context, formula)
    limit = tuning.COUNTEREXAMPLE_PATHS if paths is None else paths
    found: list[FoundPath] = []
    total: float | Fraction = Fraction(0) if asked.engine.exact else 0.0
    complete = _reached(total, found, asked)
    for path in islice(likeliest_paths(asked.problem, asked.initial), limit):
        if complete:
            break
        found.append(path)
        total += path.probability
        complete = _reached(total, found, asked)
    note = ""
    if not complete:
        note = (
            f"the limit of {limit} paths was reached before the threshold"
            if len(found) == limit
            else "these are all paths: the threshold is within their rounding errors"
        )
    result = Counterexample(
        " ".join((formula.span.text or pretty(formula)).split()),
        asked.refutes,
        asked.satisfies,
        asked.need,
        asked.strict,
        _named(asked.engine, asked.rows, found),
        total if asked.engine.exact else fsum(p.probability for p in found),
        complete,
        note=note,
    )
    return result.with_commands(*_commands(asked)) if commands else result


def _reached(total: float | Fraction, found: list[FoundPath], asked: _Question) -> bool:
    """Whether the sum of the probabilities is proved to reach what is needed.

    total: the sum; of doubles, a rough one, which is computed again near the threshold.
    """
    if not asked.engine.exact and total > asked.need * _NEARLY:
        slack = _ROUNDINGS * UNIT_ROUNDOFF
        total = fsum(p.probability * (1 - slack * len(p.states)) for p in found)
        total *= 1 - 2 * UNIT_ROUNDOFF
    elif not asked.engine.exact:
        return asked.need <= 0 and not asked.strict
    return total > asked.need if asked.strict else total >= asked.need


# ---------------------------------------------------------------------------------- question


def _question(context: Context, formula: Expression) -> _Question:
    """What has to be shown, and by which paths. Raises UnsupportedError."""
    engine = context.engine.capability(ExplicitEngine)
    assert engine is not None
    if not isinstance(formula, ProbabilityOperator) or not isinstance(formula.bound, Bound):
        raise UnsupportedError(
            "counterexamples are for P with a bound, such as P<=0.1 [ F states ]"
        )
    if context.options.fairness:
        raise UnsupportedError("counterexamples are not supported with -fair")
    initial = context.engine.initial
    holds = satisfying(context, formula, initial)
    broken = initial - holds
    operator, threshold = formula.bound.operator.value, _threshold(context, formula)
    upper = operator in ("<", "<=")
    refutes = bool(broken)
    satisfies = upper == refutes
    # P(path) > p breaks <= p; P(not path) > 1 - p breaks >= p; and so on.
    need = threshold if satisfies else 1 - threshold
    strict = (operator in ("<=", ">=")) == refutes
    first = int(np.argmax(context.engine.to_bools(broken if refutes else initial)))
    path = resolve(formula.path, states_of(context), context.engine)
    path = path if satisfies else negated(path)
    rows: Int64s | None = None
    matrix = _probabilities(engine)
    if engine.model.type is ModelType.MDP:
        given = formula.direction or ("max" if upper else "min")
        if (given == "max") is not satisfies:
            raise UnsupportedError(
                f"the property is {str(not refutes).lower()} because of every strategy, and paths "
                "belong to one\n  hint: a counterexample exists if the property is "
                f"{str(refutes).lower()}"
            )
        if isinstance(path, UntilPath) and path.window.trivial:
            rows = strategy_of(context, formula, states_of).rows
            matrix = engine.matrix.choose(rows)
    problem = _problem(context, matrix, path)
    return _Question(engine, problem, first, satisfies, refutes, need, strict, rows)


def _threshold(context: Context, formula: ProbabilityOperator) -> Fraction:
    """The threshold as it stands in the text: 1/6 is a rational, and no double."""
    model = context.engine.model
    if context.rebind is not None and not model.exact and model.builder is None:
        twin = context.rebind(exactly_bound(model))
        if isinstance(twin, ProbabilityOperator) and isinstance(twin.bound, Bound):
            return threshold_of(twin.bound)
    assert isinstance(formula.bound, Bound)
    return threshold_of(formula.bound)


def _probabilities(engine: ExplicitEngine) -> SparseMatrix:
    """The matrix; that of the embedded chain for a CTMC."""
    matrix = engine.matrix
    if engine.model.type is not ModelType.CTMC:
        return matrix
    sums = sum_segments(matrix.data, matrix.indptr) if matrix.exact else matrix.row_sums()
    return matrix.divided(sums)


def _problem(context: Context, matrix: SparseMatrix, path: Path) -> WalkProblem | StepProblem:
    """Where paths may pass and where they end. Raises UnsupportedError."""
    to = context.engine.to_bools
    everything, nothing = to(context.engine.all), to(context.engine.none)
    match path:
        case NextPath(target, window, negative) if window.trivial:
            end = to(~target if negative else target)
            return StepProblem(matrix, everything, nothing, end, 1)
        case UntilPath(left, right, window, negative):
            passing, goal = to(left), to(right)
            end = nothing
            if negative:
                impossible = graph.prob0(matrix, passing, goal, Direction.MAX)
                passing, goal, end = passing & ~goal & ~impossible, impossible, ~goal
            if window.trivial:
                return WalkProblem(matrix, passing, goal)
            if context.engine.model.type is ModelType.CTMC or not window.at_once:
                raise UnsupportedError(
                    "counterexamples are not supported for bounds on time, and for lower bounds on "
                    "steps\n  hint: F<=k with steps of a DTMC or MDP is supported"
                )
            steps = window.steps().upper
            assert steps is not None
            if (steps + 1) * matrix.states > tuning.PATH_STEPS:
                raise UnsupportedError(
                    f"{steps:,} steps of {matrix.states:,} states are too many for a counterexample"
                )
            return StepProblem(matrix, passing, goal, end, steps)
        case NextPath() | StatePath() | TemporalPath() | RewardPath():
            raise UnsupportedError(
                "counterexamples are supported for one of X, F, G, U, W and R over states"
            )


# ------------------------------------------------------------------------------------- names


def _named(
    engine: ExplicitEngine, strategy: Int64s | None, found: list[FoundPath]
) -> tuple[LikelyPath, ...]:
    """The paths with the valuations of their states and the actions of their steps."""
    numbers = sorted({s for path in found for s in path.states})
    members = ArraySet.of(engine.states, np.array(numbers, np.int64))
    states = {
        n: State(erased(engine), n, values)
        for n, values in zip(numbers, engine.valuations(members), strict=True)
    }
    actions = _Actions(engine, states)
    return tuple(
        LikelyPath(
            tuple(states[s] for s in path.states),
            tuple(
                actions.of(row if strategy is None else int(strategy[a]), a, b)
                for row, (a, b) in zip(path.rows, pairwise(path.states), strict=True)
            ),
            path.probability,
        )
        for path in found
    )


@dataclass(frozen=True)
class _Actions:
    """The actions of transitions; those of a chain are found by the interpreter."""

    engine: ExplicitEngine
    states: Mapping[int, State]
    known: dict[tuple[int, int], str] = field(default_factory=dict)

    def of(self, row: int, source: int, target: int) -> str:
        """The action of a row, or those of a transition of a chain."""
        model = self.engine.model
        if model.type is ModelType.MDP or model.builder is not None:
            action = int(self.engine.explored.choice_actions[row])
            return model.actions[action] if action >= 0 else ""
        if (source, target) not in self.known:
            wanted = self.states[target].valuation
            enabled = choices(model, self.states[source].valuation, check_sums=False)
            names = [c.action or "" for c in enabled if any(s == wanted for _, s in c.branches)]
            self.known[source, target] = ",".join(dict.fromkeys(filter(None, names)))
        return self.known[source, target]


# ---------------------------------------------------------------------------------- commands


def _commands(asked: _Question) -> tuple[CommandSet | None, str]:
    """A small set of commands, or why there is none."""
    engine, problem, model = asked.engine, asked.problem, asked.engine.model
    matrix, rows, steps = problem.matrix, asked.rows, None
    if model.builder is not None:
        return None, "no commands: the model has none"
    if model.type is ModelType.CTMC:
        return None, "no commands: without a command, the others of a CTMC are more likely"
    if isinstance(problem, StepProblem):
        steps = problem.steps
        if problem.end.any():
            return None, "no commands: with a bound on steps, they are found for F and U"
    if engine.states > tuning.COMMAND_STATES:
        return None, f"no commands: they are found for at most {tuning.COMMAND_STATES:,} states"
    if problem.target[asked.initial] or not problem.through[asked.initial]:
        return None, "no commands: the initial state decides"
    if asked.satisfies:  # any strategy may show it, and another one may need fewer commands
        matrix, rows = engine.matrix, None
    labelled = labelled_transitions(
        engine, matrix, rows, problem.through, problem.target, asked.initial
    )
    found = (
        None
        if labelled is None
        else fewest_commands(labelled, asked.need, strict=asked.strict, steps=steps)
    )
    if labelled is None or found is None:
        return None, "no commands: the threshold is too close to the value (-exact decides)"
    chosen, smallest = found
    texts = [command_text(model, labelled.commands[i]) for i in np.flatnonzero(chosen)]
    return CommandSet(tuple(sorted(texts)), len(labelled.commands), smallest), ""
