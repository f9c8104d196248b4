"""Few commands that suffice for a bound, of those that the paths of a counterexample may use."""

from __future__ import annotations

import numpy as np

from symcheck.check import tuning
from symcheck.check.counterexample import CommandSet
from symcheck.check.explanation.fewest_commands import fewest_commands
from symcheck.check.explanation.labelled_transitions import labelled_transitions
from symcheck.check.explanation.path_search import PathSearch
from symcheck.numerics.likeliest_paths import StepProblem
from symcheck.semantics.command_text import command_text

__all__ = ["command_set"]


def command_set(search: PathSearch) -> tuple[CommandSet | None, str]:
    """A small set of commands, or why there is none."""
    engine, problem, model = search.engine, search.problem, search.engine.model
    matrix, rows, steps = problem.matrix, search.rows, None
    if model.builder is not None:
        return None, "no commands: the model has none"
    if search.origin is not None:
        return (
            None,
            "no commands: they are found for one of X, F, G, U, W and R without bounds on rewards",
        )
    if model.type.continuous_time:
        return None, "no commands: without a command, the others of a CTMC are more likely"
    if isinstance(problem, StepProblem):
        steps = problem.steps
        if problem.end.any() and search.reward is None:
            return None, "no commands: with a bound on steps, they are found for F and U"
    if engine.states > tuning.COMMAND_STATES:
        return None, f"no commands: they are found for at most {tuning.COMMAND_STATES:,} states"
    if problem.target[search.initial] or not problem.through[search.initial]:
        return None, "no commands: the initial state decides"
    if search.satisfies:  # any strategy may show it, and another one may need fewer commands
        matrix, rows = engine.matrix, None
    labelled = labelled_transitions(
        engine,
        matrix,
        rows,
        problem.through,
        problem.target,
        search.initial,
        search.structure,
    )
    if labelled is not None and (labelled.weight < 0).any():
        return None, "no commands: they are not found for negative rewards"
    answer = (
        None
        if labelled is None
        else fewest_commands(labelled, search.threshold, strict=search.strict, steps=steps)
    )
    if labelled is None or answer is None:
        return None, "no commands: the threshold is too close to the value (-exact decides)"
    chosen, smallest = answer
    texts = [command_text(model, labelled.commands[i]) for i in np.flatnonzero(chosen)]
    another = engine.model.type.has_choices and search.satisfies
    count = len(labelled.commands)
    earn = search.reward is not None
    return CommandSet(tuple(sorted(texts)), count, smallest, another, earn), ""
