# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Lists of objects of which most are shared, such as the rationals of a model."""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint64_t

from symcheck.kernels.tables.hash_mix cimport mix


def group_identical(values: list[object]) -> tuple[Int32s, Int64s]:
    """Number the distinct objects in the order in which they occur first.

    Objects are distinct by identity, not by value.

    Returns:
        The number of the object in each place, int32[n], and the place where each object occurs
        first, int64[k].
    """
    cdef list objects = values
    cdef Py_ssize_t i, n = len(objects)
    cdef int32_t[::1] numbers = np.empty(n, np.int32)
    cdef int64_t[::1] firsts = np.empty(1024, np.int64)
    cdef int32_t[::1] table = np.full(2048, -1, np.int32)
    cdef uint64_t slot, mask = 2047
    cdef int32_t count = 0, k
    for i in range(n):
        if i > 0 and objects[i] is objects[i - 1]:
            numbers[i] = numbers[i - 1]
            continue
        slot = mix(<uint64_t><void*>objects[i]) & mask
        while table[slot] >= 0 and objects[firsts[table[slot]]] is not objects[i]:
            slot = (slot + 1) & mask
        if table[slot] < 0:
            if count == firsts.shape[0]:  # both arrays are twice as large
                firsts = np.concatenate([firsts, np.empty_like(firsts)])
                table = np.full(4 * count, -1, np.int32)
                mask = 4 * count - 1
                for k in range(count):
                    slot = mix(<uint64_t><void*>objects[firsts[k]]) & mask
                    while table[slot] >= 0:
                        slot = (slot + 1) & mask
                    table[slot] = k
                slot = mix(<uint64_t><void*>objects[i]) & mask
                while table[slot] >= 0:
                    slot = (slot + 1) & mask
            table[slot] = count
            firsts[count] = i
            count += 1
        numbers[i] = table[slot]
    return np.asarray(numbers), np.asarray(firsts[:count])
