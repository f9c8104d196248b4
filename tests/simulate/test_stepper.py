"""The step simulator against the rows of built models, and its own promises."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

import symcheck
from symcheck.errors import ModelFault, SymcheckError, UsageError
from symcheck.syntax.ast import ModelType

MDP = """mdp
const double p = 0.25;
module left x : [0..2]; [go] x<2 -> p:(x'=x+1) + 1-p:true; [] x=1 -> (x'=0); endmodule
module right y : bool; [go] !y -> (y'=true); [stop] y -> 1:(y'=false); endmodule
label "top" = x=2;
rewards "r" x=1 : 3; [go] true : 2; endrewards
rewards y : 1; endrewards"""
CTMC = """ctmc module a s : [0..3]; [] s<3 -> 2:(s'=s+1); [] s>0 -> 0.5:(s'=s-1); endmodule
rewards "size" true : s; [] s=3 : 4; endrewards"""
DTMC = "dtmc module a s : [0..2]; [] s=0 -> (s'=1); [b] s<2 -> 0.5:(s'=0) + 0.5:(s'=2); endmodule"


def models(tmp_path):
    """Each model from its text, from explicit files, and both with rational numbers."""
    for text in (MDP, CTMC, DTMC):
        model = symcheck.loads(text)
        kind = model.program.type
        symcheck.export(model, str(tmp_path / f"{kind.name}.all"))
        files = symcheck.load_explicit(str(tmp_path / f"{kind.name}.all"), type=kind)
        yield from ((model, m) for m in (model, model.with_options(exact=True), files))
        yield model, files.with_options(exact=True)


def test_choices_are_the_rows_of_the_built_model(tmp_path):
    for model, stepped in models(tmp_path):
        matrix = model.engine.system(model.engine.all).weights
        states = [tuple(map(int, s)) for s in model.engine.valuations(model.engine.all)]
        simulator = stepped.simulator(seed=4)
        for _ in range(60):
            number = states.index(tuple(map(int, simulator.state.values())))
            rows = Counter()
            # Commands of a DTMC are equally likely; a file has the probabilities of its actions.
            commands = model.program.type is ModelType.DTMC and bool(stepped.bound.events)
            share = len(simulator.choices) if commands else 1
            first = number if matrix.groups is None else int(matrix.groups[number])
            chain = matrix.groups is None
            for i, choice in enumerate(simulator.choices):
                for b in choice.branches:
                    target = states.index(tuple(map(int, b.state)))
                    rows[first + (0 if chain else i), target] += float(b.probability) / share
            for (row, target), weight in rows.items():
                part = slice(*matrix.indptr[row : row + 2])
                entry = dict(zip(matrix.indices[part], matrix.data[part], strict=True))
                assert entry[target] == pytest.approx(weight)
            if simulator.choices:
                assert sum(rows.values()) == pytest.approx(
                    matrix.data[
                        matrix.indptr[first] : matrix.indptr[first + (1 if chain else i + 1)]
                    ].sum()
                )
                simulator.step()
            else:
                assert "deadlock" in simulator.labels
                simulator.restart()


def test_rewards_labels_and_totals(tmp_path):
    symcheck.export(symcheck.loads(MDP), str(tmp_path / "m.all"))
    for model in (symcheck.loads(MDP), symcheck.load_explicit(str(tmp_path / "m.all"))):
        simulator = model.simulator(seed=1)
        names = tuple(simulator.rewards)
        assert names[1] == "2"
        assert simulator.labels == ("init",)
        ups = [b for b in simulator.choices[0].branches if b.state[0] == 1]
        simulator.step(0, simulator.choices[0].branches.index(ups[0]))
        assert tuple(simulator.rewards.values()) == (3, 1)
        simulator.step("stop")
        assert tuple(simulator.total_rewards.values()) == (5, 1)
        assert simulator.labels == ()
        branches = simulator.choices[1 if simulator.choices[0].action is None else 0].branches
        top = next(i for i, b in enumerate(branches) if b.state[0] == 2)
        simulator.step("go", top)
        assert simulator.labels == ("top",)


def test_time_and_rates():
    simulator = symcheck.loads(CTMC).simulator(seed=9)
    simulator.run(400)
    path = simulator.path
    stays = np.diff(path.times)
    assert (stays > 0).all()
    middle = [t for t, s in zip(stays, path, strict=False) if s.state == (1,)]
    assert np.mean(middle) == pytest.approx(1 / 2.5, rel=0.3)
    expected = sum(
        t * s.state[0] + (4 if s.state == (3,) else 0) for t, s in zip(stays, path, strict=False)
    )
    assert simulator.total_rewards["size"] == pytest.approx(expected)
    frame = path.to_frame()
    assert list(frame.columns) == [
        "action",
        "probability",
        "time",
        "s",
        "size_state",
        "size_transition",
    ]
    assert len(frame) == 401
    assert frame["time"].tolist() == path.times
    assert frame["size_transition"].sum() == 4 * (frame["s"].iloc[:-1] == 3).sum()


def test_the_seed_decides():
    model = symcheck.loads(MDP)
    first, second, other = model.simulator(seed=5), model.simulator(5), model.simulator(6)
    for simulator in (first, second, other):
        simulator.run(40)
    assert list(first.path) == list(second.path) != list(other.path)
    unseeded = model.simulator()
    unseeded.run(40)
    again = model.simulator(unseeded.seed)
    again.run(40)
    assert list(again.path) == list(unseeded.path)
    # A random path is one whose steps are all taken at random.
    assert list(model.simulate(40, seed=5)) == list(first.path)


def test_random_steps_have_the_probabilities():
    simulator = symcheck.loads(MDP).simulator(seed=2)
    taken = Counter()
    for _ in range(2000):
        simulator.step("go")
        taken[simulator.state["x"]] += 1
        simulator.back()
    assert taken[1] / 2000 == pytest.approx(0.25, abs=0.04)
    choices = Counter()
    simulator.step("go")
    while simulator.state["x"] != 1:
        simulator.back()
        simulator.step("go")
    for _ in range(2000):
        simulator.step()
        choices[simulator.path[-1].action] += 1
        simulator.back()
    assert choices.keys() == {None, "stop"}
    assert choices["stop"] / 2000 == pytest.approx(0.5, abs=0.05)


def test_back_and_restart():
    simulator = symcheck.loads(DTMC).simulator(seed=1)
    seen = [simulator.state, *(simulator.step("b", 0) for _ in range(3))]
    for state in reversed(seen[:-1]):
        assert simulator.back() == state
    with pytest.raises(UsageError, match="first state"):
        simulator.back()
    simulator.run(5)
    assert simulator.restart() == {"s": 0}
    assert len(simulator.path) == 0


def test_strategies():
    simulator = symcheck.loads(MDP).simulator(seed=3)

    def alternate(s):
        return "stop" if s.state["y"] else "go"

    simulator.run(20, alternate)
    actions = [s.action for s in simulator.path][1:]
    assert actions == ["go" if i % 2 == 0 else "stop" for i in range(len(actions))]
    assert simulator.path.end == "steps" or simulator.state["x"] == 2
    simulator.restart()
    assert simulator.run(1, lambda _: 0)["y"]


def test_deadlocks_and_wrong_steps():
    simulator = symcheck.loads(DTMC).simulator(seed=1)
    for wrong in (7, -1, "c"):
        with pytest.raises(UsageError, match=f"no choice {wrong!r}: expected 0 to 1, b"):
            simulator.step(wrong)
    with pytest.raises(UsageError, match="no successor 2"):
        simulator.step("b", 2)
    assert simulator.step("b", 1) == {"s": 2}
    assert simulator.choices == ()
    assert simulator.labels == ("deadlock",)
    with pytest.raises(UsageError, match=r"\(s=2\) is a deadlock"):
        simulator.step()
    assert simulator.run(5) == {"s": 2}
    assert simulator.path.end == "deadlock"


def test_faults_are_those_of_the_state():
    text = "dtmc module m x:[0..2]; [] x=0 -> (x'=1); [] x=1 -> 0.5:(x'=2); endmodule"
    simulator = symcheck.loads(text).simulator()
    simulator.step()
    with pytest.raises(ModelFault, match=r"sum to 0\.5.*x=1"):
        simulator.step()
    assert simulator.back() == {"x": 0}


def test_text():
    simulator = symcheck.loads(MDP).simulator(seed=1)
    assert str(simulator).splitlines() == [
        "step 0: (x=0,y=false)",
        "labels: init",
        "rewards: r 0 (so far 0), 2 0 (so far 0)",
        "  0: [go] x<2 -> p:(x'=x+1) + 1-p:true || [go] !y -> (y'=true)",
        "     0.0: 0.25 to (x=1,y=true), r 2",
        "     0.1: 0.75 to (x=0,y=true), r 2",
    ]
    assert repr(simulator) == "<Simulator: step 0, (x=0,y=false), 1 choice>"
    renamed = "dtmc module a x:[0..1]; [] x=0 -> (x'=1); endmodule module b=a[x=z] endmodule"
    texts = [c.text for c in symcheck.loads(renamed).simulator().choices]
    assert texts == ["[] x=0 -> (x'=1)", "[] z=0 -> 1.0 : (z'=1)"]


def test_models_from_python():
    def step(n):
        return (
            [("up", {n + 1: Fraction(1, 3), n: Fraction(2, 3)}), ("down", {0: 1})]
            if n < 3
            else None
        )

    model = symcheck.from_function(
        0, step, labels={"end": lambda n: n == 3}, rewards={"r": (lambda n: n, lambda _, a, m: m)}
    )
    for chosen in (model, model.with_options(exact=True)):
        simulator = chosen.simulator(seed=1)
        assert [c.action for c in simulator.choices] == ["up", "down"]
        assert str(simulator.choices[0].text) == "[up]"
        simulator.run(100, lambda _: "up")
        assert simulator.state == {"s": 3}
        assert simulator.labels == ("deadlock", "end")
        stays = sum(s.state[0] for s in list(simulator.path)[:-1])
        enters = sum(s.state[0] for s in list(simulator.path)[1:])
        assert simulator.total_rewards == {"r": stays + enters}
    assert model.simulate(50, seed=3).end in ("steps", "deadlock")
    assert chosen.simulator().choices[0].branches[1].probability == Fraction(1, 3)


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "mtbdd"])
def test_a_run_follows_the_strategy_of_a_result(engine):
    """Each step is the choice that the table of the strategy names."""
    model = symcheck.loads(MDP, strategy=True, engine=engine)
    strategy = model.check('R{"r"}min=? [ F "top" & y ]').strategy
    wanted = dict(zip(strategy.states(), strategy.actions, strict=True))
    simulator = model.simulator(seed=2)
    for _ in range(30):
        if not simulator.choices:
            break
        state = tuple(simulator.state.values())
        simulator.run(1, strategy)
        assert (simulator.path.steps[-1].action or "") == wanted[state]
    assert len(simulator.path.steps) > 5


def test_a_strategy_with_memory_is_refused():
    model = symcheck.loads(MDP, strategy=True)
    strategy = model.check('Pmax=? [ (F x=1) & (F "top" & y) ]').strategy
    assert strategy.memory is not None
    with pytest.raises(UsageError, match="memory"):
        model.simulator(seed=1).run(3, strategy)


@pytest.mark.parametrize(
    ("start", "state"),
    [
        ("x=1, y=true", (1, True)),
        ("y & x=1", (1, True)),
        ("x=max(1,2), !y", (2, False)),
        ('"top", y', (2, True)),
        ("x>1 & !y", (2, False)),
    ],
)
def test_a_path_starts_in_the_state_that_a_text_names(start, state):
    simulator = symcheck.loads(MDP).simulator(1, start)
    assert tuple(simulator.state.values()) == state
    simulator.run(5)
    assert tuple(simulator.restart().values()) == state


def test_a_state_with_all_values_is_found_without_building_the_model():
    text = "dtmc module m x : [0..1000000000]; y : int; [] true -> (y'=y+1); endmodule"
    simulator = symcheck.loads(text).simulator(start="x=7, y=-3")
    assert simulator.state == {"x": 7, "y": -3}


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("x=1", r"2 states satisfy x=1, such as \(x=1, y=false\) and \(x=1, y=true\)"),
        ("x=3, y", "x=3 is outside of the range of x, 0 to 2"),
        ("x=1, x=2, y", "no reachable state satisfies x=1, x=2, y"),
        ("x=1, z", "unknown name z"),
        ("x=true, y", "an int and a bool have no common type"),
        ("x+1", "a condition is expected"),
        ("", "expected an expression"),
    ],
)
def test_a_text_that_names_no_state_is_an_error(start, message):
    with pytest.raises(SymcheckError, match=message):
        symcheck.loads(MDP).simulator(start=start)


def test_a_state_of_a_file_has_to_be_reachable(tmp_path):
    text = "dtmc module m x : [0..3]; [] x<2 -> (x'=x+1); [] x=2 -> true; endmodule"
    symcheck.export(symcheck.loads(text), str(tmp_path / "m.all"))
    files = symcheck.load_explicit(str(tmp_path / "m.all"))
    assert files.simulator(start="x=2").state == {"x": 2}
    with pytest.raises(SymcheckError, match="no reachable state satisfies x=3"):
        files.simulator(start="x=3")


def test_a_path_runs_until_a_time_and_steps_are_taken_back():
    simulator = symcheck.loads(CTMC).simulator(seed=3)
    simulator.run(1000, time=5.0)
    *_, before, last = simulator.path.times
    assert before < 5 <= last
    steps = len(simulator.path)
    assert simulator.run(1000, time=5.0) == simulator.state
    assert len(simulator.path) == steps
    simulator.back(3)
    assert len(simulator.path) == steps - 3
    with pytest.raises(UsageError, match=f"there are {steps - 3} steps to take back"):
        simulator.back(steps)
