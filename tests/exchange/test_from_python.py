"""Models from Python against the same models in the PRISM language, and against numpy."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import symcheck
from symcheck.errors import ModelFault, NameFault, ResourceError, UnsupportedError, UsageError
from symcheck.syntax.ast import ModelType

HALF, THIRD = Fraction(1, 2), Fraction(1, 3)
Die = namedtuple("Die", "s d")
NEXT = [(1, 2), (3, 4), (5, 6), (1, None), (None, None), (None, None), (2, None)]
FACES = {3: (1,), 4: (2, 3), 5: (4, 5), 6: (6,)}


def roll(state):
    """Knuth and Yao's die."""
    s, _ = state
    if s == 7:
        return {state: 1}
    targets = [Die(t, 0) for t in NEXT[s] if t is not None]
    targets += [Die(7, face) for face in FACES.get(s, ())]
    return [(HALF, t) for t in targets]


DIE = (
    symcheck.from_function(
        Die(0, 0),
        roll,
        labels={"done": lambda x: x.s == 7},
        rewards={"flips": lambda x: int(x.s < 7)},
    ),
    """dtmc module die s : [0..7] init 0; d : [0..6] init 0;
    [] s=0 -> 0.5:(s'=1) + 0.5:(s'=2); [] s=1 -> 0.5:(s'=3) + 0.5:(s'=4);
    [] s=2 -> 0.5:(s'=5) + 0.5:(s'=6); [] s=3 -> 0.5:(s'=1) + 0.5:(s'=7)&(d'=1);
    [] s=4 -> 0.5:(s'=7)&(d'=2) + 0.5:(s'=7)&(d'=3);
    [] s=5 -> 0.5:(s'=7)&(d'=4) + 0.5:(s'=7)&(d'=5);
    [] s=6 -> 0.5:(s'=2) + 0.5:(s'=7)&(d'=6); [] s=7 -> true; endmodule
    label "done" = s=7; rewards "flips" s<7 : 1; endrewards""",
    [
        "P=? [ F d=6 ]",
        'R{"flips"}=? [ F "done" ]',
        "P=? [ F<=4 d>0 ]",
        "S=? [ d=2 ]",
        'P=? [ G ("done" => d>2) ]',
        "P=? [ X X s=3 ] ",
        "filter(sum, P=? [ F d=1 ], s<3)",
        "P>=1/6 [ F d=3 ]",
        'T=? [ F "done" ]',
        'filter(count, "done")',
        'P=? [ F{"flips"}<=3 "done" ]',
        "P=? [ (F s=4) & (F d=3) ]",
        "E [ F d=5 ]",
    ],
)


@dataclass(frozen=True)
class Robot:
    x: int
    broken: bool


def act(robot):
    if robot.broken:
        return
    if robot.x < 3:
        yield "go", {Robot(robot.x + 1, False): 0.75, Robot(robot.x, True): 0.25}
        yield "wait", ((0.5, Robot(robot.x, False)), (0.5, Robot(max(robot.x - 1, 0), False)))
    else:
        yield None, {robot: 1.0}


ROBOT = (
    symcheck.from_function(
        Robot(0, False),
        act,
        labels={"goal": lambda r: r.x == 3},
        rewards={"energy": (lambda r: r.x, lambda _, action, __: {"go": 2.5}.get(action, 0))},
    ),
    """mdp module robot x : [0..3]; broken : bool;
    [go] !broken & x<3 -> 0.75:(x'=x+1) + 0.25:(broken'=true);
    [wait] !broken & x<3 -> 0.5:true + 0.5:(x'=max(x-1,0));
    [] !broken & x=3 -> true; endmodule
    label "goal" = x=3; rewards "energy" true : x; [go] true : 2.5; endrewards""",
    [
        'Pmax=? [ F "goal" ]',
        'Pmin=? [ F "goal" ]',
        'R{"energy"}max=? [ C<=5 ]',
        'R{"energy"}min=? [ F broken | "goal" ]',
        "Pmax=? [ G F !broken ]",
        'multi(Pmax=? [ F "goal" ], Pmin>=0.3 [ G x<2 ])',
        'filter(max, Pmax=? [ F "goal" ], broken)',
        'Pmax=? [ F "deadlock" ]',
        'filter(count, "init" | broken)',
        'R{"energy"}max=? [ S ]',
    ],
)


