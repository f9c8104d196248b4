"""`symcheck -batch FILE`: many command lines, for which Python and its modules start once.

Each line runs in a copy of this process, which has loaded the modules and the grammars (on Windows,
in a new one). A line has the output, the limits and the exit status that it has alone. Neither its
errors nor its memory reach the next line, even if it crashes.

Source: Stevens & Rago, Advanced Programming in the UNIX Environment, 3rd ed. (2013), 8.3 (fork).
"""

from __future__ import annotations

import gc
import os
import shlex
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from subprocess import DEVNULL, Popen
from tempfile import TemporaryDirectory
from time import perf_counter
from types import FrameType
from typing import NoReturn, TextIO

from symcheck.cli.output import fail
from symcheck.cli.switches.arguments import parse_arguments
from symcheck.errors import Interrupted, SymcheckError, UsageError
from symcheck.operating_system import CAN_FORK

__all__ = ["is_batch", "load", "run_batch"]

_RULE = "=" * 69
_STANDARD_INPUT = "-"
_STOPPING = (signal.SIGINT, signal.SIGTERM)
_STOPPED = 128
"""The exit status of a run that a signal has stopped, without the number of the signal."""

_SAMPLE = """
dtmc
module m
  x : [0..3];
  [] x<2 -> 1/2 : (x'=x+1) + 1/4 : (x'=3) + 1/4 : (x'=0);
endmodule
rewards x<2 : 1; endrewards
label "end" = x>1;
"""
_PROPERTIES = (
    'P=? [ F x=2 ]; P=? [ F<=2 x=2 ]; R=? [ F x>1 ]; P>0 [ F x=2 ]; filter(state, "init");'
)

Run = Callable[[Sequence[str], float], NoReturn]
"""Runs a command line that started at a time (`perf_counter`), and ends the process."""
Rehearsal = Callable[[Sequence[str]], int]
"""Runs a command line in this process; its exit status."""


def is_batch(words: Sequence[str]) -> bool:
    """Whether a command line has the switch -batch."""
    return any(_is_switch(word) for word in words)


def run_batch(words: Sequence[str], run: Run, rehearse: Rehearsal) -> int:
    """Run the lines of a file, or of the standard input.

    Args:
        words: the command line. Its other switches hold for every line.
        run: runs a line.
        rehearse: runs a command line in this process.

    Returns:
        0 if each line ended with 0, otherwise 1; 130 after Ctrl-C and 143 after SIGTERM.

    Raises:
        UsageError: the command line is wrong, or the file cannot be read.
        OutputError: the output cannot be written.
    """
    name, common = _split(words)
    child = _Child()
    try:
        return _run_lines(name, common, run, rehearse, child)
    except KeyboardInterrupt:  # between two lines
        stopped = signal.Signals(child.stopped or signal.SIGINT)
        sender = "Ctrl-C" if stopped is signal.SIGINT else stopped.name
        return fail(Interrupted(f"interrupted by {sender}"), 128 + stopped)


def _run_lines(
    name: str, common: Sequence[str], run: Run, rehearse: Rehearsal, child: _Child
) -> int:
    statuses: Counter[int] = Counter()
    with _opened(name) as file, child.forwarding():
        if CAN_FORK:
            child.stopped = load(rehearse)
            if child.stopped:
                raise KeyboardInterrupt
        for number, line in _lines(name, file):
            sys.stdout.write(f"{_RULE}\nLine {number}: {line}\n\n")
            sys.stdout.flush()
            try:
                words = [*common, *shlex.split(line, comments=True)]
            except ValueError as error:  # quotes
                status = fail(UsageError(f"{name}:{number}: {error}"), 2)
            else:
                status = child.run(words, run, no_input=name == _STANDARD_INPUT)
            statuses[status] += 1
            sys.stdout.write(f"\nExit status: {status}\n")
            sys.stdout.flush()
            if child.stopped:
                break
        total = f"{statuses.total()} line{'s' * (statuses.total() != 1)}"
        counts = ", ".join(f"{n} with exit status {status}" for status, n in statuses.items())
        print(f"{_RULE}\nBatch: {total}" + (f", {counts}" if counts else ""), flush=True)
        if child.stopped:
            return 128 + child.stopped
    return 0 if statuses.keys() <= {0} else 1


