"""Names of files: of one for each combination of constants, and of -exportresults."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import UsageError
from symcheck.experiments.rows import Row

__all__ = [
    "NO_CONSTANTS",
    "ConstantTexts",
    "check_files",
    "check_results_file",
    "instance_path",
    "of_switch",
    "write_results",
]

ConstantTexts = Mapping[str, str]
"""Values of constants, as they are printed."""

NO_CONSTANTS: ConstantTexts = MappingProxyType({})

_TEXT = ("", ".txt", ".res", ".log", ".dat")
"""The extensions of a table in PRISM's default format."""


def instance_path(path: str, varying: ConstantTexts) -> str:
    """The file for one combination of constants: `out_N=3.tra` for `out.tra`; 'stdout' stays."""
    if path == "stdout" or not varying:
        return path
    whole = Path(path)
    suffix = "".join(
        f"_{name}={re.sub(r'[^-+.,=0-9A-Za-z]', '_', value)}" for name, value in varying.items()
    )
    return str(whole.with_name(f"{whole.stem}{suffix}{whole.suffix}"))


def _target(argument: str) -> tuple[Path, list[str]]:
    """File and formats of `FILE:KIND,KIND`; other colons belong to the file.

    No formats: the extension of the file decides.
    """
    path, colon, kinds = argument.rpartition(":")
    if colon:
        return Path(path), kinds.split(",")
    return Path(argument), ["text"] if Path(argument).suffix in _TEXT else []


@contextmanager
def of_switch(name: str) -> Iterator[None]:
    """A context whose UsageErrors name a switch."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{name}: {error.message}", hint=error.hint) from None


def check_files(a: Arguments) -> None:
    """Find faults of some export switches before anything is computed. Raises UsageError."""
    if a.exportstrat is not None:
        from symcheck.exchange.strategies.files import strategy_target

        with of_switch("-exportstrat"):
            strategy_target(a.exportstrat)
    if a.exportpareto is not None:
        from symcheck.exchange.pareto_fronts import check_front_file

        with of_switch("-exportpareto"):
            check_front_file(a.exportpareto)
    if a.exportiterations is not None:
        from symcheck.exchange.iterations import check_iterations_file

        try:
            check_iterations_file(a.exportiterations)
        except UsageError as error:
            raise UsageError(
                f"-exportiterations: {error}",
                hint="-exportiterations iterations.csv; -exportpage iterations.html plays them",
            ) from None
    if a.exporttests is not None:
        from symcheck.check.testing.property_tests import check_report_file

        with of_switch("-exporttests"):
            check_report_file(a.exporttests)
        _check_folder("-exporttests", Path(a.exporttests))
    if a.exportcounterexample is not None:
        from symcheck.check.counterexample import check_counterexample_file

        with of_switch("-exportcounterexample"):
            check_counterexample_file(a.exportcounterexample)
        _check_folder("-exportcounterexample", Path(a.exportcounterexample))
    if a.exportpage is not None:
        page = Path(a.exportpage)
        if page.suffix.lower() not in (".html", ".htm"):
            name = page.name.partition(".")[0]
            raise UsageError(
                f"-exportpage: '{page}' is no HTML file", hint=f"-exportpage {name}.html"
            )
        _check_folder("-exportpage", page)


def _check_folder(switch: str, path: Path) -> None:
    if not path.parent.is_dir():
        raise UsageError(f"{switch}: there is no folder '{path.parent}'")


def check_results_file(argument: str) -> None:
    """Find faults of -exportresults before anything is computed. Raises UsageError."""
    from symcheck.experiments.files import check_extension
    from symcheck.experiments.prism_tables import render

    path, kinds = _target(argument)
    with of_switch("-exportresults"):
        render([], (), kinds)
    if not path.name:
        raise UsageError(f"-exportresults: '{argument}' names no file")
    if path.is_dir():
        raise UsageError(f"-exportresults: '{path}' is a folder")
    _check_folder("-exportresults", path)
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"-exportresults: '{path}' may not be written")
    if not kinds:
        try:
            check_extension(path)
        except UsageError as error:
            raise UsageError(
                f"-exportresults: {error}", hint=f"'{path}:text' writes a text under any name"
            ) from None


def write_results(argument: str, rows: Sequence[Row], varying: Sequence[str]) -> None:
    """Write results to the file of -exportresults, completely or not at all. Raises UsageError."""
    from symcheck.experiments.files import save
    from symcheck.experiments.prism_tables import render
    from symcheck.whole_file import write_whole

    path, kinds = _target(argument)
    text = render(rows, varying, kinds)
    with of_switch("-exportresults"):
        if str(path) == "stdout":
            print(f"\nResults:\n\n{text}", end="", flush=True)
        elif kinds:
            write_whole(path, lambda temporary: _write(temporary, text))
        else:
            save(rows, varying, path)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
