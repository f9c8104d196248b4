# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Tight bounds of zones: shortest paths between all clocks (see `engines.zones.federation`)."""

from libc.stdint cimport int64_t, uint8_t


def close_zones(int64_t[:, :, ::1] zones, uint8_t[::1] kept, const int64_t infinite) -> None:
    """Tighten the bounds of zones, in place, and note which zones are not empty.

    zones: int64[m, n, n], codes of bounds, of which those above `infinite` / 2 are none. kept:
    uint8[m], written: 0 for an empty zone, whose bounds then mean nothing.

    Source: Floyd, Algorithm 97: shortest path, CACM 5 (1962).
    """
    cdef Py_ssize_t m = zones.shape[0], n = zones.shape[1], z, i, j, k
    cdef int64_t left, right, total
    with nogil:
        for z in range(m):
            kept[z] = 1
            for k in range(n):
                for i in range(n):
                    left = zones[z, i, k]
                    if left > infinite // 2:
                        continue
                    for j in range(n):
                        right = zones[z, k, j]
                        if right > infinite // 2:
                            continue
                        total = left + right - ((left | right) & 1)
                        if total < zones[z, i, j]:
                            zones[z, i, j] = total
                if zones[z, k, k] < 1:
                    kept[z] = 0
                    break
            for i in range(n):
                if zones[z, i, i] < 1:
                    kept[z] = 0
