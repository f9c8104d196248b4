"""Estimates against numerical checking of the built model: two ways from the text to the number that share no encoding."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from pathlib import Path
from random import Random
from typing import Never

import numpy as np
import pytest

import symcheck
from checking import check_text, engine_of
from generate import random_model, random_property
from symcheck.check.result import Exact, Result, Statistical
from symcheck.cli import main
from symcheck.errors import (
    NameFault,
    NumericalError,
    ResourceError,
    SymcheckError,
    UnsupportedError,
    UsageError,
)
from symcheck.parallel.workers import Workers
from symcheck.semantics.binding.bind import bind, bind_properties
from symcheck.semantics.query import query_of
from symcheck.simulate.check import check_by_sampling
from symcheck.simulate.monitors import monitor_of
from symcheck.simulate.samples import SampledProperty
from symcheck.simulate.statistics import Plan
from symcheck.syntax.ast import ProbabilityOperator
from symcheck.syntax.parse import parse_model, parse_properties

DIE = (Path(__file__).parents[2] / "models" / "die" / "die.pm").read_text()


def sample(text: str, formula: str, workers: Workers | None = None, **plan: object) -> Result:
    model = bind(parse_model(text), {})
    bound = bind_properties(parse_properties(formula), model, {})
    return check_by_sampling(
        model,
        bound.properties[0].formula,
        Plan(**{"seed": 1, **plan}),
        labels=bound.labels,
        workers=workers,
    )


def fine(text: str) -> bool:
    """Whether a random model is not at fault: some have a reward for an action that no command has."""
    try:
        bind(parse_model(text), {})
    except NameFault:
        return False
    return True


def cases(count: int) -> list[tuple[str, str, str, int]]:
    """Random models and properties that can be sampled."""
    found, seed = [], 0
    while len(found) < count:
        rng = Random(f"simulate {seed}")
        kind = rng.choice(("dtmc", "ctmc"))
        model = random_model(rng, kind)
        formula = random_property(rng, model)
        if fine(model.text) and not any(
            part in formula for part in ("S=?", "[ S ]", "[ C ]", "(P")
        ):
            found.append((kind, model.text, formula, seed))
        seed += 1
    return found


@pytest.mark.parametrize(("kind", "text", "formula", "seed"), cases(150))
def test_intervals_hold_the_checked_value(kind: str, text: str, formula: str, seed: int) -> None:
    try:
        wanted = check_text(engine_of(text), formula, epsilon=1e-9).value
    except SymcheckError:  # such as a property without a value: sampling must not invent one
        with pytest.raises(SymcheckError):
            sample(text, formula, seed=seed, samples=100)
        return
    result = sample(text, formula, seed=seed, samples=4000, error=1e-6)
    if isinstance(result.accuracy, Exact):
        assert result.value == wanted == np.inf
        return
    assert isinstance(result.accuracy, Statistical)
    slack = 1e-9 * max(1.0, abs(wanted))
    assert result.accuracy.lower - slack <= wanted <= result.accuracy.upper + slack


@pytest.mark.parametrize("seed", range(25))
def test_uniform_choices_of_an_mdp_lie_between_minimum_and_maximum(seed: int) -> None:
    rng = Random(f"mdp {seed}")
    text = next(t for t in iter(lambda: random_model(rng, "mdp").text, None) if fine(t))
    engine = engine_of(text)
    low, high = (check_text(engine, f'P{d}=? [ F<=6 "a" ]').value for d in ("min", "max"))
    result = sample(text, 'Pmin=? [ F<=6 "a" ]', samples=3000, error=1e-6)
    assert isinstance(result.accuracy, Statistical)
    assert result.accuracy.upper >= low - 1e-9
    assert result.accuracy.lower <= high + 1e-9
    assert "that strategy" in result.warnings[0]
    assert "(under the uniform strategy, in [" in str(result)


def test_an_infinite_estimate_of_an_mdp_is_that_of_the_uniform_strategy() -> None:
    text = """mdp module m x:[0..2]; [] x=0 -> (x'=1); [] x=0 -> (x'=2); endmodule
