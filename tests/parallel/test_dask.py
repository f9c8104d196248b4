"""A Dask cluster gives the rows of one process, whatever happens to its workers."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import dask
import pytest
from distributed import Client, LocalCluster

import symcheck
from dask_workers import wait_for_workers
from symcheck.cli import main
from symcheck.errors import UsageError
from symcheck.experiments.rows import Row
from symcheck.parallel.dask import connect
from symcheck.parallel.workers import Lost, Workers

CROWDS = str(Path(__file__).parents[2] / "models" / "crowds" / "crowds.pm")
EXPOSED = 'P=? [ F "exposed" ]; P=? [ F observed0>1 ]'
CONSTANTS = {"TotalRuns": range(3, 6), "CrowdSize": range(2, 5)}
TOO_MUCH = "len(bytearray(1 << 30))"

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(
            n_workers=2, threads_per_worker=1, memory_limit="900MB", dashboard_address=":0"
        ) as started,
    ):
        yield started
        # Dask cannot close while it starts workers again.
        with Client(started) as connected:
            wait_for_workers(connected, 2)


@pytest.fixture(scope="module")
def client(cluster: LocalCluster) -> Iterator[Client]:
    with Client(cluster) as connected:
        yield connected


@pytest.fixture(scope="module")
def expected() -> list[object]:
    return table(symcheck.experiment(CROWDS, EXPOSED, CONSTANTS))


def table(rows: symcheck.Experiment) -> list[object]:
    """The rows without their times."""
    return [(r.formula, r.constants, r.value, r.accuracy, r.error, r.states) for r in rows]


def test_a_client_gives_the_rows_of_one_process(client: Client, expected: list[object]) -> None:
    assert table(symcheck.experiment(CROWDS, EXPOSED, CONSTANTS, executor=client)) == expected


def test_a_task_beyond_the_limit_of_memory_fails_and_its_worker_lives(client: Client) -> None:
    before = set(client.run(os.getpid).values())
    with Workers(1, client) as workers, pytest.raises(MemoryError):
        list(workers.completed(eval, [TOO_MUCH]))
    assert set(client.run(os.getpid).values()) == before


def test_a_stopped_experiment_goes_on_with_the_missing_rows(
    client: Client, expected: list[object], tmp_path: Path
) -> None:
    def stop(_: object) -> None:
        raise KeyboardInterrupt

    file = tmp_path / "rows.jsonl"
    arguments = (CROWDS, EXPOSED, CONSTANTS)
    stopped = symcheck.experiment(*arguments, executor=client, resume=file, progress=stop)
    assert not stopped.complete
    before = file.read_text().splitlines()
    assert 1 < len(before) < len(expected)
    assert table(symcheck.experiment(*arguments, executor=client, resume=file)) == expected
    after = file.read_text().splitlines()
    assert after[: len(before)] == before
    assert len(after) == 1 + len(expected)


def test_paths_are_sampled_with_the_same_result(client: Client) -> None:
    die = symcheck.loads(
        "dtmc module m x:[0..2]; [] x=0 -> 0.3:(x'=1)+0.5:true+0.2:(x'=2); endmodule"
    )
    for formula, method, width in (
        ("P=? [ F x=1 ]", "ci", 0.006),
        ("P>0.61 [ F x=1 ]", "sprt", 0.005),
    ):
        here = die.estimate(formula, method=method, width=width, seed=3)
        there = die.estimate(formula, method=method, width=width, seed=3, executor=client)
        assert (here.value, here.accuracy) == (there.value, there.accuracy)


def test_the_command_line_gives_the_output_of_one_process(
    cluster: LocalCluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [CROWDS, "-pf", EXPOSED, "-const", "TotalRuns=3:4,CrowdSize=2:3"]
    results = []
    for more in ([], ["-scheduler", cluster.scheduler_address]):
        assert main([*words, *more, "-exportresults", str(tmp_path / "r.txt")]) == 0
        results.append((tmp_path / "r.txt").read_text())
        assert capsys.readouterr().out.count("Result:") == 8
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-exporttrans", "t.tra"], "-exporttrans has no effect: -scheduler builds the models"),
        (["-step"], "-step has no effect: -scheduler builds the models"),
    ],
)
def test_switches_that_a_cluster_does_not_honour_are_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["-const", "TotalRuns=3,CrowdSize=2", "-scheduler", "tcp://127.0.0.1:1"]
    assert main([CROWDS, *given, *words]) == 2
    assert message in capsys.readouterr().err


def test_a_missing_scheduler_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("symcheck.parallel.tuning.CONNECT_SECONDS", 0.1)
    with pytest.raises(UsageError, match="no Dask scheduler at 'tcp"):
        connect("tcp://127.0.0.1:1")
    with pytest.raises(UsageError, match="no Dask scheduler at 'nowhere'"):
        connect("nowhere")


def test_a_killed_worker_loses_no_row(
    client: Client, expected: list[object], tmp_path: Path
) -> None:
    seen: list[Row] = []

    def kill_once(event: symcheck.Progress) -> None:
        if not seen:
            os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        seen.extend(event.rows)

    rows = symcheck.experiment(
        CROWDS,
        EXPOSED,
        CONSTANTS,
        executor=client,
        progress=kill_once,
        resume=tmp_path / "rows.jsonl",
    )
    assert table(rows) == expected
    assert len(seen) == len(expected)
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 1 + len(expected)


def test_only_the_task_that_kills_every_worker_is_lost(client: Client) -> None:
    with Workers(1, client) as workers:
        tasks = ["1", "__import__('os')._exit(1)", "2"]
        assert dict(workers.completed(eval, tasks)) == {0: 1, 1: Lost(), 2: 2}
