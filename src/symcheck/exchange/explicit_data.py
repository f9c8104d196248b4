"""Models that are read state by state: an explicit engine without a model text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import partial
from math import inf
from typing import Any, NamedTuple, cast

import numpy as np

from symcheck.engines.base import Engine, erased
from symcheck.engines.capabilities import HasImportedStates, HasRationalTwin
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.rational.explore import RationalModel, StateList
from symcheck.errors import Diagnostic, ModelFault, UnsupportedError, converts_memory_error
from symcheck.explicit.explored import RACE
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import StateLayout, StateTable
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.numbers import (
    Numbers,
    Rationals,
    doubles,
    full,
    is_rational,
    rationals,
    sum_segments,
)
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.model import BoundModel, Delays
from symcheck.semantics.state_faults import POSITIVE_ENDS, SUM_TOLERANCE, rounded_sum
from symcheck.syntax.ast import Expression, Literal, ModelType, Name, Type, Weights
from symcheck.syntax.declarations import (
    Label,
    Module,
    Observable,
    Program,
    RewardStructure,
    VariableDeclaration,
)

__all__ = [
    "OBSERVATION",
    "ExplicitData",
    "ExplicitRewards",
    "ImportedEngine",
    "build_imported",
    "imported_program",
    "interval_fault",
    "interval_sums_fault",
    "reward_structure",
    "row_rewards",
    "without_choices",
]

_LARGEST_DENOMINATOR = 10**6
OBSERVATION = "observation"
"""The variable that has the observation of a state that was read."""
_TRUE = Literal(True, Type.BOOL)


class ExplicitRewards(NamedTuple):
    """A reward structure.

    states: a reward per state. rows: per row, the weighted sum of its transition rewards. entries:
    a reward per transition, or None if the transitions of each row share one.
    """

    name: str | None
    states: Numbers
    rows: Numbers
    entries: Numbers | None = None


def row_rewards(kind: ModelType, matrix: SparseMatrix, rewards: Floats) -> Floats:
    """Per row, float64[rows]: the sum of probability (rate) times reward over its transitions.

    rewards: a reward per transition, float64[entries].
    """
    of = matrix.row_of_entry
    total: Floats = np.bincount(of, matrix.data * rewards, matrix.rows).astype(np.float64)
    if kind.continuous_time:
        return total
    # If all transitions of a row have one reward, it is the expected reward, without rounding.
    least, most = np.full(matrix.rows, np.inf), np.full(matrix.rows, -np.inf)
    np.minimum.at(least, of, rewards)
    np.maximum.at(most, of, rewards)
    return np.where(least == most, least, total)


def reward_structure(
    name: str,
    kind: ModelType,
    matrix: SparseMatrix,
    states: Numbers,
    entries: Numbers | None = None,
) -> ExplicitRewards:
    """A reward structure from the rewards of states and of transitions (None: 0)."""
    if entries is None:
        return ExplicitRewards(name, states, np.zeros(matrix.rows))
    if not matrix.is_rational and not is_rational(entries):
        return ExplicitRewards(name, states, row_rewards(kind, matrix, entries), entries)
    exact = _rationals(entries)
    rows = sum_segments(_rationals(matrix.data) * exact, matrix.indptr)
    return ExplicitRewards(name, states, rows, exact)


@dataclass(frozen=True, eq=False)
class ExplicitData:
    """A model of n states as it was read.

    Attributes:
        type: the model type.
        columns: per variable its name, its type and its values, int64[n].
        matrix: probabilities (rates), float64 or Fractions. A state without transitions has an
            empty row in a chain, and no row in an MDP.
        actions: the action names.
        row_actions: per row an index into `actions`, or -1, int32[rows]; `RACE` for the rates of a
            Markov automaton.
        labels: bool[n] each; "init" and "deadlock" may be among them.
        rewards: the reward structures, float64 or Fractions.
        contributions: what each action contributes to the transitions of a chain; None without
            actions.
        names: constants and formulas that properties may use.
        lower: the lower end of each entry, where probabilities are intervals with the upper ends in
            `matrix`; the transitions of a row have one reward.
        delays: what the steps are, if they come from a timed automaton.
    """

    type: ModelType
    columns: Sequence[tuple[str, Type, Int64s]]
    matrix: SparseMatrix
    actions: tuple[str, ...]
    row_actions: Int32s
    labels: Mapping[str, Bools]
    rewards: Sequence[ExplicitRewards]
    contributions: Contributions | None = None
    names: Program | None = None
    lower: Numbers | None = None
    delays: Delays | None = None


def without_choices(given: ExplicitData) -> ExplicitData:
    """The model: a Markov automaton in which nothing is left to choose is a CTMC."""
    matrix, groups = given.matrix, given.matrix.groups
    if not given.type.immediate_choices or groups is None or not matrix.rows:
        return given
    if (given.row_actions != RACE).any() or (np.diff(groups) > 1).any():
        return given
    state, lengths = matrix.state_of_row, np.zeros(matrix.states, np.int64)
    lengths[state] = matrix.lengths

    def of_states(rows: Numbers) -> Numbers:
        values = full(matrix.states, 0, rational=is_rational(rows))
        values[state] = rows
        return values

    return replace(
        given,
        type=ModelType.with_properties(continuous_time=True),
        matrix=SparseMatrix(starts_of(lengths), matrix.indices, matrix.data, matrix.states),
        actions=(),
        row_actions=np.full(matrix.states, -1, np.int32),
        rewards=[r._replace(rows=of_states(r.rows)) for r in given.rewards],
    )


@dataclass(frozen=True, repr=False)
class _ImportedModel(BoundModel):
    """A bound model without commands: its action names are given."""

    names: tuple[str, ...] = ()

    @property
    def actions(self) -> tuple[str, ...]:
        """The action names."""
        return self.names


@dataclass(frozen=True)
class ImportedEngine(ExplicitEngine, HasImportedStates, HasRationalTwin):
    """The explicit engine on a model that was read: labels are sets of states, not expressions.

    Attributes:
        members: the states of each label.
        entry_rewards: per reward structure the reward of each transition, or None if the
            transitions of each row share one.
        given: matrix and rewards as they were given, deadlocks fixed.
        divided: the rows that are divided by their sum, which is almost 1, bool[rows].
        contributions: what each action contributes to the transitions of a chain; None without
            actions.
    """

    members: Mapping[Expression, Bools] = field(default_factory=dict, repr=False)
    entry_rewards: Sequence[Numbers | None] = field(default=(), repr=False)
    given: tuple[SparseMatrix, Sequence[ExplicitRewards]] | None = field(default=None, repr=False)
    contributions: Contributions | None = field(default=None, repr=False)
    divided: Bools = field(default_factory=lambda: np.zeros(0, np.bool_), repr=False)

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy an expression over the variables, or that have a label."""
        known = self.members.get(expression)
        return super().where(expression) if known is None else ArraySet(known)

    def rational(self, *, strict: bool = False, check_sums: bool = True) -> Engine:
        """The same model in rational arithmetic.

        A double becomes the fraction with a denominator of at most 10**6 that rounds to it, if
        there is one. So 1/3 is 1/3 again after it was written as a decimal.

        Args:
            strict: refuse rows that are divided by their sum.
            check_sums: check that probabilities sum to 1.

        Raises:
            UnsupportedError: the probabilities then do not sum to 1.
        """
        assert self.given is not None
        explored, (matrix, rewards) = self.explored, self.given
        matrix = replace(matrix, data=_rationals(matrix.data))
        of_actions = self.contributions
        if of_actions is not None:  # the parts of a transition are rounded, not their sum
            of_actions = of_actions._replace(weight=_rationals(of_actions.weight))
            matrix = replace(matrix, data=of_actions.totals(matrix))
        sums = sum_segments(matrix.data, matrix.indptr)
        if self.divided.any() and not strict:
            sums[~self.divided] = Fraction(1)
            matrix = replace(matrix, data=np.asarray(matrix.data / sums[matrix.row_of_entry]))
            rewards = [_rewards_of(matrix, r) for r in rewards]
            sums = sum_segments(matrix.data, matrix.indptr)
        weighed = explored.choice_actions != RACE
        exact_sums = check_sums and self.model.type.has_probabilities
        if exact_sums and any(s != 1 for s in sums[weighed]):
            raise UnsupportedError(
                "the given probabilities are rounded, and do not sum to 1 exactly"
            )
        exact = RationalModel(
            replace(self.model, is_rational=True),
            StateList(tuple(explored.states)),
            matrix,
            explored.choice_actions,
            explored.initial,
            explored.deadlocks,
            [_rationals(r.states) for r in rewards],
            [_rationals(r.rows) for r in rewards],
        )
        entries = [None if r.entries is None else _rationals(r.entries) for r in rewards]
        return erased(
            replace(
                self,
                explored=exact,
                name="exact",
                entry_rewards=entries,
                contributions=of_actions,
            )
        )


