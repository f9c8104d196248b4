# Representatives of orbits: the least state that permutations of components make of a state.

Piece: TypeAlias = "tuple[int, int, int, int]"
Component: TypeAlias = "tuple[Piece, ...]"

cdef enum:
    MAX_COMPONENTS = 64


def shift_of_ring(width: int, members: Sequence[Component]) -> int:
    """The position of the lowest bit of components of one piece that follow one another in a word,
    upwards or downwards; -1 if they do not.
    """
    if any(len(pieces) > 1 for pieces in members):
        return -1
    words = {word for ((word, *_),) in members}
    shifts = [shift for ((_, shift, *_),) in members]
    steps = {after - before for before, after in zip(shifts, shifts[1:])}
    return min(shifts) if len(words) == 1 and steps in ({width}, {-width}) else -1


cdef inline void sort_keys(uint64_t* keys, int n) noexcept nogil:
    """Sort a few numbers that are nearly sorted."""
    cdef int i, j
    cdef uint64_t key
    for i in range(1, n):
        key = keys[i]
        j = i
        while j > 0 and keys[j - 1] > key:
            keys[j] = keys[j - 1]
            j -= 1
        keys[j] = key


cdef inline uint64_t least_rotation(uint64_t number, int n, int width) noexcept nogil:
    """The least rotation of a number of n digits, with `width` bits each, at most 63 in all."""
    cdef uint64_t least = number, mask = ((<uint64_t> 1) << (n * width)) - 1
    cdef int i
    for i in range(1, n):  # no rotation waits for another
        least = min(least, (number >> (i * width) | number << ((n - i) * width)) & mask)
    return least


cdef inline void rotate_least(uint64_t* keys, int n, int width) noexcept nogil:
    """Rotate keys of `width` bits so that, as digits, they form the least number."""
    cdef uint64_t number = 0
    cdef int i
    for i in range(n):
        number = number << width | keys[i]
    number = least_rotation(number, n, width)
    for i in range(n - 1, -1, -1):
        keys[i] = number & (((<uint64_t> 1) << width) - 1)
        number >>= width


@cython.final
cdef class Orbits:
    """Groups of components, whose permutations (or rotations) map states to equivalent states.

    Args:
        groups: of each group, whether it is a ring, the bits of a component, and the components.
            A component is a tuple of pieces (word, shift, bits, position): where its bits are in a
            packed state, and the position of the lowest of them in the component's key.
        words: uint64 words of a state.
    """

    cdef readonly int words
    cdef int count
    cdef int32_t[::1] rings, widths, starts, pieces_of, ring_shifts
    cdef int32_t[:, ::1] pieces

    def __cinit__(self, groups: Sequence[tuple[bool, int, Sequence[Component]]], int words):
        components = [c for _, _, members in groups for c in members]
        pieces = [p for c in components for p in c]
        self.words = words
        self.count = len(groups)
        self.rings = np.array([is_ring for is_ring, _, _ in groups], np.int32)
        self.widths = np.array([width for _, width, _ in groups], np.int32)
        self.starts = np.cumsum([0, *(len(members) for _, _, members in groups)], dtype=np.int32)
        self.pieces_of = np.cumsum([0, *map(len, components)], dtype=np.int32)
        self.pieces = np.array(pieces, np.int32).reshape(-1, 4)
        # A ring whose components lie side by side is rotated as a whole.
        self.ring_shifts = np.array([shift_of_ring(width, members) if is_ring else -1
                                     for is_ring, width, members in groups], np.int32)

    def represent(self, uint64_t[:, ::1] rows):
        """Replace each packed state (uint64[n, words]) by the representative of its orbit."""
        if rows.shape[0]:
            with nogil:
                self.represent_rows(&rows[0, 0], rows.shape[0])

    cdef void represent_rows(self, uint64_t* rows, Py_ssize_t n) noexcept nogil:
        cdef uint64_t keys[MAX_COMPONENTS]
        cdef int g, first, size, shift
        cdef Py_ssize_t i
        cdef uint64_t* word
        cdef uint64_t mask
        for i in range(n):
            for g in range(self.count):
                first = self.starts[g]
                size = self.starts[g + 1] - first
                shift = self.ring_shifts[g]
                if shift >= 0:
                    word = rows + i * self.words + self.pieces[self.pieces_of[first], 0]
                    mask = ((<uint64_t> 1 << (size * self.widths[g])) - 1) << shift
                    word[0] = (word[0] & ~mask) | least_rotation(
                        (word[0] & mask) >> shift, size, self.widths[g]) << shift
                    continue
                self._read(rows + i * self.words, first, size, keys)
                if self.rings[g]:
                    rotate_least(keys, size, self.widths[g])
                else:
                    sort_keys(keys, size)
                self._write(rows + i * self.words, first, size, keys)

    cdef inline void _read(self, const uint64_t* row, int first, int size,
                           uint64_t* keys) noexcept nogil:
        cdef int c, p
        cdef const int32_t* piece
        for c in range(size):
            keys[c] = 0
            for p in range(self.pieces_of[first + c], self.pieces_of[first + c + 1]):
                piece = &self.pieces[p, 0]
                keys[c] |= ((row[piece[0]] >> piece[1])
                            & (((<uint64_t> 1) << piece[2]) - 1)) << piece[3]

    cdef inline void _write(self, uint64_t* row, int first, int size,
                            const uint64_t* keys) noexcept nogil:
        cdef int c, p
        cdef uint64_t mask
        cdef const int32_t* piece
        for c in range(size):
            for p in range(self.pieces_of[first + c], self.pieces_of[first + c + 1]):
                piece = &self.pieces[p, 0]
                mask = ((<uint64_t> 1) << piece[2]) - 1
                row[piece[0]] = ((row[piece[0]] & ~(mask << piece[1]))
                                 | ((keys[c] >> piece[3]) & mask) << piece[1])
