# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Graph algorithms for states with choices: attractors, almost sure reachability, end components.

States own consecutive rows: state s the rows groups[s] to groups[s+1].

`pre`/`rows_in`: the transposed structure, that is, the rows with an entry in a column. `owner`: the state of a row.
Masks are uint8.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.graph.tarjan cimport Search, enter, leave


def attractor(const int64_t[::1] pre, const int32_t[::1] rows_in, const int32_t[::1] owner, const int64_t[::1] groups,
              const uint8_t[::1] target, const uint8_t[::1] through):
    """uint8[n]: least set with `target` and the states of `through` all of whose rows have an entry in the set."""
    cdef int64_t n = pre.shape[0] - 1, s, k, r, head = 0, tail = 0
    cdef int32_t p
    cdef uint8_t[::1] seen = np.zeros(n, dtype=np.uint8)
    cdef uint8_t[::1] hit = np.zeros(owner.shape[0], dtype=np.uint8)
    cdef int32_t[::1] missing = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    with nogil:
        for s in range(n):
            missing[s] = <int32_t>(groups[s + 1] - groups[s])
            if target[s]:
                seen[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
        while head < tail:
            s = queue[head]
            head += 1
            for k in range(pre[s], pre[s + 1]):
                r = rows_in[k]
                if hit[r]:
                    continue
                hit[r] = 1
                p = owner[r]
                missing[p] -= 1
                if missing[p] == 0 and not seen[p] and through[p]:
                    seen[p] = 1
                    queue[tail] = p
                    tail += 1
    return np.asarray(seen)


def almost_sure(const int64_t[::1] indptr, const int32_t[::1] indices, const int64_t[::1] groups,
                const int64_t[::1] pre, const int32_t[::1] rows_in, const int32_t[::1] owner,
                const uint8_t[::1] target, const uint8_t[::1] through):
    """States with a strategy that reaches `target` through `through` with probability 1: (uint8[n], row int64[n]).

    The row is a choice that stays among these states and moves nearer to the target (-1 at the target and outside).
    Keeps one witness row per state, in a forest towards the target. A state that cannot get there with the rows left is
    removed, which disables rows; only the states that hung on them are attached anew.
    """
    cdef int64_t n = pre.shape[0] - 1, s, k, e, r, head, tail, i, w
    cdef int32_t p
    cdef uint8_t[::1] alive = np.zeros(n, dtype=np.uint8)      # not removed
    cdef uint8_t[::1] loose = np.zeros(n, dtype=np.uint8)      # to be attached anew
    cdef uint8_t[::1] disabled = np.zeros(owner.shape[0], dtype=np.uint8)
    cdef int64_t[::1] witness = np.full(n, -1, dtype=np.int64)
    cdef int32_t[::1] parent = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] affected = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] removed = np.empty(n, dtype=np.int32)
    cdef int64_t n_affected = 0, n_removed = 0
    with nogil:
        tail = 0
        head = 0
        for s in range(n):
            if target[s]:
                alive[s] = 1
                queue[tail] = <int32_t>s
                tail += 1
            elif through[s]:
                alive[s] = 1
                loose[s] = 1
                affected[n_affected] = <int32_t>s
                n_affected += 1
            else:
                removed[n_removed] = <int32_t>s
                n_removed += 1
        # The states outside are removed from the start: rows that may leave are of no use.
        for i in range(n_removed):
            s = removed[i]
            for k in range(pre[s], pre[s + 1]):
                disabled[rows_in[k]] = 1
        while True:
            # Attach, nearest first, from the states in the queue.
            while head < tail:
                s = queue[head]
                head += 1
                for k in range(pre[s], pre[s + 1]):
                    r = rows_in[k]
                    p = owner[r]
                    if loose[p] and not disabled[r]:
                        loose[p] = 0
                        witness[p] = r
                        parent[p] = <int32_t>s
                        queue[tail] = p
                        tail += 1
            # What is still loose has no way to the target: remove it and disable the rows that may enter it.
            n_removed = 0
            for i in range(n_affected):
                s = affected[i]
                if loose[s]:
                    loose[s] = 0
                    alive[s] = 0
                    witness[s] = -1
                    removed[n_removed] = <int32_t>s
                    n_removed += 1
            if n_removed == 0:
                break
            n_affected = 0
            for i in range(n_removed):
                s = removed[i]
                for k in range(pre[s], pre[s + 1]):
                    r = rows_in[k]
                    if disabled[r]:
                        continue
                    disabled[r] = 1
                    p = owner[r]
                    if alive[p] and not target[p] and witness[p] == r and not loose[p]:
                        loose[p] = 1
                        affected[n_affected] = p
                        n_affected += 1
            # Whatever hung on a loose state is loose as well.
            i = 0
            while i < n_affected:
                s = affected[i]
                i += 1
                for k in range(pre[s], pre[s + 1]):
                    r = rows_in[k]
                    p = owner[r]
                    if alive[p] and not loose[p] and not target[p] and witness[p] == r and parent[p] == s:
                        loose[p] = 1
                        affected[n_affected] = p
                        n_affected += 1
            # Reattach those with an enabled row into a state that still hangs on the target.
            head = 0
            tail = 0
            for i in range(n_affected):
                s = affected[i]
                for r in range(groups[s], groups[s + 1]):
                    if disabled[r]:
                        continue
                    for e in range(indptr[r], indptr[r + 1]):
                        w = indices[e]
                        # A state attached in this very scan is as good as any other.
                        if alive[w] and not loose[w]:
                            loose[s] = 0
                            witness[s] = r
                            parent[s] = <int32_t>w
                            break
                    if not loose[s]:
                        queue[tail] = <int32_t>s
                        tail += 1
                        break
    return np.asarray(alive), np.asarray(witness)


