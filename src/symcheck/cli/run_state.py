"""The state of a run of the command line."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

from symcheck.check.testing.expected_results import VerdictKind
from symcheck.check.testing.property_tests import PropertyTest, PropertyTests
from symcheck.cli.output import Output
from symcheck.cli.progress import Progress
from symcheck.cli.switches.arguments import Arguments
from symcheck.experiments.rows import Row
from symcheck.lazy_dataclass import dataclass
from symcheck.options import Options

if TYPE_CHECKING:  # most runs do without
    from symcheck.parallel.workers import Workers
    from symcheck.syntax.properties_in_part import UnparsedProperty

__all__ = ["RunState", "TestFailed"]


class TestFailed(Exception):
    """A test has failed, and -test ends the run with it."""


@dataclass
class RunState:
    """What was asked, where it is printed, and the results so far.

    lost: number of instances whose process was killed. varying: the constants that were given
    several values. build_seconds: time of building the current model. workers: sample the paths of
    -sim; None: this process. progress: what the current instance shows. unparsed: the properties
    that do not follow the grammar and are not reported yet, by index. told: the faults of the
    constants and labels of properties, which are reported once.
    """

    arguments: Arguments
    output: Output
    rows: list[Row] = field(default_factory=list)
    tests: list[PropertyTest] = field(default_factory=list)
    failures: int = 0
    lost: int = 0
    varying: tuple[str, ...] = ()
    build_seconds: float = 0.0
    workers: Workers | None = None
    progress: Progress | None = None
    unparsed: dict[int, UnparsedProperty] = field(default_factory=dict)
    told: set[str] = field(default_factory=set)

    @cached_property
    def options(self) -> Options:
        """The options that the switches set."""
        return self.arguments.options

    @property
    def testing(self) -> bool:
        """Whether results are compared with RESULT lines."""
        return self.arguments.test or self.arguments.testall

    @property
    def writes_files(self) -> bool:
        """Whether a file is written at the end of the run."""
        return bool(self.arguments.exportresults or self.arguments.exporttests)

    def conclude(self, test: PropertyTest) -> None:
        """Print and count the comparison with a RESULT line.

        Raises TestFailed if -test ends with it.
        """
        self.output.verdict(test.verdict)
        self.tests.append(test)
        self.failures += test.failed
        if test.verdict.kind is VerdictKind.FAIL and self.arguments.test:
            raise TestFailed

    def report(self, error: str | None = None) -> PropertyTests:
        """The tests so far. error: what ended the run."""
        files = filter(None, (self.arguments.model, self.arguments.properties))
        return PropertyTests(tuple(self.tests), " ".join(files), error)
