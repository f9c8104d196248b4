"""One random path through a model, state by state, by the scalar semantics."""

from __future__ import annotations

import numpy as np

from symcheck.errors import converts_memory_error
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Layout
from symcheck.semantics.interpreter import Choice, State, choices, state_rewards
from symcheck.semantics.model import BoundModel, Value
from symcheck.simulate.path import Path, Step
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
    """A random path from an initial state (one of several with equal probability).

    It ends after `steps` steps, when `time` is reached (the last state is the one occupied then),
    in any case in a deadlock, where it can only repeat itself (loop_check), and after max_steps.
    The choices of an MDP are equally likely. The same seed gives the same path; None draws one.
    Raises ModelFault.
    """
    chosen = int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed
    generator = np.random.default_rng(chosen)
    state = _first(model, generator)
    wanted = max_steps if steps is None else min(steps, max_steps)
    found = [Step(state, 0.0, _floats(state_rewards(model, state)))]
    forced: set[State] = set()  # states since the last one with an alternative
    end = "length" if steps is None or steps > max_steps else "steps"
    while len(found) <= wanted:
        offered = choices(model, found[-1].state, check_sums=check_sums)
        if not offered:
            end = "deadlock"
            break
        branches = sum(len(c.branches) for c in offered)
        if branches > 1:
            forced.clear()
        elif loop_check and found[-1].state in forced:
            end = "loop"
            break
        else:
            forced.add(found[-1].state)
        found.append(_next(model, found[-1], offered, generator))
        if time is not None and found[-1].time >= time:
            end = "time"
            break
    return Path(model, tuple(found), end, chosen)


def _first(model: BoundModel, generator: np.random.Generator) -> State:
    layout = Layout.of(model.variables)
    rows = initial_rows(model, layout)
    return layout.unpack(rows[int(generator.integers(len(rows)))] if len(rows) > 1 else rows[0])


def _floats(values: tuple[Value, ...]) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _next(
    model: BoundModel, here: Step, offered: tuple[Choice, ...], generator: np.random.Generator
) -> Step:
    """Choose a transition, and the time until it."""
    continuous = model.type is ModelType.CTMC
    share = 1 if continuous else len(offered)
    weighted = [(float(p) / share, p, s, c) for c in offered for p, s in c.branches]
    total = sum(w for w, _, _, _ in weighted)
    duration = float(generator.standard_exponential()) / total if continuous else 1.0
    ends = np.cumsum([w for w, _, _, _ in weighted])
    place = int(np.searchsorted(ends, generator.random() * ends[-1], side="right"))
    weight, own, state, choice = weighted[min(place, len(weighted) - 1)]
    modules = {c.module for c in choice.commands}
    module = model.modules[modules.pop()].name if len(modules) == 1 else None
    shown = float(own) if model.type is ModelType.MDP else weight
    rewards = _floats(state_rewards(model, state))
    return Step(
        state, here.time + duration, rewards, choice.action, module, shown, _floats(choice.rewards)
    )
