# Between diagrams and plain arrays: export, import, dense tables, sorted rows, counting, evaluation.

cdef struct Walk:
    # While a diagram is walked, the `next` field of a visited node holds 2 * slot + 1; nothing else of CUDD may run.
    DdNode** nodes
    DdNode** saved
    long slots
    long room
    int* ids                     # BDD: the ids of node and complement by slot; MTBDD: the id by slot
    int* level                   # the exported arrays
    int* low
    int* high
    double* values
    long size
    long leaves
    long leaf_room
    long out_room


cdef bint grow(void** array, long room, size_t width) noexcept nogil:
    cdef void* larger = realloc(array[0], room * width)
    if larger is NULL:
        return False
    array[0] = larger
    return True


cdef long enter(Walk* w, DdNode* n) noexcept nogil:
    """A slot for a node met for the first time; -1: no memory."""
    cdef long room
    if w.slots == w.room:
        room = 2 * w.room + 1024
        if not (grow(<void**>&w.nodes, room, sizeof(void*)) and grow(<void**>&w.saved, room, sizeof(void*))
                and grow(<void**>&w.ids, room, 2 * sizeof(int))):
            return -1
        w.room = room
    w.nodes[w.slots] = n
    w.saved[w.slots] = n.next
    w.ids[2 * w.slots] = -1
    w.ids[2 * w.slots + 1] = -1
    n.next = <DdNode*><uintptr_t>(2 * w.slots + 1)
    w.slots += 1
    return w.slots - 1


cdef long emit(Walk* w, int level, int low, int high) noexcept nogil:
    cdef long room
    if w.size == w.out_room:
        room = 2 * w.out_room + 1024
        if room > 0x7FFFFFFF:
            room = 0x7FFFFFFF
            if w.size == room:
                return -1
        if not (grow(<void**>&w.level, room, sizeof(int)) and grow(<void**>&w.low, room, sizeof(int))
                and grow(<void**>&w.high, room, sizeof(int))):
            return -1
        w.out_room = room
    w.level[w.size] = level
    w.low[w.size] = low
    w.high[w.size] = high
    w.size += 1
    return w.size - 1


cdef void restore(Walk* w) noexcept nogil:
    cdef long i
    for i in range(w.slots):
        w.nodes[i].next = w.saved[i]


cdef void release(Walk* w) noexcept nogil:
    free(w.nodes)
    free(w.saved)
    free(w.ids)
    free(w.level)
    free(w.low)
    free(w.high)
    free(w.values)


cdef long walk_bdd(Env* e, Walk* w, DdNode* f) noexcept nogil:
    cdef DdNode* n = regular(f)
    cdef long slot, low, high
    cdef uintptr_t s = sign(f)
    if n.index == CONSTANT:
        return 1 - s
    if <uintptr_t>n.next & 1:
        slot = <long>(<uintptr_t>n.next >> 1)
        if w.ids[2 * slot + s] >= 0:
            return w.ids[2 * slot + s]
    else:
        slot = enter(w, n)
        if slot < 0:
            return -1
    low = walk_bdd(e, w, signed(n.type.kids.E, s))
    if low < 0:
        return -1
    high = walk_bdd(e, w, signed(n.type.kids.T, s))
    if high < 0:
        return -1
    low = emit(w, e.perm[n.index], low, high)
    if low >= 0:
        w.ids[2 * slot + s] = low
    return low


cdef enum:
    FAILED = -0x7FFFFFFF - 1     # a leaf number k is given as -1 - k, so -1 is taken


cdef long walk_mtbdd(Env* e, Walk* w, DdNode* n) noexcept nogil:
    cdef long slot, low, high, room
    if <uintptr_t>n.next & 1:
        return w.ids[2 * <long>(<uintptr_t>n.next >> 1)]
    slot = enter(w, n)
    if slot < 0:
        return FAILED
    if n.index == CONSTANT:
        if w.leaves == w.leaf_room:
            room = 2 * w.leaf_room + 256
            if room > 0x7FFFFFFF or not grow(<void**>&w.values, room, sizeof(double)):
                return FAILED
            w.leaf_room = room
        w.values[w.leaves] = n.type.value
        w.leaves += 1
        low = -w.leaves
    else:
        low = walk_mtbdd(e, w, n.type.kids.E)
        if low == FAILED:
            return FAILED
        high = walk_mtbdd(e, w, n.type.kids.T)
        if high == FAILED:
            return FAILED
        low = emit(w, e.perm[n.index], low, high)
        if low < 0:
            return FAILED
    w.ids[2 * slot] = low
    return low


