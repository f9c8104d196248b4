"""The diagram manager: BDDs and MTBDDs side by side in a CUDD manager.

It is the manager of a `dd.cudd.BDD` where dd has CUDD.

Sets are `Bdd` handles and functions to numbers are `Mtbdd` handles. `Bdd.to_dd()` returns a set as
dd's `Function` without copying, and a `Function` of `manager.bdd` is accepted wherever a set is, so
that all of dd can be used.

Names of variables are looked up here, once: operations that run often take a prepared `Cube`,
`Renaming` or `Transition`. Automatic reordering is off; `sift` and `reorder` change the order.
Exported arrays are outdated afterwards.

Sources: Bryant (1986), Graph-based algorithms for Boolean function manipulation; Clarke, Fujita,
McMillan, Yang and Zhao (1993), Spectral transforms for large Boolean functions; Bahar et al.
(1997), Algebraic decision diagrams.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import add, and_, or_
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symcheck.dd import tuning
from symcheck.dd.cudd import extension
from symcheck.dd.cudd.extension import (
    Bdd,
    Core,
    Cube,
    Mtbdd,
    Renaming,
    Saturation,
    Transition,
)
from symcheck.dd.cudd_import import cudd
from symcheck.dd.export import BddTable, NodeTable
from symcheck.dd.level_order import rows_in_level_order, table_in_level_order
from symcheck.errors import MemoryLimitError
from symcheck.machine import available_memory

__all__ = [
    "Bdd",
    "Cube",
    "DiagramManager",
    "Mtbdd",
    "Renaming",
    "Saturation",
    "Statistics",
    "Transition",
    "Variables",
]

Variables = Sequence[str] | Cube
"""Variables by name, or prepared."""


Diagram = TypeVar("Diagram", Bdd, Mtbdd)


def _combine(operation: Callable[[Diagram, Diagram], Diagram], diagrams: list[Diagram]) -> Diagram:
    """Combine at least one diagram pairwise: a balanced tree keeps intermediate results small."""
    while len(diagrams) > 1:
        last = diagrams[len(diagrams) & ~1 :]
        diagrams = [operation(f, g) for f, g in zip(diagrams[::2], diagrams[1::2], strict=False)]
        diagrams += last
    return diagrams[0]


def default_memory() -> int:
    """Three quarters of the memory available to this process, in bytes: an error with advice is
    better than being killed.
    """
    return available_memory() * 3 // 4


@dataclass(frozen=True, slots=True)
class Statistics:
    """Counters of a manager. Memory in bytes; a node takes 32."""

    variables: int
    live_nodes: int
    peak_live_nodes: int
    memory: int
    collections: int
    cache_lookups: float


class DiagramManager:
    """A CUDD manager with named variables.

    At a limit an operation raises MemoryLimitError or TimeLimitError, and Ctrl-C raises
    Interrupted. The manager and all handles stay usable.

    Args:
        max_memory: in bytes; None: three quarters of the machine's. CUDD may exceed it by up to
            half.
        time_limit: seconds from now; None: no limit.

    Examples:
        >>> manager = DiagramManager()
        >>> x, y = manager.add_variables(["x", "y"])
        >>> manager.count(x | y, ["x", "y"])
        3
        >>> function = x.ite(0.25, 0.75)
        >>> float(function.sum_over(manager.cube(["x"])))
        1.0
    """

    has_mtbdds = True
    """Whether there are diagrams with numbers; the manager in pure Python has none."""

    def __init__(self, max_memory: int | None = None, time_limit: float | None = None) -> None:
        if available_memory() < tuning.LEAST_MEMORY:  # CUDD would end the process
            raise MemoryLimitError("there is not enough memory for decision diagrams")
        limit = default_memory() if max_memory is None else max_memory
        estimate, entries = tuning.MEMORY_ESTIMATE, tuning.INITIAL_CACHE_ENTRIES
        self.bdd: Any = cudd and cudd.BDD(memory_estimate=estimate, initial_cache_size=entries)
        self.core = Core(self.bdd, limit, entries, estimate)
        self.core.tune(
            min(limit // tuning.BYTES_PER_FAST_GROWTH_SLOT, 2**31), tuning.MIN_CACHE_HIT_PERCENT
        )
        self.core.limit_time(time_limit)
        self._index: dict[str, int] = {}
        self.true: Bdd = self.core.true()
        self.false: Bdd = ~self.true
        self.zero: Mtbdd = self.core.constant(0.0)
        self.one: Mtbdd = self.core.constant(1.0)

    def __repr__(self) -> str:
        s = self.statistics()
        memory = f"{s.memory / 2**20:,.0f} MiB"
        return f"<DiagramManager: {s.variables} variables, {s.live_nodes:,} live nodes, {memory}>"

    # Variables

    def add_variables(self, names: Iterable[str]) -> tuple[Bdd, ...]:
        """Declare variables below all others, in this order. Returns their literals; ValueError for
        a known name.
        """
        added = []
        for name in names:
            if self._knows(name):
                raise ValueError(f"the variable {name!r} exists already")
            self._index[name] = self.core.add_variable(name)
            added.append(self.core.literal(self._index[name]))
        return tuple(added)

    def _knows(self, name: str) -> bool:
        return name in (self._index if self.bdd is None else self.bdd.vars)

    def index_of(self, name: str) -> int:
        """CUDD's index of a variable, which reordering does not change. Raises KeyError for an
        unknown name.
        """
        index = self._index.get(name)
        if index is None:
            if not self._knows(name):
                raise KeyError(f"no variable {name!r}")
            index = self._index[name] = self.bdd.add_var(name)  # gives the index that it has
        return index

    def variable(self, name: str) -> Bdd:
        """The set of assignments in which the variable is true."""
        return self.core.literal(self.index_of(name))

    def level_of(self, name: str) -> int:
        """Level of a variable; 0 is the top."""
        return self.core.level(self.index_of(name))

    @property
    def size(self) -> int:
        """Number of variables, which is also the level of the leaves."""
        return self.core.size()

    def order(self) -> tuple[str, ...]:
        """The variables from the top down."""
        names = self.core.names_by_index()
        return tuple(names[self.core.index_at(level)] for level in range(self.size))

    def name_of(self, index: int) -> str:
        """The variable with this index."""
        return self.core.names_by_index()[index]

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
        """Prepare the simultaneous substitution f[a := b] of all items (a, b); other variables
        stay.
        """
        return Renaming(
            self.core, [(self.index_of(a), self.index_of(b)) for a, b in changes.items()]
        )

    def transition(self, rows: Sequence[str], columns: Sequence[str]) -> Transition:
        """Prepare images and preimages of relations that touch these variables.

        Args:
            rows: current-state variables.
            columns: next-state variables, one for each of `rows`.
        """
        return Transition(
            self.core, list(zip(map(self.index_of, rows), map(self.index_of, columns), strict=True))
        )

    def saturation(
        self, relations: Iterable[tuple[Bdd, Transition]], *, forward: bool = True
    ) -> Saturation:
        """Prepare least fixpoints of sets under relations, by images or (`forward` False) by
        preimages.

        Raises ValueError where a column variable is not directly below its row variable.
        """
        return Saturation(self.core, relations, forward)

    # Making diagrams

    def constant(self, value: float) -> Mtbdd:
        """The constant function. -0.0 becomes 0; NaN raises NumericalError."""
        return self.core.constant(value)

    def from_dd(self, function: object) -> Bdd:
        """The set of a dd `Function` of `self.bdd`."""
        return self.core.from_dd(function)

    def table(self, variables: Variables, values: ArrayLike) -> Mtbdd:
        """The function with these values.

        Args:
            variables: k variables; the first one is the most significant bit of a position.
            values: float64[2**k].
        """
        order, table = table_in_level_order(
            self.core, self._indices(variables), np.asarray(values, dtype=np.float64)
        )
        return extension.from_table(self.core, order, table)

    def bdd_table(self, variables: Variables, values: ArrayLike) -> Bdd:
        """The set with these truth values, bool[2**k], ordered as in `table`."""
        order, table = table_in_level_order(
            self.core, self._indices(variables), np.asarray(values).astype(np.bool_)
        )
        return extension.from_bits(self.core, order, table.view(np.uint8))

    def bdd_from_rows(self, variables: Variables, rows: NDArray[np.uint8]) -> Bdd:
        """The set of the given rows, in time O(n k).

        Args:
            variables: k variables.
            rows: uint8[n, k] of 0 and 1, distinct and ascending, compared from the first variable
                on.

        Raises:
            ValueError: rows repeat or are out of order.
        """
        order, sorted_rows, _ = rows_in_level_order(self.core, self._indices(variables), rows)
        return extension.from_rows(self.core, order, sorted_rows)

    def mtbdd_from_rows(
        self, variables: Variables, rows: NDArray[np.uint8], values: ArrayLike
    ) -> Mtbdd:
        """The function with these values (float64[n]) at the rows (as in `bdd_from_rows`), and 0
        elsewhere.
        """
        order, sorted_rows, sorting = rows_in_level_order(self.core, self._indices(variables), rows)
        numbers = np.ascontiguousarray(values, dtype=np.float64)
        return extension.from_rows(
            self.core, order, sorted_rows, numbers if sorting is None else numbers[sorting]
        )

    # Operations on several diagrams; others are methods of the handles.

    def conjunction(self, sets: Iterable[Bdd]) -> Bdd:
        """Intersection of many sets; all assignments if there is none."""
        diagrams = list(map(self.core.from_any, sets))
        return _combine(and_, diagrams) if diagrams else self.true

    def disjunction(self, sets: Iterable[Bdd]) -> Bdd:
        """Union of many sets; empty if there is none."""
        diagrams = list(map(self.core.from_any, sets))
        return _combine(or_, diagrams) if diagrams else self.false

    def sum(self, diagrams: Iterable[Mtbdd]) -> Mtbdd:
        """Sum of many functions; 0 if there is none."""
        summands = list(diagrams)
        return _combine(add, summands) if summands else self.zero

    def multiply_sum(self, left: Mtbdd, right: Mtbdd, variables: Variables) -> Mtbdd:
        """Sum of left * right over the variables: the product of a matrix with a vector or a
        matrix.
        """
        return left.multiply_sum(right, self.cube(variables))

    def count(self, states: Bdd, variables: Variables) -> int:
        """Exact number of assignments of the variables in the set. Raises ValueError if it depends
        on others.
        """
        return extension.count(self.core.from_any(states), self.cube(variables))

    def pick(self, states: Bdd, variables: Variables) -> NDArray[np.uint8] | None:
        """The lexicographically smallest assignment of the variables in the set.

        Returns:
            uint8[k] of 0 and 1, in the order of `variables`; None if the set is empty.

        Raises:
            ValueError: the set depends on other variables, or these are not in the manager's order.
        """
        states = self.core.from_any(states)
        return extension.pick(states, np.array(self._indices(variables), dtype=np.int32))

    def shared_size(self, diagrams: Sequence[Bdd | Mtbdd]) -> int:
        """Number of distinct nodes of several diagrams together."""
        return extension.shared_size(self.core, diagrams)

    # Arrays

    def export_bdd(self, *sets: Bdd) -> BddTable:
        """Sets as arrays of nodes without complement edges."""
        return BddTable(self.size, *extension.export_sets(self.core, sets))

    def import_bdd(self, table: BddTable) -> list[Bdd]:
        """The inverse of `export_bdd`. Raises ValueError if the table is malformed."""
        return extension.import_sets(self.core, table.level, table.low, table.high, table.roots)

    def export_mtbdd(self, diagrams: Mtbdd | Sequence[Mtbdd]) -> NodeTable:
        """Functions as arrays of nodes; shared nodes occur once."""
        roots = [diagrams] if isinstance(diagrams, Mtbdd) else diagrams
        return NodeTable(self.size, *extension.export_nodes(self.core, roots))

    def import_mtbdd(self, table: NodeTable) -> list[Mtbdd]:
        """The inverse of `export_mtbdd`. Raises ValueError if the table is malformed."""
        return extension.import_nodes(
            self.core, table.level, table.low, table.high, table.values, table.roots
        )

    # Variable order, limits and statistics

    def sift(self, groups: Iterable[Sequence[str]] = (), growth: float = 1.2) -> None:
        """Reduce the diagrams by sifting (Rudell 1993, Dynamic variable ordering for OBDDs).

        A limit or Ctrl-C stops it, and leaves a valid order.

        Args:
            groups: neighbouring variables that move as a block and keep their relative order.
            growth: factor by which the diagrams may grow while a block moves.

        Raises:
            ValueError: the variables of a group are not neighbours.
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
        """Set the order of the variables (each of them once), topmost first."""
        self.core.shuffle(np.array([self.index_of(name) for name in order], dtype=np.int32))

    def limit_time(self, seconds: float | None) -> None:
        """Raise TimeLimitError this many seconds from now; None removes the limit."""
        self.core.limit_time(seconds)

    def limit_lookups(self, lookups: int | None) -> None:
        """Raise TimeLimitError after so many more look-ups in CUDD's cache; None removes the limit.

        Look-ups measure the work of all operations: a limit on them has the same effect on every
        machine. Two million take about a second.
        """
        self.core.limit_lookups(lookups)

    def limit_memory(self, limit: int) -> None:
        """Change the memory limit, in bytes."""
        self.core.limit_memory(limit)

    def statistics(self) -> Statistics:
        """The current counters."""
        return Statistics(**self.core.statistics())

    def collect(self) -> int:
        """Free dead nodes now; returns their number."""
        return self.core.collect()
