"""Deterministic-state elimination: the same probabilities as the explicit engine's, at every state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engines import twins
from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.eliminate_states import deterministic_states, eliminate
from symcheck.engines.symbolic.forms import SparseEngine
from symcheck.engines.symbolic.reduced_system import ReducedSet, ReducedSystem
from symcheck.explicit.build import explore
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.settings import Accuracy
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.rewards import Structure
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_expression, parse_model

ENOUGH = 2**30
SIZE = 9

Choice = Sequence[int]
"""The successors of a choice, equally likely."""

choices = st.lists(st.integers(0, SIZE - 1), min_size=1, max_size=3, unique=True)
mdps = st.lists(st.lists(choices, min_size=1, max_size=2), min_size=SIZE, max_size=SIZE)
chains = st.lists(choices.map(lambda c: [c]), min_size=SIZE, max_size=SIZE)
subsets = st.sets(st.integers(0, SIZE - 1))


def text(kind: str, states: Sequence[Sequence[Choice]]) -> str:
    """A model of these states, all of them initial."""
    commands = [
        f"[] x={number} -> "
        + " + ".join(f"1/{len(choice)} : (x'={successor})" for successor in choice)
        + ";"
        for number, of in enumerate(states)
        for choice in of
    ]
    return f"{kind} module m x : [0..{SIZE - 1}]; {' '.join(commands)} endmodule init true endinit rewards true : x/4; [] x=1 : 2; endrewards"


def both(source: str) -> tuple[SparseEngine, ExplicitEngine]:
    model = bind(parse_model(source))
    return SparseEngine.of(construct(model, Options())), ExplicitEngine(explore(model, Options()))  # type: ignore[return-value]


def reduced(engine: SparseEngine, left: np.ndarray, right: np.ndarray) -> ReducedSystem:
    found = eliminate(
        engine.diagrams, engine.from_bools(left).bdd, engine.from_bools(right).bdd, ENOUGH
    )
    assert found is not None
    return found


def expected_values(
    engine: ExplicitEngine, left: ArraySet, right: ArraySet, direction: str | None
) -> np.ndarray:
    yes = engine.graph.prob1(left, right, direction)
    unknown = ~(yes | engine.graph.prob0(left, right, direction))
    system = engine.system(unknown)
    from symcheck.numerics.linear.problem import LinearProblem

    problem = LinearProblem(
        system.one_step_probability(yes),
        system.matrix,
        None,
        system.one_step_probability(~unknown),
        direction,
        True,
    )
    out = yes.members.astype(float)
    if unknown:
        out[unknown.members] = solve_linear(problem, Accuracy(epsilon=1e-9)).middle
    return out


def compare(
    symbolic: SparseEngine,
    explicit: ExplicitEngine,
    left: np.ndarray,
    right: np.ndarray,
    direction: str | None,
) -> None:
    arrays = ArraySet(left), ArraySet(right)
    for ask in ("prob0", "prob1"):
        found = getattr(reduced(symbolic, left, right), ask)(direction)
        expected_set = getattr(explicit.graph, ask)(*arrays, direction)
        assert found.count == expected_set.count
        assert bool(found) == bool(expected_set)
        assert np.array_equal(symbolic.to_bools(found), expected_set.members)
    with impatience():
        diagrams = symbolic.from_bools(left), symbolic.from_bools(right)
        values = until(Context(symbolic, Options(epsilon=1e-9)), *diagrams, direction)
    low, high = values.at(symbolic.all)
    expected = expected_values(explicit, *arrays, direction)
    assert np.all(low <= expected + 1e-9)
    assert np.all(high >= expected - 1e-9)
    assert np.all(high - low <= 1e-8)
    first = symbolic.first(symbolic.all)
    assert values.minimum(first) == (low[0], high[0])


@contextmanager
def impatience(lookups: int = -(10**9)) -> Iterator[None]:
    """Models of any size are large, no rows are few, and diagrams get no look-ups (or as many as is
    said).
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "ELIMINATION_STATES", 1)
        patch.setattr(tuning, "FEW_TRANSITIONS", 0)
        patch.setattr(tuning, "GRAPH_LOOKUPS", lookups)
        yield


@settings(max_examples=40)
@given(mdps, subsets, subsets, st.sampled_from([Direction.MIN, Direction.MAX]))
def test_probabilities_of_decision_processes(
    states: Sequence[Sequence[Choice]], left: set[int], right: set[int], direction: str
) -> None:
    members = [np.isin(np.arange(SIZE), list(s)) for s in (left, right)]
    compare(*both(text("mdp", states)), members[0], members[1], direction)


