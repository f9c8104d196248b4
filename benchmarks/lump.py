"""Bisimulation on diagrams, on explicit rows, and by Storm on its diagrams: blocks and CPU seconds.

usage: lump.py [NAME...]    only the rows whose name contains one of the words

Models and properties are those of the PRISM benchmark suite in the folder that the environment
variable SYMCHECK_PEERS names, and generated models of identical components. The construction of the
model is not counted for any tool. Each partition runs in a process of its own with a limit of LIMIT
CPU seconds. 'listed' refines materialized rows, for at most 10 million states.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

LIMIT = 60
LISTED = 10_000_000

TASKS = [
    ("crowds 4/10", "dtmcs/crowds/crowds.pm", "positive.pctl", "TotalRuns=4,CrowdSize=10"),
    ("crowds 6/20", "dtmcs/crowds/crowds.pm", "positive.pctl", "TotalRuns=6,CrowdSize=20"),
    ("egl 5/8", "dtmcs/egl/egl.pm", "unfairA.pctl", "N=5,L=8"),
    ("egl 10/2", "dtmcs/egl/egl.pm", "unfairA.pctl", "N=10,L=2"),
    ("egl 10/8", "dtmcs/egl/egl.pm", "unfairA.pctl", "N=10,L=8"),
    ("nand 20/4", "dtmcs/nand/nand.pm", "reliable.pctl", "N=20,K=4"),
    ("herman 13", "dtmcs/herman/herman13.pm", "steps.pctl", ""),
    ("kanban 3", "ctmcs/kanban/kanban.sm", "throughput.csl", "t=3"),
    ("polling 12", "ctmcs/polling/poll12.sm", "s1_before_s2.csl", ""),
    ("cluster 64", "ctmcs/cluster/cluster.sm", "qos1.csl", "N=64,T=1"),
    ("csma 2/4", "mdps/csma/csma2_4.nm", "all_before_max.pctl", ""),
    ("csma 3/4", "mdps/csma/csma3_4.nm", "all_before_max.pctl", ""),
    *(
        (f"alike {n}x{k}", f"{n} {k}", "", "")
        for n, k in ((20, 2), (40, 2), (60, 2), (16, 3), (10, 4), (14, 4))
    ),
]


def alike(components: int, states: int) -> str:
    """A CTMC of identical components: each counts up with increasing rates, and resets to 0."""
    parts = []
    for i in range(components):
        up = "".join(
            f" [] x{i}={s} -> {0.1 * (s + 1)}:(x{i}'={s + 1});\n" for s in range(states - 1)
        )
        down = "".join(f" [] x{i}={s} -> {1.3 * s}:(x{i}'=0);\n" for s in range(1, states))
        parts.append(f"module m{i}\n x{i} : [0..{states - 1}];\n{up}{down}endmodule\n")
    total = " + ".join(f"(x{i}={states - 1}?1:0)" for i in range(components))
    return "ctmc\n" + "".join(parts) + f"rewards\n true : {total};\nendrewards\n"


def files(task: tuple[str, str, str, str], folder: Path) -> tuple[Path, Path]:
    _, model, properties, _ = task
    if properties:
        path = Path(os.environ["SYMCHECK_PEERS"]) / "prism-benchmarks" / model
        return path, path.parent / properties
    components, states = map(int, model.split())
    own, asked = folder / "alike.sm", folder / "alike.csl"
    own.write_text(alike(components, states))
    asked.write_text("R=? [ S ]\n")
    return own, asked


def timed(run: Callable[[], Any]) -> tuple[float, Any]:
    started = process_time()
    result = run()
    return process_time() - started, result


def ours(
    task: tuple[str, str, str, str], path: Path, properties: Path, *, listed: bool
) -> dict[str, Any]:
    from symcheck.check.bisimulation.on_quotient import quotient
    from symcheck.check.context import Context
    from symcheck.engines.symbolic.forms import HybridEngine
    from symcheck.engines.symbolic.materialized import materialize
    from symcheck.options import Options
    from symcheck.semantics.binding.bind import bind, bind_properties
    from symcheck.symbolic.build import construct
    from symcheck.syntax.parse import parse_model_file, parse_properties

    given = dict(pair.split("=") for pair in task[3].split(",")) if task[3] else {}
    program = parse_model_file(path)
    of_model = {c.name for c in program.constants}
    options = Options(engine="hybrid")
    engine: Any = HybridEngine.of(
        construct(bind(program, {k: v for k, v in given.items() if k in of_model}), options)
    )
    if listed and engine.states > LISTED:
        return {"states": engine.states}
    bound = bind_properties(
        parse_properties(properties.read_text()),
        engine.model,
        {k: v for k, v in given.items() if k not in of_model},
    )
    if listed:
        engine = materialize(engine)
    context = Context(engine, options, bound.labels)
    seconds, found = timed(lambda: quotient(context, bound.properties[0].formula))
    way = "" if listed or "on diagrams" in found.cost else " (explicit)"
    return {
        "states": engine.states,
        "blocks": found.engine.states,
        "rounds": found.rounds,
        "seconds": seconds,
        "way": way,
    }


def storm(task: tuple[str, str, str, str], path: Path, properties: Path) -> dict[str, Any]:
    import stormpy
    from stormpy.transformations import perform_bisimulation

    program = stormpy.parse_prism_program(str(path), prism_compatibility=True)
    asked = stormpy.parse_properties(properties.read_text(), program)[:1]
    undefined = {c.name for c in program.constants if not c.defined} | {
        str(c.name) for c in asked[0].get_undefined_constants()
    }
    constants = ",".join(
        pair for pair in task[3].split(",") if pair and pair.split("=")[0] in undefined
    )
    program, asked = stormpy.instantiate_constants(program, constants, asked)
    model = stormpy.build_model(program, asked, engine=stormpy.Engine.DD)
    seconds, found = timed(lambda: perform_bisimulation(model, asked))
    return {"states": model.nr_states, "blocks": found.nr_states, "seconds": seconds}


def one(index: int, who: str) -> None:
    task = TASKS[index]
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))
    with tempfile.TemporaryDirectory() as folder:
        path, properties = files(task, Path(folder))
        found = (
            storm(task, path, properties)
            if who == "storm"
            else ours(task, path, properties, listed=who == "listed")
        )
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(found))


def child(index: int, who: str) -> dict[str, Any]:
    command = [sys.executable, __file__, "--one", str(index), who]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode == -signal.SIGXCPU:
        return {"failed": f"> {LIMIT}"}
    if ended.returncode:
        return {"failed": "failed"}
    found: dict[str, Any] = json.loads(ended.stdout.strip().splitlines()[-1])
    return found


def cell(found: dict[str, Any]) -> str:
    if "failed" in found:
        return str(found["failed"])
    return f"{found['seconds']:.2f}{found.get('way', '')}" if "seconds" in found else ""


def main(words: list[str]) -> None:
    print(
        "| model | states | blocks | rounds | on diagrams, s | MB "
        "| listed, s | Storm, s | MB | blocks |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for index, task in enumerate(TASKS):
        if words and not any(word in task[0] for word in words):
            continue
        own, listed, other = (child(index, who) for who in ("diagrams", "listed", "storm"))
        states = own.get("states", 0)
        about = f"{states:,}" if states < 10**10 else f"{states:.1e}"
        size = f"{own.get('blocks', 0):,}".replace(",", " ")
        print(
            f"| {task[0]} | {about.replace(',', ' ')} | {size} | {own.get('rounds', '')} "
            f"| {cell(own)} | {own.get('memory', 0):.0f} "
            f"| {cell(listed)} | {cell(other)} | {other.get('memory', 0):.0f} "
            f"| {other.get('blocks', '')} |",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(int(sys.argv[2]), sys.argv[3])
    else:
        main(sys.argv[1:])
