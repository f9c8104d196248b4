"""The fewest commands with which a bound is broken already.

A set of commands is critical if the transitions that need no other commands reach the target with
the required probability, or for a bound on a reward, if runs earn the required reward before they
take another transition. Rewards are not negative, so that what they earn in this part of the model
is a lower bound of the whole. A set that is not critical is enlarged until no command can be added;
each critical set then contains one of the commands left out. Smallest sets that meet all of these
cuts are found by integer programming, until one is critical: no smaller set can be.

Sources: Wimmer, Jansen, Vorpahl, Abraham, Katoen & Becker (2013), 'High-level counterexamples for
probabilistic automata'; Dehnert, Jansen, Wimmer, Abraham & Katoen (2014), 'Fast debugging of PRISM
models', who learn cuts as well; Quatmann, Jansen, Dehnert, Wimmer, Abraham, Katoen & Becker (2015),
'Counterexamples for expected rewards', for subsystems that are critical for rewards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symcheck.check import tuning
from symcheck.check.explanation.labelled_transitions import LabelledTransitions
from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.kernels.arrays import Bools
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.numbers import full
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.options import Options

__all__ = ["fewest_commands"]

_SETTINGS = Options(epsilon=1e-12)


@dataclass
class _Checker:
    """Decides which sets of commands are critical.

    checks: how many were decided. undecided: whether some value was too close to the threshold.
    """

    transitions: LabelledTransitions
    threshold: Fraction
    strict: bool
    steps: int | None
    checks: int = 0
    undecided: bool = field(default=False)

    def critical(self, chosen: Bools) -> bool:
        """Whether a set of commands is proved to be critical."""
        self.checks += 1
        low, high = self._bounds(self.transitions.restricted(chosen))
        reached = low > self.threshold if self.strict else low >= self.threshold
        refuted = high <= self.threshold if self.strict else high < self.threshold
        self.undecided |= not reached and not refuted
        return bool(reached)

    def _bounds(self, matrix: SparseMatrix) -> tuple[float | Fraction, float | Fraction]:
        """Bounds on the (maximal) probability of reaching the target, or expected reward."""
        n, initial = self.transitions.states, self.transitions.initial
        goal, start = np.zeros((2, n + 1), np.bool_)
        goal[n], start[initial] = True, True
        edges = graph.Incidence(matrix)
        unknown = graph.forward_reachable(edges, start) & graph.backward_reachable(edges, goal)
        unknown[n] = False
        if not unknown[initial]:
            return 0.0, 0.0
        inside, constant = matrix.among(unknown), matrix.sums(unknown, goal)
        first = int(np.count_nonzero(unknown[:initial]))
        if self.steps is None:
            direction = None if inside.groups is None else Direction.MAX
            of_reward = self.transitions.of_reward
            problem = LinearProblem(
                constant, inside, direction=direction, probability=not of_reward
            )
            solution = solve_linear(problem, _SETTINGS)
            return solution.lower[first], solution.upper[first]
        value = full(inside.states, 0, rational=matrix.is_rational)
        for _ in range(self.steps):
            value = inside.multiply(value) + constant
            if inside.groups is not None:
                value = np.maximum.reduceat(value, inside.groups[:-1])
        slack = 0 if matrix.is_rational else 2 * self.steps * (matrix.longest + 4) * UNIT_ROUNDOFF
        return value[first] * (1 - slack), value[first] * (1 + slack)


def fewest_commands(
    transitions: LabelledTransitions, threshold: Fraction, *, strict: bool, steps: int | None = None
) -> tuple[Bools, bool] | None:
    """A small critical set of commands.

    Args:
        transitions: with their commands.
        threshold: the probability (reward) to be reached, or with `strict` exceeded.
        strict: see `threshold`.
        steps: the most steps of a path; None for no bound.

    Returns:
        The set, bool[commands], and whether it is proved to be a smallest one. None if the set of
        all commands is not proved to be critical.
    """
    checker = _Checker(transitions, threshold, strict, steps)
    count = len(transitions.commands)
    if not checker.critical(np.ones(count, np.bool_)):
        return None
    cuts: list[Bools] = []
    while checker.checks < tuning.COMMAND_SET_CHECKS:
        chosen = _hitting_set(cuts, count)
        if checker.critical(chosen):
            return chosen, not checker.undecided
        cuts.append(~_enlarged(chosen, checker.critical))
    return _reduced(np.ones(count, np.bool_), checker.critical), False


def _hitting_set(cuts: list[Bools], count: int) -> Bools:
    """A smallest set that meets each cut."""
    require_memory_for_scipy()
    from scipy.optimize import Bounds, LinearConstraint, milp

    if not cuts:
        return np.zeros(count, np.bool_)
    answer = milp(
        np.ones(count),
        constraints=LinearConstraint(np.array(cuts, np.float64), lb=1.0),
        integrality=np.ones(count),
        bounds=Bounds(0, 1),
    )
    if answer.x is None:
        raise NumericalError(f"the smallest set of commands was not found: {answer.message}")
    return np.asarray(answer.x > 0.5)


def _enlarged(chosen: Bools, critical: Callable[[Bools], bool]) -> Bools:
    """A set that is not critical, with all commands that do not make it so."""
    chosen = chosen.copy()
    for command in np.flatnonzero(~chosen):
        chosen[command] = True
        chosen[command] = not critical(chosen)
    return chosen


def _reduced(chosen: Bools, critical: Callable[[Bools], bool]) -> Bools:
    """A critical set without the commands that it does not need."""
    chosen = chosen.copy()
    for command in np.flatnonzero(chosen):
        chosen[command] = False
        chosen[command] = not critical(chosen)
    return chosen
