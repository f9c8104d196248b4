# Diagrams as arrays of nodes, and back.

cdef struct Traversal:
    # During a traversal the `next` field of a visited node holds 2 * slot + 1. No CUDD function may
    # run meanwhile.
    DdNode** nodes
    DdNode** saved
    long slots
    long capacity
    int* ids                     # per slot, BDD: ids of the node and its complement; MTBDD: its id
    int* level                   # the exported arrays
    int* low
    int* high
    double* values
    long size
    long leaves
    long leaf_capacity
    long out_capacity


cdef bint grow_array(void** array, long capacity, size_t width) noexcept nogil:
    cdef void* larger = realloc(array[0], capacity * width)
    if larger is NULL:
        return False
    array[0] = larger
    return True


cdef long visit_node(Traversal* w, DdNode* n) noexcept nogil:
    """A slot for a node that is visited for the first time; -1: no memory."""
    cdef long capacity
    if w.slots == w.capacity:
        capacity = 2 * w.capacity + 1024
        if not (grow_array(<void**>&w.nodes, capacity, sizeof(void*)) and grow_array(<void**>&w.saved, capacity, sizeof(void*))
                and grow_array(<void**>&w.ids, capacity, 2 * sizeof(int))):
            return -1
        w.capacity = capacity
    w.nodes[w.slots] = n
    w.saved[w.slots] = n.next
    w.ids[2 * w.slots] = -1
    w.ids[2 * w.slots + 1] = -1
    n.next = <DdNode*><uintptr_t>(2 * w.slots + 1)
    w.slots += 1
    return w.slots - 1


cdef long emit_node(Traversal* w, int level, int low, int high) noexcept nogil:
    cdef long capacity
    if w.size == w.out_capacity:
        capacity = 2 * w.out_capacity + 1024
        if capacity > 0x7FFFFFFF:
            capacity = 0x7FFFFFFF
            if w.size == capacity:
                return -1
        if not (grow_array(<void**>&w.level, capacity, sizeof(int)) and grow_array(<void**>&w.low, capacity, sizeof(int))
                and grow_array(<void**>&w.high, capacity, sizeof(int))):
            return -1
        w.out_capacity = capacity
    w.level[w.size] = level
    w.low[w.size] = low
    w.high[w.size] = high
    w.size += 1
    return w.size - 1


cdef bint add_leaf(Traversal* w, double value) noexcept nogil:
    cdef long capacity
    if w.leaves == w.leaf_capacity:
        capacity = 2 * w.leaf_capacity + 256
        if capacity > 0x7FFFFFFF or not grow_array(<void**>&w.values, capacity, sizeof(double)):
            return False
        w.leaf_capacity = capacity
    w.values[w.leaves] = value
    w.leaves += 1
    return True


cdef void restore_nodes(Traversal* w) noexcept nogil:
    cdef long i
    for i in range(w.slots):
        w.nodes[i].next = w.saved[i]


cdef void free_traversal(Traversal* w) noexcept nogil:
    free(w.nodes)
    free(w.saved)
    free(w.ids)
    free(w.level)
    free(w.low)
    free(w.high)
    free(w.values)


cdef long export_bdd_node(Env* e, Traversal* w, DdNode* f) noexcept nogil:
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
        slot = visit_node(w, n)
        if slot < 0:
            return -1
    low = export_bdd_node(e, w, signed(n.type.kids.E, s))
    if low < 0:
        return -1
    high = export_bdd_node(e, w, signed(n.type.kids.T, s))
    if high < 0:
        return -1
    low = emit_node(w, e.perm[n.index], low, high)
    if low >= 0:
        w.ids[2 * slot + s] = low
    return low


cdef enum:
    FAILED = -0x7FFFFFFF - 1     # leaf number k is returned as -1 - k


cdef long export_mtbdd_node(Env* e, Traversal* w, DdNode* n) noexcept nogil:
    cdef long slot, low, high
    if <uintptr_t>n.next & 1:
        return w.ids[2 * <long>(<uintptr_t>n.next >> 1)]
    slot = visit_node(w, n)
    if slot < 0:
        return FAILED
    if n.index == CONSTANT:
        if not add_leaf(w, n.type.value):
            return FAILED
        low = -w.leaves
    else:
        low = export_mtbdd_node(e, w, n.type.kids.E)
        if low == FAILED:
            return FAILED
        high = export_mtbdd_node(e, w, n.type.kids.T)
        if high == FAILED:
            return FAILED
        low = emit_node(w, e.perm[n.index], low, high)
        if low < 0:
            return FAILED
    w.ids[2 * slot] = low
    return low


cdef bint visit_leaves(Traversal* w, DdNode* n) noexcept nogil:
    if <uintptr_t>n.next & 1:
        return True
    if visit_node(w, n) < 0:
        return False
    if n.index != CONSTANT:
        return visit_leaves(w, n.type.kids.E) and visit_leaves(w, n.type.kids.T)
    return add_leaf(w, n.type.value)


cdef object ints_from(int* source, long n, long capacity):
    """A new int32 array of length `capacity` whose last n entries are those of `source`."""
    out = np.empty(capacity, dtype=np.int32)
    cdef int[::1] view = out
    if n:
        memcpy(&view[capacity - n], source, n * sizeof(int))
    return out


cdef object doubles_from(double* source, long n):
    out = np.empty(n, dtype=np.float64)
    cdef double[::1] view = out
    if n:
        memcpy(&view[0], source, n * sizeof(double))
    return out


