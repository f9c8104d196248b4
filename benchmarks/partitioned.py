"""A model on local Dask clusters of one worker and of two, and on the explicit engine of a process.

python benchmarks/partitioned.py [MODEL PROPERTY [CONSTANTS]]

Times are wall times of the exploration and of one property; processor time and memory are those of
each worker.
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


def measured(model: symcheck.Model, formula: str, workers: int) -> None:
    """Print a line about a cluster."""
    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        before = client.run(used)
        distributed = explore_on_cluster(model, client)
        explored = client.run(used)
        result = distributed.check(formula)
        after = client.run(used)
        print(
            f"{workers} workers: {distributed.states} states, {distributed.ghosts} ghosts; "
            f"explored in {distributed.rounds} rounds and {distributed.seconds:.1f} s "
            f"(processor {[round(explored[w][0] - before[w][0], 1) for w in after]} s), "
            f"checked in {result.seconds:.1f} s "
            f"(processor {[round(after[w][0] - explored[w][0], 1) for w in after]} s), memory "
            f"{[round(m) for _, m in before.values()]} to {[round(m) for _, m in after.values()]} "
            f"MB; {result.value} {result.accuracy}; {result.explanation}",
            flush=True,
        )


def main() -> None:
    """Print a line for each number of workers, and one for a single process."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    given = sys.argv[1:] or [str(CROWDS), PROPERTY, "TotalRuns=5,CrowdSize=15"]
    file, formula, constants = (*given, None)[:3]
    model = symcheck.load(str(file), constants, engine="explicit")
    for workers in (1, 2):
        measured(model, str(formula), workers)
    started, before = perf_counter(), process_time()
    states = model.engine.states
    explored, middle = perf_counter() - started, process_time()
    result = model.check(str(formula))
    print(
        f"one process: {states} states in {explored:.1f} s (processor {middle - before:.1f} s), "
        f"checked in {result.seconds:.1f} s (processor {process_time() - middle:.1f} s), memory "
        f"{used()[1]:.0f} MB; {result.value} {result.accuracy}"
    )


if __name__ == "__main__":
    main()
