"""BDDs in pure Python: the sets and numbers of nodes of CUDD, for the same order of variables."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import symcheck
from symcheck import teach
from symcheck.dd import tuning
from symcheck.dd.manager import DiagramManager
from symcheck.dd.python_manager import PythonManager
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError

NAMES = ("a", "a'", "b", "b'", "c")
ROWS, COLUMNS = ("a", "b"), ("a'", "b'")
TABLES = st.lists(st.booleans(), min_size=32, max_size=32)
STATES = st.lists(st.booleans(), min_size=8, max_size=8)
OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "and": lambda f, g: f & g,
    "or": lambda f, g: f | g,
    "xor": lambda f, g: f ^ g,
    "difference": lambda f, g: f - g,
    "not": lambda f, _: ~f,
    "equivalent": lambda f, g: f.equivalent(g),
    "ite": lambda f, g: f.ite(g, ~g),
}


def members(manager: Any, states: Any) -> list[list[int]]:
    """The assignments in a set, in the order of the variables."""
    found = []
    while (row := manager.pick(states, NAMES)) is not None:
        found.append(row.tolist())
        states = states - manager.bdd_from_rows(NAMES, row[None])
    return found


def both(make: Callable[[Any], Any]) -> None:
    """A set is the same in both managers, and has as many nodes and members."""
    seen = []
    for manager in (DiagramManager(), PythonManager()):
        manager.add_variables(NAMES)
        states = make(manager)
        found = members(manager, states)
        assert len(found) == manager.count(states, NAMES)
        assert bool(states) == bool(found)
        table = manager.export_bdd(states)
        seen.append((found, states.node_count, len(table), sorted(table.level.tolist())))
    assert seen[0] == seen[1]


@pytest.mark.parametrize("name", OPERATIONS)
@given(f=TABLES, g=TABLES)
def test_operations_are_those_of_cudd(name: str, f: list[bool], g: list[bool]) -> None:
    both(lambda m: OPERATIONS[name](m.bdd_table(NAMES, f), m.bdd_table(NAMES, g)))


@given(f=TABLES, variables=st.lists(st.sampled_from(NAMES), unique=True))
def test_quantification_is_that_of_cudd(f: list[bool], variables: list[str]) -> None:
    both(lambda m: m.bdd_table(NAMES, f).exists(m.cube(variables)))


@given(relation=st.lists(st.booleans(), min_size=16, max_size=16), states=STATES)
def test_images_keep_what_a_relation_does_not_touch(
    relation: list[bool], states: list[bool]
) -> None:
    def step(manager: Any, direction: str) -> Any:
        touched = manager.transition(ROWS, COLUMNS)
        moves = manager.bdd_table((*ROWS, *COLUMNS), relation)
        start = manager.bdd_table((*ROWS, "c"), states)
        if direction == "image":
            return touched.image(start, moves)
        if direction == "preimage":
            return touched.preimage(start, moves)
        return manager.saturation([(moves, touched)]).saturate(start)

    for direction in ("image", "preimage", "closure"):
        both(lambda m, d=direction: step(m, d))


@given(f=TABLES, g=TABLES)
def test_sets_are_read_from_tables_of_nodes(f: list[bool], g: list[bool]) -> None:
    manager = PythonManager()
    manager.add_variables(NAMES)
    sets = [manager.bdd_table(NAMES, values) for values in (f, g)]
    assert manager.import_bdd(manager.export_bdd(*sets)) == sets


@given(f=TABLES, g=TABLES)
def test_comparisons_and_shared_nodes(f: list[bool], g: list[bool]) -> None:
    seen = []
    for manager in (DiagramManager(), PythonManager()):
        manager.add_variables(NAMES)
        x, y = manager.bdd_table(NAMES, f), manager.bdd_table(NAMES, g)
        seen.append((x == y, x <= y, x.disjoint(y), manager.shared_size([x, y]), bool(x)))
    assert seen[0] == seen[1]


def test_equal_sets_are_equal_and_have_one_hash() -> None:
    manager = PythonManager()
    x, y = manager.add_variables(["x", "y"])
    assert ~(x & y) == ~x | ~y
    assert hash(~(x & y)) == hash(~x | ~y)
    assert x != y
    assert manager.order() == ("x", "y")
    assert manager.conjunction([]) == manager.true
    assert manager.disjunction([]) == manager.false
    assert repr(manager).startswith("<PythonManager: 2 variables, ")


def test_faults_are_those_of_the_manager_with_cudd() -> None:
    for manager in (DiagramManager(), PythonManager()):
        (x, _) = manager.add_variables(["x", "y"])
        with pytest.raises(ValueError, match="'x' exists already"):
            manager.add_variables(["x"])
        with pytest.raises(ValueError, match="depends on"):
            manager.count(x, ["y"])  # type: ignore[arg-type]


def test_numbers_are_refused() -> None:
    manager = PythonManager()
    (x,) = manager.add_variables(["x"])
    for call in (
        lambda: manager.constant(1.0),
        lambda: manager.zero,
        lambda: manager.table(["x"], np.zeros(2)),
        lambda: x.ite(0.5, 1.0),
        lambda: x.to_mtbdd(),
    ):
        with pytest.raises(UnsupportedError, match="MTBDDs"):
            call()


def test_limits_of_nodes_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    manager = PythonManager()
    x, y = manager.add_variables(["x", "y"])
    manager.limit_time(0.0)
    with pytest.raises(TimeLimitError):
        x & y
    manager.limit_time(None)
    monkeypatch.setattr(tuning, "MOST_PYTHON_NODES", 4)
    assert (x & y).node_count == 3
    with pytest.raises(MemoryLimitError, match="more than 4 nodes"):
        _ = [x & y, x ^ y, x | y]


def test_the_search_of_the_die_needs_no_cudd() -> None:
    """States and nodes of the reached set and of the frontier, as the tutorial shows them."""
    die = symcheck.load(Path(__file__).resolve().parents[2] / "models/die/die.pm").bound
    manager: Any = PythonManager()
    trace = teach.frontiers(symcheck.build(die, symcheck.Options(), manager=manager))
    counts = [(f.iteration.states, f.iteration.nodes, f.iteration.frontier) for f in trace]
    assert counts == [(1, 7, 1), (3, 7, 2), (7, 7, 4), (13, 9, 6), (13, 9, 0)]
    assert list(trace)[1].new_states == ((1, 0), (2, 0))


def test_managers_in_cycles_are_freed() -> None:
    """dd asserts that functions are freed before their manager, which no collector promises."""
    for _ in range(20):
        manager = PythonManager()
        x, y = manager.add_variables(["x", "y"])
        cycle: list[object] = [manager, x & y]
        cycle.append(cycle)
    del manager, x, y, cycle
    gc.collect()  # an error in a destructor would be a warning, which is an error in tests
