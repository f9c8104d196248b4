# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Lines of a text file from columns of numbers."""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy

cdef struct Column:
    const int64_t* whole  # the numbers, or NULL
    const int32_t* codes  # the number of the text of each line
    const char* texts
    const int64_t* starts  # where each text begins in `texts`


def join_lines(columns: list[Int64s | tuple[list[str], Int32s]], count: int) -> str:
    """Lines that consist of the columns, with a space between two of them.

    Args:
        columns: int64[count] each, or texts in ASCII and the number of that of each line.
        count: the number of lines.
    """
    cdef Py_ssize_t i, k, size = 0, lines = count, several = len(columns)
    cdef const int64_t[::1] numbers
    cdef const int32_t[::1] codes
    cdef bytes joined
    cdef list kept = []  # what the pointers point to
    if lines == 0:
        return ""
    cdef Column* known = <Column*>malloc(several * sizeof(Column))
    if known == NULL:
        raise MemoryError()
    cdef uint8_t[::1] out
    cdef char* end
    cdef char* start
    try:
        for k, column in enumerate(columns):
            if isinstance(column, tuple):
                texts = [text.encode("ascii") for text in column[0]]
                joined = b"".join(texts)
                lengths = [len(text) for text in texts]
                numbers, codes = np.cumsum([0, *lengths]), column[1]
                size += int(np.asarray(lengths, np.int64)[column[1]].sum()) + lines
                kept += [joined, numbers, codes]
                known[k] = Column(NULL, &codes[0], joined, &numbers[0])
            else:
                numbers = column
                kept.append(numbers)
                known[k] = Column(&numbers[0], NULL, NULL, NULL)
                size += 21 * lines
        out = np.empty(size, np.uint8)
        start = end = <char*>&out[0]
        with nogil:
            for i in range(lines):
                for k in range(several):
                    end = write_cell(end, known[k], i)
                    end[0] = b"\n" if k == several - 1 else b" "
                    end += 1
        return start[:end - start].decode("ascii")
    finally:
        free(known)


cdef inline char* write_cell(char* end, Column column, Py_ssize_t line) noexcept nogil:
    """Write the number or the text of a line, and return where it ends."""
    cdef int64_t first, length
    cdef uint64_t rest
    cdef char digits[20]
    cdef int size = 0
    if column.whole == NULL:
        first = column.starts[column.codes[line]]
        length = column.starts[column.codes[line] + 1] - first
        memcpy(end, column.texts + first, length)
        return end + length
    rest = <uint64_t>column.whole[line]
    if column.whole[line] < 0:
        rest = 0 - rest
        end[0] = b"-"
        end += 1
    while True:
        digits[size] = <char>(48 + rest % 10)
        size += 1
        rest = rest // 10
        if rest == 0:
            break
    while size > 0:
        size -= 1
        end[0] = digits[size]
        end += 1
    return end
