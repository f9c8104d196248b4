"""Sliders for the constants of a model: its properties are checked at each position."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from decimal import Decimal
from html import escape
from io import BytesIO
from pathlib import Path
from time import monotonic

from ipywidgets import (  # type: ignore[import-untyped]
    HTML,
    HBox,
    Image,
    SelectionSlider,
    VBox,
)

from symcheck.api.arguments import properties_file
from symcheck.api.model import Model
from symcheck.constant_values import typed_value, value_lists
from symcheck.errors import Interrupted, SymcheckError, UsageError
from symcheck.experiments.rows import constant_text
from symcheck.experiments.run import Progress, experiment, given_model
from symcheck.experiments.table import Experiment
from symcheck.options import OptionValues
from symcheck.semantics.diagnostics import suggest
from symcheck.syntax.ast import Type
from symcheck.syntax.declarations import Constant, PropertiesFile
from symcheck.tables import optional_package
from symcheck.view.states import state_graph

__all__ = ["Sliders", "sliders"]

_STEPS = 20
"""Steps from end to end of a slider for a double, unless a step is given."""
_MOST_POSITIONS = 1001
_MOST_POINTS = 41
"""Points of a curve: it is computed while the reader waits."""
_PATIENCE = 10.0
"""Seconds that a check may take, and a curve, unless the option `time_limit` is given."""
_SETTLES = 0.05
"""Seconds in which further movements of sliders replace a check that has not begun."""

Range = tuple[float, float] | tuple[float, float, float] | Sequence[bool | float] | str | None
"""(low, high), (low, high, step), a text such as "1:2:9", or the positions as a list; None for true
and false."""


class Sliders(VBox):  # type: ignore[misc]
    """Sliders for constants, a table of the values, and pictures; `sliders` makes it.

    A check begins when a slider is let go. One that takes too long ends with a message, and what is
    moved meanwhile is checked once, at the last positions.

    Attributes:
        inputs: the slider of each constant.
        results: the values at the current positions; None before the first check, or after an
            error.
        curve: the values over the constant `across`; None without one.
        message: what went wrong; empty if nothing did.
    """

    results: Experiment | None = None
    curve: Experiment | None = None
    message = ""

    def __init__(
        self,
        model: Model,
        properties: PropertiesFile,
        constants: Mapping[str, Range],
        across: str | None = None,
        *,
        graph: bool = False,
    ) -> None:
        self._model, self._properties = model, properties
        self._across, self._graph = across, graph
        self._curve_at: Mapping[str, str] | None = None
        self._waiting: asyncio.TimerHandle | None = None
        self.inputs = {n: _slider(model, properties, n, r) for n, r in constants.items()}
        if across is not None and across not in constants:
            hint = suggest(across, constants)
            raise UsageError(f"across={across!r}: there is no such slider", hint=hint)
        self._table, self._note = HTML(), HTML()
        self._plot = Image(format="svg+xml", layout={"max_width": "100%"})
        self._states = Image(format="svg+xml", layout={"max_width": "100%"})
        for slider in self.inputs.values():
            slider.observe(self._moved, "value")
        pictures = [self._plot] * (across is not None) + [self._states] * graph
        super().__init__([*self.inputs.values(), self._table, self._note, HBox(pictures)])
        self.refresh()

    @property
    def positions(self) -> dict[str, str]:
        """The value of each constant that has a slider."""
        return {name: slider.value for name, slider in self.inputs.items()}

    def refresh(self) -> None:
        """Check at the current positions, and show what comes out."""
        self._waiting = None
        self._say("<em>checking …</em>")
        self.results, self.message = None, ""
        try:
            self.results = experiment(self._model, self._properties, self.positions)
            self._table.value = self.results._repr_html_()
            if self._across is not None:
                self._draw_curve(self._across)
            if self._graph:
                self._draw_states()
        except SymcheckError as error:
            self.message = str(error)
            if self.results is None:
                self._table.value = ""
        self._say(f"<pre>{escape(self.message)}</pre>" if self.message else "")

    def _say(self, html: str) -> None:
        self._note.value = html

    def _moved(self, _: object) -> None:
        """Check soon, and once for all movements until then; at once where no loop runs."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self.refresh()
            return
        if self._waiting is not None:
            self._waiting.cancel()
        self._waiting = loop.call_later(_SETTLES, self.refresh)

    def _draw_curve(self, across: str) -> None:
        """Plot the values over a constant, with a line at its current position."""
        optional_package("matplotlib", "plot")
        from matplotlib.figure import Figure

        others = {name: value for name, value in self.positions.items() if name != across}
        if self.curve is None or others != self._curve_at:
            self.curve, self._curve_at = None, others
            points = _points(self.inputs[across].options)
            limit = self._model.options.time_limit or _PATIENCE
            until = monotonic() + limit

            def in_time(_: Progress) -> None:
                if monotonic() > until:
                    raise Interrupted("the curve takes too long")

            self.curve = experiment(
                self._model, self._properties, {**others, across: points}, progress=in_time
            )
        figure = Figure(figsize=(6.4, 3.2), layout="constrained")
        axes = self.curve.plot(across, axes=figure.subplots())
        here = typed_value(self.inputs[across].value)
        if not isinstance(here, bool | str):
            axes.axvline(float(here), color="0.4", linestyle=":")
        drawn = BytesIO()
        figure.savefig(drawn, format="svg")
        self._plot.value = drawn.getvalue()
        if not self.curve.complete:
            self.message = f"the curve has {len(self.curve)} points: more take over {limit:g} s"

    def _draw_states(self) -> None:
        names = {c.name for c in self._model.program.constants}
        chosen = {name: value for name, value in self.positions.items() if name in names}
        model = self._model.with_constants({**self._model.given_constants, **chosen})
        self._states.value = state_graph(model).svg.encode()


