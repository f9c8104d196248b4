# Recursions that the wheel's CUDD lacks, in CUDD's conventions: the result is not referenced for
# the caller, intermediate results are referenced before the next allocation, and NULL means
# stopped. The depth is at most the number of levels. `_owned`: the references of the arguments, which
# may be NULL, are consumed.

cdef enum Op:
    PLUS, TIMES, MINUS, DIVIDE, MINIMUM, MAXIMUM
    LESS, LESS_EQUAL, EQUAL      # comparisons, whose result is a BDD
    PERMUTE_BDD, PERMUTE_ADD

# The address of an operation is its key in CUDD's cache.
cdef char[32] _ops

# A renaming: the new index of each index. `key`, a constant of its own, stands for it in CUDD's
# cache.
cdef struct Mapping:
    int* to
    int size
    DdNode* key

# Tags of three-operand operations, as cuddInt.h describes them; CUDD itself uses 0x02 to 0xa2.
cdef enum:
    TAG_ITE = 0xA6
    TAG_SUM_PRODUCT = 0xAA
    TAG_IMAGE = 0xAE
    TAG_PREIMAGE = 0xC2
    TAG_SATURATE = 0xC6


cdef inline DdNode* regular(DdNode* n) noexcept nogil:
    return <DdNode*>(<uintptr_t>n & ~<uintptr_t>1)

cdef inline DdNode* negate(DdNode* n) noexcept nogil:
    return <DdNode*>(<uintptr_t>n ^ 1)

cdef inline uintptr_t sign(DdNode* n) noexcept nogil:
    return <uintptr_t>n & 1

cdef inline DdNode* signed(DdNode* n, uintptr_t s) noexcept nogil:
    return <DdNode*>(<uintptr_t>n ^ s)

cdef inline void reference(DdNode* n) noexcept nogil:
    regular(n).ref += 1

cdef inline void dereference(DdNode* n) noexcept nogil:
    regular(n).ref -= 1

cdef inline DdNode* referenced(DdNode* n) noexcept nogil:
    """The node, referenced; NULL stays NULL."""
    if n is not NULL:
        regular(n).ref += 1
    return n

cdef inline DdNode* released(Env* e, DdNode* n, DdNode* result) noexcept nogil:
    """The result, after the reference of another node was released; both may be NULL."""
    referenced(result)
    if n is not NULL:
        Cudd_RecursiveDeref(e.dd, n)
    if result is not NULL:
        dereference(result)
    return result

cdef inline int level_of(Env* e, DdNode* n) noexcept nogil:
    cdef unsigned int index = regular(n).index
    return CONSTANT if index == CONSTANT else e.perm[index]

cdef inline bint stop_requested(Env* e) noexcept nogil:
    e.steps += 1
    return (e.steps & STEPS_PER_CHECK) == 0 and should_stop(e)


cdef inline DdNode* mtbdd_node(Env* e, int index, DdNode* t, DdNode* u) noexcept nogil:
    """The MTBDD node with these children, whose references are consumed; NULL if one is NULL."""
    cdef DdNode* r
    if t is NULL or u is NULL:
        return released(e, t, released(e, u, NULL))
    r = t if t is u else cuddUniqueInter(e.dd, index, t, u)
    if r is NULL:
        return released(e, t, released(e, u, NULL))
    dereference(t)
    dereference(u)
    return r


cdef inline DdNode* bdd_node(Env* e, int index, DdNode* t, DdNode* u) noexcept nogil:
    """The BDD node with these children, whose references are consumed; its then-edge is regular."""
    cdef uintptr_t s = sign(t)
    if u is not NULL:
        u = signed(u, s)
    cdef DdNode* r = mtbdd_node(e, index, signed(t, s), u)
    return NULL if r is NULL else signed(r, s)


cdef inline DdNode* leaf(Env* e, double value) noexcept nogil:
    """The leaf with this value; NULL for NaN."""
    cdef DdNode* r
    if value == 0:
        return e.zero            # also for -0.0, which would be a second zero
    if value != value:
        e.reason = UNDEFINED
        return NULL
    # CUDD counts a leaf before it allocates it: a stop in between would leave a wrong count.
    e.uninterruptible = True
    r = cuddUniqueConst(e.dd, value)
    e.uninterruptible = False
    return r


cdef inline void mtbdd_cofactors(Env* e, DdNode* f, int level, DdNode** t, DdNode** u) noexcept nogil:
    """The cofactors of an MTBDD by the variable at `level`, which is not below its top variable."""
    if f.index != CONSTANT and e.perm[f.index] == level:
        t[0] = f.type.kids.T
        u[0] = f.type.kids.E
    else:
        t[0] = f
        u[0] = f


cdef inline void bdd_cofactors(Env* e, DdNode* f, int level, DdNode** t, DdNode** u) noexcept nogil:
    """The cofactors of a BDD by the variable at `level`, which is not below its top variable."""
    cdef DdNode* n = regular(f)
    if n.index != CONSTANT and e.perm[n.index] == level:
        t[0] = signed(n.type.kids.T, sign(f))
        u[0] = signed(n.type.kids.E, sign(f))
    else:
        t[0] = f
        u[0] = f


cdef inline DdNode* truth(Env* e, bint value) noexcept nogil:
    return e.one if value else e.logic_zero


