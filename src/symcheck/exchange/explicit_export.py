"""A built model as plain arrays, for any engine: the source of all export formats."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from symcheck.check.beliefs.model import observations
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.capabilities import HasActions, HasImportedStates
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.transition_actions import contributions, state_columns, state_order
from symcheck.exchange.explicit_data import ExplicitRewards
from symcheck.explicit.explored import RACE
from symcheck.matrices.contributions import Contributions, TransitionParts
from symcheck.matrices.numbers import Numbers, nonzero
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import Variable
from symcheck.semantics.rewards import Structure
from symcheck.syntax.ast import ModelType, Type

__all__ = ["ExplicitExport", "explicit_export"]

SetOf = Callable[[str], StateSet]


@dataclass(frozen=True, eq=False)
class ExplicitExport:
    """A model of n states in lexicographic order; the entries of a row are ordered by column.

    Attributes:
        type: the model type.
        variables: the variables.
        columns: the values of each variable, int64[n].
        matrix: the matrix in doubles.
        values: probabilities (rates) of the entries, as doubles or rationals; complex numbers are
            intervals from the real to the imaginary part.
        actions: the action names.
        row_actions: per row of an MDP an index into `actions`, or -1. None for a chain.
        labels: bool[n] each; "init" and "deadlock" (states without transitions) come first.
        rewards: the reward structures.
        property_labels: the names of labels that come from a properties file.
        apart: computes the transition rewards of a chain, per structure. None if the transitions
            of each row share one reward.
        contributions: what each action contributes to the transitions of a chain; None if no
            transition has an action.
        observations: of each state, from 0, int32[n]; None if all of it is observed.
    """

    type: ModelType
    variables: tuple[Variable, ...]
    columns: Sequence[Int64s] = field(repr=False)
    matrix: SparseMatrix = field(repr=False)
    values: Numbers = field(repr=False)
    actions: tuple[str, ...]
    row_actions: Int32s | None = field(repr=False)
    labels: Mapping[str, Bools] = field(repr=False)
    rewards: Sequence[ExplicitRewards] = field(repr=False)
    property_labels: frozenset[str] = frozenset()
    apart: Callable[[SparseMatrix], Sequence[Numbers]] | None = field(default=None, repr=False)
    contributions: Callable[[], Contributions | None] = field(default=lambda: None, repr=False)
    observations: Int32s | None = field(default=None, repr=False)

    @property
    def n(self) -> int:
        """Number of states."""
        return self.matrix.states

    @cached_property
    def timed(self) -> Bools | None:
        """The rows of a Markov automaton whose weights are rates, bool[rows]; None: not of one."""
        actions = self.row_actions
        return None if actions is None or not self.type.continuous_time else actions == RACE

    @cached_property
    def state_of_row(self) -> Int64s:
        """The state of each row."""
        return self.matrix.state_of_row

    @cached_property
    def row_of_entry(self) -> Int64s:
        """The row of each entry."""
        return self.matrix.row_of_entry

    @cached_property
    def choice_of_row(self) -> Int64s:
        """The index of each row among the choices of its state."""
        groups = self.matrix.groups
        return (
            np.zeros(self.n, np.int64)
            if groups is None
            else np.arange(self.matrix.rows) - groups[self.state_of_row]
        )

    @cached_property
    def row_sums(self) -> Floats:
        """Per row: the total probability (rate)."""
        return (
            np.add.reduceat(self.matrix.data, self.matrix.indptr[:-1])
            if self.matrix.rows
            else np.empty(0)
        )

    @cached_property
    def parts(self) -> TransitionParts:
        """The transitions, each divided among its actions."""
        contributions = self.contributions()
        if contributions is not None:
            return TransitionParts.of(
                replace(self.matrix, data=self.values), contributions, self.actions
            )
        rows = np.full(self.matrix.rows, -1, np.int32)
        actions = rows if self.row_actions is None else self.row_actions
        return TransitionParts(
            np.arange(self.matrix.entries), actions[self.row_of_entry], self.values
        )

    def without_actions(self) -> ExplicitExport:
        """The model without the names of actions."""
        none = None if self.row_actions is None else np.full_like(self.row_actions, -1)
        return replace(self, actions=(), row_actions=none, contributions=lambda: None)

    def action_texts(self) -> list[str]:
        """The action name of each row; empty for none."""
        names = np.array([*self.actions, ""], dtype=object)
        chosen: list[str] = (
            ([""] * self.matrix.rows)
            if self.row_actions is None
            else names[np.maximum(self.row_actions, -1)].tolist()
        )
        return chosen

    def state_texts(self, start: int, stop: int) -> list[str]:
        """The values of the variables in some states, as `(1,true)`."""
        parts = [
            _texts(c[start:stop], v.type) for c, v in zip(self.columns, self.variables, strict=True)
        ]
        return (
            [f"({','.join(row)})" for row in zip(*parts, strict=True)]
            if parts
            else ["()"] * (stop - start)
        )

    @cached_property
    def _rewards_of_commands(self) -> Sequence[Numbers]:
        assert self.apart is not None
        return self.apart(self.matrix)

    def entry_rewards(self, number: int) -> Numbers:
        """The reward of each transition in structure `number`."""
        structure = self.rewards[number]
        if structure.entries is not None:
            return structure.entries
        if self.apart is not None and bool(nonzero(structure.rows).any()):
            return self._rewards_of_commands[number]
        return self.transition_rewards(structure)[self.row_of_entry]

    def transition_rewards(self, structure: ExplicitRewards) -> Numbers:
        """Per row, the one reward for all its transitions that has the row's expected reward."""
        if not self.type.continuous_time:
            return structure.rows
        return np.asarray(
            np.where(structure.rows == 0, 0.0, structure.rows.astype(np.float64) / self.row_sums)
        )


