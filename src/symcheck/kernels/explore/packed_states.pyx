# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Order on packed states: rows of uint64 words, compared word by word."""

from libc.stdint cimport int32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

cdef enum:
    SMALL = 48  # below this, insertion sort
    DIGIT = 11


cdef struct Item:
    uint64_t key
    int32_t row


cdef void insertion(Item* items, long long n) noexcept nogil:
    cdef long long i, j
    cdef Item item
    for i in range(1, n):
        item = items[i]
        j = i
        while j > 0 and items[j - 1].key > item.key:
            items[j] = items[j - 1]
            j -= 1
        items[j] = item


cdef void radix(Item* items, Item* spare, long long n, uint64_t varying) noexcept nogil:
    """Sort by key, least significant digit first, passing over digits in which no key differs."""
    cdef long long counts[1 << DIGIT]
    cdef int shift = 0, d
    cdef long long i, total, c
    cdef Item* source = items
    cdef Item* target = spare
    cdef uint64_t mask = (1 << DIGIT) - 1
    while shift < 64:
        if not (varying >> shift) & 1:
            shift += 1
            continue
        memset(counts, 0, sizeof(counts))
        for i in range(n):
            counts[(source[i].key >> shift) & mask] += 1
        total = 0
        for d in range(1 << DIGIT):
            c = counts[d]
            counts[d] = total
            total += c
        for i in range(n):
            d = (source[i].key >> shift) & mask
            target[counts[d]] = source[i]
            counts[d] += 1
        source, target = target, source
        shift += DIGIT
    if source != items:
        for i in range(n):
            items[i] = source[i]


cdef void order_range(const uint64_t* rows, int words, int word, Item* items, Item* spare, long long n) noexcept nogil:
    cdef long long i, begin
    cdef uint64_t both = ~(<uint64_t> 0), any = 0
    while True:
        both = ~(<uint64_t> 0)
        any = 0
        for i in range(n):
            items[i].key = rows[<long long> items[i].row * words + word]
            both &= items[i].key
            any |= items[i].key
        if any != both:
            break
        word += 1
        if word == words:
            return
    if n <= SMALL:
        insertion(items, n)
    else:
        radix(items, spare, n, any & ~both)
    if word + 1 == words:
        return
    begin = 0
    for i in range(1, n + 1):
        if i == n or items[i].key != items[begin].key:
            if i - begin > 1:
                order_range(rows, words, word + 1, items + begin, spare + begin, i - begin)
            begin = i


def order_rows(const uint64_t[:, ::1] rows, int32_t[::1] order, int32_t[::1] rank):
    """Sort rows (uint64[n, words]) lexicographically: row `order[i]` is the i-th, and row j is the `rank[j]`-th."""
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
            order_range(&rows[0, 0], words, 0, items, items + n, n)
        for i in range(n):
            order[i] = items[i].row
            rank[items[i].row] = <int32_t> i
    free(items)


def find_rows(const uint64_t[:, ::1] table, const uint64_t[:, ::1] wanted, int32_t[::1] found):
    """The place of each wanted row in a sorted table, -1 where it is not there."""
    cdef long long n = table.shape[0], low, high, middle, i
    cdef int words = table.shape[1], w, sign
    with nogil:
        for i in range(wanted.shape[0]):
            low, high = 0, n
            found[i] = -1
            while low < high:
                middle = (low + high) // 2
                sign = 0
                for w in range(words):
                    if table[middle, w] != wanted[i, w]:
                        sign = -1 if table[middle, w] < wanted[i, w] else 1
                        break
                if sign == 0:
                    found[i] = <int32_t> middle
                    break
                if sign < 0:
                    low = middle + 1
                else:
                    high = middle
