"""The state of a run of the command line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from symcheck.check.expected_results import Verdict, VerdictKind
from symcheck.cli.arguments import Arguments
from symcheck.cli.output import Output
from symcheck.experiment.table import Row
from symcheck.options import Options

__all__ = ["RunState", "TestFailed", "results_file", "sorted_rows"]


class TestFailed(Exception):
    """A test has failed, and -test ends the run with it."""


@dataclass
class RunState:
    """What was asked, where it is printed, and the results so far.

    fixed: the constants that were given one value only.
    """

    arguments: Arguments
    output: Output
    rows: list[Row] = field(default_factory=list)
    failures: int = 0
    fixed: tuple[str, ...] = ()

    @cached_property
    def options(self) -> Options:
        """The options that the switches set."""
        return self.arguments.options

    @property
    def testing(self) -> bool:
        """Whether results are compared with RESULT lines."""
        return self.arguments.test or self.arguments.testall

    def conclude(self, verdict: Verdict) -> None:
        """Print and count the comparison with a RESULT line.

        Raises TestFailed if -test ends with it.
        """
        self.output.verdict(verdict)
        if verdict.kind in (VerdictKind.FAIL, VerdictKind.UNSUPPORTED):
            self.failures += 1
        if verdict.kind is VerdictKind.FAIL and self.arguments.test:
            raise TestFailed


def results_file(argument: str) -> tuple[Path, list[str]]:
    """The file and the formats of `FILE:KIND,KIND`; other colons belong to the file."""
    path, colon, kinds = argument.rpartition(":")
    if not colon:
        return Path(argument), ["text"]
    return Path(path), kinds.split(",")


def sorted_rows(rows: Sequence[Row]) -> Iterator[Row]:
    """The rows of each property together, in the order of their first rows."""
    order = {name: i for i, name in enumerate(dict.fromkeys(r.property for r in rows))}
    return iter(sorted(rows, key=lambda r: order[r.property]))
