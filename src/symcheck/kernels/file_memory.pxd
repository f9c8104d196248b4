# cython: language_level=3
"""Large blocks of memory in files: see file_memory.pyx."""

cdef void* resize_block(void* data, size_t old, size_t size, int* file) noexcept nogil
cdef void free_block(void* data, size_t size, int file) noexcept nogil
