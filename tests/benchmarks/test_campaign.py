"""The campaign of random models finds what it is there to find, and nothing in a few models."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from math import exp
from pathlib import Path

import campaign
import exponentials
import pytest

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.errors import InputError, UnsupportedError

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
COIN = "dtmc module m x : [0..2]; [] x=0 -> 1/3 : (x'=1) + 2/3 : (x'=2); endmodule"


def test_a_contradiction_is_a_difference():
    true = symcheck.loads(COIN, exact=True).check("P=? [ F x=1 ]")
    found = symcheck.loads(COIN, engine="explicit").check("P=? [ F x=1 ]")
    assert campaign.difference(found, true) == ""
    near = replace(found, value=0.34, accuracy=Certified(0.3399999, 0.34))
    assert campaign.difference(near, true) == "outside"
    assert campaign.difference(replace(near, accuracy=Certified(0.3, 0.4)), true) == "wide"
    assert campaign.difference(replace(found, accuracy=Exact()), true) == "outside"
    rounded = replace(found, value=1 / 3 + 1e-15, accuracy=Exact(rounding=True))
    assert campaign.difference(found, rounded) == ""
    assert campaign.difference(replace(found, value=True), replace(true, value=False)) == "verdict"
    assert campaign.difference(InputError("no"), true) == "error"
    assert campaign.difference(UnsupportedError("no"), true) == ""
    assert campaign.difference(ValueError("no"), true) == "crash"


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("P=? [ F<=0.5 x=2 ]", 1 - 3 * exp(-1) + 2 * exp(-1.5)),
        ("P=? [ G>0.5 x=0 ]", 0.0),
        ("P=? [ x=0 U[0.5,2] x=1 ]", exp(-1) - exp(-4)),
        ("P=? [ F=1 x=0 ]", exp(-2)),
        ('R{"r"}=? [ C<=2 ]', 3 * (1 - exp(-4)) / 2),
        ('R{"r"}=? [ I=1 ]', exp(-2)),
        ("P>=0.1 [ F=1 x=0 ]", True),
        ("P=? [ X x=1 ]", None),
    ],
)
def test_exponentials_have_the_values_of_a_chain_of_three_states(formula, value):
    text = """ctmc module m x : [0..2];
        [] x=0 -> 2 : (x'=1);
        [] x=1 -> 3 : (x'=2);
        endmodule rewards "r" x=0 : 1; [] x=0 : 1; endrewards"""
    found = exponentials.value(symcheck.loads(text, exact=True), formula)
    assert found == pytest.approx(value, abs=1e-15) if value is not None else found is None


def test_a_few_models_agree_and_a_second_run_continues(tmp_path):
    log = tmp_path / "log.jsonl"
    for runs in (2, 4):
        words = [sys.executable, BENCHMARKS / "campaign.py", f"--runs={runs}", f"--log={log}"]
        ran = subprocess.run(words, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        lines = [json.loads(line) for line in log.read_text().splitlines()]
        assert [line["seed"] for line in lines] == [f"1-{i}" for i in range(runs)]
        assert f"{runs} models" in ran.stdout


def test_methods_for_large_models_agree_on_small_ones(tmp_path):
    before = vars(campaign.numerics).copy()
    with campaign.large("1"):
        lowered = {n for n, v in vars(campaign.numerics).items() if v != before[n]}
    assert "KRYLOV_STEPS" not in lowered or "SMOOTHING_STEPS" in lowered
    assert len(lowered) > 5
    assert vars(campaign.numerics) == before
    words = [
        sys.executable,
        BENCHMARKS / "campaign.py",
        "--runs=4",
        "--large",
        f"--log={tmp_path}/x.jsonl",
    ]
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