def _rationals(values: Numbers) -> Rationals:
    return rationals(_nearest_fraction(v) for v in values.tolist())


def _nearest_fraction(value: float | Fraction) -> Fraction | float:
    if isinstance(value, Fraction) or abs(value) == inf:
        return value
    near = Fraction(value).limit_denominator(_LARGEST_DENOMINATOR)
    return near if float(near) == value else Fraction(repr(value))


@converts_memory_error("an explicit file is stored row by row: no other engine needs less memory")
def build_imported(given: ExplicitData, options: Options) -> Engine:
    """The engine that the options name on a model that was read; 'auto' is the explicit one.

    Raises:
        ModelFault: there is a deadlock, and `options.fix_deadlocks` is False.
        UnsupportedError: two states have the same values, and the engine has diagrams; or the
            engine is rational, and the probabilities do not sum to 1 exactly.
        ResourceError: a limit of memory or time was reached.
    """
    if given.lower is not None:
        return _interval_engine(given, given.lower, options)
    engine = _explicit(given, options.fix_deadlocks, options.check_sums)
    if options.exact:
        return engine.rational(strict=True)
    if options.engine in ("auto", "explicit"):
        return erased(engine)
    from symcheck.exchange.symbolic_import import symbolic_engine

    return symbolic_engine(engine.explored, engine.members, options)


