/* What C has no words for: each with the form that gcc and clang compile best on POSIX, and a twin in
   standard C (or of Windows). -DSYMCHECK_PORTABLE selects the twins everywhere, for tests. */
#ifndef SYMCHECK_PORTABLE_H
#define SYMCHECK_PORTABLE_H

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#if defined(__GNUC__) && !defined(SYMCHECK_PORTABLE)
#define SYMCHECK_GNU 1
#else
#define SYMCHECK_GNU 0
#endif

/* ---- memory and time ---- */

/* Ask for huge pages for an array, which save page-table walks if it is read at random. */
#if SYMCHECK_GNU && defined(__linux__)
#include <sys/mman.h>
static inline void prefer_huge_pages(void* data, size_t size) {
    uintptr_t begin = ((uintptr_t)data + 4095) / 4096 * 4096, end = (uintptr_t)data + size;
    if (size >= 4194304) madvise((void*)begin, (end - begin) / 4096 * 4096, MADV_HUGEPAGE);
}
#else
static inline void prefer_huge_pages(void* data, size_t size) { (void)data; (void)size; }
#endif

/* Return freed memory that the allocator keeps to the system. */
#if SYMCHECK_GNU && defined(__GLIBC__)
#include <malloc.h>
#define trim_heap() malloc_trim(0)
#else
#define trim_heap() ((void)0)
#endif

/* Files as memory. The space on the disk is reserved, because a write into a mapped file that finds no
   space would end the process. Elsewhere than on Linux no file is opened. */
#if SYMCHECK_GNU && defined(__linux__)
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>
static inline int open_unnamed_file(const char* folder) {
    char name[4096];
    int file = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file >= 0) return file;
    if (snprintf(name, sizeof name, "%s/symcheckXXXXXX", folder) >= (int)sizeof name) return -1;
    file = mkstemp(name);
    if (file >= 0) unlink(name);
    return file;
}
static inline void close_file(int file) { close(file); }
static inline void* map_file(int file, size_t size) {
    void* data;
    if (posix_fallocate(file, 0, (off_t)size)) return NULL;
    data = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    return data == MAP_FAILED ? NULL : data;
}
static inline void* resize_mapped_file(void* data, size_t old, size_t size, int file) {
    if (size > old && posix_fallocate(file, (off_t)old, (off_t)(size - old))) return NULL;
    data = mremap(data, old, size, MREMAP_MAYMOVE);
    return data == MAP_FAILED ? NULL : data;
}
static inline void unmap_file(void* data, size_t size, int file) {
    munmap(data, size);
    close(file);
}
#else
static inline int open_unnamed_file(const char* folder) { (void)folder; return -1; }
static inline void close_file(int file) { (void)file; }
static inline void* map_file(int file, size_t size) { (void)file; (void)size; return NULL; }
static inline void* resize_mapped_file(void* data, size_t old, size_t size, int file) {
    (void)data; (void)old; (void)size; (void)file; return NULL;
}
static inline void unmap_file(void* data, size_t size, int file) { (void)data; (void)size; (void)file; }
#endif

/* Seconds on a clock that is never set back. */
#if defined(_WIN32)
#include <windows.h>
static inline double monotonic_seconds(void) {
    LARGE_INTEGER count, frequency;
    QueryPerformanceCounter(&count);
    QueryPerformanceFrequency(&frequency);
    return (double)count.QuadPart / (double)frequency.QuadPart;
}
#else
#include <time.h>
static inline double monotonic_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
#endif

/* ---- hints, bits and functions in two versions ---- */

#if SYMCHECK_GNU
#define prefetch(address) __builtin_prefetch(address)
#define trailing_zeros(bits) __builtin_ctz(bits)
#else
#define prefetch(address) ((void)(address))
static inline int trailing_zeros(unsigned bits) { /* bits != 0 */
    int count = 0;
    for (; !(bits & 1); bits >>= 1) count++;
    return count;
}
#endif

/* Numbers that threads share. Without atomic operations, one thread must work alone. */
#if SYMCHECK_GNU
#include <sched.h>
#define HAS_ATOMICS 1
#define next_number(counter) __atomic_fetch_add(counter, 1, __ATOMIC_RELAXED)
#define publish(flag, value) __atomic_store_n(flag, value, __ATOMIC_RELEASE)
static inline void wait_until(const int32_t* flag, int32_t value) {
    int spins = 0;
    while (__atomic_load_n(flag, __ATOMIC_ACQUIRE) != value)
        if (++spins % 256 == 0) sched_yield();
}
#else
#define HAS_ATOMICS 0
#define next_number(counter) ((*(counter))++)
#define publish(flag, value) (*(flag) = (value))
#define wait_until(flag, value) ((void)(flag))
#endif

/* A function for processors with and without AVX2. There is none with fused multiply-add: results must
   not depend on the machine. */
#if SYMCHECK_GNU && defined(__x86_64__) && !defined(__clang__) && defined(__GLIBC__)
#define SYMCHECK_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define SYMCHECK_CLONES
#endif

#if defined(_MSC_VER) && !defined(__clang__)
#define SYMCHECK_RESTRICT __restrict
#else
#define SYMCHECK_RESTRICT __restrict__
#endif

/* ---- integers: whether an operation overflows; the result is defined if it does not ---- */

