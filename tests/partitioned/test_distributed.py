"""Models whose states are partitioned over workers have the values of the explicit engine."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from random import Random
from threading import Timer
from typing import Never

import numpy as np
import pytest
from distributed import Client, LocalCluster

import symcheck
from generate import random_model
from symcheck.check.result import Certified, Exact
from symcheck.distributed import DistributedModel, explore_on_cluster
from symcheck.distributed.part import owners
from symcheck.errors import ModelFault, NameFault, ResourceError, UnsupportedError
from symcheck.options import Options

MODELS = Path(__file__).parents[2] / "models"

RETRANSMISSION = """dtmc  // N frames, each sent at most MAX times, over channels that lose messages
const int N = 16; const int MAX = 3;
module sender
  frame : [1..N]; tries : [0..MAX]; state : [0..3];  // 1: sent, 2: delivered, 3: end
  [] state=0 & tries<MAX -> 0.9:(state'=1) & (tries'=tries+1) + 0.1:(tries'=tries+1);
  [] state=0 & tries=MAX -> (state'=3);
  [] state=1 -> 0.95:(state'=2) + 0.05:(state'=0);
  [] state=2 & frame<N -> (state'=0) & (frame'=frame+1) & (tries'=0);
endmodule
rewards "sent" state=0 & tries<MAX : 1; endrewards
label "failed" = state=3; label "done" = state=2 & frame=N;"""

CONSENSUS = """mdp  // two processes toss a coin that is a bounded counter
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

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as connected,
    ):
        yield connected


def compare(model: symcheck.Model, client: Client, *formulas: str) -> None:
    """Sizes and values are those of the explicit engine."""
    explicit = model.with_options(engine="explicit")
    distributed = explore_on_cluster(model, client)
    assert distributed.states == explicit.engine.states
    assert distributed.transitions == explicit.engine.transitions
    for formula in formulas:
        expected, found = explicit.check(formula), distributed.check(formula)
        assert expected.bounds is not None
        assert found.bounds is not None
        (low, high), (lower, upper) = found.bounds, expected.bounds
        slack = 1e-12 * max(1.0, abs(lower)) if np.isfinite(lower) else 0.0
        assert low <= upper + slack, formula
        assert lower <= high + slack, formula
        assert high == low or high - low <= 1.01e-6 * max(high, 1e-300) or "G" in formula, formula


def test_die(client: Client) -> None:
    die = symcheck.load(MODELS / "die" / "die.pm")
    properties = ["P=? [ F d=6 ]", "P=? [ F<=4 d=6 ]", "P=? [ G d!=6 ]", 'R{"tosses"}=? [ F d>0 ]']
    compare(die, client, *properties, "P=? [ F s<8 ]", 'R{"tosses"}=? [ F d=6 ]')


def test_retransmission(client: Client) -> None:
    model = symcheck.loads(RETRANSMISSION)
    compare(model, client, 'P=? [ F "failed" ]', 'P=? [ frame<9 U<=40 "failed" ]')
    compare(model, client, 'R{"sent"}=? [ F "failed" | "done" ]')


def test_consensus(client: Client) -> None:
    model = symcheck.loads(CONSENSUS)
    compare(model, client, 'Pmin=? [ F "finished" ]', 'Pmin=? [ F "heads" ]')
    compare(model, client, 'Pmax=? [ F<=30 "finished" ]', 'Pmin=? [ F<=30 "finished" ]')


def test_ctmc(client: Client) -> None:
    model = symcheck.load(MODELS / "queue" / "queue.sm")
    compare(model, client, "P=? [ n<4 U n=4 ]", "P=? [ n<10 U n=10 ]")


@pytest.mark.parametrize("seed", range(8))
def test_random_models(seed: int, client: Client) -> None:
    rng = Random(f"distributed {seed}")
    kind = rng.choice(("dtmc", "mdp"))
    text = random_model(rng, kind).text
    try:
        model = symcheck.loads(text)
    except NameFault:
        pytest.skip("a reward for an action that no command has")
    directions = ("min", "max") if kind == "mdp" else ("",)
    bounded = [f'P{d}=? [ F<={rng.randint(0, 9)} "a" ]' for d in directions]
    compare(
        model, client, *bounded, f'P{directions[0]}=? [ F "a" ]', f'P{directions[0]}=? [ G "a" ]'
    )


def test_the_partition_is_even() -> None:
    counts = np.bincount(owners(np.arange(9000, dtype=np.uint64).reshape(-1, 1), 3))
    assert counts.min() > 2700


def test_bounds_are_proved_and_decided_values_exact(client: Client) -> None:
    die = explore_on_cluster(symcheck.load(MODELS / "die" / "die.pm"), client)
    result = die.check("P=? [ F d=6 ]")
    assert isinstance(result.accuracy, Certified)
    assert result.accuracy.lower <= 1 / 6 <= result.accuracy.upper
    assert isinstance(die.check("P=? [ F d>0 ]").accuracy, Exact)
    assert repr(die) == "<DistributedModel: dtmc, 13 states, 20 transitions on 2 workers>"


@pytest.mark.parametrize(
    "formula", ["P>0.5 [ F d=6 ]", "P=? [ F<=2 G d=0 ]", "P=? [ F>=2 d=6 ]", "P=? [ X d=6 ]"]
)
def test_other_properties_are_refused(formula: str, client: Client) -> None:
    die = explore_on_cluster(symcheck.load(MODELS / "die" / "die.pm"), client)
    with pytest.raises(UnsupportedError, match="a distributed model is checked for"):
        die.check(formula)


def test_faults_of_the_model_are_told(client: Client) -> None:
    text = "dtmc module m x:[0..5]; [] x<5 -> (x'=x+1); endmodule"
    with pytest.raises(ModelFault, match=r"\(x=5\)"):
        explore_on_cluster(symcheck.loads(text, fix_deadlocks=False), client)
    with pytest.raises(ModelFault, match="range"):
        explore_on_cluster(symcheck.loads(text.replace("x<5", "true")), client)


def test_a_bound_model_has_options_of_its_own(client: Client) -> None:
    bound = symcheck.loads("dtmc module m x:[0..5]; [] x<5 -> (x'=x+1); endmodule").bound
    assert explore_on_cluster(bound, client).deadlocks == 1
    with pytest.raises(ModelFault, match=r"\(x=5\)"):
        explore_on_cluster(bound, client, Options(fix_deadlocks=False))


def check_for_ever(model: DistributedModel) -> Never:
    while True:
        model.check('P=? [ F "failed" ]')


def test_a_killed_worker_is_an_error_and_the_next_run_is_right(client: Client) -> None:
    model = symcheck.loads(RETRANSMISSION)
    distributed: DistributedModel = explore_on_cluster(model, client)
    pid = next(iter(client.run(os.getpid).values()))
    killer = Timer(0.2, os.kill, (pid, signal.SIGKILL))
    killer.start()
    with pytest.raises(ResourceError, match="a worker of the cluster is lost"):
        check_for_ever(distributed)
    killer.join()
    client.wait_for_workers(2, timeout=60)
    compare(model, client, 'P=? [ F "failed" ]')
