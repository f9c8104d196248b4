"""Parts of a model in one process: whatever the number of parts, values are those of the explicit
engine; parts that are lost come back.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import wraps
from itertools import chain, cycle, repeat
from pathlib import Path
from random import Random
from typing import Any
from weakref import ref

import numpy as np
import pytest

import symcheck
from generate import random_model
from in_process_cluster import InProcessCluster, cluster
from symcheck.check.result import Certified, Exact
from symcheck.distributed import DistributedModel, explore_on_cluster, parts, tuning
from symcheck.distributed import iteration as iteration_module
from symcheck.distributed import model as model_module
from symcheck.distributed.iteration import Iteration
from symcheck.distributed.messages import Message
from symcheck.distributed.part import Part
from symcheck.distributed.partition import Partition, choose_partition
from symcheck.distributed.substitution import Substitution
from symcheck.errors import (
    InputError,
    ModelFault,
    NameFault,
    NumericalError,
    OutputError,
    ResourceError,
    UnsupportedError,
    UsageError,
)
from symcheck.explicit.states import StateLayout
from symcheck.semantics.model import BoundModel

MODELS = Path(__file__).parents[2] / "models"

COIN = """mdp  // two processes toss a coin that is a bounded counter
const int K = 3; const int bound = 2*2*K;
global counter : [0..bound] init K*2;
module process1
  p1 : [0..2]; c1 : [0..1];
  [] p1=0 -> 0.5:(c1'=0) & (p1'=1) + 0.5:(c1'=1) & (p1'=1);
  [] p1=1 & c1=0 & counter>0 -> (counter'=counter-1) & (p1'=2) & (c1'=0);
  [] p1=1 & c1=1 & counter<bound -> (counter'=counter+1) & (p1'=2) & (c1'=0);
  [] p1=2 & counter>=2 & counter<=bound-2 -> (p1'=0);
  [stop] p1=2 & (counter<2 | counter>bound-2) -> true;
endmodule
module process2 = process1 [ p1=p2, c1=c2 ] endmodule
rewards "steps" true : 1; endrewards
label "finished" = p1=2 & p2=2 & (counter<2 | counter>bound-2);
label "heads" = p1=2 & p2=2 & counter>bound-2;"""

WALK = """dtmc  // a walk on a line that takes a while
const int N = 10;
module walk x : [0..N] init 5; [] x>0 & x<N -> 0.5:(x'=x+1) + 0.5:(x'=x-1); endmodule
rewards "turns" x=5 : 2; [] true : 1; endrewards"""

RACE = """TYPE  // who is first at the goal? Now and then, nobody moves
const int N = 12;
module first x : [0..N+1];
  [go] x<N & y<N -> 0.4 : (x'=x+1) + 0.5 : (x'=x) + 0.1 : (x'=x+2);
endmodule
module second y : [0..N+1];
  [go] y<N -> 0.45 : (y'=y+1) + 0.55 : (y'=y); [wait] x<N & y<N-1 -> (y'=y+1);
endmodule
rewards "moves" [go] true : 1; x>y & y>3 : 0.5; endrewards"""

QUEUES = """ctmc  // two queues
const int N = 4;
module first a : [0..N];
  [] a<N -> 2 : (a'=a+1); [move] a>0 -> 3 : (a'=a-1); [] a=0 -> 1 : true;
endmodule
module second b : [0..N]; [move] b<N -> 1 : (b'=b+1); [] b>0 -> 1.5 : (b'=b-1); endmodule
rewards "waiting" a>0 : a; [move] true : 0.25; endrewards"""


@pytest.fixture(autouse=True)
def no_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "limit_worker", lambda: None)


def assert_same(model: symcheck.Model, distributed: DistributedModel, *formulas: str) -> None:
    """Sizes and values are those of the explicit engine, within bounds as close as requested."""
    explicit = model.with_options(engine="explicit")
    assert distributed.states == explicit.engine.states
    assert distributed.transitions == explicit.engine.transitions
    for formula in formulas:
        expected, found = explicit.check(formula), distributed.check(formula)
        if isinstance(expected.value, bool):
            assert found.value == expected.value, formula
            continue
        assert expected.bounds is not None
        assert found.bounds is not None
        (low, high), (lower, upper) = found.bounds, expected.bounds
        slack = 1e-12 * max(1.0, abs(lower)) if np.isfinite(lower) else 0.0
        assert low <= upper + slack, formula
        assert lower <= high + slack, formula
        assert high == low or high - low <= 1.01e-6 * max(high, 1e-300) or "G" in formula, formula


def test_a_value_after_steps_that_is_rounded_to_0_or_1_is_not_exact() -> None:
    text = """dtmc module m s:[0..2] init 0;
    [] s<2 -> 1e-200:(s'=s+1) + 1-1e-200:true; [] s=2 -> true; endmodule"""
    distributed = explore_on_cluster(symcheck.loads(text), cluster(2))
    for formula, exact in (
        ("P=? [ F<=2 s=2 ]", Fraction("1e-400")),
        ("P=? [ G<=1 s=0 ]", 1 - Fraction("1e-200")),
    ):
        lower, upper = distributed.check(formula).bounds
        assert lower <= exact <= upper, formula
        assert lower < upper, formula


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_dtmc(workers: int) -> None:
    model = symcheck.loads(WALK)
    formulas = ["P=? [ F x=N ]", "P=? [ x<8 U x=8 ]", "P=? [ F<=100 x=N ]", "P=? [ G x>0 ]"]
    rewards = ["R=? [ F x=0 | x=N ]", "R=? [ F x=0 ]", "R=? [ F x=5 ]", "T=? [ F x=0 | x=N ]"]
    verdicts = ["P>0.4 [ F x=N ]", "P<0.4 [ F x=N ]", "T<=26 [ F x=0 | x=N ]", "R>=1e3 [ F x=0 ]"]
    assert_same(model, explore_on_cluster(model, cluster(workers)), *formulas, *rewards, *verdicts)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_an_mdp(workers: int) -> None:
    model = symcheck.loads(COIN)
    until = ['Pmin=? [ F "heads" ]', 'Pmax=? [ F "finished" ]', 'Pmin=? [ F "finished" ]']
    bounded = ['Pmax=? [ F<=30 "finished" ]', 'Pmin=? [ F<30 "finished" ]', "Pmax=? [ G<=9 p1<2 ]"]
    rewards = ["Rmin=? [ F p1=2 ]", 'Tmin=? [ F "finished" ]', 'Rmax=? [ F "finished" ]']
    verdicts = ['P>=0.1 [ F "heads" ]', 'Pmax<0.2 [ F<=5 "heads" ]', 'P<=0.2 [ F<=9 "heads" ]']
    assert_same(
        model, explore_on_cluster(model, cluster(workers)), *until, *bounded, *rewards, *verdicts
    )


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_ctmc(workers: int) -> None:
    model = symcheck.loads(QUEUES)
    formulas = ["P=? [ b<4 U a=4 ]", "P=? [ F<=2.5 b=3 ]", "P=? [ a<3 U<=1e-3 b=1 ]"]
    more = ["P=? [ F<=0 b=3 ]", "P=? [ G<=2 a<4 ]", "P=? [ F<=20 b=4 ]", "P>=0.5 [ F<=9 b=2 ]"]
    rewards = ["R=? [ F b=2 ]", "T=? [ F b=2 ]", "T=? [ F a=0 & b=1 ]"]
    assert_same(model, explore_on_cluster(model, cluster(workers)), *formulas, *more, *rewards)


@pytest.mark.parametrize("seed", range(40))
def test_random_models(seed: int) -> None:
    rng = Random(f"distributed {seed}")
    kind = rng.choice(("dtmc", "mdp", "ctmc"))
    try:
        model = symcheck.loads(random_model(rng, kind).text)
    except NameFault:
        pytest.skip("a reward for an action that no command has")
    distributed = explore_on_cluster(model, cluster(rng.randint(1, 4)))
    for d in ("min", "max") if kind == "mdp" else ("",):
        assert_same(model, distributed, f'P{d}=? [ F<={rng.randint(0, 9)} "a" ]')
        assert_same(model, distributed, f'P{d}=? [ F "a" ]', f'P{d}=? [ G "a" ]')
        assert_same(model, distributed, f'T{d}=? [ F "a" ]')


# ------------------------------------------------------------------ backward substitution


def race(kind: str) -> symcheck.Model:
    """Without a choice, the second one does not wait."""
    text = RACE.replace("TYPE", kind)
    return symcheck.loads(text if kind == "mdp" else text.replace("[wait] x<N &", "[wait] false &"))


@pytest.mark.parametrize("workers", [2, 3, 5])
@pytest.mark.parametrize(
    ("kind", "direction"), [("dtmc", ""), ("ctmc", ""), ("mdp", "min"), ("mdp", "max")]
)
def test_states_without_cycles_are_solved_once(kind: str, direction: str, workers: int) -> None:
    """A state follows its successors, on whichever part they are; self-loops do not matter."""
    model = race(kind)
    distributed = explore_on_cluster(model, cluster(workers))
    formulas = [f"P{direction}=? [ F x>=N ]", f"P{direction}=? [ G y<N ]"]
    formulas += [f"{r}{direction}=? [ F x>=N | y>=N ]" for r in ("R", "T")]
    assert_same(model, distributed, *formulas)
    for formula in formulas:
        result = distributed.check(formula)
        low, high = result.bounds or (0, 1)
        assert "backward substitution" in result.explanation
        assert 0 < high - low < 1e-11


@pytest.mark.parametrize("share", [tuning.SUBSTITUTION_SHARE, 1e9])
def test_components_within_a_part_are_solved_once(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Components are solved by iteration in an mdp. Bounds that are too wide are not used."""
    monkeypatch.setattr(tuning, "SUBSTITUTION_SHARE", share)
    text = """mdp module stairs stair : [0..60]; step : [0..8];
        [up] stair<60 & step<8 -> 0.5 : (step'=step+1) + 0.4 : (step'=max(0, step-1))
          + 0.05 : (stair'=60) & (step'=0) + 0.05 : true;
        [up] stair<60 & step=8 -> 0.7 : (stair'=stair+1) & (step'=5) + 0.3 : (step'=5);
        [fall] stair<60 & step=4 -> 0.97 : (step'=8) + 0.03 : (stair'=60);
        endmodule rewards [up] step>2 : 1; endrewards"""
    model = symcheck.loads(text)
    distributed = explore_on_cluster(model, cluster(2))
    formulas = [f"P{d}=? [ F stair=60 & step=5 ]" for d in ("min", "max")]
    formulas += [f"R{d}=? [ F stair=60 ]" for d in ("min", "max")]
    assert_same(model, distributed, *formulas)
    methods = {distributed.check(f).explanation.split(";")[1].split(",")[0] for f in formulas}
    assert (methods == {" backward substitution"}) == (share < 1), methods


def test_cycles_over_boundaries_are_iterated_on_solved_states(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The walk to and fro depends on the race; the states of the race are not iterated."""
    text = RACE.replace("TYPE", "dtmc").replace("[wait] x<N & y<N-1", "[wait] false")
    walk = "\nmodule walk z : [0..60] init 30; [] z>0 & z<60 & x=0 & y=0 -> 0.5:(z'=z-1) + 0.5:(z'=z+1); endmodule"
    text = text.replace("[go] x<N & y<N", "[go] (z=0 | z=60) & x<N & y<N") + walk
    model = symcheck.loads(text)
    distributed = explore_on_cluster(model, cluster(3))
    unknown, begin = [], Iteration.begin_phase

    @wraps(begin)
    def begin_phase(iteration: Iteration) -> list[Message]:
        unknown.append(int(iteration.unknown_own.sum()))
        return begin(iteration)

    monkeypatch.setattr(Iteration, "begin_phase", begin_phase)
    assert_same(model, distributed, "P=? [ F x>=N ]")
    assert 0 < sum(unknown[:3]) <= 61


def test_rewards_are_not_negative() -> None:
    model = symcheck.loads(
        "dtmc module m x:[0..1]; [] true -> (x'=1); endmodule rewards true : -1; endrewards"
    )
    with pytest.raises(UnsupportedError, match="negative"):
        explore_on_cluster(model, cluster(2)).check("R=? [ F x=1 ]")


@pytest.mark.parametrize(
    "formula",
    [
        "P=? [ F<=2 G d=0 ]",
        "P=? [ F>=2 d=6 ]",
        "P=? [ X d=6 ]",
        "R=? [ C<=3 ]",
        "S=? [ d=6 ]",
        "P=? [ F P>0 [ F d=6 ] ]",
        "d=6",
    ],
)
def test_other_properties_are_refused(formula: str) -> None:
    die = explore_on_cluster(symcheck.load(MODELS / "die" / "die.pm"), cluster(2))
    with pytest.raises(UnsupportedError, match="a distributed model is checked for"):
        die.check(formula)


def test_an_mdp_needs_a_direction() -> None:
    with pytest.raises((UnsupportedError, InputError), match="Pmin"):
        explore_on_cluster(symcheck.loads(COIN), cluster(2)).check('P=? [ F "heads" ]')


def test_several_initial_states_are_refused() -> None:
    model = symcheck.loads(
        "dtmc module m x:[0..9]; [] x<9 -> 0.5:(x'=x+1) + 0.5:(x'=0); endmodule init x<3 endinit rewards true : 1; endrewards"
    )
    distributed = explore_on_cluster(model, cluster(2))
    for formula in ("P=? [ F<=20 x=9 ]", "P=? [ F x=2 ]", "R=? [ F x=0 ]"):
        with pytest.raises(UnsupportedError, match="one initial state"):
            distributed.check(formula)


def test_estimates_are_not_taken_for_bounds() -> None:
    """A method without bounds is not used, also where there is one part."""
    model = symcheck.loads(WALK, method="power", epsilon=1e-3)
    result = explore_on_cluster(model, cluster(1)).check("P=? [ x>0 U x=N ]")
    assert isinstance(result.accuracy, Certified)
    assert result.accuracy.lower <= 0.5 <= result.accuracy.upper


def test_an_undecided_threshold_is_an_error() -> None:
    model = explore_on_cluster(symcheck.loads(WALK), cluster(2))
    with pytest.raises(NumericalError, match="does not decide"):
        model.check("P>=0.5 [ F x=N ]")


def test_faults_of_the_model_are_told() -> None:
    text = "dtmc module m x:[0..5]; [] x<5 -> (x'=x+1); endmodule"
    with pytest.raises(ModelFault, match=r"\(x=5\)"):
        explore_on_cluster(symcheck.loads(text, fix_deadlocks=False), cluster(2))
    with pytest.raises(ModelFault, match="range"):
        explore_on_cluster(symcheck.loads(text.replace("x<5", "true")), cluster(2))
    with pytest.raises(UsageError, match="no workers"):
        explore_on_cluster(symcheck.loads(text), cluster(0))


def test_accuracies_are_told() -> None:
    die = explore_on_cluster(symcheck.load(MODELS / "die" / "die.pm"), cluster(2))
    result = die.check("P=? [ F d=6 ]")
    assert isinstance(result.accuracy, Certified)
    assert result.accuracy.lower <= 1 / 6 <= result.accuracy.upper
    assert isinstance(die.check("P=? [ F d>0 ]").accuracy, Exact)
    assert repr(die) == "<DistributedModel: dtmc, 13 states, 20 transitions on 2 workers>"


def test_backward_substitution_that_has_not_enough_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The iteration needs less memory, and takes its place on all parts."""

    def fail_once_in_a_while(*arguments: Any) -> Substitution:
        if next(fails):
            raise MemoryError
        return Substitution(*arguments)

    fails = cycle([False, True])
    monkeypatch.setattr(iteration_module, "Substitution", fail_once_in_a_while)
    for text, formulas in (
        (WALK, ["P=? [ F x=N ]", "R=? [ F x=0 | x=N ]"]),
        (COIN, ['Pmin=? [ F "heads" ]', "Rmin=? [ F p1=2 ]"]),
    ):
        model = symcheck.loads(text)
        assert_same(model, explore_on_cluster(model, cluster(2)), *formulas)


# ------------------------------------------------------------------------------- partition


def test_hashes_are_even() -> None:
    rows = np.arange(9000, dtype=np.uint64).reshape(-1, 1)
    counts = np.bincount(Partition(3, ((1 << 64) - 1,)).owners(rows))
    assert counts.min() > 2700


def test_owners_follow_variables_that_change_rarely() -> None:
    text = """dtmc module slow a : [0..99]; [] a<99 & b=0 -> (a'=a+1); endmodule
        module fast b : [0..99]; [] true -> (b'=mod(b+1, 100)); endmodule"""
    model = symcheck.loads(text).bound
    partition = choose_partition(model, 2)
    layout = StateLayout.of(model.variables)
    values = np.arange(100)
    rows = layout.pack([np.repeat(values, 100), np.tile(values, 100)])
    owners = partition.owners(rows).reshape(100, 100)
    assert (owners == owners[:, :1]).all()
    assert 0.3 < owners.mean() < 0.7


def test_owners_follow_blocks_of_values_that_change_by_small_steps() -> None:
    """Most steps of a counter stay in a block."""
    text = """dtmc module counter c : [0..999] init 500; [] true -> 0.5 : (c'=min(999, c+1))
        + 0.5 : (c'=max(0, c-1)); endmodule"""
    model = symcheck.loads(text).bound
    partition = choose_partition(model, 2)
    layout = StateLayout.of(model.variables)
    owners = partition.owners(layout.pack([np.arange(1000)]))
    assert np.count_nonzero(np.diff(owners)) < 10
    assert 400 < np.count_nonzero(owners) < 600


def test_owners_do_not_follow_a_clock() -> None:
    """Of all states that are found at a time, each part owns some."""
    text = """dtmc module timer t : [0..999]; [tick] t<999 -> (t'=t+1);
        [tick] t=999 -> (t'=0); endmodule
        module walk x : [0..99] init 50;
        [tick] true -> 0.5 : (x'=min(99, x+1)) + 0.5 : (x'=max(0, x-1)); endmodule"""
    model = symcheck.loads(text).bound
    partition = choose_partition(model, 2)
    layout = StateLayout.of(model.variables)
    at_one_time = layout.pack([np.full(100, 300), np.arange(100)])
    assert 30 < np.count_nonzero(partition.owners(at_one_time)) < 70


def test_faults_among_the_first_states_are_left_to_the_exploration() -> None:
    text = """dtmc module a x:[0..199]; [] x<199 -> 0.5 : (x'=x+1) + 0.5 : true; endmodule
        module b y:[0..199]; [] true -> (y'=y+1); endmodule"""
    with pytest.raises(ModelFault, match="range"):
        explore_on_cluster(symcheck.loads(text), cluster(2))


# ------------------------------------------------------------------------------- losses


def now_and_then(seed: int, share: float = 0.05, most: int = 12) -> Iterator[bool]:
    """Whether a worker dies before a call: at random, a number of times."""
    rng = Random(seed)
    deaths = 0
    while deaths < most:
        dies = rng.random() < share
        deaths += dies
        yield dies


@pytest.mark.parametrize("seed", range(10))
def test_states_of_lost_workers_are_explored_again(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "ROUND_ENTRIES", 20)
    model = symcheck.loads(COIN)
    workers = cluster(3, now_and_then(seed, 0.15))
    distributed = explore_on_cluster(model, workers)
    workers.killed = iter(())
    assert workers.deaths
    assert_same(model, distributed, 'Pmin=? [ F "heads" ]')


def test_parts_that_begin_anew_leave_their_memory_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """One part has ended its exploration when the other one is lost, before it ends its own."""
    model, whole = symcheck.loads(COIN), cluster(2)
    calls = count_calls(whole)
    explore_on_cluster(model, whole)
    living: dict[int, list[ref[Part]]] = {0: [], 1: []}

    def create(bound: BoundModel, number: int, *more: Any) -> Part:
        assert not [part for part in living[number] if part() is not None]
        part = Part(bound, number, *more[:2])
        living[number].append(ref(part))
        return part

    monkeypatch.setattr(parts, "create_part", create)
    losing = InProcessCluster(["w0", "w1"], chain(repeat(False, len(calls) - 1), [True]), deaths=1)
    assert_same(model, explore_on_cluster(model, losing), 'Pmin=? [ F "heads" ]')
    assert len(living[0]) == 2


def test_workers_that_are_lost_before_they_have_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask would wait for them, since each part is created on a given worker."""
    workers, choose = cluster(3), model_module.choose_partition

    def choose_meanwhile(model: BoundModel, count: int) -> Partition:
        workers.workers = ["w0", "w3", "w4"]
        return choose(model, count)

    monkeypatch.setattr(model_module, "choose_partition", choose_meanwhile)
    model = symcheck.loads(COIN)
    assert_same(model, explore_on_cluster(model, workers), 'Pmin=? [ F "heads" ]')


def test_without_checkpoints_a_loss_ends_a_check() -> None:
    workers = cluster(2)
    distributed = explore_on_cluster(symcheck.loads(COIN), workers)
    workers.killed = chain(repeat(False, 20), [True])
    with pytest.raises(ResourceError, match="a worker of the cluster is lost"):
        distributed.check('Pmin=? [ F "heads" ]')


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("text", "formulas"),
    [
        (COIN, ['Pmin=? [ F "heads" ]', 'Pmax=? [ F<=30 "finished" ]', "Tmin=? [ F p1=2 ]"]),
        (QUEUES, ["P=? [ F<=2.5 b=3 ]", "R=? [ F b=2 ]"]),
        (RACE.replace("TYPE", "mdp"), ["Pmax=? [ F x>=N ]", "Rmin=? [ F x>=N | y>=N ]"]),
    ],
)
def test_checkpoints_survive_losses(
    text: str,
    formulas: list[str],
    seed: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tuning, "ROUND_ENTRIES", 20)
    monkeypatch.setattr(tuning, "SAVING_SHARE", 1e9)
    model = symcheck.loads(text)
    workers = cluster(3, now_and_then(seed))
    distributed = explore_on_cluster(model, workers, checkpoints=tmp_path)
    workers.killed = now_and_then(seed + 100, 0.02, 4)
    assert_same(model, distributed, *formulas)
    assert workers.deaths > 2


@pytest.mark.parametrize(
    ("text", "formula"),
    [(WALK, "P=? [ F<=200 x=N ]"), (RACE.replace("TYPE", "mdp"), "Pmin=? [ F x>=N ]")],
)
def test_a_later_run_goes_on_from_checkpoints(
    text: str, formula: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client dies in a check; the next one does not explore, and needs fewer rounds."""
    monkeypatch.setattr(tuning, "SAVING_SHARE", 1e9)
    model = symcheck.loads(text)
    workers = cluster(2)
    distributed = explore_on_cluster(model, workers, checkpoints=tmp_path)
    calls = count_calls(workers)
    distributed.check(formula)
    whole = len(calls)
    workers.killed = chain(repeat(False, whole * 9 // 10), interrupted())
    with pytest.raises(KeyboardInterrupt):
        distributed.check(formula)
    again = cluster(2)
    resumed = explore_on_cluster(model, again, checkpoints=tmp_path)
    assert resumed.rounds == 0
    calls = count_calls(again)
    assert_same(model, resumed, formula)
    assert len(calls) < 0.7 * whole


def interrupted() -> Iterator[bool]:
    raise KeyboardInterrupt
    yield True


def count_calls(workers: InProcessCluster) -> list[None]:
    """An entry for each call of an actor from now on."""
    seen: list[None] = []

    def count() -> Iterator[bool]:
        while True:
            seen.append(None)
            yield False

    workers.killed = count()
    return seen


def test_an_interrupted_exploration_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "ROUND_ENTRIES", 20)
    model = symcheck.loads(COIN)
    with pytest.raises(KeyboardInterrupt):
        explore_on_cluster(
            model, cluster(2, chain(repeat(False, 12), interrupted())), checkpoints=tmp_path
        )
    fresh = explore_on_cluster(model, cluster(2))
    resumed = explore_on_cluster(model, cluster(2), checkpoints=tmp_path)
    assert resumed.rounds < fresh.rounds
    assert_same(model, resumed, 'Pmin=? [ F "heads" ]')


def test_checkpoints_belong_to_a_model_and_a_number_of_workers(tmp_path: Path) -> None:
    explore_on_cluster(symcheck.loads(COIN), cluster(2), checkpoints=tmp_path / "new")
    with pytest.raises(UsageError, match="another model"):
        explore_on_cluster(symcheck.loads(WALK), cluster(2), checkpoints=tmp_path / "new")
    with pytest.raises(UsageError, match="2 parts"):
        explore_on_cluster(symcheck.loads(COIN), cluster(3), checkpoints=tmp_path / "new")
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="no checkpoints in"):
        explore_on_cluster(symcheck.loads(COIN), cluster(2), checkpoints=tmp_path / "file")


def test_rounds_wait_for_their_turn() -> None:
    model = symcheck.load(MODELS / "die" / "die.pm").bound
    part = Part(model, 0, choose_partition(model, 1))
    assert part.explore([], 0, 0) == []  # no exchange has begun
    part.begin_exchange(3)
    assert part.explore([], 3, 1) == []
    assert part.explore([], 2, 0) == []  # an earlier exchange
    first, second = part.explore([], 3, 0)
    assert [left for left, _ in (first, second)] == [False, False]
    assert part.finish().states == 13


def test_a_part_that_began_anew_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the exchange so far, its ghosts would have other numbers than those of the others."""
    known = iter([True, True, False])  # by the three parts
    begin = Part.begin_exchange

    @wraps(begin)
    def begin_exchange(part: Part, generation: int) -> None:
        if next(known, True):
            begin(part, generation)

    monkeypatch.setattr(Part, "begin_exchange", begin_exchange)
    monkeypatch.setattr(tuning, "RESTART_SECONDS", 0.1)
    model = symcheck.load(MODELS / "die" / "die.pm")
    assert_same(model, explore_on_cluster(model, cluster(3)), "P=? [ F d=6 ]")
