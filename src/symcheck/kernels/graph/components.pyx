# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Strongly connected components and reachability over compressed rows.

States own consecutive rows. state_ptr: int64[n+1], the entries of state s are state_ptr[s] to
state_ptr[s+1] of `indices` (int32, the successors).

column_ptr, column_rows: the transposed structure, that is, int64[n+1] and int32, the rows with an
entry in each column. row_state: int32[rows], the state of each row. Masks are uint8[n], 1 for
members. Every function raises MemoryError when memory ends.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.graph.tarjan cimport CLOSED, Tarjan, tarjan_enter, tarjan_leave


def components(const int64_t[::1] state_ptr, const int32_t[::1] indices,
               within: Masks | None = None) -> tuple[Int32s, Int32s, Int64s]:
    """Strongly connected components, successors first (Tarjan 1972).

    Args:
        state_ptr, indices: the graph.
        within: mask of the states to consider; None for all.
    Returns:
        component: int32[n], the component of each state, -1 outside `within`.
        order: int32[m], the states by component; within one component, in depth-first post-order.
        start: int64[components+1], where each component begins in `order`.
    """
    cdef int64_t n = state_ptr.shape[0] - 1
    cdef int32_t[::1] component = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] order = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    cdef int32_t[::1] lowlink = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] stack = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] path = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] next_entry = np.empty(n, dtype=np.int64)
    cdef int32_t[::1] index = (np.zeros(n, dtype=np.int32) if within is None else
                               np.where(within, np.int32(0), np.int32(CLOSED)))
    cdef int32_t v, w, least
    cdef int64_t root, k, end
    cdef Tarjan search = Tarjan(&index[0], &lowlink[0], &component[0], &path[0], &stack[0],
                                &order[0], &start[0], depth=-1, stack_size=0, assigned=0,
                                next_index=0, count=0)
    with nogil:
        start[0] = 0
        for root in range(n):
            if index[root]:
                continue
            tarjan_enter(&search, <int32_t>root)
            next_entry[0] = state_ptr[root]
            while search.depth >= 0:
                v = path[search.depth]
                k = next_entry[search.depth]
                end = state_ptr[v + 1]
                least = lowlink[v]
                while k < end:
                    w = indices[k]
                    if index[w] == 0:
                        break
                    if index[w] < least:
                        least = index[w]
                    k += 1
                lowlink[v] = least
                if k < end:
                    next_entry[search.depth] = k + 1
                    tarjan_enter(&search, indices[k])
                    next_entry[search.depth] = state_ptr[indices[k]]
                else:
                    tarjan_leave(&search)
    # Views suffice: pages of an array that were never written take no memory.
    return (np.asarray(component), np.asarray(order)[: search.assigned],
            np.asarray(start)[: search.count + 1])


def bottom_components(const int64_t[::1] state_ptr, const int32_t[::1] indices,
                      const int32_t[::1] component, int64_t count) -> Masks:
    """Mask of the components that no edge leaves: uint8[count].

    Edges to states without a component leave the component, too.
    """
    cdef int64_t n = state_ptr.shape[0] - 1, s, k
    cdef uint8_t[::1] out = np.ones(count, dtype=np.uint8)
    with nogil:
        for s in range(n):
            if component[s] >= 0:
                for k in range(state_ptr[s], state_ptr[s + 1]):
                    if component[indices[k]] != component[s]:
                        out[component[s]] = 0
    return np.asarray(out)


def backward_reachable(const int64_t[::1] column_ptr, const int32_t[::1] column_rows,
                       const int32_t[::1] row_state, const uint8_t[::1] target,
                       const uint8_t[::1] allowed) -> Masks:
    """Mask of `target` and the states of `allowed` with a path inside `allowed` into it.

    row_state may be empty where every state has one row.
    """
    cdef int64_t n = column_ptr.shape[0] - 1, s, k, head = 0, tail = 0
    cdef int32_t p
    cdef bint one_row = row_state.shape[0] == 0
    cdef uint8_t[::1] reached = np.zeros(n, dtype=np.uint8)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            if target[s]:
                reached[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail:
            s = queue[head]
            head += 1
            for k in range(column_ptr[s], column_ptr[s + 1]):
                p = column_rows[k] if one_row else row_state[column_rows[k]]
                if not reached[p] and allowed[p]:
                    reached[p] = 1
                    queue[tail] = p
                    tail += 1
    return np.asarray(reached)


def breadth_first(const int64_t[::1] state_ptr, const int32_t[::1] indices,
                  const uint8_t[::1] sources,
                  allowed: Masks | None = None) -> tuple[Int32s, Int32s]:
    """The states that are reachable by paths whose inner states are all in `allowed`.

    Sources outside `allowed` are reached, but their successors are not visited.

    Returns:
        The states by their distance (number of edges) from `sources`, and for every state its
        predecessor on a shortest path, int32[n]: -1 for a source, -2 for a state that no source
        reaches.
    """
    cdef int64_t n = state_ptr.shape[0] - 1, s, k, head = 0, tail = 0
    cdef const uint8_t[::1] inner = np.ones(n, dtype=np.uint8) if allowed is None else allowed
    cdef int32_t[::1] parent = np.full(n, -2, dtype=np.int32)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            if sources[s]:
                parent[s] = -1
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail:
            s = queue[head]
            head += 1
            if not inner[s]:
                continue
            for k in range(state_ptr[s], state_ptr[s + 1]):
                if parent[indices[k]] == -2:
                    parent[indices[k]] = <int32_t>s
                    queue[tail] = indices[k]
                    tail += 1
    return np.asarray(queue)[:tail], np.asarray(parent)
