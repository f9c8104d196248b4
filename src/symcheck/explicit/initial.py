"""The initial states: the one given by the declarations, or all that satisfy `init … endinit`."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import cast

import numpy as np

from symcheck.errors import ModelFault
from symcheck.explicit import tuning
from symcheck.explicit.candidates import conjuncts, guard_masks
from symcheck.explicit.faults import raise_expression_fault
from symcheck.explicit.states import Rows, StateLayout
from symcheck.matrices.rows import Bools
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.state_faults import no_initial_state
from symcheck.syntax.ast import Binary, Expression, Literal, Name
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["initial_rows"]

Columns = dict[str, Column]


def initial_rows(model: BoundModel, layout: StateLayout) -> Rows:
    """The initial states, packed, in lexicographic order: uint64[n, words].

    Variables are assigned one after the other, first those that complete a conjunct of the
    condition, so that only products of domains that no conjunct restricts are enumerated. Raises
    ModelFault if there is no initial state.
    """
    if model.initial is None:
        values = [np.array([int(cast("bool | int", v.initial))], np.int64) for v in model.variables]
        return layout.pack(values)
    result = _Enumeration(model, model.initial).blocks()
    blocks = [layout.pack([c[v.name] for v in model.variables]) for c in result]
    if not blocks:
        raise ModelFault(no_initial_state(model.initial.span))
    rows = np.concatenate(blocks)
    return np.ascontiguousarray(rows[np.lexsort(rows.T[::-1])])


class _Enumeration:
    """The search for the valuations that satisfy a condition.

    Attributes:
        domains: the values of each variable that no conjunct about it alone rules out.
        order: variables in the order of assignment.
        checks: for each variable, the conjuncts that can be evaluated once it is assigned.
    """

    def __init__(self, model: BoundModel, condition: Expression) -> None:
        parts = conjuncts(condition)
        self.variables = tuple(enumerate(model.variables))
        index = {v.name: i for i, v in self.variables}
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
            yield columns
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
                holds = self.holds(part, extended)
                extended = {n: c[np.broadcast_to(holds, c.shape)] for n, c in extended.items()}
            if len(extended[name]):
                yield from self.blocks(extended, at + 1)

    def holds(self, part: Expression, columns: Columns) -> Bools:
        """Where a conjunct holds. Raises the ModelFault of the first valuation without a value."""
        lanes = evaluate_columns(part, columns)
        if lanes.faults is not None:
            faulty = np.broadcast_to(lanes.faults, next(iter(columns.values())).shape)
            at = int(np.flatnonzero(faulty)[0])
            assigned = {i: int(columns[v.name][at]) for i, v in self.variables if v.name in columns}
            raise_expression_fault(part, tuple(v for _, v in self.variables), assigned, 0)
        return lanes.values


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
                return np.array([value])
    return np.asarray(variable.domain)