def _interval_engine(given: ExplicitData, lower: Numbers, options: Options) -> Engine:
    """The engine of a model with intervals.

    Raises:
        ModelFault: the intervals of a row hold no distribution.
        UnsupportedError: the options name an engine with diagrams, or a lower end is 0.
    """
    if options.engine not in ("auto", "explicit") and not options.exact:
        raise UnsupportedError(
            "intervals that were read state by state have explicit rows", hint="use -ex"
        )
    given = replace(given, rewards=[_one_per_row(given.matrix, r) for r in given.rewards])
    low, high = (
        _explicit(
            replace(given, matrix=replace(given.matrix, data=data)), options.fix_deadlocks, False
        )
        for data in (lower, given.matrix.data)
    )
    _check_intervals(low, high)

    def made(low: Engine, high: Engine) -> Engine:
        ends = [e.capability(ExplicitEngine) for e in (low, high)]
        assert ends[0] is not None
        assert ends[1] is not None
        explored = cast(Any, ends[1].explored)
        model = replace(explored.model, weights=Weights.INTERVALS)
        return erased(
            IntervalEngine(
                replace(explored, model=model),
                high.name,
                lower=ends[0].weights.data,
                source=ends[1],
                twin=twin,
            )
        )

    def twin() -> Engine:
        if len(_odd_intervals(low, high, rounded=False)):
            raise UnsupportedError(
                "the given intervals are rounded, and some hold no distribution exactly"
            )
        return made(low.rational(check_sums=False), high.rational(check_sums=False))

    return twin() if options.exact else made(erased(low), erased(high))


def _one_per_row(matrix: SparseMatrix, given: ExplicitRewards) -> ExplicitRewards:
    """Rewards whose transitions of each row have one reward, as nature chooses among these."""
    if given.entries is None:
        return given
    rows = given.rows.copy()
    rows[matrix.row_of_entry] = given.entries
    if (rows[matrix.row_of_entry] != given.entries).any():
        raise UnsupportedError("with intervals, the transitions of a row have one reward")
    return given._replace(rows=rows, entries=None)


def _check_intervals(low: ImportedEngine, high: ImportedEngine) -> None:
    """Raise ModelFault for the first row without a distribution, and for a lower end of 0."""
    assert low.given is not None
    lower = low.given[0]
    for row in _odd_intervals(low, high, rounded=True)[:1].tolist():
        message = f"the intervals of row {row}, of state {lower.state_of_row[row]}, hold no "
        hint = "0 <= lower <= upper <= 1, and 1 lies between the sums of the ends"
        raise ModelFault(Diagnostic(message + "distribution", code="interval", hint=hint))
    for entry in np.flatnonzero(lower.data == 0)[:1].tolist():
        state = lower.state_of_row[lower.row_of_entry[entry]]
        raise UnsupportedError(
            f"an interval with the lower end 0 is not supported, for example in state {state}",
            hint=POSITIVE_ENDS,
        )


