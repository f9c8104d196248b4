# Diagrams as arrays of nodes, and back.

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
