# cython: language_level=3
"""The register machine that evaluates compiled expressions, for the kernels that run it."""


cdef union Register:
    long long i
    double d


cdef struct Instruction:
    int op
    int dst
    int a
    int b


cpdef enum Op:
    HALT = 0
    FAIL
    MOVE
    REAL
    ADDI
    SUBI
    MULI
    NEGI
    MINI
    MAXI
    MODI
    POWI
    ADDD
    SUBD
    MULD
    DIVD
    NEGD
    MIND
    MAXD
    POWD
    LOGD
    FLOOR
    CEIL
    ROUND
    EQI
    NEI
    LTI
    LEI
    EQD
    NED
    LTD
    LED
    NOT
    AND
    OR
    # Rounding errors of doubles, and bounds made of them.
    REALE
    ADDE
    MULE
    DIVE
    SCALE
    SHARE
    LESS
    GROWTH
    # Decisions on a double with a bound on its error; where that does not decide, ASK does, which
    # follows.
    ZERO
    NONZERO
    NEGATIVE
    NONNEGATIVE
    POSITIVE
    NONPOSITIVE
    FLOORS
    CEILS
    ROUNDS
    NUMBER
    ASK
    # From here on `dst` is the target of a jump.
    JUMP
    JTRUE
    JFALSE
    JEQI
    JNEI
    JLTI
    JGEI
    JEQD
    JNED
    JLTD
    JNLTD
    JLED
    JNLED


cpdef enum Status:
    DONE = 0
    DISABLED
    OVERFLOW
    MODULUS
    NEGATIVE_POWER
    NOT_A_NUMBER
    UNDECIDED
    # These are detected by the exploration, not by the machine.
    RANGE
    PROBABILITY
    SUM
    MEMORY


cdef int execute(const Instruction* pc, const Instruction* code, Register* r,
                 void* decider) noexcept nogil
cdef raise_interruption(object decider)
