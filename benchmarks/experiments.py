"""Experiments in one process and in several: 100 instances of crowds, in turns.

python benchmarks/experiments.py [--jobs 2] [--turns 3]

Wall time is that of the whole call, with the start of the processes. Processor time is that of all
processes; on a machine with other load, processor time divided by the number of processes is the
wall time to expect of a quiet one.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter

import symcheck

CROWDS = Path(__file__).resolve().parent.parent / "models" / "crowds"
CONSTANTS = {"TotalRuns": range(2, 7), "CrowdSize": range(1, 21)}


def processor_times() -> tuple[float, float]:
    """Seconds of this process, and of the processes that it has waited for."""
    own, others = getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime, others.ru_utime + others.ru_stime


def measured(jobs: int) -> tuple[float, float, float]:
    """Wall time and processor times of one experiment, in seconds."""
    started, (own, others) = perf_counter(), processor_times()
    rows = symcheck.experiment(
        CROWDS / "crowds.pm", CROWDS / "crowds.pctl", CONSTANTS, jobs=jobs, engine="hybrid"
    )
    wall, (own_end, others_end) = perf_counter() - started, processor_times()
    assert len(rows) == 400
    assert not rows.errors
    return wall, own_end - own, others_end - others


def main() -> None:
    """Print a line for each run, and the ratio of the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    walls: dict[int, list[float]] = {1: [], arguments.jobs: []}
    for _ in range(arguments.turns):
        for jobs, found in walls.items():
            wall, own, others = measured(jobs)
            found.append(wall)
            print(
                f"jobs={jobs}: {wall:6.2f} s wall, {own:6.2f} s of processor time here, "
                f"{others:6.2f} s in other processes"
            )
    ratio = median(walls[arguments.jobs]) / median(walls[1])
    print(f"wall time of {arguments.jobs} processes / of one: {ratio:.2f}")


if __name__ == "__main__":
    main()
