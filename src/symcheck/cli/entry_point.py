"""From the words of the command line to an exit status, whatever happens on the way."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import NoReturn

from symcheck import __version__
from symcheck.cli.arguments import parse_arguments
from symcheck.cli.check_property import internal
from symcheck.cli.report import Report
from symcheck.cli.run import run
from symcheck.cli.run_state import Job, results_file, sorted_rows
from symcheck.cli.signals import Stopping, limited
from symcheck.errors import (
    Interrupted,
    ResourceError,
    SymcheckError,
    TimeLimitError,
    UsageError,
    out_of_memory,
)
from symcheck.experiment.table import render

__all__ = ["run_safely"]


def run_safely(words: list[str] | None = None) -> int:
    """Run the command line. Every error ends in a message on standard error and an exit status, never in a traceback."""
    # Where the caller has closed one of them.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    with ExitStack() as stack:
        status = _guarded(sys.argv[1:] if words is None else words, stack)
    if words is None:
        _leave(status)
    return status


def _leave(status: int) -> NoReturn:
    """End the process, which is ours, without taking everything apart that was built: the system does it at once.

    After an interrupt inside of exec() Python would also end by the signal, and not with the status 130.
    """
    try:
        print(end="", flush=True)
    except BrokenPipeError:
        status = 1  # the reader of our output has gone
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
    """The exit status of a run, whatever happens in it; `stack` is left when results have been written."""
    job: Job | None = None
    stopping = Stopping()
    try:
        arguments = parse_arguments(words)
        if arguments.version:
            print(f"symcheck {__version__}")
            return 0
        stack.enter_context(_inside(arguments.folder))
        if arguments.exportresults is not None:
            results_file_checked(arguments.exportresults)
        job = Job(arguments, Report(verbose=arguments.verbose))
        with stopping, limited(arguments.timeout, lambda: _give_up(job)):
            status = run(job)
        _export(job)
        return status
    except UsageError as error:
        return _fail(_kept(job, error), 2)
    except (ResourceError, MemoryError, KeyboardInterrupt) as error:
        return _stopped(job, _as_resource_error(error, stopping), stopping)
    except SymcheckError as error:
        return _fail(_kept(job, error), 1)
    except RecursionError:
        return _fail(SymcheckError("the input is nested too deeply"), 1)
    except BrokenPipeError:
        # The reader of our output has gone (`| head`): nothing more to say, and Python must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:  # never a traceback: the message says that it is ours, and where
        return _fail(_kept(job, internal(error)), 1)


@contextmanager
def _inside(folder: str | None) -> Iterator[None]:
    """Run in the folder of -dir, from which all names of files count. Raises UsageError where there is none."""
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


def _kept(job: Job | None, error: SymcheckError) -> SymcheckError:
    """The error that ends a run, after the finished results have been written where that is possible."""
    with suppress(UsageError):
        _export(job)
    return error


def results_file_checked(argument: str) -> None:
    """Complain about -exportresults before anything is computed. Raises UsageError."""
    path, kinds = results_file(argument)
    render([], kinds)
    if not path.name:
        raise UsageError(f"-exportresults: '{argument}' names no file")
    if path.is_dir():
        raise UsageError(f"-exportresults: '{path}' is a folder")
    if not path.parent.is_dir():
        raise UsageError(f"-exportresults: there is no folder '{path.parent}'")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"-exportresults: '{path}' may not be written")


def _fail(error: SymcheckError, status: int) -> int:
    with suppress(OSError):
        sys.stdout.flush()
    text = str(error)
    print(text if "error[" in text.splitlines()[0] else f"error: {text}", file=sys.stderr)
    return status


def _as_resource_error(error: BaseException, stopping: Stopping) -> ResourceError:
    match error:
        case Interrupted():
            return Interrupted(f"{error}{stopping.advice}")
        case ResourceError():
            return error
        case MemoryError():
            return out_of_memory()
        case _:
            return Interrupted(f"stopped by {stopping.name}{stopping.advice}")


def _stopped(job: Job | None, error: ResourceError, stopping: Stopping) -> int:
    """The end of a run that a limit or the user has stopped: finished results are kept."""
    _export(job)
    if job is not None and job.rows:
        print(
            f"{len(job.rows)} finished result{'s are' if len(job.rows) > 1 else ' is'} above",
            file=sys.stderr,
        )
    return _fail(error, stopping.status if isinstance(error, Interrupted) else 3)


def _export(job: Job | None) -> None:
    """Write the results, whole or not at all."""
    if job is None or not job.arguments.exportresults or not job.rows:
        return
    path, kinds = results_file(job.arguments.exportresults)
    if str(path) == "stdout":
        print(f"\nResults:\n\n{render(list(sorted_rows(job.rows)), kinds)}", end="", flush=True)
        return
    from symcheck.exchange.text import write_text

    try:
        write_text(str(path), [render(list(sorted_rows(job.rows)), kinds)], sys.stdout)
    except UsageError as error:
        raise UsageError(f"-exportresults: {error}") from None


def _give_up(job: Job | None) -> None:
    """Compiled code did not notice that time is up: end the process from beside it."""
    _stopped(job, TimeLimitError("the time limit was reached"), Stopping())
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(3)
