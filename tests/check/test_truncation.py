"""Probabilities with a bound on time or steps, of models with infinitely many states."""

import re
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from math import comb, exp, factorial

import pytest

import symcheck
from symcheck.check import truncation
from symcheck.check import tuning as tuning_of_checks
from symcheck.check.context import Context
from symcheck.check.result import Certified, Exact
from symcheck.errors import (
    Interrupted,
    MemoryLimitError,
    ModelFault,
    NumericalError,
    UnsupportedError,
)
from symcheck.explicit import tuning
from symcheck.explicit.region import Region
from symcheck.explicit.states import Rows
from symcheck.numerics import tuning as tuning_of_numerics
from symcheck.numerics.transient import methods
from symcheck.numerics.transient.forward import ForwardValue

QUEUE = """
    ctmc
    module queue
        jobs : int init 0;
        [] true -> 3 : (jobs'=jobs+1);
        [] jobs>0 -> 4 : (jobs'=jobs-1);
    endmodule
"""
ARRIVALS = "ctmc module m n : int init 0; [] true -> 2 : (n'=n+1); endmodule"
SERVERS = """
    ctmc
    module m
        n : int init 0;
        [] true -> 3 : (n'=n+1);
        [] n>0 -> n : (n'=n-1);
    endmodule
"""
WALK = """
    dtmc
    module m
        x : int init 0;
        [] true -> 0.25 : (x'=x+1) + 0.75 : (x'=x-1);
    endmodule
"""
GAMBLER = """
    mdp
    module m
        money : int init 3;
        [safe] money>0 -> 0.5 : (money'=money+1) + 0.5 : (money'=money-1);
        [bold] money>1 -> 0.375 : (money'=money+2) + 0.625 : (money'=money-2);
    endmodule
"""


def truncated(model: str, formula: str, **options: object) -> symcheck.Result:
    return symcheck.loads(model, truncate=True, **options).check(formula)


def encloses(result: symcheck.Result, value: float, epsilon: float = 1e-6) -> bool:
    bounds = result.accuracy
    assert isinstance(bounds, Certified)
    slack = 1e-12 * value  # of the oracle
    is_narrow = bounds.upper - bounds.lower <= epsilon * bounds.upper
    return bounds.lower - slack <= value <= bounds.upper + slack and is_narrow


def poisson(mean: float, count: int) -> float:
    return exp(-mean) * mean**count / factorial(count)


@pytest.mark.parametrize("count", [0, 1, 7, 40])
def test_arrivals_are_poisson_distributed(count: int) -> None:
    result = truncated(ARRIVALS, f"P=? [ F[5,5] n={count} ]")
    assert encloses(result, poisson(10.0, count))


@pytest.mark.parametrize("time", [0.01, 1.0, 30.0])
def test_customers_of_infinitely_many_servers_are_poisson_distributed(time: float) -> None:
    result = truncated(SERVERS, f"P=? [ F[{time},{time}] n=2 ]")
    assert encloses(result, poisson(3 * (1 - exp(-time)), 2))


def test_a_queue_has_the_values_of_one_with_much_room() -> None:
    room = QUEUE.replace("jobs : int", "jobs : [0..400]").replace("true -> 3", "jobs<400 -> 3")
    for formula in (
        "P=? [ F<=50 jobs>=25 ]",
        "P=? [ G[2,3] jobs!=1 ]",
        "P=? [ jobs<6 U<=9 jobs=6 ]",
    ):
        expected = symcheck.loads(room, epsilon=1e-10).check(formula).value
        assert encloses(truncated(QUEUE, formula), expected), formula


@pytest.mark.parametrize("steps", [0, 1, 10, 60])
def test_a_walk_on_the_integers_is_binomially_distributed(steps: int) -> None:
    result = truncated(WALK, f"P=? [ F[{steps},{steps}] x=0 ]")
    up = steps // 2
    expected = comb(steps, up) * 0.25**up * 0.75 ** (steps - up) if steps % 2 == 0 else 0.0
    assert result.value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("direction", "best"), [("max", max), ("min", min)])
