"""From the words of the command line to an exit status; every error is reported."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from io import TextIOWrapper
from threading import Lock, Thread
from time import perf_counter
from typing import NoReturn, TextIO

import numpy as np

from symcheck.cli.check_property import internal_error
from symcheck.cli.output import LAST_WORDS, Output, fail
from symcheck.cli.output_paths import check_files, check_results_file, write_results
from symcheck.cli.run import run
from symcheck.cli.run_state import RunState
from symcheck.cli.signals import StopSignals
from symcheck.cli.switches.arguments import information, parse_arguments
from symcheck.errors import (
    Interrupted,
    OutputError,
    ResourceError,
    SymcheckError,
    TimeLimitError,
    UsageError,
    out_of_memory,
)
from symcheck.experiments.rows import error_text
from symcheck.machine import available_memory, memory_ended
from symcheck.whole_file import is_output_fault, output_fault, remove_unfinished

__all__ = ["run_safely"]

_LAST_FILES = 20.0  # the same, if finished results are still to be written to a file


_RESERVE = 4 << 20  # bytes that are kept for the end of a run whose memory is exhausted


def run_safely(words: Sequence[str] | None = None, started: float | None = None) -> int:
    """Run the command line; see `symcheck.cli.main`.

    Every error ends in a message on standard error and an exit status, never in a traceback.

    Args:
        words: the command line; None: that of this process, which ends here.
        started: when the run started, by `perf_counter`; the time limit counts from then.
    """
    # The caller may have closed one of them.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    started = perf_counter() if started is None else started
    sys.set_int_max_str_digits(0)  # rational results may be long
    if any("batch" in word for word in (sys.argv[1:] if words is None else words)):
        from symcheck.cli.batch import is_batch

        if is_batch(sys.argv[1:] if words is None else words):
            return _run_batch(words)
    if (sys.argv[1:] if words is None else list(words))[:1] == ["workbench"]:
        return _run_workbench(sys.argv[2:] if words is None else words[1:])
    if words is not None:
        with ExitStack() as stack:
            return _Session(StopSignals(), started, own_process=False).run(words, stack)
    return _run_process(sys.argv[1:], started)


def _run_process(words: Sequence[str], started: float) -> NoReturn:
    """Run a command line, and end this process."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout = _CheckedStream(sys.stdout)
    session = _Session(StopSignals(lambda: session.end()), started, own_process=True)
    try:
        status = session.run(words, ExitStack())
    except KeyboardInterrupt:  # between the end of the run and that of the signals
        status = fail(session.signals.error, session.signals.status)
    _leave(status)


def _run_batch(words: Sequence[str] | None) -> int:
    """Run the lines of a batch. words: None for those of this process, which ends here."""
    from symcheck.cli.batch import run_batch

    if words is None and isinstance(sys.stdout, TextIOWrapper):
        sys.stdout = _CheckedStream(sys.stdout)
    try:
        status = run_batch(sys.argv[1:] if words is None else words, _run_process, run_safely)
    except KeyboardInterrupt:
        status = fail(Interrupted("interrupted by Ctrl-C"), 130)
    except SymcheckError as error:
        status = fail(error, 2 if isinstance(error, UsageError) else 1)
    if words is None:
        _leave(status)
    return status


def _run_workbench(words: Sequence[str]) -> int:
    from symcheck.workbench.command import serve

    try:
        return serve(words)
    except KeyboardInterrupt:
        return 0
    except SymcheckError as error:
        return fail(error, 2 if isinstance(error, UsageError) else 1)


def _leave(status: int) -> NoReturn:
    """End the process without freeing each object: the system frees its memory at once.

    After an interrupt within exec() Python would otherwise end by the signal, and not with the
    status 130.
    """
    if status == 0:
        try:
            sys.stdout.flush()
        except OutputError as error:
            status = fail(error, 1)
    with suppress(OSError):
        sys.stderr.flush()
    remove_unfinished()
    os._exit(status)


class _CheckedStream(TextIOWrapper):
    """A stream of text. What does not arrive is an OutputError."""

    def __init__(self, stream: TextIOWrapper) -> None:
        encoding, errors, by_line = stream.encoding, stream.errors, stream.line_buffering
        super().__init__(stream.detach(), encoding, errors, line_buffering=by_line)

    def write(self, text: str) -> int:
        with _output_faults():
            return super().write(text)

    def flush(self) -> None:
        with _output_faults():
            super().flush()


