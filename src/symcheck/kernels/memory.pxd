# cython: language_level=3
"""Growing arrays for kernels that run without the interpreter lock."""

from libc.string cimport memcpy

from symcheck.kernels.file_memory cimport free_block, resize_block
from symcheck.kernels.portable cimport prefer_huge_pages


cdef struct Buffer:
    void* data
    size_t size
    int mapped     # the file that holds the block, plus 1; 0 for memory without a file


cdef inline int reserve(Buffer* buffer, size_t size) noexcept nogil:
    """Make the buffer hold at least `size` bytes.

    Returns 0, or 1 when memory ends; the buffer then stays as it is.
    """
    cdef void* data
    cdef size_t capacity
    cdef int file = buffer.mapped - 1
    if size <= buffer.size:
        return 0
    capacity = buffer.size + buffer.size // 2
    if capacity < size:
        capacity = size
    if capacity < 1024:
        capacity = 1024
    data = resize_block(buffer.data, buffer.size, capacity, &file)
    if data == NULL:
        return 1
    buffer.data = data
    buffer.size = capacity
    buffer.mapped = file + 1
    if file < 0:
        prefer_huge_pages(data, capacity)
    return 0


cdef inline void release(Buffer* buffer) noexcept nogil:
    """Free the memory of a buffer, which is empty afterwards."""
    free_block(buffer.data, buffer.size, buffer.mapped - 1)
    buffer.data = NULL
    buffer.size = 0
    buffer.mapped = 0


cdef inline object array_of(const void* data, Py_ssize_t count, dtype):
    """A new array of `count` numbers, which are copied from memory."""
    import numpy as np
    out = np.empty(count, dtype)
    cdef unsigned char[::1] target = out.view(np.uint8)
    if count:
        memcpy(&target[0], data, target.shape[0])
    return out
