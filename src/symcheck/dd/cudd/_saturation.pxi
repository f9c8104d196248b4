# Closing a set under relations, node by node (saturation); in the conventions of _cudd_recursions.pxi.
#
# The set under a node is closed under what does not change the variables above it, before anything above is applied again.
# What a relation does to the variable at hand has four parts: the two that keep its value are relations of the variables
# below, and are left to the two children (so adding one to a counter, which mostly changes low bits, works mostly down
# there); the two that change it are applied here. A variable that a relation only reads is kept. After Ciardo, Luettgen
# & Siminiscalco (2001), with the constraint of Zhao & Ciardo (2009): a family of relations is what saturation calls the
# events below a level, here as they are for the values above that led there.

cdef struct Part:
    DdNode* relation             # referenced
    DdNode* pairs                # referenced: the cube of the variables touched, as relation_step takes it

cdef struct Family:
    Part* parts                  # ordered by their pairs, which are different
    int count
    int level                    # of the topmost variable that a part touches or reads
    DdNode* key                  # a constant that stands for the family in CUDD's cache
    Family* low                  # where that variable is and stays 0 or 1; both NULL until asked for
    Family* high
    Part* moves                  # first those from 0 to 1, then those from 1 to 0, in the direction of the search
    int ups
    int downs
    Family* next                 # in the same slot of the table
    uint64_t hash

cdef struct Families:
    Env* e
    Family** slots
    long size
    long count
    long limit                   # of families
    long nodes                   # live nodes at which to give up
    double deadline              # time at which to give up
    double last                  # look-up in CUDD's cache at which to give up: what all work comes down to
    bint forward
    bint fresh                   # move only what is new, and close it by itself
    bint gave_up
    unsigned long steps
    unsigned long* keys


cdef enum:
    GLANCES = 0x3F               # the limits of one search are looked at once in so many steps


cdef bint too_much(Families* all) noexcept nogil:
    """Whether to give up, looked at now and then."""
    all.steps += 1
    if (all.steps & GLANCES) == 0:
        all.gave_up |= <long>(Cudd_ReadKeys(all.e.dd) - Cudd_ReadDead(all.e.dd)) > all.nodes or now() > all.deadline
        all.gave_up |= Cudd_ReadCacheLookUps(all.e.dd) > all.last
    return all.gave_up


cdef int compare_pairs(Env* e, DdNode* p, DdNode* q) noexcept nogil:
    """An order of cubes that does not depend on addresses: by their levels, topmost first."""
    while p is not q:
        if level_of(e, p) != level_of(e, q):
            return -1 if level_of(e, p) < level_of(e, q) else 1
        p = p.type.kids.T
        q = q.type.kids.T
    return 0


cdef bint add_part(Env* e, Part* parts, int* count, DdNode* relation, DdNode* pairs, bint moves=False) noexcept nogil:
    """Unite the relation with the part of the same pairs, or insert it as a part. False: stopped.

    What changes no variable is left out, unless it `moves` by the variable above.
    """
    cdef int a = 0, b = count[0], middle, order
    cdef Ref r
    if relation is e.no or (pairs is e.one and not moves):
        return True
    while a < b:
        middle = (a + b) >> 1
        order = compare_pairs(e, parts[middle].pairs, pairs)
        if order == 0:
            r = cuddBddAndRecur(e.dd, negate(parts[middle].relation), negate(relation))
            if r is NULL:
                return False
            take(r)
            Cudd_IterDerefBdd(e.dd, parts[middle].relation)
            parts[middle].relation = negate(r)
            return True
        if order < 0:
            a = middle + 1
        else:
            b = middle
    for middle in range(count[0], a, -1):
        parts[middle] = parts[middle - 1]
    parts[a].relation = relation
    parts[a].pairs = pairs
    take(relation)
    take(pairs)
    count[0] += 1
    return True


