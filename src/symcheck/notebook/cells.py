"""The cells `%%prism`, which holds a model, and `%%pctl`, which holds properties of one."""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from html import escape
from keyword import iskeyword
from typing import overload

from IPython.core.interactiveshell import InteractiveShell
from IPython.core.magic_arguments import MagicArgumentParser
from IPython.display import HTML, DisplayHandle, display

from symcheck.api.model import Model
from symcheck.api.progress import Reporter
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result, bounds_text, show_value
from symcheck.check.results import position
from symcheck.constant_values import constant_values
from symcheck.errors import InputError, SymcheckError, UsageError
from symcheck.experiments.run import experiment
from symcheck.experiments.table import Experiment
from symcheck.lsp.answers import Document
from symcheck.options import make_options, read_options
from symcheck.semantics.binding.bind import split_constants, undefined_constants
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_model, parse_properties
from symcheck.tables import Table, counted

__all__ = ["Cells", "Results"]

_COLOURS = {
    "comment": ("comment", "#6a737d"),
    "keyword": ("keyword", "#007020"),
    "number": ("number", "#a35200"),
    "function": ("builtin", "#06287e"),
    "variable": ("variable", "#00496b"),
    "string": ("string", "#a31515"),
}
"""A colour of JupyterLab's theme for a kind of word, and one for where there is no theme."""


class _CellError(Exception):
    """What is wrong in a cell. It is shown as it is, without the lines of Python behind it."""

    def _render_traceback_(self) -> list[str]:
        return str(self).splitlines()


@contextmanager
def _shown_errors() -> Iterator[None]:
    try:
        yield
    except SymcheckError as error:
        raise _CellError(str(error)) from None


class Results(Sequence[Result]):
    """The results of the properties of a cell, in order and by name. It draws itself as a table.

    faults: of the properties that have no result.
    """

    def __init__(
        self,
        checked: Sequence[PropertyInstance],
        results: Sequence[Result],
        warnings: Sequence[str] = (),
        faults: Sequence[InputError] = (),
    ) -> None:
        self._checked, self._results = tuple(checked), tuple(results)
        self._warnings, self.faults = tuple(warnings), tuple(faults)

    @overload
    def __getitem__(self, key: int | str) -> Result: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[Result, ...]: ...
    def __getitem__(self, key: int | str | slice) -> Result | tuple[Result, ...]:
        if isinstance(key, slice):
            return self._results[key]
        return self._results[position([p.name for p in self._checked], key)]

    def __len__(self) -> int:
        return len(self._results)

    def _table(self) -> Table:
        rows = [
            (
                p.full_title,
                show_value(r.value),
                str(r.accuracy),
                bounds_text(r),
                f"{r.seconds:.3g} s",
            )
            for p, r in zip(self._checked, self._results, strict=True)
        ]
        told = (note for r in self._results for note in (*r.warnings, *r.notes))
        notes = [*self._warnings, *told]
        head = ("property", "value", "accuracy", "bounds", "time")
        return Table.of(head, rows, "\n".join(dict.fromkeys(notes)))

    def __repr__(self) -> str:
        return str(self._table())

    def _repr_html_(self) -> str:
        return self._table()._repr_html_()


class Cells:
    """The two kinds of cells, in a shell whose variables hold the models."""

    def __init__(self, shell: InteractiveShell) -> None:
        self._shell = shell
        self._arguments = {name: _arguments(name) for name in ("prism", "pctl")}
        for name, cell in (("prism", self.prism), ("pctl", self.pctl)):
            shell.register_magic_function(cell, "cell", name)

    def prism(self, line: str, cell: str) -> None:
        """Read a model from the cell: `%%prism NAME [CONSTANTS] [-o OPTION=VALUE]…`.

        NAME is the variable that takes the model, CONSTANTS are such as N=3,p=0.5, and options are
        those of symcheck.Options. The text is shown in colours.
        """
        asked = self._arguments["prism"].parse_argstring(line)
        text = "\n" + cell  # lines are counted as in the cell, whose first one is the magic
        with _shown_errors():
            _check_variable(asked.name)
            program = parse_model(text, asked.name)
            options = make_options(_options(asked))
            model = Model(program, constant_values(asked.constants), options).checked()
            document = Document(asked.name, text, "prism")
            given = model.given_constants
            missing = [c.name for c in undefined_constants(program) if c.name not in given]
            about = "" if missing else f"{asked.name}: {model.type.value}"
            warnings = [] if missing else [str(w) for w in model.warnings]
        self._shell.user_ns[asked.name] = model
        about = about or f"{asked.name}, with open constants: {', '.join(missing)}"
        display(HTML(_model_html(about, document, warnings)))

    def pctl(self, line: str, cell: str) -> Results | Experiment | None:
        """Check the properties of the cell: `%%pctl NAME [CONSTANTS] [-r RESULTS] [-o …]…`.

        NAME is the variable of the model, and RESULTS one that takes the results. Ranges of
        constants, as in N=1:10, make a table. Options are those of symcheck.Options.
        """
        asked = self._arguments["pctl"].parse_argstring(line)
        with _shown_errors():
            model = self._shell.user_ns.get(asked.name)
            if not isinstance(model, Model):
                raise UsageError(f"{asked.name} is no model", hint="%%prism NAME makes one")
            if asked.results:  # those of the run before are no results of this one
                _check_variable(asked.results)
                self._shell.user_ns.pop(asked.results, None)
            found = _checked(model, asked, "\n" + cell)
        faults = found.faults if isinstance(found, Results) else ()
        if asked.results and (found or not faults):
            self._shell.user_ns[asked.results] = found
        if faults:
            if found:
                display(found)
            raise _CellError("\n".join(dict.fromkeys(map(str, faults))))
        return found


