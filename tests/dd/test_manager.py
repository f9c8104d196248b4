"""Diagrams against truth tables, one operation at a time."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd.export import BddTable, NodeTable
from symcheck.dd.manager import DiagramManager
from symcheck.errors import NumericalError

NAMES = ["a", "b", "c", "d"]
ROWS = np.array(list(itertools.product((0, 1), repeat=4)), dtype=np.uint8)
numbers = st.lists(
    st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-13, 2e-13, 3.0, math.inf]), min_size=16, max_size=16
)
finite = st.lists(
    st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-13, 2e-13, 3.0]), min_size=16, max_size=16
)
truths = st.lists(st.booleans(), min_size=16, max_size=16)


@pytest.fixture(scope="module")
def manager():
    made = DiagramManager()
    made.add_variables(NAMES)
    return made


def test_small_numbers_are_neither_zero_nor_equal(manager):
    tiny = manager.constant(1e-300)
    assert tiny != manager.zero
    assert manager.constant(1 + 2**-52) != manager.one
    assert float(tiny + 5e-324 - tiny) == 0.0
    assert float(manager.constant(5e-324)) == 5e-324


def test_there_is_one_zero(manager):
    assert manager.constant(-0.0) == manager.zero
    assert -manager.zero == manager.zero
    assert math.copysign(1, float(manager.constant(-1e-300) * 1e-300)) == 1


def test_undefined_values_are_refused(manager):
    infinite = manager.constant(math.inf)
    a = manager.variable("a").to_mtbdd()
    with pytest.raises(NumericalError, match="undefined"):
        manager.constant(math.nan)
    with pytest.raises(NumericalError):
        infinite - infinite * a
    assert infinite * a == manager.variable("a").ite(math.inf, 0.0)
    assert float(manager.zero * infinite) == 0.0
    assert float(manager.one / 0) == math.inf


@given(finite, finite)
@settings(max_examples=50, deadline=None)
def test_arithmetic(manager, left, right):
    x, y = np.array(left), np.array(right)
    f, g = manager.table(NAMES, x), manager.table(NAMES, y)
    assert f + g == manager.table(NAMES, x + y)
    assert f - g == manager.table(NAMES, x - y)
    assert f * g == manager.table(NAMES, x * y)
    assert f.minimum(g) == manager.table(NAMES, np.minimum(x, y))
    assert f.maximum(g) == manager.table(NAMES, np.maximum(x, y))
    assert 2 - f * 3 == manager.table(NAMES, 2 - x * 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        assert f / g == manager.table(NAMES, np.where(x == 0, 0, x / y))


@given(numbers, numbers, truths)
@settings(max_examples=50, deadline=None)
def test_bridges(manager, left, right, chosen):
    x, y, s = np.array(left), np.array(right), np.array(chosen)
    f, g, states = manager.table(NAMES, x), manager.table(NAMES, y), manager.bdd_table(NAMES, s)
    for operator, expected in {
        "<": x < y,
        "<=": x <= y,
        ">": x > y,
        ">=": x >= y,
        "=": x == y,
        "!=": x != y,
    }.items():
        assert f.compare(operator, g) == manager.bdd_table(NAMES, expected)
    assert f.compare(">=", 0.5) == manager.bdd_table(NAMES, x >= 0.5)
    assert f.equal(g) == manager.bdd_table(NAMES, x == y)
    assert f.to_bdd() == manager.bdd_table(NAMES, x != 0)
    assert f.times_bdd(states) == manager.table(NAMES, np.where(s, x, 0))
    assert states.ite(f, g) == manager.table(NAMES, np.where(s, x, y))
    assert states.to_mtbdd(0.25) == manager.table(NAMES, s * 0.25)
    assert f.evaluate(ROWS).tolist() == x.tolist()
    assert states.evaluate(ROWS).tolist() == s.tolist()
    assert f.leaves.tolist() == sorted(set(left))
    assert (f.minimum_leaf, f.maximum_leaf) == (min(left), max(left))


@given(finite, finite, st.sets(st.sampled_from(range(4))))
@settings(max_examples=50, deadline=None)
def test_abstraction(manager, left, right, axes):
    x, y = np.array(left).reshape(2, 2, 2, 2), np.array(right).reshape(2, 2, 2, 2)
    cube = manager.cube([NAMES[axis] for axis in axes])
    f, g = manager.table(NAMES, x.ravel()), manager.table(NAMES, y.ravel())

    def values(table):
        return np.broadcast_to(table, x.shape).ravel()

    where = tuple(axes)
    np.testing.assert_allclose(
        f.sum_over(cube).evaluate(ROWS), values(x.sum(where, keepdims=True)), atol=1e-15
    )
    np.testing.assert_allclose(
        f.multiply_sum(g, cube).evaluate(ROWS),
        values((x * y).sum(where, keepdims=True)),
        atol=1e-15,
    )


def test_a_matrix_times_a_vector(manager):
    random = np.random.default_rng(1)
    matrix, vector = random.random((4, 4)), random.random(4)
    m = manager.table(["a", "c", "b", "d"], matrix.ravel())
    v = manager.table(["b", "d"], vector)
    product = manager.multiply_sum(m, v, ["b", "d"])
    np.testing.assert_allclose(product.evaluate(ROWS[[0, 2, 8, 10]]), matrix @ vector, rtol=1e-15)


def test_rename_is_simultaneous(manager):
    a, b, c, d = map(manager.variable, NAMES)
    f = (a & ~b) | (c ^ d)
    assert f.rename(manager.renaming({"a": "b", "b": "a"})) == (b & ~a) | (c ^ d)
    assert f.rename(manager.renaming({"a": "b", "b": "c", "c": "d", "d": "a"})) == (b & ~c) | (
        d ^ a
    )
    assert f.rename(manager.renaming({"a": "c", "b": "c"})) == c ^ d
    m = f.ite(0.25, 4.0)
    exchange = manager.renaming({"a": "d", "d": "a"})
    assert m.rename(exchange) == f.rename(exchange).ite(0.25, 4.0)


def test_a_renaming_that_died_leaves_nothing_in_the_cache(manager):
    a, b, c, _ = map(manager.variable, NAMES)
    for _ in range(50):
        assert a.rename(manager.renaming({"a": "b"})) == b
        assert a.rename(manager.renaming({"a": "c"})) == c


def test_sets(manager):
    a, b, c, d = map(manager.variable, NAMES)
    assert a & b <= a <= a | b
    assert a & b < a
    assert not a <= b
    assert (a - b).disjoint(b)
    assert a
    assert not manager.false
    assert a.equivalent(b) == ~(a ^ b)
    assert (a & b | c).cofactor(a & ~c) == b
    assert (a & c).exists(manager.cube("ab")) == c
    assert [manager.name_of(i) for i in (d & b).support] == ["b", "d"]
    assert manager.conjunction([a, b, c]) == a & b & c
    assert manager.disjunction([a, b, c]) == a | b | c
    assert manager.conjunction([]) == manager.true
    assert manager.disjunction([]) == manager.false
    assert len({a & b, b & a, a}) == 2


def test_dd_functions_go_both_ways(manager):
    a, b, *_ = map(manager.variable, NAMES)
    function = manager.bdd.add_expr(r"a /\ ~ b")
    assert manager.from_dd(function) == a - b
    assert (a - b).to_dd() == function
    assert a & function == a - b
    assert function == (a - b).to_dd()
    other = DiagramManager()
    with pytest.raises(TypeError, match="this manager"):
        other.from_dd(function)


def test_operands_of_other_managers_or_types_are_refused(manager):
    other = DiagramManager()
    (x,) = other.add_variables(["x"])
    with pytest.raises(ValueError, match="different managers"):
        manager.true & x
    with pytest.raises(ValueError, match="different managers"):
        manager.one + other.one
    with pytest.raises(ValueError, match="another manager"):
        manager.true.exists(other.cube(["x"]))
    with pytest.raises(TypeError, match="Bdd is needed"):
        manager.true & True
    with pytest.raises(TypeError, match="number is needed"):
        manager.one + "1"


def test_counting_is_exact():
    manager = DiagramManager()
    names = [f"x{i}" for i in range(200)]
    literals = manager.add_variables(names)
    assert manager.count(manager.true, names) == 2**200
    assert manager.count(~manager.conjunction(literals), names) == 2**200 - 1
    assert manager.count(literals[7] | literals[150], names) == 3 * 2**198
    parity = manager.false
    for literal in literals:
        parity = parity ^ literal
    assert manager.count(parity, names) == 2**199
    for k in (63, 64, 65, 127, 128, 129):
        assert manager.count(~manager.conjunction(literals[:k]), names[:k]) == 2**k - 1
    with pytest.raises(ValueError, match="not among the counted"):
        manager.count(literals[5], names[:5])


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_rows_and_picking_in_any_order(order):
    manager = DiagramManager()
    manager.add_variables("xyz")
    names = ["xyz"[i] for i in order]
    rows = np.array([[0, 0, 1], [0, 1, 0], [1, 1, 0]], dtype=np.uint8)
    states = manager.bdd_from_rows(names, rows)
    assert [states.evaluate(bits) for bits in ([0, 0, 0], [1, 1, 1])] == [False, False]
    assert manager.count(states, names) == 3
    values = manager.mtbdd_from_rows(names, rows, [0.5, 1.5, 2.5])
    assert values == manager.table(names, [0, 0.5, 1.5, 0, 0, 0, 2.5, 0])
    if names == ["x", "y", "z"]:
        assert manager.pick(states, names).tolist() == [0, 0, 1]
        assert manager.pick(manager.false, names) is None
    else:
        with pytest.raises(ValueError, match="order"):
            manager.pick(states, names)


def test_rows_must_be_sorted_and_unique(manager):
    with pytest.raises(ValueError, match="ascending"):
        manager.bdd_from_rows(NAMES, np.array([[0, 0, 1, 1], [0, 0, 1, 0]], dtype=np.uint8))
    with pytest.raises(ValueError, match="ascending"):
        manager.bdd_from_rows(NAMES, np.array([[0, 1, 0, 0], [0, 1, 0, 0]], dtype=np.uint8))
    assert manager.bdd_from_rows(NAMES, np.zeros((0, 4), dtype=np.uint8)) == manager.false
    assert manager.bdd_from_rows([], np.zeros((1, 0), dtype=np.uint8)) == manager.true


@given(numbers, numbers)
@settings(max_examples=30, deadline=None)
def test_exported_nodes_come_back(manager, left, right):
    f, g = manager.table(NAMES, left), manager.table(NAMES, right)
    table = manager.export_mtbdd([f, g])
    assert manager.import_mtbdd(table) == [f, g]
    assert len(table) == manager.shared_size([f, g])
    inner = np.arange(table.leaves, len(table))
    assert (table.low[inner] < inner).all()
    assert (table.high[inner] < inner).all()
    assert (table.level[: table.leaves] == table.levels).all()
    assert (table.level[table.low[inner]] > table.level[inner]).all()
    other = DiagramManager()
    other.add_variables(NAMES)
    assert other.import_mtbdd(table)[1].evaluate(ROWS).tolist() == right


@given(truths, truths)
@settings(max_examples=30, deadline=None)
def test_exported_sets_come_back(manager, left, right):
    f, g = manager.bdd_table(NAMES, left), manager.bdd_table(NAMES, right)
    table = manager.export_bdd(f, g, ~f)
    assert manager.import_bdd(table) == [f, g, ~f]
    for root, expected in zip(table.roots, (left, right), strict=False):
        for bits, value in zip(ROWS, expected, strict=True):
            node = root
            while node > 1:
                node = (table.high if bits[table.level[node]] else table.low)[node]
            assert node == value


def test_malformed_tables_are_refused(manager):
    ints = [
        np.array(column, dtype=np.int32)
        for column in ([4, 4, 0, 0], [0, 1, 0, 2], [0, 1, 1, 1], [3])
    ]
    with pytest.raises(ValueError, match="not below"):
        manager.import_bdd(BddTable(4, *ints))
    ints[1][3] = 3
    with pytest.raises(ValueError, match="does not exist"):
        manager.import_bdd(BddTable(4, *ints))
    with pytest.raises(ValueError, match="root"):
        manager.import_bdd(BddTable(4, *(column[:3] for column in ints[:3]), ints[3]))
    with pytest.raises(ValueError, match="length"):
        manager.import_mtbdd(NodeTable(4, ints[0], ints[1][:2], ints[2], np.zeros(2), ints[3]))


def test_images_do_not_need_frames():
    manager = DiagramManager()
    rows, columns = ["r0", "r1", "r2"], ["c0", "c1", "c2"]
    manager.add_variables(["r0", "c0", "r1", "c1", "r2", "c2"])
    r1, c1 = manager.variable("r1"), manager.variable("c1")
    flip = manager.transition(["r1"], ["c1"])
    start = manager.bdd_from_rows(rows, np.array([[0, 0, 1], [0, 1, 0]], np.uint8))
    successors = manager.bdd_from_rows(rows, np.array([[0, 0, 0], [0, 1, 1]], np.uint8))
    assert flip.image(start, r1 ^ c1) == successors
    assert flip.preimage(successors, r1 ^ c1) == start
    assert flip.image(start, (r1 & ~c1) & manager.variable("r2")) == manager.false
    manager.reorder(columns + rows)
    assert flip.image(start, r1 ^ c1) == successors
    assert flip.preimage(successors, r1 ^ c1) == start
    assert start.and_exists(r1 ^ c1, flip.rows).rename(manager.renaming({"c1": "r1"})) == successors


def test_an_order_changed_behind_our_back_is_noticed():
    """A reordering through dd, with nothing to collect, must not leave old levels in use."""
    manager = DiagramManager()
    manager.add_variables(NAMES)
    f = manager.table(NAMES, np.arange(16))
    manager.collect()
    manager.bdd.reorder({name: level for level, name in enumerate(reversed(NAMES))})
    assert f + f == manager.table(NAMES, 2 * np.arange(16))
    manager.core.check()
    manager.bdd.insert_var("new", 0)
    assert manager.order() == ("new", *reversed(NAMES))
    assert f * f == manager.table(NAMES, np.arange(16.0) ** 2)


def test_sifting_keeps_groups_together_and_helps():
    manager = DiagramManager()
    left, right = [f"x{i}" for i in range(8)], [f"y{i}" for i in range(8)]
    manager.add_variables(left + right)
    equal = manager.conjunction(
        [
            manager.variable(x).equivalent(manager.variable(y))
            for x, y in zip(left, right, strict=True)
        ]
    )
    before = equal.node_count
    manager.sift()
    assert equal.node_count < before / 4
    order = manager.order()
    pairs = [order[i : i + 2] for i in range(0, 16, 2)]
    manager.sift(pairs)
    after = manager.order()
    assert all(after.index(b) == after.index(a) + 1 for a, b in pairs)
    with pytest.raises(ValueError, match="not neighbours"):
        manager.sift([after[:3:2]])


def test_statistics_and_representations(manager):
    a = manager.variable("a")
    assert manager.statistics().variables == 4
    assert repr(manager.true) == "<Bdd true>"
    assert "1 variables" in repr(a)
    assert repr(manager.constant(0.5)) == "<Mtbdd 0.5>"
    assert "4 variables" in repr(manager)
    with pytest.raises(TypeError):
        type(a)()
    with pytest.raises(KeyError, match="nothing"):
        manager.variable("nothing")
    with pytest.raises(ValueError, match="exists"):
        manager.add_variables(["a"])
