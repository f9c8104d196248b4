"""Settings of a check: methods, accuracy, observers."""

from __future__ import annotations

import pytest

from checking import RESULTS, check_text, engine_of
from symcheck.check.result import Certified, Estimate, Exact
from symcheck.engines.registry import BUILDERS
from symcheck.errors import UsageError
from symcheck.numerics.linear.methods import METHODS
from symcheck.numerics.linear.problem import Progress

GAMBLER = (RESULTS / "gambler.pm").read_text()
CHOICES = (RESULTS / "choices.nm").read_text()
GIVEN = {"n": "12", "i": "5", "p": "0.45"}
R = 0.55 / 0.45
TRUE = (1 - R**5) / (1 - R**12)


@pytest.mark.parametrize("method", [m.name for m in METHODS.values() if not m.is_rational])
def test_methods(method):
    engine = engine_of(GAMBLER, constants=GIVEN)
    result = check_text(engine, 'P=? [ F "rich" ]', method=method, certify=METHODS[method].sound)
    assert result.method == method
    # An estimate has no proof: it may be much further away than the change at which its iteration stops.
    assert result.value == pytest.approx(TRUE, rel=1e-5 if METHODS[method].sound else 1e-3)
    assert isinstance(result.accuracy, (Certified, Exact) if METHODS[method].sound else Estimate)


def test_accuracy_is_kept():
    engine = engine_of(GAMBLER, constants=GIVEN)
    for epsilon in (1e-3, 1e-6, 1e-10):
        result = check_text(engine, 'P=? [ F "rich" ]', method="interval", epsilon=epsilon)
        assert isinstance(result.accuracy, Certified)
        assert result.accuracy.lower <= TRUE <= result.accuracy.upper
        assert result.accuracy.upper - result.accuracy.lower <= epsilon * TRUE * 1.01


def test_unknown_method():
    with pytest.raises(UsageError, match="method='magic': expected one of auto, topological"):
        check_text(engine_of(GAMBLER, constants=GIVEN), 'P=? [ F "rich" ]', method="magic")


def test_unknown_engine():
    with pytest.raises(UsageError, match="engine='steam': expected one of auto, explicit"):
        engine_of(GAMBLER, "steam", GIVEN)


@pytest.mark.parametrize("name", [n for n in BUILDERS if n != "exact"])
def test_fair_strategies(name):
    """An unfair strategy waits for ever; a fair one cannot: in the end it takes the sure way, or the risky one until it is lost."""
    engine = engine_of(CHOICES, name)
    assert check_text(engine, 'Pmin=? [ F "goal" | "lost" ]').value == 0
    assert check_text(engine, 'Pmin=? [ F "goal" | "lost" ]', fairness=True).value == 1
    assert check_text(engine, 'P>=1 [ F "goal" | "lost" ]', fairness=True).value is True
    assert check_text(engine, "P>0 [ G s=0 ]", fairness=True).value is False
    assert check_text(engine, 'Pmax=? [ F "lost" ]', fairness=True).value == pytest.approx(
        0.6, rel=1e-6
    )
    assert check_text(engine, 'Pmin=? [ F "goal" ]', fairness=True).value == pytest.approx(
        0.4, rel=1e-6
    )


def test_observer_sees_the_iterations_and_may_end_them():
    from symcheck.check.checker import check
    from symcheck.options import Options
    from symcheck.semantics.binding.bind import bind_properties
    from symcheck.syntax.parse import parse_properties

    engine = engine_of(GAMBLER, constants=GIVEN)
    bound = bind_properties(
        parse_properties('P=? [ F "rich" ]; P=? [ F<=20 "rich" ]'), engine.model
    )
    steps: list[Progress] = []
    for p in bound.properties:
        check(engine, p.formula, Options(method="interval"), observer=steps.append)
    assert {s.method for s in steps} >= {"step by step"}
    assert len(steps) > 20

    def stop(step: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(engine, bound.properties[1].formula, Options(), observer=stop)
