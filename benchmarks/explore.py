"""Speed and memory of explicit exploration: `python benchmarks/explore.py [MODEL CONSTANTS]…`.

Without arguments, it explores large models of the PRISM benchmark suite and of the quantitative
verification benchmark set, which SYMCHECK_PEERS must name. Each model runs in a process of its own,
and CPU seconds are those of this process. `search` is the breadth-first search, `finish` orders
states and rows, and peak is the largest resident memory.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

CASES = (
    ("prism-benchmarks/dtmcs/crowds/crowds.pm", "TotalRuns=5,CrowdSize=20"),
    ("prism-benchmarks/dtmcs/nand/nand.pm", "N=40,K=4"),
    ("prism-benchmarks/dtmcs/brp/brp.pm", "N=64,MAX=5"),
    ("prism-benchmarks/dtmcs/herman/herman15.pm", ""),
    ("qcomp/ctmc/kanban/kanban.prism", "t=5"),
    ("prism-benchmarks/ctmcs/polling/poll15.sm", ""),
    ("prism-benchmarks/ctmcs/fms/fms.sm", "n=6"),
    ("prism-benchmarks/mdps/firewire_impl_dl/firewire_impl_dl.nm", "deadline=800,delay=3"),
    ("prism-benchmarks/mdps/csma/csma3_4.nm", ""),
    ("prism-benchmarks/mdps/consensus/coin6.nm", "K=8"),
    ("prism-benchmarks/mdps/wlan/wlan6.nm", "COL=0"),
    ("prism-benchmarks/mdps/zeroconf/zeroconf.nm", "reset=false,N=1000,K=8"),
)


def measure(path: str, constants: str) -> dict[str, float]:
    """Explore one model in this process."""
    from symcheck.explicit.build import Exploration
    from symcheck.options import Options
    from symcheck.semantics.binding.bind import bind
    from symcheck.syntax.parse import parse_model_file

    times = [time.process_time()]
    model = bind(parse_model_file(path), dict(c.split("=") for c in constants.split(",") if c))
    exploration = Exploration(model, Options())
    times.append(time.process_time())
    exploration.run()
    times.append(time.process_time())
    result = exploration.finish()
    times.append(time.process_time())
    prepare, search, finish = (b - a for a, b in pairwise(times))
    return {
        "states": len(result.states),
        "transitions": result.matrix.entries,
        "levels": result.levels,
        "prepare": prepare,
        "search": search,
        "finish": finish,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def main(arguments: list[str]) -> None:
    """Print a line per model."""
    if arguments[:1] == ["--one"]:
        print(json.dumps(measure(arguments[1], arguments[2])))
        return
    peers = Path(os.environ.get("SYMCHECK_PEERS", "SYMCHECK_PEERS is not set"))
    given = list(zip(arguments[::2], arguments[1::2], strict=True))
    cases = given or [
        (str(peers / path), constants) for path, constants in CASES if (peers / path).exists()
    ]
    head = f"{'model':38}{'states':>10}{'transitions':>12}{'levels':>7}"
    head += f"{'prepare':>9}{'search':>8}{'finish':>8}"
    print(f"{head}{'M st/s':>8}{'all':>6}{'MB':>6}")
    for path, constants in cases:
        run = subprocess.run(
            [sys.executable, __file__, "--one", path, constants],
            capture_output=True,
            text=True,
            check=False,
        )
        if run.returncode:
            print(f"{Path(path).name} {constants}: {run.stderr.strip().splitlines()[-1]}")
            continue
        r = json.loads(run.stdout)
        speed, overall = (
            r["states"] / max(r["search"], 1e-9) / 1e6,
            r["states"] / (r["prepare"] + r["search"] + r["finish"]) / 1e6,
        )
        print(
            f"{Path(path).stem + ' ' + constants:38.38}{r['states']:10}{r['transitions']:12}"
            f"{r['levels']:7}{r['prepare']:9.3f}"
            f"{r['search']:8.2f}{r['finish']:8.2f}{speed:8.2f}{overall:6.2f}{r['peak']:6.0f}"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