cdef bint walk_leaves(Walk* w, DdNode* n) noexcept nogil:
    cdef long room
    if <uintptr_t>n.next & 1:
        return True
    if enter(w, n) < 0:
        return False
    if n.index != CONSTANT:
        return walk_leaves(w, n.type.kids.E) and walk_leaves(w, n.type.kids.T)
    if w.leaves == w.leaf_room:
        room = 2 * w.leaf_room + 256
        if not grow(<void**>&w.values, room, sizeof(double)):
            return False
        w.leaf_room = room
    w.values[w.leaves] = n.type.value
    w.leaves += 1
    return True


cdef object ints_from(int* source, long n, long room):
    """A new int32 array of length `room` whose last n entries are those of `source`."""
    out = np.empty(room, dtype=np.int32)
    cdef int[::1] view = out
    if n:
        memcpy(&view[room - n], source, n * sizeof(int))
    return out


cdef object doubles_from(double* source, long n):
    out = np.empty(n, dtype=np.float64)
    cdef double[::1] view = out
    if n:
        memcpy(&view[0], source, n * sizeof(double))
    return out


cdef object leaf_values(DdNode* n):
    cdef Walk w
    memset(&w, 0, sizeof(Walk))
    try:
        done = walk_leaves(&w, n)
        restore(&w)
        if not done:
            raise MemoryError
        return doubles_from(w.values, w.leaves)
    finally:
        release(&w)


def export_sets(Core core not None, sets):
    """(level, low, high, roots) of Bdds as int32 arrays: children before parents, ids 0 and 1 are false and true."""
    cdef Env* e = core.begin()
    cdef Walk w
    cdef Bdd f
    cdef long root
    cdef list handles = [as_bdd(core, x) for x in sets]
    roots = np.empty(len(handles), dtype=np.int32)
    cdef int[::1] out = roots
    cdef Py_ssize_t i
    memset(&w, 0, sizeof(Walk))
    try:
        root = min(emit(&w, e.size, 0, 0), emit(&w, e.size, 1, 1))
        for i in range(len(handles)):
            f = handles[i]
            if root >= 0:
                root = walk_bdd(e, &w, f.node)
                out[i] = <int>root
        restore(&w)
        if root < 0:
            raise MemoryError("the diagrams are too large to export")
        return ints_from(w.level, w.size, w.size), ints_from(w.low, w.size, w.size), ints_from(w.high, w.size, w.size), roots
    finally:
        release(&w)


def export_nodes(Core core not None, diagrams):
    """(level, low, high, values, roots) of Mtbdds: the leaves first, then inner nodes, children before parents."""
    cdef Env* e = core.begin()
    cdef Walk w
    cdef Mtbdd m
    cdef long root = 0, k, i
    cdef list handles = [as_mtbdd(core, x) for x in diagrams]
    roots = np.empty(len(handles), dtype=np.int32)
    cdef int[::1] out = roots, level, low, high
    memset(&w, 0, sizeof(Walk))
    try:
        for i in range(len(handles)):
            m = handles[i]
            if root != FAILED:
                root = walk_mtbdd(e, &w, m.node)
                out[i] = <int>root
        restore(&w)
        k = w.leaves
        if root == FAILED or k + w.size > 0x7FFFFFFF:
            raise MemoryError("the diagrams are too large to export")
        arrays = (ints_from(w.level, w.size, k + w.size), ints_from(w.low, w.size, k + w.size), ints_from(w.high, w.size, k + w.size))
        level, low, high = arrays
        for i in range(k):
            level[i] = e.size
            low[i] = high[i] = <int>i
        for i in range(k, k + w.size):
            low[i] = low[i] + <int>k if low[i] >= 0 else -1 - low[i]
            high[i] = high[i] + <int>k if high[i] >= 0 else -1 - high[i]
        for i in range(out.shape[0]):
            out[i] = out[i] + <int>k if out[i] >= 0 else -1 - out[i]
        return *arrays, doubles_from(w.values, k), roots
    finally:
        release(&w)


cdef int check_table(Env* e, const int[::1] level, const int[::1] low, const int[::1] high, long leaves) except -1:
    cdef long i, n = level.shape[0]
    cdef int l
    if low.shape[0] != n or high.shape[0] != n or leaves > n:
        raise ValueError("the arrays of the table differ in length")
    for i in range(leaves, n):
        l = level[i]
        if not (0 <= l < e.size and 0 <= low[i] < i and 0 <= high[i] < i):
            raise ValueError(f"node {i} is out of order or refers to what is not there")
        if (low[i] >= leaves and level[low[i]] <= l) or (high[i] >= leaves and level[high[i]] <= l):
            raise ValueError(f"node {i} has a child that is not below it")
    return 0


