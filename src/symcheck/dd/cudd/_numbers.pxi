# Mtbdd: a function from assignments to numbers; the size of several diagrams together.

Operand: TypeAlias = "Mtbdd | SupportsFloat"


@cython.final
@cython.no_gc
@cython.freelist(256)
cdef class Mtbdd:
    """A function from assignments of the variables to float64, as a multi-terminal BDD (Clarke et
    al. 1993).

    Functions are immutable and hashable, and equal functions of one manager are the same node. `+ -
    * / ** %` and unary minus act pointwise on functions and numbers. 0 * x and 0 / x are 0 for
    every x, also for infinity and 0, as in sparse matrices; x / 0 is infinite for other x. Values
    are neither merged nor rounded, and -0.0 is stored as 0. Functions are made by a DiagramManager.

    Raises:
        NumericalError: a value is undefined, such as infinity - infinity.
        MemoryLimitError, TimeLimitError, Interrupted: in any operation; all handles stay usable.
    Examples:
        >>> from symcheck.dd.manager import DiagramManager
        >>> x, y = DiagramManager().add_variables(["x", "y"])
        >>> f = x.to_mtbdd(0.5) + y.to_mtbdd(0.25)
        >>> f.maximum_leaf, f.compare(">", 0.25) == x
        (0.75, True)
    """

    cdef readonly Core core
    cdef DdNode* node

    __array_ufunc__ = None       # numpy scalars then leave arithmetic with a diagram to this class

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

    def __add__(Mtbdd self, other: Operand) -> Mtbdd:
        return self._apply(PLUS, other)

    def __radd__(Mtbdd self, other: SupportsFloat) -> Mtbdd:
        return self._apply(PLUS, other)

    def __mul__(Mtbdd self, other: Operand) -> Mtbdd:
        return self._apply(TIMES, other)

    def __rmul__(Mtbdd self, other: SupportsFloat) -> Mtbdd:
        return self._apply(TIMES, other)

    def __sub__(Mtbdd self, other: Operand) -> Mtbdd:
        return self._apply(MINUS, other)

    def __rsub__(Mtbdd self, other: SupportsFloat) -> Mtbdd:
        return self._rapply(MINUS, other)

    def __truediv__(Mtbdd self, other: Operand) -> Mtbdd:
        return self._apply(DIVIDE, other)

    def __rtruediv__(Mtbdd self, other: SupportsFloat) -> Mtbdd:
        return self._rapply(DIVIDE, other)

    def __neg__(Mtbdd self) -> Mtbdd:
        return self._rapply(MINUS, 0.0)

    def minimum(self, other: Operand) -> Mtbdd:
        """The pointwise minimum."""
        return self._apply(MINIMUM, other)

    def maximum(self, other: Operand) -> Mtbdd:
        """The pointwise maximum."""
        return self._apply(MAXIMUM, other)

    def compare(self, str operator, other: Operand) -> Bdd:
        """The set where `self operator other` holds.

        Args:
            operator: one of < <= > >= = == !=.
            other: an Mtbdd or a number.
        """
        cdef Mtbdd o = as_mtbdd(self.core, other), f = self
        if operator in (">", ">="):
            f, o = o, f
        if operator in ("<", ">"):
            return wrap_bdd(self.core, apply(self.core.begin(), LESS, f.node, o.node))
        if operator in ("<=", ">="):
            return wrap_bdd(self.core, apply(self.core.begin(), LESS_EQUAL, f.node, o.node))
        if operator in ("=", "=="):
            return wrap_bdd(self.core, apply(self.core.begin(), EQUAL, f.node, o.node))
        if operator == "!=":
            return ~self.compare("=", other)
        raise ValueError(f"unknown comparison {operator!r}")

    def equal(self, other: Operand) -> Bdd:
        """The set where both have the same value."""
        return self.compare("==", other)

    def times_bdd(self, states: Bdd) -> Mtbdd:
        """This function on the set `states`, 0 elsewhere."""
        cdef Bdd f = as_bdd(self.core, states)
        return wrap_mtbdd(self.core, ite(self.core.begin(), f.node, self.node, self.core.e.zero))

    def to_bdd(self) -> Bdd:
        """The set where the value is not 0."""
        return self.compare("!=", 0.0)

    def sum_over(self, Cube cube not None) -> Mtbdd:
        """The sum over all assignments of the cube's variables."""
        return self.multiply_sum(1.0, cube)

    def multiply_sum(self, other: Operand, Cube cube not None) -> Mtbdd:
        """`(self * other).sum_over(cube)`, without building the product: a matrix times a vector or
        a matrix.
        """
        cdef Mtbdd o = as_mtbdd(self.core, other)
        return wrap_mtbdd(self.core, sum_product(self.core.begin(), self.node, o.node, cube_of(self.core, cube)))

    def rename(self, Renaming renaming not None) -> Mtbdd:
        """The function with its variables renamed."""
        if renaming.core is not self.core:
            raise ValueError("the renaming belongs to another manager")
        return wrap_mtbdd(self.core, permute(self.core.begin(), False, self.node, &renaming.map))

    def __hash__(self):
        return <Py_hash_t>(<uintptr_t>self.node >> 4)

    def __eq__(Mtbdd self, other: object):
        if type(other) is Mtbdd:
            return self.node is (<Mtbdd>other).node
        return NotImplemented

    @property
    def node_count(self) -> int:
        """Number of nodes, leaves included."""
        return Cudd_DagSize(self.node)

    @property
    def support(self) -> tuple[int, ...]:
        """Indices of the variables that the value depends on, topmost first."""
        return support_of(self.core, self.node)

    @property
    def leaves(self) -> Floats:
        """The values that occur, ascending; float64[n]."""
        return np.sort(leaf_values(self.node))

    @property
    def minimum_leaf(self) -> float:
        """The smallest value that occurs."""
        return float(leaf_values(self.node).min())

    @property
    def maximum_leaf(self) -> float:
        """The largest value that occurs."""
        return float(leaf_values(self.node).max())

    # overload: (self, bits: Sequence[int]) -> float
    # overload: (self, bits: ArrayLike) -> Any
    def evaluate(self, bits):
        """The values at assignments.

        Args:
            bits: uint8[variables] or uint8[n, variables], by variable index.
        Returns:
            A float, or float64[n].
        """
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


def shared_size(Core core not None, handles: Sequence[Bdd | Mtbdd]) -> int:
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
