"""Random numbers that are a function of the seed, the path and the step.

So the value of a path does not depend on which paths are sampled with it, nor where.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from symcheck.matrices.rows import Floats, Int64s

__all__ = ["PathNumbers", "Stream"]

_PER_COUNT = 4  # Philox gives four words for each value of its counter


class Stream(IntEnum):
    """What the numbers decide."""

    BRANCH = 0
    DURATION = 1


class PathNumbers:
    """The numbers of a seed: those of Philox, whose counter has the path, the step and the stream.

    Source: J. K. Salmon et al.: Parallel random numbers: as easy as 1, 2, 3 (SC 2011).

    Args:
        seed: a whole number from 0.
    """

    def __init__(self, seed: int) -> None:
        self._key = np.random.SeedSequence(seed).generate_state(2, np.uint64)

    def uniform(self, paths: Int64s, step: int, stream: Stream) -> Floats:
        """A number from [0, 1) for each path: float64[n].

        Args:
            paths: numbers of paths, int64[n], ascending. The cost is that of all between them.
            step: the step that these paths take.
        """
        if not len(paths):
            return np.empty(0)
        count = int(paths[0]) // _PER_COUNT
        philox = np.random.Philox(key=self._key, counter=[count, step, stream, 0])
        first = count * _PER_COUNT
        return np.random.Generator(philox).random(int(paths[-1]) + 1 - first)[paths - first]
