"""States, transitions, values and distributions as Python values, on every engine."""

from __future__ import annotations

from fractions import Fraction
from html.parser import HTMLParser

import networkx
import numpy as np
import pytest

import symcheck
from symcheck.engines import tuning
from symcheck.engines.states import State
from symcheck.errors import NameFault, UnsupportedError, UsageError
from symcheck.options import ENGINES

WALK = """dtmc const int N = 3; const double p; module m x : [0..N]; b : bool;
  [] x<N -> p:(x'=x+1)&(b'=true) + 1-p:(x'=0)&(b'=false); [] x=N -> true; endmodule
  formula top = x=N; label "end" = top;
  rewards "steps" true : 1; [] x>1 : 2; endrewards"""
STATES = [(0, False), (1, True), (2, True), (3, True)]
CHOICE = """mdp module m x : [0..2]; [go] x=0 -> 0.5:(x'=1) + 0.5:(x'=0); [] x=0 -> (x'=2);
  [stay] x=2 -> true; endmodule"""
BITS = "dtmc module m0 x0 : [0..1]; [] true -> 0.5:(x0'=1-x0) + 0.5:true; endmodule " + " ".join(
    f"module m{i} = m0 [x0=x{i}] endmodule" for i in range(1, 70)
)


@pytest.fixture(params=ENGINES)
def model(request):
    return symcheck.loads(WALK, "p=1/2", engine=request.param)


def test_states_are_a_sequence_of_named_valuations(model):
    states = model.states
    assert (len(states), states.count, bool(states)) == (4, 4, True)
    assert [s.valuation for s in states] == STATES
    assert [s.number for s in states] == [0, 1, 2, 3]
    assert dict(states[1]) == {"x": 1, "b": True}
    assert states[-1] == {"x": 3, "b": True} == states[(3, True)] == states[{"b": True, "x": 3}]
    assert hash(states[1]) == hash(states[{"x": 1, "b": True}])
    assert states[1:3] == [states[1], states[2]] == states[2:0:-1][::-1]
    assert states[np.int64(2)]["x"] == 2
    assert [*states.initial] == [states[0]]
    assert repr(states[1]) == "(x=1, b=true)"
    assert {n: list(c) for n, c in states.columns().items()} == {
        "state": [0, 1, 2, 3],
        "x": [0, 1, 2, 3],
        "b": [False, True, True, True],
    }


def test_sets_of_states(model):
    high, odd = model.where("x>=2"), model.where("mod(x,2)=1")
    assert [s["x"] for s in high | odd] == [1, 2, 3]
    assert [s["x"] for s in high & odd] == [3]
    assert [s["x"] for s in high - odd] == [2]
    assert [s["x"] for s in ~high] == [0, 1]
    assert high <= model.states
    assert not high <= odd
    assert high == model.where("x>1")
    assert high != odd
    assert (~high | high) == model.states
    assert high.numbers.tolist() == [2, 3]
    assert np.asarray(high).tolist() == [False, False, True, True]
    assert high[0].number == 2
    assert not model.where("false")
    assert model.states[3] in high
    assert (2, True) in high
    assert {"x": 1, "b": True} not in high
    assert all(x not in high for x in (5, "x", {"x": 2}, None, (2, 3, 4), ("x", True)))
    assert repr(high) == "<States: 2 of 4>"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("x=N", [3]),
        ('"end" | "init"', [0, 3]),
        ("!top & b", [1, 2]),
        ("P>=0.25 [ F<=1 top ]", [2, 3]),
        ('filter(forall, "deadlock" => false)', [0, 1, 2, 3]),
    ],
)
def test_conditions(model, text, found):
    assert model.where(text).numbers.tolist() == found


def test_names(model):
    assert model.constants == {"N": 3, "p": 0.5}
    assert [(v.name, v.low, v.high) for v in model.variables] == [("x", 0, 3), ("b", 0, 1)]
    assert list(model.labels) == ["end", "init", "deadlock"]
    assert model.labels["end"].numbers.tolist() == [3]
    assert model.labels.get("ende") is None
    assert not model.deadlocks
    steps = model.rewards["steps"]
    assert (list(steps.states), list(steps.choices)) == ([1] * 4, [0, 0, 2, 2])


