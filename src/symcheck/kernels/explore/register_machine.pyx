# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""A register machine for expressions over int64, double and bool (0 or 1 as an integer).

A program is int32[n, 4]: operation, destination, two operands, all of them registers (variables,
constants, temporaries). It ends with HALT (status DONE), FAIL (DISABLED: a guard is false) or the
status of an error. Doubles follow IEEE 754 (division by zero gives an infinity or NaN), but zero has
no sign; integer overflow is an error.

A decision on a double (a comparison, a rounding to an int) reads a bound on its error, which the
program computes beside it. Where the bound does not decide, the machine asks a `decider`: a Python
object with the indices of the variables that decision number k reads (`reads[k]`) and a method
`decide(k, values)`, which raises one of `faults` where the model has one. Any other exception, such
as that of Ctrl-C, ends the code; it is kept in `interruption`, for `raise_interruption`.

Source: Higham (2002), Accuracy and stability of numerical algorithms, 3.3 (running error analysis)
and 4.3 (the error of a sum or a product is a double).
"""

from libc.math cimport INFINITY, NAN, ceil, fabs, floor, fma, log, pow

from symcheck.kernels.portable cimport add_overflows, multiply_overflows, subtract_overflows

import numpy as np

cdef inline int to_integer(double x, Register* result) noexcept nogil:
    """Convert a double; a status if it is no int64."""
    if not (-9223372036854775808.0 <= x < 9223372036854775808.0):
        return Status.NOT_A_NUMBER if x - x != 0 else Status.OVERFLOW
    result.i = <long long> x
    return 0


cdef int power(long long base, long long exponent, Register* result) noexcept nogil:
    cdef long long value = 1
    if exponent < 0:
        return Status.NEGATIVE_POWER
    while True:
        if exponent & 1 and multiply_overflows(value, base, &value):
            return Status.OVERFLOW
        exponent >>= 1
        if exponent == 0:
            break
        if multiply_overflows(base, base, &base):
            # A base that no longer fits is needed again: only 0 and +-1 stay small, and they never
            # overflow.
            return Status.OVERFLOW
    result.i = value
    return 0


cdef inline int modulo(long long x, long long y, Register* result) noexcept nogil:
    if y == 0:
        return Status.MODULUS
    x = 0 if y == -1 else x % y  # the smallest int64 has no remainder by -1 in C
    if x < 0 and add_overflows(x, y, &x):
        return Status.OVERFLOW
    result.i = x
    return 0


cdef inline double logarithm(double x, double base) noexcept nogil:
    if not (0 < base < INFINITY) or base == 1 or not x >= 0:
        return NAN
    return log(x) / log(base)


cdef inline double nearest(double x) noexcept nogil:
    """The nearest int, upwards from the middle; x + 0.5 would be rounded."""
    cdef double whole = floor(x)
    return whole + 1 if x - whole >= 0.5 else whole


cdef enum:
    UNDECIDED_SIGN = 2

cdef double SLACK = 1.000001  # more than the rounding of bounds
cdef double TINY = 1e-250  # doubles below may have lost digits to underflow
cdef double FLOOR_OF_BOUNDS = 1e-300
cdef double HALF_UNIT = 1.1102230246251565e-16
cdef double CANCELLATION = 8796093022208.0  # 2**43 times the error: see `entry_errors.CLOSE`


cdef inline double conversion_error(long long x) noexcept nogil:
    """A bound on the rounding error of an int as a double."""
    if -9007199254740992LL <= x <= 9007199254740992LL:
        return 0
    return fabs(<double> x) * HALF_UNIT


cdef inline double sum_error(double x, double y) noexcept nogil:
    """The rounding error of x + y (Knuth)."""
    cdef double total = x + y, part = total - x
    return fabs((x - (total - part)) + (y - part))


cdef inline double product_error(double x, double y) noexcept nogil:
    """A bound on the rounding error of x * y, which is exact unless the product is tiny."""
    cdef double product = x * y
    if fabs(product) < TINY:
        return 0 if x == 0 or y == 0 else INFINITY
    return fabs(fma(x, y, -product))


cdef inline double division_residual(double x, double y) noexcept nogil:
    """A bound on |x - q y|, where q is x / y, rounded."""
    cdef double quotient = x / y
    if fabs(quotient) < TINY or fabs(x) < TINY:
        return 0 if x == 0 else INFINITY
    return fabs(fma(-quotient, y, x))


cdef inline double scale(double x, double error) noexcept nogil:
    """A bound on |x error|."""
    cdef double product = fabs(x * error)
    return FLOOR_OF_BOUNDS if product < FLOOR_OF_BOUNDS and x != 0 and error != 0 else product


cdef inline double share(double error, double y) noexcept nogil:
    """A bound on |error / y|; for y = 0, NaN, or 0 if there is no error."""
    cdef double quotient = fabs(error / y)
    if y == 0:
        return 0 if error == 0 else NAN
    return FLOOR_OF_BOUNDS if quotient < FLOOR_OF_BOUNDS and error != 0 else quotient


cdef inline int sign_of(double x, double error) noexcept nogil:
    """The sign of a number that differs from x by at most `error`, or UNDECIDED_SIGN."""
    if fabs(x) > error * SLACK and x - x == 0:
        return 1 if x > 0 else -1
    return 0 if x == 0 and error == 0 else UNDECIDED_SIGN


cdef inline bint is_between(double x, double error) noexcept nogil:
    """Whether floor is the same for all numbers that differ from x by at most `error`."""
    cdef double below = floor(x)
    return error == 0 or (x - below > error * SLACK and below + 1 - x > error * SLACK)


cdef int ask(void* decider, int number, Register* r, int dst) noexcept with gil:
    """Let the decider make a decision; a status if it cannot."""
    cdef int i
    if decider == NULL:
        return Status.UNDECIDED
    of_model = <object> decider
    try:
        values = tuple([r[<int> i].i for i in of_model.reads[number]])
        answer = of_model.decide(number, values)
        if isinstance(answer, float):
            r[dst].d = answer
        else:
            r[dst].i = answer
    except of_model.faults:
        return Status.UNDECIDED  # the interpreter finds it again, and describes it
    except BaseException as error:
        of_model.interruption = error
        return Status.UNDECIDED
    return 0


cdef raise_interruption(object decider):
    """Raise what has ended a decision and is no fault of the model."""
    if decider is not None and decider.interruption is not None:
        error, decider.interruption = decider.interruption, None
        raise error


cdef int execute(const Instruction* pc, const Instruction* code, Register* r,
                 void* decider) noexcept nogil:
    """Run from `pc` until the program ends; jumps are relative to `code`."""
    cdef int op, dst, a, b, status
    while True:
        op = pc.op
        dst = pc.dst
        a = pc.a
        b = pc.b
        pc += 1
        if op == Op.HALT:
            return Status.DONE
        elif op == Op.FAIL:
            return Status.DISABLED
        elif op == Op.MOVE:
            r[dst] = r[a]
        elif op == Op.REAL:
            r[dst].d = <double> r[a].i
        elif op == Op.ADDI:
            if add_overflows(r[a].i, r[b].i, &r[dst].i):
                return Status.OVERFLOW
        elif op == Op.SUBI:
            if subtract_overflows(r[a].i, r[b].i, &r[dst].i):
                return Status.OVERFLOW
        elif op == Op.MULI:
            if multiply_overflows(r[a].i, r[b].i, &r[dst].i):
                return Status.OVERFLOW
        elif op == Op.NEGI:
            if subtract_overflows(0, r[a].i, &r[dst].i):
                return Status.OVERFLOW
        elif op == Op.MINI:
            r[dst].i = r[b].i if r[b].i < r[a].i else r[a].i
        elif op == Op.MAXI:
            r[dst].i = r[b].i if r[b].i > r[a].i else r[a].i
        elif op == Op.MODI:
            status = modulo(r[a].i, r[b].i, &r[dst])
            if status:
                return status
        elif op == Op.POWI:
            status = power(r[a].i, r[b].i, &r[dst])
            if status:
                return status
        elif op == Op.ADDD:
            r[dst].d = r[a].d + r[b].d
        elif op == Op.SUBD:
            r[dst].d = r[a].d - r[b].d
        elif op == Op.MULD:
            r[dst].d = r[a].d * r[b].d
        elif op == Op.DIVD:
            r[dst].d = r[a].d / (r[b].d + 0.0)
        elif op == Op.NEGD:
            r[dst].d = -r[a].d
        elif op == Op.MIND:
            r[dst].d = r[b].d if r[b].d < r[a].d or r[b].d != r[b].d else r[a].d
        elif op == Op.MAXD:
            r[dst].d = r[b].d if r[b].d > r[a].d or r[b].d != r[b].d else r[a].d
        elif op == Op.POWD:
            r[dst].d = pow(r[a].d + 0.0, r[b].d)
        elif op == Op.LOGD:
            r[dst].d = logarithm(r[a].d, r[b].d)
        elif op == Op.FLOOR:
            status = to_integer(floor(r[a].d), &r[dst])
            if status:
                return status
        elif op == Op.CEIL:
            status = to_integer(ceil(r[a].d), &r[dst])
            if status:
                return status
        elif op == Op.ROUND:
            status = to_integer(nearest(r[a].d), &r[dst])
            if status:
                return status
        elif op == Op.EQI:
            r[dst].i = r[a].i == r[b].i
        elif op == Op.NEI:
            r[dst].i = r[a].i != r[b].i
        elif op == Op.LTI:
            r[dst].i = r[a].i < r[b].i
        elif op == Op.LEI:
            r[dst].i = r[a].i <= r[b].i
        elif op == Op.EQD:
            r[dst].i = r[a].d == r[b].d
        elif op == Op.NED:
            r[dst].i = r[a].d != r[b].d
        elif op == Op.LTD:
            r[dst].i = r[a].d < r[b].d
        elif op == Op.LED:
            r[dst].i = r[a].d <= r[b].d
        elif op == Op.NOT:
            r[dst].i = r[a].i ^ 1
        elif op == Op.AND:
            r[dst].i = r[a].i & r[b].i
        elif op == Op.OR:
            r[dst].i = r[a].i | r[b].i
        elif op == Op.REALE:
            r[dst].d = conversion_error(r[a].i)
        elif op == Op.ADDE:
            r[dst].d = sum_error(r[a].d, r[b].d)
        elif op == Op.MULE:
            r[dst].d = product_error(r[a].d, r[b].d)
        elif op == Op.DIVE:
            r[dst].d = division_residual(r[a].d, r[b].d)
        elif op == Op.SCALE:
            r[dst].d = scale(r[a].d, r[b].d)
        elif op == Op.SHARE:
            r[dst].d = share(r[a].d, r[b].d)
        elif op == Op.LESS:
            r[dst].d = fabs(r[a].d) - r[b].d * SLACK if fabs(r[a].d) > r[b].d * SLACK else 0
        elif op == Op.GROWTH:
            r[dst].d = 2 * r[a].d if r[a].d < 0.25 else INFINITY
        elif op == Op.ZERO:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status == 0
                pc += 1
        elif op == Op.NONZERO:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status != 0
                pc += 1
        elif op == Op.NEGATIVE:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status < 0
                pc += 1
        elif op == Op.NONNEGATIVE:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status >= 0
                pc += 1
        elif op == Op.POSITIVE:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status > 0
                pc += 1
        elif op == Op.NONPOSITIVE:
            status = sign_of(r[a].d, r[b].d)
            if status != UNDECIDED_SIGN:
                r[dst].i = status <= 0
                pc += 1
        elif op == Op.FLOORS:
            if is_between(r[a].d, r[b].d) and not to_integer(floor(r[a].d), &r[dst]):
                pc += 1
        elif op == Op.CEILS:
            if is_between(r[a].d, r[b].d) and not to_integer(ceil(r[a].d), &r[dst]):
                pc += 1
        elif op == Op.ROUNDS:
            if ((r[b].d == 0 or fabs(r[a].d - floor(r[a].d) - 0.5) > r[b].d * SLACK)
                    and not to_integer(nearest(r[a].d), &r[dst])):
                pc += 1
        elif op == Op.NUMBER:
            r[dst].d = r[a].d
            if r[b].d == 0 or (fabs(r[a].d) > r[b].d * CANCELLATION and r[a].d - r[a].d == 0):
                pc += 1
        elif op == Op.ASK:
            status = ask(decider, a, r, dst)
            if status:
                return status
        elif op == Op.JUMP:
            pc = code + dst
        elif op == Op.JTRUE:
            if r[a].i:
                pc = code + dst
        elif op == Op.JFALSE:
            if not r[a].i:
                pc = code + dst
        elif op == Op.JEQI:
            if r[a].i == r[b].i:
                pc = code + dst
        elif op == Op.JNEI:
            if r[a].i != r[b].i:
                pc = code + dst
        elif op == Op.JLTI:
            if r[a].i < r[b].i:
                pc = code + dst
        elif op == Op.JGEI:
            if r[a].i >= r[b].i:
                pc = code + dst
        elif op == Op.JEQD:
            if r[a].d == r[b].d:
                pc = code + dst
        elif op == Op.JNED:
            if r[a].d != r[b].d:
                pc = code + dst
        elif op == Op.JLTD:
            if r[a].d < r[b].d:
                pc = code + dst
        elif op == Op.JNLTD:
            if not (r[a].d < r[b].d):
                pc = code + dst
        elif op == Op.JLED:
            if r[a].d <= r[b].d:
                pc = code + dst
        elif op == Op.JNLED:
            if not (r[a].d <= r[b].d):
                pc = code + dst


def evaluate(const int[:, ::1] code, long long[::1] registers, decider=None) -> int:
    """Run code until it halts, and write its results into the registers.

    Args:
        code: instructions, int32[n, 4].
        registers: int64[m], where doubles are stored by their bits.
        decider: decides what the rounding errors leave open.

    Returns:
        The Status in which the code ended.
    """
    cdef const Instruction* program = <const Instruction*> &code[0, 0]
    cdef int status = execute(program, program, <Register*> &registers[0], _pointer(decider))
    raise_interruption(decider)
    return status


cdef void* _pointer(object decider):
    """A decider that the caller keeps, for `execute`."""
    return NULL if decider is None else <void*> decider


def apply_to_doubles(op: int, const double[:] x, const double[:] y) -> Floats:
    """The doubles that an operation on two doubles gives for each pair.

    Args:
        op: a member of `Op` such as POWD, with two operands and a result that are doubles.
        x, y: float64[n].
    Returns:
        float64[n].
    """
    cdef Instruction[2] code = [Instruction(op, 2, 0, 1), Instruction(Op.HALT, 0, 0, 0)]
    cdef Register[3] r
    cdef Py_ssize_t i
    if x.shape[0] != y.shape[0]:
        raise ValueError("the operands differ in length")
    result = np.empty(x.shape[0])
    cdef double[::1] out = result
    with nogil:
        for i in range(x.shape[0]):
            r[0].d = x[i]
            r[1].d = y[i]
            execute(code, code, r, NULL)
            out[i] = r[2].d
    return result


def decide_doubles(op: int, const double[:] x, const double[:] errors) -> tuple[Int64s | Floats, Bools]:
    """The answers of a decision on doubles with bounds on their errors.

    Args:
        op: a member of `Op` from ZERO to NUMBER.
        x, errors: float64[n].
    Returns:
        int64[n] (float64[n] for NUMBER), arbitrary where the bounds do not decide, and bool[n]:
        where they do not.
    """
    cdef Instruction[3] code = [Instruction(op, 2, 0, 1), Instruction(Op.FAIL, 0, 0, 0),
                                Instruction(Op.HALT, 0, 0, 0)]
    cdef Register[3] r
    cdef Py_ssize_t i
    if x.shape[0] != errors.shape[0]:
        raise ValueError("the operands differ in length")
    answers, unsure = np.empty(x.shape[0], np.int64), np.empty(x.shape[0], np.bool_)
    cdef long long[::1] out = answers
    cdef unsigned char[::1] undecided = unsure.view(np.uint8)
    with nogil:
        for i in range(x.shape[0]):
            r[0].d = x[i]
            r[1].d = errors[i]
            r[2].i = 0
            undecided[i] = execute(code, code, r, NULL) == Status.DISABLED
            out[i] = r[2].i
    return answers.view(np.float64) if op == Op.NUMBER else answers, unsure


def run_packed(const int[:, ::1] code, const long long[::1] slots, const int[:, ::1] fields,
               const long long[::1] lows, const unsigned long long[:, ::1] states, int result,
               long long[::1] numbers or None,
               unsigned char[::1] truths or None, decider) -> tuple[int, int]:
    """Evaluate a program on packed states.

    Args:
        code: int32[instructions, 4]. slots: int64[registers], the first content of the registers.
        fields: int32[k, 4], register, word, shift and bits of each variable. lows: int64[k], their
            least values.
        states: uint64[n, words].
        result: the register whose value is stored.
        numbers, truths: int64[n] (doubles by their bits) or uint8[n], the one that is not None
            receives the values.
        decider: decides what the rounding errors leave open.
    Returns:
        (state, status) of the first state without a value, or (-1, 0).
    """
    cdef Py_ssize_t row, j, faulty = -1
    cdef const Instruction* program = <const Instruction*> &code[0, 0]
    cdef long long[::1] registers = np.append(slots, 0)
    cdef Register* r = <Register*> &registers[0]
    cdef unsigned long long bits
    cdef int status = 0
    cdef void* decides = _pointer(decider)
    with nogil:
        for row in range(states.shape[0]):
            for j in range(fields.shape[0]):
                bits = states[row, fields[j, 1]] >> fields[j, 2]
                bits &= (<unsigned long long> 1 << fields[j, 3]) - 1
                r[fields[j, 0]].i = <long long> bits + lows[j]
            status = execute(program, program, r, decides)
            if status:
                faulty = row
                break
            if truths is not None:
                truths[row] = <unsigned char> r[result].i
            else:
                numbers[row] = r[result].i
    raise_interruption(decider)
    return faulty, status
