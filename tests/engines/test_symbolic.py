"""The symbolic engines against the explicit one, question by question, on random sets of states."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest

from engines.twins import ENGINES, MODELS, Pair, explicit, fresh, pairs, pairs_of, symbolic
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.forms import DiagramOperator, MtbddEngine, SparseEngine
from symcheck.engines.symbolic.sets import SymbolicSet, SymbolicValues
from symcheck.matrices.operators import BoundStep
from symcheck.matrices.rows import SparseMatrix
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.rewards import Structure
from symcheck.symbolic.build import construct
from symcheck.syntax.ast import Type
from symcheck.syntax.operators import Operation, Operator, UnaryOperator
from symcheck.syntax.parse import parse_expression, parse_model
from syntax.operations import NUMERIC


def same(engine: SymbolicEngine, diagram: SymbolicSet, array: ArraySet) -> bool:
    return np.array_equal(engine.to_bools(diagram), array.members) and diagram.count == array.count


def rows_by_state(matrix: SparseMatrix, extra: np.ndarray) -> list[list[tuple[float, ...]]]:
    """Each state's rows, in an order that does not depend on the engine: (extra, columns and values
    …).
    """
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    result = []
    for s in range(matrix.states):
        rows = []
        for r in range(groups[s], groups[s + 1]):
            part = slice(matrix.indptr[r], matrix.indptr[r + 1])
            cells = sorted(
                zip(
                    matrix.indices[part].tolist(),
                    np.round(matrix.data[part], 12).tolist(),
                    strict=True,
                )
            )
            rows.append((round(float(extra[r]), 12), *(x for cell in cells for x in cell)))
        result.append(sorted(rows))
    return result


@pytest.mark.parametrize("name", MODELS)
def test_states_and_sizes(name: str) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    assert (a.states, a.transitions, a.choices) == (b.states, b.transitions, b.choices)
    assert list(a.valuations(a.all)) == list(b.valuations(b.all))
    assert list(b.valuations(b.all, 3)) == list(a.valuations(a.all))[:3]
    assert same(b, b.initial, a.initial)
    assert same(b, b.deadlocks, a.deadlocks)
    assert not b.none
    assert b.all.count == b.states


@pytest.mark.parametrize("name", MODELS)
def test_set_operations(name: str) -> None:
    engine = symbolic(name, SparseEngine)
    for p, q in zip(pairs(name, 6), list(pairs(name, 7))[1:], strict=True):
        assert same(engine, p.diagram & q.diagram, p.array & q.array)
        assert same(engine, p.diagram | q.diagram, p.array | q.array)
        assert same(engine, p.diagram - q.diagram, p.array - q.array)
        assert same(engine, ~p.diagram, ~p.array)
        assert (p.diagram <= q.diagram) == (p.array <= q.array)
        assert (p.diagram == q.diagram) == (p.array == q.array)
        assert bool(p.diagram) == bool(p.array)
        if p.array:
            assert same(engine, engine.first(p.diagram), explicit(name).first(p.array))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("lookups", [0, 10**9])
def test_graph_questions(name: str, lookups: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "symcheck.engines.tuning.GRAPH_LOOKUPS", lookups
    )  # so on rows, or so on diagrams
    a, b = explicit(name), fresh(name, SparseEngine)
    directions = ("min", "max") if name == "mdp" else (None,)
    for p, q in zip(pairs_of(b, 12), list(pairs_of(b, 14))[2:], strict=True):
        assert same(b, b.graph.predecessors(p.diagram), a.graph.predecessors(p.array))
        assert same(b, b.graph.all_successors_in(p.diagram), a.graph.all_successors_in(p.array))
        assert same(
            b, b.graph.exists_until(p.diagram, q.diagram), a.graph.exists_until(p.array, q.array)
        )
        assert same(b, b.graph.exists_globally(p.diagram), a.graph.exists_globally(p.array))
        for direction in directions:
            assert same(
                b,
                b.graph.prob0(p.diagram, q.diagram, direction),
                a.graph.prob0(p.array, q.array, direction),
            )
            assert same(
                b,
                b.graph.prob1(p.diagram, q.diagram, direction),
                a.graph.prob1(p.array, q.array, direction),
            )
    assert ("_rows" in vars(b.graph)) == (lookups == 0)


@pytest.mark.parametrize("name", ["dtmc", "ctmc"])
def test_bottom_components(name: str) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    expected = {tuple(np.flatnonzero(s.members)) for s in a.graph.bsccs()}
    assert {tuple(np.flatnonzero(b.to_bools(s))) for s in b.graph.bsccs()} == expected
    assert {
        tuple(np.flatnonzero(b.to_bools(s))) for s in b.graph.enumerated_bsccs(b.diagrams.states)
    } == expected


def test_end_components() -> None:
    a, b = explicit("mdp"), symbolic("mdp", SparseEngine)
    sets = list(pairs("mdp", 12))
    for p in [*sets, Pair(a.all, b.all)]:
        expected = {tuple(np.flatnonzero(s.members)) for s in a.graph.end_components(p.array)}
        assert {
            tuple(np.flatnonzero(b.to_bools(s))) for s in b.graph.end_components(p.diagram)
        } == expected
    for p, q, r in zip(sets, sets[1:], sets[2:], strict=False):
        expected_set = a.graph.accepting_end_components(
            [(p.array, [q.array]), (q.array, [r.array, p.array])]
        )
        assert same(
            b,
            b.graph.accepting_end_components(
                [(p.diagram, [q.diagram]), (q.diagram, [r.diagram, p.diagram])]
            ),
            expected_set,
        )


@pytest.mark.parametrize("name", MODELS)
def test_witnesses_are_shortest_paths(name: str) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    for p, q in zip(pairs(name, 12), list(pairs(name, 14))[2:], strict=True):
        expected, found = a.graph.witness(p.array, q.array), b.graph.witness(p.diagram, q.diagram)
        assert (expected is None) == (found is None)
        if found is None or expected is None:
            continue
        assert len(found) == len(expected)
        numbers = [list(a.valuations(a.all)).index(tuple(state.values())) for state in found]
        assert a.initial.members[numbers[0]]
        assert q.array.members[numbers[-1]]
        assert all(p.array.members[n] for n in numbers[:-1])
        for here, there in pairwise(numbers):
            target = np.zeros(a.states, bool)
            target[there] = True
            assert a.graph.predecessors(ArraySet(target)).members[here]


@pytest.mark.parametrize("kind", ENGINES)
@pytest.mark.parametrize("name", MODELS)
def test_systems(name: str, kind: type[SymbolicEngine]) -> None:
    a, b = explicit(name), symbolic(name, kind)
    sets = list(pairs(name, 5, kind))
    for p, q in zip([*sets[:3], Pair(a.all, b.all)], sets[1:], strict=True):
        s, t = a.system(p.array), b.system(p.diagram)
        assert t.n == s.n
        assert (t.groups is None) == (s.groups is None)
        if s.groups is not None:
            np.testing.assert_array_equal(t.groups, s.groups)
        rng = np.random.default_rng(3)
        x, v = rng.random(s.n), rng.random(a.states)
        values = (ArrayValues(v, v + 1), b.system(b.all).lift(v, v + 1))
        for left, right in (
            (np.zeros(s.matrix.rows), np.zeros(t.matrix.rows)),
            (s.one_step_probability(q.array), t.one_step_probability(q.diagram)),
            (s.one_step_values(values[0])[0], t.one_step_values(values[1])[0]),
            (s.one_step_values(values[0])[1], t.one_step_values(values[1])[1]),
            (s.weight_sums(), t.weight_sums()),
            (s.operator.multiply(x), t.operator.multiply(x)),
            *(
                (s.rewards(Structure(i))[1], t.rewards(Structure(i))[1])
                for i in range(len(a.model.rewards))
            ),
        ):
            assert rows_by_state(t.matrix, right) == rows_by_state(s.matrix, left)
        for i in range(len(a.model.rewards)):
            np.testing.assert_allclose(
                t.rewards(Structure(i))[0], s.rewards(Structure(i))[0], rtol=1e-14
            )
        np.testing.assert_array_equal(t.restrict(q.diagram), s.restrict(q.array))
        np.testing.assert_array_equal(t.restrict(values[1]), s.restrict(values[0]))
        rest = (q, 7.0), (sets[4], 9.0)
        lifted = s.lift(x, x + 1, [(r.array, c) for r, c in rest])
        found = t.lift(x, x + 1, [(r.diagram, c) for r, c in rest])
        np.testing.assert_array_equal(found.at(b.all), lifted.at(a.all))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("direction", ["min", "max"])
def test_diagrams_multiply_and_sweep_as_blocks_do(name: str, direction: str) -> None:
    engine = symbolic(name, MtbddEngine)
    for p in pairs(name, 3, MtbddEngine):
        system = engine.system(p.diagram)
        on_diagrams, blocks = DiagramOperator(system), system.blocks
        rng = np.random.default_rng(2)
        x = rng.random(system.n)
        np.testing.assert_allclose(on_diagrams.multiply(x), blocks.multiply(x), rtol=1e-13)
        assert on_diagrams.longest == np.diff(system.matrix.indptr).max(initial=0)
        constant, divisor = rng.random(blocks.shape[0]) * 0.1, rng.random(blocks.shape[0]) + 8.0
        operators = on_diagrams.divided(divisor), blocks.divided(divisor)
        chosen = direction if name == "mdp" else None
        for upper in (False, True):
            bounds = (
                np.full(system.n, 9.0 if upper else 0.0),
                np.full(system.n, 9.0 if upper else 0.0),
            )
            for operator, x in zip(operators, bounds, strict=True):
                for _ in range(300):
                    operator.sweep(x, BoundStep(constant, chosen, 1e-14, upper))
            np.testing.assert_allclose(bounds[0], bounds[1], rtol=1e-11)


def test_actions_of_rows() -> None:
    a, b = explicit("mdp"), symbolic("mdp", SparseEngine)
    t = b.system(b.all)
    assert t.actions is not None
    expected = rows_by_state(a.matrix, a.explored.choice_actions)
    assert rows_by_state(t.matrix, t.actions) == expected


@pytest.mark.parametrize("name", MODELS)
def test_expressions(name: str) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    texts = {
        "dtmc": ("x+y>4 & !lost", "x/(y-1)"),
        "ctmc": ("jobs>=c", "jobs*c-2"),
        "mdp": ("s=4|t=s", "pow(s,2)+t"),
    }[name]
    assert same(b, b.where(parse_expression(texts[0])), a.where(parse_expression(texts[0])))
    number = parse_expression(texts[1])
    np.testing.assert_array_equal(
        b.values(number, Type.DOUBLE).at(b.all), a.values(number, Type.DOUBLE).at(a.all)
    )
    truth = parse_expression(texts[0])
    np.testing.assert_array_equal(
        b.values(truth, Type.BOOL).at(b.all), a.values(truth, Type.BOOL).at(a.all)
    )


def value_pairs(name: str) -> list[tuple[ArrayValues, SymbolicValues]]:
    a, b = explicit(name), symbolic(name, SparseEngine)
    rng = np.random.default_rng(5)
    found: list[tuple[ArrayValues, SymbolicValues]] = [
        (a.constant(0.5), b.constant(0.5)),
        (a.constant(1, 2), b.constant(1, 2)),
    ]
    for p, q in zip(pairs(name, 6), list(pairs(name, 7))[1:], strict=True):
        s, t = a.system(p.array), b.system(p.diagram)
        low = rng.integers(-4, 5, s.n) / 4
        for upper, exact in ((None, True), (low + 0.25, False)):
            found.append(
                (
                    s.lift(low, upper, [(q.array, 0.75)], exact),
                    t.lift(low, upper, [(q.diagram, 0.75)], exact),
                )
            )
        found.append((a.indicator(p.array), b.indicator(p.diagram)))
    return found


@pytest.mark.parametrize("name", MODELS)
def test_values(name: str) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    values, sets = value_pairs(name), list(pairs(name, 3))
    for x, y in values:
        assert x.is_point == y.is_point
        for p in [*sets, Pair(a.all, b.all)]:
            np.testing.assert_array_equal(y.at(p.diagram), x.at(p.array))
            assert y.rounded(p.diagram) == x.rounded(p.array)
            np.testing.assert_allclose(y.total(p.diagram), x.total(p.array))
            if p.array:
                assert y.minimum(p.diagram) == x.minimum(p.array)
                assert y.maximum(p.diagram) == x.maximum(p.array)
        for operator, threshold in product(
            (">=", ">", "<=", "<", "=", "!="), (0.0, 0.25, 0.5, 1.0)
        ):
            for found, expected in zip(
                y.compare(operator, threshold), x.compare(operator, threshold), strict=True
            ):
                assert same(b, found, expected)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize(
    ("operator", "count"),
    [
        (UnaryOperator.MINUS, 1),
        *((o, n) for o, n in NUMERIC if not (isinstance(o, Operator) and o.is_comparison)),
    ],
)
def test_arithmetic_on_values(name: str, operator: Operation, count: int) -> None:
    a, b = explicit(name), symbolic(name, SparseEngine)
    values = value_pairs(name)
    for (x, y), (v, w) in pairwise(values):
        expected = x.map(operator, *[v, 2.0][: count - 1])
        found = y.map(operator, *[w, 2.0][: count - 1])
        np.testing.assert_array_equal(found.at(b.all), expected.at(a.all))
    p = next(pairs(name, 1))
    expected, found = (
        values[2][0].choose(p.array, values[3][0]),
        values[2][1].choose(p.diagram, values[3][1]),
    )
    np.testing.assert_array_equal(found.at(b.all), expected.at(a.all))


@pytest.mark.parametrize("name", MODELS)
def test_another_order_of_the_variables_only_numbers_the_states_otherwise(name: str) -> None:
    a, model = explicit(name), bind(parse_model(MODELS[name]))
    order = [v.name for v in reversed(model.variables)]
    b = SparseEngine.of(construct(model, Options(), order=order))
    states = list(b.valuations(b.all))
    assert states == sorted(states, key=lambda values: values[::-1])
    place = {values: i for i, values in enumerate(states)}
    moved = np.array([place[values] for values in a.valuations(a.all)])
    for p in pairs(name, 3):
        members = np.zeros(a.states, bool)
        members[moved] = p.array.members
        q = b.from_bools(members)
        expected = np.zeros(a.states)
        expected[moved] = np.add.reduceat(
            a.system(a.all).one_step_probability(p.array), _starts(a.matrix)
        )
        whole = b.system(b.all)
        np.testing.assert_allclose(
            np.add.reduceat(whole.one_step_probability(q), _starts(whole.matrix)),
            expected,
            rtol=1e-13,
        )
        assert same(
            b,
            b.graph.predecessors(q),
            ArraySet(a.graph.predecessors(p.array).members[np.argsort(moved)]),
        )


def _starts(matrix: SparseMatrix) -> np.ndarray:
    return np.arange(matrix.rows) if matrix.groups is None else matrix.groups[:-1]


def test_a_few_unknowns_among_very_many_states_need_few_numbers() -> None:
    counters = "\n".join(
        f"module m{i}\n b{i} : [0..1023] init 0;\n [] x=0 -> (b{i}'=mod(b{i}+1, 1024));\nendmodule"
        for i in range(6)
    )
    text = f"dtmc\nmodule m\n x : [0..3] init 0;\n [] x=0 & b0=5 -> 0.5:(x'=1)+0.5:(x'=2);\nendmodule\n{counters}"
    engine = SparseEngine.of(construct(bind(parse_model(text)), Options()))
    assert engine.states > 2**60
    unknown = engine.where(parse_expression("x=0 & b0=5 & b1=2 & b2=3 & b3=4 & b4=5 & b5<8"))
    system = engine.system(unknown)
    assert system.n == 8
    assert system.matrix.states == 8
    values = system.lift(
        np.arange(8) / 8, None, [(engine.where(parse_expression("x=1")), 1.0)], up_to_rounding=True
    )
    assert values.maximum(engine.all) == (1.0, 1.0)
    sure, undecided = values.compare(">=", 0.5)
    assert sure.count == engine.where(parse_expression("x=1")).count + 3
    assert undecided.count == 1  # computed as 0.5, but known up to rounding only
