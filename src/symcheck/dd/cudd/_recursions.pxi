# Recursions that the wheel's CUDD lacks, in CUDD's conventions: the result is not referenced for
# the caller, intermediate results are referenced before the next allocation, and NULL means
# stopped. The depth is at most the number of levels. `_owned`: the references of the arguments are
# consumed. `_referenced`: the result is referenced.

cdef enum Op:
    PLUS, TIMES, MINUS, DIVIDE, MINIMUM, MAXIMUM, POWER, MODULO
    LESS, LESS_EQUAL, EQUAL
    MASKED, TO_BDD, PERMUTE_BDD, PERMUTE_ADD
    SUM_OVER, MAX_OVER, MIN_OVER

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

cdef inline int level_of(Env* e, DdNode* n) noexcept nogil:
    cdef unsigned int index = regular(n).index
    return CONSTANT if index == CONSTANT else e.perm[index]

cdef inline bint stop_requested(Env* e) noexcept nogil:
    e.steps += 1
    return (e.steps & STEPS_PER_CHECK) == 0 and should_stop(e)


cdef inline DdNode* mtbdd_node(Env* e, int index, DdNode* t, DdNode* u) noexcept nogil:
    """The MTBDD node with these children, whose references are consumed."""
    cdef DdNode* r
    if t is u:
        dereference(t)
        dereference(u)
        return t
    r = cuddUniqueInter(e.dd, index, t, u)
    if r is NULL:
        Cudd_RecursiveDeref(e.dd, t)
        Cudd_RecursiveDeref(e.dd, u)
        return NULL
    dereference(t)
    dereference(u)
    return r


cdef inline DdNode* bdd_node(Env* e, int index, DdNode* t, DdNode* u) noexcept nogil:
    """The BDD node with these children, whose references are consumed; its then-edge is regular."""
    cdef uintptr_t s = sign(t)
    cdef DdNode* r = mtbdd_node(e, index, signed(t, s), signed(u, s))
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


cdef inline double modulo(double a, double b) noexcept nogil:
    cdef double r = fmod(a, b)
    return r + b if r != 0 and (r < 0) != (b < 0) else r


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
    elif op == POWER:
        if g is e.zero: return e.one
        if g is e.one: return f
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
    if op == POWER: return leaf(e, pow(a, b))
    return leaf(e, modulo(a, b))


cdef DdNode* apply(Env* e, Op op, DdNode* f, DdNode* g) noexcept nogil:
    """f op g, pointwise. 0 times and 0 divided by anything is 0, as in sparse matrices."""
    cdef Ref r, t, u, ft, fu, gt, gu
    cdef int lf, lg, index
    r = apply_terminal(e, op, f, g)
    if r is not NULL:
        return r
    if f.index == CONSTANT and g.index == CONSTANT:
        return NULL
    if f > g and op in (PLUS, TIMES, MINIMUM, MAXIMUM):
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
    t = apply(e, op, ft, gt)
    if t is NULL:
        return NULL
    reference(t)
    u = apply(e, op, fu, gu)
    if u is NULL:
        Cudd_RecursiveDeref(e.dd, t)
        return NULL
    reference(u)
    r = mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert2(e.dd, &_ops[<int>op], f, g, r)
    return r


cdef DdNode* compare(Env* e, Op op, DdNode* f, DdNode* g) noexcept nogil:
    """The BDD of the assignments with f op g."""
    cdef Ref r, t, u, ft, fu, gt, gu
    cdef int lf, lg, index
    cdef double a, b
    if f is g:
        return e.logic_zero if op == LESS else e.one
    if f.index == CONSTANT and g.index == CONSTANT:
        a = f.type.value
        b = g.type.value
        return e.one if (a < b if op == LESS else a <= b if op == LESS_EQUAL else a == b) else e.logic_zero
    if op == EQUAL and f > g:
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
    t = compare(e, op, ft, gt)
    if t is NULL:
        return NULL
    reference(t)
    u = compare(e, op, fu, gu)
    if u is NULL:
        Cudd_IterDerefBdd(e.dd, t)
        return NULL
    reference(u)
    r = bdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert2(e.dd, &_ops[<int>op], f, g, r)
    return r


cdef DdNode* to_bdd(Env* e, DdNode* f) noexcept nogil:
    """The BDD of the assignments with f != 0."""
    cdef Ref r, t, u
    if f.index == CONSTANT:
        return e.logic_zero if f is e.zero else e.one
    r = cuddCacheLookup1(e.dd, &_ops[<int>TO_BDD], f)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    t = to_bdd(e, f.type.kids.T)
    if t is NULL:
        return NULL
    reference(t)
    u = to_bdd(e, f.type.kids.E)
    if u is NULL:
        Cudd_IterDerefBdd(e.dd, t)
        return NULL
    reference(u)
    r = bdd_node(e, f.index, t, u)
    if r is not NULL:
        cuddCacheInsert1(e.dd, &_ops[<int>TO_BDD], f, r)
    return r


cdef DdNode* masked(Env* e, DdNode* m, DdNode* f) noexcept nogil:
    """m on the set f, 0 elsewhere."""
    cdef Ref r, t, u, mt, mu, ft, fu
    cdef int lm, lf, index
    if f is e.one or m is e.zero:
        return m
    if f is e.logic_zero:
        return e.zero
    r = cuddCacheLookup2(e.dd, &_ops[<int>MASKED], m, f)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lm = level_of(e, m)
    lf = level_of(e, f)
    index = m.index if lm <= lf else regular(f).index
    mtbdd_cofactors(e, m, min(lm, lf), &mt, &mu)
    bdd_cofactors(e, f, min(lm, lf), &ft, &fu)
    t = masked(e, mt, ft)
    if t is NULL:
        return NULL
    reference(t)
    u = masked(e, mu, fu)
    if u is NULL:
        Cudd_RecursiveDeref(e.dd, t)
        return NULL
    reference(u)
    r = mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert2(e.dd, &_ops[<int>MASKED], m, f, r)
    return r