@settings(max_examples=40)
@given(chains, subsets, subsets)
def test_probabilities_of_chains(
    states: Sequence[Sequence[Choice]], left: set[int], right: set[int]
) -> None:
    members = [np.isin(np.arange(SIZE), list(s)) for s in (left, right)]
    compare(*both(text("dtmc", states)), members[0], members[1], None)


@pytest.mark.parametrize("name", ["mdp", "dtmc"])
def test_models_of_several_modules(name: str) -> None:
    symbolic, explicit = twins.symbolic(name, SparseEngine), twins.explicit(name)
    sets = [p.array.members for p in twins.pairs(name, 12)]
    for left, right in zip(sets[::2], sets[1::2], strict=True):
        for direction in (Direction.MIN, Direction.MAX) if name == "mdp" else (None,):
            compare(symbolic, explicit, left, right, direction)  # type: ignore[arg-type]


def test_what_is_passed_over() -> None:
    symbolic, _ = both(
        "mdp module m x : [0..5]; [] x<3 -> (x'=x+1); [] x=1 -> (x'=5); [] x=3 -> 0.5:(x'=4)+0.5:(x'=5); endmodule"
    )
    names = {
        x
        for x in range(6)
        if symbolic.where(parse_expression(f"x={x}")).bdd <= deterministic_states(symbolic.diagrams)
    }
    assert names == {0, 2, 4, 5}  # the last two have a loop as their only transition
    parts = reduced(
        symbolic, np.ones(6, bool), symbolic.to_bools(symbolic.where(parse_expression("x=4")))
    )
    assert parts.n == 2
    assert parts.representative.tolist() == [0, 0, 1, 1, 2, 3]


def test_memory_that_would_not_do() -> None:
    symbolic = twins.symbolic("mdp", SparseEngine)
    assert (
        eliminate(symbolic.diagrams, symbolic.diagrams.states, symbolic.diagrams.initial, 100)
        is None
    )


@pytest.fixture
def impatient() -> Iterator[None]:
    with impatience():
        yield


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("name", ["mdp", "dtmc", "ctmc"])
def test_graph_questions_where_diagrams_take_long(name: str) -> None:
    symbolic, explicit = twins.fresh(name, SparseEngine), twins.explicit(name)
    sets = list(twins.pairs_of(symbolic, 12))
    for left, right in zip(sets[::2], sets[1::2], strict=True):
        possible = symbolic.graph.exists_until(left.diagram, right.diagram)
        assert np.array_equal(
            symbolic.to_bools(possible),
            explicit.graph.exists_until(left.array, right.array).members,
        )
        for direction in (Direction.MIN, Direction.MAX) if name == "mdp" else (None,):
            for ask in ("prob0", "prob1"):
                found = getattr(symbolic.graph, ask)(left.diagram, right.diagram, direction)
                assert np.array_equal(
                    symbolic.to_bools(found),
                    getattr(explicit.graph, ask)(left.array, right.array, direction).members,
                )


@pytest.mark.usefixtures("impatient")
def test_sets_of_a_reduced_system_have_no_diagram_until_it_is_asked_for() -> None:
    symbolic = twins.fresh("mdp", SparseEngine)
    everything, target = symbolic.all, symbolic.where(parse_expression("s=6"))
    zero = symbolic.graph.prob0(everything, target, Direction.MAX)
    one = symbolic.graph.prob1(everything, target, Direction.MAX)
    assert isinstance(one, ReducedSet)
    unknown = ~(zero | one)
    assert isinstance(unknown, ReducedSet)
    assert isinstance(one - target, ReducedSet)
    assert "bdd" not in vars(unknown)
    assert unknown.count + zero.count + one.count == symbolic.states
    assert symbolic.to_bools(one - target).sum() == one.count - target.count
    chain = twins.fresh("ctmc", SparseEngine)  # rates are no probabilities
    assert not isinstance(chain.graph.prob0(chain.all, chain.initial, None), ReducedSet)


@pytest.mark.usefixtures("impatient")
def test_sets_that_the_system_does_not_represent_are_combined_as_diagrams() -> None:
    symbolic = twins.fresh("mdp", SparseEngine)
    one = symbolic.graph.prob1(symbolic.all, symbolic.where(parse_expression("s=6")), Direction.MAX)
    for other in twins.pairs_of(symbolic, 8):
        for found, expected in (
            (one & other.diagram, symbolic.to_bools(one) & other.array.members),
            (other.diagram & one, symbolic.to_bools(one) & other.array.members),
            (other.diagram | one, symbolic.to_bools(one) | other.array.members),
            (one - other.diagram, symbolic.to_bools(one) & ~other.array.members),
            (other.diagram - one, ~symbolic.to_bools(one) & other.array.members),
        ):
            assert np.array_equal(symbolic.to_bools(found), expected)


