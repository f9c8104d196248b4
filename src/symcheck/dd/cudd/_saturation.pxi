# Saturation: the least fixpoint of a set under relations, computed node by node; in the conventions
# of _recursions.pxi.
#
# The set below a node is saturated with the events that keep the variables above it before any
# event above is applied. At the variable of a node, an event has four cofactors. The two that keep
# the variable's value are events of the levels below and are applied in the children (adding one to
# a counter mostly changes low bits, so it mostly works there). The two that change it are applied
# here. Variables that an event only reads are kept.
#
# Sources: Ciardo, Luettgen and Siminiceanu (2001), Saturation: an efficient iteration strategy for
# symbolic state-space generation; Zhao and Ciardo (2009), Symbolic CTL model checking of
# asynchronous systems using constrained saturation (the set `within`). An event partition is what
# Ciardo et al. call the events below a level, here as their cofactors by the values of the
# variables above.

cdef struct Event:
    DdNode* relation             # referenced
    DdNode* touched              # referenced: the cube of the touched variables, as relation_step takes it

cdef struct EventPartition:
    Event* events                # ordered by their touched variables, which are distinct
    int count
    int level                    # of the topmost variable that an event touches or reads
    DdNode* key                  # a constant that stands for the partition in CUDD's cache
    EventPartition* low          # the events below, where that variable is and stays 0
    EventPartition* high         # the same for 1; both are NULL until `split_partition`
    Event* level_events          # events that change that variable: first from 0 to 1, then from 1 to 0
    int rising
    int falling
    EventPartition* next         # in the same bucket of the table
    uint64_t hash

cdef struct PartitionTable:
    Env* e
    EventPartition** buckets
    long size
    long count
    long max_partitions
    double deadline              # time at which to stop
    double max_lookups           # count of look-ups in CUDD's cache at which to stop: a measure of all work
    bint forward
    bint new_only                # apply events to new states only, and saturate their results separately
    bint stopped
    unsigned long steps
    unsigned long* keys


cdef bint limit_reached(PartitionTable* table) noexcept nogil:
    """Whether a limit of this saturation is reached; checked once in a number of steps."""
    table.steps += 1
    if (table.steps & STEPS_PER_LIMIT_CHECK) == 0:
        table.stopped |= Cudd_ReadCacheLookUps(table.e.dd) > table.max_lookups or monotonic_seconds() > table.deadline
    return table.stopped


cdef int compare_touched(Env* e, DdNode* p, DdNode* q) noexcept nogil:
    """Compare two cubes by their levels, topmost first: an order that does not depend on addresses.
    """
    while p is not q:
        if level_of(e, p) != level_of(e, q):
            return -1 if level_of(e, p) < level_of(e, q) else 1
        p = p.type.kids.T
        q = q.type.kids.T
    return 0


cdef bint add_event(Env* e, Event* events, int* count, DdNode* relation, DdNode* touched, bint changes_level=False) noexcept nogil:
    """Add a relation to the event with the same touched variables, or insert an event. False:
    stopped.

    A relation that changes no variable is left out, unless it changes the variable of the level
    above.
    """
    cdef int a = 0, b = count[0], middle, order
    cdef Ref r
    if relation is e.logic_zero or (touched is e.one and not changes_level):
        return True
    while a < b:
        middle = (a + b) >> 1
        order = compare_touched(e, events[middle].touched, touched)
        if order == 0:
            r = cuddBddAndRecur(e.dd, negate(events[middle].relation), negate(relation))
            if r is NULL:
                return False
            reference(r)
            Cudd_IterDerefBdd(e.dd, events[middle].relation)
            events[middle].relation = negate(r)
            return True
        if order < 0:
            a = middle + 1
        else:
            b = middle
    for middle in range(count[0], a, -1):
        events[middle] = events[middle - 1]
    events[a].relation = relation
    events[a].touched = touched
    reference(relation)
    reference(touched)
    count[0] += 1
    return True


