"""-resume FILE: results that a stopped run has finished are read, and not computed again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from symcheck.check.result import Estimate, Result
from symcheck.cli.instance import InstancesTask
from symcheck.cli.run_state import RunState
from symcheck.errors import SymcheckError
from symcheck.experiments.journal import Journal, opened
from symcheck.experiments.rows import Row, constant_text, row_of
from symcheck.experiments.run import experiment_description, row_key

__all__ = ["FinishedResults", "finished_results"]


@contextmanager
def finished_results(state: RunState, task: InstancesTask) -> Iterator[FinishedResults]:
    """The finished results in the file of -resume.

    It is the file that `symcheck.experiment(..., resume=)` has.

    Raises UsageError: the file cannot be used, or belongs to another experiment.
    """
    path = state.arguments.resume
    assert path is not None
    with opened(path, experiment_description(task.model, task.file), "-resume") as journal:
        yield FinishedResults(journal, state, task)


class FinishedResults:
    """The rows of earlier runs, and of this one.

    Args:
        journal: the file.
        state: of this run; its new rows are written to the file.
        task: what all instances share.
    """

    def __init__(self, journal: Journal, state: RunState, task: InstancesTask) -> None:
        self._journal = journal
        self._state = state
        self._task = task

    def open(self, choices: Sequence[Mapping[str, str]]) -> list[Mapping[str, str]]:
        """The choices of constants that are not finished. The results of others are printed."""
        return [choice for choice in choices if not self._print(choice)]

    def write(self, constants: Mapping[str, str], rows: Sequence[Row]) -> None:
        """Write the rows of an instance, if it has one for each of its properties."""
        keys = self._keys(constants)
        if len(rows) == len(keys):
            self._journal.append(dict(zip(keys, rows, strict=True)))

    def _keys(self, constants: Mapping[str, str]) -> list[str]:
        task = self._task
        asked = task.model.instances(task.file, task.of_properties, task.indices)
        return [row_key(row_of(instance, constants), instance.index) for instance in asked]

    def _print(self, constants: Mapping[str, str]) -> bool:
        """Print the results of an instance; False if one of them is missing."""
        rows = [self._journal.rows.get(key) for key in self._keys(constants)]
        finished = [row for row in rows if row is not None]
        if len(finished) < len(rows):
            return False
        output = self._state.output
        for row in finished:
            self._state.rows.append(row)
            own = {n: constant_text(v) for n, v in row.constants.items() if n not in constants}
            output.property(row.formula, None, constants, own)
            if row.error is not None:
                output.error(SymcheckError(row.error))
                self._state.failures += 1
            else:
                accuracy = row.accuracy or Estimate()
                origin = f"from {self._state.arguments.resume}"
                output.result(Result(row.value, accuracy, origin, seconds=row.seconds))
        return True
