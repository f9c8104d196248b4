"""Models from a matrix in Python. Fractions stay exact with the option `exact`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from numbers import Real
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from symcheck.api import Model, model_type, takes_options
from symcheck.errors import Diagnostic, ModelFault, NameFault, UsageError
from symcheck.exchange.api_io import explicit_model
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

__all__ = ["check_rows", "from_matrix", "identifier", "label", "model_type"]


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
        options: see `symcheck.Options`.

    Raises:
        UsageError: an argument has the wrong shape or type.
        ModelFault: a row does not sum to 1, or an entry is negative or not finite.

    Example:
        >>> import symcheck
        >>> walk = symcheck.from_matrix([[0.5, 0.5], [0, 1]], labels={"end": [1]})
        >>> walk.check('T=? [ F "end" ]').value
        2.0
    """
    settings = make_options(options)
    kind = model_type(type) or (ModelType.DTMC if groups is None else ModelType.MDP)
    rows, columns, data, shape = _entries(matrix, "the matrix")
    found = SparseMatrix(
        starts_of(np.bincount(rows, minlength=shape[0])),
        columns.astype(np.int32),
        data,
        shape[1],
        _groups(kind, groups, shape),
    )
    n = found.states
    check_rows(kind, found, settings.check_sums, lambda row: f"row {row}")
    names, row_actions = _actions(actions, found)
    members = {label(name): _members(name, given, n) for name, given in (labels or {}).items()}
    structures = [
        _matrix_rewards(name, given, kind, found, rows) for name, given in (rewards or {}).items()
    ]
    data_read = ExplicitData(
        kind,
        [("s", Type.INT, np.arange(n))],
        found,
        names,
        row_actions,
        members | {"init": _members("init", np.atleast_1d(initial), n)},
        structures,
    )
    return explicit_model(data_read, settings)


# ------------------------------------------------------------------------------------- matrices


def _entries(given: Any, what: str) -> tuple[Int64s, Int64s, Numbers, tuple[int, int]]:
    """Row, column and value of the entries that are not 0, by rows, and the shape."""
    if hasattr(given, "tocsr"):
        sparse = given.tocsr(copy=True)
        sparse.sum_duplicates()
        sparse.eliminate_zeros()
        rows = np.repeat(np.arange(sparse.shape[0]), np.diff(sparse.indptr))
        return rows, sparse.indices, _numbers(sparse.data, what), sparse.shape
    dense = _numbers(given, what)
    if dense.ndim != 2:
        raise UsageError(f"{what} has {dense.ndim} dimensions: expected 2, rows and columns")
    rows, columns = np.nonzero(dense)
    return rows, columns, dense[rows, columns], dense.shape


def _numbers(values: Any, what: str) -> Numbers:
    """An array of float64, or of objects if there are Fractions."""
    try:
        array = np.asarray(values)
        real = array.dtype.kind in "biuf" or all(isinstance(x, Real) for x in array.flat)
        floats = array.astype(np.float64) if real else np.array([np.nan])
    except (TypeError, ValueError):
        floats = np.array([np.nan])
    if not np.isfinite(floats).all():
        raise UsageError(f"{what} is no array of finite real numbers")
    exact = array.dtype == object and any(isinstance(x, Fraction) for x in array.flat)
    return array if exact else floats


def _groups(kind: ModelType, groups: Sequence[int] | None, shape: tuple[int, int]) -> Int64s | None:
    rows, columns = shape
    if not columns:
        raise UsageError("the matrix is empty: a model has at least one state")
    if kind is not ModelType.MDP:
        if groups is not None:
            raise UsageError(f"a {kind.name} has one row per state, and no groups")
        if rows != columns:
            raise UsageError(
                f"the matrix has the shape {rows} x {columns}: a {kind.name} has a square matrix"
                "\n  hint: an MDP has several rows per state, and groups that say which"
            )
        return None
    starts = np.arange(columns + 1) if groups is None else np.asarray(groups, np.int64)
    if (
        starts.shape != (columns + 1,)
        or starts[0] != 0
        or starts[-1] != rows
        or (np.diff(starts) < 0).any()
    ):
        raise UsageError(
            f"groups: expected {columns + 1} ascending numbers, from 0 to the number of rows, "
            f"{rows}: the first row of each state, and the end"
        )
    return starts


def check_rows(
    kind: ModelType,
    matrix: SparseMatrix,
    check_sums: bool,
    describe: Callable[[int], str],
    *,
    deadlocks: bool = False,
) -> None:
    """Check the signs of entries and the sums of rows; with `deadlocks`, a row may be empty.

    Raises ModelFault.
    """
    values = matrix.doubles().data
    for entry in np.flatnonzero(values < 0)[:1].tolist():
        row = int(np.searchsorted(matrix.indptr, entry, side="right")) - 1
        message = f"{describe(row)} holds {values[entry]:g}, in column {matrix.indices[entry]}"
        hint = "leave the diagonal of a generator matrix out" if kind is ModelType.CTMC else None
        raise ModelFault(
            Diagnostic(f"{message}: expected no negative number", code="negative", hint=hint)
        )
    if kind is ModelType.CTMC or not check_sums:
        return
    sums = sum_segments(matrix.data, matrix.indptr).tolist()
    filled = np.diff(matrix.indptr).tolist()
    for row, (total, entries) in enumerate(zip(sums, filled, strict=True)):
        if not sums_to_one(total) and (entries or not deadlocks):
            shown = total if isinstance(total, Fraction) else f"{float(total):.12g}"
            message = f"{describe(row)} sums to {shown}, not to 1"
            hint = None if entries else "a state that is not left has a 1 on the diagonal"
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


def _actions(
    actions: Sequence[str | None] | None, matrix: SparseMatrix
) -> tuple[tuple[str, ...], Int32s]:
    """The action names, and the number of the action of each row."""
    given = [None] * matrix.rows if actions is None else list(actions)
    if len(given) != matrix.rows or (matrix.groups is None and actions is not None):
        raise UsageError(
            f"actions: expected one for each of the {matrix.rows} rows of an MDP, not {len(given)}"
        )
    names = tuple(dict.fromkeys(identifier("an action", a) for a in given if a is not None))
    number = {a: i for i, a in enumerate(names)}
    return names, np.array([-1 if a is None else number[a] for a in given], np.int32)


def _matrix_rewards(
    name: str, given: Any, kind: ModelType, matrix: SparseMatrix, rows: Int64s
) -> ExplicitRewards:
    states, transitions = given if isinstance(given, tuple) else (given, None)
    what = f'the reward "{identifier("a reward structure", name)}"'
    n = matrix.states
    of_states = np.zeros(n) if states is None else _numbers(states, what)
    if of_states.shape != (n,):
        raise UsageError(
            f"{what}: expected {n} rewards of states, not an array of shape {of_states.shape}"
            "\n  hint: a pair (None, matrix) gives the rewards of transitions"
        )
    if transitions is None:
        return ExplicitRewards(name, of_states, np.zeros(matrix.rows))
    shape = (matrix.rows, matrix.columns)
    array = transitions.tocsr() if hasattr(transitions, "tocsr") else _numbers(transitions, what)
    if array.shape == (matrix.rows,):
        entries = array[rows]
    elif array.shape == shape:
        entries = _numbers(array[rows, matrix.indices], what).ravel()
    else:
        raise UsageError(
            f"{what}: expected rewards of transitions as {shape[0]} x {shape[1]} numbers or one "
            f"for each of the {shape[0]} rows, not an array of shape {array.shape}"
        )
    return reward_structure(name, kind, matrix, of_states, entries)


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