cdef void drop_events(Env* e, Event* events, int count) noexcept nogil:
    cdef int i
    for i in range(count):
        Cudd_IterDerefBdd(e.dd, events[i].relation)
        Cudd_IterDerefBdd(e.dd, events[i].touched)
    free(events)


cdef bint grow_buckets(PartitionTable* table) noexcept nogil:
    cdef long i, size = 2 * table.size
    cdef EventPartition* f
    cdef EventPartition* following
    cdef EventPartition** buckets = <EventPartition**>calloc(size, sizeof(EventPartition*))
    if buckets is NULL:
        return False
    for i in range(table.size):
        f = table.buckets[i]
        while f is not NULL:
            following = f.next
            f.next = buckets[f.hash & (size - 1)]
            buckets[f.hash & (size - 1)] = f
            f = following
    free(table.buckets)
    table.buckets = buckets
    table.size = size
    return True


cdef EventPartition* partition_of(PartitionTable* table, Event* events, int count) noexcept nogil:
    """The partition of these events, which are consumed; NULL: stopped, or too many partitions."""
    cdef Env* e = table.e
    cdef uint64_t hash = 1469598103, factor = 1099511627
    factor = factor << 8 | 0xB3
    cdef int i
    cdef EventPartition* f
    for i in range(count):
        hash = (hash ^ <uint64_t><uintptr_t>events[i].relation) * factor
        hash = (hash ^ <uint64_t><uintptr_t>events[i].touched) * factor
    hash ^= hash >> 29
    f = table.buckets[hash & (table.size - 1)]
    while f is not NULL:
        if f.hash == hash and f.count == count and memcmp(f.events, events, count * sizeof(Event)) == 0:
            drop_events(e, events, count)
            return f
        f = f.next
    if table.count >= table.max_partitions:
        table.stopped = True
    elif table.count < table.size or grow_buckets(table):
        f = <EventPartition*>calloc(1, sizeof(EventPartition))
    if f is not NULL:
        table.keys[0] += 1
        f.key = cuddUniqueConst(e.dd, 2.0 + <double>table.keys[0])
    if f is NULL or f.key is NULL:
        if f is NULL and not table.stopped:
            e.reason = NO_MEMORY
        free(f)
        drop_events(e, events, count)
        return NULL
    reference(f.key)
    f.events = events
    f.count = count
    f.level = CONSTANT
    for i in range(count):
        f.level = min(f.level, min(level_of(e, events[i].relation), level_of(e, events[i].touched)))
    f.hash = hash
    f.next = table.buckets[hash & (table.size - 1)]
    table.buckets[hash & (table.size - 1)] = f
    table.count += 1
    return f


cdef void drop_partitions(PartitionTable* table) noexcept nogil:
    cdef long i
    cdef EventPartition* f
    cdef EventPartition* following
    for i in range(table.size):
        f = table.buckets[i]
        while f is not NULL:
            following = f.next
            drop_events(table.e, f.events, f.count)
            drop_events(table.e, f.level_events, f.rising + f.falling)
            Cudd_RecursiveDeref(table.e.dd, f.key)
            free(f)
            f = following
    free(table.buckets)
    table.buckets = NULL
    table.size = table.count = 0


cdef bint split_events(PartitionTable* table, EventPartition* f, Event* low, Event* high, Event* up, Event* down, int* n) noexcept nogil:
    """Split events by the top variable into four lists, whose lengths are counted in n. False:
    stopped.
    """
    cdef Env* e = table.e
    cdef Event p
    cdef Ref a, b, r00, r01, r10, r11, rest
    cdef int i
    for i in range(f.count):
        p = f.events[i]
        if min(level_of(e, p.relation), level_of(e, p.touched)) > f.level:
            if not (add_event(e, low, &n[0], p.relation, p.touched) and add_event(e, high, &n[1], p.relation, p.touched)):
                return False
            continue
        bdd_cofactors(e, p.relation, f.level, &a, &b)
        if level_of(e, p.touched) > f.level:
            if not (add_event(e, low, &n[0], b, p.touched) and add_event(e, high, &n[1], a, p.touched)):
                return False
            continue
        bdd_cofactors(e, a, f.level + 1, &r11, &r10)
        bdd_cofactors(e, b, f.level + 1, &r01, &r00)
        rest = p.touched.type.kids.T.type.kids.T
        if not table.forward:
            r01, r10 = r10, r01
        if not (add_event(e, low, &n[0], r00, rest) and add_event(e, high, &n[1], r11, rest)):
            return False
        if not (add_event(e, up, &n[2], r01, rest, True) and add_event(e, down, &n[3], r10, rest, True)):
            return False
    return True


