"""Compressed rows and block matrices: construction from diagrams, products and memory.

usage: matrix.py [NAME...]    only the instances whose name contains one of the words

The models are those of the PRISM benchmark suite in the folder that SYMCHECK_PEERS names. Times are
the best of five. Products of rows use one thread, products of blocks all threads.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

from symcheck.engines.explicit.engine import SparseOperator
from symcheck.engines.symbolic.forms import HybridEngine
from symcheck.matrices.blocks import flatten
from symcheck.matrices.rows import SparseMatrix
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_model_file

INSTANCES = [
    ("dtmcs/crowds/crowds.pm", "TotalRuns=5,CrowdSize=15"),
    ("dtmcs/nand/nand.pm", "N=40,K=4"),
    ("dtmcs/nand/nand.pm", "N=60,K=4"),
    ("dtmcs/herman/herman15.pm", ""),
    ("ctmcs/kanban/kanban.sm", "t=5"),
    ("ctmcs/kanban/kanban.sm", "t=6"),
    ("ctmcs/cluster/cluster.sm", "N=512"),
    ("ctmcs/tandem/tandem.sm", "c=1023"),
    ("ctmcs/polling/poll15.sm", ""),
    ("mdps/consensus/coin6.nm", "K=2"),
    ("mdps/csma/csma3_4.nm", ""),
]


def best(run: Callable[[], object]) -> float:
    """Seconds of the fastest of five runs, after a warm-up run."""
    run()
    times = []
    for _ in range(5):
        started = perf_counter()
        run()
        times.append(perf_counter() - started)
    return min(times)


def measure(path: Path, constants: str) -> str:
    given = dict(pair.split("=") for pair in constants.split(",")) if constants else {}
    engine = HybridEngine.of(construct(bind(parse_model_file(path), given), Options()))
    system = engine.system(engine.all)
    blocks = system.blocks
    seconds = best(lambda: flatten(system.dag, system.layout))
    rows = SparseOperator(
        SparseMatrix(*flatten(system.dag, system.layout), system.n, system.groups)
    )
    x = np.random.default_rng(1).random(system.n)
    product, stamped = best(lambda: rows.multiply(x)), best(lambda: blocks.multiply(x))
    return (
        f"| {path.stem} {constants} | {system.n:,} | {blocks.entries:,} "
        f"| {blocks.entries / seconds / 1e6:.0f} | {1e3 * product:.1f} | "
        f"{1e3 * stamped:.1f} | {rows.matrix.nbytes / 1e6:.1f} | {blocks.nbytes / 1e6:.2f} |"
    )


def main(words: list[str]) -> None:
    root = Path(os.environ["SYMCHECK_PEERS"]) / "prism-benchmarks"
    print(
        "| model | states | entries | rows written, M entries/s | product of rows, ms "
        "| of blocks, ms | rows, MB | blocks, MB |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, constants in INSTANCES:
        if not words or any(word in f"{name} {constants}" for word in words):
            print(measure(root / name, constants), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
