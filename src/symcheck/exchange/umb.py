"""The unified Markov binary format (https://github.com/pmc-tools/umb), through the package `umbi`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.exchange.snapshot import Snapshot
from symcheck.exchange.text import same_path
from symcheck.syntax.ast import ModelType, Type

__all__ = ["umb_model", "umbi_ats", "write_umb"]


def umbi_ats() -> Any:
    """The part of `umbi` that holds transition systems. Raises UnsupportedError where the package is not installed."""
    try:
        import umbi.ats
    except ImportError:
        raise UnsupportedError("UMB files need the package 'umbi', which is not installed: pip install umbi") from None
    return umbi.ats


def write_umb(model: Snapshot, target: str) -> None:
    """Write a model as a UMB file. Raises UsageError where it cannot be written."""
    ats = umbi_ats()
    made = umb_model(model)
    # umbi looks at the ending of the name.
    same_path(target, lambda path: _written(ats, made, path))


def _written(ats: Any, made: Any, path: Path) -> None:
    ended = path.with_suffix(".umb")
    ats.write(made, ended)
    ended.replace(path)


def umb_model(model: Snapshot) -> Any:
    """The model as an `umbi.ats.ExplicitAts`: in a CTMC, probabilities and exit rates."""
    ats = umbi_ats()
    made = ats.ExplicitAts()
    timed = model.type is ModelType.CTMC
    made.time = ats.TimeType.STOCHASTIC if timed else ats.TimeType.DISCRETE
    made.num_players = 1 if model.type is ModelType.MDP else 0
    for _ in range(model.n):
        made.add_state()
    if model.type is ModelType.MDP:
        made.state_to_player = [0] * model.n
    made.set_initial_states(np.flatnonzero(model.labels["init"]).tolist())
    if model.row_actions is not None and model.actions:
        # The last action stands for none.
        made.choice_action_to_name = [*model.actions, ""]
        made.num_choice_actions = len(model.actions) + 1
    if timed:
        made.state_to_exit_rate = model.row_sums.tolist()
    _choices(model, made, timed)
    for name, members in model.labels.items():
        if name != "init":
            made.add_ap_annotation(name=name, alias=name).set_state_values(members.tolist())
    for i, structure in enumerate(model.rewards):
        name = structure.name or f"reward{i + 1}"
        annotation = made.add_reward_annotation(name=name, alias=name)
        annotation.set_state_values(structure.states.tolist())
        annotation.set_choice_values(model.transition_rewards(structure).tolist())
    _valuations(model, ats, made)
    made.validate()
    return made


def _choices(model: Snapshot, made: Any, timed: bool) -> None:
    m = model.matrix
    values = model.values / model.row_sums[model.row_of_entry] if timed else model.values
    entries = list(zip(m.indices.tolist(), values.tolist(), strict=True))
    indptr = m.indptr.tolist()
    for row, state in enumerate(model.state_of_row.tolist()):
        choice = made.add_state_choice(state=state)
        if made.num_choice_actions:
            action = int(model.row_actions[row]) if model.row_actions is not None else -1
            choice.action = action if action >= 0 else len(model.actions)
        for target, value in entries[indptr[row] : indptr[row + 1]]:
            choice.add_branch(target=target, prob=value)


def _valuations(model: Snapshot, ats: Any, made: Any) -> None:
    made.variable_valuations = ats.EntityClassValuations()
    valuations = ats.EntityValuations()
    made.variable_valuations.set_valuations_for(ats.EntityClass.STATES, valuations)
    variables = [valuations.add_variable(v.name) for v in model.variables]
    columns = [(c.astype(bool) if v.type is Type.BOOL else c).tolist() for c, v in zip(model.columns, model.variables, strict=True)]
    for state, values in enumerate(zip(*columns, strict=True)):
        valuations.set_entity_valuation(state, dict(zip(variables, values, strict=True)))
    for variable, column in zip(variables, columns, strict=True):
        variable.set_values(sorted(set(column)))
