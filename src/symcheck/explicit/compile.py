"""Compiled expressions, evaluated on many states at once."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from symcheck.explicit.assembler import Assembler
from symcheck.explicit.code_generation import CodeGenerator
from symcheck.explicit.decider import Decider
from symcheck.explicit.faults import raise_expression_fault
from symcheck.explicit.states import Rows, StateLayout
from symcheck.kernels.explore.register_machine import run_packed
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Int64s
from symcheck.semantics.expressions.vectorised import Column
from symcheck.semantics.model import BoundModel, Variable
from symcheck.syntax.ast import Expression, Type
from symcheck.syntax.traversal import names

__all__ = ["Code", "compile_expression"]

_DTYPES = {Type.BOOL: np.uint8, Type.INT: np.int64, Type.DOUBLE: np.float64}


@dataclass(frozen=True, eq=False)
class Code:
    """An expression as a program of the register machine.

    Attributes:
        support: indices of the variables that it reads, ascending.
        program: int32[n, 4].
        registers: int64, the register file with the constants set, variables first.
        result: register of the value.
        decider: makes the decisions that rounding errors leave open.
    """

    expression: Expression = field(repr=False)
    variables: tuple[Variable, ...] = field(repr=False)
    type: Type
    support: tuple[int, ...]
    program: NDArray[np.int32] = field(repr=False)
    registers: Int64s = field(repr=False)
    result: int = field(repr=False)
    decider: Decider = field(repr=False)

    def run_packed(self, layout: StateLayout, rows: Rows) -> Column:
        """The value in each of n packed states.

        Args:
            layout: how the states are packed.
            rows: the states, uint64[n, words].

        Returns:
            bool[n], int64[n] or float64[n] by `type`.

        Raises:
            ModelFault: for the first state in which the expression has no value.
        """
        values = np.empty(len(rows), _DTYPES[self.type])
        is_bool = self.type is Type.BOOL
        support = list(self.support)
        fault, status = run_packed(
            self.program,
            self.registers,
            np.ascontiguousarray(layout.fields[support]),
            np.ascontiguousarray(layout.lows[support]),
            np.ascontiguousarray(rows),
            self.result,
            None if is_bool else values.view(np.int64),
            values if is_bool else None,
            self.decider,
        )
        if fault >= 0:
            state = dict(enumerate(map(int, layout.unpack(rows[fault]))))
            raise_expression_fault(self.expression, self.variables, state, status)
        return values.view(np.bool_) if is_bool else values


def compile_expression(expression: Expression, model: BoundModel | tuple[Variable, ...]) -> Code:
    """Compile a well-typed expression over the variables of a model.

    Raises:
        UnsupportedError: the expression contains a node that has no value at a single state, such
            as a label or a probability.
    """
    variables = model if isinstance(model, tuple) else model.variables
    assembler = Assembler(len(variables))
    generator = CodeGenerator(assembler, variables)
    register, kind = generator.number(expression)
    assembler.halt()
    program, registers = assembler.finish()
    read = names(expression)
    support = tuple(i for i, v in enumerate(variables) if v.name in read)
    result = assembler.place_of(register)
    return Code(expression, variables, kind, support, program, registers, result, generator.decider)