def interval_fault(lower: float, upper: float) -> tuple[str, str | None]:
    """What is wrong with an interval of probabilities, and a hint; '' if nothing is."""
    if not (0 <= lower < inf and 0 <= upper < inf):
        return "a probability must be finite and not negative", None
    if lower > upper:
        return "this interval is empty: its lower end is above its upper end", None
    if upper > 1:
        return "the upper end of this interval is more than 1", None
    if lower == 0 < upper:
        return "an interval with the lower end 0 is not supported", POSITIVE_ENDS
    return "", None


def interval_sums_fault(
    row: Int64s, lower: Floats, upper: Floats, rows: int
) -> Iterator[tuple[int, str, str]]:
    """The first row without a distribution, what is wrong with it, and a hint.

    row: of each interval, int64[intervals].
    """
    counts, filled = np.bincount(row, minlength=rows), np.bincount(row, minlength=rows) > 0
    for side, ends, sign in (("lower", lower, 1), ("upper", upper, -1)):
        sums = np.bincount(row, ends, rows)
        wrong = filled & (sign * (sums - 1) > 0) & ~rounded_sum(sums, counts)
        for i in np.flatnonzero(wrong)[:1].tolist():
            message = f"the {side} ends of these intervals sum to {sums[i]:.12g}"
            yield i, message, "1 lies between the sums of the lower and of the upper ends"


def _odd_intervals(low: ImportedEngine, high: ImportedEngine, *, rounded: bool) -> Int64s:
    """The rows without a distribution. rounded: sums of ends may miss 1 by rounding."""
    assert low.given is not None
    assert high.given is not None
    lower, upper = low.given[0], high.given[0]
    below, above = (sum_segments(_rationals(m.data), m.indptr) for m in (lower, upper))
    lengths = lower.lengths
    wrong = (below > 1) & ~(rounded & rounded_sum(below, lengths))
    wrong |= (above < 1) & ~(rounded & rounded_sum(above, lengths))
    odd = (lower.data < 0) | (lower.data > upper.data) | (upper.data > 1)
    wrong[lower.row_of_entry[odd.astype(np.bool_)]] = True
    return np.flatnonzero(wrong)


def _explicit(given: ExplicitData, fix_deadlocks: bool, check_sums: bool) -> ImportedEngine:
    fixed, row_actions, rewards, dead = _fixed(given, fix_deadlocks)
    normal = not given.type.continuous_time and check_sums and not fixed.is_rational
    divided, warning = _odd_rows(fixed) if normal else (np.zeros(fixed.rows, np.bool_), None)
    matrix, earned = fixed.doubles(), rewards
    if warning is not None:
        sums = np.where(divided, _row_sums(matrix), 1.0)
        matrix = replace(matrix, data=matrix.data / sums[matrix.row_of_entry])
        earned = [_rewards_of(matrix, r) for r in rewards]
    members = dict(given.labels)
    initial = members.pop("init", None)
    deadlock = dead | members.pop("deadlock", np.zeros(given.matrix.states, bool))
    marks: dict[str, Expression] = {name: Name(f'"{name}"') for name in members}
    model = replace(_model(given, marks), warnings=() if warning is None else (warning,))
    layout = StateLayout.of(model.variables)
    explored = ExplicitModel(
        model,
        StateTable(layout, layout.pack([c for _, _, c in given.columns])),
        matrix,
        row_actions,
        np.flatnonzero(initial) if initial is not None else np.zeros(1, np.int64),
        np.flatnonzero(deadlock),
        [doubles(r.states) for r in earned],
        [doubles(r.rows) for r in earned],
    )
    return ImportedEngine(
        explored,
        members={marks[name]: states for name, states in members.items()},
        entry_rewards=[None if r.entries is None else doubles(r.entries) for r in rewards],
        given=(fixed, rewards),
        contributions=given.contributions,
        divided=divided,
    )


def _row_sums(matrix: SparseMatrix) -> Floats:
    sums: Floats = np.bincount(matrix.row_of_entry, matrix.data, matrix.rows).astype(np.float64)
    return sums


