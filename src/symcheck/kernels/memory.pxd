# cython: language_level=3
"""Growing arrays for kernels that run without the interpreter lock."""

from libc.stdint cimport uintptr_t
from libc.stdlib cimport free, realloc
from libc.string cimport memcpy

cdef extern from "sys/mman.h" nogil:
    int madvise(void*, size_t, int)
    int MADV_HUGEPAGE


cdef struct Buffer:
    void* data
    size_t size


cdef inline void prefer_huge_pages(void* data, size_t size) noexcept nogil:
    """Ask for huge pages for a large array that is read at random.

    Huge pages save page-table walks. Systems without `MADV_HUGEPAGE` ignore the request.
    """
    cdef uintptr_t begin = (<uintptr_t> data + 4095) // 4096 * 4096, end = <uintptr_t> data + size
    if size >= 4194304:
        madvise(<void*> begin, (end - begin) // 4096 * 4096, MADV_HUGEPAGE)


cdef inline int reserve(Buffer* buffer, size_t size) noexcept nogil:
    """Make the buffer hold at least `size` bytes.

    Returns 0, or 1 when memory ends; the buffer then stays as it is.
    """
    cdef void* data
    cdef size_t capacity
    if size <= buffer.size:
        return 0
    capacity = buffer.size + buffer.size // 2
    if capacity < size:
        capacity = size
    if capacity < 1024:
        capacity = 1024
    data = realloc(buffer.data, capacity)
    if data == NULL:
        return 1
    buffer.data = data
    buffer.size = capacity
    prefer_huge_pages(data, capacity)
    return 0


cdef inline void release(Buffer* buffer) noexcept nogil:
    """Free the memory of a buffer, which is empty afterwards."""
    free(buffer.data)
    buffer.data = NULL
    buffer.size = 0


cdef inline object array_of(const void* data, Py_ssize_t count, dtype):
    """A new array of `count` numbers, which are copied from memory."""
    import numpy as np
    out = np.empty(count, dtype)
    cdef unsigned char[::1] target = out.view(np.uint8)
    if count:
        memcpy(&target[0], data, target.shape[0])
    return out
