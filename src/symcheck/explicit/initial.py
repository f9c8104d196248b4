"""The initial states: the one given by the declarations, or all that satisfy `init … endinit`.

Conditions are evaluated with numpy. Valuations in which a conjunct has no value, because another
conjunct may rule them out, are left to the interpreter of expressions.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import cast

import numpy as np

from symcheck.errors import InputError, ModelFault
from symcheck.explicit import tuning
from symcheck.explicit.candidates import guard_masks
from symcheck.explicit.states import Rows, StateLayout
from symcheck.matrices.rows import Bools
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.state_faults import at_state, describe_state, no_initial_state
from symcheck.syntax.ast import Binary, Expression, Literal, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import conjuncts, names

__all__ = ["initial_rows", "initial_states"]

Columns = dict[str, Column]
_UNDECIDED = ""
"""The column of the valuations in which a conjunct has no value; no variable has this name."""


def initial_rows(model: BoundModel, layout: StateLayout) -> Rows:
    """The initial states, packed, in lexicographic order: uint64[n, words].

    Raises ModelFault if there is no initial state, or the condition has no value in some valuation.
    """
    return layout.pack(_initial_columns(model))


def initial_states(model: BoundModel) -> list[tuple[bool | int, ...]]:
    """The initial states as tuples of values. Order and errors are as for `initial_rows`."""
    columns = _initial_columns(model)
    return list(zip(*(c.tolist() for c in columns), strict=True)) if columns else [()]


def _initial_columns(model: BoundModel) -> list[Column]:
    """The values of each variable in the initial states, in lexicographic order.

    Variables are assigned one after the other, first those that complete a conjunct of the
    condition, so that only products of domains that no conjunct restricts are enumerated.
    """
    if model.initial is None:
        return [np.array([cast("bool | int", v.initial)]) for v in model.variables]
    blocks: list[Columns] = (
        list(_Enumeration(model, model.initial).blocks())
        if model.variables
        else [{}] * bool(evaluate(model.initial, {}, exact=model.is_rational))
    )
    if not blocks:
        raise ModelFault(no_initial_state(model.initial.span))
    columns = [np.concatenate([block[v.name] for block in blocks]) for v in model.variables]
    if not columns:
        return []
    order = np.lexsort(columns[::-1])
    return [column[order] for column in columns]


class _Enumeration:
    """The search for the valuations that satisfy a condition.

    Attributes:
        domains: the values of each variable that no conjunct about it alone rules out.
        order: variables in the order of assignment.
        checks: for each variable, the conjuncts that can be evaluated once it is assigned.
    """

    def __init__(self, model: BoundModel, condition: Expression) -> None:
        self._model, self._condition = model, condition
        parts = list(conjuncts(condition))
        index = {v.name: i for i, v in enumerate(model.variables)}
        allowed = guard_masks(condition, model.variables, index)
        self.domains = {
            v.name: _domain(v, parts, allowed.get(i)) for i, v in enumerate(model.variables)
        }
        support = [names(part) for part in parts]
        combinations = [prod(max(1, len(self.domains[n])) for n in read) for read in support]
        ordered = sorted(range(len(parts)), key=combinations.__getitem__)
        first = [n for i in ordered for n in sorted(support[i], key=index.__getitem__)]
        self.order = tuple(dict.fromkeys((*first, *index)))
        self.checks: dict[str, list[Expression]] = {name: [] for name in self.order}
        for part, read in zip(parts, support, strict=True):
            last = max(map(self.order.index, read), default=0)
            self.checks[self.order[last]].append(part)

    def blocks(self, columns: Columns | None = None, at: int = 0) -> Iterator[Columns]:
        """Values per variable of the valuations that satisfy all conjuncts, in blocks."""
        columns = columns or {}
        if at == len(self.order):
            yield from self._decided(columns)
            return
        name = self.order[at]
        domain = self.domains[name]
        lanes = len(next(iter(columns.values()), (0,)))
        size = max(1, tuning.VALUATIONS_PER_BLOCK // max(1, lanes))
        for start in range(0, len(domain), size):
            values = domain[start : start + size]
            extended = {n: np.repeat(c, len(values)) for n, c in columns.items()}
            extended[name] = np.tile(values, lanes)
            for part in self.checks[name]:
                extended = self._satisfying(part, extended)
            if len(extended[name]):
                yield from self.blocks(extended, at + 1)

    def _satisfying(self, part: Expression, columns: Columns) -> Columns:
        """The valuations that a conjunct does not rule out; those without a value are noted."""
        lanes = evaluate_columns(part, columns)
        if lanes.faults is None:
            return _selected(columns, lanes.values)
        noted = columns.get(_UNDECIDED, np.zeros(len(next(iter(columns.values()))), np.bool_))
        columns = {**columns, _UNDECIDED: noted | lanes.faults}
        return _selected(columns, lanes.values | lanes.faults)

    def _decided(self, columns: Columns) -> Iterator[Columns]:
        """The initial states among complete valuations. Raises ModelFault."""
        noted = columns.pop(_UNDECIDED, None)
        if noted is None:
            yield columns
            return
        holds = ~noted
        holds[noted] = self._decide(self._condition, _selected(columns, noted))
        if holds.any():
            yield _selected(columns, holds)

    def _decide(self, expression: Expression, columns: Columns) -> Bools:
        """Where an expression holds, one valuation after the other. Raises ModelFault."""
        read = sorted(names(expression)) or list(columns)[:1]
        values = np.stack([np.asarray(columns[n], np.int64) for n in read])
        distinct, inverse = np.unique(values, axis=1, return_inverse=True)
        kinds = [columns[n].dtype.type for n in read]
        holds = [
            self._holds(
                expression, {n: kind(x).item() for n, kind, x in zip(read, kinds, v, strict=True)}
            )
            for v in distinct.T
        ]
        return np.array(holds, np.bool_)[inverse.reshape(-1)]

    def _holds(self, expression: Expression, values: dict[str, bool | int]) -> bool:
        try:
            return bool(evaluate(expression, values, exact=self._model.is_rational))
        except InputError as fault:
            read = [v for v in self._model.variables if v.name in values]
            shown = describe_state(read, [values[v.name] for v in read])
            raise at_state(fault, shown) from None


def _selected(columns: Columns, holds: Bools) -> Columns:
    """The valuations where a condition holds."""
    return {n: c[np.broadcast_to(holds, c.shape)] for n, c in columns.items()}


def _domain(variable: Variable, parts: list[Expression], allowed: Bools | None) -> Column:
    """The values of a variable that the conjuncts about it alone allow."""
    assert variable.domain is not None, "init … endinit enumerates bounded variables only"
    if allowed is not None:
        return np.asarray(variable.domain)[allowed]
    for part in parts:
        match part:
            case Binary(Operator.EQ, Name(name), Literal(value)) | Binary(
                Operator.EQ, Literal(value), Name(name)
            ) if name == variable.name and value in variable.domain:
                return np.array([value], np.bool_ if variable.type is Type.BOOL else np.int64)
    return np.asarray(variable.domain)
