"""Times of Markov automata and interval models: symcheck and Storm's sparse engine, in turns.

    python benchmarks/classes_storm.py [--folder PEERS] [--limit 60] [--only WORD] [--repeat 1]

PEERS holds `qvbs/ma/` (default: see tests/peers_folder.py); the interval models are written here.
Storm runs with its sound environment and the precision of symcheck (1e-6, relative; absolute
within a time). A time is that from the text to the value in a process of its own, without the
start of Python and its imports; the smallest of the repetitions counts. Instances that Storm
solves in less than a second are not part of the mean.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from peers_folder import PEERS

# Constants that are greater than those of the set, where its instances take no time.
MORE = {
    "ftwc": [{"N": n, "TIME_BOUND": 5} for n in (4, 8, 16)],
    "bitcoin-attack": [{"MALICIOUS": 20, "CD": 6}, {"MALICIOUS": 60, "CD": 20}],
    "stream": [{"N": n} for n in (10, 100, 500, 1000)],
    "polling-system": [
        {"JOB_TYPES": j, "C": c, "TIME_BOUND": 5} for j, c in ((1, 4), (2, 3), (3, 3))
    ],
    "reentrant-queues": [
        {"JOB_TYPES": j, "C_LEFT": c, "C_RIGHT": c, "TIME_BOUND": 5} for j, c in ((2, 3), (3, 3))
    ],
}

# A walk between 0 and n, of which nobody knows the exact chances.
WALK = """{kind} module walk x : [0..{n}] init {half}; y : [0..{m}] init 0;
[a] x>0 & x<{n} -> [0.45,0.5]:(x'=x+1) + [0.5,0.55]:(x'=x-1)&(y'=mod(y+1,{m}+1));
{second}
[] x=0 | x={n} -> true; endmodule rewards "steps" x>0 & x<{n} : 1; endrewards label "up" = x={n};
label "end" = x=0 | x={n};"""
SECOND = "[b] x>0 & x<{n} -> [0.3,0.6]:(x'=x+1) + [0.2,0.5]:(x'=x-1) + [0.1,0.2]:(y'=0);"


def ours(path: str, constants: str, name: str) -> tuple[float, float]:
    """Seconds of symcheck, and the value."""
    import symcheck

    symcheck.loads("dtmc module m x:[0..1]; [] true -> (x'=1); endmodule").check("P=? [ F x=1 ]")
    started = time.perf_counter()
    model = symcheck.load(path, constants)
    result = model.check_all(path)[name] if path.endswith(".jani") else model.check(name)
    return time.perf_counter() - started, float(result.value)


def storms(path: str, constants: str, name: str) -> tuple[float, float]:
    """Seconds of Storm, and the value."""
    import stormpy

    started = time.perf_counter()
    words = {}
    if path.endswith(".jani"):
        program, found = stormpy.parse_jani_model(path)
        properties = [p for p in found if p.get_name() == name]
        if constants:
            program, properties = stormpy.instantiate_constants(program, constants, properties)
        model = stormpy.build_model(program, properties)
    else:
        program = stormpy.parse_prism_program(path)
        properties = stormpy.parse_properties(name.replace("maxmin", "max"), program)
        model = stormpy.build_model[stormpy.Interval](program, properties)
        mode = stormpy.UncertaintyResolutionMode
        words["uncertainty_resolution_mode"] = mode.ROBUST if "maxmin" in name else mode.MAXIMIZE
    result = stormpy.model_checking(
        model, properties[0], environment=stormpy.environments.sound(), **words
    )
    initial = next(iter(model.initial_states))
    value = float(result.get_value(initial) if hasattr(result, "get_value") else result[initial])
    return time.perf_counter() - started, value


def timed(tool: str, limit: float, *words: str) -> tuple[float, float] | None:
    """Seconds and the value of a tool in a new process; None beyond the limit or where it fails."""
    command = [sys.executable, __file__, tool, *words]
    try:
        out = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=True)
    except subprocess.TimeoutExpired:
        return None
    except subprocess.CalledProcessError as failed:
        print(f"{tool}: {failed.stderr.splitlines()[-1]}", file=sys.stderr)
        return None
    seconds, value = json.loads(out.stdout.splitlines()[-1])
    return seconds, value


def instances(folder: Path) -> Iterator[tuple[str, str, str, str]]:
    """Pairs of a model and a question: a family, a file, constants, and a name or a property."""
    for file in sorted((folder / "qvbs" / "ma").glob("*/reference.json")):
        family = json.loads(file.read_text())
        for known in family["instances"]:
            path = file.parent / known["jani"]
            for constants in MORE.get(file.parent.name, [known["constants"]]):
                text = ",".join(f"{k}={v}" for k, v in constants.items())
                for question in family["properties"]:
                    yield file.parent.name, str(path), text, question["name"]
            if file.parent.name in MORE:
                break


def interval_models(folder: Path) -> Iterator[tuple[str, str, str, str]]:
    """Walks with intervals: files in a folder, each with its questions."""
    for kind, n, m in (
        ("dtmc", 100, 500),
        ("dtmc", 200, 1000),
        ("mdp", 60, 300),
        ("mdp", 100, 500),
    ):
        path = folder / f"walk-{kind}-{n}-{m}.prism"
        second = SECOND.format(n=n) if kind == "mdp" else ""
        path.write_text(WALK.format(kind=kind, n=n, m=m, second=second, half=n // 2))
        optimum = "max" if kind == "dtmc" else "maxmin"
        for question in (
            f'P{optimum}=? [ F "up" ]',
            f'R{optimum}=? [ F "end" ]',
            f'P{optimum}=? [ F<=200 "up" ]',
        ):
            yield f"intervals-{kind}", str(path), "", question


def main() -> None:
    """Print a table of times, and the geometric mean of their quotients."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=PEERS)
    parser.add_argument("--limit", type=float, default=60)
    parser.add_argument("--only", default="")
    parser.add_argument("--repeat", type=int, default=1)
    a = parser.parse_args()
    quotients = []
    print(f"{'instance':60}{'symcheck':>10}{'Storm':>10}{'value':>18}{'Storm':>18}")
    with tempfile.TemporaryDirectory() as own:
        tasks = [*instances(a.folder), *interval_models(Path(own))]
        for family, *words in tasks:
            shown = f"{family} {Path(words[0]).stem} {words[1]} {words[2]}"
            if a.only not in shown:
                continue
            runs = [
                (timed("ours", a.limit, *words), timed("storms", a.limit, *words))
                for _ in range(a.repeat)
            ]
            us, them = (
                min((r for r in side if r), default=None) for side in zip(*runs, strict=True)
            )
            cells = [
                f"{r[i]:>{w}.{d}f}" if r else f"{'-':>{w}}"
                for i, w, d in ((0, 10, 2), (1, 18, 7))
                for r in (us, them)
            ]
            print(f"{shown:60}{''.join(cells)}", flush=True)
            if us and them and them[0] >= 1:
                quotients.append(us[0] / them[0])
    if quotients:
        mean = math.exp(sum(map(math.log, quotients)) / len(quotients))
        print(
            f"{len(quotients)} of a second or more: geometric mean {mean:.2f} "
            f"of Storm's time, at most {max(quotients):.2f}"
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["ours"] or sys.argv[1:2] == ["storms"]:
        print(json.dumps((ours if sys.argv[1] == "ours" else storms)(*sys.argv[2:5])))
    else:
        main()
