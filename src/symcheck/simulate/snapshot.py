"""A path that grows step by step as plain values, which a browser shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.interpreter import State
from symcheck.simulate.path import PathStep
from symcheck.simulate.stepper import Simulator

__all__ = ["snapshot"]


def snapshot(simulator: Simulator, known: int = 0) -> dict[str, Any]:
    """The rows of the path from `known`, its length, and what is enabled in the last state.

    Args:
        simulator: the path.
        known: the number of rows that need not be told again.

    Returns:
        What `json` writes. A row has the transition, the time, the state, its rewards, and those
        that the transition into it has earned.
    """
    path = simulator.path
    return {
        "length": len(path.steps),
        "rows": [_row(s) for s in path.steps[known:]],
        "variables": path.variables,
        "rewards": [r.name or str(i) for i, r in enumerate(path.model.rewards, 1)],
        "labels": simulator.labels,
        "totals": simulator.total_rewards,
        "state": " & ".join(f"{n}={format_value(v)}" for n, v in simulator.state.items()),
        "choices": [
            {
                "action": c.action or "",
                "module": c.module or "",
                "text": c.text,
                "branches": [
                    [format_value(b.probability), _changes(simulator.state, b.state)]
                    for b in c.branches
                ],
            }
            for c in simulator.choices
        ],
    }


def _row(step: PathStep) -> list[Any]:
    return [step.transition, step.time, list(step.state), list(step.rewards), list(step.earned)]


def _changes(before: Mapping[str, bool | int], after: State) -> str:
    changed = [
        f"{name}={format_value(new)}"
        for (name, old), new in zip(before.items(), after, strict=True)
        if new != old
    ]
    return ", ".join(changed) or "no change"
