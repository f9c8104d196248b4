"""Random paths through a model, step by step."""

from __future__ import annotations

from numbers import Integral
from typing import cast

import numpy as np

from symcheck.errors import UsageError, converts_memory_error
from symcheck.semantics.interpreter import State
from symcheck.simulate.path import Path, used_seed
from symcheck.simulate.steps import Steps

__all__ = ["simulate"]


@converts_memory_error("a shorter path needs less")
def simulate(
    model: Steps,
    steps: int | None = None,
    *,
    time: float | None = None,
    seed: int | None = None,
    loop_check: bool = True,
    max_steps: int = 10_000,
) -> Path:
    """Sample a path from an initial state; several initial states are equally likely.

    The path ends in a deadlock or at the first limit that is reached. The choices of an MDP are
    equally likely.

    Args:
        model: the steps of the model.
        steps: maximal number of steps; None: `max_steps`.
        time: end in the state that is occupied at this time; None: no limit.
        seed: seed of the generator; None draws one.
        loop_check: end the path when it can only repeat itself.
        max_steps: end after this many steps in any case.

    Raises:
        ModelFault: the model breaks a rule in a state on the path.
        UsageError: `steps` is no whole number from 0.
    """
    if steps is not None and (not isinstance(cast(object, steps), Integral) or steps < 0):
        raise UsageError(f"steps={steps!r}: expected a whole number from 0, or None")
    seed = used_seed(seed)
    generator = np.random.default_rng(seed)
    limit = max_steps if steps is None else min(steps, max_steps)
    path = [model.start(generator)]
    forced: set[State] = set()  # states since the last one with several branches
    end = "length" if steps is None or steps > max_steps else "steps"
    while len(path) <= limit:
        enabled = model.choices(path[-1].state)
        if not enabled:
            end = "deadlock"
            break
        branches = sum(len(c.branches) for c in enabled)
        if branches > 1:
            forced.clear()
        elif loop_check and path[-1].state in forced:
            end = "loop"
            break
        else:
            forced.add(path[-1].state)
        path.append(model.take(path[-1], enabled, generator))
        if time is not None and path[-1].time >= time:
            end = "time"
            break
    return Path(model.model, tuple(path), end, seed)
