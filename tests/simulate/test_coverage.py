"""How often intervals miss the true value: over 200 seeds of each kind, not more often than they say.

The values are sums and powers written out here. A miss counts one seed, so that a kind with error 0.01 may have 2
of 200; 10 or more have a probability below 1e-4.
"""

from __future__ import annotations

from math import exp, inf

import pytest

import symcheck
from symcheck.api.model import Model
from symcheck.check.result import Exact, Statistical
from symcheck.errors import NumericalError, SymcheckError, UsageError

SEEDS = 200
MOST_MISSES = 9


def branch(p: float | str, reward: str, kind: str = "dtmc") -> Model:
    """One step with probability p to s=1, otherwise to s=2; both end in s=3."""
    text = f"""{kind} module m s:[0..3];
        [] s=0 -> {p}:(s'=1) + 1-{p}:(s'=2);
        [] s=1 | s=2 -> (s'=3); [] s=3 -> true; endmodule
        rewards {reward} endrewards"""
    return symcheck.loads(text)


def misses(model: Model, formula: str, value: float, **plan: object) -> int:
    """In how many of the seeds the interval does not contain the value."""
    count = 0
    for seed in range(SEEDS):
        result = model.estimate(formula, seed=seed, **plan)  # type: ignore[arg-type]
        low, high = result.bounds
        if isinstance(result.accuracy, Statistical):
            assert not result.accuracy.approximate
        count += not low <= value <= high
    return count


RARE = branch("0.01", "s=1 : 100;")
EACH = "s=1 : 100; s=2 : 1;"
COSTS = branch("0.01", "s=1 : -100;")
JUMPS = """ctmc module m s:[0..3]; [a] s=0 -> 0.01:(s'=1) + 0.99:(s'=2); [] s=1 | s=2 -> 2:(s'=3);
    [] s=3 -> true; endmodule rewards [a] true : 1; [] s=1 : 100; endrewards"""
OCCUPIED = "ctmc module m s:[0..1]; [] s=0 -> 0.01:(s'=1); [] s=1 -> true; endmodule rewards s=1 : 7; endrewards"
BINOMIAL = """dtmc module m n:[0..10]; s:[0..10]; [] s<10 -> 0.01:(n'=min(10,n+1))&(s'=s+1) + 0.99:(s'=s+1);
    [] s=10 -> true; endmodule rewards s=10 : n; endrewards"""


@pytest.mark.parametrize(
    ("model", "formula", "value", "plan"),
    [
        (RARE, "R=? [ F s=3 ]", 1.0, {"samples": 200}),
        (RARE, "R=? [ C<=3 ]", 1.0, {"samples": 200}),
        (RARE, "R=? [ I=1 ]", 1.0, {"samples": 200}),
        (RARE, "R=? [ F s=3 ]", 1.0, {"samples": 200, "error": 0.05}),
        (RARE, "R=? [ F s=3 ]", 1.0, {"samples": 200, "most": 100.0, "method": "apmc"}),
        (RARE, "R=? [ F s=3 ]", 1.0, {"width": 5.0, "pilot": 100}),
        (branch("0.01", EACH), "R=? [ F s=3 ]", 1.99, {"samples": 200}),
        (branch("0.99", EACH), "R=? [ F s=3 ]", 99.01, {"samples": 100}),
        (COSTS, "R=? [ F s=3 ]", -1.0, {"samples": 200}),
        (symcheck.loads(JUMPS), "R=? [ F s=3 ]", 2.0, {"samples": 200}),
        (symcheck.loads(JUMPS), "R=? [ C<=99 ]", 2.0, {"samples": 200}),
        (symcheck.loads(OCCUPIED), "R=? [ I=1 ]", 7 * -(exp(-0.01) - 1), {"samples": 200}),
        (symcheck.loads(OCCUPIED), "R=? [ C<=2 ]", 7 * (2 - (1 - exp(-0.02)) / 0.01), {"samples": 200}),
        (symcheck.loads(BINOMIAL), "R=? [ I=10 ]", 0.1, {"samples": 100}),
        (RARE, "P=? [ F s=1 ]", 0.01, {"samples": 200}),
        (RARE, "P=? [ G s!=1 ]", 0.99, {"samples": 200}),
        (RARE, "P=? [ F s=1 ]", 0.01, {"samples": 200, "method": "apmc"}),
        (RARE, "P=? [ F s=1 ]", 0.01, {"width": 0.02, "pilot": 100}),
        (branch("1e-9", ""), "P=? [ F s=1 ]", 1e-9, {"samples": 20}),
        (branch("0.5", ""), "P=? [ F s=1 ]", 0.5, {"samples": 200, "error": 0.01}),
    ],
)  # fmt: skip
def test_intervals_miss_as_rarely_as_they_say(
    model: Model, formula: str, value: float, plan: dict[str, object]
) -> None:
    limit = 23 if plan.get("error") == 0.05 else MOST_MISSES  # 10 expected at most
    assert misses(model, formula, value, **plan) <= limit


