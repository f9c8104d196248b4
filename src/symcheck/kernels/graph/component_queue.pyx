# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Strong components in an order in which the values of their successors are known before.

Backward induction, component by component: Dai, Mausam, Weld & Goldsmith (2011), Topological value
iteration algorithms.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t


cdef class ComponentQueue:
    """Components that wait for the values of their successors.

    Args:
        column_ptr, column_rows, row_state: the transposed structure (see
            `symcheck.kernels.graph.mdp_graph`).
        component: int32[states], the component of each state; -1 for states of other parts, and
            for states with known values.
        count: of components.
        unknown: uint8[states], the states without a known value, also those of other parts.
        excluded: uint8[states]; components with such a state are never ready.
    """

    cdef const int64_t[::1] column_ptr
    cdef const int32_t[::1] column_rows, row_state, component
    cdef int64_t[::1] waiting       # for each component: entries of unknown states outside of it
    cdef int32_t[::1] queue         # components that were ready, in their order
    cdef int64_t count

    def __init__(self, const int64_t[::1] column_ptr, const int32_t[::1] column_rows,
                 const int32_t[::1] row_state, const int32_t[::1] component, int64_t count,
                 const uint8_t[::1] unknown, const uint8_t[::1] excluded):
        cdef int64_t s, k
        cdef int32_t c
        self.column_ptr, self.column_rows, self.row_state = column_ptr, column_rows, row_state
        self.component = component
        self.waiting = np.zeros(count, dtype=np.int64)
        self.queue = np.empty(count, dtype=np.int32)
        with nogil:
            for s in range(component.shape[0]):
                if component[s] >= 0 and excluded[s]:
                    self.waiting[component[s]] += 1
                if not unknown[s]:
                    continue
                for k in range(column_ptr[s], column_ptr[s + 1]):
                    c = component[row_state[column_rows[k]]]
                    if c >= 0 and c != component[s]:
                        self.waiting[c] += 1
            for c in range(count):
                if self.waiting[c] == 0:
                    self.push(c)

    cdef void push(self, int32_t component) noexcept nogil:
        """Add a component that is ready."""
        self.queue[self.count] = component
        self.count += 1

    cdef void release(self, int64_t state) noexcept nogil:
        """Add the components that waited for the value of this state only."""
        cdef int64_t k
        cdef int32_t c
        for k in range(self.column_ptr[state], self.column_ptr[state + 1]):
            c = self.component[self.row_state[self.column_rows[k]]]
            if c >= 0 and c != self.component[state]:
                self.waiting[c] -= 1
                if self.waiting[c] == 0:
                    self.push(c)

    def ready(self, const int32_t[::1] found, const int32_t[::1] order,
              const int64_t[::1] start) -> Int32s:
        """The components that have become ready, successors first.

        Args:
            found: int32, states of other parts whose values have become known.
            order: int32, the states by component. start: int64[components+1] into `order`.
        Returns:
            int32, components; their values are counted as known.
        """
        cdef int64_t i, head = 0
        cdef int32_t c
        with nogil:
            for i in range(found.shape[0]):
                self.release(found[i])
            while head < self.count:
                c = self.queue[head]
                head += 1
                for i in range(start[c], start[c + 1]):
                    self.release(order[i])
        self.count = 0
        return np.asarray(self.queue[:head]).copy()
