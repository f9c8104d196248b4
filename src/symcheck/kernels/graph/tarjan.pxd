# cython: language_level=3
"""Tarjan's algorithm for strongly connected components (1972), without recursion.

The caller sets each index to 0, and CLOSED for states that are left out, and enumerates the
successors. It calls `tarjan_enter(search, root)` at depth -1. While the depth is not negative, it
visits the successors of `path[depth]`: it lowers the state's `lowlink` to the least `index` of
them, enters the first one with the index 0, and calls `tarjan_leave` when no successor is left.
"""
from libc.stdint cimport int32_t, int64_t

cdef enum:
    CLOSED = 2147483647  # the index of states with a component: it is never the least one

cdef struct Tarjan:
    int32_t* index       # order in which states were visited, from 1; 0: not yet; CLOSED: see above
    int32_t* lowlink         # least such number known to be reachable from the state
    int32_t* component   # component of each state; -1: none yet
    int32_t* path        # states from the root to the current state
    int32_t* stack    # visited states that have no component yet
    int32_t* order       # states by component, successors first
    int64_t* start       # of each component in `order`
    int64_t depth, stack_size, assigned
    int32_t next_index, count

cdef inline void tarjan_enter(Tarjan* s, int32_t state) noexcept nogil:
    """Put a state on the path."""
    s.depth += 1
    s.path[s.depth] = state
    s.next_index += 1
    s.index[state] = s.next_index
    s.lowlink[state] = s.next_index

cdef inline void tarjan_leave(Tarjan* s) noexcept nogil:
    """Take the last state off the path, and close its component if it is the root of one."""
    cdef int32_t v = s.path[s.depth], w
    cdef int32_t lowlink_v = s.lowlink[v]
    cdef int64_t first, k
    s.stack[s.stack_size] = v
    s.stack_size += 1
    s.depth -= 1
    if lowlink_v == s.index[v]:
        # The states left since v was put on the path, without a component yet, form that of v.
        first = s.stack_size
        while first > 0 and s.index[s.stack[first - 1]] >= lowlink_v:
            first -= 1
        for k in range(first, s.stack_size):
            w = s.stack[k]
            s.component[w] = s.count
            s.index[w] = CLOSED
            s.order[s.assigned] = w
            s.assigned += 1
        s.stack_size = first
        s.count += 1
        s.start[s.count] = s.assigned
    elif s.depth >= 0 and lowlink_v < s.lowlink[s.path[s.depth]]:
        s.lowlink[s.path[s.depth]] = lowlink_v