cdef void drop_parts(Env* e, Part* parts, int count) noexcept nogil:
    cdef int i
    for i in range(count):
        Cudd_IterDerefBdd(e.dd, parts[i].relation)
        Cudd_IterDerefBdd(e.dd, parts[i].pairs)
    free(parts)


cdef bint enlarge(Families* all) noexcept nogil:
    cdef long i, size = 2 * all.size
    cdef Family* f
    cdef Family* following
    cdef Family** slots = <Family**>calloc(size, sizeof(Family*))
    if slots is NULL:
        return False
    for i in range(all.size):
        f = all.slots[i]
        while f is not NULL:
            following = f.next
            f.next = slots[f.hash & (size - 1)]
            slots[f.hash & (size - 1)] = f
            f = following
    free(all.slots)
    all.slots = slots
    all.size = size
    return True


cdef Family* family_of(Families* all, Part* parts, int count) noexcept nogil:
    """The family of these parts, which are consumed; NULL: stopped, or too many families."""
    cdef Env* e = all.e
    cdef uint64_t hash = 1469598103, factor = 1099511627
    factor = factor << 8 | 0xB3
    cdef int i
    cdef Family* f
    for i in range(count):
        hash = (hash ^ <uint64_t><uintptr_t>parts[i].relation) * factor
        hash = (hash ^ <uint64_t><uintptr_t>parts[i].pairs) * factor
    hash ^= hash >> 29
    f = all.slots[hash & (all.size - 1)]
    while f is not NULL:
        if f.hash == hash and f.count == count and memcmp(f.parts, parts, count * sizeof(Part)) == 0:
            drop_parts(e, parts, count)
            return f
        f = f.next
    if all.count >= all.limit:
        all.gave_up = True
    elif all.count < all.size or enlarge(all):
        f = <Family*>calloc(1, sizeof(Family))
    if f is not NULL:
        all.keys[0] += 1
        f.key = cuddUniqueConst(e.dd, 2.0 + <double>all.keys[0])
    if f is NULL or f.key is NULL:
        if f is NULL and not all.gave_up:
            e.reason = NO_MEMORY
        free(f)
        drop_parts(e, parts, count)
        return NULL
    take(f.key)
    f.parts = parts
    f.count = count
    f.level = CONSTANT
    for i in range(count):
        f.level = min(f.level, min(level_of(e, parts[i].relation), level_of(e, parts[i].pairs)))
    f.hash = hash
    f.next = all.slots[hash & (all.size - 1)]
    all.slots[hash & (all.size - 1)] = f
    all.count += 1
    return f


cdef void drop_families(Families* all) noexcept nogil:
    cdef long i
    cdef Family* f
    cdef Family* following
    for i in range(all.size):
        f = all.slots[i]
        while f is not NULL:
            following = f.next
            drop_parts(all.e, f.parts, f.count)
            drop_parts(all.e, f.moves, f.ups + f.downs)
            Cudd_RecursiveDeref(all.e.dd, f.key)
            free(f)
            f = following
    free(all.slots)
    all.slots = NULL
    all.size = all.count = 0


cdef bint split_parts(Families* all, Family* f, Part* low, Part* high, Part* up, Part* down, int* n) noexcept nogil:
    """Fill the four lists of parts, whose lengths are in n. False: stopped."""
    cdef Env* e = all.e
    cdef Part p
    cdef Ref a, b, r00, r01, r10, r11, rest
    cdef int i
    for i in range(f.count):
        p = f.parts[i]
        if min(level_of(e, p.relation), level_of(e, p.pairs)) > f.level:
            if not (add_part(e, low, &n[0], p.relation, p.pairs) and add_part(e, high, &n[1], p.relation, p.pairs)):
                return False
            continue
        split_bdd(e, p.relation, f.level, &a, &b)
        if level_of(e, p.pairs) > f.level:
            if not (add_part(e, low, &n[0], b, p.pairs) and add_part(e, high, &n[1], a, p.pairs)):
                return False
            continue
        split_bdd(e, a, f.level + 1, &r11, &r10)
        split_bdd(e, b, f.level + 1, &r01, &r00)
        rest = p.pairs.type.kids.T.type.kids.T
        if not all.forward:
            r01, r10 = r10, r01
        if not (add_part(e, low, &n[0], r00, rest) and add_part(e, high, &n[1], r11, rest)):
            return False
        if not (add_part(e, up, &n[2], r01, rest, True) and add_part(e, down, &n[3], r10, rest, True)):
            return False
    return True