def test_transitions(model):
    found = [(s["x"], a, t["x"], p) for s, a, t, p in model.transitions]
    half = Fraction(1, 2)
    assert sorted(found) == [
        *((x, None, y, half) for x in range(3) for y in (0, x + 1)),
        (3, None, 3, 1),
    ]
    assert len(model.transitions) == 7
    frame = model.transitions.to_frame()
    assert list(frame) == ["source", "choice", "action", "target", "probability"]
    assert float(frame.groupby("source").probability.sum().min()) == 1
    assert np.asarray(model.matrix.sum(axis=1)).tolist() == [1] * 4
    assert model.matrix.dtype == np.float64
    graph = model.to_networkx()
    assert networkx.shortest_path(graph, 0, 3) == [0, 1, 2, 3]
    assert graph.nodes[1] == {"x": 1, "b": True}
    assert graph.edges[0, 1]["probability"] == half


def test_values_of_states(model):
    values = model.check("P=? [ F<=2 x=3 ]").values
    expected = [0, 0.25, 0.5, 1]
    assert len(values) == 4
    assert [float(v) for v in values] == expected
    assert np.asarray(values, float).tolist() == expected
    assert values[1] == values[-3] == values[{"x": 1, "b": True}] == values[(1, True)] == 0.25
    assert values[model.states[1]] == values[symcheck.loads(WALK, "p=1/2").states[1]]
    assert values[1:3].tolist() == values[model.where("x=1|x=2")].tolist() == [0.25, 0.5]
    assert {s["x"]: v for s, v in values.items()} == dict(enumerate(expected))
    frame = values.to_frame()
    bounds = [] if model.options.exact else ["lower", "upper"]
    assert (list(frame), frame.index.name) == (["x", "b", "value", *bounds], "state")
    assert frame.value.astype(float).tolist() == expected
    with pytest.raises(TypeError, match="different models"):
        values[symcheck.loads(WALK, "p=1/2").where("x=1")]
    exact = model.options.exact
    assert type(values[1]) is (Fraction if exact else float)


def test_a_quotient_gives_values_of_all_states():
    model = symcheck.load("models/die/die.pm", bisim=True)
    assert model.check("P=? [ F d=6 ]").values[{"s": 6, "d": 0}] == pytest.approx(2 / 3)
    assert len(model.check("P>0.1 [ F d=6 ]").satisfying) == 4


def test_bounds_enclose_certified_values():
    model = symcheck.loads(WALK.replace("dtmc", "ctmc"), "p=0.3", epsilon=1e-2)
    result = model.check("P=? [ F<=2 x=3 ]")
    low, high = result.bounds
    assert low < result.value < high
    assert result.accuracy == symcheck.check.result.Certified(low, high)
    assert (result.values.lower[0], result.values.upper[0]) == (low, high)
    assert list(result.values.to_frame()) == ["x", "b", "value", "lower", "upper"]


def test_bounds_of_other_results():
    model = symcheck.loads(WALK + " init x<2 & (x>0 <=> b) endinit", "p=0.5")
    low, high = model.check("P=? [ F<=2 x=3 ]").bounds
    assert low == 0
    assert 0.25 <= high <= 0.25 * (1 + 1e-14)
    low, high = model.check('R{"steps"}=? [ C<=1 ]').bounds
    assert 1 - 1e-14 < low <= 1 <= high < 1 + 1e-14
    model = symcheck.loads(WALK, "p=0.5")
    low, high = model.estimate("P=? [ F<=3 x=3 ]", samples=100, seed=1).bounds
    assert low < 0.125 < high
    estimate = model.with_options(certify=False, method="power").check('R{"steps"}=? [ F x=3 ]')
    with pytest.raises(UnsupportedError, match="an estimate has no bounds"):
        _ = estimate.bounds


def test_a_result_is_a_number_or_a_verdict():
    model = symcheck.loads(WALK, "p=0.5")
    result = model.check("P=? [ F<=3 x=3 ]")
    assert float(result) == 0.125
    assert f"{result:.2f} {result}" == "0.12 0.125 (exact up to rounding)"
    assert bool(model.check("P>0.1 [ F<=3 x=3 ]"))
    assert not model.check("P>0.2 [ F<=3 x=3 ]")
    assert float(model.with_options(exact=True).check("P=? [ F<=3 x=3 ]")) == 0.125


