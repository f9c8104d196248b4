# cython: language_level=3
"""Tarjan's search for strong components (1972), without recursion: what happens where it enters a state, and where it leaves one.

Listing successors is left to those who search. They begin with `enter(search, root)` at depth -1; while the depth is not negative,
they look at the successors of `path[depth]`, lower its `low` by `found` of those that have no component yet, `enter` the first
one that is not found, and `leave` where there is none left.
"""
from libc.stdint cimport int32_t, int64_t

cdef struct Search:
    int32_t* found       # when a state was entered, from 1 on; 0: not yet
    int32_t* low         # the earliest state that is known to be reached from it
    int32_t* component   # -1 as long as it has none
    int32_t* path        # from a root to the state at hand
    int32_t* finished    # the states that were left and have no component yet
    int32_t* order       # states by component, successors first
    int64_t* start       # of each component in `order`
    int64_t depth, top, done
    int32_t clock, count

cdef inline void enter(Search* s, int32_t state) noexcept nogil:
    s.depth += 1
    s.path[s.depth] = state
    s.clock += 1
    s.found[state] = s.clock
    s.low[state] = s.clock

cdef inline void leave(Search* s) noexcept nogil:
    cdef int32_t v = s.path[s.depth], w
    cdef int32_t lowest = s.low[v]
    cdef int64_t first, k
    s.finished[s.top] = v
    s.top += 1
    s.depth -= 1
    if lowest == s.found[v]:
        # Everything that finished since v was found, and has no component yet, belongs to v.
        first = s.top
        while first > 0 and s.found[s.finished[first - 1]] >= lowest:
            first -= 1
        for k in range(first, s.top):
            w = s.finished[k]
            s.component[w] = s.count
            s.order[s.done] = w
            s.done += 1
        s.top = first
        s.count += 1
        s.start[s.count] = s.done
    elif s.depth >= 0 and lowest < s.low[s.path[s.depth]]:
        s.low[s.path[s.depth]] = lowest
