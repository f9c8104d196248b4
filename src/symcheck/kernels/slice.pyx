# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Parts of compressed-row matrices: chosen rows, and among their entries the chosen columns.

All arrays are one-dimensional and contiguous. `number` has a new column number per old column, -1 for columns left out.
"""

ctypedef unsigned char uint8


def slice_pointers(const long long[::1] indptr, const int[::1] indices, const long long[::1] rows, const int[::1] number,
                   long long[::1] out):
    """Fill `out` (int64[len(rows)+1]) with the row pointers of the part; the last one is its number of entries."""
    cdef Py_ssize_t i, k
    cdef long long total = 0
    cdef long long r
    with nogil:
        out[0] = 0
        for i in range(rows.shape[0]):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                if number[indices[k]] >= 0:
                    total += 1
            out[i + 1] = total


def slice_entries(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] rows,
                  const int[::1] number, int[::1] columns, double[::1] values):
    """Fill the entries of the part, whose total `slice_pointers` told."""
    cdef Py_ssize_t i, k
    cdef Py_ssize_t at = 0
    cdef long long r
    cdef int c
    with nogil:
        for i in range(rows.shape[0]):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                c = number[indices[k]]
                if c >= 0:
                    columns[at] = c
                    values[at] = data[k]
                    at += 1


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
