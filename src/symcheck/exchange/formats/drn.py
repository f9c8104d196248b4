"""Storm's DRN format: one text holds the whole model.

Source: https://www.stormchecker.org/documentation/background/drn.html
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symcheck.exchange.explicit_data import ExplicitRewards
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.text import FULL_PRECISION, number_text, number_texts

__all__ = ["drn_file"]

_STATES = 4096


def drn_file(model: ExplicitExport, *, precision: int = FULL_PRECISION) -> Iterator[str]:
    """The model as text chunks: states with labels and rewards, their choices, the successors.

    DRN has no transition rewards. A choice therefore has the expected reward of its transitions.
    In a CTMC, where Storm reads no rewards of choices, this is added to the state reward.
    """
    kind = "Markov Automaton" if model.type.immediate_choices else model.type.name
    names = [r.name or f"reward{i + 1}" for i, r in enumerate(model.rewards)]
    if np.iscomplexobj(model.values):
        yield "@value_type: double-interval\n"
    yield f"@type: {kind}\n@parameters\n\n@reward_models\n{' '.join(names)}\n"
    yield f"@nr_states\n{model.n}\n@nr_choices\n{model.matrix.rows}\n@model\n"
    for start in range(0, model.n, _STATES):
        yield "".join(_states(model, start, min(start + _STATES, model.n), precision))


def _states(model: ExplicitExport, start: int, stop: int, precision: int) -> Iterator[str]:
    m = model.matrix
    groups = (
        np.arange(start, stop + 1) if m.groups is None else m.groups[start : stop + 1]
    ).tolist()
    first, last = groups[0], groups[-1]
    indptr = m.indptr[first : last + 1].tolist()
    begin, end = indptr[0], indptr[-1]
    weights, sums = model.values[begin:end], model.row_sums[first:last]
    if model.timed is not None:  # probabilities, and the rates of states
        sums = np.where(model.timed[first:last], sums, 0.0)
        weights = weights / np.repeat(np.where(sums > 0.0, sums, 1.0), np.diff(indptr))
        sums = sums[np.array(groups[:-1]) - first]
    values = number_texts(weights, precision)
    entries = [
        f"\t\t{t} : {v}\n" for t, v in zip(m.indices[begin:end].tolist(), values, strict=True)
    ]
    actions = _actions(model, first, last, begin, end)
    rewards = [_rewards(model, r, start, stop, first, last, precision) for r in model.rewards]
    rates = number_texts(sums, precision) if model.type.continuous_time else None
    labels = [
        (f' "{n}"' if not n.isidentifier() else f" {n}", members[start:stop])
        for n, members in model.labels.items()
    ]
    for i in range(stop - start):
        text = f"state {start + i}" + (f" !{rates[i]}" if rates is not None else "")
        if model.observations is not None:
            text += f" {{{model.observations[start + i]}}}"
        text += f" [{', '.join(r[0][i] for r in rewards)}]" if rewards else ""
        yield text + "".join(n for n, members in labels if members[i]) + "\n"
        for r in range(groups[i] - first, groups[i + 1] - first):
            yield (
                f"\taction {actions[r]}"
                + (f" [{', '.join(x[1][r] for x in rewards)}]" if rewards else "")
                + "\n"
            )
            yield from entries[indptr[r] - begin : indptr[r + 1] - begin]


def _actions(model: ExplicitExport, first: int, last: int, begin: int, end: int) -> list[str]:
    """The action of some rows. A row of a chain has all its actions, in one word as in Storm.

    first, last: the rows. begin, end: their entries.
    """
    if model.row_actions is not None:
        return [
            model.actions[a] if a >= 0 else "__NOLABEL__"
            for a in model.row_actions[first:last].tolist()
        ]
    if not model.actions:
        return ["0"] * (last - first)
    parts = model.parts
    some = slice(*np.searchsorted(parts.entry, (begin, end)).tolist())
    labels: list[set[str]] = [set() for _ in range(last - first)]
    for row, a in zip(
        model.row_of_entry[parts.entry[some]].tolist(), parts.action[some].tolist(), strict=True
    ):
        if a >= 0:
            labels[row - first].add(model.actions[a])
    return ["_".join(sorted(own)) or "__NOLABEL__" for own in labels]


def _rewards(
    model: ExplicitExport,
    structure: ExplicitRewards,
    start: int,
    stop: int,
    first: int,
    last: int,
    precision: int,
) -> tuple[list[str], list[str]]:
    states, rows = structure.states[start:stop], structure.rows[first:last]
    if model.timed is not None:
        timed, sums = model.timed[first:last], model.row_sums[first:last]
        rows = np.where(timed, rows / np.where(timed, sums, 1.0), rows)
    elif model.type.continuous_time:
        states, rows = states + rows, np.zeros(last - first)
    return [number_text(v, precision) for v in states.tolist()], [
        number_text(v, precision) for v in rows.tolist()
    ]