cdef bint split_family(Families* all, Family* f) noexcept nogil:
    """Find what the family is below its topmost variable, and what changes that. False: stopped."""
    cdef int* n = <int*>calloc(4, sizeof(int))
    cdef Part* lists[4]
    cdef int i
    cdef bint done = n is not NULL
    for i in range(4):
        lists[i] = <Part*>malloc((2 * f.count if i == 2 else f.count) * sizeof(Part))
        done = done and lists[i] is not NULL
    if not done:
        all.e.reason = NO_MEMORY
        for i in range(4):
            free(lists[i])
        free(n)
        return False
    done = split_parts(all, f, lists[0], lists[1], lists[2], lists[3], n)
    if done:
        # Both kinds of moves in one list.
        memcpy(lists[2] + n[2], lists[3], n[3] * sizeof(Part))
        free(lists[3])
        f.moves = lists[2]
        f.ups = n[2]
        f.downs = n[3]
        f.low = family_of(all, lists[0], n[0])
        if f.low is not NULL:
            f.high = family_of(all, lists[1], n[1])
        else:
            drop_parts(all.e, lists[1], n[1])
        done = f.low is not NULL and f.high is not NULL
        if not done:
            drop_parts(all.e, f.moves, f.ups + f.downs)
            f.moves = NULL
            f.ups = f.downs = 0
            f.low = f.high = NULL
    else:
        for i in range(4):
            drop_parts(all.e, lists[i], n[i])
    free(n)
    return done


cdef DdNode* moved(Families* all, Part* moves, int count, DdNode* source, DdNode* target, DdNode* within) noexcept nogil:
    """The target (whose reference is consumed) with what the moves make of the source, as far as that is within; referenced."""
    cdef Env* e = all.e
    cdef Ref x, y
    cdef int i
    for i in range(count):
        x = relation_step(e, all.forward, source, moves[i].relation, moves[i].pairs)
        if x is NULL:
            Cudd_IterDerefBdd(e.dd, target)
            return NULL
        take(x)
        y = cuddBddAndRecur(e.dd, x, within)
        if y is not NULL:
            take(y)
        Cudd_IterDerefBdd(e.dd, x)
        target = disjoined(e, target, y)
        if target is NULL:
            return NULL
        take(target)
    return target


cdef DdNode* closed_again(Families* all, Family* f, DdNode* s, DdNode* within) noexcept nogil:
    """closed(), of a referenced set whose reference is consumed (NULL: stopped before); the result is referenced."""
    cdef DdNode* r
    if s is NULL:
        return NULL
    r = closed(all, f, s, within)
    if r is not NULL:
        take(r)
    Cudd_IterDerefBdd(all.e.dd, s)
    return r


