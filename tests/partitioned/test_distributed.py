"""Models whose states are partitioned over the workers of a Dask cluster.

What the parts compute is tested in `test_parts.py`, in one process.
"""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from threading import Timer
from typing import Never

import pytest
from distributed import Client, LocalCluster

import symcheck
from dask_workers import wait_for_workers
from symcheck.distributed import DistributedModel, explore_on_cluster
from symcheck.errors import ModelFault, ResourceError

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
label "failed" = state=3;"""

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as connected,
    ):
        yield connected


def test_two_workers_have_the_values_of_one_process(client: Client) -> None:
    die = symcheck.load(MODELS / "die" / "die.pm")
    distributed = explore_on_cluster(die.bound, client)
    assert repr(distributed) == "<DistributedModel: dtmc, 13 states, 20 transitions on 2 workers>"
    low, high = distributed.check("P=? [ F d=6 ]").bounds or (1, 0)
    assert low <= 1 / 6 <= high <= low * 1.00001
    low, high = distributed.check('R{"tosses"}=? [ F d>0 ]').bounds or (1, 0)
    assert low <= 11 / 3 <= high <= low * 1.00001


def test_options_are_those_of_the_model(client: Client) -> None:
    text = "dtmc module m x:[0..5]; [] x<5 -> (x'=x+1); endmodule"
    with pytest.raises(ModelFault, match=r"\(x=5\)"):
        explore_on_cluster(symcheck.loads(text, fix_deadlocks=False), client)
    with pytest.raises(ModelFault, match="range"):
        explore_on_cluster(symcheck.loads(text.replace("x<5", "true")), client)


def kill_a_worker(client: Client, after: float) -> Timer:
    """End the process of a worker after some seconds."""
    pid = next(iter(client.run(os.getpid).values()))
    killer = Timer(after, os.kill, (pid, signal.SIGKILL))
    killer.start()
    return killer


def check_for_ever(model: DistributedModel) -> Never:
    while True:
        model.check('P=? [ F "failed" ]')


def test_a_killed_worker_is_an_error_without_checkpoints(client: Client) -> None:
    distributed = explore_on_cluster(symcheck.loads(RETRANSMISSION), client)
    killer = kill_a_worker(client, 0.2)
    with pytest.raises(ResourceError, match="a worker of the cluster is lost"):
        check_for_ever(distributed)
    killer.join()
    wait_for_workers(client, 2)


def test_a_killed_worker_is_replaced_from_checkpoints(client: Client, tmp_path: Path) -> None:
    """The check goes on with the values of its last checkpoint."""
    model = symcheck.loads(RETRANSMISSION)
    formula = 'P=? [ F<=60 "failed" ]'
    expected = model.check(formula).bounds or (1, 0)
    distributed = explore_on_cluster(model, client, checkpoints=tmp_path)
    before = set(client.nthreads())
    killer = kill_a_worker(client, 0.3)
    while set(client.nthreads()) == before:
        low, high = distributed.check(formula).bounds or (1, 0)
        assert low <= expected[1]
        assert expected[0] <= high <= low * 1.00001
    killer.join()
    result = distributed.check(formula)
    assert result.value == pytest.approx(sum(expected) / 2, rel=1e-6)
