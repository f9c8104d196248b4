"""Summary and pictures of the measurements of qcomp.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame, Series

__all__ = ["write_summary"]

OURS = "symcheck"
SMALL = 1.0  # processor seconds of the best peer below which differences are shown, not ratios
MANY_STATES = 1_000_000
COLORS = ("#c0392b", "#222222", "#2980b9", "#27ae60", "#8e44ad", "#e67e22", "#7f8c8d", "#16a085")


def write_summary(rows: Sequence[Mapping[str, Any]], measured: Path) -> str:
    """Write a summary and a picture beside the file of measurements, and give the summary.

    Times are processor seconds (user and system): other load on the machine adds less to them than
    to wall time.
    """
    import pandas as pd

    frame = pd.DataFrame(list(rows)).drop_duplicates(["task", "tool"], keep="last")
    solved = frame[frame["verdict"].isin(("right", "inaccurate", "no reference"))]
    seconds = solved.pivot(index="task", columns="tool", values="processor")
    memory = solved.pivot(index="task", columns="tool", values="megabytes")
    states = frame.groupby("task")["states"].max()
    dates = sorted(frame["date"].unique())
    period = " to ".join(dict.fromkeys((dates[0], dates[-1])))
    limits = ", ".join(f"{limit:g}" for limit in sorted(frame["limit"].unique()))
    versions = ", ".join(sorted(frame["version"].unique()))
    lines = [
        f"Measured by `python benchmarks/qcomp.py` ({period}): "
        f"{frame['task'].nunique()} tasks, a limit of {limits} s per run, symcheck {versions}. "
        "Times are processor seconds (user and system).",
        "",
        *_counts(frame, solved),
        "",
        *_comparison(seconds, memory, states),
        "",
        *_lists(frame, solved, seconds),
    ]
    text = "\n".join(lines).rstrip() + "\n"
    measured.with_suffix(".md").write_text(text)
    _picture(seconds, frame, measured.with_suffix(".png"))
    return text


def _tools(frame: DataFrame) -> list[str]:
    return list(dict.fromkeys(frame["tool"]))


def _counts(frame: DataFrame, solved: DataFrame) -> list[str]:
    lines = [
        "| tool | tasks | solved | right | inaccurate | no reference | wrong | time | memory "
        "| failed |",
        "|---" * 10 + "|",
    ]
    for tool in _tools(frame):
        own = frame[frame["tool"] == tool]
        verdicts, ends = own["verdict"].value_counts(), own["ended"].value_counts()
        counts = [len(own), int((solved["tool"] == tool).sum())]
        counts += [verdicts.get(v, 0) for v in ("right", "inaccurate", "no reference", "wrong")]
        counts += [ends.get(e, 0) for e in ("time", "memory", "failed")]
        lines.append(f"| {tool} | " + " | ".join(map(str, counts)) + " |")
    return lines


def _comparison(seconds: DataFrame, memory: DataFrame, states: Series) -> list[str]:
    """symcheck against each peer, and against the best of them, on tasks that both solve."""
    lines = [
        "| peer | tasks of at least 1 s: number | ratio of times | worst | shorter tasks: number "
        "| difference, s | worst | above 10⁶ states: number | ratio of memory | worst |",
        "|---" * 10 + "|",
    ]
    if OURS not in seconds:
        return []
    peers = [tool for tool in seconds if tool.split()[0] != OURS]
    best = {"the best of them": (seconds[peers].min(axis=1), memory[peers].min(axis=1))}
    single = {tool: (seconds[tool], memory[tool]) for tool in peers}
    for name, (time, megabytes) in {**single, **(best if len(peers) > 1 else {})}.items():
        both = time.notna() & seconds[OURS].notna()
        long, large = both & (time >= SMALL), both & (states.reindex(time.index) > MANY_STATES)
        ratios = (seconds[OURS] / time)[long]
        differences = (seconds[OURS] - time)[both & ~long]
        memories = (memory[OURS] / megabytes)[large]
        cells = [len(ratios), *_mean_and_worst(ratios)]
        cells += [len(differences), f"{differences.median():.2f}", f"{differences.max():.2f}"]
        cells += [len(memories), *_mean_and_worst(memories)]
        lines.append(f"| {name} | " + " | ".join(map(str, cells)) + " |")
    return [
        *lines,
        "",
        "Ratios are geometric means of symcheck divided by the peer; differences are medians. With "
        "--skip-larger, a tool is not tried on larger instances than one that exceeded a limit.",
    ]


def _mean_and_worst(ratios: Series) -> tuple[str, str]:
    import numpy as np

    if ratios.empty:
        return "", ""
    return f"{np.exp(np.log(ratios).mean()):.2f}", f"{ratios.max():.2f}"


def _lists(frame: DataFrame, solved: DataFrame, seconds: DataFrame) -> list[str]:
    """The tasks to look at: wrong results, and those that one side only solves."""
    ours = set(solved[solved["tool"] == OURS]["task"])
    tried = set(frame[frame["tool"] == OURS]["task"])
    others = set(solved[solved["tool"] != OURS]["task"])
    beside = set(frame[frame["tool"] != OURS]["task"])
    wrong = frame[frame["verdict"] == "wrong"]
    peers = [tool for tool in seconds if tool != OURS]
    ratio = (seconds[OURS] / seconds[peers].min(axis=1)) if peers and OURS in seconds else None
    lists = {
        "Wrong": [f"{r.task} ({r.tool}: {r.value})" for r in wrong.itertuples()],
        "Solved by a peer and not by symcheck": sorted((others & tried) - ours),
        "Solved by symcheck and by no peer that was tried": sorted((ours & beside) - others),
    }
    if ratio is not None:
        slow = ratio[ratio > 1].sort_values(ascending=False)
        slow = slow[seconds[peers].min(axis=1)[slow.index] >= SMALL]
        lists["Slower than the best peer, of tasks of at least 1 s"] = [
            f"{task} ({value:.2f})" for task, value in slow.items()
        ]
    lines = []
    for title, entries in lists.items():
        lines += [f"{title}: {len(entries)}" + (":" if entries else "."), ""]
        lines += [f"- {entry}" for entry in entries] + ([""] if entries else [])
    return lines


def _picture(seconds: DataFrame, frame: DataFrame, path: Path) -> None:
    """A scatter plot of symcheck against each peer, and a cactus plot of all tools."""
    import matplotlib.pyplot as plt

    figure, (scatter, cactus) = plt.subplots(1, 2, figsize=(10.5, 4.6), layout="constrained")
    limit = float(frame["limit"].max()) * 2  # unsolved tasks stand on this line
    for tool, color in zip(_tools(frame), COLORS, strict=False):
        if tool in seconds:
            ordered = seconds[tool].dropna().sort_values()
            width = 2.4 if tool == OURS else 1.3
            cactus.plot(
                range(1, len(ordered) + 1), ordered, color=color, linewidth=width, label=tool
            )
        if tool in seconds and tool != OURS and OURS in seconds:
            tried = frame[frame["tool"] == tool]["task"]
            pairs = seconds.reindex(tried)[[tool, OURS]].fillna(limit)
            scatter.scatter(pairs[tool], pairs[OURS], s=14, color=color, alpha=0.6, label=tool)
    _diagonals(scatter, limit)
    scatter.set(
        title="each task: below the line, symcheck is faster",
        xlabel="peer, processor seconds",
        ylabel="symcheck, processor seconds",
    )
    cactus.set(
        title="tasks solved within a time each",
        xlabel="tasks",
        ylabel="processor seconds",
        yscale="log",
    )
    cactus.grid(True, which="major", alpha=0.3)
    for axes in (scatter, cactus):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _diagonals(axes: Axes, limit: float) -> None:
    """Logarithmic axes, lines of equal and of tenfold times, and the line of unsolved tasks."""
    least = 0.1
    for factor, style in ((1, "-"), (10, ":"), (0.1, ":")):
        axes.plot(
            [least, limit], [least * factor, limit * factor], style, color="#aaaaaa", zorder=0
        )
    axes.axhline(limit, color="#dddddd", zorder=0)
    axes.axvline(limit, color="#dddddd", zorder=0)
    axes.annotate("unsolved", (limit, least), rotation=90, ha="right", va="bottom", fontsize=8)
    axes.set(xscale="log", yscale="log", xlim=(least, limit * 1.5), ylim=(least, limit * 1.5))
