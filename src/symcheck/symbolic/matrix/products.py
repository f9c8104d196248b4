"""Products of diagrams that do not vanish by underflow."""

from __future__ import annotations

from functools import reduce
from operator import and_
from typing import TYPE_CHECKING

import numpy as np

from symcheck.semantics.expressions.literals import LEAST

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
    least = 1.0
    for factor in factors:
        sizes = np.abs(factor.leaves)
        least *= float(sizes.min(initial=1.0, where=sizes > 0.0))
    if least >= _SURELY_NORMAL:
        return computed
    lost = reduce(and_, (f.to_bdd() for f in factors)) - computed.to_bdd()
    return computed + lost.to_mtbdd(LEAST) if lost else computed
