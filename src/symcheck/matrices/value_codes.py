"""Numbers as codes into a table, where few of them are distinct: loops over a matrix take as long
as its entries take to read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from symcheck.kernels.arrays import Floats, Masks, UInt16s
from symcheck.kernels.rows import value_codes
from symcheck.matrices import tuning

__all__ = ["Codes", "encode"]

Codes = Masks | UInt16s | Floats
"""Codes of one or two bytes, or the numbers themselves."""


def encode(data: Floats) -> tuple[Codes, Floats]:
    """Codes of one or two bytes and the table of their values, float64[distinct values].

    Data with more distinct values than codes are returned as they are, with a table that is unused.
    Memory: 1 to 2 bytes per entry.
    """
    table = value_codes.distinct_values(data, tuning.SHORT_CODES)
    if table is None or not len(table):
        return data, np.ones(1)
    kind: type[Any] = np.uint8 if len(table) <= tuning.BYTE_CODES else np.uint16  # no common name
    codes = np.empty(len(data), kind)
    value_codes.write_codes(data, table, codes)
    return codes, table