def _opened(path: str) -> TextIO:
    """The file of -mainlog, which has each line at once. Raises UsageError."""
    try:
        return _CheckedStream(open(path, "w", buffering=1, encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"-mainlog: cannot write '{path}': {error.strerror}") from None


@contextmanager
def _output_faults() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise output_fault("the output", error) from None


class _Session:
    """A run, and how it ends.

    Args:
        signals: those that stop the run.
        started: when the time limit starts, by `perf_counter`.
        own_process: whether the process has this run only.
    """

    def __init__(self, signals: StopSignals, started: float, *, own_process: bool) -> None:
        self.signals = signals
        self._own_process = own_process
        self._started = started
        self._state: RunState | None = None
        self._ending = Lock()
        self._reserve = [np.empty(_RESERVE, np.uint8)]  # of addresses: no page of it is touched

    def run(self, words: Sequence[str], stack: ExitStack) -> int:
        """The exit status of a run. The caller closes `stack` after the results are written."""
        with self.signals:
            try:
                return self._run(words, stack)
            except BaseException as error:
                try:
                    self.signals.acknowledge()
                except KeyboardInterrupt:  # the signal was repeated before
                    self.signals.acknowledge()
                with self._ending:
                    return self._status(error)

    def _run(self, words: Sequence[str], stack: ExitStack) -> int:
        arguments = parse_arguments(words)
        if arguments.batch is not None:
            raise UsageError("-batch stands in a line of a batch, which runs one model")
        if (text := information(arguments)) is not None:
            print(text)
            return 0
        limit = arguments.options.time_limit
        if limit is not None:
            self.signals.limit_time(limit - (perf_counter() - self._started))
        stack.enter_context(_working_folder(arguments.folder))
        if arguments.exportresults is not None:
            check_results_file(arguments.exportresults)
        check_files(arguments)
        if self._own_process:
            self.signals.limit_memory(max(available_memory(), arguments.options.max_memory or 0))
        log = arguments.mainlog
        out = None if log is None or log == "stdout" else stack.enter_context(_opened(log))
        self._state = RunState(arguments, Output(out, arguments.verbose))
        status = run(self._state)
        self._export()
        return status

    def _status(self, error: BaseException) -> int:
        """Report what has ended a run before its end, after the finished results are written."""
        self._reserve.clear()
        if isinstance(error, TimeLimitError):
            self.signals.note_timeout()
        if self.signals.signal is not None:  # whatever the interrupted code has made of it
            stopped = self.signals.error
            if isinstance(error, ResourceError):
                stopped.note = error.note
            return self._stopped(stopped, self.signals.status)
        if memory_ended(error):
            error.__traceback__ = error.__context__ = None  # their frames hold the memory
            return self._stopped(out_of_memory(), 3)
        match error:
            case Interrupted() | KeyboardInterrupt():
                return self._stopped(Interrupted("interrupted by Ctrl-C"), 130)
            case ResourceError():
                return self._stopped(error, 3)
            case UsageError():
                return fail(self._after_export(error), 2)
            case SymcheckError():
                return fail(self._after_export(error), 1)
            case RecursionError():
                return fail(SymcheckError("the input is nested too deeply"), 1)
            case OSError() if is_output_fault(error):
                return fail(self._after_export(output_fault("the output", error)), 1)
            case Exception():  # a defect of symcheck, without a traceback
                return fail(self._after_export(internal_error(error)), 1)
            case _:
                raise error

    def _after_export(self, error: SymcheckError) -> SymcheckError:
        """The error that ends a run, after the finished results were written if possible."""
        with suppress(UsageError, OutputError):
            self._export(error)
        return error

    def _stopped(self, error: ResourceError, status: int) -> int:
        """End a run that a limit or the user has stopped; finished results are written."""
        try:
            self._export(error)
        except (UsageError, OutputError) as fault:
            fail(fault, status)
        self._report_samples()
        count = len(self._state.rows) if self._state is not None else 0
        verb = "results are" if count > 1 else "result is"
        return fail(error, status, f"{count} finished {verb} above" if count else None)

    def _report_samples(self) -> None:
        """Print what the samples of an unfinished property give."""
        progress = None if self._state is None else self._state.progress
        if self._state is None or progress is None:
            return
        progress.clear()
        if progress.sampled is not None:
            with self.signals.writing(), suppress(OSError, OutputError, MemoryError):
                self._state.output.sampled(progress.sampled)

    def _export(self, error: SymcheckError | None = None) -> None:
        """Write the files of -exportresults and -exporttests. error: what ended the run."""
        state = self._state
        if state is None:
            return
        a = state.arguments
        with self.signals.writing():
            if a.exporttests:
                state.report(None if error is None else error_text(error)).save(a.exporttests)
            if a.exportresults and state.rows:
                write_results(a.exportresults, state.rows, state.varying)

    def end(self) -> None:
        """End the process from another thread: the main thread does not notice a signal."""
        if self._ending.acquire(blocking=False):
            last = Thread(
                target=self._stopped, args=(self.signals.error, self.signals.status), daemon=True
            )
            last.start()
            writes = self._state is not None and self._state.writes_files
            last.join(_LAST_FILES if writes else LAST_WORDS)
        remove_unfinished()
        os._exit(self.signals.status)


@contextmanager
def _working_folder(folder: str | None) -> Iterator[None]:
    """Run in the folder of -dir, to which names of files are relative.

    Raises UsageError if there is none.
    """
    if folder is None:
        yield
        return
    before = os.getcwd()
    try:
        os.chdir(folder)
    except OSError as error:
        raise UsageError(f"-dir: '{folder}': {error.strerror}") from None
    try:
        yield
    finally:
        os.chdir(before)
