"""The diagram manager: BDDs and MTBDDs side by side in the CUDD manager of a `dd.cudd.BDD`.

Sets are `Bdd` handles and functions to numbers are `Mtbdd` handles (see `extension.pyi`). `Bdd.to_dd()` gives a set as dd's
`Function` without copying, and wherever a set is expected a `Function` of `manager.bdd` is taken, so all of dd stays usable.

Names of variables are looked up here, once: what runs often takes a prepared `Cube`, `Renaming` or `Transition`.
Automatic reordering is off; reorder on purpose with `sift` or `reorder`. Arrays exported earlier are stale afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symcheck.dd import _layout
from symcheck.dd.cudd import extension
from symcheck.dd.cudd.extension import Bdd, Closure, Core, Cube, Mtbdd, Renaming, Transition
from symcheck.dd.cudd_import import cudd
from symcheck.dd.export import BddTable, NodeTable
from symcheck.machine import memory

__all__ = [
    "Bdd",
    "Closure",
    "Cube",
    "DiagramManager",
    "Mtbdd",
    "Renaming",
    "Statistics",
    "Transition",
    "Variables",
]

Variables = Sequence[str] | Cube
"""Variables by name, or prepared."""

# Entries of 32 bytes; CUDD doubles its cache while that pays. dd's own 2**18 cost 3 ms per manager.
INITIAL_CACHE = 2**15
# CUDD touches a 64th of this in advance: 4 ms per GiB. It limits nothing; what CUDD derives from it is set below.
ESTIMATE = 2**26
# Share of lookups (in per cent) that must find something for the cache to grow. CUDD's own 30 is seldom reached by searches
# of timed models, which then forget what they have done: twice the work in firewire_impl_dl.
MINIMAL_HITS = 5


def default_memory() -> int:
    """Three quarters of the memory that this process may have, in bytes: ending with advice is better than being killed."""
    return memory() * 3 // 4


@dataclass(frozen=True, slots=True)
class Statistics:
    """What a manager holds and did. Memory in bytes, times in seconds; nodes are of 32 bytes each."""

    variables: int
    live_nodes: int
    dead_nodes: int
    peak_live_nodes: int
    peak_nodes: int
    memory: int
    collections: int
    collection_seconds: float
    reorderings: int
    reordering_seconds: float
    cache_slots: int
    cache_lookups: float
    cache_hits: float


class DiagramManager:
    """A CUDD manager with named variables.

    `max_memory` in bytes (None: three quarters of the machine's; CUDD may pass it by up to half), `time_limit` in seconds
    from now. Passing either raises MemoryLimitError or TimeLimitError, Ctrl-C raises Interrupted; the manager and all
    handles stay usable.
    """

    def __init__(self, max_memory: int | None = None, time_limit: float | None = None) -> None:
        limit = default_memory() if max_memory is None else max_memory
        self.bdd: Any = cudd.BDD(memory_estimate=ESTIMATE, initial_cache_size=INITIAL_CACHE)
        # Up to so many slots (a fifth of the memory's nodes) the unique table grows fast; there collecting does not pay.
        self.bdd.configure(loose_up_to=min(limit // 160, 2**31), min_hit=MINIMAL_HITS)
        self.core = Core(self.bdd, limit)
        self.core.limit_time(time_limit)
        self._index: dict[str, int] = {}
        self.true: Bdd = self.core.true()
        self.false: Bdd = ~self.true
        self.zero: Mtbdd = self.core.constant(0.0)
        self.one: Mtbdd = self.core.constant(1.0)

    def __repr__(self) -> str:
        s = self.statistics()
        return f"<DiagramManager: {s.variables} variables, {s.live_nodes:,} live nodes, {s.memory / 2**20:,.0f} MiB>"

    # Variables

    def add_variables(self, names: Iterable[str]) -> tuple[Bdd, ...]:
        """Declare variables below all others, in this order; returns their literals."""
        added = []
        for name in names:
            if name in self.bdd.vars:
                raise ValueError(f"the variable {name!r} exists already")
            self._index[name] = self.bdd.add_var(name)
            added.append(self.core.literal(self._index[name]))
        return tuple(added)

    def index_of(self, name: str) -> int:
        """CUDD's index of a variable, which never changes (its level does, on reordering)."""
        index = self._index.get(name)
        if index is None:
            if name not in self.bdd.vars:
                raise KeyError(f"no variable {name!r}")
            index = self._index[name] = self.bdd.add_var(name)
        return index

    def variable(self, name: str) -> Bdd:
        """The set where the variable is true."""
        return self.core.literal(self.index_of(name))

    def level_of(self, name: str) -> int:
        """Level of a variable; 0 is the top."""
        return self.core.level(self.index_of(name))

    def order(self) -> tuple[str, ...]:
        """The variables from the top down."""
        return tuple(self.name_of(self.core.index_at(level)) for level in range(self.core.size()))

    def name_of(self, index: int) -> str:
        """The variable with this index."""
        return str(self.bdd._var_with_index[index])

    def _indices(self, variables: Variables) -> tuple[int, ...]:
        return (
            variables.indices
            if isinstance(variables, Cube)
            else tuple(map(self.index_of, variables))
        )

    def cube(self, variables: Variables) -> Cube:
        """Prepare variables for quantification, summing or counting."""
        return (
            variables if isinstance(variables, Cube) else Cube(self.core, self._indices(variables))
        )

    def renaming(self, changes: Mapping[str, str]) -> Renaming:
        """Prepare f[a := b] for all items (a, b) at once; variables not mentioned stay."""
        return Renaming(
            self.core, [(self.index_of(a), self.index_of(b)) for a, b in changes.items()]
        )

    def transition(self, rows: Sequence[str], columns: Sequence[str]) -> Transition:
        """Prepare `image` and `preimage` of relations over these row and column variables (pairwise)."""
        return Transition(
            self.core, list(zip(map(self.index_of, rows), map(self.index_of, columns), strict=True))
        )

    def closure(
        self, relations: Iterable[tuple[Bdd, Transition]], *, forward: bool = True
    ) -> Closure:
        """Prepare closing sets under relations, by images or (`forward` off) by preimages."""
        return Closure(self.core, relations, forward)

    # Making diagrams

    def constant(self, value: float) -> Mtbdd:
        """The function with one value. NaN is refused (NumericalError); -0.0 becomes 0."""
        return self.core.constant(value)

    def from_dd(self, function: Any) -> Bdd:
        """The set of a dd `Function` of `self.bdd`."""
        return self.core.from_dd(function)

    def table(self, variables: Variables, values: ArrayLike) -> Mtbdd:
        """The function with these 2**k values; the first variable is the most significant bit of the position."""
        order, dense = _layout.dense(
            self.core, self._indices(variables), np.asarray(values, dtype=np.float64)
        )
        return extension.from_table(self.core, order, dense)

    def bdd_table(self, variables: Variables, values: ArrayLike) -> Bdd:
        """The set with these 2**k truth values, placed as in `table`."""
        order, dense = _layout.dense(
            self.core, self._indices(variables), np.asarray(values).astype(np.bool_)
        )
        return extension.from_bits(self.core, order, dense.view(np.uint8))

    def bdd_from_rows(self, variables: Variables, rows: NDArray[Any]) -> Bdd:
        """The set of some rows, unique and in ascending order.

        rows: uint64[n], the first of the k <= 64 variables the most significant bit; or 0/1 as uint8[n, k], compared
        from the first variable on. O(n k). ValueError if rows repeat or are out of order.
        """
        order, sorted_rows, _ = _layout.rows(self.core, self._indices(variables), rows)
        return extension.from_rows(self.core, order, sorted_rows)

    def mtbdd_from_rows(self, variables: Variables, rows: NDArray[Any], values: ArrayLike) -> Mtbdd:
        """The function with `values` (float64[n]) at the rows, as in `bdd_from_rows`, and 0 elsewhere."""
        order, sorted_rows, places = _layout.rows(self.core, self._indices(variables), rows)
        numbers = np.ascontiguousarray(values, dtype=np.float64)
        return extension.from_rows(
            self.core, order, sorted_rows, numbers if places is None else numbers[places]
        )

    # Working with diagrams; what is not here is a method of the handles.

    def conjunction(self, sets: Iterable[Bdd]) -> Bdd:
        """Intersection of many sets, as a balanced tree; all assignments if there is none."""
        return extension.unite(self.core, sets, True)

    def disjunction(self, sets: Iterable[Bdd]) -> Bdd:
        """Union of many sets, as a balanced tree; empty if there is none."""
        return extension.unite(self.core, sets, False)

    def sum(self, diagrams: Iterable[Mtbdd]) -> Mtbdd:
        """Sum of many functions, as a balanced tree; 0 if there is none."""
        return extension.total(self.core, diagrams)

    def multiply_sum(self, left: Mtbdd, right: Mtbdd, variables: Variables) -> Mtbdd:
        """Sum of left × right over the variables: matrix times vector, or matrix times matrix."""
        return left.multiply_sum(right, self.cube(variables))

    def count(self, states: Bdd, variables: Variables) -> int:
        """Exact number of assignments of the variables in the set. ValueError if it depends on others."""
        return extension.count(self.core.from_any(states), self.cube(variables))

    def pick(self, states: Bdd, variables: Variables) -> NDArray[np.uint8] | None:
        """The lexicographically smallest assignment of the variables (first variable first) in the set; None if empty.

        uint8[k] of 0/1. ValueError if the set depends on others.
        """
        states = self.core.from_any(states)
        indices = self._indices(variables)
        if not set(states.support) <= set(indices):
            raise ValueError("the set depends on variables that are not asked for")
        levels = list(map(self.core.level, indices))
        if levels == sorted(levels):
            return extension.pick(states, np.array(indices, dtype=np.int32))
        row = np.zeros(len(indices), dtype=np.uint8)
        for place, index in enumerate(indices):
            literal = self.core.literal(index)
            low = states - literal
            row[place] = not low
            states = low or states & literal
        return row if states else None

    def shared_size(self, diagrams: Sequence[Bdd | Mtbdd]) -> int:
        """Number of distinct nodes of several diagrams together."""
        return extension.shared_size(self.core, diagrams)

    # Arrays

    def export_bdd(self, *sets: Bdd) -> BddTable:
        """Sets as arrays of nodes without complement edges."""
        return BddTable(self.core.size(), *extension.export_sets(self.core, sets))

    def import_bdd(self, table: BddTable) -> list[Bdd]:
        """The inverse of `export_bdd`. ValueError if the table is malformed."""
        return extension.import_sets(self.core, table.level, table.low, table.high, table.roots)

    def export_mtbdd(self, diagrams: Mtbdd | Sequence[Mtbdd]) -> NodeTable:
        """Functions as arrays of nodes, shared nodes once."""
        chosen = [diagrams] if isinstance(diagrams, Mtbdd) else diagrams
        return NodeTable(self.core.size(), *extension.export_nodes(self.core, chosen))

    def import_mtbdd(self, table: NodeTable) -> list[Mtbdd]:
        """The inverse of `export_mtbdd`. ValueError if the table is malformed."""
        return extension.import_nodes(
            self.core, table.level, table.low, table.high, table.values, table.roots
        )

    # The order, limits and statistics

    def sift(self, groups: Iterable[Sequence[str]] = (), growth: float = 1.2) -> None:
        """Look for a better order by sifting. Each group of neighbouring variables moves as a block, its inner order kept.

        `growth`: how much the diagrams may grow on the way. A limit or Ctrl-C stops it in some valid order.
        """
        blocks = []
        for group in groups:
            levels = [self.level_of(name) for name in group]
            if levels != list(range(levels[0], levels[0] + len(levels))):
                raise ValueError(
                    f"the variables {', '.join(group)} are not neighbours in this order"
                )
            blocks.append((self.index_of(group[0]), len(levels)))
        self.core.sift(blocks, growth)

    def reorder(self, order: Sequence[str]) -> None:
        """Put the variables (each once) in this order, topmost first."""
        self.core.shuffle(np.array([self.index_of(name) for name in order], dtype=np.int32))

    def limit_time(self, seconds: float | None) -> None:
        """Stop with TimeLimitError after so many seconds from now; None lifts the limit."""
        self.core.limit_time(seconds)

    def limit_memory(self, limit: int) -> None:
        """Change the memory limit, in bytes."""
        self.core.limit_memory(limit)

    def statistics(self) -> Statistics:
        """Counters, read at once."""
        return Statistics(**self.core.statistics())

    def collect(self) -> int:
        """Free dead nodes now; returns how many there were."""
        return self.core.collect()
