# Handles, and arguments that are prepared once for many operations: Cube, Renaming, Transition.

cdef inline Bdd wrap_bdd(Core core, DdNode* n):
    if n is NULL:
        core.fail()
    reference(n)
    cdef Bdd f = Bdd.__new__(Bdd)
    f.core = core
    f.node = n
    return f


cdef inline Mtbdd wrap_mtbdd(Core core, DdNode* n):
    if n is NULL:
        core.fail()
    reference(n)
    cdef Mtbdd m = Mtbdd.__new__(Mtbdd)
    m.core = core
    m.node = n
    return m


cdef Bdd as_bdd(Core core, object x):
    """x as a Bdd of this core; a dd Function is taken as well."""
    if type(x) is not Bdd:
        if isinstance(x, Function):
            return core.from_dd(x)
        raise TypeError(f"a Bdd is needed, not {type(x).__name__}")
    if (<Bdd>x).core is not core:
        raise ValueError("the diagrams belong to different managers")
    return <Bdd>x


cdef Mtbdd as_mtbdd(Core core, object x):
    """x as an Mtbdd of this core; a number becomes a constant."""
    if type(x) is not Mtbdd:
        if isinstance(x, (int, float)) or hasattr(x, "__float__"):
            return core.constant(x)
        raise TypeError(f"an Mtbdd or a number is needed, not {type(x).__name__}")
    if (<Mtbdd>x).core is not core:
        raise ValueError("the diagrams belong to different managers")
    return <Mtbdd>x


cdef inline DdNode* cube_of(Core core, Cube cube) except NULL:
    if cube.core is not core:
        raise ValueError("the cube belongs to another manager")
    return cube.node


cdef tuple support_of(Core core, DdNode* f):
    cdef int* found = NULL
    cdef int i, n = Cudd_SupportIndices(core.e.dd, f, &found)
    if n < 0:
        core.fail()
    try:
        return tuple(sorted([found[i] for i in range(n)], key=core.level))
    finally:
        free(found)


@cython.final
@cython.no_gc
cdef class Cube:
    """A set of variables to quantify, sum or count over. `indices`: their indices, in the order
    given.
    """

    cdef readonly Core core
    cdef readonly tuple indices  # type: tuple[int, ...]
    cdef DdNode* node

    def __cinit__(self, Core core not None, indices: Iterable[int]):
        cdef Ref c, r
        cdef int i
        self.core = core
        self.indices = tuple(indices)
        if len(set(self.indices)) != len(self.indices):
            raise ValueError("a variable occurs twice")
        cdef Env* e = core.begin()
        c = referenced(e.one)
        for i in sorted(self.indices, key=core.level, reverse=True):
            if not 0 <= i < e.size:
                Cudd_IterDerefBdd(e.dd, c)
                raise IndexError(i)
            r = Cudd_bddAnd(e.dd, Cudd_bddIthVar(e.dd, i), c)
            c = referenced(released(e, c, r))
            if c is NULL:
                core.fail()
        self.node = c

    def __dealloc__(self):
        if self.node is not NULL:
            Cudd_IterDerefBdd(self.core.e.dd, self.node)

    def __len__(self):
        return len(self.indices)

    def __repr__(self):
        return f"<Cube of {len(self.indices)} variables>"

    @property
    def set(self) -> Bdd:
        """The conjunction of the variables, as a Bdd."""
        return wrap_bdd(self.core, self.node)


