"""Plots and exponents of the measurements of growth.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Run:
    """A run of one process.

    seconds: wall time. processor: user and system time. megabytes: the largest resident set. value:
    the result; None if the run did not end.
    """

    family: str
    size: int
    engine: str
    states: int | None
    seconds: float
    processor: float
    megabytes: int
    value: float | None
    ended: str


# Strong colours for symcheck, greys for Storm; one marker per engine.
LOOKS = {
    "symcheck": {"color": "#c0392b", "marker": "o", "linewidth": 2.4, "zorder": 5},
    "symcheck -h": {"color": "#e67e22", "marker": "s"},
    "symcheck -s": {"color": "#2980b9", "marker": "^"},
    "symcheck -m": {"color": "#8e44ad", "marker": "D"},
    "symcheck -ex": {"color": "#27ae60", "marker": "v"},
    "Storm sparse": {"color": "#222222", "marker": "o", "linestyle": "--"},
    "Storm hybrid": {"color": "#666666", "marker": "s", "linestyle": "--"},
    "Storm dd": {"color": "#999999", "marker": "D", "linestyle": "--"},
}


def states_of(runs: Sequence[Run]) -> dict[tuple[str, int], int]:
    """The number of states of each instance in symcheck (Storm may omit states behind targets)."""
    return {
        (r.family, r.size): r.states for r in runs if r.states and r.engine.startswith("symcheck")
    }


def right(runs: Sequence[Run]) -> list[Run]:
    """The runs that ended with the value that most engines found for the instance."""
    kept = []
    for run in runs:
        if run.ended != "done" or run.value is None:
            continue
        others = [
            r.value
            for r in runs
            if (r.family, r.size) == (run.family, run.size) and r.value is not None
        ]
        near = sum(abs(v - run.value) <= 1e-3 * abs(run.value) + 1e-12 for v in others)
        if 2 * near >= len(others):
            kept.append(run)
    return kept


def slope(points: Sequence[tuple[float, float]]) -> float | None:
    """The slope of a least-squares fit through the logarithms; None for fewer than two points."""
    if len(points) < 2:
        return None
    xs, ys = [math.log(x) for x, _ in points], [math.log(y) for _, y in points]
    mx, my = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((x - mx) * (y - my) for x, y in zip(xs, ys, strict=True)) / sum(
        (x - mx) ** 2 for x in xs
    )


def exponents(
    runs: Sequence[Run], states: dict[tuple[str, int], int]
) -> tuple[float | None, float | None]:
    """The exponents of time and memory.

    Runs that take less than twice as much as the smallest run are left out, because start-up
    dominates them.
    """
    quickest, least = (
        min((r.seconds for r in runs), default=0.0),
        min((r.megabytes for r in runs), default=0),
    )
    times = [(states[r.family, r.size], r.seconds) for r in runs if r.seconds >= 2 * quickest]
    memory = [(states[r.family, r.size], r.megabytes) for r in runs if r.megabytes >= 2 * least]
    return slope(times), slope(memory)


def curves(
    axes: Axes,
    runs: Sequence[Run],
    states: dict[tuple[str, int], int],
    value: Callable[[Run], float],
) -> None:
    for engine, look in LOOKS.items():
        points = sorted((states[r.family, r.size], value(r)) for r in runs if r.engine == engine)
        if points:
            axes.plot(
                *zip(*points, strict=True),
                label=engine,
                markersize=4.5,
                **({"linewidth": 1.3} | look),
            )
    logarithmic(axes)


def logarithmic(axes: Axes) -> None:
    """Make both axes logarithmic; a short value axis has ticks at 0.2, 0.5, 1, 2, 5, …."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", alpha=0.3)


