# Handles of nodes: Bdd (a set of assignments), Mtbdd (a number per assignment), Cube and Renaming (prepared once).

cdef inline Bdd wrap_bdd(Core core, DdNode* n):
    if n is NULL:
        core.fail()
    take(n)
    cdef Bdd f = Bdd.__new__(Bdd)
    f.core = core
    f.node = n
    return f


cdef inline Mtbdd wrap_mtbdd(Core core, DdNode* n):
    if n is NULL:
        core.fail()
    take(n)
    cdef Mtbdd m = Mtbdd.__new__(Mtbdd)
    m.core = core
    m.node = n
    return m


cdef Bdd as_bdd(Core core, object x):
    """x as a Bdd of this core; a dd Function is taken as well."""
    if type(x) is not Bdd:
        if isinstance(x, cudd.Function):
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
    """A set of variables to quantify, sum or count over. `indices`: their indices, in the order given."""

    cdef readonly Core core
    cdef readonly tuple indices
    cdef DdNode* node

    def __cinit__(self, Core core not None, indices):
        cdef Ref c, r
        cdef int i
        self.core = core
        self.indices = tuple(indices)
        if len(set(self.indices)) != len(self.indices):
            raise ValueError("a variable occurs twice")
        cdef Env* e = core.begin()
        c = e.one
        take(c)
        for i in sorted(self.indices, key=core.level, reverse=True):
            if not 0 <= i < e.size:
                Cudd_IterDerefBdd(e.dd, c)
                raise IndexError(i)
            r = Cudd_bddAnd(e.dd, Cudd_bddIthVar(e.dd, i), c)
            if r is not NULL:
                take(r)
            Cudd_IterDerefBdd(e.dd, c)
            if r is NULL:
                core.fail()
            c = r
        self.node = c

    def __dealloc__(self):
        if self.node is not NULL:
            Cudd_IterDerefBdd(self.core.e.dd, self.node)

    def __len__(self):
        return len(self.indices)

    def __repr__(self):
        return f"<Cube of {len(self.indices)} variables>"

    @property
    def set(self):
        """The conjunction of the variables, as a Bdd."""
        return wrap_bdd(self.core, self.node)


@cython.final
@cython.no_gc
cdef class Renaming:
    """A change of variables, f[a := b] for all pairs of indices (a, b) at once; prepared once, used often."""

    cdef readonly Core core
    cdef readonly tuple pairs
    cdef Mapping map

    def __cinit__(self, Core core not None, pairs):
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
        # Numbers are never used again for this, so what CUDD's cache says of a key stays true.
        core.renamings += 1
        self.map.key = cuddUniqueConst(e.dd, 2.0 + <double>core.renamings)
        if self.map.key is NULL:
            core.fail()
        take(self.map.key)

    def __dealloc__(self):
        free(self.map.to)
        if self.map.key is not NULL:
            Cudd_RecursiveDeref(self.core.e.dd, self.map.key)

    def __repr__(self):
        return f"<Renaming of {len(self.pairs)} variables>"


@cython.final
@cython.no_gc
cdef class Transition:
    """The touched variables of a relation: pairs (row index, column index), prepared for `image` and `preimage`.

    Where each column variable is right below its row variable, quantification and renaming are done on the way.
    """

    cdef readonly Core core
    cdef readonly tuple pairs
    cdef readonly Cube rows
    cdef readonly Cube columns
    cdef Cube all
    cdef Renaming to_rows
    cdef Renaming to_columns

    def __cinit__(self, Core core not None, pairs):
        self.core = core
        self.pairs = tuple(pairs)
        self.rows = Cube(core, [a for a, _ in self.pairs])
        self.columns = Cube(core, [b for _, b in self.pairs])
        self.all = Cube(core, [i for pair in self.pairs for i in pair])
        self.to_rows = Renaming(core, [(b, a) for a, b in self.pairs])
        self.to_columns = Renaming(core, self.pairs)

    cdef bint adjacent(self, Env* e) noexcept:
        """Looked at anew each time (it is cheap beside the step): the order may have changed."""
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
            t = Cudd_bddAndAbstract(e.dd, s, r, self.rows.node)
        else:
            s = permute(e, True, s, &self.to_columns.map)
            if s is NULL:
                return NULL
            take(s)
            t = Cudd_bddAndAbstract(e.dd, s, r, self.columns.node)
            if t is not NULL:
                take(t)
            Cudd_IterDerefBdd(e.dd, s)
            if t is not NULL:
                give(t)
            return t
        if t is NULL:
            return NULL
        take(t)
        u = permute(e, True, t, &self.to_rows.map)
        if u is not NULL:
            take(u)
        Cudd_IterDerefBdd(e.dd, t)
        if u is not NULL:
            give(u)
        return u

    def image(self, Bdd states not None, Bdd relation not None):
        """The successors of `states` (over row variables) by `relation`, over row variables."""
        as_bdd(self.core, states)
        as_bdd(self.core, relation)
        return wrap_bdd(self.core, self.step(self.core.begin(), True, states.node, relation.node))

    def preimage(self, Bdd states not None, Bdd relation not None):
        """The predecessors of `states` (over row variables) by `relation`, over row variables."""
        as_bdd(self.core, states)
        as_bdd(self.core, relation)
        return wrap_bdd(self.core, self.step(self.core.begin(), False, states.node, relation.node))


