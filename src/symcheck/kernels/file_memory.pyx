# cython: language_level=3
"""Large blocks of memory in files.

A block is a file without a name in a folder that the caller chooses, mapped into memory. The system
writes its pages to the disk when memory ends, and the disk space is reserved when the block is
made. Arrays of numpy get their memory in this way too (NEP 49).
"""

from libc.stdlib cimport calloc, free, malloc, realloc
from libc.string cimport memcpy, strcpy

from symcheck.kernels.portable cimport (close_file, map_file, open_unnamed_file, resize_mapped_file,
                                        unmap_file)
from symcheck.kernels.tuning cimport MAPPED_BLOCK_BYTES

cdef extern from "numpy/arrayobject.h":
    ctypedef struct PyDataMemAllocator:
        void* ctx
        void* (*malloc)(void* ctx, size_t size) noexcept
        void* (*calloc)(void* ctx, size_t count, size_t size) noexcept
        void* (*realloc)(void* ctx, void* data, size_t size) noexcept
        void (*free)(void* ctx, void* data, size_t size) noexcept
    ctypedef struct PyDataMem_Handler:
        char name[127]
        unsigned char version
        PyDataMemAllocator allocator
    object PyDataMem_SetHandler(object handler)
    int _import_array() except -1

cdef extern from "Python.h":
    object PyCapsule_New(void* pointer, const char* name, void* destructor)

_import_array()


cdef struct Block:
    void* data
    size_t size
    int file

cdef char* folder = NULL             # of the files; NULL: blocks are not in files
cdef Block* blocks = NULL            # those of numpy, which are few
cdef Py_ssize_t block_count = 0
cdef PyDataMem_Handler handler


cdef void* resize_block(void* data, size_t old, size_t size, int* file) noexcept nogil:
    """A block of `size` bytes with the content of one of `old` bytes, which is freed; NULL when
    memory or the disk ends, and the old block then stays.

    Args:
        file: of the block, or -1; that of the new block afterwards.
    """
    cdef void* larger
    cdef int opened
    if file[0] >= 0:
        return resize_mapped_file(data, old, size, file[0])
    if folder == NULL or size < MAPPED_BLOCK_BYTES:
        return realloc(data, size)
    opened = open_unnamed_file(folder)
    if opened < 0:
        return NULL
    larger = map_file(opened, size)
    if larger == NULL:
        close_file(opened)
        return NULL
    if data != NULL:
        memcpy(larger, data, min(old, size))
        free(data)
    file[0] = opened
    return larger


cdef void free_block(void* data, size_t size, int file) noexcept nogil:
    """Free a block, and its file."""
    if file >= 0:
        unmap_file(data, size, file)
    else:
        free(data)


# ------------------------------------------------------------------------------------ numpy
# numpy calls these functions with the interpreter lock.


cdef Py_ssize_t index_of(void* data) noexcept:
    """The index of a block in `blocks`, or -1."""
    cdef Py_ssize_t i
    for i in range(block_count):
        if blocks[i].data == data:
            return i
    return -1


cdef void* allocate(void* context, size_t size) noexcept:
    global blocks, block_count
    cdef Block block = Block(NULL, size, -1)
    cdef Block* more
    block.data = resize_block(NULL, 0, size, &block.file)
    if block.file < 0:
        return block.data
    more = <Block*> realloc(blocks, (block_count + 1) * sizeof(Block))
    if more == NULL:
        free_block(block.data, size, block.file)
        return NULL
    blocks = more
    blocks[block_count] = block
    block_count += 1
    return block.data


cdef void* allocate_zeros(void* context, size_t count, size_t size) noexcept:
    if count * size < MAPPED_BLOCK_BYTES or folder == NULL:
        return calloc(count, size)
    return allocate(context, count * size)  # a new file holds zeros


cdef void* resize(void* context, void* data, size_t size) noexcept:
    cdef Py_ssize_t i = index_of(data)
    cdef void* larger
    if i < 0:
        return realloc(data, size)
    larger = resize_mapped_file(data, blocks[i].size, size, blocks[i].file)
    if larger != NULL:
        blocks[i].data, blocks[i].size = larger, size
    return larger


cdef void release(void* context, void* data, size_t size) noexcept:
    global block_count
    cdef Py_ssize_t i = index_of(data)
    if i < 0:
        free(data)
        return
    unmap_file(data, blocks[i].size, blocks[i].file)
    block_count -= 1
    blocks[i] = blocks[block_count]


strcpy(handler.name, b"symcheck files")
handler.version = 1
handler.allocator = PyDataMemAllocator(NULL, allocate, allocate_zeros, resize, release)
cdef object capsule = PyCapsule_New(&handler, "mem_handler", NULL)


def use_folder(path: bytes | None) -> bytes | None:
    """Make later blocks files in a folder (None: no files), and return the folder so far.

    Raises OSError if no file can be opened there.
    """
    global folder
    cdef char* copy = NULL
    cdef int file
    before = None if folder == NULL else <bytes> folder
    if path is not None:
        copy = <char*> malloc(len(path) + 1)
        if copy == NULL:
            raise MemoryError
        strcpy(copy, path)
        file = open_unnamed_file(copy)
        if file < 0:
            free(copy)
            raise OSError
        close_file(file)
    free(folder)
    folder = copy
    return before


def use_for_arrays(other: object = None) -> object:
    """Let numpy take the memory of new arrays from here, or from another handler.

    It holds for the current context (`contextvars`). Returns the handler so far.
    """
    return PyDataMem_SetHandler(capsule if other is None else other)


def mapped_bytes() -> int:
    """The memory of arrays in files, in bytes."""
    cdef Py_ssize_t i
    cdef size_t total = 0
    for i in range(block_count):
        total += blocks[i].size
    return total