def test_a_result_is_not_compared_with_a_number():
    model = symcheck.loads(WALK, "p=0.5")
    result, verdict = model.check("P=? [ F<=3 x=3 ]"), model.check("P>0.1 [ F<=3 x=3 ]")
    for number in (0.125, 1, Fraction(1, 8), np.float64(0.125), (0, 1), pytest.approx(0.125)):
        with pytest.raises(TypeError, match=r"float\(result\) == pytest.approx"):
            _ = result == number
    with pytest.raises(TypeError, match=r"compare its value: result.value == True"):
        _ = verdict == True  # noqa: E712
    assert result == result
    assert result != verdict
    assert result != "0.125"
    assert len({result, verdict}) == 2


def test_an_mdp():
    model = symcheck.loads(CHOICE, strategy=True)
    assert model.matrix.toarray().tolist() == [[0, 0, 1], [0.5, 0.5, 0], [0, 1, 0], [0, 0, 1]]
    assert model.transitions.source.tolist() == [0, 0, 0, 1, 2]
    assert model.transitions.choice.tolist() == [0, 1, 1, 2, 3]
    assert model.transitions.action.tolist() == [None, "go", "go", None, "stay"]
    assert (model.transitions.action == "go").tolist() == [False, True, True, False, False]
    assert model.transitions.probability.tolist() == [1, 0.5, 0.5, 1, 1]
    assert isinstance(model.to_networkx(), networkx.MultiDiGraph)
    assert [*model.deadlocks] == [{"x": 1}]
    strategy = model.check("Pmax=? [ F x=1 ]").strategy
    assert strategy.to_frame().action.tolist() == ["go", "", "stay"]
    assert strategy.to_frame().reached.tolist() == [True, True, False]
    assert str(strategy).splitlines() == [
        "state  x  action",
        "0      0  go",
        "1      1",
        "2 of 3 states are reached",
    ]
    memory = model.check("Pmax=? [ F<=2 x=1 ]").strategy
    assert list(memory.to_frame()) == ["x", "memory", "action", "reached"]


@pytest.mark.parametrize("model", sorted(set(ENGINES) - {"exact"}), indirect=True)
def test_a_distribution(model):  # its numbers are doubles
    found = model.transient(2)
    assert found[{"x": 2, "b": True}] == found[2] == pytest.approx(0.25)
    assert np.asarray(found).tolist() == pytest.approx([0.5, 0.25, 0.25, 0])
    assert found.to_frame().probability.tolist() == pytest.approx([0.5, 0.25, 0.25, 0])
    assert str(found).splitlines()[1:] == [
        "0      0  false  0.5",
        "1      1  true   0.25",
        "2      2  true   0.25",
        "3 of 4 states have positive probability",
    ]


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)


def test_tables_of_a_notebook():
    model = symcheck.loads(WALK, "p=0.5")
    mdp = symcheck.loads(CHOICE, strategy=True)
    shown = [
        model,
        model.states,
        model.transitions,
        model.check("P=? [ F x=3 ]"),
        model.check("P=? [ F x=3 ]").values,
        model.transient(2),
        mdp.check("Pmax=? [ F x=1 ]").strategy,
        model.simulate(3, seed=1),
        symcheck.view.results(model.check_all("x<3; x>3")),
    ]
    for value in shown:
        tags = _Tags()
        tags.feed(value._repr_html_())
        assert not tags.open
        assert tags.cells
    assert "p=(1&lt;2?0.5:0)" in model.with_constants({"p": "(1<2?0.5:0)"})._repr_html_()
    assert str(model.states).splitlines()[-1] == "4 of 4 states"
    assert str(model.check("x").values).splitlines()[:2] == [
        "state  x  b      value",
        "0      0  false  0",
    ]
    assert str(model.transitions).splitlines()[1] == "0               0       0.5"