@cython.final
@cython.no_gc
@cython.freelist(256)
cdef class Bdd:
    """A set of assignments. Immutable; equal sets of one manager are the same node, so comparing them costs nothing."""

    cdef readonly Core core
    cdef DdNode* node

    def __init__(self):
        raise TypeError("a Bdd is made by a DiagramManager")

    def __dealloc__(self):
        if self.node is not NULL:
            Cudd_IterDerefBdd(self.core.e.dd, self.node)

    def __and__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAnd(self.core.begin().dd, self.node, o.node))

    def __or__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddOr(self.core.begin().dd, self.node, o.node))

    def __xor__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddXor(self.core.begin().dd, self.node, o.node))

    def __sub__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAnd(self.core.begin().dd, self.node, negate(o.node)))

    def __invert__(self):
        return wrap_bdd(self.core, negate(self.node))

    def implies(self, other):
        """~self | other."""
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddOr(self.core.begin().dd, negate(self.node), o.node))

    def equivalent(self, other):
        """The assignments on which both agree."""
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddXor(self.core.begin().dd, self.node, negate(o.node)))

    def ite(self, then, otherwise):
        """`then` on this set, `otherwise` elsewhere: a Bdd from two Bdds, else an Mtbdd (numbers become constants)."""
        cdef Bdd a, b
        cdef Mtbdd x, y
        if isinstance(then, (Bdd, cudd.Function)) and isinstance(otherwise, (Bdd, cudd.Function)):
            a = as_bdd(self.core, then)
            b = as_bdd(self.core, otherwise)
            return wrap_bdd(self.core, Cudd_bddIte(self.core.begin().dd, self.node, a.node, b.node))
        x = as_mtbdd(self.core, then)
        y = as_mtbdd(self.core, otherwise)
        return wrap_mtbdd(self.core, ite(self.core.begin(), self.node, x.node, y.node))

    def to_mtbdd(self, double value=1.0):
        """`value` on this set, 0 elsewhere."""
        cdef Mtbdd x = self.core.constant(value)
        return wrap_mtbdd(self.core, masked(self.core.begin(), x.node, self.node))

    def exists(self, Cube cube not None):
        """Projection: the assignments that some values of the cube's variables bring into the set."""
        return wrap_bdd(self.core, Cudd_bddExistAbstract(self.core.begin().dd, self.node, cube_of(self.core, cube)))

    def forall(self, Cube cube not None):
        """The assignments that every value of the cube's variables keeps in the set."""
        return wrap_bdd(self.core, Cudd_bddUnivAbstract(self.core.begin().dd, self.node, cube_of(self.core, cube)))

    def and_exists(self, other, Cube cube not None):
        """(self & other).exists(cube), without the conjunction in between."""
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAndAbstract(self.core.begin().dd, self.node, o.node, cube_of(self.core, cube)))

    def rename(self, Renaming renaming not None):
        """The set with its variables changed."""
        if renaming.core is not self.core:
            raise ValueError("the renaming belongs to another manager")
        return wrap_bdd(self.core, permute(self.core.begin(), True, self.node, &renaming.map))

    def cofactor(self, literals):
        """The set with the variables fixed as in `literals`, a conjunction of literals."""
        cdef Bdd o = as_bdd(self.core, literals)
        if o.node is self.core.e.no:
            raise ValueError("the literals contradict each other")
        return wrap_bdd(self.core, Cudd_Cofactor(self.core.begin().dd, self.node, o.node))

    def simplify(self, care):
        """A set, often with fewer nodes, that agrees with this one on `care` (which must not be empty)."""
        cdef Bdd o = as_bdd(self.core, care)
        if o.node is self.core.e.no:
            return self
        return wrap_bdd(self.core, Cudd_bddRestrict(self.core.begin().dd, self.node, o.node))

    def __bool__(self):
        return self.node is not self.core.e.no

    def __hash__(self):
        return <Py_hash_t>(<uintptr_t>self.node >> 4 ^ sign(self.node))

    def __eq__(Bdd self, other):
        if type(other) is Bdd:
            return self.node is (<Bdd>other).node
        if isinstance(other, cudd.Function) and other.bdd is self.core.bdd:
            return self.node is <DdNode*><uintptr_t>(int(other) - 2)
        return NotImplemented

    def __le__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return Cudd_bddLeq(self.core.begin().dd, self.node, o.node) != 0

    def __ge__(Bdd self, other):
        cdef Bdd o = as_bdd(self.core, other)
        return Cudd_bddLeq(self.core.begin().dd, o.node, self.node) != 0

    def __lt__(Bdd self, other):
        return self <= other and self != other

    def __gt__(Bdd self, other):
        return self >= other and self != other

    def disjoint(self, other):
        """Whether no assignment is in both sets; no diagram is built."""
        cdef Bdd o = as_bdd(self.core, other)
        return Cudd_bddLeq(self.core.begin().dd, self.node, negate(o.node)) != 0

    @property
    def is_true(self):
        """Whether every assignment is in the set."""
        return self.node is self.core.e.one

    @property
    def node_count(self):
        """Number of nodes, the terminal included."""
        return Cudd_DagSize(self.node)

    @property
    def support(self):
        """Indices of the variables that the set depends on, topmost first."""
        return support_of(self.core, self.node)

    def evaluate(self, bits):
        """Whether assignments are in the set; `bits`: uint8 by variable index, [variables] or [n, variables]."""
        rows = _assignments(self.core, bits)
        out = np.empty(len(rows), dtype=np.bool_)
        evaluate_rows(self.core.begin(), self.node, rows, None, out.view(np.uint8))
        return bool(out[0]) if np.ndim(bits) == 1 else out

    def to_dd(self):
        """This set as a Function of dd; nothing is copied."""
        return self.core.bdd._add_int(<uintptr_t>self.node + 2)

    def __repr__(self):
        if self.node is self.core.e.no or self.node is self.core.e.one:
            return f"<Bdd {'true' if self.node is self.core.e.one else 'false'}>"
        return f"<Bdd of {self.node_count} nodes over {len(self.support)} variables>"