cdef DdNode* ite(Env* e, DdNode* f, DdNode* g, DdNode* h) noexcept nogil:
    """The MTBDD g on the set f, h elsewhere."""
    cdef Ref r, t, u, ft, fu, gt, gu, ht, hu
    cdef int lf, l, index
    if f is e.one or g is h:
        return g
    if f is e.logic_zero:
        return h
    if h is e.zero:
        return masked(e, g, f)
    if g is e.zero:
        return masked(e, h, negate(f))
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
    t = ite(e, ft, gt, ht)
    if t is NULL:
        return NULL
    reference(t)
    u = ite(e, fu, gu, hu)
    if u is NULL:
        Cudd_RecursiveDeref(e.dd, t)
        return NULL
    reference(u)
    r = mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert(e.dd, TAG_ITE, f, g, h, r)
    return r


cdef DdNode* apply_owned(Env* e, Op op, DdNode* t, DdNode* u) noexcept nogil:
    """t op u; the references of t and u are consumed."""
    cdef DdNode* r = apply(e, op, t, u)
    if r is not NULL:
        reference(r)
    Cudd_RecursiveDeref(e.dd, t)
    Cudd_RecursiveDeref(e.dd, u)
    if r is not NULL:
        dereference(r)
    return r


cdef DdNode* scaled(Env* e, DdNode* f, DdNode* cube) noexcept nogil:
    """The leaf f times 2**k, for k variables in the cube."""
    cdef int k = 0
    while cube is not e.one:
        k += 1
        cube = cube.type.kids.T
    return leaf(e, ldexp(f.type.value, k))


cdef DdNode* abstract(Env* e, Op over, DdNode* f, DdNode* cube) noexcept nogil:
    """Sum, maximum or minimum of f over the assignments of the variables in the (BDD) cube."""
    cdef Ref r, t, u, rest
    cdef int lf, lc
    cdef Op op = PLUS if over == SUM_OVER else MAXIMUM if over == MAX_OVER else MINIMUM
    if over == SUM_OVER:
        if f is e.zero or cube is e.one:
            return f
        if f.index == CONSTANT:
            return scaled(e, f, cube)
    else:
        while cube is not e.one and level_of(e, cube) < level_of(e, f):
            cube = cube.type.kids.T
        if cube is e.one:
            return f
    r = cuddCacheLookup2(e.dd, &_ops[<int>over], f, cube)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lf = level_of(e, f)
    lc = level_of(e, cube)
    if lc < lf:
        t = abstract(e, over, f, cube.type.kids.T)
        if t is NULL:
            return NULL
        reference(t)
        reference(t)
        r = apply_owned(e, op, t, t)
    else:
        rest = cube.type.kids.T if lc == lf else cube
        t = abstract(e, over, f.type.kids.T, rest)
        if t is NULL:
            return NULL
        reference(t)
        u = abstract(e, over, f.type.kids.E, rest)
        if u is NULL:
            Cudd_RecursiveDeref(e.dd, t)
            return NULL
        reference(u)
        r = apply_owned(e, op, t, u) if lc == lf else mtbdd_node(e, f.index, t, u)
    if r is not NULL:
        cuddCacheInsert2(e.dd, &_ops[<int>over], f, cube, r)
    return r


cdef DdNode* sum_product(Env* e, DdNode* f, DdNode* g, DdNode* cube) noexcept nogil:
    """Sum over the cube's variables of f times g, without building the product."""
    cdef Ref r, t, u, ft, fu, gt, gu, rest = cube
    cdef int l, lf, lg, lc, index
    if f is e.zero or g is e.zero:
        return e.zero
    if cube is e.one:
        return apply(e, TIMES, f, g)
    if f is e.one:
        return abstract(e, SUM_OVER, g, cube)
    if g is e.one:
        return abstract(e, SUM_OVER, f, cube)
    if f.index == CONSTANT and g.index == CONSTANT:
        t = leaf(e, f.type.value * g.type.value)
        if t is NULL:
            return NULL
        reference(t)
        r = scaled(e, t, cube)
        if r is not NULL:
            reference(r)
        Cudd_RecursiveDeref(e.dd, t)
        if r is not NULL:
            dereference(r)
        return r
    if f > g:
        f, g = g, f
    r = cuddCacheLookup(e.dd, TAG_SUM_PRODUCT, f, g, cube)
    if r is not NULL:
        return r
    if stop_requested(e):
        return NULL
    lf = level_of(e, f)
    lg = level_of(e, g)
    lc = level_of(e, cube)
    l = min(lf, lg)
    index = f.index if lf <= lg else g.index
    if lc < l:
        t = sum_product(e, f, g, cube.type.kids.T)
        if t is NULL:
            return NULL
        reference(t)
        reference(t)
        r = apply_owned(e, PLUS, t, t)
    else:
        if lc == l:
            rest = cube.type.kids.T
        mtbdd_cofactors(e, f, l, &ft, &fu)
        mtbdd_cofactors(e, g, l, &gt, &gu)
        t = sum_product(e, ft, gt, rest)
        if t is NULL:
            return NULL
        reference(t)
        u = sum_product(e, fu, gu, rest)
        if u is NULL:
            Cudd_RecursiveDeref(e.dd, t)
            return NULL
        reference(u)
        r = apply_owned(e, PLUS, t, u) if lc == l else mtbdd_node(e, index, t, u)
    if r is not NULL:
        cuddCacheInsert(e.dd, TAG_SUM_PRODUCT, f, g, cube, r)
    return r