def test_equations_where_many_states_are_neither() -> None:
    """Diagrams answer the graph questions in time, and most unknown states are deterministic."""
    symbolic, _ = both(
        "mdp module m x : [0..9] init 0; y : bool; "
        "[] x=0 -> 0.5:(x'=1) + 0.5:(x'=5); [] x=0 -> 0.25:(x'=9) + 0.75:(x'=5); [] x>0 & x<5 -> (x'=x+1); "
        "[] x=5 -> 0.25:(x'=9) + 0.25:(x'=6) + 0.5:(x'=8); [] x=6 -> (x'=7); [] x=7 -> (x'=5); endmodule"
    )
    context = Context(symbolic, Options())
    with impatience(10**9):
        values = until(
            context, symbolic.all, symbolic.where(parse_expression("x=9")), Direction.MAX
        )
    assert [run.unknowns for run in context.log.runs] == [2]
    assert values.rounded(symbolic.initial)
    assert values.minimum(symbolic.initial)[0] == pytest.approx(0.5, rel=1e-12)
    yes, _ = values.compare(">", 0.4)
    assert symbolic.initial <= yes


@settings(max_examples=40)
@given(
    st.one_of(mdps.map(lambda s: ("mdp", s)), chains.map(lambda s: ("dtmc", s))), subsets, subsets
)
def test_formulas_where_diagrams_take_long(
    model: tuple[str, Sequence[Sequence[Choice]]], left: set[int], right: set[int]
) -> None:
    """Whole measures, by the equations on what is left, on both engines."""
    symbolic, explicit = both(text(*model))
    with impatience():
        for direction in (Direction.MIN, Direction.MAX) if model[0] == "mdp" else (None,):
            values = []
            for engine in (symbolic, explicit):
                context = Context(engine, Options(epsilon=1e-9))
                members = [
                    engine.from_bools(np.isin(np.arange(SIZE), list(s))) for s in (left, right)
                ]
                probability = until(context, *members, direction).at(engine.all)
                reward = reach_reward(context, Structure(0), members[1], direction).at(engine.all)
                values.append((probability, reward))
            for (low, high), (other_low, other_high) in zip(*values, strict=True):
                assert np.all(low <= other_high * (1 + 1e-8))
                assert np.all(other_low <= high * (1 + 1e-8))


@pytest.mark.parametrize("lookups", [-(10**9), 10**9])
@pytest.mark.parametrize("direction", [Direction.MIN, Direction.MAX])
def test_rewards_of_eliminated_states_are_added_up(direction: Direction, lookups: int) -> None:
    source = (
        "mdp module m x : [0..9] init 0; [] x=0 -> 0.5:(x'=1) + 0.5:(x'=5); [] x=0 -> (x'=7); [] x>0 & x<9 -> (x'=x+1); endmodule "
        "rewards x<9 : 1; [] x=4 : 10; x=8 : 0.5; endrewards"
    )
    symbolic, explicit = both(source)
    context = Context(symbolic, Options())
    with impatience(lookups):
        values = reach_reward(
            context, Structure(0), symbolic.where(parse_expression("x=9")), direction
        )
    assert [run.unknowns for run in context.log.runs] == [1]
    expected = reach_reward(
        Context(explicit, Options()),
        Structure(0),
        explicit.where(parse_expression("x=9")),
        direction,
    )
    assert values.at(symbolic.all)[0] == pytest.approx(expected.at(explicit.all)[0], rel=1e-12)
    assert values.rounded(symbolic.initial)


@pytest.mark.usefixtures("impatient")
def test_negative_rewards_are_left_to_others() -> None:
    symbolic, _ = both(
        "mdp module m x : [0..9] init 0; [] x<9 -> (x'=x+1); [] x=1 -> (x'=0); endmodule rewards x=2 : -1; endrewards"
    )
    context = Context(symbolic, Options())
    values = reach_reward(
        context, Structure(0), symbolic.where(parse_expression("x=9")), Direction.MIN
    )
    assert [run.unknowns for run in context.log.runs] == [9]
    assert values.minimum(symbolic.initial)[0] == pytest.approx(-1.0)


def test_few_states_are_left_to_others() -> None:
    assert not twins.fresh("mdp", SparseEngine).elimination.possible
