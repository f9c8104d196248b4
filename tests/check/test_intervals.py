"""Models with intervals of probabilities: nature chooses from them, after the strategy is known."""

from __future__ import annotations

from fractions import Fraction as Q
from math import inf
from pathlib import Path
from random import Random

import intervals as drawn_intervals
import numpy as np
import pytest

import symcheck
from checking import judge_file, lines_without_run
from oracles import intervals
from symcheck.check.result import Certified
from symcheck.check.testing.expected_results import VerdictKind
from symcheck.errors import InputError, ModelFault, UnsupportedError
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics.linear import intervals as interval_problems

MODELS = Path(__file__).parents[2] / "models" / "intervals"
ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
CHAIN = """dtmc
module m
  s : [0..3];
  [] s=0 -> [0.2,0.6] : (s'=1) + [0.3,0.8] : (s'=2);
  [] s=1 -> [0.1,0.5] : (s'=0) + [0.2,0.7] : (s'=2) + [0.3,0.6] : (s'=3);
  [] s>=2 -> true;
endmodule
rewards "steps" s<2 : 1; endrewards
"""
GAME = """mdp
module m
  s : [0..4];
  [a] s=0 -> [0.2,0.6] : (s'=1) + [0.3,0.8] : (s'=2);
  [b] s=0 -> [0.1,0.9] : (s'=2) + [0.1,0.9] : (s'=4);
  [] s=1 -> [0.3,0.5] : (s'=3) + [0.4,0.8] : (s'=4);
  [] s=2 -> [0.6,0.7] : (s'=3) + [0.3,0.8] : (s'=0);
  [] s>2 -> true;
endmodule
rewards "steps" s<3 : 1; endrewards
"""


def loaded(text: str, engine: str) -> symcheck.Model:
    return (
        symcheck.loads(text, exact=True)
        if engine == "exact"
        else symcheck.loads(text, engine=engine)
    )


def encloses(result: symcheck.Result, value: Q) -> bool:
    accuracy = result.accuracy
    if isinstance(accuracy, Certified):
        return Q(accuracy.lower) <= value <= Q(accuracy.upper)
    return result.value == value or abs(result.value - value) <= 1e-12 * value


# ------------------------------------------------------------------------------------------ values


@pytest.mark.parametrize("engine", [*ENGINES, "auto"])
@pytest.mark.parametrize(
    ("text", "value"),
    [
        # From 1: 3/10 at least to 3, 5/10 at most back to 0, and 2/10 to 2.
        ("Pmin=? [ F s=3 ]", Q(2, 10) * Q(3, 10) / (1 - Q(2, 10) * Q(1, 10))),
        ("Pmax=? [ F s=3 ]", Q(6, 10) * Q(6, 10) / (1 - Q(6, 10) * Q(2, 10))),
        ("Pmin=? [ X s=1 ]", Q(2, 10)),
        ("Pmax=? [ X s=1 ]", Q(6, 10)),
        ("Pmax=? [ F<=2 s=3 ]", Q(36, 100)),
        ("Pmin=? [ s<2 U[2,2] s=3 ]", Q(6, 100)),
        ("Pmax=? [ G s!=3 ]", 1 - Q(6, 100) / Q(98, 100)),
        ("Pmin=? [ G<=2 s!=3 ]", 1 - Q(36, 100)),
        ("Pmax=? [ F G s=3 ]", Q(36, 100) / Q(88, 100)),
        ("Pmin=? [ (F s=1) & (F s=3) ]", Q(6, 100) / Q(98, 100)),
        ("Rmax=? [ F s>=2 ]", Q(16, 10) / (1 - Q(6, 10) * Q(5, 10))),
        ("Rmin=? [ F s>=2 ]", Q(12, 10) / (1 - Q(2, 10) * Q(1, 10))),
        ("Tmin=? [ F s>=2 ]", Q(12, 10) / (1 - Q(2, 10) * Q(1, 10))),
        ("Rmax=? [ C<=2 ]", Q(16, 10)),
        ("Rmin=? [ I=1 ]", Q(2, 10)),
    ],
)
def test_nature_alone_chooses_in_a_chain(engine, text, value):
    assert encloses(loaded(CHAIN, engine).check(text), value)
    assert loaded(CHAIN, "exact").check(text).value == value