@cython.final
@cython.no_gc
@cython.freelist(256)
cdef class Mtbdd:
    """A number (float64) per assignment. Immutable; equal functions of one manager are the same node."""

    cdef readonly Core core
    cdef DdNode* node

    __array_ufunc__ = None       # numpy scalars leave arithmetic with a diagram to the diagram

    def __init__(self):
        raise TypeError("an Mtbdd is made by a DiagramManager")

    def __dealloc__(self):
        if self.node is not NULL:
            Cudd_RecursiveDeref(self.core.e.dd, self.node)

    cdef Mtbdd _apply(self, Op op, object other):
        cdef Mtbdd o = as_mtbdd(self.core, other)
        return wrap_mtbdd(self.core, apply(self.core.begin(), op, self.node, o.node))

    cdef Mtbdd _rapply(self, Op op, object other):
        cdef Mtbdd o = as_mtbdd(self.core, other)
        return wrap_mtbdd(self.core, apply(self.core.begin(), op, o.node, self.node))

    def __add__(Mtbdd self, other):
        return self._apply(PLUS, other)

    def __radd__(Mtbdd self, other):
        return self._apply(PLUS, other)

    def __mul__(Mtbdd self, other):
        return self._apply(TIMES, other)

    def __rmul__(Mtbdd self, other):
        return self._apply(TIMES, other)

    def __sub__(Mtbdd self, other):
        return self._apply(MINUS, other)

    def __rsub__(Mtbdd self, other):
        return self._rapply(MINUS, other)

    def __truediv__(Mtbdd self, other):
        return self._apply(DIVIDE, other)

    def __rtruediv__(Mtbdd self, other):
        return self._rapply(DIVIDE, other)

    def __neg__(Mtbdd self):
        return self._rapply(MINUS, 0.0)

    def __pow__(Mtbdd self, other, modulus):
        if modulus is not None:
            return NotImplemented
        return self._apply(POWER, other)

    def __rpow__(Mtbdd self, other, modulus):
        return self._rapply(POWER, other)

    def __mod__(Mtbdd self, other):
        return self._apply(MODULO, other)

    def __rmod__(Mtbdd self, other):
        return self._rapply(MODULO, other)

    def minimum(self, other):
        """The smaller value, leaf by leaf."""
        return self._apply(MINIMUM, other)

    def maximum(self, other):
        """The larger value, leaf by leaf."""
        return self._apply(MAXIMUM, other)

    def compare(self, str operator, other):
        """The set where `self operator other`; operators: < <= > >= = == !=. `other`: an Mtbdd or a number."""
        cdef Mtbdd o = as_mtbdd(self.core, other)
        cdef Env* e = self.core.begin()
        cdef DdNode* r
        if operator == "<":
            r = compare(e, LESS, self.node, o.node)
        elif operator == "<=":
            r = compare(e, LESS_EQUAL, self.node, o.node)
        elif operator == ">":
            r = compare(e, LESS, o.node, self.node)
        elif operator == ">=":
            r = compare(e, LESS_EQUAL, o.node, self.node)
        elif operator == "=" or operator == "==":
            r = compare(e, EQUAL, self.node, o.node)
        elif operator == "!=":
            r = compare(e, EQUAL, self.node, o.node)
            r = r if r is NULL else negate(r)
        else:
            raise ValueError(f"unknown comparison {operator!r}")
        return wrap_bdd(self.core, r)

    def equal(self, other):
        """The set where both have the same value."""
        return self.compare("==", other)

    def times_bdd(self, states):
        """This on the set `states`, 0 elsewhere."""
        cdef Bdd f = as_bdd(self.core, states)
        return wrap_mtbdd(self.core, masked(self.core.begin(), self.node, f.node))

    def to_bdd(self):
        """The set where the value is not 0."""
        return wrap_bdd(self.core, to_bdd(self.core.begin(), self.node))

    def sum_over(self, Cube cube not None):
        """The sum over all assignments of the cube's variables."""
        return wrap_mtbdd(self.core, abstract(self.core.begin(), SUM_OVER, self.node, cube_of(self.core, cube)))

    def max_over(self, Cube cube not None):
        """The maximum over all assignments of the cube's variables."""
        return wrap_mtbdd(self.core, abstract(self.core.begin(), MAX_OVER, self.node, cube_of(self.core, cube)))

    def min_over(self, Cube cube not None):
        """The minimum over all assignments of the cube's variables."""
        return wrap_mtbdd(self.core, abstract(self.core.begin(), MIN_OVER, self.node, cube_of(self.core, cube)))

    def multiply_sum(self, other, Cube cube not None):
        """(self * other).sum_over(cube), without the product in between: a matrix times a vector or a matrix."""
        cdef Mtbdd o = as_mtbdd(self.core, other)
        return wrap_mtbdd(self.core, sum_product(self.core.begin(), self.node, o.node, cube_of(self.core, cube)))

    def rename(self, Renaming renaming not None):
        """The same numbers with the variables changed."""
        if renaming.core is not self.core:
            raise ValueError("the renaming belongs to another manager")
        return wrap_mtbdd(self.core, permute(self.core.begin(), False, self.node, &renaming.map))

    def map(self, function):
        """The diagram with `function` (float64[n] -> float64[n]) applied to its array of leaves, e.g. numpy.floor."""
        table = export_nodes(self.core, [self])
        values = np.ascontiguousarray(function(table[3]), dtype=np.float64)
        if values.shape != table[3].shape:
            raise ValueError("the function must give one number per leaf")
        return import_nodes(self.core, *table[:3], values, table[4])[0]

    def __hash__(self):
        return <Py_hash_t>(<uintptr_t>self.node >> 4)

    def __eq__(Mtbdd self, other):
        if type(other) is Mtbdd:
            return self.node is (<Mtbdd>other).node
        return NotImplemented

    @property
    def node_count(self):
        """Number of nodes, leaves included."""
        return Cudd_DagSize(self.node)

    @property
    def support(self):
        """Indices of the variables that the value depends on, topmost first."""
        return support_of(self.core, self.node)

    @property
    def is_constant(self):
        """Whether there is only one leaf."""
        return self.node.index == CONSTANT

    @property
    def leaves(self):
        """The values that occur, ascending; float64[n]."""
        return np.sort(leaf_values(self.node))

    @property
    def minimum_leaf(self):
        """The smallest value that occurs."""
        return float(leaf_values(self.node).min())

    @property
    def maximum_leaf(self):
        """The largest value that occurs."""
        return float(leaf_values(self.node).max())

    def evaluate(self, bits):
        """The value at assignments; `bits`: uint8 by variable index, [variables] or [n, variables]."""
        rows = _assignments(self.core, bits)
        out = np.empty(len(rows), dtype=np.float64)
        evaluate_rows(self.core.begin(), self.node, rows, out, None)
        return float(out[0]) if np.ndim(bits) == 1 else out

    def __float__(self):
        if self.node.index != CONSTANT:
            raise TypeError("this diagram is not constant")
        return self.node.type.value

    def __repr__(self):
        if self.node.index == CONSTANT:
            return f"<Mtbdd {self.node.type.value:g}>"
        return f"<Mtbdd of {self.node_count} nodes over {len(self.support)} variables>"


