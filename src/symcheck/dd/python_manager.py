"""Sets as BDDs of `dd.autoref`, in pure Python, for teaching where there is no CUDD.

`PythonManager` and `PythonBdd` have those methods of `DiagramManager` and `Bdd` that encode guards
and transition relations and search reachable states. dd.autoref and CUDD both have complement edges
and one leaf: for the same variable order, BDDs have the same number of nodes.

dd.autoref has no MTBDDs. Everything that needs diagrams with numbers raises UnsupportedError.
A manager keeps at most `tuning.MOST_PYTHON_NODES` nodes; an operation may exceed that before it
ends.

Source: Bryant (1986), Graph-based algorithms for Boolean function manipulation.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symcheck.dd import tuning
from symcheck.dd.cudd_import import INSTALL_HINT
from symcheck.dd.export import BddTable
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError

__all__ = ["PythonBdd", "PythonManager", "PythonSaturation", "PythonTransition"]

Cube = tuple[str, ...]
"""Names of the variables to be quantified: dd.autoref needs no diagram of them, as CUDD does."""


def _needs_mtbdds(*_: object, **__: object) -> NoReturn:
    raise UnsupportedError(
        "diagrams with numbers (MTBDDs) need CUDD, which is not installed here: the BDDs of "
        "dd.autoref are sets only",
        hint=INSTALL_HINT,
    )


class PythonBdd:
    """A set of assignments. `function` is the `dd.autoref.Function`."""

    def __init__(self, manager: PythonManager, function: Any) -> None:
        self.manager = manager
        self.function = function

    def _apply(self, operator: str, other: PythonBdd) -> PythonBdd:
        return self.manager.made(lambda b: b.apply(operator, self.function, other.function))

    def __and__(self, other: PythonBdd) -> PythonBdd:
        return self._apply("&", other)

    def __or__(self, other: PythonBdd) -> PythonBdd:
        return self._apply("|", other)

    def __xor__(self, other: PythonBdd) -> PythonBdd:
        return self._apply("^", other)

    def __sub__(self, other: PythonBdd) -> PythonBdd:
        return self & ~other

    def __invert__(self) -> PythonBdd:
        return PythonBdd(self.manager, ~self.function)

    def equivalent(self, other: PythonBdd) -> PythonBdd:
        """The assignments on which both sets agree."""
        return ~(self ^ other)

    def ite(self, then: PythonBdd | float, otherwise: PythonBdd | float) -> PythonBdd:
        """`then` within this set, and `otherwise` outside. Raises UnsupportedError for numbers."""
        if not (isinstance(then, PythonBdd) and isinstance(otherwise, PythonBdd)):
            _needs_mtbdds()
        return self.manager.made(lambda b: b.ite(self.function, then.function, otherwise.function))

    def exists(self, cube: Cube) -> PythonBdd:
        """Quantify variables existentially."""
        return self.manager.made(lambda b: b.exist(cube, self.function))

    to_mtbdd = _needs_mtbdds

    def __bool__(self) -> bool:
        return self != self.manager.false

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PythonBdd) and bool(self.function == other.function)

    def __hash__(self) -> int:
        return hash(self.function)

    def __le__(self, other: PythonBdd) -> bool:
        return not self - other

    def disjoint(self, other: PythonBdd) -> bool:
        """Whether the sets have no common member."""
        return not self & other

    @property
    def node_count(self) -> int:
        """Number of nodes, the leaf included."""
        return int(self.function.dag_size)

    def to_dd(self) -> Any:
        """The `dd.autoref.Function`."""
        return self.function

    def __repr__(self) -> str:
        return f"PythonBdd({self.node_count} nodes)"


@dataclass(frozen=True, eq=False)
class PythonTransition:
    """Images and preimages of relations over current-state and next-state variables, pairwise."""

    rows: Cube
    columns: Cube

    def image(self, states: PythonBdd, relation: PythonBdd) -> PythonBdd:
        """The successors of `states` by `relation`, over row variables."""
        renaming = dict(zip(self.columns, self.rows, strict=True))
        sets = relation.function, states.function
        return states.manager.made(lambda _: _autoref().image(*sets, renaming, set(self.rows)))

    def preimage(self, states: PythonBdd, relation: PythonBdd) -> PythonBdd:
        """The predecessors of `states` by `relation`, over row variables."""
        renaming = dict(zip(self.rows, self.columns, strict=True))
        sets = relation.function, states.function
        return states.manager.made(
            lambda _: _autoref().preimage(*sets, renaming, set(self.columns))
        )


@dataclass(frozen=True, eq=False)
class PythonSaturation:
    """Least fixpoints in the order of saturation, on whole sets: a relation is applied only when
    those before it add no states. Saturation with CUDD does so node by node.
    """

    relations: tuple[tuple[PythonBdd, PythonTransition], ...]
    forward: bool
    exhausted = False  # there are no budgets

    def saturate(
        self, states: PythonBdd, within: PythonBdd | None = None, **_: object
    ) -> PythonBdd:
        """The least set that contains `states` and is closed under the relations, which are sorted
        from the lowest topmost variable to the highest; budgets do not matter.
        """
        number = 0
        while number < len(self.relations):
            relation, transition = self.relations[number]
            step = transition.image if self.forward else transition.preimage
            new = step(states, relation)
            new = (new if within is None else new & within) - states
            states, number = (states | new, 0) if new else (states, number + 1)
        return states


class PythonManager:
    """A manager of BDDs in pure Python, with the interface of `DiagramManager` for sets.

    Args:
        time_limit: seconds from now, checked after each operation; None: no limit.

    Examples:
        >>> manager = PythonManager()
        >>> x, y = manager.add_variables(["x", "y"])
        >>> manager.count(x | y, ["x", "y"])
        3
    """

    has_mtbdds = False
    constant = table = mtbdd_from_rows = sum = multiply_sum = _needs_mtbdds
    zero = one = property(_needs_mtbdds)

    def __init__(self, time_limit: float | None = None) -> None:
        self.bdd: Any = _new_bdd()
        self.limit_time(time_limit)
        self.true = PythonBdd(self, self.bdd.true)
        self.false = PythonBdd(self, self.bdd.false)

    def __repr__(self) -> str:
        return f"<PythonManager: {len(self.bdd.vars)} variables, {len(self.bdd):,} nodes>"

    def made(self, operation: Callable[[Any], Any]) -> PythonBdd:
        """The result of an operation of `dd.autoref.BDD`. Raises TimeLimitError and
        MemoryLimitError at the limits.
        """
        result = PythonBdd(self, operation(self.bdd))
        if self._deadline is not None and time.monotonic() > self._deadline:
            raise TimeLimitError("the time limit is reached")
        if len(self.bdd) > tuning.MOST_PYTHON_NODES:
            self.bdd.collect_garbage()
            if len(self.bdd) > tuning.MOST_PYTHON_NODES:
                raise MemoryLimitError(
                    f"more than {tuning.MOST_PYTHON_NODES:,} nodes are too many for BDDs in pure "
                    "Python, which replace CUDD here",
                    hint=INSTALL_HINT,
                )
        return result

    def limit_time(self, seconds: float | None) -> None:
        """Raise TimeLimitError this many seconds from now; None removes the limit."""
        self._deadline = None if seconds is None else time.monotonic() + seconds

    # Variables

    def add_variables(self, names: Iterable[str]) -> tuple[PythonBdd, ...]:
        """Declare variables below all others, in this order. Returns their literals; ValueError for
        a known name.
        """
        added = []
        for name in names:
            if name in self.bdd.vars:
                raise ValueError(f"the variable {name!r} exists already")
            self.bdd.add_var(name)
            added.append(self.variable(name))
        return tuple(added)

    def variable(self, name: str) -> PythonBdd:
        """The set of assignments in which the variable is true."""
        return PythonBdd(self, self.bdd.var(name))

    def level_of(self, name: str) -> int:
        """Level of a variable; 0 is the top."""
        return int(self.bdd.level_of_var(name))

    @property
    def size(self) -> int:
        """Number of variables, which is also the level of the leaf."""
        return len(self.bdd.vars)

    def order(self) -> tuple[str, ...]:
        """The variables from the top down."""
        return tuple(sorted(self.bdd.vars, key=self.level_of))

    def cube(self, variables: Sequence[str]) -> Cube:
        """Prepare variables for quantification."""
        return tuple(variables)

    def transition(self, rows: Sequence[str], columns: Sequence[str]) -> PythonTransition:
        """Prepare images and preimages of relations that touch these variables, pairwise."""
        return PythonTransition(tuple(rows), tuple(columns))

    def saturation(
        self, relations: Iterable[tuple[PythonBdd, PythonTransition]], *, forward: bool = True
    ) -> PythonSaturation:
        """Prepare least fixpoints under relations, by images or preimages."""
        return PythonSaturation(tuple(relations), forward)

    # Making sets

    def bdd_table(self, variables: Sequence[str], values: ArrayLike) -> PythonBdd:
        """The set with these truth values, bool[2**k]; the first variable is the most significant
        bit of a position.
        """
        known: dict[bytes, Any] = {}

        def expand(part: NDArray[np.bool_]) -> Any:
            """Shannon expansion by the variable that halves the table."""
            if part.all() or not part.any():
                return self.bdd.true if part[0] else self.bdd.false
            key = part.tobytes()
            if key not in known:
                low, high = map(expand, np.split(part, 2))
                variable = variables[len(variables) - len(part).bit_length() + 1]
                known[key] = self.bdd.ite(self.bdd.var(variable), high, low)
            return known[key]

        return self.made(lambda _: expand(np.asarray(values).astype(np.bool_)))

    def bdd_from_rows(self, variables: Sequence[str], rows: NDArray[np.uint8]) -> PythonBdd:
        """The set of the given rows, uint8[n, k] of 0 and 1."""
        cubes = (dict(zip(variables, map(bool, row), strict=True)) for row in rows.tolist())
        return self.disjunction(PythonBdd(self, self.bdd.cube(cube)) for cube in cubes)

    def conjunction(self, sets: Iterable[PythonBdd]) -> PythonBdd:
        """Intersection of sets; all assignments if there is none."""
        return reduce(and_, sets, self.true)

    def disjunction(self, sets: Iterable[PythonBdd]) -> PythonBdd:
        """Union of sets; empty if there is none."""
        return reduce(or_, sets, self.false)

    # Reading sets

    def count(self, states: PythonBdd, variables: Sequence[str]) -> int:
        """Number of assignments of the variables in the set. Raises ValueError if it depends on
        others.
        """
        if others := self.bdd.support(states.function) - set(variables):
            raise ValueError(f"the set depends on {', '.join(sorted(others))}")
        return int(self.bdd.count(states.function, len(variables)))

    def pick(self, states: PythonBdd, variables: Sequence[str]) -> NDArray[np.uint8] | None:
        """The lexicographically smallest assignment of the variables, which are in the manager's
        order, as uint8[k]; None if the set is empty.
        """
        if not states:
            return None
        bits, node = np.zeros(len(variables), np.uint8), states.function.node
        for position, name in enumerate(variables):
            level, low, high = self.bdd._bdd.succ(abs(node))
            if level == self.level_of(name):
                low, high = (low, high) if node > 0 else (-low, -high)
                bits[position] = low == -1
                node = high if bits[position] else low
        return bits

    def shared_size(self, diagrams: Sequence[PythonBdd]) -> int:
        """Number of distinct nodes of several sets together."""
        return len(self.bdd._bdd.descendants([d.function.node for d in diagrams]))

    def export_bdd(self, *sets: PythonBdd) -> BddTable:
        """Sets as arrays of nodes without complement edges."""
        rows = [(self.size, 0, 0), (self.size, 1, 1)]
        number = {-1: 0, 1: 1}  # by the signed number in dd, which is negative for complements

        def visit(node: int) -> int:
            if node not in number:
                sign = 1 if node > 0 else -1
                level, low, high = self.bdd._bdd.succ(abs(node))
                row = level, visit(sign * low), visit(sign * high)
                number[node] = len(rows)
                rows.append(row)
            return number[node]

        roots = np.array([visit(s.function.node) for s in sets], np.int32)
        level, low, high = np.array(rows, np.int32).T.copy()
        return BddTable(self.size, level, low, high, roots)

    def import_bdd(self, table: BddTable) -> list[PythonBdd]:
        """The inverse of `export_bdd`."""
        names, made = self.order(), [self.false, self.true]
        columns = (column[2:].tolist() for column in (table.level, table.low, table.high))
        for level, low, high in zip(*columns, strict=True):
            made.append(self.variable(names[level]).ite(made[high], made[low]))
        return [made[root] for root in table.roots.tolist()]


def _autoref() -> Any:
    return importlib.import_module("dd.autoref")


def _new_bdd() -> Any:
    """A `dd.autoref.BDD` that may be freed in any order with its functions, as in a cycle: the
    destructor of dd asserts that the functions go first.
    """
    nodes = importlib.import_module("dd.bdd").BDD
    made = _autoref().BDD()
    made._bdd = type("Nodes", (nodes,), {"__del__": lambda _: None})()
    made.vars = made._bdd.vars
    return made