cdef DdNode* closed(Families* all, Family* f, DdNode* s, DdNode* within) noexcept nogil:
    """The least set that contains s, and with a state what the family's relations make of it, as far as that is within."""
    cdef Env* e = all.e
    cdef Ref r, t, u, s0, s1, w0, w1
    cdef int l, index
    if f.count == 0 or s is e.no or s is e.one or s is within or within is e.no:
        return s
    r = cuddCacheLookup(e.dd, TAG_CLOSED, s, f.key, within)
    if r is not NULL:
        return r
    if tick(e) or too_much(all):
        return NULL
    l = min(level_of(e, s), level_of(e, within))
    if l < f.level:
        split_bdd(e, s, l, &s1, &s0)
        split_bdd(e, within, l, &w1, &w0)
        index = regular(s).index if level_of(e, s) == l else regular(within).index
        t = closed(all, f, s1, w1)
        if t is NULL:
            return NULL
        take(t)
        u = closed(all, f, s0, w0)
        if u is NULL:
            Cudd_IterDerefBdd(e.dd, t)
            return NULL
        take(u)
    else:
        if f.low is NULL and not split_family(all, f):
            return NULL
        split_bdd(e, s, f.level, &s1, &s0)
        split_bdd(e, within, f.level, &w1, &w0)
        index = Cudd_ReadInvPerm(e.dd, f.level)
        take(s1)
        t = closed_again(all, f.high, s1, w1)
        if t is NULL:
            return NULL
        take(s0)
        u = closed_again(all, f.low, s0, w0)
        if u is NULL:
            Cudd_IterDerefBdd(e.dd, t)
            return NULL
        if not exchange(all, f, &t, &u, w1, w0):
            return NULL
    r = bdd_node(e, index, t, u)
    if r is not NULL:
        take(r)
        cuddCacheInsert(e.dd, TAG_CLOSED, s, f.key, within, r)
        if r is not s:
            cuddCacheInsert(e.dd, TAG_CLOSED, r, f.key, within, r)
        give(r)
    return r


cdef bint exchange(Families* all, Family* f, DdNode** t, DdNode** u, DdNode* w1, DdNode* w0) noexcept nogil:
    """Move between the two (referenced) children until nothing is new; on False (stopped) their references are gone."""
    cdef Env* e = all.e
    cdef Ref new_t = t[0], new_u = u[0]
    cdef bint done = True
    take(new_t)
    take(new_u)
    while done and (new_u is not e.no or new_t is not e.no):
        # Steps may all be remembered ones, and very many.
        done = not (tick(e) or too_much(all))
        done = done and spread(all, f.high, f.moves, f.ups, u[0], &new_u, t, &new_t, w1)
        done = done and spread(all, f.low, f.moves + f.ups, f.downs, t[0], &new_t, u, &new_u, w0)
    drop(e, new_t)
    drop(e, new_u)
    if not done:
        drop(e, t[0])
        drop(e, u[0])
    return done


cdef inline void drop(Env* e, DdNode* n) noexcept nogil:
    if n is not NULL:
        Cudd_IterDerefBdd(e.dd, n)


cdef DdNode* minus(Env* e, DdNode* a, DdNode* b) noexcept nogil:
    """a without b, referenced; a's reference is consumed (it may be NULL)."""
    cdef DdNode* r
    if a is NULL:
        return NULL
    r = cuddBddAndRecur(e.dd, a, negate(b))
    if r is not NULL:
        take(r)
    Cudd_IterDerefBdd(e.dd, a)
    return r


cdef DdNode* plus(Env* e, DdNode* a, DdNode* b) noexcept nogil:
    """a and b united, referenced; both references are consumed (they may be NULL)."""
    cdef DdNode* r = disjoined(e, a, b)
    if r is not NULL:
        take(r)
    return r


cdef bint spread(Families* all, Family* f, Part* moves, int count, DdNode* source, DdNode** new_source,
                 DdNode** target, DdNode** new_target, DdNode* within) noexcept nogil:
    """Move the source, or what is new there, to the target and close that; what is new there is noted. False: stopped."""
    cdef Env* e = all.e
    cdef Ref x = e.no, old = target[0]
    take(x)
    if count and new_source[0] is not e.no:
        if all.fresh:
            x = minus(e, moved(all, moves, count, new_source[0], x, within), old)
            x = minus(e, closed_again(all, f, x, within), old)
        else:
            Cudd_IterDerefBdd(e.dd, x)
            take(old)
            x = moved(all, moves, count, source, old, within)
            if x is not old:
                x = closed_again(all, f, x, within)
    drop(e, new_source[0])
    new_source[0] = e.no
    take(e.no)
    if x is NULL:
        return False
    take(x)
    if all.fresh or x is e.no:
        target[0] = plus(e, old, x)
        new_target[0] = plus(e, new_target[0], x)
    elif x is old:
        drop(e, x)
        drop(e, x)
    else:       # what exactly is new is not asked for
        drop(e, old)
        drop(e, new_target[0])
        target[0] = new_target[0] = x
    return target[0] is not NULL and new_target[0] is not NULL