def _odd_rows(matrix: SparseMatrix) -> tuple[Bools, str | None]:
    """The rows that sum to almost 1, by more than rounding, and a warning if there are some."""
    sums = _row_sums(matrix)
    odd = (np.abs(sums - 1) <= SUM_TOLERANCE) & ~rounded_sum(sums, matrix.lengths)
    count = int(odd.sum())
    if not count:
        return odd, None
    row = int(np.argmax(odd))
    state = int(matrix.state_of_row[row])
    of = f"choice {row - int(matrix.groups[state])} of " if matrix.groups is not None else ""
    others = f", like {count - 1} others" * (count > 1)
    return odd, (
        f"the probabilities of {of}state {state} sum to {sums[row]:.15g}, not 1{others}: they are "
        "divided by their sum"
    )


def _rewards_of(matrix: SparseMatrix, given: ExplicitRewards) -> ExplicitRewards:
    """The rewards with those of rows for other probabilities."""
    if given.entries is None:
        return given
    if matrix.is_rational:
        of_entries = _rationals(matrix.data) * _rationals(given.entries)
        return given._replace(rows=sum_segments(of_entries, matrix.indptr))
    return given._replace(
        rows=row_rewards(ModelType.with_properties(), matrix, doubles(given.entries))
    )


def imported_program(given: ExplicitData) -> Program:
    """The declarations of a model that was read: variables, labels, rewards, but no commands."""
    declared = []
    for name, kind, column in given.columns:
        low, high = (Literal(int(x), Type.INT) for x in (column.min(), column.max()))
        whole = kind is Type.INT
        declared.append(
            VariableDeclaration(name, kind, low if whole else None, high if whole else None, None)
        )
    names = given.names or Program(None)
    return Program(
        given.type,
        names.constants,
        names.formulas,
        labels=tuple(Label(n, _TRUE) for n in given.labels if n not in ("init", "deadlock")),
        modules=(Module("imported", tuple(declared), ()),),
        rewards=tuple(RewardStructure(r.name, ()) for r in given.rewards),
        observables=(Observable(None, Name(OBSERVATION)),) * given.type.partially_observed,
    )


def _model(given: ExplicitData, marks: Mapping[str, Expression]) -> BoundModel:
    bound = bind(imported_program(given))
    values = {f.name: getattr(bound, f.name) for f in fields(bound)}
    values |= {"labels": dict(marks), "builder": partial(build_imported, given)}
    values["delays"] = given.delays
    return _ImportedModel(**values, names=given.actions)


def _fixed(
    given: ExplicitData, fix_deadlocks: bool
) -> tuple[SparseMatrix, Int32s, list[ExplicitRewards], Bools]:
    """Matrix, actions and rewards with a self-loop at each deadlock, and the deadlocks, bool[n]."""
    m = given.matrix
    n = m.states
    counts = np.diff(m.indptr) if m.groups is None else np.diff(m.groups)
    dead = counts == 0
    if not dead.any():
        return m, given.row_actions, list(given.rewards), dead
    if not fix_deadlocks:
        raise ModelFault(
            Diagnostic(
                f"the model has {int(dead.sum())} deadlock states, such as {int(np.argmax(dead))}",
                code="deadlock",
            )
        )
    states = np.flatnonzero(dead)
    at = m.indptr[:-1][states] if m.groups is None else m.indptr[m.groups[:-1][states]]
    indices = np.insert(m.indices, at, states.astype(np.int32))
    data = np.insert(m.data, at, 1.0)
    rewards = [
        r._replace(entries=None if r.entries is None else np.insert(r.entries, at, 0.0))
        for r in given.rewards
    ]
    if m.groups is None:
        lengths = np.where(dead, 1, np.diff(m.indptr))
        return SparseMatrix(starts_of(lengths), indices, data, n), given.row_actions, rewards, dead
    rows = m.groups[:-1][states]
    lengths = np.insert(np.diff(m.indptr), rows, 1)
    groups = starts_of(np.where(dead, 1, counts))
    none = RACE if given.type.immediate_choices else -1
    actions = np.insert(given.row_actions, rows, none).astype(np.int32)
    rewards = [r._replace(rows=np.insert(r.rows, rows, 0.0)) for r in rewards]
    return SparseMatrix(starts_of(lengths), indices, data, n, groups), actions, rewards, dead
