"""A model on local Dask clusters of one worker and of two, and on the explicit engine of a process.

python benchmarks/partitioned.py [MODEL PROPERTY [CONSTANTS]] [--turns N]

Times are wall times of the exploration and of one property; processor time and memory are those of
each worker, and of the process of the client and the scheduler. The explicit engine runs with one
thread, and with as many as it takes by default. They run in turns. At last come the medians of the
wall times of exploration and check, compared.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter, process_time

from distributed import Client, LocalCluster

import symcheck
from symcheck.distributed import explore_on_cluster

CROWDS = Path(__file__).resolve().parent.parent / "models" / "crowds" / "crowds.pm"
PROPERTY = "P=? [ F observed0>1 ]"


def used() -> tuple[float, float]:
    """Processor time of this process, in seconds, and its largest memory, in MB."""
    usage = getrusage(RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def measured(model: symcheck.Model, formula: str, workers: int) -> float:
    """Print a line about a cluster; the wall time of exploration and check."""
    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        client.run(import_parts)
        before, started = client.run(used), process_time()
        distributed = explore_on_cluster(model, client)
        explored, middle = client.run(used), process_time()
        result = distributed.check(formula)
        after, ended = client.run(used), process_time()
        print(
            f"{workers} workers: {distributed.states} states, {distributed.ghosts} ghosts; "
            f"explored in {distributed.rounds} rounds and {distributed.seconds:.1f} s "
            f"(processor {[round(explored[w][0] - before[w][0], 1) for w in after]} s, client "
            f"{middle - started:.1f} s), checked in {result.seconds:.1f} s "
            f"(processor {[round(after[w][0] - explored[w][0], 1) for w in after]} s, client "
            f"{ended - middle:.1f} s), memory "
            f"{[round(m) for _, m in before.values()]} to {[round(m) for _, m in after.values()]} "
            f"MB; {result.value} {result.accuracy}; {result.explanation}",
            flush=True,
        )
        return distributed.seconds + result.seconds


def import_parts() -> None:
    """Import what a worker needs, which takes half a second in each new process."""
    import symcheck.distributed.part  # noqa: F401


def measured_alone(model: symcheck.Model, formula: str, threads: int | None) -> float:
    """Print a line about this process; the wall time of exploration and check."""
    model = model.with_options(threads=threads)
    started, before = perf_counter(), process_time()
    states = model.engine.states
    explored, middle = perf_counter() - started, process_time()
    result = model.check(formula)
    print(
        f"one process, {threads or 'default'} threads: {states} states in {explored:.1f} s "
        f"(processor {middle - before:.1f} s), checked in {result.seconds:.1f} s (processor "
        f"{process_time() - middle:.1f} s), memory {used()[1]:.0f} MB; {result.value} "
        f"{result.accuracy}",
        flush=True,
    )
    return explored + result.seconds


def main() -> None:
    """Print two lines for clusters and two for a single process per turn, and the comparison."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?", default=str(CROWDS))
    parser.add_argument("formula", nargs="?", default=PROPERTY)
    parser.add_argument("constants", nargs="?")
    parser.add_argument("--turns", type=int, default=1)
    given = parser.parse_args()
    crowds = given.model == str(CROWDS) and given.constants is None
    constants = "TotalRuns=6,CrowdSize=20" if crowds else given.constants
    model = symcheck.load(given.model, constants, engine="explicit")
    turns = [
        (
            *(measured(model, given.formula, workers) for workers in (1, 2)),
            *(measured_alone(model, given.formula, threads) for threads in (1, None)),
        )
        for _ in range(given.turns)
    ]
    one, two, alone, threaded = map(median, zip(*turns, strict=True))
    print(
        f"exploration and check: {one:.1f} s on one worker, {two:.1f} s on two, {alone:.1f} s in "
        f"one process with one thread, {threaded:.1f} s with the default. One worker takes "
        f"{one / alone:.2f} and {one / threaded:.2f} times as long as one process; two workers are "
        f"{one / two:.2f} times as fast as one"
    )


if __name__ == "__main__":
    main()