def test_strategies_know_the_steps_that_are_left(
    direction: str, best: Callable[[list[Fraction]], Fraction]
) -> None:
    steps = 12

    @cache
    def value(money: int, left: int) -> Fraction:
        if money >= 8:
            return Fraction(1)
        if left == 0 or money == 0:
            return Fraction(0)
        half = Fraction(1, 2)
        choices = [half * value(money + 1, left - 1) + half * value(money - 1, left - 1)]
        if money > 1:
            bold = Fraction(3, 8) * value(money + 2, left - 1)
            choices.append(bold + Fraction(5, 8) * value(money - 2, left - 1))
        return best(choices)

    result = truncated(GAMBLER, f"P{direction}=? [ F<={steps} money>=8 ]")
    assert result.value == pytest.approx(float(value(3, steps)), rel=1e-6)


def test_small_probabilities_have_relative_accuracy() -> None:
    result = truncated(ARRIVALS, "P=? [ F[5,5] n=90 ]")
    assert encloses(result, poisson(10.0, 90))
    assert result.value < 1e-50


def test_nobody_looks_for_fewer_states_than_those_of_the_region(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def abandoned(*_: object) -> ForwardValue:
        tried.append(True)
        return ForwardValue()

    monkeypatch.setattr(tuning_of_numerics, "FORWARD_ENTRIES", 0.0)
    monkeypatch.setattr(methods, "forward_value", abandoned)
    truncated(QUEUE, "P=? [ F<=50 jobs>=25 ]")
    assert not tried
    room = QUEUE.replace("jobs : int", "jobs : [0..400]").replace("true -> 3", "jobs<400 -> 3")
    symcheck.loads(room).check("P=? [ F<=50 jobs>=25 ]")
    assert tried


def test_only_states_that_paths_reach_in_time_are_explored() -> None:
    result = truncated(QUEUE, "P=? [ F<=1 jobs>=5 ]")
    assert result.engine is not None
    assert result.engine.states == 6  # nothing matters beyond the target


def test_thresholds_are_decided_by_bounds() -> None:
    value = truncated(QUEUE, "P=? [ F<=50 jobs>=25 ]").value
    assert truncated(QUEUE, f"P>{0.999 * value} [ F<=50 jobs>=25 ]").value is True
    assert truncated(QUEUE, f"P>={1.001 * value} [ F<=50 jobs>=25 ]").value is False


def test_a_threshold_too_close_to_the_value_is_not_decided() -> None:
    with pytest.raises(NumericalError, match="cannot decide whether"):
        truncated(ARRIVALS, f"P>{poisson(10.0, 7)!r} [ F[5,5] n=7 ]")


def test_what_is_not_solved_ends_with_wide_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A larger region would not make them closer."""
    solved = []

    def roughly(context: Context, *_: object) -> object:
        solved.append(context.engine.states)
        return context.engine.constant(0.25, 0.75)

    monkeypatch.setattr(truncation, "probability", roughly)
    result = truncated(QUEUE, "P=? [ F[2,2] jobs=1 ]")
    assert result.bounds == (0.25, 0.75)
    assert len(solved) == 2
    assert result.warnings


def test_the_next_step_needs_a_few_states_only() -> None:
    result = truncated(QUEUE, "P=? [ X jobs=1 ]")
    assert (result.value, result.accuracy) == (1.0, Exact())


def test_a_fault_counts_where_paths_get_in_time() -> None:
    faulty = QUEUE.replace("3 :", "(jobs=LIMIT ? -1 : 3) :")
    near = faulty.replace("LIMIT", "3")
    with pytest.raises(ModelFault, match="rate"):
        truncated(near, "P=? [ F<=1 jobs>=5 ]")
    far = faulty.replace("LIMIT", "1000000")
    assert encloses(
        truncated(far, "P=? [ F[1,1] jobs=0 ]"), truncated(QUEUE, "P=? [ F[1,1] jobs=0 ]").value
    )


def test_growing_variables_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    endless = symcheck.loads(QUEUE)
    assert endless.is_truncated
    assert endless.growth is not None
    assert "jobs" in endless.growth.note
    formula = "P=? [ F<=50 jobs>=25 ]"
    assert encloses(endless.check(formula), truncated(QUEUE, formula, epsilon=1e-10).value)
    small = QUEUE.replace("true -> 3", "jobs<900 -> 3")
    assert not symcheck.loads(small).is_truncated
    assert not symcheck.loads(QUEUE, exact=True).is_truncated


def test_every_state_is_explored_on_demand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    model = symcheck.loads(QUEUE, truncate=False, max_memory=10_000_000)
    with pytest.raises(MemoryLimitError, match="memory limit"):
        model.check("P=? [ F[50,50] jobs=25 ]")


def climb(target: int, up: Fraction, down: Fraction) -> Fraction:
    """The expected time in which a queue grows from 0 to a number of jobs."""
    step = total = 1 / up
    for _ in range(1, target):
        step = 1 / up + down / up * step
        total += step
    return total


@pytest.mark.parametrize("target", [1, 2, 9, 40])
def test_times_until_a_target_need_the_states_before_it(target: int) -> None:
    result = truncated(QUEUE, f"T=? [ F jobs={target} ]")
    low, high = result.bounds
    assert low <= climb(target, Fraction(3), Fraction(4)) <= high
    assert result.engine is not None
    assert result.engine.states == target + 1
    assert f"{target + 1} states, which are all that matter" in result.explanation
    assert truncated(QUEUE, f"P>=1 [ F jobs={target} ]").value is True


@pytest.mark.parametrize("safe", [2, 10])
def test_ruin_is_decided_before_what_follows_it(safe: int) -> None:
    walk = WALK.replace("init 0", "init 1")
    formula = f"x=0 | x={safe}"
    ruin = 1 - (1 - Fraction(3)) / (1 - Fraction(3) ** safe)
    low, high = truncated(walk, f"P=? [ x<{safe} U x=0 ]").bounds
    assert low <= ruin <= high
    steps = 2 * (1 - safe * (1 - ruin))
    low, high = truncated(
        walk.replace("endmodule", "endmodule rewards true : 1; endrewards"), f"R=? [ F {formula} ]"
    ).bounds
    assert low <= steps <= high


def test_bold_play_is_optimal_up_to_a_target() -> None:
    """Until 5, with choices: against all memoryless strategies."""
    result = truncated(GAMBLER, "Pmax=? [ money<5 U money>=5 ]")
    whole = symcheck.loads(
        GAMBLER.replace("int init", "[0..9] init")
        .replace(">0 ->", ">0&money<9 ->")
        .replace(">1 ->", ">1&money<8 ->")
    )
    assert result.value == pytest.approx(whole.check("Pmax=? [ money<5 U money>=5 ]").value)
    assert result.engine is not None
    assert result.engine.states == 7


def test_a_search_up_to_a_target_begins_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    model = symcheck.loads(QUEUE)
    assert model.check("P=? [ F jobs=7 ]").value == 1
    assert not model.is_built
    with pytest.raises(MemoryLimitError):
        symcheck.loads(QUEUE, everywhere=True, max_memory=10_000_000).check("P=? [ F jobs=7 ]")


BUSY = QUEUE.replace("init 0", "init 3")
TWO = """
    ctmc
    module first
        a : int init 2;
        [] true -> 3 : (a'=a+1);
        [] a>0 -> 4 : (a'=a-1);
    endmodule
    module second = first [a=b] endmodule
"""


@pytest.mark.parametrize(
    ("model", "formula", "value"),
    [
        (BUSY, "P=? [ F jobs=0 ]", 1),
        (BUSY, "P=? [ F>=2 jobs=0 ]", 1),
        (BUSY, "P=? [ G jobs>0 ]", 0),
        (BUSY, "P=? [ jobs>0 W jobs>9 ]", (1 - Fraction(4, 3) ** 3) / (1 - Fraction(4, 3) ** 10)),
        (TWO, "P=? [ b>0 U a=0 ]", Fraction(1, 2)),
        (TWO, "P=? [ F a=0 & b=0 ]", 1),
    ],
)
def test_without_a_bound_on_time_bounds_meet_where_paths_come_back(
    monkeypatch: pytest.MonkeyPatch, model: str, formula: str, value: Fraction
) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    result = truncated(model, formula)
    low, high = result.bounds
    assert low <= value <= high
    assert high - low <= 1e-6


def test_bounds_stay_apart_where_paths_do_not_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    monkeypatch.setattr(tuning_of_checks, "APPROACHING_ROUNDS", 2)
    growing = BUSY.replace("-> 3", "-> 4.5").replace("-> 4 ", "-> 3.5 ")
    result = truncated(growing, "P=? [ F jobs=0 ]")
    low, high = result.bounds
    assert low <= Fraction(7, 9) ** 3 <= high
    assert low == pytest.approx((7 / 9) ** 3)
    assert any("apart" in warning for warning in result.warnings)
    assert truncated(growing, "P>=0.4 [ F jobs=0 ]").value is True
    with pytest.raises(NumericalError, match=r"cannot decide .* lies between 0\.47"):
        truncated(growing, "P>=0.6 [ F jobs=0 ]")


def test_a_tiny_lower_bound_is_something(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first 19 steps go down, each with probability 1e-16."""
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    walk = "dtmc module m x : int init 19; [] x>0 -> 1e-16 : (x'=x-1) + 0.9999999999999999 : (x'=x+1); endmodule"
    low, high = truncated(walk, "P=? [ F x=0 ]").bounds
    assert 0.9e-304 < low <= Fraction(1, 10**304) * (1 + Fraction(1, 10**9))
    assert high == 1
    assert truncated(walk, "P>1e-305 [ F x=0 ]").value is True


def test_an_interrupt_tells_the_bounds_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fair game: each growth of the region helps, and never enough."""
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    grow = Region.grow

    def grows(region: Region, rows: Rows) -> None:
        if len(region) > 4_000:
            raise KeyboardInterrupt
        grow(region, rows)

    monkeypatch.setattr(Region, "grow", grows)
    with pytest.raises(Interrupted) as raised:
        truncated(BUSY.replace("-> 4 ", "-> 3 "), "P=? [ F jobs=0 ]")
    assert re.fullmatch(r"the value is between 0\.999\d+ and 1\.0", str(raised.value.note))


def test_nothing_is_known_where_no_path_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "GROWING_STATES", 2_000)
    monkeypatch.setattr(tuning_of_checks, "UNKNOWN_STATES", 5_000)
    with pytest.raises(NumericalError, match=r"nothing is known after [\d,]+ states"):
        truncated(ARRIVALS, "P=? [ F n<0 ]")


@pytest.mark.parametrize("formula", ["jobs=2", "P>0.9 [ F jobs=2 ]", "P<0.1 [ F<=1 jobs=2 ]"])
def test_states_that_satisfy_a_formula_are_sought_everywhere(formula: str) -> None:
    room = QUEUE.replace("jobs : int", "jobs : [0..9]").replace("true ->", "jobs<9 ->")
    truncated = symcheck.loads(room, truncate=True).where(formula)
    assert [*map(str, truncated)] == [*map(str, symcheck.loads(room).where(formula))]


@pytest.mark.parametrize("formula", ["S=? [ jobs=0 ]", "T=? [ F jobs<0 ]"])
def test_other_properties_need_every_state(formula: str) -> None:
    model = symcheck.loads(QUEUE, truncate=True, max_memory=10_000_000)
    with pytest.raises(MemoryLimitError, match="memory limit") as raised:
        model.check(formula)
    assert "has no bounds" in str(raised.value.note)


REWARDED = {
    "arrivals": ARRIVALS.replace("[]", "[arrive]")
    + " rewards true : n; endrewards rewards [arrive] true : 1; endrewards "
    "rewards true : n*n - 7*n; endrewards",
    "servers": SERVERS + "rewards true : n; endrewards",
    "births": "ctmc module m n : int init 1; [] n>0 -> 0.5*n : (n'=n+1); endmodule "
    "rewards true : n; endrewards",
    "walk": WALK + "rewards true : x; endrewards rewards true : x*x; endrewards",
    "powers": WALK + "rewards true : pow(2.0, x); endrewards",
    "explosion": "ctmc module m n : int init 1; [] true -> n*n : (n'=n+1); endmodule "
    "rewards true : n>0 ? -2 : 5; endrewards",
    "slow": "ctmc module m n : int init 0; [] true -> 1e-6 : (n'=n+1); endmodule "
    "rewards true : 1e-290*n; endrewards",
    "unused": "ctmc module m x : int init 0; y : int init 0; [] true -> 1 : (x'=x+1); "
    "[] true -> 0 : (x'=x+y); [] true -> 1 : (y'=y+1); endmodule rewards true : x*x; endrewards",
    "gene": "ctmc module m a : int init 0; b : int init 0; [] true -> 2 : (a'=a+1); "
    "[make] a>0 -> 5*a : (b'=b+1); endmodule rewards true : b; endrewards "
    "rewards true : a*b; endrewards rewards [make] true : 1; endrewards",
}


@pytest.mark.parametrize(
    ("model", "query", "value"),
    [
        ("arrivals", "R=? [ I=5 ]", 10.0),
        ("arrivals", "R=? [ I=0 ]", 0.0),
        ("arrivals", "R=? [ C<=5 ]", 25.0),
        ("arrivals", "R{2}=? [ C<=5 ]", 10.0),
        ("arrivals", "R{3}=? [ I=5 ]", 40.0),
        ("arrivals", "R{3}=? [ I=1 ]", -8.0),
        ("servers", "R=? [ I=2 ]", 3 * (1 - exp(-2))),
        ("servers", "R=? [ C<=30 ]", 3 * (29 + exp(-30))),
        ("births", "R=? [ I=4 ]", exp(2)),
        ("births", "R=? [ C<=2 ]", 2 * (exp(1) - 1)),
        ("walk", "R=? [ I=10 ]", -5.0),
        ("walk", "R=? [ C<=10 ]", -22.5),
        ("walk", "R{2}=? [ I=60 ]", 945.0),
        ("powers", "R=? [ I=9 ]", 0.875**9),
        ("powers", "R=? [ C<=3 ]", 1 + 0.875 + 0.875**2),
        ("slow", "R=? [ I=1e7 ]", 1e-289),
        ("unused", "R=? [ I=2 ]", 2.0 + 2.0**2),
        ("gene", "R=? [ I=2 ]", 5 * 2**2),
        ("gene", "R{3}=? [ C<=2 ]", 5 * 2**2),
    ],
)
def test_rewards_within_a_bound_have_closed_forms(model: str, query: str, value: float) -> None:
    low, high = truncated(REWARDED[model], query).bounds
    slack = 1e-13 * abs(value)
    assert low - slack <= value <= high + slack
    assert high - low <= 1e-6 * abs(value)


@pytest.mark.parametrize(("direction", "best"), [("max", max), ("min", min)])
@pytest.mark.parametrize("cumulative", [True, False])
def test_rewards_of_strategies_within_steps(
    direction: str, best: Callable[[list[Fraction]], Fraction], cumulative: bool
) -> None:
    """`safe` is a fair game that pays its stake, and `bold` a lossy one that pays more."""

    @cache
    def value(money: int, left: int) -> Fraction:
        here = Fraction(money * money - 9 * money)
        if left == 0:
            return Fraction(0) if cumulative else here
        if money <= 0:
            later = [value(money, left - 1)]
        else:
            half = Fraction(1, 2)
            later = [cumulative + half * (value(money + 1, left - 1) + value(money - 1, left - 1))]
            if money > 1:
                up, down = value(money + 2, left - 1), value(money - 2, left - 1)
                later.append(3 * cumulative + Fraction(3, 8) * up + Fraction(5, 8) * down)
        return best(later) + (here if cumulative else 0)

    rewards = "rewards true : money*money - 9*money; [safe] true : 1; [bold] true : 3; endrewards"
    query = "C<=9" if cumulative else "I=9"
    low, high = truncated(GAMBLER + rewards, f"R{direction}=? [ {query} ]").bounds
    expected = value(3, 9)
    assert low <= expected <= high
    assert high - low <= 1e-6 * abs(expected)


def test_rewards_are_refused_where_nothing_bounds_them() -> None:
    fast = "ctmc module m n : int init 1; [] true -> n*n : (n'=n+1); endmodule "
    with pytest.raises(UnsupportedError, match="no bound is found on what is earned outside"):
        truncated(fast + "rewards true : n; endrewards", "R=? [ I=1 ]")
    for reward in ("pow(2, n)", "n>10000 ? 1e308*1e308*n : n"):
        with pytest.raises(UnsupportedError, match="no bound is found"):
            truncated(ARRIVALS + f" rewards true : {reward}; endrewards", "R=? [ C<=1 ]")


@pytest.mark.parametrize(
    ("model", "query", "value"),
    [
        ("arrivals", "R=? [ I=5 ]", 10.0),
        ("arrivals", "R{2}=? [ C<=5 ]", 10.0),
        ("births", "R=? [ I=2 ]", exp(1)),
        ("gene", "R=? [ I=2 ]", 20.0),
        ("explosion", "R=? [ C<=0.1 ]", -0.2),
    ],
)
def test_what_is_earned_outside_of_a_small_region_counts(
    monkeypatch: pytest.MonkeyPatch, model: str, query: str, value: float
) -> None:
    monkeypatch.setattr(tuning, "FIRST_REGION_STATES", 3)
    low, high = truncated(REWARDED[model], query, epsilon=0.05).bounds
    assert low < value < high
    assert high - low > 1e-9
