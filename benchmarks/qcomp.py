"""The quantitative verification benchmark set: symcheck beside its peers, in turns in one run.

    python benchmarks/qcomp.py FOLDER                       measure into results/qcomp.jsonl
    python benchmarks/qcomp.py FOLDER --only kanban --limit 20 --tools symcheck "Storm sparse"
    python benchmarks/qcomp.py --summary                    write results/qcomp.md and .png again

FOLDER has a folder for each family, with models, properties and `reference.json`: the instances
(model, props, constants, states) and the known results of their properties. Every property of each
instance is a task. The tools run it one after the other, each in a process of its own, so that load
on the machine meets all of them. Tasks in the file of measurements are not repeated: an interrupted
run goes on. Times and limits are processor seconds (user and system), to which other load adds less
than to wall time. A result is right if its relative error is at most 1e-5, and inaccurate up to
1e-3.

Storm runs if `stormpy` is installed, PRISM if `prism` is on the path. With --skip-larger, a tool
that exceeds a limit is not tried on larger instances of the family with the same property.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from fractions import Fraction
from math import ceil, inf
from pathlib import Path
from typing import Any

from qcomp_summary import write_summary
from whole_runs import RESULTS, STORM, last, measure

import symcheck
from symcheck.errors import SymcheckError
from symcheck.semantics.expressions.literals import format_value

TOOLS = (
    *("symcheck", "Storm sparse", "Storm hybrid", "Storm dd"),
    *("PRISM hybrid", "PRISM sparse", "PRISM mtbdd", "PRISM explicit"),
)
RIGHT, ACCURATE = 1e-3, 1e-5
WALL = 20  # times the limit of processor time: a run may wait for other processes, or sleep


@dataclass(frozen=True)
class Task:
    """A property of an instance.

    formula: the name of the property. states: known number of states. reference: known result.
    """

    family: str
    kind: str
    model: Path
    properties: Path
    constants: str
    formula: str
    states: int | None
    reference: float | bool | None

    @property
    def name(self) -> str:
        shown = f"{self.model.stem} {self.constants}" if self.constants else self.model.stem
        return f"{self.family}: {shown}: {self.formula}"


@dataclass(frozen=True)
class Measurement:
    """A run of a tool. ended: done, time, memory, failed or skipped. seconds: wall time."""

    task: str
    family: str
    formula: str
    kind: str
    tool: str
    ended: str
    verdict: str
    value: str | None
    states: int | None
    seconds: float
    processor: float
    megabytes: int
    limit: float
    date: str
    version: str


def tasks(folder: Path) -> list[Task]:
    """The tasks of a folder, smaller instances of a family first."""
    listed = [t for file in sorted(folder.rglob("reference.json")) for t in _family(file)]
    return sorted(listed, key=lambda t: (t.family, t.states or inf, t.name))


def _family(file: Path) -> Iterator[Task]:
    data = json.loads(file.read_text())
    if data["type"] not in ("dtmc", "ctmc", "mdp"):
        return
    for instance in data["instances"]:
        if instance["props"] is None:
            continue
        properties = file.parent / instance["props"]
        states = instance["states"][-1] if instance["states"] else None
        for asked in symcheck.parse_properties_file(properties).properties:
            yield Task(
                *(file.parent.name, data["type"], file.parent / instance["model"], properties),
                ",".join(f"{n}={format_value(v)}" for n, v in instance["constants"].items()),
                *(str(asked.name), states),
                _known(instance["results"].get(asked.name)),
            )


def _known(result: Any) -> float | bool | None:
    sys.set_int_max_str_digits(0)
    if isinstance(result, dict):
        exact, near = result.get("exact"), result.get("approx")
        return float(Fraction(exact)) if exact else near
    return {"true": True, "false": False}.get(str(result).lower(), result)


def verdict(value: str | None, reference: float | bool | None) -> str:
    """right, inaccurate, wrong, or 'no reference'."""
    if reference is None:
        return "no reference"
    if isinstance(reference, bool):
        return "right" if str(value).lower() == str(reference).lower() else "wrong"
    try:
        number = float(str(value))
    except ValueError:
        return "wrong"
    if number == reference or abs(number - reference) <= ACCURATE * abs(reference) + 1e-14:
        return "right"
    return "inaccurate" if abs(number - reference) <= RIGHT * abs(reference) else "wrong"


def available(tools: Sequence[str]) -> list[str]:
    """The installed ones."""
    there = {
        "symcheck": True,
        "Storm": importlib.util.find_spec("stormpy") is not None,
        "PRISM": shutil.which("prism") is not None,
    }
    return [tool for tool in tools if there[tool.split()[0]]]


def command(task: Task, tool: str) -> list[str]:
    program, _, engine = tool.partition(" ")
    files = [str(task.model), str(task.properties)]
    if program == "Storm":
        words = [sys.executable, "-c", STORM, files[0], task.properties.read_text()]
        return [*words, task.constants, engine.upper(), task.formula]
    constants = ["-const", task.constants] if task.constants else []
    switches = ["-prop", task.formula, *constants]
    if program == "PRISM":
        return ["prism", *files, *switches, f"-{engine}", "-cuddmaxmem", "8g", "-javamaxmem", "8g"]
    return [sys.executable, "-m", "symcheck", *files, *switches, *([engine] if engine else [])]


def run(task: Task, tool: str, limit: float, megabytes: int) -> Measurement:
    """Measure one run."""
    text, ended, wall, processor, peak = measure(
        command(task, tool), WALL * limit, megabytes, ceil(limit)
    )
    value, states = last(text, "Result:"), last(text, "States:")
    if ended == "done" and value is None:
        ended = "failed"
    if ended == "failed" and any(w in text.lower() for w in ("memory", "bad_alloc")):
        ended = "memory"
    return Measurement(
        *(task.name, task.family, task.formula, task.kind, tool, ended),
        verdict(value, task.reference) if ended == "done" else "none",
        value if ended == "done" else text.strip()[-200:] if ended == "failed" else None,
        int(states) if states and states.isdigit() else task.states,
        *(round(wall, 3), round(processor, 3), peak, limit),
        f"{datetime.now(UTC):%Y-%m-%d}",
        symcheck.__version__,
    )


def read(path: Path) -> list[dict[str, Any]]:
    """The measurements of a file; a last line that is cut off is dropped."""
    rows = []
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def measure_all(arguments: argparse.Namespace) -> None:
    """Measure what the file does not have."""
    rows = read(arguments.out)
    arguments.out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    finished = {(row["task"], row["tool"]) for row in rows}
    beaten = {
        (r["family"], r["formula"], r["tool"]) for r in rows if r["ended"] in ("time", "memory")
    }
    with arguments.out.open("a") as file:
        for task in tasks(arguments.folder):
            if arguments.only and not any(text in task.name for text in arguments.only):
                continue
            if task.states is not None and task.states > arguments.max_states:
                continue
            for tool in available(arguments.tools):
                series = (task.family, task.formula, tool)
                if (task.name, tool) in finished or (arguments.skip_larger and series in beaten):
                    continue
                row = run(task, tool, arguments.limit, arguments.memory)
                if row.ended in ("time", "memory"):
                    beaten.add(series)
                file.write(json.dumps(asdict(row)) + "\n")
                file.flush()
                print(f"{row.task}: {tool}: {row.ended} {row.seconds} s {row.verdict} {row.value}")


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--summary", action="store_true", help="only summarise the file")
    parser.add_argument("--out", type=Path, default=RESULTS / "qcomp.jsonl")
    parser.add_argument("--only", nargs="*", help="tasks whose names contain one of these texts")
    parser.add_argument("--tools", nargs="*", default=TOOLS)
    parser.add_argument("--limit", type=float, default=60, help="processor seconds per run")
    parser.add_argument(
        "--memory", type=int, default=16_000, help="megabytes of address space per run"
    )
    parser.add_argument("--max-states", type=float, default=inf, help="leave out larger instances")
    parser.add_argument("--skip-larger", action="store_true")
    arguments = parser.parse_args(words)
    if not arguments.summary:
        if arguments.folder is None or not arguments.folder.is_dir():
            parser.error("name the folder of the benchmark set")
        try:
            measure_all(arguments)
        except SymcheckError as error:
            parser.error(str(error))
    print(write_summary(read(arguments.out), arguments.out))


if __name__ == "__main__":
    main()