@pytest.mark.parametrize("engine", ENGINES)
def test_the_player_chooses_before_nature(engine):
    model, exact = loaded(GAME, engine), loaded(GAME, "exact")
    values = {}
    for direction in ("minmin", "minmax", "maxmin", "maxmax"):
        values[direction] = exact.check(f"P{direction}=? [ F s=3 ]").value
        assert encloses(model.check(f"P{direction}=? [ F s=3 ]"), values[direction])
    # Against b, nature answers with 4; a is then better, and x = 0.4 (0.3) + 0.6 (0.6 + 0.4 x).
    assert values["maxmin"] == max(
        Q(1, 10) * Q(6, 10) / (1 - Q(1, 10) * Q(4, 10)),
        (Q(6, 10) * Q(3, 10) + Q(4, 10) * Q(6, 10)) / (1 - Q(4, 10) * Q(4, 10)),
    )
    assert values["minmin"] < values["minmax"] < values["maxmax"]


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("P>=3/49 [ F s=3 ]", True),
        ("P>3/49 [ F s=3 ]", False),
        ("P<=9/22 [ F s=3 ]", True),
        ("P<9/22 [ F s=3 ]", False),
        ("P>=1 [ F s>=2 ]", True),
        ("P>0 [ F s=3 ]", True),
        ("P<1 [ F s=3 ]", True),
        ("Pmax>=9/22 [ F s=3 ]", True),
        ("P>=0.2 [ X P>=0.3 [ X s=3 ] ]", True),
        ("P>0.2 [ X P>=0.3 [ X s=3 ] ]", False),
    ],
)
def test_thresholds_at_the_value_are_decided(engine, text, holds):
    assert loaded(CHAIN, engine).check(text).value is holds


def test_a_target_that_may_be_missed_costs_infinitely_much():
    assert symcheck.loads(CHAIN).check("Rmin=? [ F s=3 ]").value == inf
    assert symcheck.loads(GAME).check("Rmaxmin=? [ F s>=3 ]").value < inf


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "exact"])
def test_intervals_of_commands_that_synchronise_are_multiplied(engine):
    text = """mdp
    module a x : [0..2]; [go] x=0 -> [0.2,0.5]:(x'=1) + [0.5,0.8]:(x'=2); [] x>0 -> true; endmodule
    module b y : [0..2]; [go] y=0 -> [0.1,0.3]:(y'=1) + 0.8:(y'=2); [] y>0 -> true; endmodule
    """
    # The ends of the product are 0.02 and 0.15; the other products leave room for both.
    model = loaded(text, engine)
    assert encloses(model.check("Pminmin=? [ F x=1&y=1 ]"), Q(2, 100))
    assert encloses(model.check("Pmaxmax=? [ F x=1&y=1 ]"), Q(15, 100))


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "exact"])
def test_overlapping_commands_of_a_chain_are_equally_likely(engine):
    text = """dtmc
    module m s : [0..3];
      [a] s=0 -> [0.2,0.6]:(s'=1) + [0.4,0.8]:(s'=2);
      [b] s=0 -> [0.5,0.5]:(s'=2) + 0.5:(s'=3);
      [] s>0 -> true;
    endmodule
    rewards [a] true : 1; [b] true : 3; endrewards"""
    model = loaded(text, engine)
    assert encloses(model.check("Pmin=? [ F s=1 ]"), Q(1, 10))
    assert encloses(model.check("Pmax=? [ F s=2 ]"), Q(65, 100))
    assert encloses(model.check("Rmax=? [ F s>0 ]"), Q(2))


def test_intervals_that_are_points_are_numbers():
    text = """dtmc module m s:[0..1]; [] s=0 -> [0.5,0.5]:(s'=1) + [0.5,0.5]:true;
    [] s=1 -> [1,1]:(s'=0); endmodule rewards s=1 : 3; endrewards"""
    model = symcheck.loads(text)
    assert model.check("Rmin=? [ S ]").value == pytest.approx(1.0, rel=1e-6)
    assert model.check("Smax=? [ s=1 ]").value == pytest.approx(1 / 3, rel=1e-6)


@pytest.mark.parametrize("direct", [True, False], ids=["by elimination", "by BiCGStab"])
def test_slow_chains_end_with_the_right_value(direct, monkeypatch):
    if not direct:
        monkeypatch.setattr(interval_problems, "_SOLVED_STATES", 0)
    # A fair walk on 0..200 with a little play: about 1e4 steps, so that each iteration gains little.
    text = """mdp module m s : [0..200] init 100;
    [] s>0&s<200 -> [0.499,0.501]:(s'=s+1) + [0.499,0.501]:(s'=s-1); [] s=0|s=200 -> true;
    endmodule rewards s>0&s<200 : 1; endrewards"""
    model = symcheck.loads(text)
    for direction, end in (("minmin", Q(501, 499)), ("maxmax", Q(499, 501))):
        ruin = 1 - (1 - end**100) / (1 - end**200)
        assert encloses(model.check(f"P{direction}=? [ F s=200 ]"), 1 - ruin)
    # Nature that maximises the time drives the walk to the middle.
    slow = model.check("Rmaxmax=? [ F s=0|s=200 ]")
    assert slow.value > 10_000
    assert slow.accuracy.upper - slow.accuracy.lower < 1e-5 * slow.value


