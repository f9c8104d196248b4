# Diagrams of dense tables and of sorted rows; counting, picking and evaluating.

cdef struct DenseTable:
    const double* values
    const unsigned char* bits
    const int* indices
    int width


cdef DdNode* dense_diagram(Env* e, DenseTable* d, long start, int depth) noexcept nogil:
    """The diagram of the entries from `start` on, below the first `depth` variables."""
    cdef Ref t, u
    if depth == d.width:
        if d.values is NULL:
            return e.one if d.bits[start] else e.logic_zero
        return leaf(e, d.values[start])
    if stop_requested(e):
        return NULL
    u = referenced(dense_diagram(e, d, start, depth + 1))
    start += <long>1 << (d.width - depth - 1)
    t = NULL if u is NULL else referenced(dense_diagram(e, d, start, depth + 1))
    return mtbdd_node(e, d.indices[depth], t, u) if d.bits is NULL else bdd_node(e, d.indices[depth], t, u)


cdef int check_order(Env* e, const int[::1] indices) except -1:
    cdef Py_ssize_t i
    for i in range(indices.shape[0]):
        if not 0 <= indices[i] < e.size or (i and e.perm[indices[i]] <= e.perm[indices[i - 1]]):
            raise ValueError("the variables must be distinct and in the manager's order, topmost first")
    return 0


def from_table(Core core not None, const int[::1] indices, const double[::1] values) -> Mtbdd:
    """The Mtbdd of a dense table; `indices`: variables in level order, the first is the most
    significant bit.
    """
    cdef Env* e = core.begin()
    cdef DenseTable d
    check_order(e, indices)
    if values.shape[0] != 1 << indices.shape[0]:
        raise ValueError("a table needs 2**k values for k variables")
    d.values = &values[0]
    d.bits = NULL
    d.width = <int>indices.shape[0]
    d.indices = &indices[0] if d.width else NULL
    return wrap_mtbdd(core, dense_diagram(e, &d, 0, 0))


def from_bits(Core core not None, const int[::1] indices, const unsigned char[::1] bits) -> Bdd:
    """The Bdd of a dense table of truth values (0, or not)."""
    cdef Env* e = core.begin()
    cdef DenseTable d
    check_order(e, indices)
    if bits.shape[0] != 1 << indices.shape[0]:
        raise ValueError("a table needs 2**k values for k variables")
    d.values = NULL
    d.bits = &bits[0]
    d.width = <int>indices.shape[0]
    d.indices = &indices[0] if d.width else NULL
    return wrap_bdd(core, dense_diagram(e, &d, 0, 0))


cdef struct RowTable:
    const unsigned char* bits    # a row is `width` bytes
    const double* values         # NULL: a BDD
    const int* indices
    int width


cdef DdNode* rows_diagram(Env* e, RowTable* r, long start, long end, int depth) noexcept nogil:
    """The diagram of the sorted rows start to end - 1, which agree on the first `depth` variables.
    """
    cdef Ref t, u, empty = e.logic_zero if r.values is NULL else e.zero
    cdef long a = start, b = end, middle
    if start == end:
        return empty
    if depth == r.width:
        return e.one if r.values is NULL else leaf(e, r.values[start])
    if stop_requested(e):
        return NULL
    while a < b:
        middle = (a + b) >> 1
        if r.bits[middle * r.width + depth]:
            b = middle
        else:
            a = middle + 1
    u = referenced(rows_diagram(e, r, start, b, depth + 1))
    t = NULL if u is NULL else referenced(rows_diagram(e, r, b, end, depth + 1))
    return bdd_node(e, r.indices[depth], t, u) if r.values is NULL else mtbdd_node(e, r.indices[depth], t, u)


cdef int check_rows(RowTable* r, long n) except -1:
    cdef long i
    for i in range(n - 1):
        if memcmp(r.bits + i * r.width, r.bits + (i + 1) * r.width, r.width) >= 0:
            raise ValueError(f"rows {i} and {i + 1} are equal or not in ascending order")
    return 0


