# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Single passes over compressed rows: certificates of bounds, depths of components, plain sweeps.

indptr, indices, data: int64[rows+1], int32, float64. groups: int64[states+1] or None, the rows of
each state. mode: 0 without choices, 1 minimum, 2 maximum.
"""

import numpy as np

from libc.math cimport fabs, INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.rounding cimport UNDERFLOW_MARGIN, error_of_row


def certify(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
            groups: Int64s | None, const double[::1] lower_b, const double[::1] upper_b,
            const double[::1] x, const double[::1] weight, const int64_t[::1] policy,
            int mode, double error) -> tuple[float, float]:
    """The least factors (low, high) for which x - low * weight and x + high * weight are proved
    bounds.

    The upper bound u = x + h w needs A_r u + b_r <= u_s for every row r of s (maximum), or for the
    row of the policy (minimum and no choices); the lower bound is symmetric. As a condition on h
    this is gap <= h * slack per row, with slack = w_s - A_r w: a least h where the slack is
    positive, and a greatest one where it is negative. Rounding errors are included.

    Args:
        lower_b, upper_b: float64[rows], bounds on b.
        x: float64[states].
        weight: float64[states]. One that is not positive proves nothing.
        policy: int64[states], a row per state (unused without groups).
        error: of the coefficients and constants, relative.
    Returns:
        The two factors; infinity if this weight proves nothing.
    """
    cdef int64_t n = x.shape[0], s, r, k, first, last
    cdef double ax, aw, size, margin, gap, slack
    cdef double low = 0.0, high = 0.0, low_limit = INFINITY, high_limit = INFINITY
    cdef bint grouped = groups is not None, in_policy
    cdef const int64_t[::1] group_ptr = groups if grouped else indptr
    with nogil:
        for s in range(n):
            first = group_ptr[s] if grouped else s
            last = group_ptr[s + 1] if grouped else s + 1
            if not weight[s] > 0.0:
                low = high = INFINITY
            for r in range(first, last):
                ax = 0.0
                aw = 0.0
                size = fabs(x[s])
                for k in range(indptr[r], indptr[r + 1]):
                    ax = ax + data[k] * x[indices[k]]
                    size = size + data[k] * fabs(x[indices[k]])
                    aw = aw + data[k] * weight[indices[k]]
                margin = error_of_row(indptr[r + 1] - indptr[r], error)
                slack = weight[s] - aw - (aw + weight[s]) * margin
                in_policy = not grouped or policy[s] == r
                if mode == 2 or in_policy:
                    gap = (ax + upper_b[r] - x[s] + (size + fabs(upper_b[r])) * margin
                           + UNDERFLOW_MARGIN)
                    narrow_factor(gap, slack, &high, &high_limit)
                if mode != 2 or in_policy:
                    gap = (x[s] - ax - lower_b[r] + (size + fabs(lower_b[r])) * margin
                           + UNDERFLOW_MARGIN)
                    narrow_factor(gap, slack, &low, &low_limit)
        low = low * (1.0 + 1e-14)
        high = high * (1.0 + 1e-14)
        if low > low_limit:
            low = INFINITY
        if high > high_limit:
            high = INFINITY
    return low, high


cdef inline void narrow_factor(double gap, double slack, double* least,
                               double* greatest) noexcept nogil:
    """Narrow the range least <= h <= greatest by gap <= h * slack."""
    if slack > 0.0:
        if gap > least[0] * slack:
            least[0] = gap / slack
    elif gap > 0.0:
        least[0] = INFINITY
    elif slack < 0.0 and gap / slack < greatest[0]:
        greatest[0] = gap / slack


def component_depths(const int64_t[::1] edges, const int32_t[::1] indices,
                     const int32_t[::1] component, const int32_t[::1] order,
                     const int64_t[::1] start, int64_t size) -> Int32s:
    """The most components of more than `size` states on a path from each component:
    int32[components].

    A component counts for itself. Edges to states without a component (-1) do not count.

    Args:
        edges: int64[states+1], the entries of each state in `indices`.
        component: int32[states]. order: int32, the states by component. start:
            int64[components+1].
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


def gauss_seidel_sweep(const int64_t[::1] indptr, const int32_t[::1] indices,
                       const double[::1] data, const double[::1] b, double[::1] x,
                       bint backwards):
    """One Gauss-Seidel sweep x = A x + b of a chain in place, in index order, without bounds.

    b: float64[states]. x: float64[states]. backwards: from the last state on.
    """
    cdef int64_t n = x.shape[0], i, s, k
    cdef double total, loop
    with nogil:
        for i in range(n):
            s = n - 1 - i if backwards else i
            total = b[s]
            loop = 0.0
            for k in range(indptr[s], indptr[s + 1]):
                if indices[k] == s:
                    loop = loop + data[k]
                else:
                    total = total + data[k] * x[indices[k]]
            x[s] = total / (1.0 - loop) if loop < 1.0 else 0.0
