"""The result of an experiment: a sequence of rows that converts, plots and saves itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, overload

from symcheck.constant_values import ConstantValue
from symcheck.experiments.rows import Row, constant_names, constant_text, records
from symcheck.tables import Table, optional_package

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

__all__ = ["Experiment"]


@dataclass(frozen=True, repr=False)
class Experiment(Sequence[Row]):
    """The rows of an experiment, in the order of the given constants.

    Attributes:
        rows: one for each property and combination of constants; the last constant changes fastest.
        varying: the constants that were given several values.
        complete: False if the experiment was stopped by Ctrl-C: rows are missing.
    """

    rows: tuple[Row, ...]
    varying: tuple[str, ...] = ()
    complete: bool = True

    @classmethod
    def load(cls, path: str | Path) -> Experiment:
        """Read a table that `save` or -exportresults has written: .csv, .json, a data frame.

        The constants with several values are the `varying` ones.

        Raises:
            UsageError: the file cannot be read, or has another form.
        """
        from symcheck.experiments.reader import read_rows

        rows = tuple(read_rows(path))
        names = constant_names(rows)
        values = {n: {r.constants[n] for r in rows if n in r.constants} for n in names}
        return cls(rows, tuple(n for n in names if len(values[n]) > 1))

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> Experiment: ...
    def __getitem__(self, index: int | slice) -> Row | Experiment:
        if isinstance(index, slice):
            return replace(self, rows=self.rows[index])
        return self.rows[index]

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        stopped = "" if self.complete else ", stopped before the end"
        rows, errors = len(self), len(self.errors)
        counts = f"{rows} row{'s' * (rows != 1)}, {errors} error{'s' * (errors != 1)}"
        return f"<Experiment: {counts}{stopped}>"

    def _repr_html_(self) -> str:
        names = constant_names(self.rows)
        cells = []
        for r in self.rows:
            constants = [constant_text(r.constants[n]) if n in r.constants else "" for n in names]
            cells.append([r.name, *constants, r.text, r.error or r.accuracy])
        note = "" if self.complete else repr(self)
        return Table.of(["property", *names, "value", "accuracy"], cells, note)._repr_html_()

    @property
    def errors(self) -> tuple[Row, ...]:
        """The rows without a value."""
        return tuple(r for r in self.rows if r.error is not None)

    def select(self, name: str | None = None, /, **constants: ConstantValue) -> Experiment:
        """The rows of the property of a name (or text), or with these values of constants."""
        chosen = (
            r
            for r in self.rows
            if name in (None, r.name) and all(r.constants.get(n) == v for n, v in constants.items())
        )
        return replace(self, rows=tuple(chosen))

    def to_frame(self) -> DataFrame:
        """A data frame: property, each constant, value, lower, upper, accuracy, size, times, error.

        Raises UnsupportedError if pandas is not installed.
        """
        frame: DataFrame = optional_package("pandas", "frames").DataFrame(records(self.rows))
        return frame

    to_pandas = to_frame  # the usual name of polars and pyarrow

    def plot(
        self, x: str | None = None, by: str | Sequence[str] | None = None, axes: Axes | None = None
    ) -> Axes:
        """Plot the values with matplotlib, a line for each property and value of `by`.

        Lower and upper bounds of values are drawn as a band, or as bars where there are few points.

        Args:
            x: the constant on the horizontal axis; None for the first with several values.
            by: the constants that tell lines apart; None for all others with several values.
            axes: where to draw; None for new axes.

        Returns:
            The axes.

        Raises:
            UsageError: there is no such constant, or another one has several values too.
            UnsupportedError: matplotlib is not installed.
        """
        from symcheck.experiments.plot import plot

        names = (by,) if isinstance(by, str) else by
        return plot(self.rows, self.varying, x, names, axes)

    def save(self, path: str | Path) -> None:
        """Write a table (.csv, .json, .parquet) or a plot (.png, .svg, .pdf), whole or not at all.

        Raises:
            UsageError: the extension is another one, or the file cannot be written.
            UnsupportedError: the file needs a package that is not installed.
        """
        from symcheck.experiments.files import save

        save(self.rows, self.varying, path)