cdef bint split_partition(PartitionTable* table, EventPartition* f) noexcept nogil:
    """Compute the partitions of the two children and the events that change the top variable.
    False: stopped.
    """
    cdef int* n = <int*>calloc(4, sizeof(int))
    cdef Event* lists[4]
    cdef int i
    cdef bint done = n is not NULL
    for i in range(4):
        lists[i] = <Event*>malloc((2 * f.count if i == 2 else f.count) * sizeof(Event))
        done = done and lists[i] is not NULL
    if not done:
        table.e.reason = NO_MEMORY
        for i in range(4):
            free(lists[i])
        free(n)
        return False
    done = split_events(table, f, lists[0], lists[1], lists[2], lists[3], n)
    if done:
        # One list holds both directions.
        memcpy(lists[2] + n[2], lists[3], n[3] * sizeof(Event))
        free(lists[3])
        f.level_events = lists[2]
        f.rising = n[2]
        f.falling = n[3]
        f.low = partition_of(table, lists[0], n[0])
        if f.low is not NULL:
            f.high = partition_of(table, lists[1], n[1])
        else:
            drop_events(table.e, lists[1], n[1])
        done = f.low is not NULL and f.high is not NULL
        if not done:
            drop_events(table.e, f.level_events, f.rising + f.falling)
            f.level_events = NULL
            f.rising = f.falling = 0
            f.low = f.high = NULL
    else:
        for i in range(4):
            drop_events(table.e, lists[i], n[i])
    free(n)
    return done


cdef DdNode* fire_all(PartitionTable* table, Event* level_events, int count, DdNode* source, DdNode* target, DdNode* within) noexcept nogil:
    """The target (its reference is consumed) united with the images of the source within a set;
    referenced.
    """
    cdef Env* e = table.e
    cdef Ref x, y
    cdef int i
    for i in range(count):
        x = referenced(relation_step(e, table.forward, source, level_events[i].relation,
                                     level_events[i].touched))
        y = NULL if x is NULL else cuddBddAndRecur(e.dd, x, within)
        target = union_owned(e, target, referenced(released(e, x, y)))
        if target is NULL:
            break
    return target


cdef DdNode* saturate_owned(PartitionTable* table, EventPartition* f, DdNode* s, DdNode* within) noexcept nogil:
    """Saturate a referenced set, whose reference is consumed (NULL: stopped before); the result is
    referenced.
    """
    cdef DdNode* r = NULL if s is NULL else saturate(table, f, s, within)
    return referenced(released(table.e, s, r))


