"""The initial states: the one given by the declarations, or all that satisfy `init … endinit`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from symcheck.errors import ModelFault
from symcheck.explicit import tuning
from symcheck.explicit.candidates import conjuncts, guard_masks
from symcheck.explicit.compile import Code, compile_expression
from symcheck.explicit.states import Rows, StateLayout
from symcheck.matrices.rows import Int64s
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.state_faults import no_initial_state
from symcheck.syntax.ast import Binary, Expression, Literal, Name
from symcheck.syntax.operators import Operator

__all__ = ["initial_rows"]


def initial_rows(model: BoundModel, layout: StateLayout) -> Rows:
    """The initial states, packed, in lexicographic order: uint64[n, words].

    Variables are assigned one after the other, first those that complete a conjunct of the
    condition, so that only products of domains that no conjunct restricts are enumerated. Raises
    ModelFault if there is no initial state.
    """
    if model.initial is None:
        values = [np.array([int(cast("bool | int", v.initial))], np.int64) for v in model.variables]
        return layout.pack(values)
    blocks = [layout.pack(columns) for columns in _Enumeration.of(model, model.initial).blocks()]
    if not blocks:
        raise ModelFault(no_initial_state(model.initial.span))
    rows = np.concatenate(blocks)
    return np.ascontiguousarray(rows[np.lexsort(rows.T[::-1])])


@dataclass(frozen=True, eq=False)
class _Enumeration:
    """The search for the valuations that satisfy a condition.

    order: variables in the order of assignment; after number i, the conjuncts `checks[i]` can be
    evaluated.
    """

    domains: tuple[Int64s, ...]
    order: tuple[int, ...]
    checks: tuple[tuple[Code, ...], ...]

    @staticmethod
    def of(model: BoundModel, condition: Expression) -> _Enumeration:
        parts = conjuncts(condition)
        codes = [compile_expression(p, model) for p in parts]
        domains = tuple(_domain(model, i, parts) for i in range(len(model.variables)))
        allowed = guard_masks(
            condition, model.variables, {v.name: i for i, v in enumerate(model.variables)}
        )
        domains = tuple(
            d[allowed[i]] if i in allowed and len(allowed[i]) == len(d) else d
            for i, d in enumerate(domains)
        )
        order: list[int] = []
        for code in sorted(
            codes, key=lambda c: float(np.prod([max(1.0, len(domains[v])) for v in c.support]))
        ):
            order.extend(v for v in code.support if v not in order)
        order.extend(i for i in range(len(domains)) if i not in order)
        position = {v: i for i, v in enumerate(order)}
        last = [max((position[v] for v in c.support), default=0) for c in codes]
        checks = tuple(
            tuple(c for c, at in zip(codes, last, strict=True) if at == i)
            for i in range(len(order))
        )
        return _Enumeration(domains, tuple(order), checks)

    def blocks(self) -> Iterator[list[Int64s]]:
        """Values per variable of the valuations that satisfy all conjuncts, in blocks."""
        return self._extend([], 0)

    def _extend(self, columns: list[Int64s], at: int) -> Iterator[list[Int64s]]:
        if at == len(self.order):
            by_variable = dict(zip(self.order, columns, strict=True))
            yield [by_variable[i] for i in range(len(self.order))]
            return
        domain = self.domains[self.order[at]]
        lanes = len(columns[0]) if columns else 1
        size = max(1, tuning.VALUATIONS_PER_BLOCK // max(1, lanes))
        for start in range(0, len(domain), size):
            part = domain[start : start + size]
            extended = [np.repeat(c, len(part)) for c in columns] + [np.tile(part, lanes)]
            for code in self.checks[at]:
                holds = code.run(dict(zip(self.order, extended, strict=False)))
                extended = [c[np.broadcast_to(holds, c.shape)] for c in extended]
            if len(extended[0]):
                yield from self._extend(extended, at + 1)


def _domain(model: BoundModel, index: int, parts: list[Expression]) -> Int64s:
    variable = model.variables[index]
    fixed = _fixed(variable, parts)
    if fixed is not None:
        return np.array([fixed], np.int64)
    assert variable.low is not None, (
        "binding rules out variables without bounds beside init … endinit"
    )
    assert variable.high is not None
    return np.arange(variable.low, variable.high + 1)


def _fixed(variable: Variable, parts: list[Expression]) -> int | None:
    """The value in range that a conjunct `x=3` gives to a variable, or None."""
    for part in parts:
        match part:
            case Binary(Operator.EQ, Name(name), Literal(int(value))) | Binary(
                Operator.EQ, Literal(int(value)), Name(name)
            ) if name == variable.name:
                if (
                    variable.low is None
                    or variable.high is None
                    or variable.low <= value <= variable.high
                ):
                    return int(value)
    return None
