"""A run of the command line in progress."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from symcheck.cli.report import Report
from symcheck.engines.base import Engine
from symcheck.experiment.table import Row
from symcheck.options import Options

__all__ = ["Job", "options_of", "results_file", "sorted_rows"]


@dataclass
class Job:
    """What was asked, where it is reported, and what has come out so far. fixed: constants that were given one value only."""

    arguments: argparse.Namespace
    report: Report
    rows: list[Row] = field(default_factory=list)
    imported: Engine | None = None
    failures: int = 0
    fixed: tuple[str, ...] = ()

    @property
    def testing(self) -> bool:
        """Whether results are compared with RESULT lines."""
        return bool(self.arguments.test or self.arguments.testall)


def options_of(arguments: argparse.Namespace) -> Options:
    """The options of a check that the switches ask for."""
    return Options(
        engine=arguments.engine or "auto",
        method=arguments.method,
        epsilon=arguments.epsilon,
        relative=arguments.relative,
        certify=not arguments.estimate,
        max_iterations=arguments.maxiters,
        exact=arguments.exact,
        max_memory=arguments.cuddmaxmem,
        time_limit=arguments.timeout,
        fix_deadlocks=arguments.fix_deadlocks,
        check_sums=arguments.check_sums,
        fairness=arguments.fairness,
        reduce=arguments.reduce,
        order=tuple(arguments.order.split(",")) if arguments.order else None,
        bisim=arguments.bisim,
        everywhere=arguments.exportvector is not None,
        strategy=arguments.exportstrat is not None,
        ltl2da=arguments.ltl2datool,
        ltl2da_syntax=arguments.ltl2dasyntax,
    )


def results_file(argument: str) -> tuple[Path, list[str]]:
    """`FILE:KIND,KIND` taken apart; a colon that belongs to the file's name is left in it."""
    path, colon, kinds = argument.rpartition(":")
    if not colon:
        return Path(argument), ["text"]
    return Path(path), kinds.split(",")


def sorted_rows(rows: Sequence[Row]) -> Iterator[Row]:
    """Rows of the same property together, in the order of its first row."""
    order = {name: i for i, name in enumerate(dict.fromkeys(r.property for r in rows))}
    return iter(sorted(rows, key=lambda r: order[r.property]))
