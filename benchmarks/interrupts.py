"""Interrupt runs at random moments, and check that each ends as it should.

python benchmarks/interrupts.py [--runs N] [--seed N] [--slack SECONDS]

A run is stopped by a signal, by a limit of time or memory, by a full disk or by a closed pipe. It
must then end within a second, with its exit status and one message, without a traceback and without
a process that it leaves behind, and each file must be whole or missing. The library is not
imported: runs are processes of their own.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from pathlib import Path
from xml.etree import ElementTree

MODELS = Path(__file__).resolve().parent.parent / "models"

ENGINES = ("", "-ex", "-s", "-h", "-m", "-exact")

JOBS: tuple[str, ...] = (
    "die/die.pm die/die.pctl -exporttrans die.tra -exportstates die.sta",
    "crowds/crowds.pm crowds/crowds.pctl -const TotalRuns=3:5,CrowdSize=5 -exportresults r.csv",
    "crowds/crowds.pm -const TotalRuns=5,CrowdSize=8 -exportmodel m.tra,sta,lab",
    "kanban/kanban.sm -const t=2 -exporttrans k.tra -steadystate -exportss k.txt",
    "herman/herman9.pm herman/herman9.pctl -exportresults r.json",
    "dining/dining.nm dining/dining.pctl -exportresults r.csv",
    "tandem/tandem.sm tandem/tandem.csl -const c=20,T=1 -exportvector v.txt",
    "gambler/gambler.pm gambler/gambler.pctl -exportresults r.csv:csv",
    "queue/queue.sm queue/queue.csl -exportresults r.csv",
    "leader/leader.pm leader/leader.pctl -bisim -exportresults r.csv",
    "multiplex/multiplex.pm multiplex/multiplex.pctl -const K=1 -exportresults r.csv",
    "die/die.pm -simpath 20000,loopcheck=false path.txt",
    "crowds/crowds.pm -const TotalRuns=4,CrowdSize=5:9 -jobs 2 -exporttrans c.tra "
    "-exportresults r.csv crowds/crowds.pctl",
    "die/die.pm die/die.pctl -exportpage p.html -exportdot d.dot -exportstrat s.txt",
    "herman/herman7.pm herman/herman7.pctl -exportpage p.html -exportresults r.csv",
    "die/die.jani -exportmodel m.tra,sta,lab,srew -exportresults r.csv -pf P=?[F\u00a0d=6]",
    "crowds/crowds.pm crowds/crowds.pctl -const TotalRuns=4,CrowdSize=5 -exportjani j.jani "
    "-exportresults r.csv",
    "die/die.pm -pf P<=0.1[F\u00a0d=6] -counterexample -exportcounterexample c.json "
    "-exportresults r.csv",
    "crowds/crowds.pm -const TotalRuns=4,CrowdSize=5 -pf P<=0.001[F\u00a0observed0>1] "
    "-exportcounterexample c.txt",
    "crowds/crowds.pm crowds/crowds.pctl -const TotalRuns=5,CrowdSize=5 -testall "
    "-exporttests r.xml",
    "dining/dining.nm dining/dining.pctl -testall -exporttests r.json -exportresults r.csv",
    "compare die/die.pm die/die.pctl -with prism",
    "compare crowds/crowds.pm crowds/crowds.pctl -const TotalRuns=3:4,CrowdSize=5 -with prism",
    "queue/queue.sm queue/queue.csl -const c=5:14 -jobs 3 -exportresults r.csv",
    "crowds/crowds.pm crowds/crowds.pctl -const TotalRuns=3:6,CrowdSize=5 -jobs 2 -testall "
    "-exporttests r.xml -exportresults r.csv",
    "-batch suite.txt",
)
"""Runs of a second or so; names of files without a dash before them that exist are models. A space
within a word is a no-break space.
"""

_PEER = "#!/bin/sh\nsleep 0.1\necho Result: 0.5\n"
"""The program `prism` of the runs that compare answers."""

_SUITE = f"""{MODELS}/die/die.pm {MODELS}/die/die.pctl
{MODELS}/crowds/crowds.pm {MODELS}/crowds/crowds.pctl -const TotalRuns=4,CrowdSize=5
{MODELS}/dining/dining.nm {MODELS}/dining/dining.pctl
"""
"""The lines of `-batch suite.txt`."""

_TRIAL = "SYMCHECK_TRIAL"
"""The environment variable by which the processes of a trial are known."""

_IMPORTS = 90 << 20  # bytes that Python, numpy and the extension modules nearly take

DISTURBANCES = ("SIGINT", "SIGTERM", "time", "memory", "space", "full output", "closed pipe")

_BAD = re.compile(
    r"Traceback|internal error|Exception ignored|Fatal|core dumped|^\s+File \"", re.MULTILINE
)


@dataclass(frozen=True)
class Trial:
    """A run and its disturbance.

    moment: seconds until a signal, or until the time limit. amount: bytes of memory, of a file or
    of the output that is read.
    """

    words: tuple[str, ...]
    kind: str
    moment: float = 0.0
    amount: int = 0
    way: str = ""

    def __str__(self) -> str:
        return f"{' '.join(self.words)} | {self.kind} {self.way} {self.moment:.3f} s {self.amount}"


@dataclass
class Outcome:
    """How a run ended. late: seconds from the disturbance to the end."""

    status: int
    out: str
    err: str
    late: float
    files: Mapping[str, bytes] = field(default_factory=dict)


def trials(seed: int) -> Iterator[Trial]:
    """Random trials without end."""
    draw = random.Random(seed)
    while True:
        words = draw.choice(JOBS).split(" ") + [w for w in [draw.choice(ENGINES)] if w]
        if "-exportdot" in words and words[-1] in ("-ex", "-exact"):
            words.pop()
        words = [w.replace("\u00a0", " ") for w in words]
        whole = tuple(str(MODELS / w) if (MODELS / w).is_file() else w for w in words)
        kind = draw.choice(DISTURBANCES)
        moment = draw.choice((draw.uniform(0.05, 0.4), draw.uniform(0.0, 2.0)))
        way, amount = "", 0
        if kind in ("SIGINT", "SIGTERM"):
            way = draw.choice(("", "to the group", "twice", "to the group, twice"))
        elif kind == "memory":
            way = draw.choice(("-cuddmaxmem", "SYMCHECK_MEMORY", "address space", "data"))
            amount = int(2 ** draw.uniform(20, 29))
            amount += (way in ("address space", "data")) * _IMPORTS
        elif kind == "space":
            amount = int(2 ** draw.uniform(4, 18))
        elif kind == "closed pipe":
            amount = draw.choice((0, draw.randrange(2000)))
        yield Trial(whole, kind, moment, amount, way)


def run(trial: Trial, command: tuple[str, ...] = (sys.executable, "-m", "symcheck")) -> Outcome:
    """Carry out a trial in a folder of its own."""
    words = [*command, *trial.words]
    environment = {**os.environ, _TRIAL: f"{os.getpid()}.{time.monotonic_ns()}"}
    limits: list[tuple[int, int]] = []
    if trial.kind == "time":
        words += ["-timeout", f"{max(trial.moment, 0.01):.3f}"]
    elif trial.way == "-cuddmaxmem":
        words += ["-cuddmaxmem", f"{trial.amount >> 10}k"]
    elif trial.way == "SYMCHECK_MEMORY":
        environment["SYMCHECK_MEMORY"] = f"{trial.amount >> 10}k"
    elif trial.kind == "memory":
        limit = resource.RLIMIT_AS if trial.way == "address space" else resource.RLIMIT_DATA
        limits.append((limit, trial.amount))
    elif trial.kind == "space":
        limits.append((resource.RLIMIT_FSIZE, trial.amount))

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for limit, amount in limits:
            resource.setrlimit(limit, (amount, resource.getrlimit(limit)[1]))

    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryDirectory() as programs,
        open("/dev/full", "w") as full,
    ):
        peer = Path(programs, "prism")
        peer.write_text(_PEER)
        peer.chmod(0o755)
        Path(folder, "suite.txt").write_text(_SUITE)
        environment["PATH"] = f"{programs}:{environment['PATH']}"
        started = time.monotonic()
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=full if trial.kind == "full output" else subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=folder,
            env=environment,
            preexec_fn=prepare,
            start_new_session=True,
        )
        disturbed = started + (trial.moment if trial.kind == "time" else 0.0)
        if trial.kind in ("SIGINT", "SIGTERM"):
            try:
                process.wait(trial.moment)
            except subprocess.TimeoutExpired:
                _send(process, trial)
            disturbed = time.monotonic()
        head = b""
        if trial.kind == "closed pipe":
            assert process.stdout is not None
            head = process.stdout.read(trial.amount)
            process.stdout.close()
            process.stdout = None
        try:
            out, err = process.communicate(timeout=300)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            err += b"\ndoes not end: internal error"
        late = time.monotonic() - disturbed
        if left := _left_running(environment[_TRIAL]):
            err += f"\nleft running: internal error: {left}".encode()
        files = {p.name: p.read_bytes() for p in Path(folder).iterdir()}
    shown = head + (out or b"")
    # A signal that arrives before Python has started ends the process; shells add 128 to it.
    status = process.returncode if process.returncode >= 0 else 128 - process.returncode
    return Outcome(status, shown.decode(), err.decode(), late, files)


def _send(process: subprocess.Popen[bytes], trial: Trial) -> None:
    """Send a signal to a process, or to its group, as a terminal does; perhaps a second one."""
    number = signal.Signals[trial.kind]
    for pause in (0.0, trial.moment % 0.3) if "twice" in trial.way else (0.0,):
        time.sleep(pause)
        if process.poll() is not None:
            return
        if "group" in trial.way:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)


def _left_running(trial: str) -> list[str]:
    """The command lines of the processes of a trial that run a second after its end."""
    mark, end = f"{_TRIAL}={trial}".encode(), time.monotonic() + 1
    while True:
        left = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                if mark in (folder / "environ").read_bytes():
                    left.append((folder / "cmdline").read_bytes().decode().replace("\0", " "))
            except OSError:
                continue
        if not left or time.monotonic() > end:
            return left
        time.sleep(0.05)


@cache
def reference(words: tuple[str, ...]) -> Outcome:
    """The run without a disturbance."""
    return run(Trial(words, "none"))


def too_early(trial: Trial, found: Outcome) -> bool:
    """Whether a signal arrived while Python itself started, before the first line of `main`."""
    return (
        trial.kind in ("SIGINT", "SIGTERM")
        and "KeyboardInterrupt" in found.err
        and not found.out
        and not re.search(r"symcheck/.*, in (?!<module>)", found.err)
    )


def faults(trial: Trial, found: Outcome, slack: float) -> list[str]:
    """What is wrong with the end of a run."""
    whole = reference(trial.words)
    out: list[str] = []
    text = found.err + found.out
    if _BAD.search(text):
        out.append("traceback")
    stopped = {
        "SIGINT": {130},
        "SIGTERM": {143},
        "time": {3},
        "memory": {3},
        "space": {1},
        "full output": {1},
        "closed pipe": {1},
    }[trial.kind]
    if "-batch" in trial.words and stopped == {3}:
        stopped = {1, 3}  # the limit of a line, or too little for the modules
    if "-jobs" in trial.words and trial.kind == "space":
        stopped = {1, 3}  # a semaphore of the processes needs space too
    if found.status not in {whole.status, *stopped}:
        out.append(f"status {found.status}")
    if (
        trial.kind not in ("SIGINT", "SIGTERM")
        and found.status in stopped - {whole.status}
        and "error: " not in found.err
    ):
        out.append("no message")
    if trial.kind in ("SIGINT", "SIGTERM", "time") and found.late > 1 + slack:
        out.append(f"late: {found.late:.2f} s")
    for name, content in found.files.items():
        if name not in whole.files:
            out.append(f"left behind: {name}")
        elif not name.startswith("r.") and name != "path.txt" and content != whole.files[name]:
            lines = content.count(b"\n"), whole.files[name].count(b"\n")
            if trial.kind != "memory" or lines[0] != lines[1]:  # other methods have other digits
                out.append(f"half a file: {name}")
        elif not _is_whole(name, content):
            out.append(f"half a table: {name}")
    results = found.out.count("\nResult: ")
    table = found.files.get("r.csv")
    if table is not None and table.count(b"\n") - 1 < results:
        out.append(f"{results} results in the output and {table.count(10) - 1} in the table")
    if table is None and results and "r.csv" in trial.words and trial.kind != "space":
        out.append("finished results were not written")
    return out


def _is_whole(name: str, content: bytes) -> bool:
    """Whether a file of results is complete; how many results it has is another question."""
    try:
        match Path(name).suffix:
            case ".csv":
                return content.endswith(b"\n")
            case ".xml":
                ElementTree.fromstring(content)
            case ".json":
                json.loads(content)
    except (ValueError, ElementTree.ParseError):
        return False
    return True


def main() -> int:
    """Run the trials and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slack", type=float, default=1.0, help="seconds for a loaded machine")
    asked = parser.parse_args()
    ends: Counter[tuple[str, int]] = Counter()
    wrong = early = 0
    latest = {"SIGINT": 0.0, "SIGTERM": 0.0, "time": 0.0}
    done = 0
    for trial in islice(trials(asked.seed), asked.runs):
        try:
            found = run(trial)
        except KeyboardInterrupt:
            break
        done += 1
        ends[trial.kind, found.status] += 1
        if trial.kind in latest:
            latest[trial.kind] = max(latest[trial.kind], found.late)
        if too_early(trial, found):
            early += 1
        elif bad := faults(trial, found, asked.slack):
            wrong += 1
            print(f"{'; '.join(bad)}: {trial}\n{found.err[-1500:]}", flush=True)
    for (kind, status), count in sorted(ends.items()):
        print(f"{kind}: {count} runs ended with {status}")
    print(", ".join(f"{kind}: ended after {t:.2f} s at most" for kind, t in latest.items()))
    print(f"{early} signals arrived before Python had started")
    print(f"{wrong} of {done} runs ended wrongly")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
