# cython: boundscheck=False, wraparound=False, initializedcheck=False
"""Queues of states for breadth-first searches."""
from libc.stdint cimport int32_t, int64_t, uint8_t

cdef inline int64_t enqueue_members(
        const uint8_t[::1] members, uint8_t[::1] reached, int32_t[::1] queue) noexcept nogil:
    """Mark the members as reached and put them into the queue; returns how many they are."""
    cdef int64_t s, count = 0
    for s in range(members.shape[0]):
        if members[s]:
            reached[s] = 1
            queue[count] = <int32_t>s
            count += 1
    return count
