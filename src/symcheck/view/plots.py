"""Plots by matplotlib (extra `plot`).

Each function draws into the given axes, or into new ones, and returns them. Each raises
UnsupportedError if matplotlib is not installed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import IO, TYPE_CHECKING, Protocol, runtime_checkable

from symcheck.charts import BLUE, axes_of, pyplot
from symcheck.errors import UnsupportedError, UsageError
from symcheck.matrices.rows import Int64s

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from symcheck.numerics.linear.problem import Progress
    from symcheck.symbolic.model import Iteration

__all__ = ["plot_blocks", "plot_bounds", "plot_orders", "plot_search", "read_image"]

_MOST_OCCURRENCES = 20_000
"""More rectangles than this are not legible, and take matplotlib seconds."""

_ORANGE, _GREEN = "#c8641b", "#2b7a33"


class Ordered(Protocol):
    """A model built under one variable order (`symcheck.teach.OrderFrame`)."""

    @property
    def order(self) -> tuple[str, ...]: ...
    @property
    def states_nodes(self) -> int: ...
    @property
    def matrix_nodes(self) -> int | None: ...


def read_image(file: IO[bytes]) -> NDArray[np.float32]:
    """The pixels of a PNG image, float32[height, width, 4]."""
    pixels: NDArray[np.float32] = pyplot().imread(file)
    return pixels


@runtime_checkable
class Framed(Protocol):
    """A frame of a trace of the search (`symcheck.teach.SearchFrame`)."""

    @property
    def iteration(self) -> Iteration: ...


def _require(given: object, kind: type, expected: str) -> None:
    if not isinstance(given, kind):
        raise UsageError(f"{expected}, not an object of the type {type(given).__name__}")


def plot_search(
    iterations: Iterable[Iteration | Framed], axes: Axes | None = None, title: str = ""
) -> Axes:
    """Plot BDD nodes of the reached set and of the frontier per iteration, and states on the right.

    Args:
        iterations: the frames of `teach.frontiers`, or the iterations of a search with an observer
            (without one, nothing is counted).
        axes: where to draw.
        title: the caption.
    """
    _require(iterations, Iterable, "plot_search takes the frames of teach.frontiers(model)")
    counted = [i.iteration if isinstance(i, Framed) else i for i in iterations]
    seen = [i for i in counted if i.states is not None]
    axes = axes_of(axes)
    number = [i.number for i in seen]
    axes.plot(number, [i.nodes or 0 for i in seen], color=BLUE, label="nodes, reached")
    axes.plot(number, [i.frontier_nodes or 0 for i in seen], color=_ORANGE, label="nodes, frontier")
    axes.set(xlabel="iteration", ylabel="BDD nodes", title=title)
    right = axes.twinx()
    right.plot(number, [i.states or 0 for i in seen], color=_GREEN, linestyle="--", label="states")
    right.set_ylabel("states", color=_GREEN)
    for side in (axes, right):
        side.set_ylim(bottom=0)
    handles = axes.get_legend_handles_labels()[0] + right.get_legend_handles_labels()[0]
    axes.legend(handles=handles, fontsize="small", frameon=False)
    return axes


def plot_bounds(
    steps: Iterable[Progress],
    state: int = 0,
    axes: Axes | None = None,
    truth: float | None = None,
    title: str = "",
) -> Axes:
    """Plot the lower and upper bound of one unknown per iteration, with the gap shaded.

    Args:
        steps: the iterations of a numerical method: `steps` of `teach.until_trace`.
        state: the number of the unknown.
        axes: where to draw.
        truth: a value that is drawn as a line for comparison.
        title: the caption.
    """
    _require(steps, Iterable, "plot_bounds takes teach.until_trace(model, left, right).steps")
    seen = list(steps)
    axes = axes_of(axes)
    number = [s.iteration for s in seen if s.lower is not None]
    lower = [float(s.lower[state]) for s in seen if s.lower is not None]
    upper = [float(s.upper[state]) for s in seen if s.upper is not None]
    if len(upper) == len(lower):
        axes.fill_between(number, lower, upper, color="#ece2f3")
        axes.plot(number, upper, color=_ORANGE, label="upper bound")
    axes.plot(number, lower, color=BLUE, label="lower bound" if upper else "iterate")
    if truth is not None:
        axes.axhline(truth, color="#404040", linewidth=0.8, linestyle=":", label="value")
    axes.set(xlabel="iteration", ylabel="value", title=title)
    axes.legend(fontsize="small", frameon=False)
    return axes


def plot_orders(frames: Sequence[Ordered], axes: Axes | None = None, title: str = "") -> Axes:
    """Plot the nodes of reachable states and matrix under each variable order, fewest first.
    Without CUDD there is no matrix.
    """
    _require(frames, Iterable, "plot_orders takes the frames of teach.compare_orders(model)")
    best = sorted(frames, key=lambda f: (f.matrix_nodes or 0, f.states_nodes), reverse=True)
    axes = axes_of(axes, (6.4, 1.0 + 0.32 * len(best)))
    positions = range(len(best))
    if matrix := [f.matrix_nodes for f in best if f.matrix_nodes is not None]:
        axes.barh([p + 0.2 for p in positions], matrix, height=0.38, color=BLUE, label="matrix")
    axes.barh(
        [p - 0.2 for p in positions],
        [f.states_nodes for f in best],
        height=0.38,
        color=_GREEN,
        label="states",
    )
    axes.set_yticks(list(positions), [" < ".join(f.order) for f in best], fontsize="small")
    axes.set(xlabel="nodes", title=title)
    axes.legend(fontsize="small", frameon=False)
    return axes


@runtime_checkable
class Blocked(Protocol):
    """The blocks of a matrix (`symcheck.teach.BlockStructure`)."""

    @property
    def blocks(self) -> Int64s: ...
    @property
    def occurrences(self) -> Int64s: ...


def plot_blocks(matrix: Blocked, axes: Axes | None = None, title: str = "") -> Axes:
    """Plot the occurrences of the distinct blocks in the matrix, one colour per block.

    Raises:
        UnsupportedError: there are more than 20 000 occurrences.
    """
    _require(matrix, Blocked, "plot_blocks takes teach.block_structure(model)")
    occurrences = matrix.occurrences
    if len(occurrences) > _MOST_OCCURRENCES:
        raise UnsupportedError(
            f"the matrix has {len(occurrences):,} block occurrences, and at most "
            f"{_MOST_OCCURRENCES:,} are drawn",
            hint="draw a smaller model",
        )
    axes = axes_of(axes, (5.2, 5.0))
    from matplotlib.patches import Rectangle

    colours = pyplot().get_cmap("tab20")
    number = {int(b): i for i, b in enumerate(dict.fromkeys(occurrences[:, 1].tolist()))}
    for _, block, row, column in occurrences.tolist():
        height, width, _ = matrix.blocks[block].tolist()
        colour = colours(number[block] % 20)
        axes.add_patch(
            Rectangle(
                (column, row),
                width,
                height,
                facecolor=colour,
                edgecolor="#404040",
                linewidth=0.3,
                alpha=0.75,
            )
        )
    rows, columns = (
        (occurrences[:, 2 + i] + matrix.blocks[occurrences[:, 1], i]).max(initial=1) for i in (0, 1)
    )
    axes.set(xlim=(0, columns), ylim=(rows, 0), xlabel="to state", ylabel="from state", title=title)
    axes.set_aspect("equal")
    return axes
