"""Names of files: of one for each combination of constants, and of -exportresults."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
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
def of_switch(name: str, hint: str | None = None) -> Iterator[None]:
    """A context whose UsageErrors name a switch. hint: replaces theirs."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{name}: {error.message}", hint=hint or error.hint) from None


def check_files(a: Arguments) -> None:
    """Find faults of some export switches before anything is computed. Raises UsageError."""
    if a.exportstrat is not None:
        from symcheck.exchange.strategies.files import strategy_target

        with of_switch("-exportstrat"):
            strategy_target(a.exportstrat)
    if a.exportpareto is not None:
        from symcheck.exchange.pareto_fronts import front_extension

        with of_switch("-exportpareto"):
            _check(a.exportpareto, front_extension)
    if a.exportregions is not None:
        from symcheck.constant_values import parameter_ranges
        from symcheck.exchange.region_files import regions_extension

        ranges = parameter_ranges(",".join(a.param), "-param")
        with of_switch("-exportregions"):
            _check(a.exportregions, lambda path: regions_extension(path, ranges))
    if a.exportiterations is not None:
        from symcheck.exchange.iterations import iterations_extension

        advice = "-exportiterations iterations.csv; -exportpage iterations.html plays them"
        with of_switch("-exportiterations", advice):
            _check(a.exportiterations, iterations_extension)
    if a.exporttests is not None:
        from symcheck.check.testing.property_tests import check_report_file

        with of_switch("-exporttests"):
            _check(a.exporttests, check_report_file)
    if a.exportcounterexample is not None:
        from symcheck.check.counterexample import counterexample_extension

        with of_switch("-exportcounterexample"):
            _check(a.exportcounterexample, counterexample_extension)
    if a.exportcertificate is not None:
        from symcheck.exchange.certificates import certificate_extension

        with of_switch("-exportcertificate"):
            _check(a.exportcertificate, certificate_extension)
    if a.exportpage is not None:
        with of_switch("-exportpage"):
            _check(a.exportpage, _page_extension)


def _check(path: str, check_extension: Callable[[str], object]) -> None:
    check_extension(path)
    if not Path(path).parent.is_dir():
        raise UsageError(f"there is no folder '{Path(path).parent}'")


def _page_extension(path: str) -> str:
    page = Path(path)
    if page.suffix.lower() not in (".html", ".htm"):
        name = page.name.partition(".")[0]
        raise UsageError(f"'{page}' is no HTML file", hint=f"-exportpage {name}.html")
    return page.suffix


def check_results_file(argument: str) -> None:
    """Find faults of -exportresults before anything is computed. Raises UsageError."""
    from symcheck.experiments.files import check_extension
    from symcheck.experiments.prism_tables import render

    path, kinds = _target(argument)
    with of_switch("-exportresults"):
        render([], (), kinds)
        if not path.name:
            raise UsageError(f"'{argument}' names no file")
        if path.is_dir():
            raise UsageError(f"'{path}' is a folder")
        _check(str(path), str)
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise UsageError(f"'{path}' may not be written")
    if not kinds:
        with of_switch("-exportresults", f"'{path}:text' writes a text under any name"):
            check_extension(path)


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
