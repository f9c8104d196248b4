# cython: language_level=3
"""What C has no words for, with a twin for each compiler and system: see portable.h."""
from libc.stdint cimport int32_t, int64_t, uint64_t

cdef extern from "portable.h" nogil:
    void prefer_huge_pages(void* data, size_t size)
    void trim_heap()
    int open_unnamed_file(const char* folder)
    void* map_file(int file, size_t size)
    void* resize_mapped_file(void* data, size_t old, size_t size, int file)
    void unmap_file(void* data, size_t size, int file)
    void close_file(int file)
    void prefetch(const void* address)
    double monotonic_seconds()

    const bint HAS_ATOMICS
    int64_t next_number(int64_t* counter)                 # for each thread another one
    void publish(int32_t* flag, int32_t value)            # after all that was written before
    void wait_until(const int32_t* flag, int32_t value)   # and then read what was written

    bint add_overflows(long long x, long long y, long long* result)
    bint subtract_overflows(long long x, long long y, long long* result)
    bint multiply_overflows(long long x, long long y, long long* result)

    ctypedef struct Wide:     # a non-negative integer of 128 bits; not a struct where C has one
        pass
    Wide wide_of(uint64_t low)
    uint64_t wide_low(Wide a)
    uint64_t wide_high(Wide a)
    Wide wide_sum(Wide a, Wide b)
    Wide wide_left(Wide a, int shift)
    Wide wide_right(Wide a, int shift)
    double wide_double(Wide a)

    ctypedef struct Sum:      # a sum of non-negative doubles, rounded at most twice in all
        pass
    Sum sum_of(double x)
    Sum add_term(Sum s, double x)
    Sum add_product(Sum s, double a, double b)
    Sum add_sum(Sum s, Sum t)
    bint is_positive(Sum s)
    bint in_range(Sum s)
    double rounded(Sum s)
    double divided(Sum s, double x)
    double divide_by(double x, Sum s)
    double quotient(Sum s, Sum t)
    bint product_underflows(double a, double b)
    const double COMPENSATED_ROUNDINGS
