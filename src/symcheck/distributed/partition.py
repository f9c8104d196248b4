"""The owner of a state: a hash of variables that few transitions change.

Source: F. Lerda, R. Sisto: Distributed-memory model checking with SPIN (SPIN 1999), where the owner
depends on one process.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symcheck.distributed import tuning
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.successors import SuccessorGenerator
from symcheck.explicit.tables import tables
from symcheck.kernels.explore.breadth_first import Explorer
from symcheck.kernels.explore.breadth_first import owners as hashed_owners
from symcheck.matrices.rows import Int32s
from symcheck.semantics.model import BoundModel

__all__ = ["Partition", "choose_partition"]

_FOREVER = 1e9
_KEYS = (1 << 31) - 1


@dataclass(frozen=True)
class Partition:
    """A partition of packed states.

    Attributes:
        parts: how many.
        mask: the bits of each word that name the owner.
        seed: of the hash.
    """

    parts: int
    mask: tuple[int, ...]
    seed: int = 0

    def owners(self, rows: Rows) -> Int32s:
        """The part of each packed state (uint64[n, words]): int32[n]."""
        return hashed_owners(rows, np.array(self.mask, np.uint64), self.seed, self.parts)

    def of(self, number: int) -> tuple[Rows, int, int, int] | None:
        """The share of a part, as an Explorer takes it; None for all states."""
        mask = np.array(self.mask, np.uint64)
        return (mask, self.seed, self.parts, number) if self.parts > 1 else None


def choose_partition(model: BoundModel, parts: int) -> Partition:
    """A partition that is even on the first states of the model, with few transitions between the
    parts.

    The variables are tried that change least, one, two and so on, each with some hashes.
    """
    layout = StateLayout.of(model.variables)
    everything = Partition(parts, ((1 << 64) - 1,) * layout.words)
    if parts == 1:
        return everything
    states, sources, targets = _sample(model, layout)
    changes = [
        float((layout.column(sources, v) != layout.column(targets, v)).mean())
        for v in range(len(model.variables))
    ]
    best, least = everything, _cost(everything, states, sources, targets)
    mask = np.zeros(layout.words, np.uint64)
    for variable in np.argsort(changes, kind="stable"):
        _, word, shift, bits = layout.fields[variable].tolist()
        mask[word] |= np.uint64(((1 << bits) - 1) << shift)
        keys = hashed_owners(states, mask, 0, _KEYS)
        if len(np.unique(keys)) < tuning.KEYS_PER_PART * parts:
            continue
        for seed in range(tuning.SEEDS):
            candidate = Partition(parts, tuple(mask.tolist()), seed)
            cost = _cost(candidate, states, sources, targets)
            if cost < least:
                best, least = candidate, cost
    return best


def _sample(model: BoundModel, layout: StateLayout) -> tuple[Rows, Rows, Rows]:
    """Some of the first states, and the sources and targets of transitions from some of them.

    Faults of the model are left to the exploration, which tells them.
    """
    explorer = Explorer(tables(replace(model, rewards=()), layout))
    explorer.add(initial_rows(model, layout))
    explorer.run(tuning.SAMPLE_STATES, _FOREVER)
    states = explorer.states.view_rows().copy()
    explored = states[: max(1, explorer.explored)]
    chosen = explored[:: 1 + len(explored) // tuning.SAMPLE_ROWS]
    if explorer.fault_state >= 0:
        return states, chosen, chosen
    found = SuccessorGenerator(model, layout).choices(chosen)
    ends = np.append(0, found.branch_ends)[found.ends]
    sources = np.repeat(chosen, np.diff(ends, prepend=0), axis=0)
    return states, sources, found.targets


def _cost(partition: Partition, states: Rows, sources: Rows, targets: Rows) -> float:
    """The work of the largest part, in states, for each state of an even part."""
    largest = np.bincount(partition.owners(states)).max() * partition.parts / len(states)
    crossing = float((partition.owners(sources) != partition.owners(targets)).mean())
    return float(largest) * (1 + tuning.COST_OF_CROSSING * crossing)
