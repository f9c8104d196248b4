# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Signatures of states for bisimulation on compressed rows, as hashes of 128 bits."""

from libc.stdint cimport int32_t, int64_t, uint64_t
from libc.stdlib cimport free, malloc

from symcheck.kernels.tables.hash_mix cimport double_bits, mix, round_to_44_bits


def row_signatures(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                   const int64_t[::1] groups, const uint64_t[::1] seeds, const int32_t[::1] block,
                   Py_ssize_t blocks, const int64_t[::1] states, uint64_t[:, ::1] out):
    """Hash the set of rows of each state.

    A row is hashed by its seed and, per block, the sum of its entries in the block. Equal rows of a
    state count once.

    Args:
        indptr, indices, data: compressed rows. groups: int64[n+1], the rows of each state.
        seeds: uint64[rows], which tell rows apart beforehand.
        block: int32[n], the block of each state. blocks: number of blocks.
        states: int64[m], the states to hash. out: uint64[m, 2], receives the hashes.
    Raises:
        MemoryError: memory ended.
    Source: Valmari & Franceschinis (2010); Derisavi, Hermanns & Sanders (2003).
    """
    cdef Py_ssize_t i, k, j, touched, first
    cdef int64_t r, row_count, most = 1
    cdef int b
    cdef uint64_t h0, h1, block_hash, sum_hash
    for i in range(states.shape[0]):
        row_count = groups[states[i] + 1] - groups[states[i]]
        if row_count > most:
            most = row_count
    cdef double *block_sum = <double *>malloc(max(1, blocks) * sizeof(double))
    cdef int *touched_blocks = <int *>malloc(max(1, blocks) * sizeof(int))
    cdef uint64_t *hashes = <uint64_t *>malloc(2 * most * sizeof(uint64_t))
    if block_sum == NULL or touched_blocks == NULL or hashes == NULL:
        free(block_sum)
        free(touched_blocks)
        free(hashes)
        raise MemoryError()
    with nogil:
        for i in range(blocks):
            block_sum[i] = -1.0
        for i in range(states.shape[0]):
            row_count = 0
            for r in range(groups[states[i]], groups[states[i] + 1]):
                touched = 0
                for k in range(indptr[r], indptr[r + 1]):
                    b = block[indices[k]]
                    if block_sum[b] < 0.0:
                        block_sum[b] = 0.0
                        touched_blocks[touched] = b
                        touched += 1
                    block_sum[b] += data[k]
                h0 = mix(seeds[r] + <uint64_t>0x9E3779B97F4A7C15)
                h1 = mix(seeds[r] ^ <uint64_t>0xD1B54A32D192ED03)
                for k in range(touched):
                    b = touched_blocks[k]
                    block_hash = mix(<uint64_t>b * <uint64_t>0x9E3779B97F4A7C15 + 1)
                    sum_hash = double_bits(round_to_44_bits(block_sum[b]))
                    h0 += mix(block_hash ^ sum_hash)
                    h1 += mix(block_hash + mix(sum_hash + <uint64_t>0x632BE59BD9B4E019))
                    block_sum[b] = -1.0
                for j in range(row_count):
                    if hashes[2 * j] == h0 and hashes[2 * j + 1] == h1:
                        break
                else:
                    hashes[2 * row_count] = h0
                    hashes[2 * row_count + 1] = h1
                    row_count += 1
            h0 = 0
            h1 = 0
            for j in range(row_count):
                h0 += mix(hashes[2 * j] + 3)
                h1 += mix(hashes[2 * j + 1] + 7)
            out[i, 0] = h0
            out[i, 1] = h1
    free(block_sum)
    free(touched_blocks)
    free(hashes)
