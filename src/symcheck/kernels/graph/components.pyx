# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Graph algorithms over compressed rows. States own consecutive rows; `edges` (int64[states+1]) delimits a state's entries.

`pre`/`rows_in`: the transposed structure, that is, the rows with an entry in a column. `owner`: the state of a row.
Masks are uint8.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.graph.tarjan cimport Search, enter, leave


def components(const int64_t[::1] edges, const int32_t[::1] indices, within=None):
    """Strongly connected components of the states in `within` (default: all), successors first.

    Returns (component int32[n], -1 outside; order int32[m]: the states by component, within one in the order in which a
    depth-first search leaves them; start int64[count+1] into `order`). Tarjan (1972).
    """
    cdef int64_t n = edges.shape[0] - 1
    cdef const uint8_t[::1] inside = np.ones(n, dtype=np.uint8) if within is None else within
    cdef int32_t[::1] component = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] order = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    cdef int32_t[::1] low = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] finished = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] path = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] at = np.empty(n, dtype=np.int64)
    cdef int32_t[::1] found = np.zeros(n, dtype=np.int32)
    cdef int32_t v, w, lowest
    cdef int64_t root, k, end
    cdef Search search = Search(
        &found[0], &low[0], &component[0], &path[0], &finished[0], &order[0], &start[0], depth=-1, top=0, done=0, clock=0, count=0,
    )
    with nogil:
        start[0] = 0
        for root in range(n):
            if found[root] or not inside[root]:
                continue
            enter(&search, <int32_t>root)
            at[0] = edges[root]
            while search.depth >= 0:
                v = path[search.depth]
                k = at[search.depth]
                end = edges[v + 1]
                lowest = low[v]
                while k < end:
                    w = indices[k]
                    if found[w] == 0:
                        if inside[w]:
                            break
                    elif component[w] < 0 and found[w] < lowest:
                        lowest = found[w]
                    k += 1
                low[v] = lowest
                if k < end:
                    at[search.depth] = k + 1
                    enter(&search, indices[k])
                    at[search.depth] = edges[indices[k]]
                else:
                    leave(&search)
    # Views: what was not written to of an array takes no memory.
    return np.asarray(component), np.asarray(order)[: search.done], np.asarray(start)[: search.count + 1]


def bottom(const int64_t[::1] edges, const int32_t[::1] indices, const int32_t[::1] component, int64_t count):
    """uint8[count]: 1 for the components that no edge leaves (to a state outside of all components either)."""
    cdef int64_t n = edges.shape[0] - 1, s, k
    cdef uint8_t[::1] out = np.ones(count, dtype=np.uint8)
    with nogil:
        for s in range(n):
            if component[s] >= 0:
                for k in range(edges[s], edges[s + 1]):
                    if component[indices[k]] != component[s]:
                        out[component[s]] = 0
    return np.asarray(out)


def forward(const int64_t[::1] edges, const int32_t[::1] indices, const uint8_t[::1] sources, const uint8_t[::1] through):
    """uint8[n]: reachable from `sources` by passing through states of `through` (sources themselves are expanded if in it)."""
    cdef int64_t n = edges.shape[0] - 1, s, k, head = 0, tail = 0
    cdef uint8_t[::1] seen = np.zeros(n, dtype=np.uint8)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            if sources[s]:
                seen[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail:
            s = queue[head]
            head += 1
            if not through[s]:
                continue
            for k in range(edges[s], edges[s + 1]):
                if not seen[indices[k]]:
                    seen[indices[k]] = 1
                    queue[tail] = indices[k]
                    tail += 1
    return np.asarray(seen)


def backward(const int64_t[::1] pre, const int32_t[::1] rows_in, const int32_t[::1] owner,
             const uint8_t[::1] target, const uint8_t[::1] through):
    """uint8[n]: `target`, and the states of `through` from which some path through `through` leads into it."""
    cdef int64_t n = pre.shape[0] - 1, s, k, head = 0, tail = 0
    cdef int32_t p
    cdef bint plain = owner.shape[0] == 0
    cdef uint8_t[::1] seen = np.zeros(n, dtype=np.uint8)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            if target[s]:
                seen[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail:
            s = queue[head]
            head += 1
            for k in range(pre[s], pre[s + 1]):
                p = rows_in[k] if plain else owner[rows_in[k]]
                if not seen[p] and through[p]:
                    seen[p] = 1
                    queue[tail] = p
                    tail += 1
    return np.asarray(seen)


def shortest(const int64_t[::1] edges, const int32_t[::1] indices, const uint8_t[::1] sources, const uint8_t[::1] through,
             const uint8_t[::1] target):
    """A shortest path from `sources` through `through` into `target`, as state numbers; empty if there is none."""
    cdef int64_t n = edges.shape[0] - 1, s, k, head = 0, tail = 0, goal = -1
    cdef int32_t w
    cdef int32_t[::1] parent = np.full(n, -2, dtype=np.int32)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            if sources[s]:
                parent[s] = -1
                if target[s]:
                    goal = s
                    break
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail and goal < 0:
            s = queue[head]
            head += 1
            if not through[s]:
                continue
            for k in range(edges[s], edges[s + 1]):
                w = indices[k]
                if parent[w] == -2:
                    parent[w] = <int32_t>s
                    if target[w]:
                        goal = w
                        break
                    queue[tail] = w
                    tail += 1
    path = []
    while goal >= 0:
        path.append(goal)
        goal = parent[goal]
    return np.array(path[::-1], dtype=np.int64)