def _is_switch(word: str) -> bool:
    return word.startswith("-") and word.lstrip("-").partition("=")[0] == "batch"


def _split(words: Sequence[str]) -> tuple[str, list[str]]:
    """The file, and the words of every line. Raises UsageError."""
    arguments = parse_arguments(words)
    hint = "each line has the words of a run: die.pm die.pctl -sparse"
    if arguments.model is not None:
        raise UsageError(
            f"'{arguments.model}' stands beside -batch, whose lines name models", hint=hint
        )
    assert arguments.batch is not None
    common, rest = [], iter(words)
    for word in rest:
        if not _is_switch(word):
            common.append(word)
        elif "=" not in word:
            next(rest)
    return arguments.batch, common


def _lines(name: str, file: TextIO) -> Iterator[tuple[int, str]]:
    """The lines that have words, with their numbers from 1. Raises UsageError."""
    number = 0
    try:
        for number, line in enumerate(file, 1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield number, line.strip()
    except UnicodeDecodeError:
        message = f"-batch: cannot read '{name}' after line {number}: not a UTF-8 text"
        raise UsageError(message) from None


def _opened(name: str) -> TextIO:
    """The file of the lines. Raises UsageError."""
    if name == _STANDARD_INPUT:
        return sys.stdin
    try:
        return open(name, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"-batch: cannot read '{name}': {error.strerror}") from None


def load(rehearse: Rehearsal) -> int:
    """Load what most lines need, by runs of a small model on both representations.

    What they make once, such as the parser of switches, is that of the lines too. The collector
    need not visit it, so that the copies of this process share its memory. Returns the signal that
    has arrived meanwhile, or 0.
    """
    with TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere:
        sample = os.path.join(folder, "sample.pm")
        with open(sample, "w") as file:
            file.write(_SAMPLE)
        with redirect_stdout(nowhere), redirect_stderr(nowhere):
            for engine in ([], ["-hybrid"]):  # there may be no diagrams on this machine
                if (status := rehearse([sample, "-pf", _PROPERTIES, *engine])) > _STOPPED:
                    return status - _STOPPED
    gc.collect()
    gc.freeze()
    return 0


class _Child:
    """The process of a line. Signals that would stop this process stop the line, and the batch.

    stopped: the signal that has arrived, or 0.
    """

    def __init__(self) -> None:
        self.stopped = 0
        self._process = 0

    @contextmanager
    def forwarding(self) -> Iterator[None]:
        """A context in which signals reach the process of the line."""
        self._handlers = {n: signal.getsignal(n) for n in _STOPPING}
        try:
            for number, handler in self._handlers.items():
                if handler is not signal.SIG_IGN:
                    signal.signal(number, self._forward)
            yield
        finally:
            self._restore()

    def run(self, words: Sequence[str], run: Run, *, no_input: bool) -> int:
        """Run a line, and wait for its exit status."""
        if not CAN_FORK:
            return self._run_anew(words, no_input=no_input)
        started = perf_counter()
        self._process = os.fork()
        if self._process == 0:
            self._restore()
            if no_input:  # the further lines are not the input of this one
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                sys.stdin = open(0, encoding="utf-8")  # noqa: SIM115
            run(words, started)
        status = os.waitstatus_to_exitcode(os.waitpid(self._process, 0)[1])
        self._process = 0
        if status < 0:
            name = signal.Signals(-status).name
            hint = "memory may be exhausted" if status == -signal.SIGKILL else None
            return fail(SymcheckError(f"the run was ended by {name}", hint=hint), 128 - status)
        return status

    def _run_anew(self, words: Sequence[str], *, no_input: bool) -> int:
        """Run a line in a new process, which loads the modules again."""
        with Popen(
            [sys.executable, "-m", "symcheck", *words], stdin=DEVNULL if no_input else None
        ) as process:
            self._process = process.pid
            status = process.wait()
        self._process = 0
        return status

    def _restore(self) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def _forward(self, number: int, _: FrameType | None) -> None:
        self.stopped = self.stopped or number
        if not self._process:  # it waits for the next line
            raise KeyboardInterrupt
        if CAN_FORK:  # Windows sends Ctrl-C to all processes of the console
            with suppress(ProcessLookupError):
                os.kill(self._process, number)
