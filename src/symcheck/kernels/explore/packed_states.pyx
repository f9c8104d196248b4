# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Lexicographic order of packed states: rows of uint64 words."""

from libc.stdint cimport int32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.tuning cimport INSERTION_SORT_ROWS, RADIX_BITS


cdef struct Item:
    uint64_t key
    int32_t row


cdef void insertion_sort(Item* items, long long n) noexcept nogil:
    """Sort few items by key."""
    cdef long long i, j
    cdef Item item
    for i in range(1, n):
        item = items[i]
        j = i
        while j > 0 and items[j - 1].key > item.key:
            items[j] = items[j - 1]
            j -= 1
        items[j] = item


cdef void radix_sort(Item* items, Item* spare, long long n, uint64_t varying) noexcept nogil:
    """Sort by key, least significant digit first, skipping digits in which no key differs."""
    cdef long long counts[1 << RADIX_BITS]
    cdef int shift = 0, d
    cdef long long i, total, occurrences
    cdef Item* source = items
    cdef Item* target = spare
    cdef uint64_t mask = (1 << RADIX_BITS) - 1
    while shift < 64:
        if not (varying >> shift) & 1:
            shift += 1
            continue
        memset(counts, 0, sizeof(counts))
        for i in range(n):
            counts[(source[i].key >> shift) & mask] += 1
        total = 0
        for d in range(1 << RADIX_BITS):
            occurrences = counts[d]
            counts[d] = total
            total += occurrences
        for i in range(n):
            d = (source[i].key >> shift) & mask
            target[counts[d]] = source[i]
            counts[d] += 1
        source, target = target, source
        shift += RADIX_BITS
    if source != items:
        for i in range(n):
            items[i] = source[i]


cdef void sort_range(const uint64_t* rows, int words, int word, Item* items, Item* spare,
                     long long n) noexcept nogil:
    """Sort items by the words from `word` on."""
    cdef long long i, begin
    cdef uint64_t common_bits = ~(<uint64_t> 0), any_bits = 0
    while True:
        common_bits = ~(<uint64_t> 0)
        any_bits = 0
        for i in range(n):
            items[i].key = rows[<long long> items[i].row * words + word]
            common_bits &= items[i].key
            any_bits |= items[i].key
        if any_bits != common_bits:
            break
        word += 1
        if word == words:
            return
    if n <= INSERTION_SORT_ROWS:
        insertion_sort(items, n)
    else:
        radix_sort(items, spare, n, any_bits & ~common_bits)
    if word + 1 == words:
        return
    begin = 0
    for i in range(1, n + 1):
        if i == n or items[i].key != items[begin].key:
            if i - begin > 1:
                sort_range(rows, words, word + 1, items + begin, spare + begin, i - begin)
            begin = i


def sort_rows(const uint64_t[:, ::1] rows, int32_t[::1] order, int32_t[::1] rank):
    """Sort rows lexicographically.

    Args:
        rows: uint64[n, words].
        order: int32[n], receives the row at each position; rank: int32[n], its inverse.
    Raises:
        MemoryError: memory ended.
    """
    cdef long long n = rows.shape[0], i
    cdef int words = rows.shape[1]
    cdef Item* items
    if n == 0:
        return
    items = <Item*> malloc(2 * n * sizeof(Item))
    if items == NULL:
        raise MemoryError
    with nogil:
        for i in range(n):
            items[i].row = <int32_t> i
        if words:
            sort_range(&rows[0, 0], words, 0, items, items + n, n)
        for i in range(n):
            order[i] = items[i].row
            rank[items[i].row] = <int32_t> i
    free(items)


def find_rows(const uint64_t[:, ::1] table, const uint64_t[:, ::1] requested,
              int32_t[::1] positions):
    """Find rows in a sorted table by binary search.

    Args:
        table: uint64[n, words], sorted. requested: uint64[m, words].
        positions: int32[m], receives the position of each row, -1 if it is not in the table.
    """
    cdef long long n = table.shape[0], low, high, middle, i
    cdef int words = table.shape[1], w, sign
    with nogil:
        for i in range(requested.shape[0]):
            low, high = 0, n
            positions[i] = -1
            while low < high:
                middle = (low + high) // 2
                sign = 0
                for w in range(words):
                    if table[middle, w] != requested[i, w]:
                        sign = -1 if table[middle, w] < requested[i, w] else 1
                        break
                if sign == 0:
                    positions[i] = <int32_t> middle
                    break
                if sign < 0:
                    low = middle + 1
                else:
                    high = middle
