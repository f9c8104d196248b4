"""Check a model within a limit of memory that it exceeds, with its large arrays in files.

python benchmarks/file_arrays.py [--size N] [--limit KILOBYTES] [--folder DIR]

The model, an MDP of four counters from 0 to N, is checked three times: without a limit, with a
limit of data that ends the run, and with this limit and `-workdir`.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MODEL = """mdp
const int N;
module a x:[0..N]; [] x<N -> 0.5:(x'=x+1)+0.5:true; [] x>0 -> 0.9:(x'=x-1)+0.1:true; endmodule
module b y:[0..N]; [] y<N -> 0.5:(y'=y+1)+0.5:true; [] y>0 -> 0.8:(y'=y-1)+0.2:true; endmodule
module c z:[0..N]; [] z<N -> 0.25:(z'=z+1)+0.75:true; endmodule
module d w:[0..N]; [] w<N -> 0.25:(w'=w+1)+0.75:true; endmodule
"""
PROPERTIES = "Pmin=? [ F<=90 x=N & y=N ]; Pmax=? [ F x=N & y=N & z<3 ]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--size", type=int, default=45)
    parser.add_argument("--limit", type=int, default=500_000, help="kilobytes of data")
    parser.add_argument("--folder", help="of the files (default: a temporary one)")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=a.folder) as folder:
        model = Path(folder, "counters.nm")
        model.write_text(MODEL)
        words = [str(model), "-const", f"N={a.size}", "-pf", PROPERTIES, "-ex"]
        for name, limit, more in (
            ("no limit", None, []),
            (f"limit of {a.limit / 1000:g} MB", a.limit, []),
            ("the same limit, in files", a.limit, ["-workdir", folder]),
        ):
            print(f"{name:26}", _run([*words, *more], limit), flush=True)


def _run(words: list[str], limit: int | None) -> str:
    """Times and outcome of one run."""

    def restrict() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (1000 * limit, 1000 * limit))

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.monotonic()
    run = subprocess.run(
        [sys.executable, "-m", "symcheck", *words],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=restrict,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    lines = [line for line in run.stdout.splitlines() if line.startswith(("States", "Result"))]
    return (
        f"{after.ru_utime - before.ru_utime:6.1f} s user {after.ru_stime - before.ru_stime:6.1f} s "
        f"system {time.monotonic() - started:7.1f} s wall  "
        + ("; ".join(lines) if run.returncode == 0 else run.stderr.partition("\n")[0])
    )


if __name__ == "__main__":
    main()
