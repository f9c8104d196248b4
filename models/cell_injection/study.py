"""The cell-injection study as one command: tables and figures.

It checks nine cell positions, and other step sizes and noise levels.

    python models/cell_injection/study.py [--out study-output] [--workers 2]

Stopped, it goes on where it was: finished rows are in OUT/rows.jsonl; --fresh begins anew. See
docs/cell_injection.md.
"""

from __future__ import annotations

import argparse
import csv
import random
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from time import perf_counter
from typing import Any

import symcheck
from symcheck.errors import ModelFault
from symcheck.experiments.run import Progress as Finished
from symcheck.experiments.table import Experiment
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.interpreter import initial_states, transitions
from symcheck.semantics.model import BoundModel
from symcheck.syntax.parse import parse_model

HERE = Path(__file__).parent
MODEL = HERE / "cell_injection.pm"
PAPER = {
    "NoisePercentage": "0.01",
    "StepSizeXY": "18",
    "InitialPositionXY": "100",
    "MaxDistance": "250",
    "Damping": "1",
}
BOUNDARIES = (174, 175, 176)
STEPS = (9, 12, 15, 18, 24, 30, 36)
NOISES = (0.005, 0.01, 0.015, 0.02)
BLUE, RED, GREY, BLACK = "#2166ac", "#b2182b", "#888888", "#222222"


@dataclass(frozen=True)
class Measure:
    """A property of the study, and the range that the paper reports: as numbers and in words."""

    title: str
    property: str
    constants: Mapping[str, int]
    low: float
    high: float
    words: str

    def of(self, instance: Experiment) -> float:
        """Its value for an instance."""
        (row,) = instance.select(self.property, **self.constants)
        assert row.number is not None, row.error
        return row.number

    def show(self, instance: Experiment) -> str:
        """The same for a table: yes and no for what is true or false."""
        value = self.of(instance)
        return f"{'yes' if value else 'no':>9}" if self.words == "yes" else f"{value:9.4f}"


MEASURES = (
    Measure("position error > 7 %", "position_error", {}, 0.2, 0.2, "about 0.2"),
    Measure("force error > 10 %", "force_error", {"ForceBound": 10}, 0.2, 0.2, "about 0.2"),
    Measure("force error > 5 %", "force_error", {"ForceBound": 5}, 0.35, 0.63, "0.35 to 0.63"),
    Measure("rupture while piercing", "rupture_in_piercing", {}, 0, 0.15, "below 0.15"),
    Measure("rupture at injection", "rupture_in_injection", {}, 0, 0.15, "below 0.15"),
    Measure("poor injection", "poor", {}, 0, 0.1, "success above 0.9"),
    Measure("stages, as printed", "stages", {}, 1, 1, "follows each stage"),
    Measure("stages, in order", "stages_in_order", {}, 1, 1, "follows each stage"),
    Measure("deadlock free", "deadlock_free", {}, 1, 1, "yes"),
    Measure("injection is reached", "injected", {}, 1, 1, "(not asked)"),
)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("study-output"))
    parser.add_argument("--workers", type=int, default=2, help="processes at a time")
    parser.add_argument(
        "--fresh", action="store_true", help="forget what an earlier run has finished"
    )
    parser.add_argument(
        "--positions-only",
        action="store_true",
        help="the nine positions only, without variations and figures",
    )
    arguments = parser.parse_args()
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    resume = out / "rows.jsonl"
    if arguments.fresh:
        resume.unlink(missing_ok=True)

    positions = run(
        "positions",
        {**PAPER, "CellBoundaryX": BOUNDARIES, "CellBoundaryY": BOUNDARIES},
        resume,
        arguments,
    )
    show_positions(positions)
    write(out / "positions.csv", positions, ("CellBoundaryX", "CellBoundaryY"))
    if arguments.positions_only:
        return
    centre = {**PAPER, "CellBoundaryX": 175, "CellBoundaryY": 175}
    variations = run(
        "variations", {**centre, "StepSizeXY": STEPS, "NoisePercentage": NOISES}, resume, arguments
    )
    show_variations(variations)
    write(out / "variations.csv", variations, ("StepSizeXY", "NoisePercentage"))
    (wrong,) = run("damping of the other sign", {**centre, "Damping": 0}, resume, arguments)
    injected, position_error, deadlock_free = (
        wrong.select(n)[0].value for n in ("injected", "position_error", "deadlock_free")
    )
    print(f"\nWith damping of the other sign: injection is reached with probability {injected:g},")
    print(f"position error {position_error:g}, deadlock free: {deadlock_free}.")
    print(f"Not clamped to the stage, the model is at fault:\n{fault()}")
    draw_positions(positions, out / "fig6.png")
    draw_variations(variations, out / "variations.png")
    draw_motion(out / "motion.png")
    print(
        f"\nWritten to {out}: positions.csv, variations.csv, fig6.png, variations.png, motion.png"
    )