#if SYMCHECK_GNU
#define add_overflows(x, y, result) __builtin_add_overflow(x, y, result)
#define subtract_overflows(x, y, result) __builtin_sub_overflow(x, y, result)
#define multiply_overflows(x, y, result) __builtin_mul_overflow(x, y, result)
#else
static inline int add_overflows(long long x, long long y, long long* result) {
    if (y > 0 ? x > LLONG_MAX - y : x < LLONG_MIN - y) return 1;
    *result = x + y;
    return 0;
}
static inline int subtract_overflows(long long x, long long y, long long* result) {
    if (y < 0 ? x > LLONG_MAX + y : x < LLONG_MIN + y) return 1;
    *result = x - y;
    return 0;
}
static inline int multiply_overflows(long long x, long long y, long long* result) {
    if (x > 0 ? (y > 0 ? x > LLONG_MAX / y : y < LLONG_MIN / x)
              : (y > 0 ? x < LLONG_MIN / y : x != 0 && y < LLONG_MAX / x)) return 1;
    *result = x * y;
    return 0;
}
#endif

/* ---- non-negative integers of 128 bits ---- */

#if SYMCHECK_GNU && defined(__SIZEOF_INT128__)
typedef __int128 Wide;
static inline Wide wide_of(uint64_t low) { return (Wide)low; }
static inline uint64_t wide_low(Wide a) { return (uint64_t)a; }
static inline uint64_t wide_high(Wide a) { return (uint64_t)(a >> 64); }
static inline Wide wide_sum(Wide a, Wide b) { return a + b; }
static inline Wide wide_left(Wide a, int shift) { return a << shift; }
static inline Wide wide_right(Wide a, int shift) { return a >> shift; }
static inline double wide_double(Wide a) { return (double)a; }
#else
typedef struct { uint64_t low, high; } Wide;
static inline Wide wide_of(uint64_t low) { Wide a = {low, 0}; return a; }
static inline uint64_t wide_low(Wide a) { return a.low; }
static inline uint64_t wide_high(Wide a) { return a.high; }
static inline Wide wide_sum(Wide a, Wide b) {
    Wide sum = {a.low + b.low, a.high + b.high};
    sum.high += sum.low < a.low;
    return sum;
}
static inline Wide wide_left(Wide a, int shift) { /* 0 <= shift < 128 */
    Wide out = {shift < 64 ? a.low << shift : 0,
                shift >= 64 ? a.low << (shift - 64)
                            : shift ? a.high << shift | a.low >> (64 - shift) : a.high};
    return out;
}
static inline Wide wide_right(Wide a, int shift) { /* 0 <= shift < 128 */
    Wide out = {shift >= 64 ? a.high >> (shift - 64)
                            : shift ? a.low >> shift | a.high << (64 - shift) : a.low,
                shift < 64 ? a.high >> shift : 0};
    return out;
}
/* Rounded once: the last of 64 digits says whether a digit that was shifted out is not 0. */
static inline double wide_double(Wide a) {
    int shift = 0;
    uint64_t lost = 0;
    while (a.high) {
        lost |= a.low & 1;
        a = wide_right(a, 1);
        shift++;
    }
    return ldexp((double)(a.low | lost), shift);
}
#endif

/* ---- sums of non-negative doubles with at most two roundings in all ----

   A long double with 64 binary digits or more, or a compensated sum (Neumaier 1974) where long double
   is only a double, as with MSVC and on ARM under macOS: its error is below 2 roundings of the sum and
   n^2 of squared ones. Products are rounded in addition there. */

#if LDBL_MANT_DIG >= 64 && !defined(SYMCHECK_PORTABLE)
typedef long double Sum;
static inline Sum sum_of(double x) { return x; }
static inline Sum add_term(Sum s, double x) { return s + x; }
static inline Sum add_product(Sum s, double a, double b) { return s + (long double)a * b; }
static inline Sum add_sum(Sum s, Sum t) { return s + t; }
static inline int is_positive(Sum s) { return s > 0.0L; }
static inline int in_range(Sum s) { return s <= DBL_MAX; }
static inline double rounded(Sum s) { return (double)s; }
static inline double divided(Sum s, double x) { return (double)(s / x); }
static inline double divide_by(double x, Sum s) { return (double)(x / s); }
static inline double quotient(Sum s, Sum t) { return (double)(s / t); }
/* Whether the product of two numbers loses digits at the lower end of the range. */
static inline int product_underflows(double a, double b) { (void)a; (void)b; return 0; }
/* Further roundings per state of an elimination than with long doubles. */
#define COMPENSATED_ROUNDINGS 0.0
#else
typedef struct { double sum, rest; } Sum;
static inline Sum sum_of(double x) { Sum s = {x, 0.0}; return s; }
static inline Sum add_term(Sum s, double x) {
    const double sum = s.sum + x;
    s.rest += s.sum >= x ? (s.sum - sum) + x : (x - sum) + s.sum;
    s.sum = sum;
    return s;
}
static inline Sum add_product(Sum s, double a, double b) { return add_term(s, a * b); }
static inline Sum add_sum(Sum s, Sum t) {
    s = add_term(s, t.sum);
    s.rest += t.rest;
    return s;
}
static inline int is_positive(Sum s) { return s.sum > 0.0; }
static inline double rounded(Sum s) { return s.sum <= DBL_MAX ? s.sum + s.rest : s.sum; }
static inline int in_range(Sum s) { return s.sum <= DBL_MAX; }
static inline double divided(Sum s, double x) { return rounded(s) / x; }
static inline double divide_by(double x, Sum s) { return x / rounded(s); }
static inline double quotient(Sum s, Sum t) { return rounded(s) / rounded(t); }
static inline int product_underflows(double a, double b) {
    return a > 0.0 && b > 0.0 && a * b < DBL_MIN;
}
#define COMPENSATED_ROUNDINGS 6.0
#endif

#endif
