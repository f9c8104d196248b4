"""Compiled expressions on columns of values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symcheck.explicit.compile import Code
from symcheck.kernels.explore.register_machine import Status, evaluate
from symcheck.syntax.ast import Type


def run_masked(code: Code, columns: Mapping[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The values of an expression, and which of them are valid; columns by variable index."""
    lanes = np.stack([np.asarray(c, np.int64) for c in columns.values()])
    places = list(columns)
    values, valid = np.zeros(lanes.shape[1], np.int64), np.zeros(lanes.shape[1], bool)
    for i in range(len(values)):
        registers = np.append(code.registers, 0)
        registers[places] = lanes[:, i]
        valid[i] = evaluate(code.program, registers, code.decider) == Status.DONE
        values[i] = registers[code.result]
    if code.type is Type.DOUBLE:
        return values.view(np.float64), valid
    return values.astype(bool) if code.type is Type.BOOL else values, valid
