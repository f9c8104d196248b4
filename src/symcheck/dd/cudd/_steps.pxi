# Renaming, images and preimages; in the conventions of _recursions.pxi.

cdef DdNode* permute(Env* e, bint boolean, DdNode* f, Mapping* map) noexcept nogil:
    """Rename variables.

    A node whose new variable is above its new children, as after a swap of neighbours, is built
    directly; any other is composed by if-then-else.
    """
    cdef Ref r, t, u, n = regular(f), x
    cdef Op op = PERMUTE_BDD if boolean else PERMUTE_ADD
    cdef int index
    if n.index == CONSTANT:
        return f
    r = cuddCacheLookup2(e.dd, &_ops[<int>op], n, map.key)
    if r is not NULL:
        return signed(r, sign(f))
    if stop_requested(e):
        return NULL
    t = referenced(permute(e, boolean, n.type.kids.T, map))
    u = NULL if t is NULL else referenced(permute(e, boolean, n.type.kids.E, map))
    index = map.to[n.index] if <int>n.index < map.size else n.index
    if u is NULL:
        return released(e, t, NULL)
    if e.perm[index] < min(level_of(e, t), level_of(e, u)):
        r = bdd_node(e, index, t, u) if boolean else mtbdd_node(e, index, t, u)
    else:
        x = Cudd_bddIthVar(e.dd, index)
        r = cuddBddIteRecur(e.dd, x, t, u) if boolean else ite(e, x, t, u)
        r = released(e, t, released(e, u, r))
    if r is NULL:
        return NULL
    cuddCacheInsert2(e.dd, &_ops[<int>op], n, map.key, r)
    return signed(r, sign(f))


cdef DdNode* union_owned(Env* e, DdNode* t, DdNode* u) noexcept nogil:
    """t or u, referenced; their references are consumed."""
    cdef DdNode* r = NULL
    if t is not NULL and u is not NULL:
        r = cuddBddAndRecur(e.dd, negate(t), negate(u))
    r = released(e, t, released(e, u, r))
    return NULL if r is NULL else referenced(negate(r))


cdef DdNode* step_union(Env* e, bint forward, DdNode* s0, DdNode* r0, DdNode* s1, DdNode* r1,
                        DdNode* pairs) noexcept nogil:
    """The union of the steps (s0, r0) and (s1, r1), referenced."""
    cdef DdNode* t = referenced(relation_step(e, forward, s0, r0, pairs))
    if t is NULL or t is e.one:
        return t
    return union_owned(e, t, referenced(relation_step(e, forward, s1, r1, pairs)))


cdef DdNode* relation_step(Env* e, bint forward, DdNode* s, DdNode* r, DdNode* pairs) noexcept nogil:
    """The image (forward) or preimage of the set s under the relation r.

    `pairs` is the cube of the touched variables: each row variable is directly followed by its
    column variable. Variables that are not touched keep their values. Quantification and renaming
    are done in the same recursion (relnext and relprev of van Dijk and van de Pol, Sylvan, TACAS
    2015), so that no intermediate diagram over columns is built.
    """
    cdef Ref result, t, u, s0, s1, a, b, r00, r01, r10, r11
    cdef int ls, lr, l, row, index
    cdef uintptr_t tag = TAG_IMAGE if forward else TAG_PREIMAGE
    if s is e.logic_zero or r is e.logic_zero:
        return e.logic_zero
    ls = level_of(e, s)
    lr = level_of(e, r)
    l = min(ls, lr)
    while pairs is not e.one and e.perm[pairs.index] + 1 < l:
        pairs = pairs.type.kids.T.type.kids.T
    if pairs is e.one:
        return cuddBddAndRecur(e.dd, s, r)
    result = cuddCacheLookup(e.dd, tag, s, r, pairs)
    if result is not NULL:
        return result
    if stop_requested(e):
        return NULL
    row = e.perm[pairs.index]
    if l < row:
        index = regular(s).index if ls <= lr else regular(r).index
        bdd_cofactors(e, s, l, &s1, &s0)
        bdd_cofactors(e, r, l, &a, &b)
        t = referenced(relation_step(e, forward, s1, a, pairs))
        u = NULL if t is NULL else referenced(relation_step(e, forward, s0, b, pairs))
    else:
        index = pairs.index
        bdd_cofactors(e, s, row, &s1, &s0)
        bdd_cofactors(e, r, row, &a, &b)
        bdd_cofactors(e, a, row + 1, &r11, &r10)
        bdd_cofactors(e, b, row + 1, &r01, &r00)
        a = pairs.type.kids.T.type.kids.T
        if not forward:
            r01, r10 = r10, r01
        t = step_union(e, forward, s0, r01, s1, r11, a)
        u = NULL if t is NULL else step_union(e, forward, s0, r00, s1, r10, a)
    result = bdd_node(e, index, t, u)
    if result is not NULL:
        cuddCacheInsert(e.dd, tag, s, r, pairs, result)
    return result
