"""Traces end where production ends, and every frame is what it says."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck import teach
from symcheck.errors import UnsupportedError, UsageError
from symcheck.options import Options
from symcheck.semantics.rewards import Steps
from symcheck.symbolic.build import construct
from symcheck.symbolic.reachability.search import SCHEDULES
from symcheck.syntax.parse import parse_expression

MODELS = Path(__file__).resolve().parents[2] / "models"
PHILOSOPHERS = MODELS / "dining/dining.nm"
OPTIONS = Options()


def bound(path: Path) -> symcheck.BoundModel:
    return symcheck.bind(symcheck.parse_model_file(path))


def test_construction_ends_with_the_matrix() -> None:
    made = construct(bound(MODELS / "die/die.pm"), OPTIONS)
    frames = list(teach.construction(made.space, OPTIONS))
    assert frames[-1].stage == "model"
    assert frames[-1].diagram == made.matrix
    stages = [f.stage for f in frames]
    assert stages.count("guard") == stages.count("command") == 8
    assert stages.count("update") == 15
    events = [f.diagram for f in frames if f.stage == "event"]
    assert made.space.symbolic.manager.sum(events) == made.matrix  # type: ignore[arg-type]


def test_construction_of_synchronised_modules_and_slots() -> None:
    text = """mdp
    module a x : [0..2] init 0; [t] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [t] x=1 -> (x'=2); [] x<2 -> (x'=2); endmodule
    module b y : [0..1] init 0; [t] y=0 -> (y'=1); [t] y=1 -> (y'=0); endmodule"""
    made = construct(symcheck.bind(symcheck.parse_model(text)), OPTIONS)
    frames = list(teach.construction(made.space, OPTIONS))
    assert [f.title for f in frames if f.stage == "module"] == [
        "[t] module a: sum of 2 commands",
        "[t] module b: sum of 2 commands",
    ]
    assert any(f.stage == "event" and f.title.startswith("[t] a × b") for f in frames)
    assert tuple(f.diagram for f in frames if f.stage == "model") == made.roots
    assert all(f.nodes == f.diagram.node_count for f in frames)


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_frontiers_add_up(schedule: str) -> None:
    symbolic = symcheck.build(bound(PHILOSOPHERS), OPTIONS)
    frames = list(teach.frontiers(symbolic, schedule, limit=1000))
    space = symcheck.reach(symbolic)
    assert frames[-1].states == space.states
    found = [state for frame in frames for state in frame.new_states]
    assert len(found) == len(set(found)) == space.count
    assert set(found) == set(space.valuations(space.states))
    assert frames[0].new_states == ((0, 0, 0),)


def test_frontiers_are_limited() -> None:
    frames = list(teach.frontiers(symcheck.build(bound(PHILOSOPHERS), OPTIONS), limit=2, frames=3))
    assert len(frames) == 3
    assert all(len(f.new_states) <= 2 for f in frames)
    assert str(frames[1]).startswith("1: 7 states in")
    assert str(frames[1]).endswith("in all")


def test_orders_count_the_same_states() -> None:
    frames = list(teach.compare_orders(bound(PHILOSOPHERS), OPTIONS))
    assert len({f.order for f in frames}) == 6
    assert {f.states for f in frames} == {155}
    given = list(teach.compare_orders(bound(MODELS / "die/die.pm"), OPTIONS, [("d",)]))
    assert [f.order for f in given] == [("d", "s")]


@pytest.mark.parametrize("direction", ["min", "max"])
@pytest.mark.parametrize("name", ["prob0", "prob1"])
def test_fixpoints_end_with_the_answer(name: str, direction: str) -> None:
    engine = symcheck.load(PHILOSOPHERS, engine="hybrid").engine
    goal = engine.where(parse_expression("p1=5"))
    frames = list(getattr(teach, name)(engine, engine.all, goal, direction))
    assert frames[-1].stage == "result"
    assert frames[-1].states == getattr(engine.graph, name)(engine.all, goal, direction)
    assert [f.number for f in frames] == list(range(len(frames)))
    closure = [f.count for f in frames if f.stage == "closure"]
    assert closure == sorted(set(closure))
    if (name, direction) == ("prob1", "max"):
        candidates = [f.count for f in frames if f.stage == "candidates"]
        assert candidates == sorted(candidates, reverse=True)
        assert candidates[-1] == frames[-1].count


def test_bounds_close_in_on_the_value() -> None:
    engine = symcheck.load(MODELS / "gambler/gambler.pm").engine
    seen = teach.until_trace(
        engine, engine.all, engine.where(parse_expression("money=20")), Options(method="interval")
    )
    assert (seen.zero.count, seen.one.count, seen.unknown.count) == (1, 1, 19)
    truth = np.array([float(Fraction(i, 20)) for i in range(1, 20)])
    before = np.zeros(19), np.ones(19)
    for step in seen.steps:
        assert step.lower is not None
        assert step.upper is not None
        assert (before[0] <= step.lower).all()
        assert (step.lower <= truth).all()
        assert (truth <= step.upper).all()
        assert (step.upper <= before[1]).all()
        before = step.lower, step.upper
    assert len(seen.steps) > 100


@pytest.mark.parametrize("method", ["power", "optimistic"])
def test_every_iteration_shows_its_vector(method: str) -> None:
    engine = symcheck.load(MODELS / "gambler/gambler.pm").engine
    options = Options(method=method, certify=method == "optimistic")
    seen = teach.until_trace(
        engine, engine.all, engine.where(parse_expression("money=20")), options
    )
    lows = [step.lower for step in seen.steps]
    assert all(low is not None and low.shape == (19,) for low in lows)
    assert np.abs(lows[-1] - np.arange(1, 20) / 20).max() < 1e-3
    assert not np.array_equal(lows[0], lows[-1])


def test_nothing_to_solve() -> None:
    engine = symcheck.load(MODELS / "die/die.pm").engine
    seen = teach.until_trace(engine, engine.all, engine.where(parse_expression("s=7")), OPTIONS)
    assert (seen.unknown.count, seen.problem, seen.steps) == (0, None, ())


def test_blocks_cover_the_matrix() -> None:
    made = construct(bound(MODELS / "herman/herman7.pm"), OPTIONS)
    for budget in (1, 60_000):
        seen = teach.block_structure(made, budget)
        assert seen.levels[0].counts == (made.space.count,)
        assert [level.bit for level in seen.levels] == list(made.space.symbolic.encoding.rows)
        covered = np.zeros((128, 128), bool)
        for root, block, row, column in seen.occurrences.tolist():
            rows, columns, runs = seen.blocks[block].tolist()
            assert root == 0
            assert runs > 0
            assert not covered[row : row + rows, column : column + columns].any()
            covered[row : row + rows, column : column + columns] = True
        engine = symcheck.load(MODELS / "herman/herman7.pm", engine="sparse").engine
        matrix = engine.system(engine.all).matrix
        of_row = np.repeat(np.arange(128), np.diff(matrix.indptr))
        assert covered[of_row, matrix.indices].all()
        assert seen.statistics["entries"] == matrix.entries


def test_traces_take_models_and_formulas() -> None:
    model = symcheck.load(PHILOSOPHERS)
    frames = teach.frontiers(model)
    assert frames[0].new_states == ((0, 0, 0),)
    assert len(frames) == len(list(frames)) == 8
    assert teach.construction(model)[-1].stage == "model"
    assert list(teach.prob1(model, "true", '"eating"', "max"))[-1].count == 155
    assert next(teach.compare_orders(model)).states == 155
    assert teach.block_structure(model).levels[0].counts == (155,)
    die = symcheck.load(MODELS / "die/die.pm")
    seen = teach.until_trace(die, "true", "d=6", max_steps=3)
    assert (seen.unknown.count, len(seen.steps), seen.solution) == (3, 3, None)


def test_frames_are_made_when_they_are_asked_for() -> None:
    trace = teach.frontiers(symcheck.load(PHILOSOPHERS))
    first = next(iter(trace))
    assert first is trace[0]
    assert repr(trace) == "<Trace of 8 frames>"


def test_construction_knows_where_a_command_is_enabled() -> None:
    model = symcheck.load(MODELS / "die/die.pm")
    made = construct(model.bound, OPTIONS)
    guards = [f for f in teach.construction(made.space, OPTIONS) if f.stage == "guard"]
    manager = made.space.symbolic.manager
    rows = made.space.symbolic.encoding.rows
    assert [manager.count(f.states, rows) for f in guards] == [1, 1, 1, 1, 1, 1, 1, 6]


ENDLESS = """mdp
module m
  x : [0..4];
  [a] x=0 -> (x'=1);
  [b] x=1 -> (x'=0);
  [c] x=1 -> 0.4 : (x'=2) + 0.6 : (x'=3);
  [d] x=0 -> 0.3 : (x'=2) + 0.7 : (x'=3);
  [e] x=4 -> 0.5 : (x'=4) + 0.5 : (x'=1);
  []  x=2 | x=3 -> true;
endmodule
init x=0 | x=4 endinit
"""


@pytest.mark.parametrize("method", ["interval", "policy", "optimistic"])
def test_iterates_of_end_components_are_those_of_their_states(method: str) -> None:
    """States 0 and 1 form an end component, which the methods solve as one state."""
    model = symcheck.loads(ENDLESS)
    seen = teach.until_trace(model, "true", "x=2", Options(method=method), "max")  # type: ignore[arg-type]
    assert (seen.unknown.count, len(seen.steps) > 0) == (3, True)
    last = seen.steps[-1]
    assert last.lower is not None
    assert last.lower.tolist() == pytest.approx([0.4, 0.4, 0.4], abs=1e-5)
    if method == "policy":
        assert last.policy is not None
        # State 0 moves on to 1 by [a], and 1 leaves by [c].
        assert last.policy.tolist() == [0, 3, 4]


def test_rewards_until_a_target() -> None:
    """The gambler of fair bets with goal 20 plays i (20 - i) rounds from money i."""
    model = symcheck.load(MODELS / "gambler/gambler.pm")
    goal = "money=0 | money=goal"
    seen = teach.reward_trace(model, goal, Steps(), Options(method="optimistic"))
    assert (seen.target.count, seen.infinite.count, seen.unknown.count) == (2, 0, 19)
    truth = np.array([i * (20 - i) for i in range(1, 20)])
    last = seen.steps[-1]
    assert last.lower is not None
    assert last.lower == pytest.approx(truth, abs=1e-3)
    assert seen.solution is not None
    assert (seen.solution.lower <= truth).all()
    assert (truth <= seen.solution.upper).all()


def test_states_that_never_reach_the_target_have_infinite_reward() -> None:
    model = symcheck.load(MODELS / "gambler/gambler.pm")
    seen = teach.reward_trace(model, "money=goal", Steps())
    assert (seen.target.count, seen.infinite.count, seen.unknown.count) == (1, 20, 0)
    assert seen.problem is None


@pytest.mark.parametrize("method", ["optimistic", "policy"])
def test_least_rewards_leave_out_rows_that_may_be_infinite(method: str) -> None:
    """State 0 may risk the end, but only [wait] reaches the target almost surely, in 2 steps."""
    model = symcheck.loads(
        """mdp
        module m
          x : [0..3];
          [risk] x=0 -> 0.5 : (x'=2) + 0.5 : (x'=3);
          [wait] x=0 -> 0.5 : true + 0.5 : (x'=2);
          []     x>=2 -> true;
        endmodule
        """
    )
    seen = teach.reward_trace(model, "x=2", Steps(), Options(method=method), "min")  # type: ignore[arg-type]
    assert seen.rows.tolist() == [1]
    last = seen.steps[-1]
    assert last.lower is not None
    assert last.lower.tolist() == pytest.approx([2], abs=1e-4)


def test_an_unknown_reward_structure_is_an_error() -> None:
    model = symcheck.load(MODELS / "die/die.pm")
    with pytest.raises(UsageError, match='has no reward structure "coins"; it has "tosses"'):
        teach.reward_trace(model, "s=7", "coins")


@pytest.mark.parametrize("how", ["matrix", "graph", "quotient"])
def test_traces_of_a_model_without_commands_are_those_of_its_text(how: str) -> None:
    die = symcheck.load(MODELS / "die/die.pm")
    match how:
        case "matrix":
            read = symcheck.from_matrix(die.matrix, labels={"six": die.where("d=6").mask})
        case "graph":
            six = die.where("d=6").numbers.tolist()
            read = symcheck.from_networkx(die.to_networkx(), labels={"six": six})
        case _:
            read = symcheck.quotient(die, labels={"six": "d=6"})
    last = list(teach.frontiers(read))[-1].iteration
    assert last.states == len(read.states)
    for trace, bound in ((teach.prob0, "<=0"), (teach.prob1, ">=1")):
        last_set = list(trace(read, "true", '"six"'))[-1].states
        assert last_set.count == read.where(f'P{bound} [ F "six" ]').count
    entries = teach.block_structure(read).statistics["entries"]
    assert entries == len(read.transitions)
    with pytest.raises(UnsupportedError, match="no commands"):
        teach.construction(read)
    with pytest.raises(UnsupportedError, match="no commands"):
        list(teach.compare_orders(read))


@pytest.mark.parametrize("trace", [teach.prob0, teach.prob1, teach.until_trace])
def test_traces_of_an_mdp_need_a_direction(trace: Callable) -> None:
    model = symcheck.load(MODELS / "gambler/stakes.nm")
    with pytest.raises(UsageError, match="depends on the strategy: give a direction"):
        trace(model, "true", '"rich"')
    with pytest.raises(UsageError, match="direction='Pmin': expected min or max"):
        trace(model, "true", '"rich"', direction="Pmin")


def test_the_directions_of_a_trace() -> None:
    model = symcheck.load(MODELS / "gambler/stakes.nm")
    least, most = (
        list(teach.prob0(model, "true", '"rich"', d))[-1].states.count for d in ("min", "max")
    )
    assert least == model.where('Pmin<=0 [ F "rich" ]').count
    assert most == model.where('Pmax<=0 [ F "rich" ]').count
