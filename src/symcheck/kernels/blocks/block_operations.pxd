# cython: language_level=3
"""The loops over the runs of a block, in C."""
from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.blocks.diagonal_runs cimport SmallRun, WideRun

cdef extern from *:
    """
    /* no clone with fused multiply-add: the digits shall not depend on the machine */
    #if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__GLIBC__)
    #define SYMCHECK_CLONES __attribute__((target_clones("avx2", "default")))
    #else
    #define SYMCHECK_CLONES
    #endif

    /* y += A x; the runs of a block come by ascending length, so that the branches are foreseen */
    #define SYMCHECK_MULTIPLY(NAME, RUN, X, Y)                                                                    \
    SYMCHECK_CLONES static void NAME(const RUN* run, int64_t runs, const double* values,                          \
                                     const double* __restrict__ x, double* __restrict__ y) {                      \
        int64_t i = 0;                                                                                            \
        for (; i < runs && run[i].length == 1; i++)                                                               \
            y[run[i].Y] += values[run[i].value] * x[run[i].X];                                                    \
        for (; i < runs && run[i].length == 2; i++) {                                                             \
            const double v = values[run[i].value];                                                                \
            const double* from = x + run[i].X;                                                                    \
            double* to = y + run[i].Y;                                                                            \
            const double a = to[0] + v * from[0], b = to[1] + v * from[1];                                        \
            to[0] = a;                                                                                            \
            to[1] = b;                                                                                            \
        }                                                                                                         \
        for (; i < runs; i++) {                                                                                   \
            const double v = values[run[i].value];                                                                \
            const double* __restrict__ from = x + run[i].X;                                                       \
            double* __restrict__ to = y + run[i].Y;                                                               \
            const int64_t n = run[i].length;                                                                      \
            for (int64_t j = 0; j < n; j++) to[j] += v * from[j];                                                 \
        }                                                                                                         \
    }
    SYMCHECK_MULTIPLY(multiply_small, SmallRun, col, row)
    SYMCHECK_MULTIPLY(multiply_wide, WideRun, col, row)
    SYMCHECK_MULTIPLY(transposed_small, SmallRun, row, col)
    SYMCHECK_MULTIPLY(transposed_wide, WideRun, row, col)

    /* the same for rows low .. high of the block only */
    #define SYMCHECK_CLIPPED(NAME, RUN)                                                                           \
    static void NAME(const RUN* run, int64_t runs, const double* values, const double* x, double* y,              \
                     int64_t low, int64_t high) {                                                                 \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            const int64_t row = run[i].row, shift = (int64_t)run[i].col - row;                                    \
            int64_t end = row + run[i].length;                                                                    \
            if (end > high) end = high;                                                                           \
            for (int64_t j = row > low ? row : low; j < end; j++) y[j] += v * x[j + shift];                       \
        }                                                                                                         \
    }
    SYMCHECK_CLIPPED(clipped_small, SmallRun)
    SYMCHECK_CLIPPED(clipped_wide, WideRun)

    #define SYMCHECK_COUNT(NAME, RUN)                                                                             \
    static void NAME(const RUN* run, int64_t runs, int32_t* counts) {                                             \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            int32_t* to = counts + run[i].row;                                                                    \
            for (int64_t j = 0; j < run[i].length; j++) to[j]++;                                                  \
        }                                                                                                         \
    }
    SYMCHECK_COUNT(count_small, SmallRun)
    SYMCHECK_COUNT(count_wide, WideRun)

    #define SYMCHECK_FILL(NAME, RUN)                                                                              \
    static void NAME(const RUN* run, int64_t runs, const double* values, int64_t* next, int64_t column,           \
                     int32_t* __restrict__ indices, double* __restrict__ data) {                                  \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            int64_t* at = next + run[i].row;                                                                      \
            const int32_t c = (int32_t)(column + run[i].col);                                                     \
            for (int64_t j = 0; j < run[i].length; j++) {                                                         \
                const int64_t p = at[j]++;                                                                        \
                indices[p] = c + (int32_t)j;                                                                      \
                data[p] = v;                                                                                      \
            }                                                                                                     \
        }                                                                                                         \
    }
    SYMCHECK_FILL(fill_small, SmallRun)
    SYMCHECK_FILL(fill_wide, WideRun)

    #define SYMCHECK_DIAGONAL(NAME, RUN)                                                                          \
    static void NAME(const RUN* run, int64_t runs, const double* values, int64_t shift, double* out) {            \
        for (int64_t i = 0; i < runs; i++)                                                                        \
            if ((int64_t)run[i].col - (int64_t)run[i].row == shift)                                               \
                for (int64_t j = 0; j < run[i].length; j++) out[run[i].row + j] += values[run[i].value];          \
    }
    SYMCHECK_DIAGONAL(diagonal_small, SmallRun)
    SYMCHECK_DIAGONAL(diagonal_wide, WideRun)

    #define SYMCHECK_COLUMNS(NAME, RUN)                                                                           \
    static void NAME(const RUN* run, int64_t runs, int64_t column, int32_t* out) {                                \
        for (int64_t i = 0; i < runs; i++)                                                                        \
            for (int64_t j = 0; j < run[i].length; j++) out[run[i].row + j] = (int32_t)(column + run[i].col + j); \
    }
    SYMCHECK_COLUMNS(columns_small, SmallRun)
    SYMCHECK_COLUMNS(columns_wide, WideRun)

    /* DO(s) for the states low .. high whose bit is set (bit s % 8 of byte s // 8), eight at a time */
    #define SYMCHECK_EACH(PRESENT, LOW, HIGH, DO)                                                                 \
        for (int64_t s = LOW; s < HIGH;) {                                                                        \
            unsigned bits = PRESENT[s >> 3] >> (s & 7);                                                           \
            const int64_t first = s, next = (s | 7) + 1;                                                          \
            if (next > HIGH) bits &= (1u << (HIGH - s)) - 1;                                                      \
            if (bits == 255) { for (s = first; s < first + 8; s++) { DO } }                                       \
            else for (; bits; bits &= bits - 1) { s = first + __builtin_ctz(bits); DO }                           \
            s = next;                                                                                             \
        }

    /* what a slot's rows are, into the next row of each state */
    static void scatter(const uint8_t* present, int64_t low, int64_t high, const double* part, int64_t* at, double* out) {
        SYMCHECK_EACH(present, low, high, out[at[s - low]++] = part[s - low];)
    }

    /* the better of them and what there is, without constants */
    static void improve(const uint8_t* present, int64_t low, int64_t high, const double* part, double* out, int greatest) {
        if (greatest) { SYMCHECK_EACH(present, low, high, out[s] = part[s - low] > out[s] ? part[s - low] : out[s];) }
        else { SYMCHECK_EACH(present, low, high, out[s] = part[s - low] < out[s] ? part[s - low] : out[s];) }
    }
    """
    void scatter(const uint8_t* present, int64_t low, int64_t high, const double* part, int64_t* at, double* out) noexcept nogil
    void improve(const uint8_t* present, int64_t low, int64_t high, const double* part, double* out, bint greatest) noexcept nogil
    void multiply_small(const SmallRun*, int64_t, const double*, const double* x, double* y) noexcept nogil
    void multiply_wide(const WideRun*, int64_t, const double*, const double* x, double* y) noexcept nogil
    void transposed_small(const SmallRun*, int64_t, const double*, const double* x, double* y) noexcept nogil
    void transposed_wide(const WideRun*, int64_t, const double*, const double* x, double* y) noexcept nogil
    void clipped_small(const SmallRun*, int64_t, const double*, const double* x, double* y, int64_t low, int64_t high) noexcept nogil
    void clipped_wide(const WideRun*, int64_t, const double*, const double* x, double* y, int64_t low, int64_t high) noexcept nogil
    void count_small(const SmallRun*, int64_t, int32_t* counts) noexcept nogil
    void count_wide(const WideRun*, int64_t, int32_t* counts) noexcept nogil
    void fill_small(const SmallRun*, int64_t, const double*, int64_t* next, int64_t column, int32_t*, double*) noexcept nogil
    void fill_wide(const WideRun*, int64_t, const double*, int64_t* next, int64_t column, int32_t*, double*) noexcept nogil
    void diagonal_small(const SmallRun*, int64_t, const double*, int64_t shift, double* out) noexcept nogil
    void diagonal_wide(const WideRun*, int64_t, const double*, int64_t shift, double* out) noexcept nogil
    void columns_small(const SmallRun*, int64_t, int64_t column, int32_t* out) noexcept nogil
    void columns_wide(const WideRun*, int64_t, int64_t column, int32_t* out) noexcept nogil