def test_a_state_that_a_policy_never_leaves_has_no_approximate_value():
    stays = SparseMatrix(np.arange(3), np.arange(2, dtype=np.int32), np.array([1.0, 0.5]), 2)
    ones = np.ones(2)
    for states in (0, 2):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(interval_problems, "_SOLVED_STATES", states)
            found = interval_problems._evaluated(stays, ones, ones)
            assert found is None or not np.isfinite(found).all()


def test_random_models_agree_with_vertices_and_strategies():
    differences = [
        difference
        for run in range(6)
        for engine in ("explicit", "mtbdd", "exact")
        for difference in drawn_intervals.differences(
            drawn_intervals.drawn(Random(f"test-{run}")), engine
        )
    ]
    assert differences == []


def test_the_oracle_knows_an_interval_row():
    row = {0: (Q(1, 10), Q(5, 10)), 1: (Q(2, 10), Q(6, 10)), 2: (Q(3, 10), Q(9, 10))}
    found = intervals.vertices(row)
    assert {tuple(v.get(t, 0) for t in range(3)) for v in found} == {
        (Q(1, 10), Q(2, 10), Q(7, 10)),
        (Q(1, 10), Q(6, 10), Q(3, 10)),
        (Q(5, 10), Q(2, 10), Q(3, 10)),
    }
    loop = [[{0: (Q(0), Q(1)), 1: (Q(0), Q(1))}], [{1: (Q(1), Q(1))}]]
    assert intervals.until(loop, min, min, {0, 1}, {1}) == [0, 1]
    assert intervals.until(loop, min, max, {0, 1}, {1}) == [1, 1]


# ------------------------------------------------------------------------------- known models


@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd", "exact"])
@pytest.mark.parametrize("name", ["stakes.nm", "gambler.pm"])
def test_the_models_have_their_known_values(name, engine):
    properties = MODELS / f"{name.split('.')[0]}.pctl"
    for checked in judge_file(MODELS / name, properties, {}, engine):
        assert checked.verdict.kind is VerdictKind.PASS, f"{checked.text}: {checked.verdict}"
    assert not lines_without_run(properties, [(MODELS / name, {})])


# -------------------------------------------------------------------------------------- strategies


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("Pmaxmin=? [ F s=3 ]", "P=? [ F s=3 ]"),
        ("Pminmax=? [ F s=3 ]", "P=? [ F s=3 ]"),
        ("Pmaxmax=? [ F<=3 s=3 ]", "P=? [ F<=3 s=3 ]"),
        ("Pmaxmin=? [ F G s=3 ]", "P=? [ F G s=3 ]"),
        ('R{"steps"}minmax=? [ F s>2 ]', 'R{"steps"}=? [ F s>2 ]'),
    ],
)
def test_the_chain_of_both_strategies_has_the_value(engine, text, plain):
    model = symcheck.loads(GAME, engine=engine, strategy=True)
    result = model.check(text)
    chain = symcheck.induced_chain(model, result.strategy)
    assert chain.check(plain).value == pytest.approx(result.value, rel=1e-6)


def test_nature_has_a_strategy_in_a_chain():
    model = symcheck.loads(CHAIN, strategy=True)
    result = model.check("Pmax=? [ F s=3 ]")
    assert result.strategy.induced.data[:5].tolist() == pytest.approx([0.6, 0.4, 0.2, 0.2, 0.6])


# ---------------------------------------------------------------------------------------- messages


