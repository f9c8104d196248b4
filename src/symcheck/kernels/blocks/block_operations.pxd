# cython: language_level=3
"""The loops over the runs of a block, in C."""
from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.blocks.diagonal_runs cimport Runs

cdef extern from *:
    """
    #include "portable.h"

    /* y += A x; the runs of a block are sorted by length, so that branches are predictable */
    #define SYMCHECK_MULTIPLY(NAME, RUN)                                                                          \
    SYMCHECK_CLONES static void NAME(const RUN* run, int64_t runs, const double* values,                          \
                                     const double* SYMCHECK_RESTRICT x, double* SYMCHECK_RESTRICT y) {                      \
        int64_t i = 0;                                                                                            \
        for (; i < runs && run[i].length == 1; i++)                                                               \
            y[run[i].row] += values[run[i].value] * x[run[i].col];                                                \
        for (; i < runs && run[i].length == 2; i++) {                                                             \
            const double v = values[run[i].value];                                                                \
            const double* from = x + run[i].col;                                                                  \
            double* to = y + run[i].row;                                                                          \
            const double a = to[0] + v * from[0], b = to[1] + v * from[1];                                        \
            to[0] = a;                                                                                            \
            to[1] = b;                                                                                            \
        }                                                                                                         \
        for (; i < runs; i++) {                                                                                   \
            const double v = values[run[i].value];                                                                \
            const double* SYMCHECK_RESTRICT from = x + run[i].col;                                                     \
            double* SYMCHECK_RESTRICT to = y + run[i].row;                                                             \
            const int64_t n = run[i].length;                                                                      \
            for (int64_t j = 0; j < n; j++) to[j] += v * from[j];                                                 \
        }                                                                                                         \
    }
    SYMCHECK_MULTIPLY(multiply_small, SmallRun)
    SYMCHECK_MULTIPLY(multiply_wide, WideRun)

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
                     int32_t* SYMCHECK_RESTRICT indices, double* SYMCHECK_RESTRICT data) {                                  \
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
            else for (; bits; bits &= bits - 1) { s = first + trailing_zeros(bits); DO }                           \
            s = next;                                                                                             \
        }

    /* write the rows of a slot to the next row of each state */
    static void scatter(const uint8_t* present, int64_t low, int64_t high, const double* product, int64_t* next_row, double* out) {
        SYMCHECK_EACH(present, low, high, out[next_row[s - low]++] = product[s - low];)
    }

    /* the same for the runs of a block in either form */
    #define SYMCHECK_BOTH(NAME, PARAMETERS, ...)                                                                  \
    static void NAME PARAMETERS {                                                                                 \
        if (runs.wide) NAME##_wide(runs.wide, runs.count, __VA_ARGS__);                                           \
        else NAME##_small(runs.small, runs.count, __VA_ARGS__);                                                   \
    }
    SYMCHECK_BOTH(multiply, (Runs runs, const double* values, const double* x, double* y), values, x, y)
    SYMCHECK_BOTH(clipped, (Runs runs, const double* values, const double* x, double* y, int64_t low,
                            int64_t high), values, x, y, low, high)
    SYMCHECK_BOTH(count, (Runs runs, int32_t* counts), counts)
    SYMCHECK_BOTH(fill, (Runs runs, const double* values, int64_t* next, int64_t column,
                         int32_t* indices, double* data), values, next, column, indices, data)
    SYMCHECK_BOTH(columns, (Runs runs, int64_t column, int32_t* out), column, out)
    """
    void scatter(const uint8_t* present, int64_t low, int64_t high, const double* product,
                 int64_t* next_row, double* out) noexcept nogil
    void multiply(Runs, const double* values, const double* x, double* y) noexcept nogil
    void clipped(Runs, const double* values, const double* x, double* y, int64_t low,
                 int64_t high) noexcept nogil
    void count(Runs, int32_t* counts) noexcept nogil
    void fill(Runs, const double* values, int64_t* next, int64_t column, int32_t* indices,
              double* data) noexcept nogil
    void columns(Runs, int64_t column, int32_t* out) noexcept nogil