def test_sets_of_huge_models_are_not_listed():
    model = symcheck.loads(BITS)
    assert model.states.count == 2**70
    half = model.where("x0=1")
    assert (half.count, half <= model.states, bool(half)) == (2**69, True, True)
    assert {f"x{i}": 1 for i in range(70)} in half
    assert str(model.states).endswith(f"{2**70:,} of {2**70:,} states")
    assert model.check("x0+x1").values[(1,) * 70] == 2.0
    with pytest.raises(OverflowError, match="too many for len"):
        len(half)
    for ask in (
        lambda: list(half),
        lambda: half.numbers,
        lambda: half.mask,
        lambda: half.to_frame(),
        lambda: model.matrix,
        lambda: list(model.transitions),
        lambda: model.to_networkx(),
        lambda: np.asarray(model.check("x0+x1").values),
    ):
        with pytest.raises(UnsupportedError, match="are too many to list: at most 10,000,000 are"):
            ask()


@pytest.mark.parametrize("engine", ["hybrid", "sparse"])
def test_states_of_large_models_are_read_one_by_one(engine, monkeypatch):
    monkeypatch.setattr(tuning, "LISTED_STATES", 1000)
    model = symcheck.loads(BITS.split("module m20")[0], engine=engine)
    assert len(model.states) == 2**20
    assert model.states[2**19].number == 2**19
    assert [s.number for s in model.states[5:8]] == [5, 6, 7]
    half = model.where("x0=1")
    assert [s.number for s in half[:2]] == [2**19, 2**19 + 1]
    few = model.where(" & ".join(f"x{i}=1" for i in range(18)))
    assert few.numbers.tolist() == [2**20 - 4 + i for i in range(4)]
    state = few[1]
    assert (isinstance(state, State), state["x19"]) == (True, 1)
    assert model.check("P=? [ F<=1 x0=0 ]").values[state] == 0.5


