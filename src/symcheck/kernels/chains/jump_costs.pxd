# cython: language_level=3
"""The costs of jumps, of which exponential supermartingales and Lyapunov functions are made."""
from libc.math cimport log


cdef inline double cost_of_jump(double rate, double leaving) noexcept nogil:
    """Minus the logarithm of twice the probability: a jump that is likelier than not costs nothing.
    """
    return 0.0 if rate >= 0.5 * leaving else log(0.5 * leaving) - log(rate)