def sliders(
    model: Model | str | Path,
    properties: PropertiesFile | str | Path,
    *,
    across: str | None = None,
    graph: bool = False,
    options: OptionValues | None = None,
    **constants: Range,
) -> Sliders:
    """Sliders for the constants of a model and of properties, with the values of the properties.

    Args:
        model: a file, a text, or a loaded model; a constant begins at the value that the model
            gives it, or in the middle.
        properties: a file, a text, or parsed properties.
        across: a constant over which the values are plotted.
        graph: draw the state graph, too.
        options: those of `symcheck.Options`, such as {"engine": "sparse"}. A check may take
            `time_limit` seconds, by default 10.
        constants: the range of each constant: (low, high), (low, high, step), a text such as
            "1:2:9", or a list of values; None for a constant that is true or false.

    Returns:
        A widget.

    Raises:
        UsageError: a constant is unknown or has a value already, or a range is faulty.
        SyntaxFault: a text is faulty.

    Examples:
        >>> from symcheck.notebook import sliders  # doctest: +SKIP
        >>> sliders(walk, 'P=? [ F "won" ]', across="p", p=(0.1, 0.9), N=(2, 20))  # doctest: +SKIP
    """
    given = given_model(model, options or {})
    if given.options.time_limit is None:
        given = given.with_options(time_limit=_PATIENCE)
    return Sliders(given, properties_file(properties), constants, across, graph=graph)


def _slider(model: Model, properties: PropertiesFile, name: str, given: Range) -> SelectionSlider:
    """The slider of a constant. Raises UsageError."""
    declared = {c.name: c for c in (*properties.constants, *model.program.constants)}
    if name not in declared:
        raise UsageError(f"there is no constant {name}", hint=suggest(name, declared))
    constant = declared[name]
    if constant.value is not None:
        raise UsageError(
            f"the constant {name} has a value in the text",
            hint=f"leave it open: const {constant.type.value} {name};",
        )
    texts = _positions(constant, given)
    start = model.given_constants.get(name)
    chosen = len(texts) // 2
    if start is not None and typed_value(start) in map(typed_value, texts):
        chosen = list(map(typed_value, texts)).index(typed_value(start))
    return SelectionSlider(
        options=texts, value=texts[chosen], description=name, continuous_update=False
    )


def _positions(constant: Constant, given: Range) -> list[str]:
    """The positions of a slider, as texts. Raises UsageError."""
    name = constant.name
    values: object = ["false", "true"] if given is None else given
    if isinstance(given, tuple):
        if not 2 <= len(given) <= 3 or not all(isinstance(x, int | float) for x in given):
            raise UsageError(f"{name}={given!r}: expected (low, high), (low, high, step) or a list")
        low, high, *step = given
        apart = Decimal(str(high)) - Decimal(str(low))
        by = step[0] if step else 1 if constant.type is Type.INT else apart / _STEPS
        values = f"{low}:{by}:{high}"
    elif given is None and constant.type is not Type.BOOL:
        raise UsageError(f"{name}=None: it is no constant that is true or false")
    texts = [constant_text(value) for value in value_lists({name: values})[name]]
    if len(texts) > _MOST_POSITIONS:
        raise UsageError(
            f"{name}: {len(texts):,} positions, and a slider has at most {_MOST_POSITIONS:,}"
        )
    return texts


def _points(texts: Sequence[str]) -> list[str]:
    """The positions at which a curve is computed: all, or as many at equal distances."""
    each = -(-len(texts) // _MOST_POINTS)
    return [*texts[:-1:each], texts[-1]]