def serve(jobs):
    return {jobs + 1: 0.7, **({jobs - 1: 1.25} if jobs else {})} if jobs < 5 else {4: 1.25}


QUEUE = (
    symcheck.from_function(
        0,
        serve,
        type="ctmc",
        labels={"full": lambda n: n == 5},
        rewards={"jobs": (lambda n: n, lambda n, _, m: 3 if m < n else 0)},
    ),
    """ctmc module queue s : [0..5]; [] s<5 -> 0.7:(s'=s+1); [out] s>0 -> 1.25:(s'=s-1); endmodule
    label "full" = s=5; rewards "jobs" true : s; [out] true : 3; endrewards""",
    [
        'P=? [ F<=2.5 "full" ]',
        "S=? [ s>2 ]",
        'R{"jobs"}=? [ C<=3 ]',
        'R{"jobs"}=? [ S ]',
        'R{"jobs"}=? [ F "full" ]',
        "P=? [ F[1,2] s=2 ]",
        'T=? [ F "full" ]',
    ],
)
TWINS = {"die": DIE, "robot": ROBOT, "queue": QUEUE}
CASES = [(name, p) for name, (_, _, properties) in TWINS.items() for p in properties]


def numbers(result):
    return [float(x) for x in np.ravel(result.value)]


@pytest.mark.parametrize("engine", ["explicit", "exact", "sparse", "hybrid", "mtbdd"])
@pytest.mark.parametrize(("name", "text"), CASES)
def test_values_are_those_of_the_model_in_the_prism_language(name, text, engine):
    model, source, _ = TWINS[name]
    twin = symcheck.loads(source, engine=engine)
    try:
        expected = twin.check(text)
    except UnsupportedError:
        with pytest.raises(UnsupportedError):
            model.with_options(engine=engine, exact=engine == "exact").check(text)
        return
    found = model.with_options(engine=engine, exact=engine == "exact").check(text)
    assert numbers(found) == pytest.approx(numbers(expected), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", TWINS)
def test_files_are_those_of_the_model_in_the_prism_language(name, tmp_path):
    model, source, properties = TWINS[name]
    for who, written in (("a", model), ("b", symcheck.loads(source))):
        # A function gives the actions of an MDP only.
        actions = "" if written.bound.type is ModelType.MDP else ":actions=false"
        symcheck.export(written, str(tmp_path / f"{who}.all{actions}"))
        symcheck.export(written, str(tmp_path / f"{who}.drn{actions}"))
        symcheck.export(written, str(tmp_path / f"{who}.umb"))
    names = {path.name.partition(".")[2] for path in tmp_path.iterdir()} - {"umb"}
    for ending in names:
        assert (tmp_path / f"a.{ending}").read_text() == (tmp_path / f"b.{ending}").read_text()
    again = symcheck.load_explicit(str(tmp_path / "a.umb"))
    assert numbers(again.check(properties[0])) == numbers(model.check(properties[0]))


def test_fractions_stay_exact():
    model = symcheck.from_function(
        0,
        lambda n: {0: 2 * THIRD, 1: THIRD} if n == 0 else {},
        rewards={"r": (lambda n: Fraction(1, 10**9 + 7), lambda *_: THIRD)},
        exact=True,
    )
    assert model.check("P=? [ F<=2 s=1 ]").value == Fraction(5, 9)
    assert model.check("R=? [ F s=1 ]").value == 3 * Fraction(1, 10**9 + 7) + 1
    matrix = np.array([[THIRD, 2 * THIRD], [0, 1]], dtype=object)
    assert symcheck.from_matrix(matrix, exact=True).check("P=? [ F<=2 s=1 ]").value == Fraction(
        8, 9
    )
    decimals = symcheck.from_matrix([[0.9, 0.1], [0, 1]], exact=True)
    assert decimals.check("P=? [ F<=1 s=1 ]").value == Fraction(1, 10)
    with pytest.raises(ModelFault, match="sum to 999999/1000000, not to 1"):
        symcheck.from_function(0, lambda _: {0: Fraction(999999, 10**6)})


def test_variables_are_the_fields_and_otherwise_s():
    def names(initial):
        model = symcheck.from_function(initial, lambda s: {s: 1})
        return [(v.name, v.type.value) for v in model.bound.variables]

    assert names(Robot(2, True)) == [("x", "int"), ("broken", "bool")]
    assert names((1, 2)) == [("s", "int")] == names(7) == names("idle")
    assert names([Die(0, 0), "other"]) == [("s", "int")]
    model = symcheck.from_function("b", {"b": {"a": 1}, "a": {"b": 1}}.get)
    assert model.objects == ["b", "a"]
    assert model.check("P=? [ X s=1 ]").value == 1
    negative = symcheck.from_function(3, lambda n: {n - 1: 1} if n > -3 else {n: 1})
    assert negative.check("P=? [ F s=-3 ]").value == 1
    assert negative.objects == [*range(-3, 4)]


def test_several_initial_states():
    model = symcheck.from_function([2, 5], lambda n: {max(n - 1, 0): 1})
    assert model.check('filter(count, "init")').value == 2
    given = symcheck.from_matrix(np.eye(4), initial=[1, 3])
    assert given.check('filter(sum, s, "init")').value == 4


def test_a_matrix_of_an_mdp():
    matrix = scipy.sparse.coo_matrix([[0.5, 0.5, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]])
    model = symcheck.from_matrix(
        matrix,
        groups=[0, 2, 3, 4],
        actions=["a", "b", None, None],
        labels={"end": np.array([False, False, True]), "none": []},
        rewards={"cost": (None, [1, 5, 0, 0]), "each": (None, 2 * matrix), "at": [3, 0, 0]},
    )
    assert model.bound.type is ModelType.MDP
    assert model.engine.model.actions == ("a", "b")
    assert model.check('Pmax=? [ F "end" ]').value == 1
    assert model.check('Pmin=? [ F "end" ]').value == 0
    assert model.check('R{"cost"}max=? [ C<=1 ]').value == 5
    assert model.check('R{"each"}max=? [ C<=1 ]').value == 2
    assert model.check('R{"at"}max=? [ C<=2 ]').value == 4.5
    assert model.check('filter(count, "none")').value == 0


@st.composite
def chains(draw):
    """A random matrix with rows that sum to 1, about half of its entries 0."""
    n = draw(st.integers(2, 7))
    weights = draw(
        st.lists(st.lists(st.integers(0, 6), min_size=n, max_size=n), min_size=n, max_size=n)
    )
    matrix = np.maximum(np.array(weights, float) - 2, 0) + np.eye(n) * 1e-3
    return matrix / matrix.sum(axis=1, keepdims=True)


def reaching(matrix, target):
    """The states from which the target is reachable."""
    found = target.copy()
    for _ in range(len(matrix)):
        found |= (matrix[:, found] > 0).any(axis=1)
    return found


@settings(max_examples=60, deadline=None)
@given(chains(), st.booleans())
def test_random_chains_against_numpy(matrix, sparse):
    n = len(matrix)
    target = np.arange(n) == n - 1
    given_matrix = scipy.sparse.csc_array(matrix) if sparse else matrix
    model = symcheck.from_matrix(given_matrix, labels={"end": target}, rewards={"r": np.arange(n)})
    unknown = reaching(matrix, target) & ~target
    expected = target.astype(float)
    inner = np.ix_(unknown, unknown)
    expected[unknown] = np.linalg.solve(
        np.eye(unknown.sum()) - matrix[inner], matrix[unknown][:, target].sum(axis=1)
    )
    result = model.check('P=? [ F "end" ]')
    lower, _ = result.values.at(model.engine.all)
    assert lower == pytest.approx(expected, abs=1e-6)
    power = np.linalg.matrix_power(matrix, 4)
    assert model.check("P=? [ F=4 s=1 ]").value == pytest.approx(power[0, 1], abs=1e-12)
    steps = sum(np.linalg.matrix_power(matrix, k) for k in range(4))
    assert model.check("R=? [ C<=4 ]").value == pytest.approx((steps @ np.arange(n))[0])
    assert symcheck.from_function(
        0,
        lambda s: dict(enumerate(matrix[s].tolist())),
        labels={"e": lambda s: s == n - 1},
    ).check('P=? [ F "e" ]').value == pytest.approx(expected[0], abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(chains(), st.floats(0.1, 5))
@example(np.array([[1, 0, 0], [0, 0.001, 0.999], [0, 0.9995, 0.0005]]), 2.0)  # ratios overflow
def test_random_ctmcs_against_numpy(matrix, time):
    rates = 3 * matrix - np.diag(np.diag(3 * matrix))
    generator = rates - np.diag(rates.sum(axis=1))
    model = symcheck.from_matrix(rates, type=ModelType.CTMC)
    expected = expm(generator * time)[0]
    found = model.check(f"P=? [ F[{time!r},{time!r}] s=1 ]").value
    assert found == pytest.approx(expected[1], abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(chains(), chains(), st.sampled_from(["explicit", "sparse", "hybrid", "mtbdd"]))
def test_random_mdps_against_numpy(left, right, engine):
    n = min(len(left), len(right))
    rows = np.concatenate(
        [[a[s], b[s]] for s in range(n) for a, b in [(fold(left, n), fold(right, n))]]
    )
    earned = np.arange(2 * n) % 3
    model = symcheck.from_matrix(
        rows, groups=np.arange(n + 1) * 2, rewards={"r": (np.arange(n), earned)}, engine=engine
    )
    total = np.zeros(n)
    for _ in range(3):
        total = np.arange(n) + (earned + rows @ total).reshape(n, 2).max(axis=1)
    assert model.check("Rmax=? [ C<=3 ]").value == pytest.approx(total[0])
    best = np.zeros(n)
    best[-1] = 1
    for _ in range(7):
        best = np.maximum((rows @ best).reshape(n, 2).max(axis=1), np.arange(n) == n - 1)
    result = model.check(f"Pmax=? [ F<=7 s={n - 1} ]")
    assert result.values.at(model.engine.all)[0] == pytest.approx(best, abs=1e-9)


def fold(matrix, n):
    """The first n rows, with the columns beyond n moved to the first one."""
    small = matrix[:n, :n].copy()
    small[:, 0] += matrix[:n, n:].sum(axis=1)
    return small


SQUARE = [[0.5, 0.5], [0.0, 1.0]]
WRONG_MATRICES = [
    (([[0.5, 0.4], [0, 1]],), {}, ModelFault, "row 0 sums to 0.9, not to 1"),
    (([[0.5, 0.5], [0, 0]],), {}, ModelFault, "row 1 sums to 0.*1 on the diagonal"),
    (([[1.5, -0.5], [0, 1]],), {}, ModelFault, "row 0 holds -0.5 in column 1"),
    (([[-1, 1], [2, -2]],), {"type": "ctmc"}, ModelFault, "diagonal of a generator"),
    (([[0.5, 0.5]],), {}, UsageError, "1 rows and 2 columns: expected a square one"),
    (([0.5, 0.5],), {}, UsageError, "has 1 dimensions: expected 2"),
    ((np.zeros((0, 0)),), {}, UsageError, "0 rows and 0 columns"),
    (([[1, "x"], [0, 1]],), {}, UsageError, "expected finite real numbers"),
    (([[1, np.nan], [0, 1]],), {}, UsageError, "expected finite real numbers"),
    (([[1, 1j], [0, 1]],), {}, UsageError, "expected finite real numbers"),
    ((SQUARE,), {"type": "chain"}, UsageError, "expected one of dtmc, ctmc, mdp"),
    ((SQUARE,), {"type": "ma"}, UsageError, "nothing tells rates.*from_function"),
    ((SQUARE,), {"type": "pta"}, UsageError, "needs a text"),
    ((SQUARE,), {"type": "dtmc", "groups": [0, 1, 2]}, UsageError, "expected a square one"),
    ((SQUARE,), {"groups": [0, 2]}, UsageError, "groups with 3 ascending numbers"),
    ((SQUARE,), {"groups": [0, 3, 2]}, UsageError, "groups with 3 ascending numbers"),
    ((SQUARE,), {"actions": ["a", "b"]}, UsageError, "of an MDP"),
    ((SQUARE,), {"type": "mdp", "actions": ["a"]}, UsageError, "each of the 2 rows"),
    ((SQUARE,), {"type": "mdp", "actions": ["a", "go on"]}, NameFault, "name of an action"),
    ((SQUARE,), {"labels": {"end": [2]}}, UsageError, "no state 2; expected 0 to 1"),
    ((SQUARE,), {"labels": {"end": [True]}}, UsageError, "expected 2 truth values"),
    ((SQUARE,), {"labels": {"init": [1]}}, NameFault, "predefined"),
    ((SQUARE,), {"labels": {"the end": [1]}}, NameFault, "name of a label"),
    ((SQUARE,), {"rewards": {"r": [1, 2, 3]}}, UsageError, "expected 2 rewards of states"),
    ((SQUARE,), {"rewards": {"r": (None, np.eye(3))}}, UsageError, "2 x 2 or one"),
    ((SQUARE,), {"rewards": {"r": [1, np.inf]}}, UsageError, "finite real numbers"),
    ((SQUARE,), {"initial": 2}, UsageError, "no state 2"),
    ((SQUARE,), {"engine": "fast"}, UsageError, "expected one of"),
]


@pytest.mark.parametrize(("positional", "keywords", "error", "message"), WRONG_MATRICES)
def test_errors_of_matrices(positional, keywords, error, message):
    with pytest.raises(error, match=f"(?s){message}"):
        symcheck.from_matrix(*positional, **keywords)


Bad = namedtuple("Bad", "module F")
WRONG_FUNCTIONS = [
    (0, lambda s: {s + 1: 1 / (3 - s)}, {"type": "ctmc"}, ModelFault, r"step\(3\) raised ZeroDiv"),
    (0, lambda s: (1 / 0 for _ in "x"), {}, ModelFault, r"step\(0\) raised ZeroDivisionError"),
    (0, lambda s: {s + 1: 1}, {"max_states": 9}, ResourceError, "more than 9 states"),
    (0, lambda _: {0: 0.9}, {}, ModelFault, "sum to 0.9, not to 1"),
    (0, lambda n: [(1 - n, 0.5), (n, 0.5)], {}, ModelFault, r"gives pairs \(state, probability\)"),
    (0, lambda n: [("a", [(n, 0.5), (1, 0.5)])], {}, ModelFault, r"gives pairs \(state, prob"),
    (0, lambda _: [("a", {0: 0.9})], {}, ModelFault, "for 'a' sum to 0.9"),
    (0, lambda _: [("a", {})], {}, ModelFault, "for 'a' sum to 0, not"),
    (0, lambda _: {0: 2, 1: -1}, {}, ModelFault, r"step\(0\) gives -1 as the probability"),
    (0, lambda _: {0: float("nan")}, {}, ModelFault, r"step\(0\) gives nan"),
    (0, lambda _: {0: "1"}, {}, ModelFault, r"step\(0\) gives '1'"),
    (0, lambda _: 7, {}, ModelFault, r"step\(0\) gives 7.*expected {state: probability}"),
    (0, lambda _: [7], {}, ModelFault, r"step\(0\) gives \[7\]"),
    (0, lambda _: [("a", 7)], {}, ModelFault, r"step\(0\) gives 7"),
    (0, lambda _: [("a b", {0: 1})], {}, NameFault, "name of an action"),
    (0, lambda _: [(1, [0])], {}, ModelFault, r"the state \[0\] is not hashable"),
    ({}, lambda _: {}, {}, ModelFault, "the state {} is not hashable"),
    ([], lambda _: {}, {}, UsageError, "list of initial states is empty"),
    (0, lambda _: [("a", {0: 1})], {"type": "dtmc"}, UsageError, "only an MDP has, not a DTMC"),
    (
        0,
        lambda s: {s: 1},
        {"labels": {"x": lambda s: s.y}},
        ModelFault,
        r"labels\['x'\]\(0\) raised",
    ),
    (0, lambda s: {s: 1}, {"labels": {"deadlock": bool}}, NameFault, "predefined"),
    (
        0,
        lambda s: {s: 1},
        {"rewards": {"r": str}},
        UsageError,
        r"rewards\['r'\]: expected finite real numbers",
    ),
    (0, lambda s: {s: 1}, {"rewards": {"2": str}}, NameFault, "name of a reward structure"),
    (Bad(1, 2), lambda s: {s: 1}, {}, NameFault, "'module', a field of the states"),
]


@pytest.mark.parametrize(("initial", "step", "keywords", "error", "message"), WRONG_FUNCTIONS)
def test_errors_of_functions(initial, step, keywords, error, message):
    with pytest.raises(error, match=f"(?s){message}"):
        symcheck.from_function(initial, step, **keywords)


def test_unknown_labels_and_deadlocks():
    model = symcheck.from_function(0, lambda s: {1: 1} if s == 0 else None, labels={"end": bool})
    with pytest.raises(NameFault, match="did you mean end"):
        model.check('P=? [ F "ende" ]')
    assert model.check('P=? [ F "deadlock" & "end" ]').value == 1
    with pytest.raises(ModelFault, match="1 deadlock state"):
        model.with_options(fix_deadlocks=False).check("P=? [ F s=1 ]")
    loose = symcheck.from_function(0, lambda _: {0: 0.5, 1: 0.4}, check_sums=False)
    assert loose.check("P=? [ F=1 s=1 ]").value == 0.4


@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd"])
def test_the_model_shows_itself(engine):
    model = symcheck.from_function(
        Robot(0, False), act, labels={"goal": lambda r: r.x == 3}, engine=engine
    )
    assert len(model.states) == 7
    assert [s["x"] for s in model.states] == [r.x for r in model.objects]
    assert model.where('"goal" | broken').count == 4
    assert model.where('Pmax>=1 [ F "goal" ]').count == 1
    assert model.labels["goal"].count == 1
    assert model.matrix.shape == (10, 7)
    assert model.matrix.sum() == 10
    assert model.simulator(seed=1).step("go")["x"] in (0, 1)
    assert model.to_networkx().number_of_nodes() == 7


def test_diagrams_need_different_states(tmp_path):
    (tmp_path / "m.tra").write_text("2 2\n0 1 1\n1 0 1\n")
    (tmp_path / "m.sta").write_text("(x)\n0:(4)\n1:(4)\n")
    model = symcheck.load_explicit(str(tmp_path / "m.tra,sta"))
    assert model.check("P=? [ F x=4 ]").value == 1
    with pytest.raises(UnsupportedError, match="two states have the same values"):
        model.with_options(engine="sparse").check("P=? [ F x=4 ]")


def test_options_of_models_without_commands():
    model, _, properties = ROBOT
    expected = [model.check(p).value for p in properties[:5]]
    for options in (
        {"bisim": True},
        {"bisim": True, "engine": "mtbdd"},
        {"engine": "hybrid", "order": ("broken", "x")},
        {"engine": "mtbdd", "order": ("force",)},
        {"engine": "sparse", "reduce": True},
        {"method": "policy"},
    ):
        found = model.with_options(**options)
        assert [found.check(p).value for p in properties[:5]] == pytest.approx(expected)
    with pytest.raises(UnsupportedError, match="-order sift"):
        model.with_options(engine="sparse", order=("sift",)).check(properties[0])
    # The threshold is decided in rational arithmetic, by the Fractions that were given.
    coin = symcheck.from_function(0, lambda n: {0: THIRD, 1: THIRD, 2: THIRD} if n == 0 else {n: 1})
    for engine in ("explicit", "sparse", "hybrid", "mtbdd"):
        assert coin.with_options(engine=engine).check("P>=1/2 [ F s=1 ]").value is True
        assert coin.with_options(engine=engine).check("P>1/2 [ F s=1 ]").value is False
    chosen = model.with_options(engine="mtbdd", strategy=True).check(properties[0])
    assert chosen.strategy.actions[:2] == ["go", ""]
