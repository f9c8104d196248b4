# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Graph algorithms for Markov decision processes: Prob1E, maximal end components.

States own consecutive rows (choices): state s owns the rows groups[s] to groups[s+1] (groups:
int64[n+1]).

column_ptr, column_rows: the transposed structure, that is, int64[n+1] and int32, the rows with an
entry in each column. row_state: int32[rows], the state of each row. Masks are uint8[n], 1 for
members. Every function raises MemoryError when memory ends.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.graph.tarjan cimport Tarjan, tarjan_enter, tarjan_leave


def almost_sure_reachability(const int64_t[::1] indptr, const int32_t[::1] indices,
                             const int64_t[::1] groups, const int64_t[::1] column_ptr,
                             const int32_t[::1] column_rows, const int32_t[::1] row_state,
                             const uint8_t[::1] target,
                             const uint8_t[::1] allowed) -> tuple[Masks, Int64s]:
    """The states where some strategy reaches `target` through `allowed` with probability 1
    (Prob1E).

    Args:
        indptr, indices: int64[rows+1] and int32, the successors of each row.
    Returns:
        members: uint8[n].
        witness: int64[n], a row that stays in the set and moves towards the target; -1 at the
            target and outside the set.

    The algorithm keeps a witness row per state, which form a forest with its roots at the
    target. A state that cannot reach the target with the enabled rows is removed, which disables
    the rows that may enter it; only the states whose path in the forest used such a row are
    attached again.
    Source: de Alfaro (1997), section 3.5, computed incrementally.
    """
    cdef int64_t n = column_ptr.shape[0] - 1, s, k, e, r, head, tail, i, w
    cdef int32_t p
    cdef uint8_t[::1] alive = np.zeros(n, dtype=np.uint8)      # not removed yet
    # without a path to the target at present
    cdef uint8_t[::1] detached = np.zeros(n, dtype=np.uint8)
    cdef uint8_t[::1] disabled = np.zeros(row_state.shape[0], dtype=np.uint8)
    cdef int64_t[::1] witness = np.full(n, -1, dtype=np.int64)
    cdef int32_t[::1] parent = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] affected = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] removed = np.empty(n, dtype=np.int32)
    cdef int64_t affected_count = 0, removed_count = 0
    with nogil:
        tail = 0
        head = 0
        for s in range(n):
            if target[s]:
                alive[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
            elif allowed[s]:
                alive[s] = 1
                detached[s] = 1
                affected[affected_count] = <int32_t>s
                affected_count += 1
            else:
                removed[removed_count] = <int32_t>s
                removed_count += 1
        # States outside are removed from the start, because rows that may enter them are useless.
        for i in range(removed_count):
            s = removed[i]
            for k in range(column_ptr[s], column_ptr[s + 1]):
                disabled[column_rows[k]] = 1
        while True:
            # Attach states to the forest breadth first, from those in the queue.
            while head < tail:
                s = queue[head]
                head += 1
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    r = column_rows[k]
                    p = row_state[r]
                    if detached[p] and not disabled[r]:
                        detached[p] = 0
                        witness[p] = r
                        parent[p] = <int32_t>s
                        queue[tail] = p
                        tail += 1
            # Detached states cannot reach the target: remove them and disable the rows that may
            # enter them.
            removed_count = 0
            for i in range(affected_count):
                s = affected[i]
                if detached[s]:
                    detached[s] = 0
                    alive[s] = 0
                    witness[s] = -1
                    removed[removed_count] = <int32_t>s
                    removed_count += 1
            if removed_count == 0:
                break
            affected_count = 0
            for i in range(removed_count):
                s = removed[i]
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    r = column_rows[k]
                    if disabled[r]:
                        continue
                    disabled[r] = 1
                    p = row_state[r]
                    if alive[p] and not target[p] and witness[p] == r and not detached[p]:
                        detached[p] = 1
                        affected[affected_count] = p
                        affected_count += 1
            # States attached below a detached state are detached as well.
            i = 0
            while i < affected_count:
                s = affected[i]
                i += 1
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    r = column_rows[k]
                    p = row_state[r]
                    if (alive[p] and not detached[p] and not target[p] and witness[p] == r
                            and parent[p] == s):
                        detached[p] = 1
                        affected[affected_count] = p
                        affected_count += 1
            # Attach again the states with an enabled row into a state of the forest.
            head = 0
            tail = 0
            for i in range(affected_count):
                s = affected[i]
                for r in range(groups[s], groups[s + 1]):
                    if disabled[r]:
                        continue
                    for e in range(indptr[r], indptr[r + 1]):
                        w = indices[e]
                        # States that were attached during this scan count, too.
                        if alive[w] and not detached[w]:
                            detached[s] = 0
                            witness[s] = r
                            parent[s] = <int32_t>w
                            break
                    if not detached[s]:
                        queue[tail] = <int32_t>s
                        tail += 1
                        break
    return np.asarray(alive), np.asarray(witness)


cdef void enabled_components(Tarjan* search, int32_t[::1] states, const int64_t[::1] groups,
                             const int64_t[::1] indptr, const int32_t[::1] indices,
                             const uint8_t[::1] enabled, int64_t[::1] next_row,
                             int64_t[::1] next_entry) noexcept nogil:
    """Strongly connected components of `states` over the enabled rows, which must not leave them.

    next_row, next_entry: scratch, one number per state.
    """
    cdef int64_t i, r, k, end
    cdef int32_t v, w, least
    cdef bint entered
    search.depth = -1
    search.stack_size = search.assigned = 0
    search.next_index = search.count = 0
    search.start[0] = 0
    for i in range(states.shape[0]):
        search.index[states[i]] = 0
        search.component[states[i]] = -1
    for i in range(states.shape[0]):
        v = states[i]
        if search.index[v]:
            continue
        tarjan_enter(search, v)
        next_row[0] = groups[v]
        next_entry[0] = indptr[groups[v]]
        while search.depth >= 0:
            v = search.path[search.depth]
            r = next_row[search.depth]
            k = next_entry[search.depth]
            least = search.lowlink[v]
            entered = False
            while r < groups[v + 1]:
                if enabled[r]:
                    end = indptr[r + 1]
                    while k < end:
                        w = indices[k]
                        k += 1
                        if search.index[w] == 0:
                            entered = True
                            break
                        elif search.index[w] < least:
                            least = search.index[w]
                    if entered:
                        break
                r += 1
                k = indptr[r]
            search.lowlink[v] = least
            if entered:
                next_row[search.depth] = r
                next_entry[search.depth] = k
                tarjan_enter(search, w)
                next_row[search.depth] = groups[w]
                next_entry[search.depth] = indptr[groups[w]]
            else:
                tarjan_leave(search)


def maximal_end_components(const int64_t[::1] indptr, const int32_t[::1] indices,
                           const int64_t[::1] groups, const int64_t[::1] column_ptr,
                           const int32_t[::1] column_rows, const int32_t[::1] row_state,
                           const uint8_t[::1] within,
                           usable: Masks | None) -> tuple[Int32s, Masks, int]:
    """Maximal end components with states in `within` and rows in `usable`.

    Args:
        usable: uint8[rows], or None for all rows.
    Returns:
        component: int32[n], -1 for states in none.
        enabled: uint8[rows], the rows that stay in their state's component.
        count: number of components.
    Source: de Alfaro (1997); Chatterjee & Henzinger (2011). Each round computes strongly connected
    components of what the round before changed; a component that loses no row is an end component.
    """
    cdef int64_t n = column_ptr.shape[0] - 1, s, k, r, i, j, e, head, tail
    cdef int64_t active_count = 0, next_count
    cdef int32_t p, count = 0
    cdef uint8_t[::1] enabled = np.array(np.ones(row_state.shape[0]) if usable is None else usable,
                                         dtype=np.uint8)
    cdef uint8_t[::1] candidate = np.zeros(n, dtype=np.uint8)
    cdef int32_t[::1] result = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] choices = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] active = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] scc = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] index = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] lowlink = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] stack = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] path = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] next_row = np.empty(n, dtype=np.int64)
    cdef int64_t[::1] next_entry = np.empty(n, dtype=np.int64)
    cdef int32_t[::1] order = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    cdef bint changed
    cdef Tarjan search = Tarjan(&index[0], &lowlink[0], &scc[0], &path[0], &stack[0], &order[0],
                                &start[0], depth=-1, stack_size=0, assigned=0, next_index=0,
                                count=0)
    with nogil:
        # Rows that may leave `within` are unusable from the start.
        for s in range(n):
            if within[s]:
                candidate[s] = 1
                active[active_count] = <int32_t>s
                active_count += 1
            else:
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    enabled[column_rows[k]] = 0
        head = 0
        tail = 0
        for s in range(n):
            for r in range(groups[s], groups[s + 1]):
                if not candidate[s]:
                    enabled[r] = 0
                elif enabled[r]:
                    choices[s] += 1
            if candidate[s] and choices[s] == 0:
                candidate[s] = 0
                queue[tail] = <int32_t>s
                tail += 1
        while True:
            # Remove states without an enabled row, and the rows that may enter them.
            while head < tail:
                s = queue[head]
                head += 1
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    r = column_rows[k]
                    if enabled[r]:
                        enabled[r] = 0
                        p = row_state[r]
                        choices[p] -= 1
                        if choices[p] == 0 and candidate[p]:
                            candidate[p] = 0
                            queue[tail] = p
                            tail += 1
            # Strongly connected components of the active states over the enabled rows.
            next_count = 0
            for i in range(active_count):
                s = active[i]
                if candidate[s]:
                    active[next_count] = <int32_t>s
                    next_count += 1
            active_count = next_count
            if active_count == 0:
                break
            enabled_components(&search, active[:active_count], groups, indptr, indices, enabled,
                               next_row, next_entry)
            # Disable rows that leave their component; a component without such rows is an end
            # component.
            head = 0
            tail = 0
            next_count = 0
            for j in range(search.count):
                changed = False
                for i in range(start[j], start[j + 1]):
                    s = order[i]
                    for r in range(groups[s], groups[s + 1]):
                        if not enabled[r]:
                            continue
                        for e in range(indptr[r], indptr[r + 1]):
                            if scc[indices[e]] != j:
                                enabled[r] = 0
                                choices[s] -= 1
                                changed = True
                                break
                if changed:
                    for i in range(start[j], start[j + 1]):
                        s = order[i]
                        active[next_count] = <int32_t>s
                        next_count += 1
                        if choices[s] == 0:
                            candidate[s] = 0
                            queue[tail] = <int32_t>s
                            tail += 1
                else:
                    for i in range(start[j], start[j + 1]):
                        result[order[i]] = count
                        candidate[order[i]] = 0
                    count += 1
            active_count = next_count
            if active_count == 0:
                break
        # Disable the rows of states that are in no end component.
        for s in range(n):
            if result[s] < 0:
                for r in range(groups[s], groups[s + 1]):
                    enabled[r] = 0
    return np.asarray(result), np.asarray(enabled), count
