# One CUDD manager: its limits, its errors and its statistics.

cdef extern from "Python.h":
    int PyErr_CheckSignals() noexcept nogil

cdef enum:
    CONSTANT = 0x7FFFFFFF            # index and level of a terminal node
    # Steps of our recursions between checks of the clock and of signals (a mask): about 0.1 s.
    STEPS_PER_CHECK = 0x3FFFF
    # Calls of handles between checks of the clock (a mask): each may be long.
    CALLS_PER_CHECK = 0x3FF
    # Nodes up to which dead nodes are not collected. They are often used again, and so are the
    # cached results about them: on timed models, half of the work was to find these again.
    UNCOLLECTED_NODES = 8_000_000
    # Steps of a saturation between checks of its own limits (a mask): a check reads two counters.
    STEPS_PER_LIMIT_CHECK = 0x3F

cdef enum Reason:
    NONE = 0
    SIGNAL = 1
    TIME = 2
    UNDEFINED = 3
    NO_MEMORY = 4

cdef struct Env:
    DdManager* dd
    int* perm                    # level of each variable index
    int size
    bint order_changed           # perm must be read again
    unsigned long order_version  # number of times that perm was read
    DdNode* one                  # BDD true and MTBDD leaf 1
    DdNode* logic_zero           # BDD false
    DdNode* zero                 # MTBDD leaf 0
    bint uninterruptible         # CUDD must not be stopped now
    Reason reason
    unsigned long steps
    unsigned long calls
    unsigned int uncollected_nodes  # nodes up to which dead ones are not collected
    bint collecting
    double deadline              # of the time limit, on the monotonic clock; 0: none
    double max_lookups           # count of look-ups in CUDD's cache at which to stop; 0: no limit


cdef void switch_collection(Env* e) noexcept nogil:
    """Switch garbage collection on above the threshold, off below half of it."""
    cdef unsigned int nodes = Cudd_ReadKeys(e.dd)
    if not e.collecting and nodes > e.uncollected_nodes:
        Cudd_EnableGarbageCollection(e.dd)
        e.collecting = True
    elif e.collecting and nodes < e.uncollected_nodes // 2:
        Cudd_DisableGarbageCollection(e.dd)
        e.collecting = False


cdef bint past_limit(Env* e) noexcept nogil:
    """Whether the limit of time or of look-ups is reached."""
    return (e.deadline > 0 and monotonic_seconds() > e.deadline) or (
        e.max_lookups > 0 and Cudd_ReadCacheLookUps(e.dd) > e.max_lookups
    )


cdef bint should_stop(Env* e) noexcept nogil:
    """Whether a signal arrived or the time limit is reached.

    CUDD is always called with the interpreter lock held, so signals may be checked here. A Python
    signal handler therefore runs in the middle of an operation: it may raise, but must not use
    diagrams.
    """
    switch_collection(e)
    if e.uninterruptible:
        return False
    if PyErr_CheckSignals() != 0:
        e.reason = SIGNAL
        return True
    if past_limit(e):
        e.reason = TIME
        return True
    return False


cdef int _on_check(const void* env) noexcept nogil:
    return should_stop(<Env*>env)


cdef int _on_collection(DdManager* dd, const char* kind, void* data) noexcept nogil:
    # CUDD collects garbage before every reordering, also before one that a user starts through dd.
    cdef Env* e = <Env*>Cudd_ReadApplicationHook(dd)
    if e is not NULL:
        e.order_changed = True
    return 1


cdef int _raise_pending() except -1:
    return -1


cdef DdManager* _find_manager(object bdd) except NULL:
    """The `DdManager*` that a dd.cudd.BDD object and its `true` Function both hold, validated."""
    true = bdd.true
    cdef uintptr_t* a = <uintptr_t*><void*>bdd
    cdef uintptr_t* b = <uintptr_t*><void*>true
    cdef uintptr_t node = int(true) - 2, candidate = 0, word
    cdef Py_ssize_t i, j, n = type(bdd).__basicsize__ // sizeof(void*), m = type(true).__basicsize__ // sizeof(void*)
    python = {id(bdd), id(true), id(bdd.vars), id(bdd._index_of_var), id(bdd._var_with_index), id(None)}
    cdef bint owner = False, holder = False
    for i in range(2, m):
        owner |= b[i] == <uintptr_t><void*>bdd
        holder |= b[i] == node
    for i in range(2, n):
        word = a[i]
        if word < 4096 or word % sizeof(void*) or word in python:
            continue
        for j in range(2, m):
            if b[j] == word and word != candidate:
                if candidate:
                    raise UnsupportedError(_layout_message("two words could be the manager"))
                candidate = word
    if not (owner and holder and candidate):
        raise UnsupportedError(_layout_message("the manager was not found"))
    if Cudd_ReadOne(<DdManager*>candidate) is not <DdNode*>node or Cudd_ReadSize(<DdManager*>candidate) < len(bdd.vars):
        raise UnsupportedError(_layout_message("the word found is not the manager"))
    return <DdManager*>candidate


