"""Strategies of several objectives: the chain that each induces has, checked by itself, the values together."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from symcheck.cli import main
from symcheck.errors import SymcheckError, UsageError
from symcheck.exchange.strategies.files import strategy_target, strategy_texts

PATHS = [
    'F "a"',
    '"b" U "a"',
    'G "b"',
    "F<=3 x0=1",
    'G F "a"',
    'F G "b"',
    '(G F "a") & (G F !"a")',
    'F ("a" & (X "b"))',
]
REWARDS = ['R{"r"}max=? [ C<=3 ]', 'R{"r"}min=? [ C<=4 ]', 'R{"r"}min=? [ C ]']
AVERAGES = ['R{"r"}max=? [ S ]', 'R{"r"}min=? [ S ]', 'Smax=? [ "a" ]']


def numeric(objective):
    """An objective as a query of a chain: its value there."""
    for word in ("max=?", "min=?"):
        objective = objective.replace(word, "=?")
    for operator in ("<=", ">="):
        head, found, rest = objective.partition(operator)
        if found and "[" not in head:
            objective = head + "=?" + rest[rest.index(" ") :]
    return objective


def close(found, wanted, *, exact):
    if found == wanted or exact:
        return found == wanted
    return abs(found - wanted) <= 2e-6 * max(1, abs(wanted))


def objective(rng):
    kind = rng.choice(["path"] * 3 + ["reward", "average"])
    if kind == "path":
        return f"P{rng.choice(['max', 'min'])}=? [ {rng.choice(PATHS)} ]"
    return rng.choice(REWARDS if kind == "reward" else AVERAGES)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    form=st.sampled_from(["multi", "multilex"]),
    options=st.sampled_from([{}, {"exact": True}]),
)
def test_each_point_is_attained(seed, form, options):
    rng = Random(seed)
    text = some_model(rng, "mdp").text
    objectives = [objective(rng) for _ in range(2)]
    model = symcheck.loads(text, strategy=True, **options)
    try:
        result = model.check(f"{form}({', '.join(objectives)})")
    except SymcheckError:
        assume(False)
    assume(not result.warnings)
    assert len(result.strategies) == len(result.value)
    for point, strategy in zip(result.value, result.strategies, strict=True):
        chain = symcheck.induced_chain(model, strategy)
        for value, one in zip(point, objectives, strict=True):
            found = chain.check(numeric(one)).value
            assert close(found, value, exact=bool(options)), (one, found, value)


FORK = """mdp
module m
  s : [0..3];
  [a] s=0 -> 0.4:(s'=1) + 0.6:(s'=2);
  [b] s=0 -> (s'=1);
  [c] s=0 -> 0.5:(s'=0) + 0.5:(s'=3);
  [] s>0 -> true;
endmodule
rewards "try" [c] true : 1; [a] true : 3; endrewards
rewards "loop" s=2 : 1; endrewards
"""


def lines(strategy):
    return "".join(strategy_texts(strategy, strategy_target("s"))).splitlines()


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_random_choices_without_memory_where_none_is_needed(engine):
    model = symcheck.loads(FORK, strategy=True, exact=engine == "explicit", engine=engine)
    best = model.check("multi(Pmax=? [ F s=3 ], P>=1/2 [ F s=2 ])")
    chain = symcheck.induced_chain(model, best)
    assert best.strategy.memory is None
    assert chain.check("P=? [ F s=2 ]").value == pytest.approx(0.5)
    assert chain.check("P=? [ F s=3 ]").value == pytest.approx(1 / 6)
    if model.options.exact:
        assert lines(best.strategy)[0] == "(0)=5/7:a+2/7:c"


def test_bounds_that_can_be_met_are_met():
    model = symcheck.loads(FORK, strategy=True)
    met = model.check('multi(P>=0.2 [ F s=1 ], P>=0.2 [ G F s=2 ], R{"try"}<=4 [ C ])')
    chain = symcheck.induced_chain(model, met)
    assert chain.check("P>=0.2 [ F s=1 ]").value
    assert chain.check("P>=0.2 [ G F s=2 ]").value
    assert chain.check('R{"try"}<=4 [ C ]').value


def test_a_front_has_a_strategy_for_each_point(tmp_path):
    model = symcheck.loads(FORK, strategy=True)
    front = model.check("multi(Pmax=? [ F s=2 ], Pmax=? [ F s=3 ])")
    assert not hasattr(front, "strategy")
    assert [lines(s)[0] for s in front.strategies] == ["(0)=a", "(0)=c"]
    with pytest.raises(UsageError, match=r"result.strategies\[0\]"):
        symcheck.induced_chain(model, front)
    (tmp_path / "fork.nm").write_text(FORK)
    words = [str(tmp_path / "fork.nm"), "-pf", "multi(Pmax=? [ F s=2 ], Pmax=? [ F s=3 ])"]
    assert main([*words, "-exportstrat", str(tmp_path / "s.txt")]) == 0
    assert (tmp_path / "s_point=2.txt").read_text() == "(0)=c\n(3)=\n"


def test_an_order_of_objectives_is_remembered_until_it_is_decided():
    """A run that has seen s=1 goes on to s=2, and one that has not may stop: memory is needed."""
    text = """mdp module m s:[0..2];
      [stop] s=0 -> true; [one] s=0 -> (s'=1); [back] s=1 -> (s'=0); [two] s=0 -> (s'=2);
    endmodule"""
    model = symcheck.loads(text, strategy=True)
    found = model.check("multi(Pmax=? [ F s=1 ], P>=0.5 [ F s=2 ], P>=0.5 [ G s!=2 ])")
    chain = symcheck.induced_chain(model, found)
    assert found.strategy.memory is not None
    assert chain.check("P=? [ F s=1 ]").value == pytest.approx(1)
    assert chain.check("P=? [ F s=2 ]").value == pytest.approx(0.5)


LOOPS = """mdp
module m
  s : [0..2];
  [left] s=0 -> (s'=1);
  [right] s=0 -> (s'=2);
  [stay] s>0 -> true;
  [back] s>0 -> (s'=0);
endmodule
rewards "x" s=1 : 1; endrewards
rewards "y" s=2 : 1; endrewards
"""


@pytest.mark.parametrize("options", [{}, {"exact": True}])
def test_long_run_averages_settle_at_random(options):
    """Only a random choice, made once, gives both averages 1/2; the chain must not come back."""
    model = symcheck.loads(LOOPS, strategy=True, **options)
    found = model.check('multi(R{"x"}>=0.5 [ S ], R{"y"}>=0.5 [ S ])')
    chain = symcheck.induced_chain(model, found)
    assert chain.check('R{"x"}=? [ S ]').value == pytest.approx(0.5)
    assert chain.check('R{"y"}=? [ S ]').value == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        ("multi(P>=0.9 [ F s=1 ], P>=0.9 [ F s=2 ])", "no strategy satisfies the bounds"),
        ('multi(R{"loop"}max=? [ C ], P>=0 [ F s=1 ])', "some rewards are infinite"),
        # A run that enters the loop seldom can stay for long, the more seldom the better.
        ('multi(R{"loop"}>=1 [ C ], P<=0 [ G F s=2 ], P>=1 [ F s=1 ])', "satisfies the bounds"),
    ],
)
def test_what_no_strategy_attains(query, reason):
    found = symcheck.loads(FORK, strategy=True).check(query)
    assert found.strategies == ()
    assert reason in found.warnings[0]


SELDOM = """mdp
module m
  s : [0..2];
  [in] s=0 -> (s'=1);
  [past] s=0 -> (s'=2);
  [on] s=1 -> true;
  [out] s=1 -> (s'=2);
  [] s=2 -> true;
endmodule
rewards "gain" [on] true : 1; endrewards
rewards "cost" [on] true : 1; [in] true : 1; endrewards
"""


def test_a_value_that_is_only_approached():
    """Of a cost of 1, all is gain except the entry, which the strategy makes ever less likely."""
    found = symcheck.loads(SELDOM, strategy=True).check(
        'multi(R{"gain"}max=? [ C ], R{"cost"}<=1 [ C ])'
    )
    assert found.value == pytest.approx(1)
    assert "only come as close to it as desired" in found.warnings[0]


def test_states_of_another_objective_that_are_visited_ever_more_rarely():
    found = symcheck.loads(LOOPS, strategy=True).check('multi(R{"x"}max=? [ S ], P>=1 [ G F s=2 ])')
    assert found.value == pytest.approx(1)
    assert "no strategy with finite memory" in found.warnings[0]
