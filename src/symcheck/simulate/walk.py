"""Random paths through a model, computed by the interpreter.

The interpreter knows which module takes each transition; the compiled sampler does not.
"""

from __future__ import annotations

import numpy as np

from symcheck.errors import converts_memory_error
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import StateLayout
from symcheck.semantics.interpreter import Choice, State, choices, state_rewards
from symcheck.semantics.model import BoundModel, Value
from symcheck.simulate.path import Path, PathStep
from symcheck.syntax.ast import ModelType

__all__ = ["simulate"]


@converts_memory_error("a shorter path needs less")
def simulate(
    model: BoundModel,
    steps: int | None = None,
    *,
    time: float | None = None,
    seed: int | None = None,
    loop_check: bool = True,
    max_steps: int = 10_000,
    check_sums: bool = True,
) -> Path:
    """Sample a path from an initial state; several initial states are equally likely.

    The path ends in a deadlock or at the first limit that is reached. The choices of an MDP are
    equally likely.

    Args:
        steps: maximal number of steps; None: `max_steps`.
        time: end in the state that is occupied at this time; None: no limit.
        seed: seed of the generator; None draws one.
        loop_check: end the path when it can only repeat itself.
        max_steps: end after this many steps in any case.
        check_sums: check that probabilities sum to 1.

    Raises:
        ModelFault: the model breaks a rule in a state on the path.
    """
    used_seed = int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed
    generator = np.random.default_rng(used_seed)
    state = _initial_state(model, generator)
    limit = max_steps if steps is None else min(steps, max_steps)
    path = [PathStep(state, 0.0, _floats(state_rewards(model, state)))]
    forced: set[State] = set()  # states since the last one with several branches
    end = "length" if steps is None or steps > max_steps else "steps"
    while len(path) <= limit:
        enabled = choices(model, path[-1].state, check_sums=check_sums)
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
        path.append(_next_step(model, path[-1], enabled, generator))
        if time is not None and path[-1].time >= time:
            end = "time"
            break
    return Path(model, tuple(path), end, used_seed)


def _initial_state(model: BoundModel, generator: np.random.Generator) -> State:
    layout = StateLayout.of(model.variables)
    rows = initial_rows(model, layout)
    return layout.unpack(rows[int(generator.integers(len(rows)))] if len(rows) > 1 else rows[0])


def _floats(values: tuple[Value, ...]) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _next_step(
    model: BoundModel,
    current: PathStep,
    enabled: tuple[Choice, ...],
    generator: np.random.Generator,
) -> PathStep:
    """Sample a transition and its sojourn time."""
    continuous = model.type is ModelType.CTMC
    share = 1 if continuous else len(enabled)
    weighted = [(float(p) / share, p, s, c) for c in enabled for p, s in c.branches]
    total = sum(w for w, _, _, _ in weighted)
    duration = float(generator.standard_exponential()) / total if continuous else 1.0
    cumulative = np.cumsum([w for w, _, _, _ in weighted])
    index = int(np.searchsorted(cumulative, generator.random() * cumulative[-1], side="right"))
    weight, probability, state, choice = weighted[min(index, len(weighted) - 1)]
    modules = {c.module for c in choice.commands}
    module = model.modules[modules.pop()].name if len(modules) == 1 else None
    shown = float(probability) if model.type is ModelType.MDP else weight
    rewards = _floats(state_rewards(model, state))
    return PathStep(
        state,
        current.time + duration,
        rewards,
        choice.action,
        module,
        shown,
        _floats(choice.rewards),
    )