@pytest.mark.parametrize(
    ("row", "kind", "message"),
    [
        ("[0.7,0.2]:(s'=1) + 0.5:true", ModelFault, "this interval is empty"),
        ("[-0.1,0.2]:(s'=1) + [0.5,1]:true", ModelFault, "lower end of this interval is negative"),
        (
            "[0.1,1.2]:(s'=1) + [0.5,1]:true",
            ModelFault,
            "upper end of this interval is more than 1",
        ),
        (
            "[0.6,0.7]:(s'=1) + [0.5,1]:true",
            ModelFault,
            "lower ends of these intervals sum to more",
        ),
        (
            "[0.1,0.2]:(s'=1) + [0.5,0.7]:true",
            ModelFault,
            "upper ends of these intervals sum to less",
        ),
        ("[0,0.2]:(s'=1) + [0.5,1]:true", UnsupportedError, "an interval with the lower end 0"),
        ("[0.1/(1-s),0.2]:(s'=1) + 0.5:true", ModelFault, "upper ends .* sum to less"),
    ],
)
@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "exact"])
def test_what_cannot_be_is_told_with_a_state(row, kind, message, engine):
    text = f"dtmc module m s:[0..1]; [] s=0 -> {row}; [] s=1 -> true; endmodule"
    with pytest.raises(kind, match=rf"{message}.*for example in state \(s=0\)"):
        _ = loaded(text, engine).engine


def test_a_fault_of_a_state_that_is_not_reached_is_none():
    text = """dtmc module m s:[0..2]; [] s=0 -> [0.1,0.9]:(s'=1) + [0.1,0.9]:true;
    [] s=1 -> true; [] s=2 -> [0,0.1]:true + [0,0.1]:(s'=0); endmodule"""
    assert symcheck.loads(text).check("Pmin=? [ F s=1 ]").value == 1


def test_sums_of_ends_are_compared_exactly():
    text = "dtmc module m s:[0..3]; [] s=0 -> [0.1,0.2]:(s'=1) + [0.2,0.2]:(s'=2) + [0.6,0.6]:(s'=3); [] s>0 -> true; endmodule"
    assert symcheck.loads(text).check("Pmin=? [ F s=1 ]").value == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Pmin=? [ F s=3 ]", "Pmin=. has no unique value in a model with intervals"),
        ("Pmin>=0.1 [ F s=3 ]", "Pmin=. has no unique value in a model with intervals"),
    ],
)
def test_a_decision_process_needs_both_directions(text, message):
    with pytest.raises(InputError, match=message) as caught:
        symcheck.loads(GAME).check(text)
    assert "Pminmin=?, Pminmax=?, Pmaxmin=?, Pmaxmax=?" in str(caught.value)


def test_a_chain_has_one_direction():
    with pytest.raises(InputError, match=r"Pminmax=. has no unique value"):
        symcheck.loads(CHAIN).check("Pminmax=? [ F s=3 ]")


def test_rates_have_no_intervals():
    with pytest.raises(InputError, match="continuous-time Markov chains with intervals"):
        symcheck.loads("ctmc module m s:[0..1]; [] s=0 -> [1,2]:(s'=1); endmodule").checked()


@pytest.mark.parametrize(
    "ask",
    [
        lambda m: m.check("Rmaxmin=? [ C ]"),
        lambda m: m.check("Smaxmin=? [ s=3 ]"),
        lambda m: m.check("Pmaxmin=? [ F s=3 || F s=2 ]"),
        lambda m: m.check("multi(Pmax=? [ F s=3 ], P>=0.1 [ F s=4 ])"),
        lambda m: m.check("Pmaxmin=? [ F s=3 ]").counterexample(),
        lambda m: m.check("Pmaxmin=? [ F s=3 ]").certificate(),
        lambda m: m.simulate(),
        lambda m: list(m.transitions),
        lambda m: m.matrix,
    ],
)
def test_what_needs_numbers_is_refused_by_name(ask):
    with pytest.raises(UnsupportedError, match="with intervals of probabilities"):
        ask(symcheck.loads(GAME))


@pytest.mark.parametrize("structure", [1, 2])
@pytest.mark.parametrize("path", ["C<=3", "I=3", "F s>2"])
def test_negative_rewards_are_for_rationals(path, structure):
    text = GAME.replace("s<3 : 1", "s<3 : 0-1") + 'rewards "n" s=0 : 2; s=1 : -1; endrewards'
    with pytest.raises(UnsupportedError, match="negative rewards with intervals") as caught:
        symcheck.loads(text).check(f"R{{{structure}}}maxmin=? [ {path} ]")
    assert "use -exact" in str(caught.value)
    assert loaded(text, "exact").check("Rmaxmin=? [ C<=1 ]").value == -1


@pytest.mark.parametrize("text", [CHAIN, GAME])
def test_long_run_averages_are_refused_by_name(text):
    direction = "min" if text is CHAIN else "minmin"
    with pytest.raises(UnsupportedError, match=r"long-run averages are not .* with intervals"):
        symcheck.loads(text).check(f"S{direction}=? [ s=3 ]")


