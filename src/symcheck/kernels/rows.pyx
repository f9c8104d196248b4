# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Sums over chosen rows of a compressed-row matrix, and in them over chosen columns."""

ctypedef unsigned char uint8


def sum_into(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] rows,
             const uint8[::1] member, double[::1] out):
    """Per chosen row: the sum of the entries whose column is a member."""
    cdef Py_ssize_t i, k
    cdef long long r
    cdef double total
    with nogil:
        for i in range(rows.shape[0]):
            r = rows[i]
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                if member[indices[k]]:
                    total += data[k]
            out[i] = total


def sum_values(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] rows,
               const uint8[::1] member, const double[::1] values, double[::1] out):
    """Per chosen row: the sum of entry times value over the entries whose column is a member."""
    cdef Py_ssize_t i, k
    cdef long long r
    cdef double total
    with nogil:
        for i in range(rows.shape[0]):
            r = rows[i]
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                if member[indices[k]]:
                    total += data[k] * values[indices[k]]
            out[i] = total
