# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""One pass over compressed rows: proofs of bounds, depths of components, plain sweeps."""

import numpy as np

from libc.math cimport fabs, INFINITY
from libc.stdint cimport int32_t, int64_t

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307


def certify(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, groups_,
            const double[::1] lower_b, const double[::1] upper_b, const double[::1] x, const double[::1] weight,
            const int64_t[::1] policy, int mode):
    """Least factors (low, high) for which x - low*weight and x + high*weight are proved to bound the solution.

    Upper bound u = x + h w: A_r u + b_r <= u_s for every row of s (max), or for the policy's row (min and none); lower bound
    the other way round. As an inequality in h per row: gap <= h * slack, with slack = w_s - A_r w: a least h where slack is
    positive, a greatest one where it is negative. Roundings are counted in. Infinity: no proof with this weight.
    """
    cdef int64_t n = x.shape[0], s, r, k, first, last
    cdef double ax, aw, size, margin, gap, slack
    cdef double low = 0.0, high = 0.0, low_limit = INFINITY, high_limit = INFINITY
    cdef bint grouped = groups_ is not None, own
    cdef const int64_t[::1] groups = groups_ if grouped else indptr
    with nogil:
        for s in range(n):
            first = groups[s] if grouped else s
            last = groups[s + 1] if grouped else s + 1
            for r in range(first, last):
                ax = 0.0
                aw = 0.0
                size = fabs(x[s])
                for k in range(indptr[r], indptr[r + 1]):
                    ax = ax + data[k] * x[indices[k]]
                    size = size + data[k] * fabs(x[indices[k]])
                    aw = aw + data[k] * weight[indices[k]]
                margin = (indptr[r + 1] - indptr[r] + SLACK) * U
                slack = weight[s] - aw - (aw + weight[s]) * margin
                own = not grouped or policy[s] == r
                if mode == 2 or own:
                    gap = ax + upper_b[r] - x[s] + (size + fabs(upper_b[r])) * margin + TINY
                    limit(gap, slack, &high, &high_limit)
                if mode != 2 or own:
                    gap = x[s] - ax - lower_b[r] + (size + fabs(lower_b[r])) * margin + TINY
                    limit(gap, slack, &low, &low_limit)
        low = low * (1.0 + 1e-14)
        high = high * (1.0 + 1e-14)
        if low > low_limit:
            low = INFINITY
        if high > high_limit:
            high = INFINITY
    return low, high


cdef inline void limit(double gap, double slack, double* least, double* greatest) noexcept nogil:
    """Narrow least <= h <= greatest by gap <= h * slack."""
    if slack > 0.0:
        if gap > least[0] * slack:
            least[0] = gap / slack
    elif gap > 0.0:
        least[0] = INFINITY
    elif slack < 0.0 and gap / slack < greatest[0]:
        greatest[0] = gap / slack


def levels(const int64_t[::1] edges, const int32_t[::1] indices, const int32_t[::1] component, const int32_t[::1] order,
           const int64_t[::1] start, int64_t size):
    """int32[components]: the most components of more than `size` states on a path from a component (itself included).

    Edges to states that have no component (-1) do not count.
    """
    cdef int64_t count = start.shape[0] - 1, c, i, k, s
    cdef int32_t[::1] out = np.zeros(count, dtype=np.int32)
    cdef int32_t most, other
    with nogil:
        for c in range(count):
            most = 0
            for i in range(start[c], start[c + 1]):
                s = order[i]
                for k in range(edges[s], edges[s + 1]):
                    other = component[indices[k]]
                    if other >= 0 and other != c and out[other] > most:
                        most = out[other]
            out[c] = most + (1 if start[c + 1] - start[c] > size else 0)
    return np.asarray(out)


def sweep(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, groups_, const double[::1] b,
          double[::1] x, int mode, bint backwards):
    """One Gauss-Seidel sweep in index order, in place, without bounds."""
    cdef int64_t n = x.shape[0], i, s, r, k, first, last
    cdef bint grouped = groups_ is not None, any_
    cdef const int64_t[::1] groups = groups_ if grouped else indptr
    cdef double total, loop, best
    with nogil:
        for i in range(n):
            s = n - 1 - i if backwards else i
            first = groups[s] if grouped else s
            last = groups[s + 1] if grouped else s + 1
            best = 0.0
            any_ = False
            for r in range(first, last):
                total = b[r]
                loop = 0.0
                for k in range(indptr[r], indptr[r + 1]):
                    if indices[k] == s:
                        loop = loop + data[k]
                    else:
                        total = total + data[k] * x[indices[k]]
                if loop >= 1.0:
                    continue
                total = total / (1.0 - loop)
                if not any_ or (total > best if mode == 2 else total < best):
                    best = total
                    any_ = True
            x[s] = best