def test_a_value_that_rounding_hides_is_not_decided_wrongly():
    text = "dtmc module m s:[0..2]; [] s=0 -> [1e-300,1e-299]:(s'=1) + [0.5,1]:(s'=2); [] s>0 -> true; endmodule"
    model = symcheck.loads(text)
    assert model.check("P<=1e-299 [ F s=1 ]").value is True
    assert model.check("P<1e-299 [ F s=1 ]").value is False


def test_bounds_of_states_that_are_hardly_left_are_finite():
    text = """dtmc module m s:[0..2]; [] s=0 -> [1-1e-9,1]:true + [1e-12,1e-9]:(s'=2) +
    [1e-14,1e-10]:(s'=1); [] s>0 -> true; endmodule"""
    lower, upper = symcheck.loads(text).check("Tmax=? [ F s>0 ]").bounds
    assert lower <= 1e14 / 101 <= upper < 1.1e12


# ------------------------------------------------------------------------------- files and matrices

LOW = [[0, 0.2, 0.3], [0.1, 0, 0.4], [0, 0, 1]]
HIGH = [[0, 0.7, 0.8], [0.6, 0, 0.9], [0, 0, 1]]


def test_matrices_of_both_ends():
    model = symcheck.from_matrix(LOW, upper=HIGH, labels={"end": [2]}, rewards={"r": [1, 1, 0]})
    value = Q(17, 10) / (1 - Q(7, 10) * Q(6, 10))
    assert encloses(model.check('R{"r"}max=? [ F "end" ]'), value)
    assert model.with_options(exact=True).check('R{"r"}max=? [ F "end" ]').value == value
    assert model.check(f'R{{"r"}}<={value.numerator}/{value.denominator} [ F "end" ]').value is True


@pytest.mark.parametrize(
    ("low", "high", "kind", "message"),
    [
        (HIGH, LOW, ModelFault, "the intervals of row 0, of state 0, hold no distribution"),
        (
            [[0, 1], [0, 1]],
            [[1, 1], [0, 1]],
            UnsupportedError,
            "(?s)end 0.*hint: nature could remove",
        ),
        ([[0.5, 0.5], [0, 1]], [[0.5, 0.5]], symcheck.errors.UsageError, "same shape"),
    ],
)
def test_matrices_that_cannot_be(low, high, kind, message):
    with pytest.raises(kind, match=message):
        _ = symcheck.from_matrix(low, upper=high).engine


def test_files_keep_intervals(tmp_path):
    model = symcheck.loads(GAME)
    for kind, s in (("drn", "x"), ("all", "s"), ("tra", "x"), ("pexp", "s")):
        symcheck.export(model, f"{tmp_path}/game.{kind}")
        again = symcheck.load_explicit(f"{tmp_path}/game.{kind}")
        for asked in ("Pminmax=? [ F {}=3 ]", "Pmaxmin=? [ F {}=3 ]", "Tmaxmin=? [ F {}>2 ]"):
            before = model.check(asked.format("s")).value
            assert again.check(asked.format(s)).value == pytest.approx(before, rel=1e-6)
        if kind in ("all", "pexp"):
            steps = 'R{"steps"}maxmax=? [ F s>2 ]'
            assert again.check(steps).value == pytest.approx(model.check(steps).value, rel=1e-6)
    lines = (tmp_path / "game.tra").read_text().splitlines()
    assert lines[:3] == ["5 6 10", "0 0 1 [0.2,0.6] a", "0 0 2 [0.3,0.8] a"]
    with pytest.raises(UnsupportedError, match="cannot hold intervals"):
        symcheck.export(model, f"{tmp_path}/game.umb")


def test_a_variable_that_only_an_upper_end_reads_is_kept():
    text = """dtmc
    module m s:[0..3]; b:[0..1];
      [] s=0 -> 0.5:(b'=1)&(s'=1) + 0.5:(b'=0)&(s'=1);
      [] s=1 -> [0.1,0.5+b/4]:(s'=2) + [0.1,0.9]:(s'=3);
      [] s>1 -> true;
    endmodule"""
    values = [
        symcheck.loads(text, reduce=reduce).check("Pmax=? [ F s=2 ]").value
        for reduce in (False, True)
    ]
    assert values == pytest.approx([0.625, 0.625])


def test_a_text_with_intervals_is_printed_as_it_is_read():
    printed = symcheck.pretty(symcheck.parse_model(GAME))
    assert "[0.2,0.6] : (s'=1) + [0.3,0.8] : (s'=2)" in printed
    assert symcheck.parse_model(printed) == symcheck.parse_model(GAME)
