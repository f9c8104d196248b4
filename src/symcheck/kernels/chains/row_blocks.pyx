# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Blocks of rows of a triangular matrix, which threads solve for in turn.

A block needs those in which its entries are. Threads claim the blocks in the order of the rows, and
wait for the needed ones. Rows are computed as one thread would compute them, and sums are kept for
each block, so that no digit depends on the number of threads.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.portable cimport HAS_ATOMICS, next_number, publish, wait_until


def bounds_of_blocks(const int32_t[::1] count, const int32_t[::1] indices,
                     int64_t block_rows) -> Int64s:
    """Where blocks of about so many rows begin, and the number of rows: int64[blocks+1].

    Of the rows near each multiple of `block_rows`, a block begins at one over which the fewest
    short entries lead. Where states are numbered in the order of their variables' values, that is
    where one of the first variables changes, and neighbouring blocks rarely need each other.

    Args:
        count, indices: int32[rows], the entries of each row of a triangle, and their columns.
    """
    cdef int64_t rows = count.shape[0], blocks = max(rows // block_rows, 1)
    cdef int64_t i, j, k = 0, end, block, first, crossing
    cdef int64_t half = block_rows // 2
    cdef int32_t[::1] change = np.zeros(rows + 2, dtype=np.int32)  # of the entries across
    bounds = np.empty(blocks + 1, dtype=np.int64)
    cdef int64_t[::1] out = bounds
    cdef int64_t least
    with nogil:
        for i in range(rows):
            end = k + count[i]
            while k < end:
                j = indices[k]
                k += 1
                if -block_rows <= i - j <= block_rows:
                    change[min(i, j) + 1] += 1
                    change[max(i, j) + 1] -= 1
        crossing = i = 0
        out[0] = 0
        for block in range(1, blocks):
            first = block * block_rows - half
            least = -1
            while i < first + block_rows and i < rows:
                crossing += change[i]
                if i >= first and (least < 0 or crossing < least):
                    least = crossing
                    out[block] = i
                i += 1
        out[blocks] = rows
    return bounds


def needed_blocks(const int32_t[::1] count, const int32_t[::1] indices,
                  const int64_t[::1] bounds, int64_t most) -> tuple[Int64s, Int32s] | None:
    """The other blocks in which a triangle has entries, for each block of rows.

    Args:
        count, indices: as in `bounds_of_blocks`. bounds: its result.
        most: None is returned if there are more pairs of blocks.
    Returns:
        needed_ptr: int64[blocks+1]; needed: int32, the blocks.
    """
    cdef int64_t rows = count.shape[0], blocks = bounds.shape[0] - 1
    cdef int64_t i, k = 0, end, block, found = 0
    cdef int32_t other
    starts, pairs = np.zeros(blocks + 1, dtype=np.int64), np.empty(most, dtype=np.int32)
    cdef int64_t[::1] start = starts
    cdef int32_t[::1] needed = pairs
    cdef int32_t[::1] block_of = np.empty(rows, dtype=np.int32)
    cdef int32_t[::1] seen = np.full(blocks, -1, dtype=np.int32)  # the last block that needs it
    with nogil:
        for block in range(blocks):
            for i in range(bounds[block], bounds[block + 1]):
                block_of[i] = <int32_t>block
        for block in range(blocks):
            for i in range(bounds[block], bounds[block + 1]):
                end = k + count[i]
                while k < end:
                    other = block_of[indices[k]]
                    k += 1
                    if other == block or seen[other] == block:
                        continue
                    if found == most:
                        with gil:
                            return None
                    seen[other] = <int32_t>block
                    needed[found] = other
                    found += 1
            start[block + 1] = found
    return starts, pairs[:found].copy()


cdef class RowBlocks:
    """The blocks of a triangle, and which of them are solved for.

    levels: the blocks on the longest path of needed ones: the number of blocks if each needs the
    one before, so that threads are of no use.

    Args:
        count, indices: the triangle, as in `bounds_of_blocks`.
        upper: whether its entries are above the diagonal.
        most_blocks, least_rows: the blocks at most, and the rows of one at least, about.
    """

    def __init__(self, count: Int32s, indices: Int32s, bint upper, int64_t most_blocks,
                 int64_t least_rows):
        cdef int64_t i, k, block, blocks, rows = len(count)
        bounds, needs = np.array([0, rows]), None
        block_rows = max(least_rows, rows // most_blocks)
        if HAS_ATOMICS and most_blocks > 1 and rows > block_rows:
            bounds = bounds_of_blocks(count, indices, block_rows)
            needs = needed_blocks(count, indices, bounds, 64 * most_blocks)
        if needs is None:
            bounds = np.array([0, rows])
            needs = np.zeros(2, dtype=np.int64), np.empty(0, dtype=np.int32)
        self.bounds = bounds
        self.needed_ptr, self.needed = needs
        self.blocks = blocks = len(bounds) - 1
        cdef int32_t[::1] depth = np.ones(blocks, dtype=np.int32)
        for i in range(blocks):
            block = blocks - 1 - i if upper else i
            for k in range(self.needed_ptr[block], self.needed_ptr[block + 1]):
                depth[block] = max(depth[block], depth[self.needed[k]] + 1)
        self.levels = np.max(depth, initial=1)
        self.order = np.argsort(depth, kind="stable").astype(np.int32)
        entries = np.add.reduceat(count, bounds[:-1], dtype=np.int64) if rows else [0]
        self.starts = np.concatenate(([0], np.cumsum(entries)), dtype=np.int64)
        self.finished = np.zeros(blocks, dtype=np.int32)
        self.sums = np.zeros((blocks, 2))
        self.round = 0

    def begin(self):
        """Begin to solve."""
        self.following = 0
        self.round += 1

    def totals(self) -> tuple[float, float]:
        """The two sums of all blocks."""
        first, second = np.asarray(self.sums).sum(axis=0).tolist()
        return first, second

    cdef int64_t claim(self) noexcept nogil:
        """The next block, once all that it needs are finished; -1 if all blocks are claimed."""
        cdef int64_t k, position = next_number(&self.following), block
        if position >= self.blocks:
            return -1
        block = self.order[position]
        for k in range(self.needed_ptr[block], self.needed_ptr[block + 1]):
            wait_until(&self.finished[self.needed[k]], self.round)
        return block

    cdef void finish(self, int64_t block, double first_sum, double second_sum) noexcept nogil:
        """Keep the sums of a block, and let those go on that need it."""
        self.sums[block, 0] = first_sum
        self.sums[block, 1] = second_sum
        publish(&self.finished[block], self.round)
