"""Check a model that exceeds a limit of memory: on two workers, and with large arrays in files.

python benchmarks/memory_limits.py [MODEL PROPERTY [CONSTANTS]] [--limit MB] [--file-limit MB]
    [--folder DIR] [--ways plain limit workers files]

The model is checked by the explicit engine without a limit (plain), with a limit of the data of the
process, which ends the run (limit), on two Dask workers of this limit (workers), and with
`-workdir` and another limit (files). Each line has the wall time, and for each process its
processor time and the peaks of its resident memory and of the private part of it: pages of files
are not private, and the system writes them to the disk when it needs their memory. Values agree if
their bounds overlap.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from time import monotonic

CROWDS = Path(__file__).resolve().parent.parent / "models" / "crowds" / "crowds.pm"
COUNTERS = """mdp
const int N;
module a x:[0..N]; [] x<N -> 0.5:(x'=x+1)+0.5:true; [] x>0 -> 0.9:(x'=x-1)+0.1:true; endmodule
module b y:[0..N]; [] y<N -> 0.5:(y'=y+1)+0.5:true; [] y>0 -> 0.8:(y'=y-1)+0.2:true; endmodule
module c z:[0..N]; [] z<N -> 0.25:(z'=z+1)+0.75:true; endmodule
module d w:[0..N]; [] w<N -> 0.25:(w'=w+1)+0.75:true; endmodule
"""


@dataclass
class Usage:
    """What a process has used: seconds of processor time, and peaks of memory in MB."""

    pid: int
    processor: float = 0.0
    resident: float = 0.0
    private: float = 0.0

    def sample(self) -> None:
        """Read the state of the process, if it runs."""
        try:
            times = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
        except OSError:
            return
        fields = dict(line.split(":", 1) for line in lines)
        if "RssAnon" not in fields:  # it has ended
            return
        self.processor = (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")
        self.resident = max(self.resident, int(fields["VmHWM"].split()[0]) / 1000)
        self.private = max(self.private, int(fields["RssAnon"].split()[0]) / 1000)

    def __str__(self) -> str:
        return f"{self.processor:.1f} s, {self.resident:.0f} MB, {self.private:.0f} MB private"


@dataclass
class Watch:
    """Samples of some processes."""

    processes: list[Usage]
    seconds: float = 0.0
    _end: Event = field(default_factory=Event)

    def run(self) -> None:
        while not self._end.wait(0.02):
            for process in self.processes:
                process.sample()

    @staticmethod
    @contextmanager
    def over(pids: Sequence[int]) -> Iterator[Watch]:
        """Sample processes until the context ends."""
        watch = Watch([Usage(pid) for pid in pids])
        thread, started = Thread(target=watch.run), monotonic()
        thread.start()
        try:
            yield watch
        finally:
            watch._end.set()
            thread.join()
            watch.seconds = monotonic() - started

    def __str__(self) -> str:
        return f"{self.seconds:6.1f} s wall; " + "; ".join(map(str, self.processes))


def one_process(words: Sequence[str], limit: int | None) -> tuple[Watch, list[tuple[float, float]]]:
    """A run of the command line with a limit of data in MB; bounds, or none with its message."""

    def restrict() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (limit * 10**6, limit * 10**6))

    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "results.json")
        with open(Path(folder, "errors"), "w+") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "symcheck", *words, "-ex", "-exportresults", str(table)],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                preexec_fn=restrict,
            )
            with Watch.over([process.pid]) as watch:
                status = process.wait()
            errors.seek(0)
            if status:
                print(f"status {status}: {errors.read().strip()}")
                return watch, []
        return watch, [(row["lower"], row["upper"]) for row in json.loads(table.read_text())]


def two_workers(
    model: str, formulas: Sequence[str], constants: str | None, limit: int
) -> tuple[Watch, list[tuple[float, float]]]:
    """The states partitioned over two workers with a limit in MB."""
    from distributed import Client, LocalCluster

    import symcheck
    from symcheck.distributed import explore_on_cluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    found = []
    with (
        LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            memory_limit=limit * 10**6,
            dashboard_address=":0",
        ) as cluster,
        Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        with Watch.over([*pids, os.getpid()]) as watch:
            distributed = explore_on_cluster(symcheck.load(model, constants), client)
            for formula in formulas:
                result = distributed.check(formula)
                assert result.bounds is not None
                print(f"{formula}: {result.explanation}")
                found.append(result.bounds)
        assert sorted(pids) == sorted(client.run(os.getpid).values()), "a worker was restarted"
        print(f"{distributed!r}, {distributed.ghosts:,} ghosts")
    return watch, found


def main() -> None:
    """Print a line for each way, and whether all bounds overlap."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("model", nargs="?", default=str(CROWDS), help="a file, or 'counters'")
    parser.add_argument("properties", nargs="?", default="P=? [ F observed0>1 ]")
    parser.add_argument("constants", nargs="?", default="TotalRuns=7,CrowdSize=19")
    parser.add_argument("--limit", type=int, default=2000, help="MB of data of a process")
    parser.add_argument("--file-limit", type=int, default=1000, help="the same, with -workdir")
    parser.add_argument("--folder", help="of the files (default: a temporary one)")
    ways = ("plain", "limit", "workers", "files")
    parser.add_argument("--ways", nargs="+", choices=ways, default=ways)
    a = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory(dir=a.folder) as folder:
        if a.model == "counters":
            a.model = str(Path(folder, "counters.nm"))
            Path(a.model).write_text(COUNTERS)
        words = [a.model, "-pf", a.properties, "-const", a.constants]
        for way in a.ways:
            match way:
                case "plain":
                    watch, found = one_process(words, None)
                case "limit":
                    watch, found = one_process(words, a.limit)
                case "workers":
                    watch, found = two_workers(
                        a.model, a.properties.split(";"), a.constants, a.limit
                    )
                case _:
                    watch, found = one_process([*words, "-workdir", folder], a.file_limit)
            print(f"{way}: {watch}; bounds {found}", flush=True)
            results += [found] if found else []
    agree = all(
        max(low for low, _ in bounds) <= min(high for _, high in bounds)
        for bounds in zip(*results, strict=True)
    )
    print("all bounds overlap" if agree else "the bounds contradict each other")


if __name__ == "__main__":
    main()