cdef DdNode* apply_terminal(Env* e, Op op, DdNode* f, DdNode* g) noexcept nogil:
    """The result of a terminal case, else NULL; NULL with e.reason set for an undefined result."""
    cdef double a, b
    if op == PLUS:
        if f is e.zero: return g
        if g is e.zero: return f
    elif op == TIMES:
        if f is e.zero or g is e.zero: return e.zero
        if f is e.one: return g
        if g is e.one: return f
    elif op == MINUS:
        if g is e.zero: return f     # f - f is no terminal case: infinity - infinity is undefined
    elif op == DIVIDE:
        if f is e.zero: return f
        if g is e.one: return f
    elif op == MINIMUM or op == MAXIMUM:
        if f is g: return f
    elif op >= LESS and f is g:
        return truth(e, op != LESS)
    if f.index != CONSTANT or g.index != CONSTANT:
        return NULL
    a = f.type.value
    b = g.type.value
    if op == PLUS: return leaf(e, a + b)
    if op == TIMES: return leaf(e, a * b)
    if op == MINUS: return leaf(e, a - b)
    if op == DIVIDE: return leaf(e, a / b)
    if op == MINIMUM: return f if a <= b else g
    if op == MAXIMUM: return f if a >= b else g
    if op == LESS: return truth(e, a < b)
    if op == LESS_EQUAL: return truth(e, a <= b)
    return truth(e, a == b)


cdef DdNode* apply(Env* e, Op op, DdNode* f, DdNode* g) noexcept nogil:
    """f op g, pointwise. 0 times and 0 divided by anything is 0, as in sparse matrices."""
    cdef Ref r, t, u, ft, fu, gt, gu
    cdef int lf, lg, index
    r = apply_terminal(e, op, f, g)
    if r is not NULL or (f.index == CONSTANT and g.index == CONSTANT):
        return r
    if f > g and op in (PLUS, TIMES, MINIMUM, MAXIMUM, EQUAL):
        f, g = g, f
    r = cuddCacheLookup2(e.dd, &_ops[<int>op], f, g)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lf = level_of(e, f)
    lg = level_of(e, g)
    index = f.index if lf <= lg else g.index
    mtbdd_cofactors(e, f, min(lf, lg), &ft, &fu)
    mtbdd_cofactors(e, g, min(lf, lg), &gt, &gu)
    t = referenced(apply(e, op, ft, gt))
    u = NULL if t is NULL else referenced(apply(e, op, fu, gu))
    r = bdd_node(e, index, t, u) if op >= LESS else mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert2(e.dd, &_ops[<int>op], f, g, r)
    return r


cdef DdNode* ite(Env* e, DdNode* f, DdNode* g, DdNode* h) noexcept nogil:
    """The MTBDD g on the set f, h elsewhere."""
    cdef Ref r, t, u, ft, fu, gt, gu, ht, hu
    cdef int lf, l, index
    if f is e.one or g is h:
        return g
    if f is e.logic_zero:
        return h
    if sign(f):
        f = negate(f)
        g, h = h, g
    r = cuddCacheLookup(e.dd, TAG_ITE, f, g, h)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lf = level_of(e, f)
    l = min(level_of(e, g), level_of(e, h))
    index = f.index if lf <= l else (g.index if level_of(e, g) == l else h.index)
    l = min(l, lf)
    bdd_cofactors(e, f, l, &ft, &fu)
    mtbdd_cofactors(e, g, l, &gt, &gu)
    mtbdd_cofactors(e, h, l, &ht, &hu)
    t = referenced(ite(e, ft, gt, ht))
    u = NULL if t is NULL else referenced(ite(e, fu, gu, hu))
    r = mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert(e.dd, TAG_ITE, f, g, h, r)
    return r


cdef DdNode* sum_owned(Env* e, DdNode* t, DdNode* u) noexcept nogil:
    """t + u; their references are consumed."""
    cdef DdNode* r = NULL if t is NULL or u is NULL else apply(e, PLUS, t, u)
    return released(e, t, released(e, u, r))


cdef DdNode* sum_product(Env* e, DdNode* f, DdNode* g, DdNode* cube) noexcept nogil:
    """Sum over the cube's variables of f times g, without building the product."""
    cdef Ref r, t, u, ft, fu, gt, gu
    cdef int l, lf, lg, index, doublings = 0
    if f is e.zero or g is e.zero:
        return e.zero
    if cube is e.one:
        return apply(e, TIMES, f, g)
    if f.index == CONSTANT and g.index == CONSTANT:
        while cube is not e.one:
            doublings += 1
            cube = cube.type.kids.T
        return leaf(e, ldexp(f.type.value * g.type.value, doublings))
    if f > g:
        f, g = g, f
    r = cuddCacheLookup(e.dd, TAG_SUM_PRODUCT, f, g, cube)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lf = level_of(e, f)
    lg = level_of(e, g)
    l = min(lf, lg)
    if level_of(e, cube) < l:
        t = referenced(sum_product(e, f, g, cube.type.kids.T))
        r = sum_owned(e, t, referenced(t))
    else:
        index = f.index if lf <= lg else g.index
        u = cube.type.kids.T if level_of(e, cube) == l else cube
        mtbdd_cofactors(e, f, l, &ft, &fu)
        mtbdd_cofactors(e, g, l, &gt, &gu)
        t = referenced(sum_product(e, ft, gt, u))
        u = NULL if t is NULL else referenced(sum_product(e, fu, gu, u))
        r = sum_owned(e, t, u) if level_of(e, cube) == l else mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert(e.dd, TAG_SUM_PRODUCT, f, g, cube, r)
    return r
