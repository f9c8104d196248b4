"""What a numerical method does to its vectors: the three visible steps of reachability, and the iterates of the third."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from symcheck.check.context import CheckLog, Context
from symcheck.check.measures.reachability import equations
from symcheck.direction import Direction
from symcheck.numerics.linear.methods import solve_linear

if TYPE_CHECKING:
    from symcheck.engines.base import Engine, StateSet
    from symcheck.numerics.linear.problem import LinearProblem, Solution, Step
    from symcheck.options import Options

__all__ = ["Vectors", "vectors"]


@dataclass(frozen=True, eq=False)
class Vectors:
    """Reachability in three steps. no, yes, maybe: states of probability 0, 1, and others (the unknowns, n of them).

    problem: x = A x + b over the unknowns (None where there are none). steps: what the method told, with its vectors.
    """

    no: StateSet
    yes: StateSet
    maybe: StateSet
    problem: LinearProblem | None = field(repr=False)
    solution: Solution | None = field(repr=False)
    steps: tuple[Step, ...] = field(repr=False)


def vectors(
    engine: Engine,
    left: StateSet,
    right: StateSet,
    options: Options,
    direction: Direction | None = None,
) -> Vectors:
    """Probability of left U right by `options.method` ('interval' shows both bounds), as `check.reach.until` computes it.

    direction: 'min' or 'max' in an MDP. Keeps a copy of each iterate: for small models. Raises what the method raises.
    """
    context = Context(engine, options, {}, {}, CheckLog())
    no, yes = engine.graph.prob0(left, right, direction), engine.graph.prob1(left, right, direction)
    maybe = ~(no | yes)
    if not maybe:
        return Vectors(no, yes, maybe, None, None, ())
    part = equations(context, maybe)
    problem = part.problem(part.one_step_probability(yes), None, direction, probability=True)
    steps: list[Step] = []

    def watch(step: Step) -> None:
        lower, upper = (None if v is None else np.array(v) for v in (step.lower, step.upper))
        steps.append(replace(step, lower=lower, upper=upper))

    return Vectors(no, yes, maybe, problem, solve_linear(problem, options, watch), tuple(steps))
