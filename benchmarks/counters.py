"""Counters of work instead of seconds: they detect regressions on a busy machine too.

    python benchmarks/counters.py             print the table, and counters that have grown
    python benchmarks/counters.py --update    record the counters as the new reference

Each case is one property of one model of models/ on one engine.

- states, entries: of the model, and of its matrix
- set_nodes, matrix_nodes, peak_nodes: nodes of the reachable set, of the matrix, live at the peak
- lookups: in CUDD's operation cache, about one per recursive call on diagrams
- unknowns, iterations, work: of the numerical methods; work is their product, summed over the runs
- allocated: the peak memory of numpy and Python, in units of 64 kB
- modules: of symcheck that the command line imports for the smallest model; most of its time

The test in tests/benchmarks fails if a counter exceeds its reference by more than a tenth and by 64
units; modules by 2. Better counters pass: record them, so that the gain is guarded too.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tracemalloc
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import symcheck
from symcheck.engines.symbolic.engine import SymbolicEngine

HERE = Path(__file__).resolve().parent
REFERENCE = HERE / "counters.json"
SLACK, FEW = 1.1, 64
ONE_OR_TWO = 2  # modules
DIE = HERE.parent / "models" / "die" / "die.pm"
IMPORTED = f"""
import sys
before = set(sys.modules)
from symcheck.cli import main
status = main([{str(DIE)!r}, "-pf", "P=? [ F s=7 & d=6 ]"])
print("\\n".join(sorted(set(sys.modules) - before)))
sys.exit(status)
"""

Counters = Mapping[str, int]


@dataclass(frozen=True)
class Case:
    """A model below models/, its constants as on the command line, a property, and engines."""

    model: str
    constants: str
    query: str
    engines: tuple[str, ...]

    def __str__(self) -> str:
        return f"{Path(self.model).stem} {self.constants} {self.query}".replace("  ", " ")


ALL = ("hybrid", "sparse", "mtbdd", "explicit")
SOME = ("hybrid", "sparse", "explicit")
CASES = (
    Case("crowds/crowds.pm", "TotalRuns=4,CrowdSize=8", 'P=? [ F "exposed" ]', ALL),
    Case("multiplex/multiplex.pm", "N=12,K=2", "P=? [ F phase=3 & outputs/N<=0.1 ]", SOME),
    Case("herman/herman9.pm", "", 'filter(max, R{"steps"}=? [ F "stable" ], true)', SOME),
    Case("retransmission/retransmission.pm", "N=16,MAX=3", 'P=? [ F "gave_up" ]', ALL),
    Case("kanban/kanban.sm", "t=2", 'R{"delivered"}=? [ S ]', SOME),
    Case("tandem/tandem.sm", "c=31", "P=? [ true U<=1 waiting=c & served=c ]", SOME),
    Case("polling/polling.sm", "", "P=? [ !(busy & at=2) U busy & at=1 ]", ALL),
    Case("dining/dining.nm", "", 'R{"acts"}min=? [ F "eating" ]', ALL),
    Case("dining/dining.nm", "", 'Pmin=? [ G F "eating" ]', ALL),
    Case("queue/queue.sm", "", "S=? [ n=capacity ]", ALL),
)


def count(case: Case, engine: str) -> dict[str, int]:
    """Run one case, and count."""
    tracemalloc.start()
    try:
        given = (
            dict(pair.split("=") for pair in case.constants.split(",")) if case.constants else {}
        )
        model = symcheck.load(HERE.parent / "models" / case.model, constants=given, engine=engine)
        result = model.check(case.query)
        allocated = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    built = model.engine
    counters = {"states": built.states, "entries": built.transitions}
    if isinstance(built, SymbolicEngine):
        diagrams = built.diagrams
        work = diagrams.manager.statistics()
        counters |= {
            "set_nodes": diagrams.states.node_count,
            "matrix_nodes": diagrams.manager.shared_size(diagrams.roots),
            "peak_nodes": work.peak_live_nodes,
            "lookups": int(work.cache_lookups),
        }
    runs = [run for run in result.runs if run.kind != "graph"]
    return counters | {
        "unknowns": sum(run.unknowns for run in runs),
        "iterations": sum(run.iterations for run in runs),
        "work": sum(run.unknowns * run.iterations for run in runs),
        "allocated": allocated >> 16,
    }


def imported() -> list[str]:
    """The modules that the command line imports to check a property of a model of 13 states."""
    ran = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, text=True, check=True
    )
    lines = ran.stdout.splitlines()
    return lines[next(i for i, line in enumerate(lines) if line.startswith("Result:")) + 1 :]


def measure() -> dict[str, dict[str, int]]:
    """The counters of all cases, by 'model constants, query, engine'."""
    for engine in ALL:  # imports on first use must not be counted
        count(CASES[-1], engine)
    counted = {
        f"{case}, {engine}": count(case, engine) for case in CASES for engine in case.engines
    }
    return counted | {
        "start-up": {"modules": sum(name.partition(".")[0] == "symcheck" for name in imported())}
    }


def grown(now: Mapping[str, Counters], reference: Mapping[str, Counters]) -> list[str]:
    """One line per counter that has grown, and per case or counter that only one side has."""
    lines = []
    for name in sorted(now.keys() | reference.keys()):
        here, there = now.get(name, {}), reference.get(name, {})
        if here.keys() != there.keys():
            lines.append(
                f"{name}: the counters are not those of the reference; record them with --update"
            )
            continue
        for counter, value in here.items():
            if _worse(counter, value, there[counter]):
                lines.append(f"{name}: {counter} was {there[counter]:,} and is {value:,}")
    return lines


def _worse(counter: str, value: int, reference: int) -> bool:
    match counter:
        case "states" | "entries":
            return value != reference
        case "modules":
            return value > reference + ONE_OR_TWO
        case _:
            return value > SLACK * reference + FEW


def show(now: Mapping[str, Counters]) -> str:
    names = list(dict.fromkeys(counter for counters in now.values() for counter in counters))
    rows = [["", *names]] + [
        [case, *(f"{c[n]:,}" if n in c else "" for n in names)] for case, c in now.items()
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(len(names) + 1)]
    return "\n".join(
        "  ".join(
            [
                row[0].ljust(widths[0]),
                *(x.rjust(w) for x, w in zip(row[1:], widths[1:], strict=True)),
            ]
        )
        for row in rows
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--update", action="store_true", help="record what is counted now as the reference"
    )
    arguments = parser.parse_args()
    now = measure()
    print(show(now))
    if arguments.update:
        REFERENCE.write_text(json.dumps(now, indent=1) + "\n")
        return 0
    lines = grown(now, json.loads(REFERENCE.read_text()))
    print("\n".join(lines) or "nothing has grown")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
