"""Time and memory of whole runs against the number of states, for symcheck's engines and Storm's.

    python benchmarks/growth.py          measure into benchmarks/results/growth.csv, draw
    python benchmarks/growth.py --draw   draw again from what was measured
    python benchmarks/growth.py --only kanban --limit 30

The script runs five families of models/ at growing sizes, each with one property (see
`whole_runs.py`). It compares values: a value further than 1e-3 from the others is marked and not
drawn. Exponents are the slopes of log time and log memory over log states, fitted through the runs
that take at least twice as much as the smallest run of the engine. growth.md lists them.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from growth_plots import Run, draw
from whole_runs import ENGINES, RESULTS, Family, available, runs, switches

FAMILIES = (
    Family("kanban", "kanban/kanban.sm", 'R{"delivered"}=? [ S ]', "t", (3, 4, 5, 6, 7)),
    Family(
        "crowds",
        "crowds/crowds.pm",
        'P=? [ F "exposed" ]',
        "CrowdSize",
        (5, 8, 11, 14, 17, 20),
        "TotalRuns=5",
    ),
    Family(
        "multiplex",
        "multiplex/multiplex.pm",
        "P=? [ F phase=3 & outputs/N<=0.1 ]",
        "N",
        (20, 30, 40, 50, 60),
        "K=2",
    ),
    Family(
        "tandem",
        "tandem/tandem.sm",
        "P=? [ true U<=1 waiting=c & served=c ]",
        "c",
        (31, 63, 127, 255, 511),
    ),
    Family(
        "polling",
        "polling/polling.sm",
        "P=? [ !(busy & at=2) U busy & at=1 ]",
        "N",
        (10, 12, 14, 16, 18, 20),
    ),
)


def store(path: Path, rows: Sequence[Run]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Run)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def load(path: Path) -> list[Run]:
    def number(text: str) -> float | None:
        return float(text) if text else None

    with path.open() as file:
        return [
            Run(
                *(
                    r["family"],
                    int(r["size"]),
                    r["engine"],
                    int(r["states"]) if r["states"] else None,
                ),
                *(
                    float(r["seconds"]),
                    float(r["processor"]),
                    int(r["megabytes"]),
                    number(r["value"]),
                    r["ended"],
                ),
            )
            for r in csv.DictReader(file)
        ]


def main() -> None:
    parser = switches(__doc__, FAMILIES, ENGINES)
    parser.add_argument(
        "--draw", action="store_true", help="measure nothing, draw what was measured"
    )
    arguments = parser.parse_args()
    table = RESULTS / "growth.csv"
    RESULTS.mkdir(exist_ok=True)
    kept = load(table) if table.exists() else []
    if not arguments.draw:
        engines = available(arguments.engines)
        chosen = [f for f in FAMILIES if f.name in arguments.only]
        kept = [r for r in kept if r.family not in arguments.only or r.engine not in engines]
        for run in runs(chosen, engines, arguments.limit, arguments.memory):
            kept.append(run)
            print(json.dumps(asdict(run)), flush=True)
            store(table, kept)
    order = {f.name: i for i, f in enumerate(FAMILIES)}
    kept.sort(key=lambda r: (order[r.family], r.size, ENGINES.index(r.engine)))
    store(table, kept)
    draw(kept, RESULTS)


if __name__ == "__main__":
    main()
