"""Greatest probabilities and least rewards of distributed MDPs in which a strategy may stay in an end
component, whose states may belong to several parts.
"""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

import symcheck
from in_process_cluster import cluster
from symcheck.distributed import explore_on_cluster, parts, tuning
from symcheck.errors import ResourceError

ROUND = """mdp  // a walk around a ring for nothing, which may be left at a cost, with a risk
const int N = 40;
module ring x : [0..N+1];
  [] x<N -> (x'=mod(x+1, N));
  [leave] x<N & mod(x, 7)=3 -> x/100 : (x'=N) + 0.2 : (x'=N+1) + 0.8-x/100 : (x'=0);
  [again] x=N+1 -> 0.5 : (x'=0) + 0.5 : (x'=N);
  [stop] x=N+1 -> true;
endmodule
rewards [leave] true : 1; [again] true : 5; endrewards"""


@pytest.fixture(autouse=True)
def no_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "limit_worker", lambda: None)


def assert_exact_values_are_within_bounds(text: str, workers: int, *formulas: str) -> None:
    exact = symcheck.loads(text, exact=True)
    distributed = explore_on_cluster(symcheck.loads(text), cluster(workers))
    for formula in formulas:
        expected, bounds = exact.check(formula).value, distributed.check(formula).bounds
        assert not isinstance(expected, str)
        assert bounds is not None
        assert bounds[0] <= expected <= bounds[1], formula
        assert bounds[0] == bounds[1] or bounds[1] - bounds[0] <= 1.01e-6 * bounds[1], formula


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_walk_that_may_go_on_for_ever(workers: int) -> None:
    """It is left by the choice with the least cost, or with the greatest probability."""
    probabilities = ("Pmax=? [ x<=N U x=N ]", "Pmin=? [ x<=N U x=N ]", "Pmax=? [ G x!=N ]")
    rewards = ("Rmin=? [ F x=N ]", "Rmin=? [ F x>=N ]")
    assert_exact_values_are_within_bounds(ROUND, workers, *probabilities, *rewards)


def test_values_that_converge_slowly_in_components_only() -> None:
    """The guess of an upper bound is not proved before that of the component is."""
    text = """mdp module m x : [0..3];
        [] x<2 -> (x'=1-x); [leave] x=0 -> 0.01 : (x'=3) + 0.99 : (x'=2); [back] x=2 -> (x'=0);
        endmodule rewards [leave] true : 1; [back] true : 0.5; endrewards"""
    assert_exact_values_are_within_bounds(text, 2, "Rmin=? [ F x=3 ]")


@pytest.mark.parametrize("workers", [2, 3])
def test_components_behind_states_that_are_solved_once(workers: int) -> None:
    """The equations of an end component have several solutions, so it is not solved on its part."""
    text = """mdp module m x : [0..60]; back : bool;
        [] x<20 & !back -> 0.5 : (x'=x+1) + 0.5 : (x'=x+2);
        [stay] (x=20 | x=21) & !back -> (x'=41-x);
        [go] (x=20 | x=21) & !back -> 0.5 : (x'=40) + 0.3 : (x'=60) + 0.2 : (back'=true);
        [] x>21 & x<60 & !back -> 0.9 : (x'=x+1) + 0.05 : (x'=x-1) + 0.05 : (back'=true);
        endmodule rewards [go] true : 3; [] x>21 : 1; endrewards"""
    assert_exact_values_are_within_bounds(
        text, workers, "Pmax=? [ F x=60 ]", "Rmin=? [ F x=60 | back ]"
    )


@pytest.mark.parametrize("seed", range(60))
def test_random_end_components(seed: int) -> None:
    rng = Random(seed)
    formulas = ['Pmax=? [ F "end" ]', 'Rmin=? [ F "end" ]', 'Rmax=? [ F "end" ]']
    assert_exact_values_are_within_bounds(random_mdp(rng), rng.choice((2, 3)), *formulas)


def random_mdp(rng: Random) -> str:
    """Choices that lead to and fro between near states, a third of which cost something."""
    n, commands, costs = rng.randint(4, 30), [], []
    for state in range(n - 1):
        for choice in range(rng.randint(1, 3)):
            first, second = (max(0, min(n, state + rng.randint(-3, 3))) for _ in range(2))
            tenths = rng.choice((rng.randint(1, 9), 10))
            update = f"{tenths}/10 : (x'={first}) + {10 - tenths}/10 : (x'={second})"
            commands.append(f"[c{state}_{choice}] x={state} -> {update};")
            if rng.random() < 0.3:
                costs.append(f"[c{state}_{choice}] true : {rng.randint(1, 9)};")
    return f"""mdp module m x : [0..{n}]; {" ".join(commands)} [] x>={n - 1} -> true; endmodule
        rewards {" ".join(costs)} false : 0; endrewards label "end" = x={n};"""


def test_components_survive_losses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The values of components come back from checkpoints."""
    monkeypatch.setattr(tuning, "SAVING_SHARE", 1e9)
    expected = symcheck.loads(ROUND, exact=True).check("Pmax=? [ x<=N U x=N ]").value
    rng = Random(1)
    workers = cluster(3)
    distributed = explore_on_cluster(symcheck.loads(ROUND), workers, checkpoints=tmp_path)
    workers.killed = (rng.random() < 0.02 for _ in range(300))
    bounds = distributed.check("Pmax=? [ x<=N U x=N ]").bounds
    assert workers.deaths > 1
    assert bounds is not None
    assert bounds[0] <= expected <= bounds[1]


def test_choices_that_only_lead_back_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are no reason to send a state to the client."""
    monkeypatch.setattr(tuning, "COMPONENT_STATES", 0)
    text = """mdp module m x : [0..5] init 2;
        [] x>0 & x<5 -> 0.5 : (x'=x+1) + 0.5 : (x'=x-1); [stay] true -> true; endmodule
        rewards [stay] x>5 : 1; endrewards"""
    assert_exact_values_are_within_bounds(text, 3, "Pmax=? [ F x=5 ]", "Rmin=? [ F x=5 | x=0 ]")


def test_end_components_that_are_too_large_for_the_client(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "COMPONENT_STATES", 39)
    distributed = explore_on_cluster(symcheck.loads(ROUND), cluster(2))
    with pytest.raises(ResourceError, match=r"in 40 states, .*\n  hint: check it on one machine"):
        distributed.check("Rmin=? [ F x>=N ]")