@cython.final
@cython.no_gc
cdef class Renaming:
    """A simultaneous substitution of variables, f[a := b] for all pairs of indices (a, b)."""

    cdef readonly Core core
    cdef readonly tuple pairs  # type: tuple[tuple[int, int], ...]
    cdef Mapping map

    def __cinit__(self, Core core not None, pairs: Iterable[tuple[int, int]]):
        cdef int i, a, b
        self.core = core
        self.pairs = tuple(pairs)
        cdef Env* e = core.begin()
        if len({a for a, _ in self.pairs}) != len(self.pairs):
            raise ValueError("a variable is renamed twice")
        self.map.size = e.size
        self.map.to = <int*>malloc((e.size + 1) * sizeof(int))
        if self.map.to is NULL:
            raise MemoryError
        for i in range(e.size):
            self.map.to[i] = i
        for a, b in self.pairs:
            if not (0 <= a < e.size and 0 <= b < e.size):
                raise IndexError((a, b))
            self.map.to[a] = b
        # Each key is used once, so that cached results about it stay valid.
        core.renamings += 1
        self.map.key = cuddUniqueConst(e.dd, 2.0 + <double>core.renamings)
        if self.map.key is NULL:
            core.fail()
        reference(self.map.key)

    def __dealloc__(self):
        free(self.map.to)
        if self.map.key is not NULL:
            Cudd_RecursiveDeref(self.core.e.dd, self.map.key)

    def __repr__(self):
        return f"<Renaming of {len(self.pairs)} variables>"


@cython.final
@cython.no_gc
cdef class Transition:
    """The touched variables of a relation, pairs (row index, column index), prepared for `image`
    and `preimage`.

    Where each column variable is directly below its row variable, quantification and renaming are
    done in one recursion. Variables that are not touched keep their values: the relation needs no
    identity for them.
    """

    cdef readonly Core core
    cdef readonly tuple pairs  # type: tuple[tuple[int, int], ...]
    cdef readonly Cube rows
    cdef readonly Cube columns
    cdef Cube all
    cdef Renaming to_rows
    cdef Renaming to_columns

    def __cinit__(self, Core core not None, pairs: Iterable[tuple[int, int]]):
        self.core = core
        self.pairs = tuple(pairs)
        self.rows = Cube(core, [a for a, _ in self.pairs])
        self.columns = Cube(core, [b for _, b in self.pairs])
        self.all = Cube(core, [i for pair in self.pairs for i in pair])
        self.to_rows = Renaming(core, [(b, a) for a, b in self.pairs])
        self.to_columns = Renaming(core, self.pairs)

    cdef bint adjacent(self, Env* e) noexcept:
        """Whether each column is directly below its row now; checked before each step, as the order
        may change.
        """
        cdef DdNode* c = self.all.node
        cdef DdNode* d
        while c is not e.one:
            d = c.type.kids.T
            if d is e.one or e.perm[d.index] != e.perm[c.index] + 1 or self.to_columns.map.to[c.index] != <int>d.index:
                return False
            c = d.type.kids.T
        return True

    cdef DdNode* step(self, Env* e, bint forward, DdNode* s, DdNode* r) noexcept:
        cdef Ref t, u
        if self.adjacent(e):
            return relation_step(e, forward, s, r, self.all.node)
        if forward:
            t = referenced(Cudd_bddAndAbstract(e.dd, s, r, self.rows.node))
            return released(e, t, NULL if t is NULL else permute(e, True, t, &self.to_rows.map))
        t = referenced(permute(e, True, s, &self.to_columns.map))
        u = NULL if t is NULL else Cudd_bddAndAbstract(e.dd, t, r, self.columns.node)
        return released(e, t, u)

    def image(self, Bdd states not None, Bdd relation not None) -> Bdd:
        """The successors of `states` (over row variables) by `relation`, over row variables."""
        as_bdd(self.core, states)
        as_bdd(self.core, relation)
        return wrap_bdd(self.core, self.step(self.core.begin(), True, states.node, relation.node))

    def preimage(self, Bdd states not None, Bdd relation not None) -> Bdd:
        """The predecessors of `states` (over row variables) by `relation`, over row variables."""
        as_bdd(self.core, states)
        as_bdd(self.core, relation)
        return wrap_bdd(self.core, self.step(self.core.begin(), False, states.node, relation.node))
