"""Compiled expressions, evaluated on many states at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.explicit.assembler import Assembler
from symcheck.explicit.code_generation import CodeGenerator
from symcheck.explicit.faults import raise_expression_fault
from symcheck.explicit.states import Rows, StateLayout
from symcheck.kernels.explore.register_machine import Op, run_columns, run_packed
from symcheck.matrices.rows import Bools, Int64s
from symcheck.semantics.model import BoundModel, Variable
from symcheck.syntax.ast import Expression, Type

__all__ = ["Code", "compile_expression"]


@dataclass(frozen=True, eq=False)
class Code:
    """An expression as a program of the register machine.

    Attributes:
        support: indices of the variables that it reads, ascending.
        program: int32[n, 4].
        registers: int64, the register file with the constants set, variables first.
        result: register of the value.
    """

    expression: Expression = field(repr=False)
    variables: tuple[Variable, ...] = field(repr=False)
    type: Type
    support: tuple[int, ...]
    program: NDArray[np.int32] = field(repr=False)
    registers: Int64s = field(repr=False)
    result: int = field(repr=False)

    def run(
        self, columns: Mapping[int, NDArray[Any]] | Sequence[NDArray[Any]] | NDArray[Any]
    ) -> NDArray[Any]:
        """The value for each of n valuations; some 10 to 50 million valuations per second for a few
        operations.

        Args:
            columns: per variable of `support`, an array of n ints or bools: a mapping from variable
                index to array, or the arrays in the order of `support` (a sequence, or the rows of
                an array).

        Returns:
            bool[n], int64[n] or float64[n] by `type`.

        Raises:
            ModelFault: for the first valuation without a value, as `evaluate` raises it.
        """
        return self._run(self._gather(columns), None)

    def run_masked(
        self, columns: Mapping[int, NDArray[Any]] | Sequence[NDArray[Any]] | NDArray[Any]
    ) -> tuple[NDArray[Any], Bools]:
        """As `run` without errors: the values, and which of them are valid (bool[n])."""
        lanes = self._gather(columns)
        valid = np.ones(lanes.shape[1], np.uint8)
        return self._run(lanes, valid), valid.view(np.bool_)

    def run_packed(self, layout: StateLayout, rows: Rows) -> NDArray[Any]:
        """The value in each of n packed states, as `run` gives it.

        Args:
            rows: uint64[n, words], states packed by `layout`.

        Raises:
            ModelFault: for the first state in which the expression has no value.
        """
        n, support = len(rows), list(self.support)
        reals = np.empty(n, np.float64) if self.type is Type.DOUBLE else None
        truths = np.empty(n, np.uint8) if self.type is Type.BOOL else None
        integers = np.empty(n, np.int64) if self.type is Type.INT else None
        fault, status = run_packed(
            self.program,
            self.registers,
            np.ascontiguousarray(layout.fields[support]),
            np.ascontiguousarray(layout.lows[support]),
            np.ascontiguousarray(rows),
            self.result,
            reals,
            integers,
            truths,
        )
        if fault >= 0:
            state = dict(enumerate(map(int, layout.unpack(rows[fault]))))
            raise_expression_fault(self.expression, self.variables, state, status)
        if truths is not None:
            return truths.view(np.bool_)
        values = integers if reals is None else reals
        assert values is not None
        return values

    def _gather(
        self, columns: Mapping[int, NDArray[Any]] | Sequence[NDArray[Any]] | NDArray[Any]
    ) -> Int64s:
        if isinstance(columns, np.ndarray) and columns.ndim == 2:
            return np.ascontiguousarray(columns, np.int64)
        chosen = (
            [columns[v] for v in self.support] if isinstance(columns, Mapping) else list(columns)
        )
        if not chosen:  # a constant has as many lanes as any column
            others = list(columns.values()) if isinstance(columns, Mapping) else []
            return np.zeros((0, len(others[0]) if others else 1), np.int64)
        return np.stack([np.asarray(c, np.int64) for c in chosen])

    def _run(self, lanes: Int64s, valid: NDArray[np.uint8] | None) -> NDArray[Any]:
        n = lanes.shape[1]
        reals = np.empty(n, np.float64) if self.type is Type.DOUBLE else None
        integers = np.empty(n, np.int64) if reals is None else None
        variables = np.array(self.support, np.int32)
        fault, status = run_columns(
            self.program, self.registers, variables, lanes, self.result, reals, integers, valid
        )
        if fault >= 0:
            raise_expression_fault(
                self.expression,
                self.variables,
                dict(zip(self.support, lanes[:, fault].tolist(), strict=True)),
                status,
            )
        if reals is not None:
            return reals
        assert integers is not None
        return integers.astype(np.bool_) if self.type is Type.BOOL else integers


def compile_expression(expression: Expression, model: BoundModel | tuple[Variable, ...]) -> Code:
    """Compile a well-typed expression over the variables of a model.

    Raises:
        UnsupportedError: the expression contains a node that has no value at a single state, such
            as a label or a probability.
    """
    variables = model if isinstance(model, tuple) else model.variables
    assembler = Assembler(len(variables))
    register, kind = CodeGenerator(assembler, variables).value(expression)
    assembler.halt()
    program, registers = assembler.finish()
    result = assembler.place_of(register)
    return Code(
        expression,
        variables,
        kind,
        _support(program, result, len(variables)),
        program,
        registers,
        result,
    )


def _support(program: NDArray[np.int32], result: int, variables: int) -> tuple[int, ...]:
    """The variables that a program reads; unused operands are written as 0 and are skipped."""
    read: set[int] = {result} if result < variables else set()
    for op, _, a, b in program.tolist():
        if op not in (Op.HALT, Op.FAIL, Op.JUMP):
            read.add(a)
            if op not in _UNARY:
                read.add(b)
    return tuple(sorted(v for v in read if v < variables))


_UNARY = frozenset(
    {Op.MOVE, Op.REAL, Op.NEGI, Op.NEGD, Op.FLOOR, Op.CEIL, Op.ROUND, Op.NOT, Op.JTRUE, Op.JFALSE}
)