cdef DdNode* saturate(PartitionTable* table, EventPartition* f, DdNode* s, DdNode* within) noexcept nogil:
    """The least set that contains s and is closed under the events within a set."""
    cdef Env* e = table.e
    cdef Ref r, t, u, s0, s1, w0, w1
    cdef int l, index
    if f.count == 0 or s is e.logic_zero or s is e.one or s is within or within is e.logic_zero:
        return s
    r = cuddCacheLookup(e.dd, TAG_SATURATE, s, f.key, within)
    if r is not NULL:
        return r
    if stop_requested(e) or limit_reached(table):
        return NULL
    l = min(level_of(e, s), level_of(e, within))
    if l < f.level:
        bdd_cofactors(e, s, l, &s1, &s0)
        bdd_cofactors(e, within, l, &w1, &w0)
        index = regular(s).index if level_of(e, s) == l else regular(within).index
        t = referenced(saturate(table, f, s1, w1))
        u = NULL if t is NULL else referenced(saturate(table, f, s0, w0))
    else:
        if f.low is NULL and not split_partition(table, f):
            return NULL
        bdd_cofactors(e, s, f.level, &s1, &s0)
        bdd_cofactors(e, within, f.level, &w1, &w0)
        index = Cudd_ReadInvPerm(e.dd, f.level)
        t = saturate_owned(table, f.high, referenced(s1), w1)
        u = NULL if t is NULL else saturate_owned(table, f.low, referenced(s0), w0)
        if u is not NULL and not fire_to_fixpoint(table, f, &t, &u, w1, w0):
            return NULL
    r = bdd_node(e, index, t, u)
    if r is not NULL:
        reference(r)
        cuddCacheInsert(e.dd, TAG_SATURATE, s, f.key, within, r)
        if r is not s:
            cuddCacheInsert(e.dd, TAG_SATURATE, r, f.key, within, r)
        dereference(r)
    return r


cdef bint fire_to_fixpoint(PartitionTable* table, EventPartition* f, DdNode** t, DdNode** u, DdNode* w1, DdNode* w0) noexcept nogil:
    """Apply the events of this level between the two referenced children until nothing is new.

    False: stopped, and the references of the children are released.
    """
    cdef Env* e = table.e
    cdef Ref new_t = referenced(t[0]), new_u = referenced(u[0])
    cdef bint done = True
    while done and (new_u is not e.logic_zero or new_t is not e.logic_zero):
        # All steps may be cached, and there may be very many.
        done = not (stop_requested(e) or limit_reached(table))
        done = done and fire_and_saturate(table, f.high, f.level_events, f.rising, u[0], &new_u, t, &new_t, w1)
        done = done and fire_and_saturate(table, f.low, f.level_events + f.rising, f.falling, t[0], &new_t, u, &new_u, w0)
    released(e, new_t, NULL)
    released(e, new_u, NULL)
    if not done:
        released(e, t[0], NULL)
        released(e, u[0], NULL)
    return done


cdef DdNode* difference_owned(Env* e, DdNode* a, DdNode* b) noexcept nogil:
    """a without b, referenced; the reference of a, which may be NULL, is consumed."""
    cdef DdNode* r = NULL if a is NULL else cuddBddAndRecur(e.dd, a, negate(b))
    return referenced(released(e, a, r))


cdef bint fire_and_saturate(PartitionTable* table, EventPartition* f, Event* level_events, int count, DdNode* source, DdNode** new_source,
                 DdNode** target, DdNode** new_target, DdNode* within) noexcept nogil:
    """Apply events from the source child to the target child and saturate the target.

    new_source, new_target: the states of each child to which events must still be applied. False:
    stopped.
    """
    cdef Env* e = table.e
    cdef Ref x = referenced(e.logic_zero), old = target[0]
    if count and new_source[0] is not e.logic_zero:
        if table.new_only:
            x = difference_owned(e, fire_all(table, level_events, count, new_source[0], x, within), old)
            x = difference_owned(e, saturate_owned(table, f, x, within), old)
        else:
            released(e, x, NULL)
            x = fire_all(table, level_events, count, source, referenced(old), within)
            if x is not old:
                x = saturate_owned(table, f, x, within)
    released(e, new_source[0], NULL)
    new_source[0] = referenced(e.logic_zero)
    if x is NULL:
        return False
    reference(x)
    if table.new_only or x is e.logic_zero:
        target[0] = union_owned(e, old, x)
        new_target[0] = union_owned(e, new_target[0], x)
    elif x is old:
        released(e, x, NULL)
        released(e, x, NULL)
    else:       # all of x counts as new
        released(e, old, NULL)
        released(e, new_target[0], NULL)
        target[0] = new_target[0] = x
    return target[0] is not NULL and new_target[0] is not NULL