cdef list build(Core core, bint boolean, const int[::1] level, const int[::1] low, const int[::1] high, const double[::1] values,
                const int[::1] roots):
    """Diagrams from a checked table, bottom-up."""
    cdef Env* e = core.begin()
    cdef long i, n = level.shape[0], done = 0, leaves = 2 if boolean else values.shape[0]
    cdef Ref r, t, u
    cdef DdNode** made
    check_table(e, level, low, high, leaves)
    for i in range(roots.shape[0]):
        if not 0 <= roots[i] < n:
            raise ValueError("a root is not in the table")
    made = <DdNode**>malloc((n + 1) * sizeof(DdNode*))
    if made is NULL:
        raise MemoryError
    try:
        for i in range(n):
            if i < leaves:
                r = (e.one if i else e.no) if boolean else number(e, values[i])
            elif tick(e):
                r = NULL
            else:
                t = made[high[i]]
                u = made[low[i]]
                take(t)
                take(u)
                i_index = Cudd_ReadInvPerm(e.dd, level[i])
                r = bdd_node(e, i_index, t, u) if boolean else node(e, i_index, t, u)
            if r is NULL:
                core.fail()
            take(r)
            made[i] = r
            done += 1
        if boolean:
            return [wrap_bdd(core, made[roots[i]]) for i in range(roots.shape[0])]
        return [wrap_mtbdd(core, made[roots[i]]) for i in range(roots.shape[0])]
    finally:
        for i in range(done):
            Cudd_RecursiveDeref(e.dd, made[i])
        free(made)


def import_sets(Core core not None, const int[::1] level, const int[::1] low, const int[::1] high, const int[::1] roots):
    """The inverse of `export_sets`: a list of Bdds."""
    return build(core, True, level, low, high, None, roots)


def import_nodes(Core core not None, const int[::1] level, const int[::1] low, const int[::1] high, const double[::1] values,
                 const int[::1] roots):
    """The inverse of `export_nodes`: a list of Mtbdds."""
    return build(core, False, level, low, high, values, roots)


cdef struct Dense:
    const double* values
    const unsigned char* bits
    const int* indices
    int width


cdef DdNode* dense(Env* e, Dense* d, long start, int depth) noexcept nogil:
    """The diagram of the table from entry `start` on, below the first `depth` variables."""
    cdef Ref t, u
    if depth == d.width:
        if d.values is NULL:
            return e.one if d.bits[start] else e.no
        return number(e, d.values[start])
    if tick(e):
        return NULL
    u = dense(e, d, start, depth + 1)
    if u is NULL:
        return NULL
    take(u)
    t = dense(e, d, start + (<long>1 << (d.width - depth - 1)), depth + 1)
    if t is NULL:
        Cudd_RecursiveDeref(e.dd, u)
        return NULL
    take(t)
    return node(e, d.indices[depth], t, u) if d.bits is NULL else bdd_node(e, d.indices[depth], t, u)


cdef int check_order(Env* e, const int[::1] indices) except -1:
    cdef Py_ssize_t i
    for i in range(indices.shape[0]):
        if not 0 <= indices[i] < e.size or (i and e.perm[indices[i]] <= e.perm[indices[i - 1]]):
            raise ValueError("the variables must be different and in the manager's order, topmost first")
    return 0


def from_table(Core core not None, const int[::1] indices, const double[::1] values):
    """The Mtbdd of a dense table; `indices`: variables in level order, the first is the most significant bit."""
    cdef Env* e = core.begin()
    cdef Dense d
    check_order(e, indices)
    if values.shape[0] != 1 << indices.shape[0]:
        raise ValueError("a table needs 2**k values for k variables")
    d.values = &values[0]
    d.bits = NULL
    d.width = <int>indices.shape[0]
    d.indices = &indices[0] if d.width else NULL
    return wrap_mtbdd(core, dense(e, &d, 0, 0))


def from_bits(Core core not None, const int[::1] indices, const unsigned char[::1] bits):
    """The Bdd of a dense table of truth values (0, or not)."""
    cdef Env* e = core.begin()
    cdef Dense d
    check_order(e, indices)
    if bits.shape[0] != 1 << indices.shape[0]:
        raise ValueError("a table needs 2**k values for k variables")
    d.values = NULL
    d.bits = &bits[0]
    d.width = <int>indices.shape[0]
    d.indices = &indices[0] if d.width else NULL
    return wrap_bdd(core, dense(e, &d, 0, 0))