cdef void strong_components(Search* search, int32_t[::1] states, const int64_t[::1] groups, const int64_t[::1] indptr,
                            const int32_t[::1] indices, const uint8_t[::1] enabled, int64_t[::1] at_row, int64_t[::1] at) noexcept nogil:
    """Strong components of `states`, which enabled rows do not leave, over these rows; at_row, at: room for a number per state."""
    cdef int64_t i, r, k, end
    cdef int32_t v, w, lowest
    cdef bint deeper
    search.depth = -1
    search.top = search.done = 0
    search.clock = search.count = 0
    search.start[0] = 0
    for i in range(states.shape[0]):
        search.found[states[i]] = 0
        search.component[states[i]] = -1
    for i in range(states.shape[0]):
        v = states[i]
        if search.found[v]:
            continue
        enter(search, v)
        at_row[0] = groups[v]
        at[0] = indptr[groups[v]]
        while search.depth >= 0:
            v = search.path[search.depth]
            r = at_row[search.depth]
            k = at[search.depth]
            lowest = search.low[v]
            deeper = False
            while r < groups[v + 1]:
                if enabled[r]:
                    end = indptr[r + 1]
                    while k < end:
                        w = indices[k]
                        k += 1
                        if search.found[w] == 0:
                            deeper = True
                            break
                        elif search.component[w] < 0 and search.found[w] < lowest:
                            lowest = search.found[w]
                    if deeper:
                        break
                r += 1
                k = indptr[r]
            search.low[v] = lowest
            if deeper:
                at_row[search.depth] = r
                at[search.depth] = k
                enter(search, w)
                at_row[search.depth] = groups[w]
                at[search.depth] = indptr[groups[w]]
            else:
                leave(search)


def end_components(const int64_t[::1] indptr, const int32_t[::1] indices, const int64_t[::1] groups,
                   const int64_t[::1] pre, const int32_t[::1] rows_in, const int32_t[::1] owner,
                   const uint8_t[::1] within, usable):
    """Maximal end components made of states in `within` and rows in `usable` (uint8[rows] or None: all).

    Returns (component int32[n], -1 for none; enabled uint8[rows]: rows that stay in their component; count).
    Rounds of strong components over what changed in the round before; a component that loses nothing is an end component.
    """
    cdef int64_t n = pre.shape[0] - 1, s, k, r, i, j, e, head, tail
    cdef int64_t n_active = 0, n_next
    cdef int32_t p, count = 0
    cdef uint8_t[::1] enabled = np.ones(owner.shape[0], dtype=np.uint8) if usable is None else np.array(usable, dtype=np.uint8)
    cdef uint8_t[::1] open_ = np.zeros(n, dtype=np.uint8)
    cdef int32_t[::1] result = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] choices = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] active = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] scc = np.full(n, -1, dtype=np.int32)
    cdef int32_t[::1] found = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] low = np.zeros(n, dtype=np.int32)
    cdef int32_t[::1] finished = np.empty(n, dtype=np.int32)
    cdef int32_t[::1] path = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] at_row = np.empty(n, dtype=np.int64)
    cdef int64_t[::1] at = np.empty(n, dtype=np.int64)
    cdef int32_t[::1] order = np.empty(n, dtype=np.int32)
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    cdef int32_t[::1] queue = np.empty(n, dtype=np.int32)
    cdef bint changed
    cdef Search search = Search(
        &found[0], &low[0], &scc[0], &path[0], &finished[0], &order[0], &start[0], depth=-1, top=0, done=0, clock=0, count=0,
    )
    with nogil:
        # Rows that may leave `within` are unusable from the start.
        for s in range(n):
            if within[s]:
                open_[s] = 1
                active[n_active] = <int32_t>s
                n_active += 1
            else:
                for k in range(pre[s], pre[s + 1]):
                    enabled[rows_in[k]] = 0
        head = 0
        tail = 0
        for s in range(n):
            for r in range(groups[s], groups[s + 1]):
                if not open_[s]:
                    enabled[r] = 0
                elif enabled[r]:
                    choices[s] += 1
            if open_[s] and choices[s] == 0:
                open_[s] = 0
                queue[tail] = <int32_t>s
                tail += 1
        while True:
            # Remove states without a choice, and the rows that may enter them.
            while head < tail:
                s = queue[head]
                head += 1
                for k in range(pre[s], pre[s + 1]):
                    r = rows_in[k]
                    if enabled[r]:
                        enabled[r] = 0
                        p = owner[r]
                        choices[p] -= 1
                        if choices[p] == 0 and open_[p]:
                            open_[p] = 0
                            queue[tail] = p
                            tail += 1
            # Strong components of the active states over the enabled rows.
            n_next = 0
            for i in range(n_active):
                s = active[i]
                if open_[s]:
                    active[n_next] = <int32_t>s
                    n_next += 1
            n_active = n_next
            if n_active == 0:
                break
            strong_components(&search, active[:n_active], groups, indptr, indices, enabled, at_row, at)
            # Disable rows that leave their component; a component without such rows is settled.
            head = 0
            tail = 0
            n_next = 0
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
                        active[n_next] = <int32_t>s
                        n_next += 1
                        if choices[s] == 0:
                            open_[s] = 0
                            queue[tail] = <int32_t>s
                            tail += 1
                else:
                    for i in range(start[j], start[j + 1]):
                        result[order[i]] = count
                        open_[order[i]] = 0
                    count += 1
            n_active = n_next
            if n_active == 0:
                break
        # Rows of states that are in no end component do not count.
        for s in range(n):
            if result[s] < 0:
                for r in range(groups[s], groups[s + 1]):
                    enabled[r] = 0
    return np.asarray(result), np.asarray(enabled), count