@cython.final
@cython.no_gc
cdef class Closure:
    """Relations, prepared for closing sets under them: pairs of a relation and its Transition.

    `forward`: by images, else by preimages. Each column variable must be right below its row variable (ValueError).
    """

    cdef readonly Core core
    cdef readonly tuple relations
    cdef readonly bint forward
    cdef Families all
    cdef Family* root
    cdef unsigned long readings

    def __cinit__(self, Core core not None, relations, bint forward=True, long families=200_000):
        self.core = core
        self.relations = tuple(relations)
        self.forward = forward
        self.all.limit = families
        self._prepare()

    cdef int _prepare(self) except -1:
        cdef Env* e = self.core.begin()
        cdef int count = 0
        cdef Bdd relation
        cdef Transition transition
        drop_families(&self.all)
        self.root = NULL
        self.all.e = e
        self.all.forward = self.forward
        self.all.gave_up = False
        self.all.keys = &self.core.renamings
        self.all.size = 1024
        self.all.slots = <Family**>calloc(self.all.size, sizeof(Family*))
        cdef Part* parts = <Part*>malloc((len(self.relations) + 1) * sizeof(Part))
        if parts is NULL or self.all.slots is NULL:
            free(parts)
            raise MemoryError
        for relation, transition in self.relations:
            if relation.core is not self.core or transition.core is not self.core or not transition.adjacent(e):
                drop_parts(e, parts, count)
                raise ValueError("the relations are of another manager, or their columns are not right below their rows")
            if not add_part(e, parts, &count, relation.node, transition.all.node):
                drop_parts(e, parts, count)
                self.core.fail()
        self.root = family_of(&self.all, parts, count)
        if self.root is NULL:
            self.core.fail()
        self.readings = e.readings
        return 0

    def __dealloc__(self):
        if self.core is not None and self.all.slots is not NULL:
            self.all.e = &self.core.e
            drop_families(&self.all)

    @property
    def families(self):
        """How many sets of relations, as they are for some values of the variables above, were met so far."""
        return self.all.count

    @property
    def exhausted(self):
        """Whether no more families may be made, so that closing other sets may never end."""
        return self.all.count >= self.all.limit

    def close(self, Bdd states not None, Bdd within=None, nodes=None, deadline=None, steps=None, bint fresh=False):
        """The least set that contains `states`, and with a state all its successors (predecessors) `within` a set.

        None where it was given up: past so many live `nodes`, the `deadline` (of time.monotonic) or so many `steps` (two
        million are about a second), or because too many families of relations would be needed. What was found by then is
        remembered as long as CUDD's cache keeps it.
        `fresh`: only what is new moves on, and is closed by itself: better where a clock drives everything, worse else.
        """
        cdef DdNode* r
        cdef DdNode* w = self.core.e.one
        as_bdd(self.core, states)
        if within is not None:
            as_bdd(self.core, within)
            w = within.node
        cdef Env* e = self.core.begin()
        if self.readings != e.readings:       # the order may be another
            self._prepare()
        self.all.e = e
        self.all.nodes = 0x7FFFFFFFFFFFFFFF if nodes is None else nodes
        self.all.deadline = 1e300 if deadline is None else deadline
        self.all.last = 1e300 if steps is None else Cudd_ReadCacheLookUps(e.dd) + steps
        self.all.gave_up = False
        self.all.fresh = fresh
        r = closed(&self.all, self.root, states.node, w)
        if r is NULL and self.all.gave_up and e.reason == NONE:
            return None
        return wrap_bdd(self.core, r)
