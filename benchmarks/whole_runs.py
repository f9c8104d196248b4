"""Whole runs from start-up to the result, each a process of its own, for `growth.py`, `memory.py`
and `qcomp.py`.

Storm runs if `stormpy` is installed, with its default precision (a relative change of 1e-6 without
proof); symcheck has a proved precision of 1e-6. An engine that exceeds a limit of time or memory at
one size does not run larger sizes.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from growth_plots import Run

__all__ = [
    *("ENGINES", "MODELS", "RESULTS", "STORM", "Family"),
    *("available", "last", "measure", "runs", "switches"),
]

HERE = Path(__file__).resolve().parent
MODELS = HERE.parent / "models"
RESULTS = HERE / "results"
ENGINES = (
    "symcheck",
    "symcheck -h",
    "symcheck -s",
    "symcheck -m",
    "symcheck -ex",
    "Storm sparse",
    "Storm hybrid",
    "Storm dd",
)


@dataclass(frozen=True)
class Family:
    """A family of instances.

    model: a file of models/. query: one property. sizes: the values of the constant, or the numbers
    of stations of a generated model.
    """

    name: str
    model: str
    query: str
    constant: str
    sizes: tuple[int, ...]
    fixed: str = ""

    def constants(self, size: int) -> str:
        own = "" if self.name == "polling" or not self.constant else f"{self.constant}={size}"
        return ",".join(part for part in (own, self.fixed) if part)


def switches(
    description: str | None, families: Sequence[Family], engines: Sequence[str]
) -> argparse.ArgumentParser:
    """Add the options: families, engines, and limits of a run."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="*", default=[f.name for f in families], help="families")
    parser.add_argument("--engines", nargs="*", default=engines)
    parser.add_argument("--limit", type=float, default=60, help="seconds per run")
    parser.add_argument(
        "--memory", type=int, default=16_000, help="megabytes of address space per run"
    )
    return parser


def available(engines: Sequence[str]) -> list[str]:
    """The engines whose tool is installed."""
    return [e for e in engines if not e.startswith("Storm") or importlib.util.find_spec("stormpy")]


STORM = """
import sys, stormpy
path, query, constants, engine, *names = sys.argv[1:]
program = stormpy.parse_prism_program(path, prism_compatibility=True)
formulas = [
    f for f in stormpy.parse_properties(query, program) if not names or f.get_name() in names
][:1]
undefined = {c.name for c in program.constants if not c.defined}
undefined |= {c.name for c in formulas[0].get_undefined_constants()}
constants = ",".join(c for c in constants.split(",") if c.split("=")[0] in undefined)
if constants:
    program, formulas = stormpy.instantiate_constants(program, constants, formulas)
kind = getattr(stormpy.Engine, engine)
model = stormpy.build_model(program, formulas, engine=kind)
print("States:", model.nr_states, flush=True)
result = stormpy.model_checking(model, formulas[0], only_initial_states=True, engine=kind)
greatest = str(formulas[0]).startswith("filter(max") or "maximum" in str(formulas[0])
if engine == "SPARSE":
    get = result.__getitem__ if result.is_qualitative() else result.get_value
    values = [get(s) for s in model.initial_states]
    print("Result:", max(values) if greatest else min(values))
else:
    result.filter(stormpy.create_filter_initial_states(model))
    if result.is_qualitative():
        print("Result:", result.forall_true())
    else:
        print("Result:", result.get_max() if greatest else result.get_min())
"""


def command(family: Family, size: int, engine: str, model: Path) -> list[str]:
    tool, _, switch = engine.partition(" ")
    constants = family.constants(size)
    if tool == "Storm":
        return [sys.executable, "-c", STORM, str(model), family.query, constants, switch.upper()]
    return [
        *(sys.executable, "-m", "symcheck", str(model), "-pf", family.query),
        *(["-const", constants] if constants else []),
        *([switch] if switch else []),
    ]


def measure(
    arguments: Sequence[str], seconds: float, megabytes: int, processor: int = 0
) -> tuple[str, str, float, float, int]:
    """The output of a process, its status, wall and CPU seconds, and megabytes.

    seconds: limit of wall time. processor: limit of CPU seconds; 0: none.
    """

    def limits() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))
        if processor:
            resource.setrlimit(resource.RLIMIT_CPU, (processor, processor + 1))

    with tempfile.TemporaryFile("w+") as out:
        started = time.perf_counter()
        process = subprocess.Popen(
            arguments,
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=limits,
        )
        ended = ""
        try:
            while True:
                pid, status, usage = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                if not ended and time.perf_counter() - started > seconds:
                    ended = "time"
                    os.killpg(process.pid, signal.SIGKILL)
                time.sleep(0.005)
        except KeyboardInterrupt:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - started
        out.seek(0)
        if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            ended = "time"
        ended = ended or ("done" if process.returncode == 0 else "failed")
        return out.read(), ended, wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss >> 10


def last(text: str, key: str) -> str | None:
    found = [line.split()[1] for line in text.splitlines() if line.startswith(key)]
    return found[-1] if found else None


def model_file(family: Family, size: int, folder: Path) -> Path:
    if family.name != "polling":
        return MODELS / family.model
    path = folder / f"polling{size}.sm"
    generator = MODELS / "polling" / "generate.py"
    path.write_text(
        subprocess.run(
            [sys.executable, str(generator), str(size)], check=True, capture_output=True, text=True
        ).stdout
    )
    return path


def runs(
    families: Sequence[Family], engines: Sequence[str], seconds: float, megabytes: int
) -> Iterator[Run]:
    with tempfile.TemporaryDirectory() as folder:
        for family in families:
            beaten: set[str] = set()
            for size in family.sizes:
                model = model_file(family, size, Path(folder))
                for engine in engines:
                    if engine in beaten:
                        continue
                    text, ended, wall, processor, memory = measure(
                        command(family, size, engine, model), seconds, megabytes
                    )
                    states, value = last(text, "States:"), last(text, "Result:")
                    if ended != "done":
                        beaten.add(engine)
                    yield Run(
                        *(
                            family.name,
                            size,
                            engine,
                            int(states) if states else None,
                            round(wall, 3),
                            round(processor, 3),
                            memory,
                        ),
                        *(float(value) if value and ended == "done" else None, ended),
                    )
