"""An experiment of 200 instances on local Dask clusters of one worker and of two, in turns.

Then the experiment is killed in the middle, and resumed.

python benchmarks/cluster.py [--turns 3]

Wall time is that of the call of `symcheck.experiment`; the clusters run before. Processor time is
that of the workers; divided by their number, it is the wall time to expect of a quiet machine.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import signal
import tempfile
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter, sleep

from distributed import Client, LocalCluster

import symcheck

CROWDS = Path(__file__).resolve().parent.parent / "models" / "crowds"
MODEL = (CROWDS / "crowds.pm").read_text().replace("double PF = 0.8", "double PF")
CONSTANTS = {
    "TotalRuns": range(3, 7),
    "CrowdSize": range(3, 13),
    "PF": [0.5, 0.6, 0.7, 0.8, 0.9],
}
ARGUMENTS = (MODEL, CROWDS / "crowds.pctl", CONSTANTS)


def started(workers: int) -> LocalCluster:
    """A cluster whose workers do one task at a time."""
    return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0")


def processor_time() -> float:
    """Seconds of the process of a worker."""
    used = getrusage(RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def measured(client: Client) -> tuple[float, list[float]]:
    """Wall time of one experiment, and processor time of each worker."""
    before = client.run(processor_time)
    start = perf_counter()
    rows = symcheck.experiment(*ARGUMENTS, executor=client, engine="hybrid")
    wall = perf_counter() - start
    assert rows.complete
    assert len(rows) == 800
    assert not rows.errors, rows.errors[0].error
    after = client.run(processor_time)
    return wall, [after[worker] - before[worker] for worker in after]


def run_with(address: str, file: str) -> None:
    """An experiment that writes its rows to a file."""
    with Client(address) as client:
        symcheck.experiment(*ARGUMENTS, executor=client, engine="hybrid", resume=file)


def killed_and_resumed(cluster: LocalCluster, folder: str) -> str:
    """Kill an experiment in the middle and resume it; a sentence about its rows."""
    file = Path(folder) / "rows.jsonl"
    process = get_context("spawn").Process(
        target=run_with, args=(cluster.scheduler_address, str(file))
    )
    process.start()
    while not file.exists() or len(file.read_bytes().splitlines()) < 400:
        sleep(0.01)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    before = file.read_bytes().splitlines(keepends=True)
    computed = []
    with Client(cluster) as client:
        rows = symcheck.experiment(
            *ARGUMENTS,
            executor=client,
            engine="hybrid",
            resume=file,
            progress=lambda event: computed.append(len(event.rows)),
        )
    keys = [json.loads(line)["key"] for line in file.read_bytes().splitlines()[1:]]
    twice = len(keys) - len(set(keys))
    return (
        f"killed after {computed[0]} rows ({len(before) - 1} lines), resumed with "
        f"{sum(computed[1:])} more: {len(rows)} rows, {800 - len(rows)} lost, {twice} twice"
    )


def main() -> None:
    """Print a line for each run, and the ratio of the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    walls: dict[int, list[float]] = {1: [], 2: []}
    with started(1) as one, started(2) as two:
        clusters = {1: one, 2: two}
        for cluster in clusters.values():
            with Client(cluster) as client:
                measured(client)  # workers import symcheck
        for _ in range(arguments.turns):
            for workers, cluster in clusters.items():
                with Client(cluster) as client:
                    wall, used = measured(client)
                walls[workers].append(wall)
                seconds = " + ".join(f"{x:.1f}" for x in used)
                print(f"{workers} workers: {wall:6.2f} s wall, {seconds} s of processor time")
        print(f"wall time of 2 workers / of one: {median(walls[2]) / median(walls[1]):.2f}")
        with tempfile.TemporaryDirectory() as folder:
            print(killed_and_resumed(two, folder))


if __name__ == "__main__":
    main()
