"""Times of functions of parameters: symcheck and Storm, each in a process of its own.

    python benchmarks/parametric_storm.py [FOLDER]

The folder holds `qcomp/` (see tests/peers_folder.py). A time is that from the text of the model to
the function, without the start of Python and its imports.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [
    str(Path(__file__).parents[1] / "tests"),
    str(Path(__file__).parents[1] / "tests/storm"),
]

LIMIT = 60  # seconds

INSTANCES = [
    ("brp", "N=16,MAX=2"),
    ("brp", "N=64,MAX=4"),
    ("crowds", "TotalRuns=3,CrowdSize=5"),
    ("crowds", "TotalRuns=4,CrowdSize=5"),
    ("nand", "N=5,K=1"),
    ("nand", "N=10,K=2"),
    ("herman", ""),
]


def ours(path: str, constants: str, ranges: str, formula: str) -> float:
    """Seconds of symcheck."""
    import symcheck

    warm = "dtmc const double p; module m x:[0..1]; [] true -> p:(x'=1)+1-p:(x'=0); endmodule"
    symcheck.loads(warm).parametric("p").check("P=? [ F x=1 ]")
    started = time.perf_counter()
    symcheck.load(path, constants).parametric(ranges).check(formula)
    return time.perf_counter() - started


def storms(path: str, constants: str, ranges: str, formula: str) -> float:  # noqa: ARG001
    """Seconds of Storm."""
    from test_parametric import storms_function

    started = time.perf_counter()
    storms_function(Path(path), constants, formula)
    return time.perf_counter() - started


def timed(tool: str, *words: str) -> float | None:
    """Seconds of a tool in a new process; None beyond the limit."""
    command = [sys.executable, __file__, tool, *words]
    try:
        out = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=True)
    except subprocess.TimeoutExpired:
        return None
    return float(json.loads(out.stdout.splitlines()[-1]))


def main() -> None:
    """Print a table of times, and the geometric mean of their quotients."""
    from test_parametric import INSTANCES as FORMULAS
    from test_parametric import opened

    quotients = []
    print(f"{'instance':34}{'symcheck':>10}{'Storm':>10}")
    for family, constants in INSTANCES:
        text, names = opened(family)
        with tempfile.NamedTemporaryFile("w", suffix=".prism") as file:
            file.write(text)
            file.flush()
            ranges = ",".join(f"{n}=0.01:0.99" for n in names)
            words = file.name, constants, ranges, FORMULAS[family][1]
            a, b = (timed(tool, *words) for tool in ("ours", "storms"))
        shown = [f"{x:10.3f}" if x is not None else f"{'>' + str(LIMIT):>10}" for x in (a, b)]
        print(f"{family + ' ' + constants:34}{''.join(shown)}", flush=True)
        quotients.append((a or LIMIT) / (b or LIMIT))
    mean = math.exp(sum(map(math.log, quotients)) / len(quotients))
    print(f"geometric mean of the quotients: {mean:.2f}")


if __name__ == "__main__":
    if len(sys.argv) > 2:
        print({"ours": ours, "storms": storms}[sys.argv[1]](*sys.argv[2:]))
    else:
        main()
