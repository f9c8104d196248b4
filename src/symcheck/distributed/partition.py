"""The owner of a state: a hash of variables that few transitions change, or a block of values of a
variable that changes by small steps.

Source: F. Lerda, R. Sisto: Distributed-memory model checking with SPIN (SPIN 1999), where the owner
depends on one process.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from symcheck.distributed import tuning
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.successors import SuccessorGenerator
from symcheck.explicit.tables import compile_model
from symcheck.kernels.explore.breadth_first import Explorer
from symcheck.kernels.explore.breadth_first import owners as hashed_owners
from symcheck.matrices.rows import Int32s
from symcheck.semantics.model import BoundModel

__all__ = ["Partition", "choose_partition"]

_FOREVER = 1e9
_KEYS = (1 << 31) - 1
_BLOCKS = (1 << 63) - 1


@dataclass(frozen=True)
class Partition:
    """A partition of packed states.

    Attributes:
        parts: how many.
        mask: the bits of each word that name the owner.
        seed: of the hash (see `symcheck.kernels.explore.breadth_first.owners`).
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
    """
    layout = StateLayout.of(model.variables)
    everything = Partition(parts, ((1 << 64) - 1,) * layout.words)
    if parts == 1:
        return everything
    states, sources, targets = _sample(model, layout)
    candidates = chain(
        [everything],
        _hashes(layout, parts, states, sources, targets),
        _blocks(layout, parts, sources, targets),
    )
    return min(candidates, key=lambda partition: _cost(partition, states, sources, targets))


def _hashes(
    layout: StateLayout, parts: int, states: Rows, sources: Rows, targets: Rows
) -> Iterator[Partition]:
    """Some hashes of the variable that changes least, of the two that change least, and so on."""
    changes = [
        float((layout.column(sources, v) != layout.column(targets, v)).mean())
        for v in range(len(layout.fields))
    ]
    mask = np.zeros(layout.words, np.uint64)
    for variable in np.argsort(changes, kind="stable"):
        _, word, shift, bits = layout.fields[variable].tolist()
        mask[word] |= np.uint64(((1 << bits) - 1) << shift)
        keys = hashed_owners(states, mask, 0, _KEYS)
        if len(np.unique(keys)) >= tuning.KEYS_PER_PART * parts:
            for seed in range(tuning.SEEDS):
                yield Partition(parts, tuple(mask.tolist()), seed)


def _blocks(layout: StateLayout, parts: int, sources: Rows, targets: Rows) -> Iterator[Partition]:
    """Blocks of 1, 2, 4, … values of each variable that rises and falls, which the parts own in
    turns.

    A search reaches the blocks of a variable that only rises one after the other, and all parts but
    one would wait.
    """
    for variable, word, shift, bits in layout.fields.tolist():
        before, after = layout.column(sources, variable), layout.column(targets, variable)
        rises, falls = int((after > before).sum()), int((after < before).sum())
        values = int(layout.ranges[variable]) + 1
        if min(rises, falls) < tuning.LEAST_TURNS * max(rises, falls, 1):
            continue
        for low_bits in range(bits):
            if values >> low_bits >= tuning.BLOCKS_PER_PART * parts:
                mask = [0] * layout.words
                mask[word] = ((1 << bits) - (1 << low_bits)) << shift
                yield Partition(parts, tuple(mask), _BLOCKS)


def _sample(model: BoundModel, layout: StateLayout) -> tuple[Rows, Rows, Rows]:
    """Some of the first states, and the sources and targets of transitions from a few of them.

    Faults of the model are left to the exploration, which tells them.
    """
    explorer = Explorer(compile_model(replace(model, rewards=()), layout))
    explorer.add(initial_rows(model, layout))
    explorer.run(tuning.SAMPLE_STATES, _FOREVER)
    rows = explorer.states.view_rows()
    states = rows[:: 1 + len(rows) // tuning.COMPARED_STATES].copy()
    explored = rows[: max(1, explorer.explored)]
    chosen = explored[:: 1 + len(explored) // tuning.SAMPLE_ROWS].copy()
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