def _check_variable(name: str) -> None:
    """Raise UsageError if Python cannot read a variable of this name."""
    if not name.isidentifier() or iskeyword(name):
        why = "a word of Python" if iskeyword(name) else "no name in Python"
        plain = re.sub(r"\W", "_", name)
        better = f"{plain}_" if iskeyword(plain) else f"_{plain}" if plain[:1].isdigit() else plain
        raise UsageError(f"'{name}' is {why}", hint=f"choose another name, such as {better}")


def _arguments(name: str) -> MagicArgumentParser:
    parser = MagicArgumentParser(f"%%{name}")
    parser.add_argument("name")
    parser.add_argument("constants", nargs="?", default="")
    parser.add_argument("-o", "--option", action="append", default=[], metavar="NAME=VALUE")
    if name == "pctl":
        parser.add_argument("-r", "--results", metavar="NAME")
    return parser


def _options(asked: Namespace) -> dict[str, object]:
    given = dict(text.partition("=")[::2] for text in asked.option)
    return read_options(given)


def _checked(model: Model, asked: Namespace, text: str) -> Results | Experiment:
    """The results of a cell, with a line of progress above them while they are computed."""
    file = parse_properties(text, f"properties of {asked.name}")
    line = DisplayHandle()
    line.display(HTML(""))
    reporter = Reporter(lambda text: line.update(HTML(f"<em>{escape(text)}</em>")))
    if options := _options(asked):
        model = model.with_options(**options)  # type: ignore[arg-type]
    model = replace(model, observer=reporter)
    try:
        if ":" in asked.constants:
            return experiment(model, file, asked.constants, progress=reporter)
        return _one_by_one(model, file, asked, reporter)
    finally:
        line.update(HTML(""))


def _one_by_one(
    model: Model, file: PropertiesFile, asked: Namespace, reporter: Reporter
) -> Results:
    """The results of all properties. A faulty one does not stop the others."""
    split = split_constants(model.program, file, constant_values(asked.constants))
    if split.of_model:
        model = model.with_constants({**model.given_constants, **split.of_model})
    values = {n: (v,) for n, v in split.of_properties.items()}
    checked: list[PropertyInstance] = []
    results: list[Result] = []
    faults: list[InputError] = []
    try:
        instances = model.instances(file, values, range(len(file.properties)))
        prepared = model.prepared_for(instances)
        for number, instance in enumerate(instances, 1):
            reporter.say(f"{number} of {len(instances)}: {instance.full_title}")
            try:
                results.append(prepared.check(instance, reporter.iteration))
                checked.append(instance)
            except InputError as error:
                faults.append(_with_hint(asked.name, error))
        built = prepared.model
        of_states = built.state_warnings if built.is_built else []
        of_text = model.warnings if split.of_model else []  # else %%prism has told them
        warnings = [d.message for d in (*of_text, *of_states)]
        told = [*(d.message for d in split.warnings), *warnings]
        return Results(checked, results, told, faults)
    except (SymcheckError, KeyboardInterrupt) as error:
        if results:
            display(Results(checked, results))  # what is finished is kept
        if isinstance(error, InputError):
            raise _with_hint(asked.name, error) from None
        if isinstance(error, SymcheckError):
            raise
        raise UsageError(f"interrupted after {counted(len(results), 'property')}") from None


def _with_hint(name: str, error: InputError) -> InputError:
    """An error with what to write in a cell where a constant has no value."""
    return InputError(
        *(
            replace(d, hint=f"write its value behind %%pctl {name}, as in N=4,p=0.5")
            if d.code == "undefined-constant"
            else d
            for d in error.diagnostics
        )
    )


# ------------------------------------------------------------------------------------------- HTML


def _model_html(about: str, document: Document, warnings: Sequence[str]) -> str:
    """A line about a model, its warnings, and its text to be unfolded."""
    style = "margin:0.3em 0;line-height:1.3;font-family:var(--jp-code-font-family,monospace)"
    told = "".join(f'<pre style="{style}">{escape(warning)}</pre>' for warning in warnings)
    return (
        f"<details><summary>{escape(about)}</summary>"
        f'<pre style="{style}">{_coloured(document)}</pre></details>{told}'
    )


def _coloured(document: Document) -> str:
    """The text of a document as HTML."""
    text, pieces, at = document.text, [], 0
    for start, end, kind in document.colours():
        name, plain = _COLOURS.get(kind, ("variable", "#00496b"))
        colour = f"var(--jp-mirror-editor-{name}-color, {plain})"
        word = escape(text[start:end])
        pieces += [escape(text[at:start]), f'<span style="color:{colour}">{word}</span>']
        at = end
    return "".join([*pieces, escape(text[at:])]).strip("\n")