@pytest.mark.parametrize(
    ("ask", "package"),
    [
        (lambda m: m.states.to_frame(), "pandas"),
        (lambda m: m.transitions.to_frame(), "pandas"),
        (lambda m: m.to_networkx(), "networkx"),
    ],
)
def test_packages_that_are_not_installed(ask, package, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(UnsupportedError, match=rf"this needs {package}(.|\n)*symcheck.frames"):
        ask(symcheck.loads(WALK, "p=0.5"))


def test_arrays_of_an_engine_cannot_be_changed():
    model = symcheck.loads(WALK, "p=0.5", engine="explicit")
    values = np.asarray(model.check("P=? [ F<=2 x=3 ]").values)
    with pytest.raises(ValueError, match="read-only"):
        values[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        model.where("x=1").mask[0] = True
    model.matrix.data[:] = 0
    model.rewards["steps"].states[:] = 0
    assert model.matrix.sum() == 4
    assert model.rewards["steps"].states.sum() == 4


def test_tables_of_many_variables_show_the_first():
    model = symcheck.loads(BITS.split("module m20")[0])
    head = str(model.states).splitlines()[0].split()
    assert head == ["state", *(f"x{i}" for i in range(12)), "…"]
    assert len(model.states[0]) == 20


def test_pictures_take_sets_of_states():
    model = symcheck.load("models/die/die.pm")
    picture = symcheck.view.state_graph(model, sets={"six": model.where("d=6")})
    assert picture.dot == symcheck.view.state_graph(model, sets={"six": "d=6"}).dot
    with pytest.raises(UsageError, match=r"another engine\n.*its formula as a text"):
        list(symcheck.teach.prob0(model, "true", model.where("d=6")))


# ------------------------------------------------------------------ successors and components

RACE = """ma module m x : [0..3]; <> x=0 -> 2:(x'=1) + 6:(x'=2);
  [left] x=1 -> 0.5:(x'=0) + 0.5:(x'=3); [right] x=1 -> (x'=3); <> x>1 -> 1:true; endmodule"""


def test_a_chain_has_one_choice_in_each_state(model):
    exact = model.options.exact or model.options.engine == "exact"
    half = Fraction(1, 2) if exact else 0.5
    (choice,) = model.successors(x=1, b=True)
    assert (choice.action, choice.takes_time) == (None, False)
    assert {tuple(s.values()): p for s, p in choice.successors.items()} == {
        (0, False): half,
        (2, True): half,
    }
    assert [model.successors(key) for key in (1, {"x": 1, "b": True}, (1, True))] == [
        model.successors(model.states[1])
    ] * 3


@pytest.mark.parametrize("engine", ENGINES)
def test_choices_of_an_mdp_are_the_rows_of_its_matrix(engine):
    mdp = symcheck.loads(CHOICE, engine=engine)
    found = [
        (state["x"], choice.action, {t["x"]: float(p) for t, p in choice.successors.items()})
        for state in mdp.states
        for choice in mdp.successors(state)
    ]
    assert sorted(found, key=str) == [
        (0, "go", {0: 0.5, 1: 0.5}),
        (0, None, {2: 1.0}),
        (1, None, {1: 1.0}),  # the self-loop of a deadlock
        (2, "stay", {2: 1.0}),
    ]


def test_choices_that_take_time_have_rates():
    (race,), left, right = (
        symcheck.loads(RACE).successors(x=0),
        *symcheck.loads(RACE).successors(x=1),
    )
    assert ({t["x"]: p for t, p in race.successors.items()}, race.takes_time) == (
        {1: 2, 2: 6},
        True,
    )
    assert [(c.action, c.takes_time) for c in (left, right)] == [("left", False), ("right", False)]
    queue = symcheck.loads(
        "ctmc module m x:[0..1]; [] x=0 -> 2:(x'=1); [] x=0 -> 3:(x'=1); endmodule"
    )
    (choice,) = queue.successors(x=0)
    assert (list(choice.successors.values()), choice.takes_time) == ([5.0], True)


def test_successors_are_asked_for_states_that_exist(model):
    with pytest.raises(KeyError, match="not reachable"):
        model.successors(x=0, b=True)
    with pytest.raises(KeyError, match="a state has values of x, b"):
        model.successors(x=0)
    with pytest.raises(TypeError, match="one argument, or by the values"):
        model.successors(0, x=0, b=False)


@pytest.mark.parametrize("engine", ENGINES)
def test_components_are_sets_of_states(engine):
    chain = symcheck.loads(
        """dtmc module m x : [0..5];
          [] x=0 -> 0.5:(x'=1) + 0.5:(x'=3); [] x=1 -> (x'=2); [] x=2 -> (x'=1);
          [] x=3 -> 0.5:(x'=4) + 0.5:(x'=5); [] x=5 -> (x'=3); endmodule""",
        engine=engine,
    )
    assert [[s["x"] for s in c] for c in chain.sccs] == [[1, 2], [3, 5], [4]]
    assert [[s["x"] for s in c] for c in chain.bsccs] == [[1, 2], [4]]
    with pytest.raises(UnsupportedError, match="end components exist only in MDPs"):
        _ = chain.mecs
    mdp = symcheck.loads(CHOICE, engine=engine)
    assert sorted([s["x"] for s in c] for c in mdp.mecs) == [[1], [2]]


def test_the_rows_of_a_generator_sum_to_zero():
    race = symcheck.loads(
        "ctmc module m x:[0..2]; [] x<2 -> 2:(x'=x+1); [] x>0 -> 3:(x'=0); endmodule"
    )
    rates = race.matrix.toarray()
    generator = rates - np.diag(rates.sum(axis=1))
    assert np.allclose(np.asarray(race.steady_state()) @ generator, 0, atol=1e-9)


# ------------------------------------------------------------------ results of several properties


def test_results_by_name_and_by_index(model):
    results = model.check_all('x=0; "end": P=? [ F "end" ]; "never": P=? [ F x=9 ]')
    assert float(results["end"]) == 1
    assert results[-1] is results["never"]
    assert results[0].value is True
    assert (len(results), repr(results)) == (3, "<PropertyResults: 0, end, never>")
    assert [result for _, result in results] == [results[i] for i in range(3)]
    assert list(results) == []  # an iterator gives each pair once
    with pytest.raises(KeyError, match="did you mean never"):
        results["nevr"]
    with pytest.raises(IndexError, match="result 3 of 3"):
        results[3]


def test_a_result_is_computed_when_it_is_asked_for(model):
    results = model.check_all('"faulty": P=? [ F y=1 ]; "end": P=? [ F "end" ]')
    assert float(results["end"]) == 1
    with pytest.raises(NameFault, match="unknown name y"):
        results["faulty"]