def run(
    title: str, constants: Mapping[str, object], resume: Path, arguments: argparse.Namespace
) -> list[Experiment]:
    """The rows of each instance, with a bar on the terminal and a summary.

    Ends the program where an instance is at fault.
    """
    started, used = perf_counter(), processor_time()
    with bar(title) as observer:
        rows = symcheck.experiment(
            MODEL,
            MODEL.with_suffix(".pctl"),
            {**constants, "ForceBound": (10, 5)},
            jobs=arguments.workers,
            resume=resume,
            progress=observer,
            engine="explicit",
        )
    for row in rows.errors:
        raise SystemExit(f"{dict(row.constants)}: {row.error}")
    if not rows.complete:
        raise SystemExit(130)
    names = [n for n in rows.varying if n != "ForceBound"]
    choices = dict.fromkeys(tuple(row.constants[n] for n in names) for row in rows)
    instances = [rows.select(**dict(zip(names, choice, strict=True))) for choice in choices]
    states = sum(d[0].states for d in instances)
    seconds, busy = perf_counter() - started, processor_time() - used
    memory = getrusage(RUSAGE_CHILDREN).ru_maxrss / 1024
    print(
        f"\n{title}: {len(instances)} instances, {states:,} states; {seconds:.1f} s wall, "
        f"{busy:.1f} s of CPU time, at most {memory:.0f} MB in a process"
    )
    return instances


def processor_time() -> float:
    """Seconds of this process and of those that it has started."""
    return sum(u.ru_utime + u.ru_stime for u in map(getrusage, (RUSAGE_SELF, RUSAGE_CHILDREN)))


@contextmanager
def bar(title: str) -> Iterator[Callable[[Finished], object] | None]:
    """The observer of an experiment that shows a bar on standard error, if that is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=None)
        yield lambda event: progress.update(task, completed=event.finished, total=event.total)


def fault() -> str:
    """What the variant without clamping is told."""
    from symcheck.explicit.build import explore

    try:
        explore(bound({"Damping": "-1"}), Options())
    except ModelFault as found:
        return str(found).splitlines()[0].partition(": ")[2]
    raise AssertionError("the variant stays within its range")


# ------------------------------------------------------------------------------------------- tables


def show_positions(results: Sequence[Experiment]) -> None:
    """One line for each measure: the values of the nine positions, and the paper's range."""
    heads = [
        f"{d[0].constants['CellBoundaryX']},{d[0].constants['CellBoundaryY']}" for d in results
    ]
    print(f"\n{'':24}" + "".join(f"{h:>9}" for h in heads) + "   paper")
    for m in MEASURES:
        print(f"{m.title:24}" + "".join(m.show(d) for d in results) + f"   {m.words}")
    print(f"{'states':24}" + "".join(f"{d[0].states:9d}" for d in results))


def show_variations(results: Sequence[Experiment]) -> None:
    """A table of step sizes and noise levels for each of the main measures."""
    for m in (MEASURES[0], MEASURES[1], MEASURES[3], MEASURES[5], MEASURES[9]):
        head = f"{m.title}; step, noise"
        print(f"\n{head:38}" + "".join(f"{n:>9}" for n in NOISES))
        for step in STEPS:
            print(
                f"{step:<38}"
                + "".join(m.show(d) for d in results if d[0].constants["StepSizeXY"] == step)
            )


def write(path: Path, results: Iterable[Experiment], names: Sequence[str]) -> None:
    """The results as CSV: the constants that vary, every measure, and the size of the model."""
    with path.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([*names, *(m.title for m in MEASURES), "states", "transitions"])
        for d in results:
            table.writerow(
                [
                    *(d[0].constants[n] for n in names),
                    *(f"{m.of(d):.9g}" for m in MEASURES),
                    d[0].states,
                    d[0].transitions,
                ]
            )
        if "CellBoundaryX" in names:
            table.writerow([*("paper" for _ in names), *(m.words for m in MEASURES), "", ""])


# ------------------------------------------------------------------------------------------ figures


