"""A model on local Dask clusters of one worker and of two, and on the explicit engine of a process.

python benchmarks/partitioned.py [MODEL PROPERTY [CONSTANTS]]

Times are wall times of the exploration and of one property; processor time and memory are those of
each worker, and of the process of the client and the scheduler. The explicit engine runs with one
thread, and with as many as it takes by default. At last come the wall times of exploration and
check, compared.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
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
    """Print a line for each number of workers, two for a single process, and the comparison."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    given = sys.argv[1:] or [str(CROWDS), PROPERTY, "TotalRuns=6,CrowdSize=20"]
    file, formula, constants = (*given, None)[:3]
    model = symcheck.load(str(file), constants, engine="explicit")
    one, two = (measured(model, str(formula), workers) for workers in (1, 2))
    alone, threaded = (measured_alone(model, str(formula), threads) for threads in (1, None))
    print(
        f"exploration and check: one worker takes {one / alone:.2f} times as long as one process "
        f"with one thread, and {one / threaded:.2f} times as long as with the default; two workers "
        f"are {one / two:.2f} times as fast as one"
    )


if __name__ == "__main__":
    main()