@cython.final
@cython.no_gc
cdef class Saturation:
    """Relations prepared for least fixpoints by saturation.

    Args:
        core: the manager's core.
        relations: pairs of a relation (Bdd) and its Transition.
        forward: by images; if False, by preimages.
        max_partitions: event partitions that may be created before `saturate` gives up.
    Raises:
        ValueError: a column variable is not directly below its row variable, or the managers
            differ.
    """

    cdef readonly Core core
    cdef readonly tuple relations  # type: tuple[tuple[Bdd, Transition], ...]
    cdef readonly bint forward
    cdef PartitionTable table
    cdef EventPartition* root
    cdef unsigned long order_version

    def __cinit__(self, Core core not None, relations: Iterable[tuple[Bdd, Transition]],
                  bint forward=True, long max_partitions=MAX_PARTITIONS):
        self.core = core
        self.relations = tuple(relations)
        self.forward = forward
        self.table.max_partitions = max_partitions
        self._prepare()

    cdef int _prepare(self) except -1:
        cdef Env* e = self.core.begin()
        cdef int count = 0
        cdef Bdd relation
        cdef Transition transition
        drop_partitions(&self.table)
        self.root = NULL
        self.table.e = e
        self.table.forward = self.forward
        self.table.stopped = False
        self.table.keys = &self.core.renamings
        self.table.size = 1024
        self.table.buckets = <EventPartition**>calloc(self.table.size, sizeof(EventPartition*))
        cdef Event* events = <Event*>malloc((len(self.relations) + 1) * sizeof(Event))
        if events is NULL or self.table.buckets is NULL:
            free(events)
            raise MemoryError
        for relation, transition in self.relations:
            if relation.core is not self.core or transition.core is not self.core or not transition.adjacent(e):
                drop_events(e, events, count)
                raise ValueError("the relations are of another manager, or their columns are not directly below their rows")
            if not add_event(e, events, &count, relation.node, transition.all.node):
                drop_events(e, events, count)
                self.core.fail()
        self.root = partition_of(&self.table, events, count)
        if self.root is NULL:
            self.core.fail()
        self.order_version = e.order_version
        return 0

    def __dealloc__(self):
        if self.core is not None and self.table.buckets is not NULL:
            self.table.e = &self.core.e
            drop_partitions(&self.table)

    @property
    def partitions(self) -> int:
        """Number of event partitions created so far."""
        return self.table.count

    @property
    def exhausted(self) -> bool:
        """Whether `max_partitions` is reached, so that saturation of other sets may never end."""
        return self.table.count >= self.table.max_partitions

    def saturate(self, Bdd states not None, Bdd within=None, max_lookups: int | None = None,
                 deadline: float | None = None, bint new_only=False) -> Bdd | None:
        """The least set that contains `states` and is closed under the relations, as far as
        `within` a set.

        What was computed before a limit is remembered as long as CUDD's cache keeps it, so that
        calling again goes on.

        Args:
            within: states that the relations may lead to; None: all.
            max_lookups: look-ups in CUDD's cache to spend (two million take about a second); None:
                no limit.
            deadline: time (time.monotonic) at which to stop; None: none.
            new_only: apply relations to new states only and saturate their results separately,
                which pays where a clock drives the model and costs elsewhere.
        Returns:
            The set, or None at a limit or when more than `max_partitions` event partitions are
            needed.
        """
        cdef DdNode* r
        cdef DdNode* w = self.core.e.one
        as_bdd(self.core, states)
        if within is not None:
            as_bdd(self.core, within)
            w = within.node
        cdef Env* e = self.core.begin()
        if self.order_version != e.order_version:
            self._prepare()
        self.table.e = e
        self.table.deadline = 1e300 if deadline is None else deadline
        self.table.max_lookups = 1e300 if max_lookups is None else Cudd_ReadCacheLookUps(e.dd) + max_lookups
        self.table.stopped = False
        self.table.new_only = new_only
        r = saturate(&self.table, self.root, states.node, w)
        if r is NULL and self.table.stopped and e.reason == NONE:
            return None
        return wrap_bdd(self.core, r)
