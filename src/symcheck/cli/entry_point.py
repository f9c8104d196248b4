"""From the words of the command line to an exit status; every error is reported."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import NoReturn, assert_never

from symcheck import __version__
from symcheck.cli.arguments import parse_arguments
from symcheck.cli.check_property import internal_error
from symcheck.cli.output import Output
from symcheck.cli.output_paths import check_files, check_results_file, write_results
from symcheck.cli.run import run
from symcheck.cli.run_state import RunState
from symcheck.cli.signals import StopSignals, limited
from symcheck.errors import (
    Interrupted,
    ResourceError,
    SymcheckError,
    TimeLimitError,
    UsageError,
    out_of_memory,
)
from symcheck.experiments.rows import error_text

__all__ = ["run_safely"]


def run_safely(words: list[str] | None = None) -> int:
    """Run the command line.

    Every error ends in a message on standard error and an exit status, never in a traceback.
    """
    # The caller may have closed one of them.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    with ExitStack() as stack:
        status = _guarded(sys.argv[1:] if words is None else words, stack)
    if words is None:
        _leave(status)
    return status


def _leave(status: int) -> NoReturn:
    """End the process without freeing each object: the system frees its memory at once.

    After an interrupt within exec() Python would otherwise end by the signal, and not with the
    status 130.
    """
    try:
        print(end="", flush=True)
    except BrokenPipeError:
        status = 1  # the reader of the output has closed it
    except OSError as error:
        status = (
            _fail(SymcheckError(f"the output cannot be written: {error.strerror}"), 1)
            if status == 0
            else status
        )
    with suppress(OSError):
        print(end="", file=sys.stderr, flush=True)
    os._exit(status)


def _guarded(words: list[str], stack: ExitStack) -> int:
    """The exit status of a run. The caller closes `stack` after the results are written."""
    state: RunState | None = None
    signals = StopSignals()
    try:
        arguments = parse_arguments(words)
        if arguments.version:
            print(f"symcheck {__version__}")
            return 0
        stack.enter_context(_working_folder(arguments.folder))
        if arguments.exportresults is not None:
            check_results_file(arguments.exportresults)
        check_files(arguments)
        state = RunState(arguments, Output(verbose=arguments.verbose))
        with signals, limited(arguments.options.time_limit, lambda: _end_process(state)):
            status = run(state)
        _export(state)
        return status
    except UsageError as error:
        return _fail(_after_export(state, error), 2)
    except (ResourceError, MemoryError, KeyboardInterrupt) as error:
        return _stopped(state, _as_resource_error(error, signals), signals)
    except SymcheckError as error:
        return _fail(_after_export(state, error), 1)
    except RecursionError:
        return _fail(SymcheckError("the input is nested too deeply"), 1)
    except BrokenPipeError:
        # The reader of the output has closed it (`| head`): Python must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:  # reported as a defect of symcheck, without a traceback
        return _fail(_after_export(state, internal_error(error)), 1)


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


def _after_export(state: RunState | None, error: SymcheckError) -> SymcheckError:
    """The error that ends a run, after the finished results were written if possible."""
    with suppress(UsageError):
        _export(state, error)
    return error


def _fail(error: SymcheckError, status: int) -> int:
    with suppress(OSError):
        sys.stdout.flush()
    text = str(error)
    print(text if "error[" in text.splitlines()[0] else f"error: {text}", file=sys.stderr)
    return status


def _as_resource_error(
    error: ResourceError | MemoryError | KeyboardInterrupt, signals: StopSignals
) -> ResourceError:
    match error:
        case Interrupted():
            return Interrupted(f"{error}{signals.advice}")
        case ResourceError():
            return error
        case MemoryError():
            return out_of_memory()
        case KeyboardInterrupt():
            return Interrupted(f"interrupted by {signals.name}{signals.advice}")
        case _:
            assert_never(error)


def _stopped(state: RunState | None, error: ResourceError, signals: StopSignals) -> int:
    """End a run that a limit or the user has stopped; finished results are written."""
    _export(state, error)
    if state is not None and state.rows:
        print(
            f"{len(state.rows)} finished result{'s are' if len(state.rows) > 1 else ' is'} above",
            file=sys.stderr,
        )
    return _fail(error, signals.status if isinstance(error, Interrupted) else 3)


def _export(state: RunState | None, error: SymcheckError | None = None) -> None:
    """Write the files of -exportresults and -exporttests. error: what ended the run."""
    if state is None:
        return
    a = state.arguments
    if a.exporttests:
        state.report(None if error is None else error_text(error)).save(a.exporttests)
    if a.exportresults and state.rows:
        write_results(a.exportresults, state.rows, state.varying)


def _end_process(state: RunState | None) -> None:
    """End the process from another thread: compiled code did not notice the time limit."""
    _stopped(state, TimeLimitError("the time limit was reached"), StopSignals())
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(3)