def family_picture(
    family: str, runs: Sequence[Run], states: dict[tuple[str, int], int], path: Path
) -> None:
    import matplotlib.pyplot as plt

    figure, (left, middle) = plt.subplots(1, 2, figsize=(9.6, 4), layout="constrained")
    curves(left, runs, states, lambda r: r.seconds)
    curves(middle, runs, states, lambda r: r.megabytes)
    left.set(title=f"{family}: time of a whole run", xlabel="states", ylabel="wall time (s)")
    middle.set(title=f"{family}: memory", xlabel="states", ylabel="largest resident set (MB)")
    middle.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def overview(runs: Sequence[Run], states: dict[tuple[str, int], int], path: Path) -> None:
    """Plot symcheck's default engine and Storm's fastest engine for all families."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
    palette = ["#c0392b", "#2980b9", "#27ae60", "#8e44ad", "#e67e22"]
    for family, color in zip(dict.fromkeys(r.family for r in runs), palette, strict=False):
        own = [r for r in runs if r.family == family]
        ours = sorted((states[r.family, r.size], r.seconds) for r in own if r.engine == "symcheck")
        best: dict[int, float] = {}
        for r in own:
            if r.engine.startswith("Storm"):
                n = states[r.family, r.size]
                best[n] = min(best.get(n, math.inf), r.seconds)
        if ours:
            axes.plot(
                *zip(*ours, strict=True),
                color=color,
                marker="o",
                linewidth=2,
                markersize=4.5,
                label=family,
            )
        if best:
            axes.plot(
                *zip(*sorted(best.items()), strict=True),
                color=color,
                marker="x",
                linewidth=1.2,
                markersize=4.5,
                linestyle="--",
            )
    logarithmic(axes)
    axes.set(
        title="whole runs: parsing, building, checking", xlabel="states", ylabel="wall time (s)"
    )
    beside = {"fontsize": 8, "frameon": False, "alignment": "left"}
    axes.add_artist(
        axes.legend(title="model", loc="upper left", bbox_to_anchor=(1, 0.95), **beside)
    )
    tools = [
        axes.plot(
            [],
            [],
            color="#444444",
            marker="o",
            linewidth=2,
            markersize=4.5,
            label="symcheck, default",
        )[0],
        axes.plot(
            [],
            [],
            color="#444444",
            marker="x",
            linewidth=1.2,
            linestyle="--",
            label="Storm, its fastest engine",
        )[0],
    ]
    axes.legend(handles=tools, title="tool", loc="upper left", bbox_to_anchor=(1, 0.45), **beside)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def cell(run: Run | None, tried: Run | None) -> str:
    if run is not None:
        return f"{run.seconds:.1f} / {run.megabytes:,}"
    return (
        "" if tried is None else {"done": "wrong", "time": "time", "failed": "fails"}[tried.ended]
    )


def tables(runs: Sequence[Run], good: Sequence[Run], states: dict[tuple[str, int], int]) -> str:
    """A Markdown table of seconds and MB per instance and engine, and of the exponents."""
    engines = [e for e in LOOKS if any(r.engine == e for r in runs)]
    found = {(r.family, r.size, r.engine): r for r in good}
    tried = {(r.family, r.size, r.engine): r for r in runs}
    lines = [
        "# Growth",
        "Seconds / MB of whole runs, from `python benchmarks/growth.py`, two cores, "
        "at most 60 s per run. "
        "Exponents: time, memory, over states. Curves end where the next instance took longer.",
        "",
        "*time*: did not end; *fails*: ended without a value; "
        "*wrong*: the value is further than 1e-3 from most others; "
        "empty: not tried, as a smaller instance did not end.",
        "",
    ]
    lines += [
        "| instance | states | " + " | ".join(engines) + " |",
        "|---" * (len(engines) + 2) + "|",
    ]
    for family in dict.fromkeys(r.family for r in runs):
        for size in sorted({r.size for r in runs if r.family == family}):
            keys = [(family, size, e) for e in engines]
            count = states.get((family, size))
            cells = [cell(found.get(k), tried.get(k)) for k in keys]
            lines.append(
                f"| {family} {size} | {count:,} | " + " | ".join(cells) + " |" if count else ""
            )
        fits = [
            exponents([r for r in good if r.family == family and r.engine == e], states)
            for e in engines
        ]
        cells = [", ".join("-" if x is None else f"{x:.2f}" for x in fit) for fit in fits]
        lines.append(f"| **{family}: exponents** | | " + " | ".join(cells) + " |")
    return "\n".join(line for line in lines if line is not None) + "\n"


def draw(runs: Sequence[Run], folder: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    good, states = right(runs), states_of(runs)
    for family in dict.fromkeys(r.family for r in good):
        family_picture(
            family, [r for r in good if r.family == family], states, folder / f"growth_{family}.png"
        )
    overview(good, states, folder / "growth.png")
    (folder / "growth.md").write_text(tables(runs, good, states))