rewards true : 1; endrewards"""
    result = sample(text, "Rmin=? [ F x=1 ]")  # 1 under another strategy
    assert result.value == np.inf
    assert isinstance(result.accuracy, Statistical)
    assert result.accuracy.uniform


def test_the_same_seed_gives_the_same_result() -> None:
    assert sample(DIE, "P=? [ F d=6 ]").value == sample(DIE, "P=? [ F d=6 ]").value
    assert sample(DIE, "P=? [ F d=6 ]", seed=2).value != sample(DIE, "P=? [ F d=6 ]").value


@pytest.mark.parametrize("method", ["ci", "aci", "apmc"])
def test_a_width_finds_the_number_of_samples(method: str) -> None:
    result = sample(DIE, "P=? [ F d=6 ]", method=method, width=0.02, error=1e-6)
    assert isinstance(result.accuracy, Statistical)
    assert (result.accuracy.upper - result.accuracy.lower) / 2 <= 0.02 + 1e-12
    assert result.accuracy.lower <= 1 / 6 <= result.accuracy.upper


@pytest.mark.parametrize("method", ["ci", "aci", "apmc"])
def test_samples_and_width_find_the_confidence(method: str) -> None:
    result = sample(DIE, "P=? [ F d=6 ]", method=method, width=0.02, samples=4000)
    assert isinstance(result.accuracy, Statistical)
    # The normal distribution gives 0.99931 (deviation 0.00589); Okamoto's bound 1 - 2 exp(-3.2) holds for any value.
    expected = 0.9185 if method == "apmc" else 0.9993
    assert result.accuracy.confidence == pytest.approx(expected, abs=3e-4)


def test_okamoto_number_of_samples() -> None:
    result = sample(DIE, "P=? [ F d=6 ]", method="apmc", width=0.01, error=0.01)
    assert isinstance(result.accuracy, Statistical)
    assert result.accuracy.samples == 26492  # ceil(ln(200) / 0.0002)


def test_apmc_needs_a_bound_on_rewards() -> None:
    formula = 'R{"tosses"}=? [ C<=5 ]'
    with pytest.raises(UsageError, match="most"):
        sample(DIE, formula, method="apmc")
    with pytest.raises(NumericalError, match="outside of"):
        sample(DIE, formula, method="apmc", most=2.0)
    result = sample(DIE, formula, method="apmc", most=5.0, width=0.1, error=1e-6)
    assert isinstance(result.accuracy, Statistical)
    assert (
        result.accuracy.lower <= check_text(engine_of(DIE), formula).value <= result.accuracy.upper
    )


@pytest.mark.parametrize(
    ("formula", "verdict"),
    [("P>=0.1", True), ("P>0.3", False), ("P<0.3", True), ("P<=0.05", False)],
)
@pytest.mark.parametrize("method", ["ci", "aci", "apmc", "sprt"])
def test_thresholds(method: str, formula: str, verdict: bool) -> None:
    result = sample(
        DIE,
        f"{formula} [ F d=6 ]",
        method=method,
        samples=20000,
        width=0.03 if method == "sprt" else None,
    )
    assert result.value is verdict


def test_the_sequential_test_is_wrong_as_rarely_as_it_says() -> None:
    coin = "dtmc module m x:[0..2]; [] x=0 -> 0.5:(x'=1)+0.5:(x'=2); endmodule"
    verdicts = [
        sample(coin, "P>=0.45 [ X x=1 ]", method="sprt", width=0.05, error=0.1, seed=s).value
        for s in range(200)
    ]
    assert (
        sum(1 for v in verdicts if not v) <= 40
    )  # 20 expected at most; more than 40 has probability below 1e-4


def test_a_threshold_within_the_interval_is_an_error() -> None:
    with pytest.raises(NumericalError, match="is not decided"):
        sample(DIE, "P>=1/6 [ F d=6 ]")


def test_paths_that_are_too_long_are_an_error() -> None:
    walk = "dtmc module m x:int init 0; [] true -> 0.5:(x'=x+1)+0.5:(x'=x-1); endmodule"
    with pytest.raises(NumericalError, match="max_steps"):
        sample(walk, "P=? [ F x=50 ]", samples=50, max_steps=100)


def test_a_closed_class_without_the_target_ends_a_path() -> None:
    text = "dtmc module m x:[0..3]; [] x=0 -> 0.25:(x'=1)+0.75:(x'=2); [] x=2 -> (x'=3); [] x=3 -> (x'=2); endmodule"
    text += "\nrewards true:1; endrewards"
    result = sample(text, "P=? [ F x=1 ]", error=1e-6, samples=2000)
    assert isinstance(result.accuracy, Statistical)
    assert result.accuracy.lower <= 0.25 <= result.accuracy.upper
    assert sample(text, "P=? [ G x!=1 ]", samples=2000).value == pytest.approx(1 - result.value)
    assert sample(text, "R=? [ F x=1 ]").value == np.inf


@pytest.mark.parametrize(
    ("formula", "advice"),
    [
        ("S=? [ x=0 ]", "without sampling"),
        ("R=? [ S ]", "C<=k or I=k"),
        ("R=? [ C ]", "C<=k or I=k"),
        ("P=? [ G F x=0 ]", "X, F, G, U, W and R"),
        ("P=? [ F P>0.5 [ X x=0 ] ]", "without sampling"),
        ("filter(max, P=? [ F x=0 ], x=1)", "a single P, R or T operator"),
        ("1 - P=? [ F x=0 ]", "a single P, R or T operator"),
    ],
)
def test_what_is_unsupported_says_what_would_work(formula: str, advice: str) -> None:
    text = "dtmc module m x:[0..1]; [] true -> 0.5:(x'=0)+0.5:(x'=1); endmodule\nrewards true:1; endrewards"
    with pytest.raises(UnsupportedError, match=advice.replace("|", r"\|")):
        sample(text, formula)


def test_thresholds_of_an_mdp_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="all strategies"):
        sample(
            "mdp module m x:[0..1]; [] true -> (x'=0); [] true -> (x'=1); endmodule",
            "P>=0.5 [ F x=1 ]",
        )


def test_several_initial_states_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="one initial state"):
        sample(
            "dtmc module m x:[0..1]; [] true -> (x'=x); endmodule\ninit true endinit",
            "P=? [ F x=1 ]",
        )


@pytest.mark.parametrize(
    ("text", "formula", "plan"),
    [
        (DIE, "P=? [ F d=6 ]", {"width": 0.008, "error": 1e-6}),
        (DIE, "P>=0.17 [ F d=6 ]", {"method": "sprt", "width": 0.01, "error": 1e-6}),
        (
            "ctmc module m x:[0..2]; [] x<2 -> 3:(x'=x+1)+1:(x'=0); endmodule rewards x>0 : x; endrewards",
            "R=? [ F x=2 ]",
            {"samples": 20_000},
        ),
    ],
)
def test_the_number_of_workers_does_not_change_the_result(
    text: str, formula: str, plan: dict[str, object]
) -> None:
    here = sample(text, formula, **plan)
    for count in (1, 2, 3):
        with ThreadPoolExecutor(count) as executor, Workers(1, executor) as workers:
            there = sample(text, formula, workers, **plan)
        assert (there.value, there.accuracy) == (here.value, here.accuracy)
        assert there.explanation == here.explanation


def test_processes_sample_the_same_paths() -> None:
    with Workers(2) as workers:
        there = sample(DIE, "P=? [ F d=6 ]", workers, samples=9001)
    assert there.accuracy == sample(DIE, "P=? [ F d=6 ]", samples=9001).accuracy


def test_values_of_paths_do_not_depend_on_their_batch() -> None:
    model = bind(parse_model(DIE), {})
    bound = bind_properties(parse_properties("P=? [ F d=6 ]"), model, {})
    operator = bound.properties[0].formula
    assert isinstance(operator, ProbabilityOperator)
    monitor = monitor_of(query_of(operator, model).quantity, model)
    sampled = SampledProperty(model, None, monitor, None, {}, 5, 10_000, True)
    whole = sampled.sampler().sample(0, 100).values
    parts = [sampled.sampler().sample(b, min(7, 100 - b)).values for b in range(0, 100, 7)]
    assert np.array_equal(np.concatenate(parts), whole)
    assert 5 < whole.sum() < 30


def test_a_lost_batch_is_an_error() -> None:
    class Dead(ThreadPoolExecutor):
        def submit(self, *_: object, **__: object) -> Never:
            raise BrokenExecutor

    with pytest.raises(ResourceError, match="its process was killed"):
        sample(DIE, "P=? [ F d=6 ]", Workers(1, Dead()), samples=5000)


def test_the_library_names_parameters_and_the_command_line_switches(tmp_path, capsys):
    text = "dtmc module m x : [0..1]; [] x=0 -> 0.5:(x'=1) + 0.5:true; endmodule"
    with pytest.raises(UsageError, match="choose a larger 'samples'"):
        symcheck.loads(text).estimate("P=? [ F x=1 ]", samples=1)
    (tmp_path / "m.pm").write_text(text)
    words = ["-pf", "P=? [ F x=1 ]", "-sim", "-simsamples", "1"]
    assert main([str(tmp_path / "m.pm"), *words]) == 1
    assert "choose a larger -simsamples" in capsys.readouterr().out