@pytest.mark.parametrize("width", [0.05, 0.2])
def test_the_interval_of_a_sequential_test_holds_within_its_indifference_region(
    width: float,
) -> None:
    """The verdict may be either one there, and the value is on neither side of it by the width."""
    model = branch("0.5", "")
    wrong = 0
    for seed in range(SEEDS):
        accuracy = model.estimate(
            "P>=0.5 [ F s=1 ]", method="sprt", width=width, seed=seed
        ).accuracy
        assert isinstance(accuracy, Statistical)
        wrong += not accuracy.lower <= 0.5 <= accuracy.upper
    assert wrong == 0


@pytest.mark.parametrize("method", ["ci", "aci", "apmc", "sprt"])
@pytest.mark.parametrize(("p", "threshold"), [("0.01", "0.04"), ("0.4", "0.5"), ("0.99", "0.96")])
def test_verdicts_are_wrong_as_rarely_as_they_say(method: str, p: str, threshold: str) -> None:
    model, wrong = branch(p, ""), 0
    plan = {"width": 0.02} if method == "sprt" else {"samples": 400}
    for seed in range(SEEDS):
        try:
            result = model.estimate(f"P>={threshold} [ F s=1 ]", method=method, seed=seed, **plan)  # type: ignore[arg-type]
        except NumericalError:  # the threshold is not decided
            continue
        wrong += result.value is not (float(p) >= float(threshold))
    assert wrong <= MOST_MISSES


def test_approximations_say_so() -> None:
    unbounded = symcheck.loads(
        "dtmc module m s:[0..1]; [] s=0 -> 0.1:(s'=1) + 0.9:true; [] s=1 -> true; endmodule rewards s=0:1; endrewards"
    )
    result = unbounded.estimate("R=? [ F s=1 ]", samples=200, seed=1)
    assert isinstance(result.accuracy, Statistical)
    assert result.accuracy.approximate
    assert str(result.accuracy).endswith(
        "with probability about 0.99, 200 samples, by Student's t, an approximation"
    )
    normal = RARE.estimate("P=? [ F s=1 ]", method="aci", samples=2000, seed=1).accuracy
    assert str(normal).endswith("2000 samples, by the normal distribution, an approximation")
    proved = RARE.estimate("P=? [ F s=1 ]", samples=2000, seed=1).accuracy
    assert str(proved).endswith("with probability 0.99, 2000 samples, by Clopper and Pearson")
    assert str(RARE.estimate("R=? [ C<=3 ]", seed=1).accuracy).endswith(
        "by Hoeffding and Bernstein"
    )


@pytest.mark.parametrize("method", ["ci", "aci"])
def test_equal_samples_are_no_interval_without_width(method: str) -> None:
    for formula in ("P=? [ F s=1 ]", "P=? [ G s!=1 ]", "R=? [ F s=3 ]", "R=? [ C<=9 ]"):
        result = RARE.estimate(formula, method=method, samples=5, seed=3)  # type: ignore[arg-type]
        low, high = result.bounds
        assert high - low > 0.5
        if formula[0] == "R":
            assert (
                "all 5 samples are 0: at most 0.6 of the paths earn another reward"
                in result.warnings[0]
            )
            assert "each between 0 and 100" in result.warnings[0]