cdef str _layout_message(what):
    return f"CUDD's objects are not laid out as in dd {REQUIRED_VERSION} ({what})\n  hint: pip install dd=={REQUIRED_VERSION}"


cdef int load_cudd() except -1:
    """Find CUDD's functions and compare its layout of a node with ours, once."""
    global loaded
    if loaded:
        return 0
    _resolve_all()
    cdef DdManager* dd = Cudd_Init(1, 0, 256, 64, 1 << 20)
    if dd is NULL:
        raise MemoryError
    try:
        _validate_layout(dd)
    finally:
        Cudd_Quit(dd)
    loaded = True
    return 0


cdef int _validate_layout(DdManager* dd) except -1:
    """Compare our declaration of a node with CUDD's functions."""
    cdef DdNode* one = Cudd_ReadOne(dd)
    cdef DdNode* zero = Cudd_ReadZero(dd)
    cdef DdNode* half = cuddUniqueConst(dd, 0.5)
    cdef DdNode* x = Cudd_bddIthVar(dd, 0)
    if Cudd_ReadLogicZero(dd) is not negate(one) or Cudd_ReadErrorCode(dd) != 0:
        raise UnsupportedError(_layout_message("the constants differ"))
    if half is NULL or x is NULL or <uintptr_t>half % sizeof(DdNode) or <uintptr_t>x % sizeof(DdNode):
        raise UnsupportedError(_layout_message("nodes are aligned differently"))
    if Cudd_T(x) is not x.type.kids.T or Cudd_E(x) is not x.type.kids.E or Cudd_T(x) is not one or Cudd_E(x) is not negate(one):
        raise UnsupportedError(_layout_message("the children of a node are at another offset"))
    if x.index != 0 or x.ref < 1 or half.ref != 0 or one.index != CONSTANT or zero.index != CONSTANT:
        raise UnsupportedError(_layout_message("the index of a node is at another offset"))
    if Cudd_V(half) != 0.5 or half.type.value != 0.5 or one.type.value != 1.0 or zero.type.value != 0.0:
        raise UnsupportedError(_layout_message("the value of a node is at another offset"))
    half.ref += 1
    Cudd_RecursiveDeref(dd, half)
    return 0


