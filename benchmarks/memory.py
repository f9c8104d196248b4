"""Peak memory of whole runs on models of more than a million states, by engine of symcheck and
Storm.

    python benchmarks/memory.py      print a table, and write it to benchmarks/results/memory.md
    python benchmarks/memory.py --only crowds --limit 30 --engines symcheck "Storm sparse"

The instances are models of models/, each with one property; the dining philosophers form a larger
ring. Each run is a process of its own, from start-up to the result. Its peak is the largest
resident set that the system reports, including shared libraries. Storm runs if `stormpy` is
installed. The table also has CPU seconds, because memory can be traded for time.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from growth_plots import Run
from whole_runs import MODELS, RESULTS, Family, available, runs, switches

INSTANCES = (
    Family("crowds", "crowds/crowds.pm", 'P=? [ F "exposed" ]', "CrowdSize", (20,), "TotalRuns=5"),
    Family("kanban", "kanban/kanban.sm", 'R{"delivered"}=? [ S ]', "t", (5,)),
    Family(
        "multiplex",
        "multiplex/multiplex.pm",
        "P=? [ F phase=3 & outputs/N<=0.1 ]",
        "N",
        (40, 60),
        "K=2",
    ),
    Family("polling", "polling/polling.sm", "P=? [ !(busy & at=2) U busy & at=1 ]", "N", (16,)),
    Family("dining", "ring", 'R{"acts"}min=? [ F p1=5 ]', "", (9,)),
)
ENGINES = (
    "symcheck",
    "symcheck -h",
    "symcheck -s",
    "symcheck -ex",
    "Storm sparse",
    "Storm hybrid",
    "Storm dd",
)


def ring(philosophers: int) -> str:
    """The model models/dining with any number of philosophers."""
    text = (MODELS / "dining" / "dining.nm").read_text()
    alone = re.sub(r"(?m)^module philosopher[23] = .*\n", "", text).replace(
        "p3", f"p{philosophers}"
    )
    others = [
        f"module philosopher{k} = philosopher1 "
        f"[ p1=p{k}, p2=p{k % philosophers + 1}, p{philosophers}=p{k - 1} ] endmodule"
        for k in range(2, philosophers + 1)
    ]
    return "\n".join([alone, *others, ""])


def table(measured: Sequence[Run], engines: Sequence[str]) -> str:
    """A table of MB and CPU seconds, one line per instance."""
    lines = [
        "| model | states |" + "".join(f" {e} |" for e in engines),
        "|---|---|" + "---|" * len(engines),
    ]
    for name, size in dict.fromkeys((r.family, r.size) for r in measured):
        mine = {r.engine: r for r in measured if (r.family, r.size) == (name, size)}
        states = max((r.states or 0 for r in mine.values()), default=0)
        lines.append(
            f"| {name} {size} | {states:,} |" + "".join(f" {_cell(mine.get(e))} |" for e in engines)
        )
    return "\n".join(lines) + "\n"


def _cell(run: Run | None) -> str:
    if run is None:
        return ""
    return (
        f"{run.megabytes} ({run.processor:.1f} s)"
        if run.ended == "done"
        else f"{run.ended} at {run.megabytes}"
    )


def main() -> None:
    arguments = switches(__doc__, INSTANCES, ENGINES).parse_args()
    engines = available(arguments.engines)
    measured: list[Run] = []
    with tempfile.TemporaryDirectory() as folder:
        for family in (f for f in INSTANCES if f.name in arguments.only):
            if family.model == "ring":
                path = Path(folder) / "ring.nm"
                path.write_text(ring(family.sizes[0]))
                family = Family(family.name, str(path), family.query, "", family.sizes)
            for run in runs([family], engines, arguments.limit, arguments.memory):
                measured.append(run)
                print(json.dumps(asdict(run)), flush=True)
    text = table(measured, engines)
    print(text)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "memory.md").write_text(text)


if __name__ == "__main__":
    main()
