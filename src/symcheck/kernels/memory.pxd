# cython: language_level=3
"""Growing arrays for kernels that run without the interpreter."""

from libc.stdint cimport uintptr_t
from libc.stdlib cimport free, realloc

cdef extern from "sys/mman.h" nogil:
    int madvise(void*, size_t, int)
    int MADV_HUGEPAGE


cdef struct Buffer:
    void* data
    size_t size


cdef inline void prefer_huge_pages(void* data, size_t size) noexcept nogil:
    """Large arrays that are read at random cost fewer page table walks; a kernel that does not know of it ignores this."""
    cdef uintptr_t begin = (<uintptr_t> data + 4095) // 4096 * 4096, end = <uintptr_t> data + size
    if size >= 4194304:
        madvise(<void*> begin, (end - begin) // 4096 * 4096, MADV_HUGEPAGE)


cdef inline int reserve(Buffer* buffer, size_t size) noexcept nogil:
    """Make room for `size` bytes; 0, or 1 if there is no memory (the buffer then stays as it is)."""
    cdef void* data
    cdef size_t wanted
    if size <= buffer.size:
        return 0
    wanted = buffer.size + buffer.size // 2
    if wanted < size:
        wanted = size
    if wanted < 1024:
        wanted = 1024
    data = realloc(buffer.data, wanted)
    if data == NULL:
        return 1
    buffer.data = data
    buffer.size = wanted
    prefer_huge_pages(data, wanted)
    return 0


cdef inline void release(Buffer* buffer) noexcept nogil:
    free(buffer.data)
    buffer.data = NULL
    buffer.size = 0