@cython.final
@cython.no_gc
cdef class Core:
    """One CUDD manager, kept alive by every handle of a node in it.

    Handles and cores are exempt from cyclic garbage collection. The collector clears the objects of
    a dead cycle in any order, and a handle without its manager could not dereference its node.
    Handles refer to the core only, so they are never part of a cycle.
    """

    cdef Env e
    cdef readonly object bdd
    cdef readonly object max_memory  # type: int | None
    cdef object names  # of the variables, by index, where there is no dd.cudd.BDD
    cdef unsigned long renamings

    def __cinit__(self, bdd, max_memory: int | None = None, int cache_entries = 64,
                  int memory_estimate = 1 << 20):
        load_cudd()
        cdef DdManager* dd
        if bdd is None:
            dd = Cudd_Init(0, 0, 256, cache_entries, memory_estimate)
            if dd is NULL:
                raise MemoryError
        else:
            bdd.configure(reordering=False)
            dd = _find_manager(bdd)
        self.bdd = bdd
        self.names = []
        self.e.dd = dd
        self.e.one = Cudd_ReadOne(dd)
        self.e.logic_zero = negate(self.e.one)
        self.e.zero = Cudd_ReadZero(dd)
        self.e.order_changed = True
        self.e.collecting = True
        Cudd_AutodynDisable(dd)
        # CUDD's default of 1e-12 merges leaves that differ by less; this value keeps all numbers
        # distinct.
        Cudd_SetEpsilon(dd, 5e-324)
        Cudd_RegisterOutOfMemoryCallback(dd, Cudd_OutOfMemSilent)
        Cudd_RegisterTerminationCallback(dd, _on_check, &self.e)
        Cudd_SetApplicationHook(dd, &self.e)
        if not Cudd_AddHook(dd, _on_collection, 0):
            raise MemoryError
        self.e.uncollected_nodes = UNCOLLECTED_NODES
        if max_memory is not None:
            self.limit_memory(max_memory)

    def __dealloc__(self):
        if self.e.dd is not NULL and self.bdd is None:
            Cudd_Quit(self.e.dd)
        elif self.e.dd is not NULL:
            # The dd.cudd.BDD may outlive the core.
            Cudd_UnregisterTerminationCallback(self.e.dd)
            Cudd_RemoveHook(self.e.dd, _on_collection, 0)
            Cudd_SetApplicationHook(self.e.dd, NULL)
        free(self.e.perm)

    cdef inline Env* begin(self) except NULL:
        """Call this before each operation: it reads the levels again if they changed, and checks
        the time limit.
        """
        cdef Env* e = &self.e
        e.calls += 1
        if e.order_changed or Cudd_ReadSize(e.dd) != e.size or (e.calls & CALLS_PER_CHECK) == 0:
            self._refresh()
        return e

    cdef int _refresh(self) except -1:
        cdef Env* e = &self.e
        cdef int i, size = Cudd_ReadSize(e.dd)
        switch_collection(e)
        if past_limit(e):
            raise TimeLimitError(_TIME)
        if e.order_changed or size != e.size:
            perm = <int*>realloc(e.perm, (size + 1) * sizeof(int))
            if perm is NULL:
                raise MemoryError
            e.perm = perm
            e.size = size
            e.order_version += 1
            for i in range(size):
                perm[i] = Cudd_ReadPerm(e.dd, i)
            e.order_changed = False
        return 0

    cdef int fail(self) except -1:
        """Raise the error that stopped an operation; the manager is usable afterwards."""
        cdef Env* e = &self.e
        cdef int code = Cudd_ReadErrorCode(e.dd)
        cdef Reason reason = e.reason
        e.reason = NONE
        Cudd_ClearErrorCode(e.dd)
        if PyErr_Occurred():
            try:
                _raise_pending()
            except KeyboardInterrupt as interrupt:
                raise Interrupted("interrupted while working on decision diagrams") from interrupt
        if reason == TIME:
            raise TimeLimitError(_TIME)
        if reason == UNDEFINED:
            raise NumericalError("arithmetic on diagrams gave an undefined value, such as infinity minus infinity or 0 * infinity")
        cuddGarbageCollect(e.dd, 1)
        if reason == NO_MEMORY or code in (1, 2, 3):
            raise MemoryLimitError(
                f"the decision diagrams need more than the {self.max_memory / 2**20:,.0f} MiB they may use "
                f"({Cudd_ReadKeys(e.dd) - Cudd_ReadDead(e.dd):,} live nodes): raise the limit (-cuddmaxmem, max_memory), try another "
                "order of the variables, or the explicit engine"
            )
        raise RuntimeError(f"CUDD stopped with error code {code}")

    def limit_memory(self, limit: int):
        """Set the memory limit in bytes. CUDD checks it when it allocates, so it may be exceeded by
        up to half.
        """
        Cudd_SetMaxMemory(self.e.dd, limit)
        self.e.uncollected_nodes = <unsigned int>min(UNCOLLECTED_NODES, limit // (8 * sizeof(DdNode)))
        self.max_memory = limit

    def tune(self, loose_up_to: int, int min_hit):
        """Set the slots up to which the unique table grows without garbage collection, and the hit
        rate (percent) above which the computed table grows.
        """
        Cudd_SetLooseUpTo(self.e.dd, loose_up_to)
        Cudd_SetMinHit(self.e.dd, min_hit)

    def add_variable(self, name: str) -> int:
        """The index of a new variable below all others."""
        if self.bdd is not None:
            return self.bdd.add_var(name)
        if Cudd_bddIthVar(self.e.dd, len(self.names)) is NULL:
            self.fail()
        self.names.append(name)
        return len(self.names) - 1

    def names_by_index(self) -> list[str]:
        """The names of the variables, by index."""
        if self.bdd is None:
            return list(self.names)
        return [self.bdd._var_with_index[i] for i in range(self.size())]

    def limit_time(self, seconds: float | None):
        """Stop with TimeLimitError after so many seconds from now; None: no limit."""
        self.e.deadline = 0 if seconds is None else monotonic_seconds() + max(float(seconds), 1e-9)

    def limit_lookups(self, lookups: int | None):
        """Stop with TimeLimitError after so many more look-ups in CUDD's cache; None: no limit."""
        self.e.max_lookups = 0 if lookups is None else Cudd_ReadCacheLookUps(self.e.dd) + lookups

    def from_dd(self, function) -> Bdd:
        """The Bdd of a dd Function of this manager; nothing is copied."""
        if not isinstance(function, Function) or function.bdd is not self.bdd:
            raise TypeError("a Function of this manager's dd.cudd.BDD is needed")
        return wrap_bdd(self, <DdNode*><uintptr_t>(int(function) - 2))

    def from_any(self, states) -> Bdd:
        """The Bdd of a Bdd or dd Function. Raises TypeError or ValueError for one of another
        manager.
        """
        return as_bdd(self, states)

    def true(self) -> Bdd:
        """The BDD of every assignment."""
        return wrap_bdd(self, self.e.one)

    def literal(self, int index) -> Bdd:
        """The BDD of the variable with this index."""
        if not 0 <= index < Cudd_ReadSize(self.e.dd):
            raise IndexError(index)
        return wrap_bdd(self, Cudd_bddIthVar(self.e.dd, index))

    def constant(self, double value) -> Mtbdd:
        """The MTBDD with one leaf."""
        return wrap_mtbdd(self, leaf(self.begin(), value))

    def size(self) -> int:
        """Number of variables."""
        return Cudd_ReadSize(self.e.dd)

    def level(self, int index) -> int:
        """Level of a variable, by its index."""
        return Cudd_ReadPerm(self.e.dd, index)

    def index_at(self, int level) -> int:
        """Index of the variable at a level."""
        return Cudd_ReadInvPerm(self.e.dd, level)

    def statistics(self) -> dict[str, Any]:
        """Counters of the manager, as a dict."""
        cdef DdManager* dd = self.e.dd
        return {
            "variables": Cudd_ReadSize(dd),
            "live_nodes": Cudd_ReadKeys(dd) - Cudd_ReadDead(dd),
            "peak_live_nodes": Cudd_ReadPeakLiveNodeCount(dd),
            "memory": Cudd_ReadMemoryInUse(dd),
            "collections": Cudd_ReadGarbageCollections(dd),
            "cache_lookups": Cudd_ReadCacheLookUps(dd),
        }

    def collect(self) -> int:
        """Free dead nodes now; returns their number."""
        return cuddGarbageCollect(self.e.dd, 1)

    def check(self):
        """CUDD's consistency check of all nodes and of the cache, for tests; raises AssertionError.

        It also fails after a memory limit was reached while a leaf was created: CUDD then counts a
        leaf that does not exist, which is harmless.
        """
        if Cudd_DebugCheck(self.e.dd) != 0:
            raise AssertionError("CUDD's tables are inconsistent")

    def sift(self, groups: Iterable[tuple[int, int]], double growth=1.2):
        """Sift blocks of variables: pairs (index of the topmost variable, number of adjacent
        variables).
        """
        cdef unsigned int low, size
        self.begin()
        Cudd_FreeTree(self.e.dd)
        Cudd_SetMaxGrowth(self.e.dd, growth)
        try:
            for low, size in groups:
                if Cudd_MakeTreeNode(self.e.dd, low, size, 4) is NULL:
                    raise MemoryError
            self._reordered(Cudd_ReduceHeap(self.e.dd, 14, 0))
        finally:
            Cudd_FreeTree(self.e.dd)

    def shuffle(self, const int[::1] order):
        """Reorder; `order`: the variable index per level."""
        self.begin()
        if sorted(order) != list(range(Cudd_ReadSize(self.e.dd))):
            raise ValueError("every variable is needed once")
        self._reordered(Cudd_ShuffleHeap(self.e.dd, <int*>&order[0]))

    cdef int _reordered(self, int done) except -1:
        # CUDD does not report a reordering that was stopped as an error; its order is valid.
        self.e.order_changed = True
        if not done or self.e.reason != NONE:
            self.fail()
        return 0