def test_equal_samples_of_a_reward_without_a_bound_have_no_upper_end() -> None:
    rare = "s=0 -> 0.001:(s'=1) + 0.999:(s'=2); [] s=1 -> 0.5:true + 0.5:(s'=2); [] s=2 -> true;"
    model = symcheck.loads(
        f"dtmc module m s:[0..2]; [] {rare} endmodule rewards s=1 : 1000; endrewards"
    )
    result = model.estimate("R=? [ F s=2 ]", samples=50, seed=1)
    assert result.value == 0.0
    assert result.bounds == (0.0, inf)
    assert "no bound on it is known" in result.warnings[0]
    assert model.estimate("R=? [ F s=2 ]", samples=50, seed=1, most=1e5).bounds[1] < 2e4


def test_a_reward_that_every_path_earns_is_known() -> None:
    model = branch("0.3", "s=0 : 0.1; s=1 | s=2 : 0.2;")
    result = model.estimate("R=? [ F s=3 ]", samples=50, seed=1)
    assert not result.warnings
    assert result.bounds == pytest.approx((0.3, 0.3), abs=1e-9)
    assert result.bounds[0] <= 0.3 <= result.bounds[1]


def test_a_target_that_is_missed_rarely_makes_the_reward_infinite() -> None:
    text = (
        "dtmc module m s:[0..2]; [] s=0 -> 1e-9:(s'=1) + 1-1e-9:(s'=2); [] s>0 -> true; endmodule"
    )
    model = symcheck.loads(text + " rewards s=0 : 1; endrewards")
    result = model.estimate("R=? [ F s=2 ]", samples=50, seed=1)
    assert (result.value, result.accuracy) == (inf, Exact())
    assert model.estimate("R<=5 [ F s=2 ]", samples=50, seed=1).value is False


def test_a_model_that_is_too_large_to_explore_has_the_range_of_its_variables() -> None:
    text = """dtmc module m x:[0..1000]; [] x<1000 -> 0.5:(x'=x+1) + 0.5:(x'=max(0,x-1)); [] x=1000 -> true; endmodule
        module n y:[0..1000]; [] true -> (y'=mod(y+1,1001)); endmodule
        rewards x>3 : 2; y<0 : 7; endrewards"""
    model = symcheck.loads(text)
    result = model.estimate("R=? [ C<=10 ]", samples=400, seed=1)
    assert isinstance(result.accuracy, Statistical)
    assert not result.accuracy.approximate
    assert 0 <= result.bounds[0] <= model.check("R=? [ C<=10 ]").value <= result.bounds[1] <= 20
    assert model.estimate("R=? [ F y=3 ]", samples=50, seed=1).accuracy.approximate  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("P>=0 [ F s=1 ]", True),
        ("P<=1 [ F s=1 ]", True),
        ("P>1 [ F s=1 ]", False),
        ("P<0 [ F s=1 ]", False),
    ],
)
def test_thresholds_that_every_interval_decides(formula: str, value: bool) -> None:
    assert RARE.estimate(formula, samples=20, seed=1).value is value


@pytest.mark.parametrize(
    "formula", ["P>=1 [ F s=3 ]", "P<1 [ F s=3 ]", "P>0 [ F s=1 ]", "R>0 [ F s=3 ]"]
)
def test_equal_samples_do_not_decide_a_threshold_at_their_value(formula: str) -> None:
    with pytest.raises(NumericalError, match="not decided"):
        RARE.estimate(formula, samples=20, seed=3)


def test_the_largest_reward_that_is_given_is_checked() -> None:
    with pytest.raises(NumericalError, match=r"outside of \[0, 50\]"):
        RARE.estimate("R=? [ F s=3 ]", samples=2000, seed=1, most=50.0)
    with pytest.raises((UsageError, SymcheckError)):
        COSTS.estimate("R=? [ F s=3 ]", samples=2000, seed=1, most=50.0)


def test_huge_rewards_do_not_become_infinite_sums() -> None:
    model = branch("0.5", "s=1 : 1.5e308; s=2 : 1e308;")
    result = model.estimate("R=? [ F s=3 ]", samples=200, seed=1)
    assert 1e308 < result.value < 1.5e308
    assert result.bounds[0] <= 1.25e308 <= result.bounds[1]
