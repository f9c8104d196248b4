"""Write the unified Markov binary format by the package `umbi`.

Source: https://github.com/pmc-tools/umb
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symcheck.errors import UsageError
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.matrices.numbers import Numbers
from symcheck.syntax.ast import Type
from symcheck.tables import optional_package
from symcheck.version import __version__
from symcheck.whole_file import write_whole

if TYPE_CHECKING:
    from umbi.umb import ExplicitUmb

__all__ = ["umb_model", "umb_text", "write_umb"]


def write_umb(model: ExplicitExport, target: str) -> None:
    """Write a model as a UMB file.

    Raises:
        UsageError: the file cannot be written.
        UnsupportedError: the package `umbi` is not installed.
    """
    optional_package("umbi", "umb")
    if Path(target).is_symlink() or (Path(target).exists() and not Path(target).is_file()):
        raise UsageError(f"cannot write '{target}': a UMB file is a plain file")
    made = umb_model(model)
    import umbi.umb

    # umbi looks at the ending of the name.
    write_whole(target, lambda path: umbi.umb.write(made, path), suffix=".umb")


def umb_text(model: ExplicitExport) -> Iterator[str]:
    """What the UMB file of a model holds, as text. Raises UnsupportedError as `write_umb`."""
    optional_package("umbi", "umb")
    from symcheck.exchange.formats import umb_text

    return umb_text.umb_text(umb_model(model))


def umb_model(model: ExplicitExport) -> ExplicitUmb:
    """The model as a `umbi.umb.ExplicitUmb`. A CTMC is stored as probabilities and exit rates.

    The actions of an MDP belong to choices, those of a chain to branches.
    """
    import umbi.umb

    m, timed, parts = model.matrix, model.type.continuous_time, model.parts
    made = umbi.umb.ExplicitUmb()
    system = made.index.transition_system
    made.index.file_data = umbi.umb.index.FileData(tool="symcheck", tool_version=__version__)
    system.time = "stochastic" if timed else "discrete"
    system.num_players = 1 if model.type.has_choices else 0
    system.num_states, system.num_choices, system.num_branches = model.n, m.rows, len(parts.entry)
    made.state_is_initial = model.labels["init"].tolist()
    system.num_initial_states = sum(made.state_is_initial)
    made.state_to_choices = (np.arange(model.n + 1) if m.groups is None else m.groups).tolist()
    made.state_to_player = [0] * model.n if model.type.has_choices else None
    made.state_is_markovian = [timed] * model.n
    made.choice_to_branches = np.searchsorted(parts.entry, m.indptr).tolist()
    made.branch_to_target = m.indices[parts.entry].tolist()
    of = model.row_of_entry[parts.entry]
    values = parts.values / model.row_sums[of] if timed else parts.values
    system.branch_probability_type, made.branch_to_probability = _numbers(values)
    if timed:
        system.exit_rate_type, made.state_to_exit_rate = _numbers(model.row_sums)
    if model.actions:
        # The last action stands for none.
        names, count = [*model.actions, ""], len(model.actions)
        if model.row_actions is not None:
            made.choice_action_to_string, system.num_choice_actions = names, count + 1
            made.choice_to_choice_action = np.where(
                model.row_actions < 0, count, model.row_actions
            ).tolist()
        else:
            made.branch_action_to_string, system.num_branch_actions = names, count + 1
            made.branch_to_branch_action = np.where(parts.action < 0, count, parts.action).tolist()
    _annotate(model, made)
    _valuations(model, made)
    made.validate()
    return made


def _numbers(values: Numbers) -> tuple[Any, list[Any]]:
    """Numbers of one type, and the name of that type in the file."""
    import umbi.datatypes
    from umbi.binary import SizedType

    kind, result = umbi.datatypes.promote_scalars(values.tolist())
    return SizedType.for_type(kind), result


def _annotate(model: ExplicitExport, made: ExplicitUmb) -> None:
    """Add labels and rewards. Transition rewards belong to choices, or to branches if needed."""
    from umbi.binary import SizedType
    from umbi.datatypes import PrimitiveType
    from umbi.umb.index import AnnotationDescription

    described: dict[str, dict[str, Any]] = {"aps": {}, "rewards": {}}
    result: dict[str, dict[str, dict[str, Any]]] = {"aps": {}, "rewards": {}}
    for name, members in model.labels.items():
        if name != "init":
            kind = SizedType.for_type(PrimitiveType.BOOL)
            described["aps"][name] = AnnotationDescription(
                alias=name, applies_to=["states"], type=kind
            )
            result["aps"][name] = {"states": members.tolist()}
    for i, structure in enumerate(model.rewards):
        name = structure.name or f"reward{i + 1}"
        applies_to, transitions = _transition_rewards(model, i)
        kind, numbers = _numbers(np.concatenate([structure.states, transitions]))
        described["rewards"][name] = AnnotationDescription(
            alias=name, applies_to=["states", applies_to], type=kind
        )
        result["rewards"][name] = {"states": numbers[: model.n], applies_to: numbers[model.n :]}
    made.index.annotations = {group: names for group, names in described.items() if names}
    made.annotations = {group: names for group, names in result.items() if names}


def _transition_rewards(model: ExplicitExport, number: int) -> tuple[str, Numbers]:
    """The rewards of choices, or of branches where a choice has several."""
    entries = model.entry_rewards(number)
    rows = model.matrix.rows
    first = entries[model.matrix.indptr[:-1]] if rows else entries
    if np.array_equal(first[model.row_of_entry], entries):
        return "choices", first
    return "branches", entries[model.parts.entry]


def _valuations(model: ExplicitExport, made: ExplicitUmb) -> None:
    import umbi.binary
    from umbi.binary import SizedType
    from umbi.datatypes import NumericPrimitiveType, PrimitiveType
    from umbi.umb.index import ValuationDescription

    if not model.variables:
        return
    layout = umbi.binary.StructType()
    columns = []
    for variable, column in zip(model.variables, model.columns, strict=True):
        switch = variable.type is Type.BOOL
        kind: Any = PrimitiveType.BOOL if switch else NumericPrimitiveType.INT
        values = (column.astype(bool) if switch else column).tolist()
        size = umbi.binary.max_num_bits_for_collection_element(values, kind)
        layout.add_attribute(name=variable.name, sized_type=SizedType(type=kind, size_bits=size))
        columns.append(values)
    layout.pad_to_byte()
    names = [v.name for v in model.variables]
    made.index.valuations = {"states": ValuationDescription(unique=True, classes=[layout])}
    made.valuations = {
        "states": [dict(zip(names, state, strict=True)) for state in zip(*columns, strict=True)]
    }
