"""Kill workers at random moments of a distributed run, and compare its values with a plain run.

python benchmarks/lost_workers.py [--runs N] [--seed N]

Two workers explore a model and check two properties. A random worker is killed (SIGKILL) at a
random moment of the time that an undisturbed run takes; Dask starts another one. Each second run
has no checkpoints; then a worker is killed early, during the exploration, unless this machine is
faster than before: a check ends with a message if it loses a worker. Otherwise, the values must be
those of the explicit engine, within the bounds.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random
from threading import Timer
from time import perf_counter

from distributed import Client, LocalCluster

import symcheck
from symcheck.distributed import explore_on_cluster
from symcheck.errors import ResourceError

CROWDS = Path(__file__).resolve().parent.parent / "models" / "crowds" / "crowds.pm"
CONSTANTS = {"TotalRuns": 5, "CrowdSize": 14}
PROPERTIES = ("P=? [ F observed0>1 ]", "P=? [ F<=40 observed0>1 ]")

Bounds = tuple[float, float]


class Run:
    """A distributed run, whose phase tells what a kill disturbs.

    Attributes:
        phase: of the run at present.
        seconds: of the exploration, and of all.
    """

    def __init__(self, model: symcheck.Model, client: Client, checkpoints: str | None) -> None:
        self._model, self._client, self._checkpoints = model, client, checkpoints
        self.phase, self.seconds = "exploration", (0.0, 0.0)

    def bounds(self) -> list[Bounds]:
        """The bounds of the properties."""
        started, found = perf_counter(), []
        distributed = explore_on_cluster(self._model, self._client, checkpoints=self._checkpoints)
        explored = perf_counter() - started
        for formula in PROPERTIES:
            self.phase = formula
            result = distributed.check(formula)
            assert result.bounds is not None
            found.append(result.bounds)
        self.phase, self.seconds = "end", (explored, perf_counter() - started)
        return found


def agree(found: Sequence[Bounds], expected: Sequence[Bounds]) -> bool:
    """Whether all bounds overlap, up to rounding, and are as close as requested."""
    return all(
        low <= upper * (1 + 1e-12) and lower <= high * (1 + 1e-12) and high - low <= 1.01e-6 * high
        for (low, high), (lower, upper) in zip(found, expected, strict=True)
    )


@contextmanager
def two_workers() -> Iterator[Client]:
    """A cluster of two workers that have imported symcheck."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        explore_on_cluster(
            symcheck.loads("dtmc module m x : [0..1]; [] true -> true; endmodule"), client
        )
        yield client


def disturbed(run: Run, pid: int, moment: float) -> tuple[list[Bounds] | None, str]:
    """The bounds of a run, a worker of which is killed after some seconds; in which phase.

    The bounds are None if the run ended with a message.
    """
    phases: list[str] = []
    found: list[Bounds] | None

    def kill() -> None:
        phases.append(run.phase)
        os.kill(pid, signal.SIGKILL)

    killer = Timer(moment, kill)
    killer.start()
    try:
        found = run.bounds()
    except ResourceError:
        found = None
    killer.join()
    return found, phases[0]


def main() -> int:
    """Print a line for each run; the status is 1 if one of them has other values."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    rng, ends = Random(asked.seed), Counter[str]()
    model = symcheck.load(str(CROWDS), CONSTANTS, engine="explicit")
    expected = [model.check(formula).bounds or (1.0, 0.0) for formula in PROPERTIES]
    with two_workers() as client:
        undisturbed = Run(model, client, None)
        assert agree(undisturbed.bounds(), expected)
    exploration, whole = undisturbed.seconds
    print(f"undisturbed: {exploration:.2f} s of exploration, {whole:.2f} s", flush=True)
    for number in range(asked.runs):
        saved = bool(number % 2)
        moment = rng.random() * (whole if saved else 0.5 * exploration)
        with tempfile.TemporaryDirectory() as folder, two_workers() as client:
            pid = rng.choice(sorted(client.run(os.getpid).values()))
            started = perf_counter()
            run = Run(model, client, folder if saved else None)
            found, phase = disturbed(run, pid, moment)
            if found is not None:
                end = "the values agree" if agree(found, expected) else "WRONG VALUES"
            else:
                end = "WRONG END" if saved or phase == "exploration" else "a message"
            ends[end] += 1
            print(
                f"{'checkpoints' if saved else 'no checkpoints'}, killed after {moment:.2f} s "
                f"({phase}), ended after {perf_counter() - started:.1f} s: {end}",
                flush=True,
            )
    print(", ".join(f"{count} × {end}" for end, count in ends.items()))
    return 1 if any(end.isupper() for end in ends) else 0


if __name__ == "__main__":
    sys.exit(main())
