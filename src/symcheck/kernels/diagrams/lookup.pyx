# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Functions given as diagrams, looked up at rows of bits."""

from libc.stdint cimport int32_t, int64_t, uint8_t


def lookup(const int32_t[::1] level, const int32_t[::1] low, const int32_t[::1] high, const double[::1] values, int32_t root,
           const int32_t[::1] place, const uint8_t[:, ::1] bits, double[::1] out):
    """The value at each row of `bits` (uint8[n, k]): out, float64[n].

    Ids below len(values) are leaves. place: int32, by level, which column of `bits` holds a variable's value.
    """
    cdef int64_t i
    cdef int32_t node, leaves = <int32_t> values.shape[0]
    with nogil:
        for i in range(bits.shape[0]):
            node = root
            while node >= leaves:
                node = high[node] if bits[i, place[level[node]]] else low[node]
            out[i] = values[node]