def _assignments(Core core, bits):
    rows = np.ascontiguousarray(np.atleast_2d(bits), dtype=np.uint8)
    if rows.ndim != 2 or rows.shape[1] != core.size():
        raise ValueError(f"an assignment needs a bit for each of the {core.size()} variables")
    return rows


def unite(Core core not None, sets, bint conjunction=False):
    """Union (or intersection) of many sets, as a balanced tree."""
    cdef list layer = [as_bdd(core, f) for f in sets]
    cdef Bdd f, g
    cdef Env* e = core.begin()
    cdef Py_ssize_t i
    if not layer:
        return wrap_bdd(core, e.one if conjunction else e.no)
    while len(layer) > 1:
        following = []
        for i in range(0, len(layer) - 1, 2):
            f = layer[i]
            g = layer[i + 1]
            following.append(wrap_bdd(core, (Cudd_bddAnd if conjunction else Cudd_bddOr)(e.dd, f.node, g.node)))
        if len(layer) % 2:
            following.append(layer[len(layer) - 1])
        layer = following
    return layer[0]


def total(Core core not None, diagrams):
    """Sum of many MTBDDs, as a balanced tree."""
    cdef list layer = [as_mtbdd(core, m) for m in diagrams]
    cdef Mtbdd f, g
    cdef Env* e = core.begin()
    cdef Py_ssize_t i
    if not layer:
        return wrap_mtbdd(core, e.zero)
    while len(layer) > 1:
        following = []
        for i in range(0, len(layer) - 1, 2):
            f = layer[i]
            g = layer[i + 1]
            following.append(wrap_mtbdd(core, apply(e, PLUS, f.node, g.node)))
        if len(layer) % 2:
            following.append(layer[len(layer) - 1])
        layer = following
    return layer[0]


def shared_size(Core core not None, handles):
    """Number of distinct nodes of several diagrams together."""
    cdef list alive = [h if type(h) is Mtbdd else as_bdd(core, h) for h in handles]
    cdef Py_ssize_t i, n = len(alive)
    cdef Mtbdd m
    cdef Bdd f
    cdef DdNode** nodes = <DdNode**>malloc((n + 1) * sizeof(DdNode*))
    if nodes is NULL:
        raise MemoryError
    for i in range(n):
        if type(alive[i]) is Mtbdd:
            m = alive[i]
            nodes[i] = m.node
        else:
            f = alive[i]
            nodes[i] = f.node
    try:
        return Cudd_SharingSize(nodes, <int>n)
    finally:
        free(nodes)
