# cython: language_level=3
"""Growing arrays for kernels that run without the interpreter."""

from libc.stdlib cimport free, realloc


cdef struct Buffer:
    void* data
    size_t size


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
    return 0


cdef inline void release(Buffer* buffer) noexcept nogil:
    free(buffer.data)
    buffer.data = NULL
    buffer.size = 0
