# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Signatures of states for bisimulation: where their rows lead, by blocks of a partition, as hashes
of 128 bits.
"""

from libc.stdint cimport uint64_t
from libc.stdlib cimport free, malloc

from symcheck.kernels.tables.hash_mix cimport double_bits, mix, round_to_44_bits


def signatures(const long long[::1] indptr, const int[::1] indices, const double[::1] data,
               const long long[::1] groups, const uint64_t[::1] seeds, const int[::1] block,
               Py_ssize_t blocks, const long long[::1] states, uint64_t[:, ::1] out):
    """For each of `states`: the hash of its set of rows. out: uint64[len(states), 2].

    A row counts by its seed (uint64[rows]) and, per block, by the sum of its entries that lead
    there. groups: int64[n+1], the rows of each state. Rows that are equal count once.
    """
    cdef Py_ssize_t i, k, j, touched, first
    cdef long long r, rows, most = 1
    cdef int b
    cdef uint64_t h0, h1, t, u
    for i in range(states.shape[0]):
        rows = groups[states[i] + 1] - groups[states[i]]
        if rows > most:
            most = rows
    cdef double *total = <double *>malloc(max(1, blocks) * sizeof(double))
    cdef int *seen = <int *>malloc(max(1, blocks) * sizeof(int))
    cdef uint64_t *hashes = <uint64_t *>malloc(2 * most * sizeof(uint64_t))
    if total == NULL or seen == NULL or hashes == NULL:
        free(total)
        free(seen)
        free(hashes)
        raise MemoryError()
    with nogil:
        for i in range(blocks):
            total[i] = -1.0
        for i in range(states.shape[0]):
            rows = 0
            for r in range(groups[states[i]], groups[states[i] + 1]):
                touched = 0
                for k in range(indptr[r], indptr[r + 1]):
                    b = block[indices[k]]
                    if total[b] < 0.0:
                        total[b] = 0.0
                        seen[touched] = b
                        touched += 1
                    total[b] += data[k]
                h0 = mix(seeds[r] + <uint64_t>0x9E3779B97F4A7C15)
                h1 = mix(seeds[r] ^ <uint64_t>0xD1B54A32D192ED03)
                for k in range(touched):
                    b = seen[k]
                    t = mix(<uint64_t>b * <uint64_t>0x9E3779B97F4A7C15 + 1)
                    u = double_bits(round_to_44_bits(total[b]))
                    h0 += mix(t ^ u)
                    h1 += mix(t + mix(u + <uint64_t>0x632BE59BD9B4E019))
                    total[b] = -1.0
                for j in range(rows):
                    if hashes[2 * j] == h0 and hashes[2 * j + 1] == h1:
                        break
                else:
                    hashes[2 * rows] = h0
                    hashes[2 * rows + 1] = h1
                    rows += 1
            h0 = 0
            h1 = 0
            for j in range(rows):
                h0 += mix(hashes[2 * j] + 3)
                h1 += mix(hashes[2 * j + 1] + 7)
            out[i, 0] = h0
            out[i, 1] = h1
    free(total)
    free(seen)
    free(hashes)
