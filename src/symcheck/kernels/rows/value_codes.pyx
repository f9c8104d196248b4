# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Numbers as codes of one or two bytes into a table of the distinct ones."""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint64_t
from libc.string cimport memcpy

cdef enum:
    SLOTS = 1 << 18       # of the hash table of values: four times the number of codes

ctypedef fused Code:
    uint8_t
    uint16_t


cdef inline int64_t _find_slot(double value, const int32_t* slot,
                               const double* table) noexcept nogil:
    """The slot of a value, or where it belongs. Values are compared as numbers, so -0.0 must not
    occur.
    """
    cdef uint64_t bits, h
    memcpy(&bits, &value, 8)
    h = (((bits ^ (bits >> 29)) * <uint64_t>0x9E3779B97F4A7C15) >> 40) & (SLOTS - 1)
    while slot[h] >= 0 and table[slot[h]] != value:
        h = (h + 1) & (SLOTS - 1)
    return <int64_t>h


def distinct_values(const double[::1] data, int most) -> Floats | None:
    """The distinct values in order of first occurrence, or None if there are more than `most` (at
    most 65,536).
    """
    cdef int64_t k, h, count = 0
    cdef double value
    slots = np.full(SLOTS, -1, dtype=np.int32)
    values = np.empty(most)
    cdef int32_t[::1] slot = slots
    cdef double[::1] out = values
    with nogil:
        for k in range(data.shape[0]):
            value = data[k] + 0.0
            h = _find_slot(value, &slot[0], &out[0])
            if slot[h] < 0:
                if count == most:
                    count = -1
                    break
                slot[h] = <int32_t>count
                out[count] = value
                count += 1
    return None if count < 0 else values[:count].copy()


def write_codes(const double[::1] data, const double[::1] table, Code[::1] codes):
    """Write the place of each value in a table that has each once (uint8 or uint16)."""
    cdef int64_t k, t
    slots = np.full(SLOTS, -1, dtype=np.int32)
    cdef int32_t[::1] slot = slots
    with nogil:
        for t in range(table.shape[0]):
            slot[_find_slot(table[t], &slot[0], &table[0])] = <int32_t>t
        for k in range(data.shape[0]):
            codes[k] = <Code>slot[_find_slot(data[k] + 0.0, &slot[0], &table[0])]
