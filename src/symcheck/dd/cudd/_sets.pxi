# Bdd: a set of assignments of the variables.

@cython.final
@cython.no_gc
@cython.freelist(256)
cdef class Bdd:
    """A set of assignments of the variables, as a reduced ordered binary decision diagram (Bryant
    1986).

    Sets are immutable and hashable. Equal sets of one manager are the same node, so that comparing
    them takes constant time. Operators: `&` intersection, `|` union, `^` symmetric difference, `-`
    difference, `~` complement, `<=` inclusion; `bool(f)` tells whether the set is not empty.
    Operands may be dd Functions of the same manager. Sets are made by a DiagramManager.

    Raises:
        MemoryLimitError, TimeLimitError, Interrupted: in any operation; all handles stay usable.
        ValueError: the operands belong to different managers.
    Examples:
        >>> from symcheck.dd.manager import DiagramManager
        >>> x, y = DiagramManager().add_variables(["x", "y"])
        >>> (x & y) <= x, x.disjoint(~x), bool(x - x)
        (True, True, False)
    """

    cdef readonly Core core
    cdef DdNode* node

    def __init__(self):
        raise TypeError("a Bdd is made by a DiagramManager")

    def __dealloc__(self):
        if self.node is not NULL:
            Cudd_IterDerefBdd(self.core.e.dd, self.node)

    def __and__(Bdd self, other) -> Bdd:
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAnd(self.core.begin().dd, self.node, o.node))

    def __or__(Bdd self, other) -> Bdd:
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddOr(self.core.begin().dd, self.node, o.node))

    def __xor__(Bdd self, other) -> Bdd:
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddXor(self.core.begin().dd, self.node, o.node))

    def __sub__(Bdd self, other) -> Bdd:
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAnd(self.core.begin().dd, self.node, negate(o.node)))

    def __invert__(self) -> Bdd:
        return wrap_bdd(self.core, negate(self.node))

    def equivalent(self, other: Bdd) -> Bdd:
        """The assignments on which both agree."""
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddXor(self.core.begin().dd, self.node, negate(o.node)))

    # overload: (self, then: Bdd, otherwise: Bdd) -> Bdd
    # overload: (self, then: Mtbdd | float, otherwise: Mtbdd | float) -> Mtbdd
    def ite(self, then, otherwise):
        """If-then-else: `then` on this set, `otherwise` elsewhere.

        Args:
            then, otherwise: two Bdds (the result is a Bdd), or Mtbdds and numbers (the result is an
                Mtbdd).
        """
        cdef Bdd a, b
        cdef Mtbdd x, y
        if isinstance(then, (Bdd, Function)) and isinstance(otherwise, (Bdd, Function)):
            a = as_bdd(self.core, then)
            b = as_bdd(self.core, otherwise)
            return wrap_bdd(self.core, Cudd_bddIte(self.core.begin().dd, self.node, a.node, b.node))
        x = as_mtbdd(self.core, then)
        y = as_mtbdd(self.core, otherwise)
        return wrap_mtbdd(self.core, ite(self.core.begin(), self.node, x.node, y.node))

    def to_mtbdd(self, double value=1.0) -> Mtbdd:
        """The function that is `value` on this set and 0 elsewhere."""
        cdef Mtbdd x = self.core.constant(value)
        return wrap_mtbdd(self.core, ite(self.core.begin(), self.node, x.node, self.core.e.zero))

    def exists(self, Cube cube not None) -> Bdd:
        """Existential quantification: assignments that are in the set for some values of the cube's
        variables.
        """
        return wrap_bdd(self.core, Cudd_bddExistAbstract(self.core.begin().dd, self.node, cube_of(self.core, cube)))

    def and_exists(self, other: Bdd, Cube cube not None) -> Bdd:
        """`(self & other).exists(cube)`, without building the conjunction."""
        cdef Bdd o = as_bdd(self.core, other)
        return wrap_bdd(self.core, Cudd_bddAndAbstract(self.core.begin().dd, self.node, o.node, cube_of(self.core, cube)))

    def rename(self, Renaming renaming not None) -> Bdd:
        """The set with its variables renamed."""
        if renaming.core is not self.core:
            raise ValueError("the renaming belongs to another manager")
        return wrap_bdd(self.core, permute(self.core.begin(), True, self.node, &renaming.map))

    def cofactor(self, literals: Bdd) -> Bdd:
        """The cofactor by `literals`, a conjunction of literals. Raises ValueError if that is
        empty.
        """
        cdef Bdd o = as_bdd(self.core, literals)
        if o.node is self.core.e.logic_zero:
            raise ValueError("the literals contradict each other")
        return wrap_bdd(self.core, Cudd_Cofactor(self.core.begin().dd, self.node, o.node))

    def __bool__(self):
        return self.node is not self.core.e.logic_zero

    def __hash__(self):
        return <Py_hash_t>(<uintptr_t>self.node >> 4 ^ sign(self.node))

    def __eq__(Bdd self, other: object):
        if type(other) is Bdd:
            return self.node is (<Bdd>other).node
        if isinstance(other, Function) and other.bdd is self.core.bdd:
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

    def disjoint(self, other: Bdd) -> bool:
        """Whether the intersection is empty; no diagram is built."""
        cdef Bdd o = as_bdd(self.core, other)
        return Cudd_bddLeq(self.core.begin().dd, self.node, negate(o.node)) != 0

    @property
    def node_count(self) -> int:
        """Number of nodes, the terminal included."""
        return Cudd_DagSize(self.node)

    @property
    def support(self) -> tuple[int, ...]:
        """Indices of the variables that the set depends on, topmost first."""
        return support_of(self.core, self.node)

    # overload: (self, bits: Sequence[int]) -> bool
    # overload: (self, bits: ArrayLike) -> Any
    def evaluate(self, bits):
        """Whether assignments are in the set.

        Args:
            bits: uint8[variables] or uint8[n, variables], by variable index.
        Returns:
            A bool, or bool[n].
        """
        rows = _assignments(self.core, bits)
        out = np.empty(len(rows), dtype=np.bool_)
        evaluate_rows(self.core.begin(), self.node, rows, None, out.view(np.uint8))
        return bool(out[0]) if np.ndim(bits) == 1 else out

    def to_dd(self) -> Any:
        """The set as a Function of dd, without copying. Raises UnsupportedError without dd.cudd."""
        if self.core.bdd is None:
            raise UnsupportedError("dd has no CUDD here, and no diagrams that it shares with symcheck")
        return self.core.bdd._add_int(<uintptr_t>self.node + 2)

    def __repr__(self):
        if self.node is self.core.e.logic_zero or self.node is self.core.e.one:
            return f"<Bdd {'true' if self.node is self.core.e.one else 'false'}>"
        return f"<Bdd of {self.node_count} nodes over {len(self.support)} variables>"