def figure(rows: int, columns: int, width: float, height: float) -> tuple[Any, Any]:
    """A figure with its axes, an array of rows x columns; width and height in inches."""
    try:
        import matplotlib
    except ImportError:
        raise SystemExit("figures need matplotlib: pip install 'symcheck[plot]'") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    pyplot.rcParams.update(
        {"axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 10, "font.size": 9}
    )
    return pyplot.subplots(
        rows, columns, figsize=(width, height), layout="constrained", squeeze=False
    )


def save(picture: Any, path: Path) -> None:
    """Write a figure, and forget it."""
    from matplotlib import pyplot

    picture.savefig(path, dpi=150)
    pyplot.close(picture)


def draw_positions(results: Sequence[Experiment], path: Path) -> None:
    """After the paper's Fig. 6: each measure over the nine positions, and the paper's range."""
    picture, axes = figure(2, 3, 10, 5.6)
    ticks = range(len(results))
    names = [
        f"{d[0].constants['CellBoundaryX']}\n{d[0].constants['CellBoundaryY']}" for d in results
    ]
    for axis, m in zip(axes.flat, MEASURES, strict=False):
        if m.low == m.high:
            axis.axhline(m.low, color=RED, linestyle="--", linewidth=1.2, label=f"paper: {m.words}")
        else:
            axis.axhspan(
                m.low, m.high, color=RED, alpha=0.13, linewidth=0, label=f"paper: {m.words}"
            )
        values = [m.of(d) for d in results]
        axis.bar(ticks, values, color=BLUE, width=0.7)
        axis.set_ylim(0, 1.25 * max(m.high, *values))
        axis.set_title(m.title)
        axis.set_xticks(ticks, names)
        axis.legend(loc="upper right", frameon=False)
    for axis in axes[:, 0]:
        axis.set_ylabel("probability")
    for axis in axes[1]:
        axis.set_xlabel("CellBoundaryX over CellBoundaryY (µm)")
    save(picture, path)


def draw_variations(results: Sequence[Experiment], path: Path) -> None:
    """Errors of position and force, rupture and poor injection over step size, by noise level."""
    from matplotlib import colormaps

    picture, axes = figure(1, 4, 13, 3.5)
    shown = (MEASURES[0], MEASURES[1], MEASURES[3], MEASURES[5])
    for axis, m in zip(axes[0], shown, strict=True):
        for n, noise in enumerate(NOISES):
            line = [m.of(d) for d in results if d[0].constants["NoisePercentage"] == noise]
            colour = colormaps["viridis"](0.9 - 0.85 * n / (len(NOISES) - 1))
            axis.plot(
                STEPS, line, marker="o", markersize=3.5, color=colour, label=f"{100 * noise:g} %"
            )
        axis.set_title(m.title)
        axis.set_xlabel("step size (µm)")
        axis.set_xticks(STEPS)
        axis.set_ylim(0)
    axes[0][0].set_ylabel("probability")
    axes[0][0].legend(title="noise", loc="upper right", frameon=False)
    save(picture, path)


def bound(changes: Mapping[str, str]) -> BoundModel:
    """The model at the central position, with some constants changed."""
    return bind(
        parse_model(MODEL.read_text(), MODEL.name),
        {**PAPER, "CellBoundaryX": "175", "CellBoundaryY": "175", **changes},
    )


def profile(model: BoundModel, rng: random.Random, loops: int) -> list[tuple[float, float]]:
    """A random run: the positions (X_n, Y_n) at the end of each loop's phase 1."""
    count, x, y = (model.index(n) for n in ("count", "X_n", "Y_n"))
    (state,) = initial_states(model)
    found: list[tuple[float, float]] = []
    while len(found) < loops and state[count] != 5:
        if state[count] == 1:
            found.append((state[x], state[y]))
        (row,) = transitions(model, state)
        weights = [float(p) for p, _ in row.branches]
        state = rng.choices([s for _, s in row.branches], weights)[0]
    return found


def draw_motion(path: Path, runs: int = 40) -> None:
    """Simulated motion in both axes, the desired one, and a run with damping of the other sign."""
    rng = random.Random(2019)
    right, wrong = bound({}), bound({"Damping": "0"})
    paths = [profile(right, rng, 12) for _ in range(runs)]
    away = profile(wrong, rng, 10)
    desired = [min(100 + 18 * k, 250) for k in range(9)]
    picture, axes = figure(1, 2, 10, 4)
    for place, (axis, name) in enumerate(zip(axes[0], "XY", strict=True)):
        for n, p in enumerate(paths):
            axis.plot(
                [q[place] for q in p],
                color=BLUE,
                alpha=0.25,
                linewidth=1,
                label=f"{runs} simulated runs" if n == 0 else None,
            )
        axis.plot(
            desired, color=BLACK, linewidth=1.8, marker="o", markersize=4, label="desired motion"
        )
        axis.plot(
            [q[place] for q in away],
            color=RED,
            linewidth=1.5,
            marker="s",
            markersize=3,
            label="damping of the other sign",
        )
        axis.axhline(175, color=GREY, linestyle="--", linewidth=1)
        axis.annotate(
            "cell boundary",
            (9, 175),
            xytext=(0, 3),
            textcoords="offset points",
            color=GREY,
            ha="right",
        )
        axis.set_title(f"{name} axis")
        axis.set_xlabel("loop")
        axis.set_ylabel("position of the needle (µm)")
    axes[0][0].legend(loc="upper left", frameon=False)
    save(picture, path)


if __name__ == "__main__":
    main()
