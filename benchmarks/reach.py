"""Build time, search time and nodes of the symbolic engine, per model and schedule.

    python benchmarks/reach.py [--only kanban] [--schedule saturation ...] [--order sift]
                               [--limit 30] [--out FILE.jsonl]

The script needs PRISM's benchmark suite in the folder that SYMCHECK_PEERS names (each model with
its models.csv of known numbers of states), and checks the counts. Each run is a process of its own.
With --order sift, `sift` is the time of sifting, and `order` its result. `peak` is the largest
number of live BDD and MTBDD nodes; `memory` is the largest resident set, in MB.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import os
import resource
import time
from collections.abc import Iterator
from pathlib import Path


def instances(peers: Path, only: str) -> Iterator[tuple[Path, str, int]]:
    for table in sorted((peers / "prism-benchmarks").glob("*/*/models.csv")):
        with table.open() as file:
            for row in csv.DictReader(file):
                path = table.parent / row["model_file"]
                if path.exists() and only in f"{path}?{row['model_consts']}":
                    yield path, row["model_consts"], int(row["states"])


def measure(
    path: Path, constants: str, schedule: str | None, order: str | None, limit: float
) -> dict[str, object]:
    from symcheck.errors import SymcheckError
    from symcheck.options import Options
    from symcheck.semantics.binding.bind import bind
    from symcheck.symbolic.build import build
    from symcheck.symbolic.matrix.transitions import transitions
    from symcheck.symbolic.ordering.sifting import SiftedOrder
    from symcheck.symbolic.reachability.search import reach
    from symcheck.syntax.parse import parse_model_file

    result: dict[str, object] = {"model": path.name, "constants": constants}
    given = dict(c.split("=") for c in constants.split(",")) if constants else {}
    options = Options(time_limit=limit, order=tuple(order.split(",")) if order else None)
    times = [time.perf_counter()]
    try:
        model = bind(parse_model_file(path), given)
        times.append(time.perf_counter())
        told: list[object] = []
        symbolic = build(model, options, told.append)
        times.append(time.perf_counter())
        for found in told:
            if isinstance(found, SiftedOrder):
                result |= {"order": ",".join(found.order), "sift": round(found.seconds, 4)}
        space = reach(symbolic, schedule=schedule)
        times.append(time.perf_counter())
        result |= {
            "schedule": space.schedule,
            "states": space.count,
            "nodes": space.states.node_count,
        }
        made = transitions(space, options)
        times.append(time.perf_counter())
        result |= {
            "transitions": made.transition_count,
            "matrix_nodes": symbolic.manager.shared_size(made.roots),
        }
        result["peak"] = symbolic.manager.statistics().peak_live_nodes
    except SymcheckError as error:
        result["error"] = f"{type(error).__name__}: {error}"
    names = ["parse_and_bind", "build", "reach", "matrix"]
    result |= {name: round(b - a, 4) for name, a, b in zip(names, times, times[1:], strict=False)}
    result["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="part of the model's path or constants")
    parser.add_argument(
        "--schedule",
        nargs="*",
        default=[None],
        help="frontier, chaining, saturation; default: the model's",
    )
    parser.add_argument(
        "--order", help="variables from the top down, or force or sift; default: as declared"
    )
    parser.add_argument("--limit", type=float, default=30, help="seconds per run")
    parser.add_argument("--out", type=Path, help="append results here, one JSON object a line")
    arguments = parser.parse_args()
    peers = Path(os.environ["SYMCHECK_PEERS"])
    context = multiprocessing.get_context("spawn")
    for path, constants, states in instances(peers, arguments.only):
        for schedule in arguments.schedule:
            with context.Pool(1) as pool:
                result = pool.apply(
                    measure, (path, constants, schedule, arguments.order, arguments.limit)
                )
            result["right"] = result.get("states") == states
            print(json.dumps(result), flush=True)
            if arguments.out:
                with arguments.out.open("a") as file:
                    file.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
