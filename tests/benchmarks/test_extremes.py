"""The campaign of extreme numbers finds each kind of fault, and none in the models of the suite."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import extremes
import pytest

import symcheck
from oracles.draw import Question, draw
from symcheck.check.result import Certified, Estimate, Exact, Result
from symcheck.errors import InputError, NumericalError, TimeLimitError, UnsupportedError

THIRD = Fraction(1, 3)
TINY = Fraction(1, 10**400)


@pytest.mark.parametrize(
    ("found", "truth", "kind"),
    [
        (Result(THIRD), THIRD, ""),
        (Result(1 / 3), THIRD, "not exact"),
        (Result(1 / 3, Exact(rounding=True)), THIRD, ""),
        (Result(0.3333333333, Exact(rounding=True)), THIRD, "outside"),
        (Result(1 / 3, Exact(True, 1 / 3, 1 / 3)), THIRD, "outside"),
        (Result(1 / 3, Exact(True, 0.3, 0.4)), THIRD, "rounding"),
        (Result(0.0, Exact(rounding=True)), TINY, "rounded to 0"),
        (Result(0.0, Certified(0.0, 1e-300)), TINY, ""),
        (Result(0.3, Certified(0.29, 0.31)), THIRD, "outside"),
        (Result(0.3, Certified(nan, nan)), THIRD, "outside"),
        (Result(0.3, Certified(0.2, 0.4)), THIRD, "wide"),
        (replace(Result(0.3, Certified(0.2, 0.4)), warnings=("wide",)), THIRD, ""),
        (Result(0.3, Estimate()), THIRD, "estimate"),
        (Result(0.5), (Fraction(0), Fraction(1)), "not exact"),
        (Result(0.5, Certified(0.4, 0.6)), (Fraction(1, 2), Fraction(7, 10)), "outside"),
        (Result(inf), inf, ""),
        (Result(1e300, Exact(rounding=True)), inf, "infinite"),
        (Result(nan), None, ""),
        (Result(0.5), None, "defined"),
        (Result(nan), THIRD, "NaN"),
        (Result(True), True, ""),
        (Result(True), False, "verdict"),
        (Result(True), THIRD, "kind of value"),
        (InputError("no"), None, ""),
        (InputError("no"), THIRD, "error"),
        (NumericalError("no"), THIRD, "refused"),
        (TimeLimitError("no"), THIRD, "endless"),
        (ValueError("no"), THIRD, "crash"),
    ],
    ids=str,
)
def test_each_kind_of_fault_is_found(found, truth, kind):
    assert extremes.difference(found, truth) == kind


def test_only_times_may_be_refused():
    assert extremes.may_refuse(UnsupportedError("no"), "exact", "ctmc")
    assert extremes.may_refuse(NumericalError("no"), "sparse", "ctmc")
    assert not extremes.may_refuse(UnsupportedError("no"), "sparse", "ctmc")
    assert not extremes.may_refuse(UnsupportedError("no"), "exact", "mdp")
    assert extremes.difference(NumericalError("no"), THIRD, silent=True) == ""


@pytest.mark.parametrize(
    ("action", "kind"), [("u", ""), ("v", "not optimal")], ids=["attains", "misses"]
)
def test_a_strategy_that_misses_the_optimum_is_found(action, kind):
    found = Result(0.5, strategies=(SimpleNamespace(actions=[action, ""]),))
    question = Question(
        "Pmax=? [ F true ]", Fraction(1, 2), lambda chosen: Fraction(1, 2 + chosen[0])
    )
    assert extremes.strategy_differs(found, question)[0] == kind


def test_a_wrong_value_is_written_down(tmp_path, monkeypatch):
    seed = next(s for s in map(str, range(99)) if draw(s).kind == "dtmc")
    case = draw(seed)
    wrong = replace(case.questions[0], text="P=? [ F false ]", truth=Fraction(1, 7))
    monkeypatch.setattr(extremes, "draw", lambda _: replace(case, questions=(wrong,)))
    line = extremes.run(seed, tmp_path, ("explicit",))
    assert line["differences"] == ["0: {'explicit': 'not exact'}"]
    written = (tmp_path / f"{seed}.0.props").read_text()
    assert "// truth: 1/7" in written
    assert symcheck.load(tmp_path / f"{seed}.0.pm").check(wrong.text).value == 0


def test_the_drawn_numbers_are_extreme():
    cases = [draw(f"suite-{i}") for i in range(60)]
    text = "\n".join(case.text + "\n".join(q.text for q in case.questions) for case in cases)
    for number in ("1e-200", "1e-300", "1-1e-16", "-1e17", "1e12", "<=0 ", "discount", "||"):
        assert number in text, number
    truths = [q.truth for case in cases for q in case.questions]
    assert any(isinstance(t, Fraction) and 0 < t < Fraction(1, 10**320) for t in truths)
    assert {True, False, inf, None} <= {t for t in truths if not isinstance(t, tuple)}
    assert {case.kind for case in cases} == {"dtmc", "ctmc", "mdp"}


KNOWN_GAPS: set[int] = set()
"""Of underflow within steps (6), and of times of stiff chains, which find no end in the patience."""


@pytest.mark.parametrize("seed", [f"suite-{i}" for i in range(20) if i not in KNOWN_GAPS])
def test_models_of_the_suite_agree_with_their_oracles(seed, tmp_path):
    line = extremes.run(seed, tmp_path)
    assert not line["differences"]
    assert line["outcomes"]["compared with an oracle"] == 30


def test_a_campaign_continues(tmp_path):
    log = tmp_path / "log.jsonl"
    script = Path(extremes.__file__)
    for runs in (1, 2):
        words = [sys.executable, script, f"--runs={runs}", f"--log={log}", "--seed=suite"]
        words += ["--engines", "explicit", "exact"]
        ran = subprocess.run(words, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        lines = [json.loads(line) for line in log.read_text().splitlines()]
        assert [line["seed"] for line in lines] == [f"suite-{i}" for i in range(runs)]
    assert lines[0]["checks"] == 10