def _texts(column: Int64s, type: Type) -> list[str]:
    return (
        np.where(column != 0, "true", "false").tolist()
        if type is Type.BOOL
        else list(map(str, column.tolist()))
    )


def explicit_export(
    engine: Engine,
    labels: Sequence[str] = (),
    states: SetOf | None = None,
    *,
    property_labels: Sequence[str] = (),
) -> ExplicitExport:
    """Export a built model to arrays.

    Args:
        engine: the engine of the model.
        labels: the names of the labels to export, besides "init" and "deadlock".
        states: returns the states of a label.
        property_labels: the names of labels of a properties file.
    """
    model = engine.model
    require(model, Feature.EXPLICIT_FILES)
    columns = state_columns(engine)
    members = {
        "init": engine.to_bools(engine.initial),
        "deadlock": engine.to_bools(engine.deadlocks),
    }
    if states is not None:
        members |= {name: engine.to_bools(states(name)) for name in (*labels, *property_labels)}
    system = engine.system(engine.all)
    intervals = engine.capability(IntervalEngine)
    matrix = system.weights if intervals is None else intervals.weights
    export = ExplicitExport(
        model.type,
        model.variables,
        columns,
        matrix.doubles(),
        matrix.data if intervals is None else intervals.ends,
        model.actions,
        _row_actions(engine),
        members,
        [
            ExplicitRewards(r.name, *system.rewards(Structure(i)), _entry_rewards(engine, i))
            for i, r in enumerate(model.rewards)
        ],
        frozenset(property_labels),
        _rewards_of_commands(engine),
        partial(contributions, engine),
        _observations(engine),
    )
    if intervals is not None:  # a row has one reward, whatever nature chooses
        export = replace(export, apart=None, contributions=lambda: None)
    return _sorted(export, state_order(engine, columns))


def _entry_rewards(engine: Engine, structure: int) -> Numbers | None:
    """The rewards of single transitions, for models read from files."""
    imported = engine.capability(HasImportedStates)
    return imported.entry_rewards[structure] if imported and imported.entry_rewards else None


def _rewards_of_commands(engine: Engine) -> Callable[[SparseMatrix], Sequence[Numbers]] | None:
    """A function that computes transition rewards of a chain from commands; None if not needed."""
    model = engine.model
    if (
        model.type.has_choices
        or not model.events
        or all(i.on_states for r in model.rewards for i in r.items)
    ):
        return None

    def find(matrix: SparseMatrix) -> Sequence[Numbers]:
        from symcheck.exchange.transition_rewards import transition_rewards

        return transition_rewards(engine, matrix)

    return find


def _row_actions(engine: Engine) -> Int32s | None:
    """The action of each row of an MDP."""
    if not engine.model.type.has_choices:
        return None
    known = engine.capability(HasActions)
    assert known is not None
    return known.row_actions()


def _observations(engine: Engine) -> Int32s | None:
    if not engine.model.type.partially_observed:
        return None
    explicit = engine.capability(ExplicitEngine)
    assert explicit is not None, "only explicit engines are built for these models"
    return observations(explicit)


def _sorted(export: ExplicitExport, order: Int64s | None) -> ExplicitExport:
    """The export with states and entries in canonical order (variable orders may differ)."""
    if order is not None:
        export = _permuted(export, order)
    m = export.matrix
    inside = np.diff(m.indices) > 0
    inside[m.indptr[1:-1][(m.indptr[1:-1] > 0) & (m.indptr[1:-1] < m.entries)] - 1] = True
    if inside.all():
        return export
    by = np.lexsort((m.indices, export.row_of_entry))
    matrix = SparseMatrix(m.indptr, m.indices[by], m.data[by], m.columns, m.groups)
    rewards = [
        r._replace(entries=None if r.entries is None else r.entries[by]) for r in export.rewards
    ]
    return replace(export, matrix=matrix, values=export.values[by], rewards=rewards)


def _permuted(export: ExplicitExport, order: Int64s) -> ExplicitExport:
    """The export with permuted states: new state i is old state `order[i]`."""
    m = export.matrix
    number = np.empty(export.n, np.int32)
    number[order] = np.arange(export.n, dtype=np.int32)
    counts = np.ones(export.n, np.int64) if m.groups is None else np.diff(m.groups)
    starts = np.arange(export.n) if m.groups is None else m.groups[:-1]
    rows = spans(starts[order], starts[order] + counts[order])
    entries = spans(m.indptr[:-1][rows], m.indptr[1:][rows])
    groups = None if m.groups is None else starts_of(counts[order])
    return replace(
        export,
        columns=[c[order] for c in export.columns],
        matrix=m.select(rows, number, m.columns, groups),
        values=export.values[entries],
        row_actions=None if export.row_actions is None else export.row_actions[rows],
        labels={name: members[order] for name, members in export.labels.items()},
        observations=None if export.observations is None else export.observations[order],
        rewards=[
            ExplicitRewards(
                r.name,
                r.states[order],
                r.rows[rows],
                None if r.entries is None else r.entries[entries],
            )
            for r in export.rewards
        ],
    )