cdef struct Rows:
    const uint64_t* words        # either: a row is a word, the first variable its most significant bit
    const unsigned char* bits    # or: a row is `width` bytes
    const double* values         # NULL: a BDD
    const int* indices
    int width


cdef inline bint bit_of(Rows* r, long row, int depth) noexcept nogil:
    if r.words is not NULL:
        return (r.words[row] >> (r.width - 1 - depth)) & 1
    return r.bits[row * r.width + depth] != 0


cdef DdNode* rows_diagram(Env* e, Rows* r, long start, long end, int depth) noexcept nogil:
    """The diagram of the sorted rows start … end - 1, below the first `depth` variables, on which they agree."""
    cdef Ref t, u, nothing = e.no if r.values is NULL else e.zero
    cdef long a = start, b = end, middle
    if start == end:
        return nothing
    if depth == r.width:
        return e.one if r.values is NULL else number(e, r.values[start])
    if tick(e):
        return NULL
    if bit_of(r, start, depth):
        b = start
    elif not bit_of(r, end - 1, depth):
        b = end
    else:
        while a < b:
            middle = (a + b) >> 1
            if bit_of(r, middle, depth):
                b = middle
            else:
                a = middle + 1
    u = rows_diagram(e, r, start, b, depth + 1)
    if u is NULL:
        return NULL
    take(u)
    t = rows_diagram(e, r, b, end, depth + 1)
    if t is NULL:
        Cudd_RecursiveDeref(e.dd, u)
        return NULL
    take(t)
    return bdd_node(e, r.indices[depth], t, u) if r.values is NULL else node(e, r.indices[depth], t, u)


cdef int check_rows(Rows* r, long n) except -1:
    cdef long i
    cdef int order
    for i in range(n - 1):
        if r.words is not NULL:
            order = -1 if r.words[i] < r.words[i + 1] else 1
        else:
            order = memcmp(r.bits + i * r.width, r.bits + (i + 1) * r.width, r.width)
        if order >= 0:
            raise ValueError(f"rows {i} and {i + 1} are not in ascending order, or the same")
    if r.words is not NULL and n and r.width < 64 and r.words[n - 1] >> r.width:
        raise ValueError("a row has more bits than there are variables")
    return 0


def from_rows(Core core not None, const int[::1] indices, rows, values=None):
    """The set of sorted unique rows as a Bdd, or with `values` (float64[n]) the Mtbdd that has them there and 0 elsewhere.

    `indices`: variables in level order. `rows`: uint64[n], the first variable the most significant bit, or uint8[n, k] of 0/1.
    """
    cdef Env* e = core.begin()
    cdef Rows r
    cdef const uint64_t[::1] words
    cdef const unsigned char[:, ::1] bits
    cdef const double[::1] numbers
    cdef long n = len(rows)
    check_order(e, indices)
    memset(&r, 0, sizeof(Rows))
    r.width = <int>indices.shape[0]
    r.indices = &indices[0] if r.width else NULL
    if rows.ndim == 1:
        if r.width > 64:
            raise ValueError("rows of more than 64 variables are uint8[n, k]")
        words = rows
        r.words = &words[0] if n else NULL
    else:
        if rows.shape[1] != r.width:
            raise ValueError("a row needs a bit per variable")
        bits = rows
        r.bits = &bits[0, 0] if n and r.width else NULL
    if n and r.width:
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


def count(Bdd f not None, Cube cube not None):
    """Exact number of assignments of the cube's variables in the set, which must depend on no other."""
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
        raise ValueError("the set depends on variables that are not counted")
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


def pick(Bdd f not None, const int[::1] indices):
    """The lexicographically smallest row of `indices` (in level order) in the set, uint8[k]; None if it is empty.

    Variables of the set that are not among `indices` are taken as existentially quantified: they must be below all of these.
    """
    cdef Env* e = f.core.begin()
    cdef Ref n = f.node, t, u
    cdef Py_ssize_t i
    check_order(e, indices)
    if n is e.no:
        return None
    row = np.zeros(indices.shape[0], dtype=np.uint8)
    cdef unsigned char[::1] out = row
    for i in range(indices.shape[0]):
        if level_of(e, n) < e.perm[indices[i]]:
            raise ValueError("the set depends on variables that are not asked for")
        split_bdd(e, n, e.perm[indices[i]], &t, &u)
        out[i] = u is e.no
        n = t if u is e.no else u
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