cdef object leaf_values(DdNode* n):
    cdef Traversal w
    memset(&w, 0, sizeof(Traversal))
    try:
        done = visit_leaves(&w, n)
        restore_nodes(&w)
        if not done:
            raise MemoryError
        return doubles_from(w.values, w.leaves)
    finally:
        free_traversal(&w)


def export_sets(Core core not None, sets: Iterable[Bdd]) -> tuple[Int32s, Int32s, Int32s, Int32s]:
    """(level, low, high, roots) of Bdds as int32 arrays: children before parents, ids 0 and 1 are
    false and true.
    """
    cdef Env* e = core.begin()
    cdef Traversal w
    cdef Bdd f
    cdef long root
    cdef list handles = [as_bdd(core, x) for x in sets]
    roots = np.empty(len(handles), dtype=np.int32)
    cdef int[::1] out = roots
    cdef Py_ssize_t i
    memset(&w, 0, sizeof(Traversal))
    try:
        root = min(emit_node(&w, e.size, 0, 0), emit_node(&w, e.size, 1, 1))
        for i in range(len(handles)):
            f = handles[i]
            if root >= 0:
                root = export_bdd_node(e, &w, f.node)
                out[i] = <int>root
        restore_nodes(&w)
        if root < 0:
            raise MemoryError("the diagrams are too large to export")
        return ints_from(w.level, w.size, w.size), ints_from(w.low, w.size, w.size), ints_from(w.high, w.size, w.size), roots
    finally:
        free_traversal(&w)


def export_nodes(Core core not None,
                 diagrams: Iterable[Mtbdd]) -> tuple[Int32s, Int32s, Int32s, Floats, Int32s]:
    """(level, low, high, values, roots) of Mtbdds: the leaves first, then inner nodes, children
    before parents.
    """
    cdef Env* e = core.begin()
    cdef Traversal w
    cdef Mtbdd m
    cdef long root = 0, k, i
    cdef list handles = [as_mtbdd(core, x) for x in diagrams]
    roots = np.empty(len(handles), dtype=np.int32)
    cdef int[::1] out = roots, level, low, high
    memset(&w, 0, sizeof(Traversal))
    try:
        for i in range(len(handles)):
            m = handles[i]
            if root != FAILED:
                root = export_mtbdd_node(e, &w, m.node)
                out[i] = <int>root
        restore_nodes(&w)
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
        free_traversal(&w)


cdef int check_table(Env* e, const int[::1] level, const int[::1] low, const int[::1] high, long leaves) except -1:
    cdef long i, n = level.shape[0]
    cdef int l
    if low.shape[0] != n or high.shape[0] != n or leaves > n:
        raise ValueError("the arrays of the table differ in length")
    for i in range(leaves, n):
        l = level[i]
        if not (0 <= l < e.size and 0 <= low[i] < i and 0 <= high[i] < i):
            raise ValueError(f"node {i} has a level or child that does not exist")
        if (low[i] >= leaves and level[low[i]] <= l) or (high[i] >= leaves and level[high[i]] <= l):
            raise ValueError(f"node {i} has a child that is not below it")
    return 0


cdef list import_diagrams(Core core, bint boolean, const int[::1] level, const int[::1] low, const int[::1] high, const double[::1] values,
                const int[::1] roots):
    """The diagrams of a table of nodes, built bottom-up. Raises ValueError for a malformed table.
    """
    cdef Env* e = core.begin()
    cdef long i, n = level.shape[0], done = 0, leaves = 2 if boolean else values.shape[0]
    cdef Ref r, t, u
    cdef DdNode** nodes
    cdef int index
    check_table(e, level, low, high, leaves)
    for i in range(roots.shape[0]):
        if not 0 <= roots[i] < n:
            raise ValueError("a root is not in the table")
    nodes = <DdNode**>malloc((n + 1) * sizeof(DdNode*))
    if nodes is NULL:
        raise MemoryError
    try:
        for i in range(n):
            if i < leaves:
                r = (e.one if i else e.logic_zero) if boolean else leaf(e, values[i])
            elif stop_requested(e):
                r = NULL
            else:
                t = nodes[high[i]]
                u = nodes[low[i]]
                reference(t)
                reference(u)
                index = Cudd_ReadInvPerm(e.dd, level[i])
                r = bdd_node(e, index, t, u) if boolean else mtbdd_node(e, index, t, u)
            if r is NULL:
                core.fail()
            reference(r)
            nodes[i] = r
            done += 1
        if boolean:
            return [wrap_bdd(core, nodes[roots[i]]) for i in range(roots.shape[0])]
        return [wrap_mtbdd(core, nodes[roots[i]]) for i in range(roots.shape[0])]
    finally:
        for i in range(done):
            Cudd_RecursiveDeref(e.dd, nodes[i])
        free(nodes)


def import_sets(Core core not None, const int[::1] level, const int[::1] low, const int[::1] high,
                const int[::1] roots) -> list[Bdd]:
    """The inverse of `export_sets`: a list of Bdds."""
    return import_diagrams(core, True, level, low, high, None, roots)


def import_nodes(Core core not None, const int[::1] level, const int[::1] low, const int[::1] high,
                 const double[::1] values, const int[::1] roots) -> list[Mtbdd]:
    """The inverse of `export_nodes`: a list of Mtbdds."""
    return import_diagrams(core, False, level, low, high, values, roots)
