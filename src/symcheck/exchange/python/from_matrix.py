"""Models from a matrix in Python. Fractions stay exact with the option `exact`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeVar, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike

from symcheck.api.arguments import model_type, takes_options
from symcheck.api.model import Model
from symcheck.errors import Diagnostic, ModelFault, NameFault, UsageError
from symcheck.exchange.api_io import explicit_model
from symcheck.exchange.column_reader import first_true
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards, reward_structure
from symcheck.matrices.numbers import Numbers, sum_segments
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.options import OptionValues, make_options
from symcheck.semantics.state_faults import sums_to_one
from symcheck.syntax.ast import ModelType, Type

if TYPE_CHECKING:
    from typing import TypeAlias

    from scipy.sparse import sparray, spmatrix

    Matrix: TypeAlias = ArrayLike | sparray | spmatrix

T = TypeVar("T")

__all__ = [
    "from_matrix",
    "identifier",
    "label",
    "named",
    "number_array",
    "numbered_actions",
    "plain_type",
]


@takes_options
def from_matrix(
    matrix: Matrix,
    *,
    labels: Mapping[str, ArrayLike] | None = None,
    rewards: Mapping[str, ArrayLike | tuple[ArrayLike | None, Matrix | None]] | None = None,
    initial: int | Sequence[int] = 0,
    type: ModelType | str | None = None,
    groups: Sequence[int] | None = None,
    actions: Sequence[str | None] | None = None,
    upper: Matrix | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """A model from a matrix. The variable `s` is the number of the state.

    Args:
        matrix: probabilities (rates of a CTMC), [states, states], or [choices, states] of an MDP;
            a SciPy sparse array or what numpy makes an array of, float64 or Fractions.
        labels: name to bool[states], or to the numbers of the states that have the label.
        rewards: name to the rewards of states, [states], or to a pair of these (or None) and the
            rewards of transitions: a matrix of the same shape, or an array with one per row.
        initial: the number of the initial state, or several.
        type: 'dtmc', 'ctmc' or 'mdp'; None: an MDP if there are `groups`, else a DTMC.
        groups: int[states+1]; the rows groups[s] to groups[s+1] - 1 are the choices of state s.
        actions: the action of each row of an MDP; None for a row without action.
        upper: a matrix of the same shape, if probabilities are intervals: those in `matrix` are the
            lower ends, these the upper ones.
        options: see `symcheck.Options`.

    Raises:
        UsageError: an argument has the wrong shape or type.
        ModelFault: a row does not sum to 1, or an entry is negative or not finite.

    Examples:
        >>> import symcheck
        >>> walk = symcheck.from_matrix([[0.5, 0.5], [0, 1]], labels={"end": [1]})
        >>> walk.check('T=? [ F "end" ]').value
        2.0
    """
    settings = make_options(options)
    kind = plain_type(type) or ModelType.with_properties(has_choices=groups is not None)
    rows, columns, data, shape = _entries(matrix if upper is None else upper)
    lower = None if upper is None else _lower_ends(matrix, rows, columns, shape)
    n = shape[1]
    starts = np.arange(n + 1) if groups is None else np.asarray(groups, np.int64)
    labels, rewards = named("labels", labels), named("rewards", rewards)
    if (
        not n
        or (groups is not None and not kind.has_choices)
        or starts.shape != (n + 1,)
        or (starts[0], starts[-1]) != (0, shape[0])
        or (np.diff(starts) < 0).any()
    ):
        raise UsageError(
            f"the matrix has {shape[0]} rows and {n} columns: expected a square one, or for an MDP "
            f"groups with {n + 1} ascending numbers: the first row of each state, and {shape[0]}"
            + ("" if groups is None else f"; the groups are {starts.tolist()}")
        )
    lengths = np.bincount(rows, minlength=shape[0])
    sparse = SparseMatrix(
        starts_of(lengths),
        columns.astype(np.int32),
        data,
        n,
        starts if kind.has_choices else None,
    )
    if lower is None:
        _check_rows(kind, sparse, rows, settings.check_sums)
    elif kind.continuous_time:
        raise UsageError("upper: intervals of rates are not supported; those of probabilities are")
    return explicit_model(
        ExplicitData(
            kind,
            [("s", Type.INT, np.arange(n))],
            sparse,
            *numbered_actions(actions, sparse),
            {label(name): _members(name, given, n) for name, given in labels.items()}
            | {"init": _members("init", np.atleast_1d(initial), n)},
            [_rewards(name, given, kind, sparse, rows) for name, given in rewards.items()],
            lower=lower,
        ),
        settings,
    )


def named(what: str, given: Mapping[str, T] | None) -> Mapping[str, T]:
    """The mapping from names that an argument is. Raises UsageError."""
    if given is not None and not isinstance(cast(object, given), Mapping):
        raise UsageError(f"{what}: expected a mapping from names, not {given!r}")
    return given or {}


def plain_type(given: ModelType | str | None, *, told: bool = False) -> ModelType | None:
    """The type of a model without players, clocks and observations. Raises UsageError.

    told: the model tells rates from probabilities, as a Markov automaton has to.
    """
    kind = model_type(given)
    if kind and kind.immediate_choices and not told:
        message = f"type={kind.value!r}: nothing tells rates from probabilities here"
        raise UsageError(message, hint="symcheck.from_function and symcheck.loads do")
    if kind and (kind.has_clocks or kind.partially_observed or kind.players > 1):
        raise UsageError(f"type={kind.value!r}: such a model needs a text", hint="symcheck.loads")
    return kind


def _entries(given: Any) -> tuple[Int64s, Int64s, Numbers, tuple[int, int]]:
    """Row, column and value of the entries that are not 0, by rows, and the shape."""
    if hasattr(given, "tocsr"):
        sparse = given.tocsr(copy=True)
        sparse.sum_duplicates()
        sparse.eliminate_zeros()
        rows = np.repeat(np.arange(sparse.shape[0]), np.diff(sparse.indptr))
        return rows, sparse.indices, number_array(sparse.data, "the matrix"), sparse.shape
    dense = number_array(given, "the matrix")
    if dense.ndim != 2:
        raise UsageError(f"the matrix has {dense.ndim} dimensions: expected 2, rows and columns")
    rows, columns = np.nonzero(dense)
    return rows, columns, dense[rows, columns], dense.shape


def _lower_ends(given: Any, rows: Int64s, columns: Int64s, shape: tuple[int, int]) -> Numbers:
    """The lower end of each entry of the upper ends. Raises UsageError."""
    own_rows, own_columns, data, own_shape = _entries(given)
    lower = np.zeros(len(rows), data.dtype)
    place = {at: i for i, at in enumerate(zip(rows.tolist(), columns.tolist(), strict=True))}
    for r, c, value in zip(own_rows.tolist(), own_columns.tolist(), data, strict=True):
        if own_shape != shape or (r, c) not in place:
            raise UsageError("upper: expected a matrix of the same shape, with upper ends of all")
        lower[place[r, c]] = value
    return lower


def number_array(values: object, what: str) -> Numbers:
    """An array of float64, or of objects if there are Fractions. Raises UsageError."""
    try:
        array = np.asarray(values)
        real = array.dtype.kind in "biuf" or all(isinstance(x, Real) for x in array.flat)
        floats = array.astype(np.float64) if real else np.array([np.nan])
    except (TypeError, ValueError):
        floats = np.array([np.nan])
    if not np.isfinite(floats).all():
        raise UsageError(f"{what}: expected finite real numbers")
    exact = array.dtype == object and any(isinstance(x, Fraction) for x in array.flat)
    return array if exact else floats


def _check_rows(kind: ModelType, matrix: SparseMatrix, rows: Int64s, check_sums: bool) -> None:
    """Check the signs of entries and the sums of rows. Raises ModelFault."""
    message, hint = "", None
    for entry in first_true(matrix.data < 0):
        message = f"row {rows[entry]} holds {matrix.data[entry]} in column {matrix.indices[entry]}"
        message += ": expected no negative number"
        hint = "leave the diagonal of a generator matrix out" if kind.continuous_time else None
    if not message and not kind.continuous_time and check_sums:
        sums = sum_segments(matrix.data, matrix.indptr).tolist()
        for row in [i for i, total in enumerate(sums) if not sums_to_one(total)][:1]:
            message = f"row {row} sums to {sums[row]}, not to 1"
            hint = None if sums[row] else "a state that is not left has a 1 on the diagonal"
    if message:
        raise ModelFault(Diagnostic(message, code="update-sum", hint=hint))


def _members(name: str, given: ArrayLike, n: int) -> Bools:
    """The states of a label. Raises UsageError."""
    array = np.asarray(given)
    if array.dtype == bool and array.shape == (n,):
        return array
    if array.size and (array.ndim != 1 or not np.issubdtype(array.dtype, np.integer)):
        raise UsageError(f"'{name}': expected {n} truth values, or numbers of states")
    members = np.zeros(n, bool)
    for state in array.tolist():
        if not 0 <= state < n:
            raise UsageError(f"'{name}': there is no state {state}; expected 0 to {n - 1}")
        members[state] = True
    return members


def numbered_actions(
    actions: Sequence[str | None] | None, matrix: SparseMatrix
) -> tuple[tuple[str, ...], Int32s]:
    """The action names, and the number of the action of each row."""
    if actions is None:
        return (), np.full(matrix.rows, -1, np.int32)
    if len(actions) != matrix.rows or matrix.groups is None:
        raise UsageError(
            f"actions: expected one for each of the {matrix.rows} rows of an MDP, "
            f"not {len(actions)}"
        )
    names = tuple(dict.fromkeys(identifier("an action", a) for a in actions if a is not None))
    number = {a: i for i, a in enumerate(names)}
    return names, np.array([-1 if a is None else number[a] for a in actions], np.int32)


def _rewards(
    name: str, given: Any, kind: ModelType, matrix: SparseMatrix, rows: Int64s
) -> ExplicitRewards:
    states, transitions = given if isinstance(given, tuple) else (given, None)
    what = f"rewards[{identifier('a reward structure', name)!r}]"
    state_rewards = np.zeros(matrix.states) if states is None else number_array(states, what)
    entries: Any = transitions
    if transitions is not None:
        sparse = hasattr(transitions, "tocsr")
        entries = transitions.tocsr() if sparse else number_array(transitions, what)
    shapes: tuple[tuple[int, ...], ...] = ((matrix.rows,), (matrix.rows, matrix.columns))
    if state_rewards.shape != (matrix.states,) or (
        entries is not None and entries.shape not in shapes
    ):
        raise UsageError(
            f"{what}: expected {matrix.states} rewards of states, or a pair of these or None and "
            f"rewards of transitions, {matrix.rows} x {matrix.columns} or one for each row"
        )
    if entries is not None:
        chosen = entries[rows] if entries.ndim == 1 else entries[rows, matrix.indices]
        entries = number_array(chosen, what).ravel()
    return reward_structure(name, kind, matrix, state_rewards, entries)


# ---------------------------------------------------------------------------------------- names


def identifier(what: str, name: object) -> str:
    """The name, if it is one in the PRISM language. Raises NameFault."""
    if not isinstance(name, str) or not (name.isidentifier() and name.isascii()):
        hint = "a name has letters, digits and _, and begins with no digit"
        raise NameFault(
            Diagnostic(f"{name!r} cannot be the name of {what}", code="name", hint=hint)
        )
    return name


def label(name: object) -> str:
    """The name of a label. Raises NameFault."""
    if name in ("init", "deadlock"):
        raise NameFault(Diagnostic(f'the label "{name}" is predefined', code="name"))
    return identifier("a label", name)
