"""Products of diagrams that do not vanish by underflow."""

from __future__ import annotations

from functools import reduce
from math import prod
from operator import and_
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["nothing_lost"]

_SURELY_NORMAL = 1e-290
"""Numbers of which a product is at least this do not underflow, even divided by some million."""


def nothing_lost(computed: Mtbdd, *factors: Mtbdd) -> Mtbdd:
    """A product or quotient, with the least double where it underflows to 0.

    So the graph keeps an edge, and a reward is not taken for none; equations refuse subnormal
    numbers.

    Args:
        computed: the product, or the first factor divided by numbers of at least 1.
        factors: those of which none is 0 where the exact result is not.
    """
    least = prod(min((abs(v) for v in f.leaves if v != 0.0), default=1.0) for f in factors)
    if least >= _SURELY_NORMAL:
        return computed
    lost = reduce(and_, (f.to_bdd() for f in factors)) - computed.to_bdd()
    return computed + lost.to_mtbdd(5e-324) if lost else computed