# overload: (core: Core, indices: Int32s, rows: Masks) -> Bdd
# overload: (core: Core, indices: Int32s, rows: Masks, values: Floats) -> Mtbdd
def from_rows(Core core not None, const int[::1] indices, const unsigned char[:, ::1] rows, values=None):
    """The set of sorted unique rows as a Bdd, or with `values` (float64[n]) the Mtbdd that has them
    there and 0 elsewhere.

    `indices`: variables in level order. `rows`: uint8[n, k] of 0/1.
    """
    cdef Env* e = core.begin()
    cdef RowTable r
    cdef const double[::1] numbers
    cdef long n = rows.shape[0]
    check_order(e, indices)
    memset(&r, 0, sizeof(RowTable))
    r.width = <int>indices.shape[0]
    if rows.shape[1] != r.width:
        raise ValueError("a row needs a bit per variable")
    if n and r.width:
        r.indices, r.bits = &indices[0], &rows[0, 0]
        check_rows(&r, n)
    if values is None:
        return wrap_bdd(core, rows_diagram(e, &r, 0, n, 0))
    numbers = values
    if numbers.shape[0] != n:
        raise ValueError("a value is needed per row")
    if n == 0:
        return wrap_mtbdd(core, e.zero)
    r.values = &numbers[0]
    return wrap_mtbdd(core, rows_diagram(e, &r, 0, n, 0))


cdef inline void add_shifted(uint64_t* out, const uint64_t* x, int words, int shift) noexcept nogil:
    """out += x << shift, numbers of so many words, least significant first."""
    cdef int i, skip = shift >> 6, bits = shift & 63
    cdef uint64_t part, carry = 0, total
    for i in range(skip, words):
        part = x[i - skip] << bits
        if bits and i > skip:
            part |= x[i - skip - 1] >> (64 - bits)
        total = out[i] + part
        carry, out[i] = (total < part) | (total + carry < total), total + carry


def count(Bdd f not None, Cube cube not None) -> int:
    """Exact number of assignments of the cube's variables in the set; ValueError if the set depends
    on others.
    """
    cdef Core core = f.core
    cube_of(core, cube)
    level, low, high, roots = export_sets(core, [f])
    cdef int[::1] levels = level, lows = low, highs = high
    cdef Env* e = core.begin()
    cdef long i, n = len(level), root = roots[0]
    cdef int k = len(cube.indices), words = k // 64 + 1, place
    position = np.full(e.size + 1, -1, dtype=np.int32)
    position[sorted(map(core.level, cube.indices))] = np.arange(k)
    position[e.size] = k
    if (position[level] < 0).any():
        raise ValueError("the set depends on variables that are not among the counted ones")
    cdef int[::1] at = position
    cdef uint64_t* counts = <uint64_t*>calloc(n * words, sizeof(uint64_t))
    if counts is NULL:
        raise MemoryError
    try:
        counts[words] = 1
        for i in range(2, n):
            place = at[levels[i]] + 1
            add_shifted(counts + i * words, counts + lows[i] * words, words, at[levels[lows[i]]] - place)
            add_shifted(counts + i * words, counts + highs[i] * words, words, at[levels[highs[i]]] - place)
        result = 0
        for i in range(words):
            result |= int(counts[root * words + i]) << (64 * i)
        return result << int(at[levels[root]])
    finally:
        free(counts)


def pick(Bdd f not None, const int[::1] indices) -> Masks | None:
    """The lexicographically smallest row of `indices` (in level order) in the set, uint8[k]; None
    if it is empty.

    Variables of the set that are not among `indices` are taken as existentially quantified: they
    must be below all of these.
    """
    cdef Env* e = f.core.begin()
    cdef Ref n = f.node, t, u
    cdef Py_ssize_t i
    check_order(e, indices)
    if n is e.logic_zero:
        return None
    row = np.zeros(indices.shape[0], dtype=np.uint8)
    cdef unsigned char[::1] out = row
    for i in range(indices.shape[0]):
        if level_of(e, n) < e.perm[indices[i]]:
            raise ValueError("the set depends on variables that are not among the given ones")
        bdd_cofactors(e, n, e.perm[indices[i]], &t, &u)
        out[i] = u is e.logic_zero
        n = t if u is e.logic_zero else u
    return row


cdef int evaluate_rows(Env* e, DdNode* f, const unsigned char[:, ::1] rows, double[::1] values, unsigned char[::1] bits) except -1:
    cdef Py_ssize_t i
    cdef DdNode* n
    for i in range(rows.shape[0]):
        n = f
        while regular(n).index != CONSTANT:
            n = signed(regular(n).type.kids.T if rows[i, regular(n).index] else regular(n).type.kids.E, sign(n))
        if bits is None:
            values[i] = n.type.value
        else:
            bits[i] = n is e.one
    return 0
