"""Compiled expressions on columns of values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symcheck.explicit.compile import Code
from symcheck.kernels.explore.register_machine import run_columns
from symcheck.syntax.ast import Type


def run_masked(code: Code, columns: Mapping[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The values of an expression, and which of them are valid; columns by variable index."""
    lanes = np.stack([np.asarray(c, np.int64) for c in columns.values()])
    n = lanes.shape[1]
    valid = np.ones(n, np.uint8)
    reals = np.empty(n) if code.type is Type.DOUBLE else None
    integers = np.empty(n, np.int64) if reals is None else None
    registers = np.array(list(columns), np.int32)
    run_columns(code.program, code.registers, registers, lanes, code.result, reals, integers, valid)
    values = integers if reals is None else reals
    return values.astype(bool) if code.type is Type.BOOL else values, valid.view(np.bool_)
