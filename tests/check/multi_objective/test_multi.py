"""Several objectives: against every memoryless strategy, against single objectives, and by hand."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import inf, isnan
from random import Random
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import symcheck
from checking import check_text, engine_of
from generate import random_model
from symcheck.check import tuning
from symcheck.check.result import Estimate, Exact
from symcheck.errors import InputError, NumericalError, UnsupportedError

SLOW = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))

FORK = """mdp
module m
  s : [0..3];
  [a] s=0 -> 0.4:(s'=1) + 0.6:(s'=2);
  [b] s=0 -> (s'=1);
  [c] s=0 -> 0.5:(s'=0) + 0.5:(s'=3);
  [] s>0 -> true;
endmodule
rewards "try"
  [c] true : 1;
  [a] true : 3;
endrewards
rewards "loop"
  s=2 : 1;
endrewards
"""


def ask(text, model=FORK, engine="explicit"):
    return check_text(engine_of(model, engine), text).value


def test_an_exact_zero_and_an_exact_one_are_rationals():
    for text, value in (
        ("multi(Pmin=? [F s=2], P>=0.1 [F s=1])", 0),
        ("multi(Pmax=? [F s=1], P>=0 [F s=2])", 1),
    ):
        answer = ask(text, engine="exact")
        assert answer == value
        assert isinstance(answer, Fraction)


@pytest.mark.parametrize("symmetry", [False, True])
def test_initial_states_of_one_orbit_are_several(symmetry):
    text = """mdp
    module m1
      x1 : [0..2];
      [] x1=0 -> 1/2:(x1'=1) + 1/2:(x1'=2);
      [] x1>0 -> true;
    endmodule
    module m2 = m1 [x1=x2] endmodule
    init (x1=1 & x2=0) | (x1=0 & x2=1) endinit
    """
    model = symcheck.loads(text, engine="explicit", symmetry=symmetry)
    with pytest.raises(UnsupportedError, match="several initial states"):
        model.check("multi(Pmax=? [F x1=2|x2=2], P>=0 [F x1=1&x2=1])")


def random_engine(seed):
    try:
        engine = engine_of(random_model(Random(seed), "mdp").text)
    except InputError:
        assume(False)
    assume(engine.initial.count == 1)
    return engine


def test_achievability():
    assert ask("multi(P>=0.39 [ F s=1 ], P>=0.59 [ F s=2 ])") is True
    assert ask("multi(P>=0.5 [ F s=1 ], P>=0.55 [ F s=2 ])") is False
    assert ask("multi(P>=0.2 [ F s=1 ], P>=0.2 [ F s=2 ], P>=0.2 [ G F s=3 ])") is True
    assert ask('multi(P<=0.1 [ F s=1 ], P>=0.9 [ F s=3 ], R{"try"}<=2 [ C ])') is True
    assert ask('multi(P<=0.1 [ F s=1 ], P>=0.9 [ F s=3 ], R{"try"}<=1 [ C ])') is False


def test_numerical():
    # With probability q = 5/6 action a is chosen (0.6 q = 0.5), the rest may go to s=3.
    assert ask("multi(Pmax=? [ F s=3 ], P>=0.5 [ F s=2 ])") == pytest.approx(1 / 6, abs=1e-9)
    assert ask("multi(Pmin=? [ F s=1 ], P>=0.3 [ F s=2 ])") == pytest.approx(0.2, abs=1e-9)
    assert ask('multi(R{"try"}min=? [ C ], P>=0.5 [ F s=3 ])') == pytest.approx(1, abs=1e-9)
    assert isnan(ask("multi(Pmax=? [ F s=3 ], P>=0.7 [ F s=2 ])"))


def test_infinite_rewards():
    assert ask('multi(R{"loop"}max=? [ C ], P>=1 [ F (s=1|s=2) ])') == inf
    assert ask('multi(R{"loop"}max=? [ C ], P>=1 [ F s=3 ])') == pytest.approx(
        0, abs=1e-9
    )  # the loop cannot be entered
    assert ask('multi(R{"loop"}min=? [ C ], P>=0.3 [ F s=2 ])') == inf
    assert isnan(ask('multi(R{"loop"}min=? [ C ], P>=0.7 [ F s=2 ])'))
    assert ask('multi(R{"loop"}>=1000000 [ C ], P>=0.9 [ F s=1 ])') is True
    assert ask('multi(R{"loop"}>=0.1 [ C ], P>=1 [ F s=1 ])') is False
    with pytest.raises(NumericalError, match="no bound"):
        ask('multi(R{"loop"}max=? [ C ], Pmax=? [ F s=1 ])')


def test_rewards_of_some_steps():
    # Nothing beats a at once, which ends it.
    assert ask('multi(R{"try"}max=? [ C<=3 ], P>=0 [ true ])') == pytest.approx(3, abs=1e-9)
    assert ask('multi(R{"try"}max=? [ C<=1 ], P>=1 [ F s=3 ])') == pytest.approx(1, abs=1e-9)
    assert ask('multi(R{"try"}max=? [ C<=2 ], R{"try"}max=? [ C<=1 ])') == [
        (pytest.approx(3.0), pytest.approx(3.0))
    ]


def test_pareto():
    points = ask("multi(Pmax=? [ F s=2 ], Pmax=? [ F s=3 ])")
    assert points == [
        (pytest.approx(0.6), pytest.approx(0, abs=1e-9)),
        (pytest.approx(0, abs=1e-9), pytest.approx(1)),
    ]
    assert ask("multi(Pmax=? [ F s=2 ], Pmin=? [ F s=1 ])") == [
        (pytest.approx(0.6), pytest.approx(0.4)),
        (pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-9)),
    ]


LOOPS = """mdp
module m
  s : [0..4];
  [a] s=0 -> 0.5:(s'=1) + 0.5:(s'=0);
  [b] s=0 -> (s'=2);
  [c] s=0 -> (s'=3);
  [] s=1 -> (s'=4);
  [] s=2 | s=3 -> true;
  [d] s=4 -> (s'=0);
  [e] s=4 -> true;
endmodule
rewards "r"
  [a] true : 3;
  s=3 : 1;
  [d] true : 1;
endrewards
"""


@pytest.mark.parametrize("engine", ["exact", "explicit", "mtbdd"])
def test_rewards_until_states(engine):
    # Without a bound, the best is never to reach s=1, which costs nothing: as in Storm.
    assert ask('multi(R{"r"}min=? [ F s=1 ], P>=0 [ F s=2 ])', LOOPS, engine) == 0
    assert ask('multi(R{"r"}min=? [ F s=1 ], P>=1 [ F s=1 ])', LOOPS, engine) == pytest.approx(6)
    assert ask('multi(R{"r"}max=? [ F s=1 ], P>=0 [ F s=2 ])', LOOPS, engine) == inf
    assert ask('multi(R{"r"}<=3 [ F s=1 ], P>=0.5 [ F s=1 ])', LOOPS, engine) is True
    assert ask('multi(R{"r"}<=2.9 [ F s=1 ], P>=0.5 [ F s=1 ])', LOOPS, engine) is False
    # Time never ends where s=1 is not reached.
    assert ask("multi(Tmin=? [ F s=1 ], P>=0 [ F s=2 ])", LOOPS, engine) == pytest.approx(2)
    # s=1 is left again; what is earned later does not count.
    assert ask(
        'multi(R{"r"}min=? [ F s=1 ], R{"r"}min=? [ F s=4 ], P>=1 [ F (s=4 & F s=2) ])',
        LOOPS,
        engine,
    ) == [(pytest.approx(6), pytest.approx(6))]
    assert ask('multi(R{"r"}min=? [ C ], P>=1 [ F (s=4 & F s=2) ])', LOOPS, engine) == (
        pytest.approx(7)
    )


@pytest.mark.parametrize("engine", ["exact", "explicit", "hybrid"])
def test_long_run_averages(engine):
    # Half of the runs stay in s=2, the others in the cycle 0 -> 1 -> 4 -> 0: 7 in 4 steps.
    assert ask('multi(R{"r"}max=? [ S ], P>=0.5 [ F s=2 ])', LOOPS, engine) == pytest.approx(7 / 8)
    assert ask("multi(Smax=? [ s=2 ], P>=0.5 [ F s=1 ])", LOOPS, engine) == pytest.approx(1)
    # The cycle must be left seldom enough: average and visits for ever.
    assert ask('multi(R{"r"}max=? [ S ], P>=1 [ G F s=1 ])', LOOPS, engine) == pytest.approx(7 / 4)
    assert ask("multi(Smax=? [ s=4 ], P>=1 [ G F s=1 ])", LOOPS, engine) == pytest.approx(1)
    assert ask("multi(S>=0.5 [ s=2 ], S>=0.5 [ s=3 ])", LOOPS, engine) is True
    assert ask("multi(S>=0.5 [ s=2 ], S>=0.51 [ s=3 ])", LOOPS, engine) is False
    assert ask("multi(Smax=? [ s=2 ], Smax=? [ s=1 ], Smin=? [ s=0 ])", LOOPS, engine) == [
        (pytest.approx(1), pytest.approx(0), pytest.approx(0)),
        (pytest.approx(0), pytest.approx(0.25), pytest.approx(0.5)),
    ]
    # A finite total reward needs an end component without reward, where the average is 0.
    assert ask('multi(R{"r"}max=? [ S ], R{"r"}<=100 [ C ])', LOOPS, engine) == pytest.approx(0)


def test_negative_rewards_have_averages():
    model = LOOPS.replace("s=3 : 1;", "s=3 : -1; s=2 : -2;")
    for engine in ("exact", "explicit"):
        query = 'multi(R{"r"}min=? [ S ], P>=0.5 [ F s=3 ])'
        assert ask(query, model, engine) == pytest.approx(-1.5)
    with pytest.raises(UnsupportedError, match="negative"):
        ask('multi(R{"r"}min=? [ C ], P>=0.5 [ F s=3 ])', model)


def test_three_objectives():
    result = check_text(
        engine_of(FORK, "exact"), "multi(Pmax=? [ F s=1 ], Pmax=? [ F s=2 ], Pmax=? [ F s=3 ])"
    )
    assert result.value == [(1, 0, 0), (Fraction(2, 5), Fraction(3, 5), 0), (0, 0, 1)]
    # The only facet that is no bound of one objective alone is x + y + z <= 1 .
    facets = {(h.weights, h.bound) for h in result.front.halfspaces}
    third = Fraction(1, 3)
    assert ((third, third, third), third) in facets
    assert ((0, 1, 0), Fraction(3, 5)) in facets
    # Minimising probabilities is shown with the probabilities themselves.
    least = check_text(
        engine_of(FORK, "exact"), "multi(Pmin=? [ F s=1 ], Pmax=? [ F s=2 ], Pmin=? [ F s=3 ])"
    )
    for h in least.front.halfspaces:
        values = [sum(w * x for w, x in zip(h.weights, p, strict=True)) for p in least.value]
        assert max(values) == h.bound


def test_rational_arithmetic():
    assert ask("multi(Pmax=? [ F s=3 ], P>=0.5 [ F s=2 ])", engine="exact") == Fraction(1, 6)
    assert ask('multi(R{"try"}min=? [ C ], P>=1/3 [ F s=2 ])', engine="exact") == Fraction(5, 3)
    assert ask("multi(Pmax=? [ F s=2 ], Pmin=? [ F s=1 ])", engine="exact") == [
        (Fraction(3, 5), Fraction(2, 5)),
        (0, 0),
    ]
    assert ask('multi(R{"loop"}max=? [ C ], P>=1 [ F (s=1|s=2) ])', engine="exact") == inf
    assert isnan(ask("multi(Pmax=? [ F s=3 ], P>=0.7 [ F s=2 ])", engine="exact"))


@pytest.mark.parametrize("engine", ["exact", "explicit", "hybrid"])
def test_bounds_that_are_met_just_so(engine):
    assert ask("multi(P>=0.6 [ F s=2 ], P>=0.4 [ F s=1 ])", engine=engine) is True
    assert ask("multi(P>=0.6 [ F s=2 ], P>=0.4000000000001 [ F s=1 ])", engine=engine) is False
    assert (
        ask("multi(P>=0.1 [ F s=2 ], P>=1/6 [ F s=1 ], P>=11/15 [ F s=3 ])", engine=engine) is True
    )
    assert (
        ask(
            "multi(P>=0.1 [ F s=2 ], P>=1/6 [ F s=1 ], P>=0.73333333333334 [ F s=3 ])",
            engine=engine,
        )
        is False
    )


def test_results_say_that_they_are_proved():
    result = check_text(engine_of(FORK), "multi(Pmax=? [ F s=3 ], P>=0.5 [ F s=2 ])")
    assert result.accuracy == Exact(rounding=True)
    assert "proved" in result.runs[-1].explanation


def test_rewards_in_components_that_exclude_each_other():
    # Either loop may be entered, not both for certain; each pays one of the objectives for ever.
    model = """mdp
    module m
      s : [0..2];
      [] s=0 -> (s'=1);
      [] s=0 -> (s'=2);
      [one] s=1 -> true;
      [two] s=2 -> true;
    endmodule
    rewards "one" [one] true : 1; endrewards
    rewards "two" [two] true : 1; endrewards
    """
    for engine in ("exact", "explicit"):
        assert ask('multi(R{"one"}>=7 [ C ], R{"two"}>=7 [ C ])', model, engine) is True
        assert ask('multi(R{"one"}>=7 [ C ], P>=1 [ F s=2 ])', model, engine) is False


@pytest.mark.parametrize("engine", ["sparse", "hybrid", "mtbdd"])
def test_engines_on_diagrams(engine):
    assert ask("multi(Pmax=? [ F s=3 ], P>=0.5 [ F s=2 ])", engine=engine) == pytest.approx(
        1 / 6, abs=1e-9
    )


@pytest.mark.parametrize(
    "text",
    [
        "multi(P>0.5 [ F s=1 ], P>=0.1 [ F s=2 ])",
        "multi(S>0.5 [ s=1 ], P>=0.1 [ F s=2 ])",
        "multi(T=? [ F s=1 ], P>=0.1 [ F s=2 ])",
        "multi(Tmin=? [ G s=1 ], P>=0.1 [ F s=2 ])",
        'multi(R{"try"}max=? [ I=3 ], P>=0.1 [ F s=2 ])',
        'multi(R{"try"}max=? [ C discount=0.5 ], P>=0.1 [ F s=2 ])',
        "multi(s=1, P>=0.1 [ F s=2 ])",
    ],
)
def test_wrong_objectives(text):
    with pytest.raises((InputError, UnsupportedError)):
        ask(text)


def test_unsupported_objectives():
    with pytest.raises(UnsupportedError, match="C, C<=k, S and F states"):
        ask('multi(R{"try"}max=? [ F (s=3 & X s=3) ], P>=0.1 [ F s=2 ])')
    with pytest.raises(UnsupportedError, match="of its own"):
        ask("!multi(P>=0.1 [ F s=1 ], P>=0.1 [ F s=2 ])")
    with pytest.raises(InputError):
        ask("multi(P>=0.1 [ F s=1 ], P>=0.1 [ F s=2 ])", FORK.replace("mdp", "dtmc", 1))


@SLOW
@given(
    seed=st.integers(0, 2**20),
    direction=st.sampled_from(["min", "max"]),
    path=st.sampled_from(["F {0}", "G F {0}", "F G {0}", "F<=3 {0}"]),
)
def test_a_single_objective_is_the_usual_measure(seed, direction, path):
    engine = random_engine(seed)
    query = path.format('"a"')
    want = check_text(engine, f"P{direction}=? [ {query} ]").value
    assert check_text(engine, f"multi(P{direction}=? [ {query} ])").value == pytest.approx(
        want, abs=1e-6
    )


@SLOW
@given(
    seed=st.integers(0, 2**20),
    direction=st.sampled_from(["min", "max"]),
    query=st.sampled_from(["C", "C<=4"]),
)
def test_a_single_reward_is_the_usual_measure(seed, direction, query):
    engine = random_engine(seed)
    want = check_text(engine, f"R{direction}=? [ {query} ]").value
    assert check_text(engine, f"multi(R{direction}=? [ {query} ])").value == pytest.approx(
        want, rel=1e-5, abs=1e-8
    )


def strategies(matrix, targets, start):
    """Reachability of absorbing targets under every memoryless deterministic strategy."""
    groups = matrix.groups
    dense = np.zeros((matrix.rows, matrix.states))
    for r in range(matrix.rows):
        span = slice(matrix.indptr[r], matrix.indptr[r + 1])
        dense[r, matrix.indices[span]] += matrix.data[span]
    for rows in product(*(range(groups[s], groups[s + 1]) for s in range(matrix.states))):
        chain = dense[list(rows)]
        x = np.array([np.array(t, dtype=float) for t in targets]).T
        known = x.copy()
        for _ in range(4000):
            y = np.maximum(chain @ x, known)
            if np.abs(y - x).max() < 1e-13:
                break
            x = y
        yield x[start]


def absorbing(rng, n, targets=2):
    """A random MDP; the last states are absorbing."""
    lines = ["mdp", "module m", f"  s : [0..{n + targets - 1}];"]
    for s in range(n):
        for _ in range(rng.choice((1, 2, targets))):
            p = rng.choice((0.25, 0.5, 0.75))
            first, second = rng.sample(range(n + targets), 2)
            lines.append(f"  [] s={s} -> {p}:(s'={first}) + {1 - p}:(s'={second});")
    return "\n".join([*lines, f"  [] s>={n} -> true;", "endmodule"])


@SLOW
@given(seed=st.integers(0, 2**20))
def test_pareto_curve_against_all_strategies(seed):
    rng = Random(seed)
    n = rng.randint(2, 4)
    engine = engine_of(absorbing(rng, n))
    columns = engine.explored.states.column(0)
    points = list(
        strategies(engine.matrix, [columns == n, columns == n + 1], int(engine.explored.initial[0]))
    )
    curve = check_text(engine, f"multi(Pmax=? [ F s={n} ], Pmax=? [ F s={n + 1} ])").value
    for angle in np.linspace(0, np.pi / 2, 13):
        weights = np.array([np.cos(angle), np.sin(angle)])
        assert max(weights @ np.array(p) for p in curve) == pytest.approx(
            max(weights @ p for p in points), abs=1e-6
        )
    for point in curve:  # corners are what some strategy without memory and chance achieves
        assert min(np.abs(np.array(point) - p).max() for p in points) < 1e-6
    bound = float(max(p[1] for p in points)) / 2
    best = check_text(engine, f"multi(Pmax=? [ F s={n} ], P>={bound!r} [ F s={n + 1} ])").value
    hull = max(
        (p[0] if p[1] >= bound else q[0] + (p[0] - q[0]) * (bound - q[1]) / (p[1] - q[1]))
        for p in points
        for q in points
        if q[1] >= bound
    )
    assert best == pytest.approx(hull, abs=1e-6)


@SLOW
@given(seed=st.integers(0, 2**20), engine=st.sampled_from(["explicit", "exact", "doubles"]))
def test_front_of_three_objectives_against_all_strategies(seed, engine):
    rng = Random(seed)
    n = rng.randint(2, 3)
    text = absorbing(rng, n, 3)
    explored = engine_of(text)
    columns = explored.explored.states.column(0)
    points = list(
        strategies(
            explored.matrix,
            [columns == n + i for i in range(3)],
            int(explored.explored.initial[0]),
        )
    )
    objectives = ", ".join(f"Pmax=? [ F s={n + i} ]" for i in range(3))
    with patch.object(tuning, "PROVED_EQUATIONS", 0 if engine == "doubles" else 300):
        result = check_text(
            engine_of(text, engine.replace("doubles", "explicit")), f"multi({objectives})"
        )
    assert isinstance(result.accuracy, Estimate if engine == "doubles" else Exact)
    front = np.array(result.value, dtype=float)
    for weights in np.random.default_rng(seed).dirichlet([0.5] * 3, 40):
        assert (front @ weights).max() == pytest.approx(max(points @ weights), abs=1e-6)
    for point in front:
        assert min(np.abs(point - p).max() for p in points) < 1e-6
        others = front[np.abs(front - point).max(axis=1) > 0]
        assert not (others >= point - 1e-9).all(axis=1).any()
    for h in result.front.halfspaces:
        weights = np.array(h.weights, dtype=float)
        assert (front @ weights).max() == pytest.approx(float(h.bound), abs=1e-9)


TINY_PROBABILITIES = """mdp
module m0
  x0 : [0..2] init 1;
  [] y0=0 -> 0.5 : (x0'=min(x0+1,2)) + 0.5 : (x0'=max(x0-1,0));
  [] true -> 1e-9 : (x0'=max(x0-1,0)) + 1e-6 : (x0'=1) + 1-1e-9-1e-6 : (x0'=2);
endmodule
module m1
  y0 : [0..1] init 0;
  y1 : [0..1] init 0;
  [] y0>=1 -> 0 : (y0'=mod(y0+1,2)) + 1 : (y1'=min(y1+1,1));
  [go] z0!=0 -> (y0'=1);
  [go] y1<=1 -> (y0'=max(y0-1,0));
  [] x0=0 -> (y0'=max(y0-1,0));
endmodule
module m2
  z0 : [0..1] init 0;
  [] z0!=1 -> (z0'=max(z0-1,0));
  [go] true -> 1e-12 : (z0'=max(z0-1,0)) + 0.5 : (z0'=max(z0-1,0)) + 0.5-1e-12 : (z0'=mod(z0+1,2));
  [] y1>=1 -> 1e-12 : (z0'=min(z0+1,1)) + 1-1e-12 : (z0'=min(z0+1,1));
  [] z0>=1 -> (z0'=max(z0-1,0));
endmodule
rewards "c" true : 1; [go] true : 1; endrewards
"""
"""HiGHS takes its bounded linear program for unbounded, unless presolve is off."""


@pytest.mark.parametrize("engine", ["explicit", "exact"])
def test_a_program_beside_tiny_probabilities_is_not_taken_for_unbounded(engine):
    model = symcheck.loads(TINY_PROBABILITIES, engine=engine)
    value = model.check('multi(R{"c"}min=? [ S ], P>=0.5 [ F "init" ])').value
    assert value == pytest.approx(1, abs=1e-7)


def test_a_coordinate_that_underflows_is_not_0() -> None:
    text = """mdp module m s:[0..4];
    [a] s=0 -> 1e-200:(s'=1) + 1-1e-200:(s'=3);
    [b] s=0 -> 1e-150:(s'=4) + 1-1e-150:(s'=3);
    [] s=1 -> 1e-200:(s'=2) + 1-1e-200:(s'=3);
    [] s>1 -> true; endmodule"""
    model = symcheck.loads(text)
    points = model.check("multi(Pmax=? [ F s=2 ], Pmax=? [ F s=4 ])").value
    assert isinstance(points, list)
    assert sorted(points) == [(0.0, 1e-150), (Fraction("1e-400"), 0.0)]
