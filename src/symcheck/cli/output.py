"""The output of the command line, in PRISM's wording where scripts read it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from threading import Thread
from typing import TYPE_CHECKING, TextIO

from symcheck.check.result import Estimate, Result
from symcheck.check.testing.property_tests import PropertyTests
from symcheck.engines.base import Engine
from symcheck.engines.capabilities import RepresentsOrbits
from symcheck.engines.selection import EngineChoice
from symcheck.engines.states import example
from symcheck.errors import Diagnostic, InputError, OutputError, SymcheckError
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.model import BoundModel, Value
from symcheck.semantics.state_faults import deadlocks_mended
from symcheck.tables import counted
from symcheck.version import __version__

if TYPE_CHECKING:
    from symcheck.distributed import DistributedModel
    from symcheck.simulate.check import SampledSoFar

__all__ = ["LAST_WORDS", "Output", "fail"]

LAST_WORDS = 0.3  # seconds for the last message of a run that does not end by itself

_RULE = "-" * 69


_RUNS = {
    "linear": "Linear equations",
    "steps": "Steps",
    "transient": "Transient analysis",
    "steady": "Long run",
    "graph": "Graph",
    "epochs": "Reward bounds",
}
"""What -v calls the kinds of runs of a method."""

_OWN_METHODS = {
    "steps": "bounds on steps, which are computed step by step",
    "transient": "bounds on time, which are computed by uniformisation",
    "steady": "long-run averages, which are computed by elimination or from the Poisson equation",
    "epochs": "bounds on rewards, which are computed budget by budget",
}
"""The kinds of runs that solve other problems than x = A x + b, and how."""


class Output:
    """Writes a run to a stream, flushed after each result: a stopped run keeps them."""

    def __init__(self, out: TextIO | None = None, verbose: bool = False) -> None:
        self.out = out or sys.stdout
        self.verbose = verbose
        self.warnings = 0
        self.of_models: set[str] = set()  # the warnings of models, which their results repeat
        self._notes: set[str] = set()

    def line(self, text: str = "") -> None:
        """One line of output."""
        print(text, file=self.out)

    def warn(self, text: str) -> None:
        """A warning, counted for the end of the run."""
        self.warnings += 1
        self.line(f"Warning: {text}")

    def note(self, text: str) -> None:
        """A note about the texts of a run, shown once."""
        if text not in self._notes:
            self._notes.add(text)
            self.line(f"Note: {text}")

    def detail(self, text: str) -> None:
        """A line that only -v shows."""
        if self.verbose:
            self.line(text)

    def header(self, files: Iterable[str]) -> None:
        """The name of the program and what it reads."""
        self.line(f"symcheck {__version__}")
        self.line()
        for file in files:
            self.line(file)

    def model(self, model: BoundModel, constants: Mapping[str, str]) -> None:
        """Type, modules, variables and given constants of a model."""
        self.line()
        kind = model.type if model.clocks is None else model.clocks.automaton.type
        self.line(f"Type:        {kind.name}")
        self.line(f"Modules:     {' '.join(m.name for m in model.modules)}")
        self.line(f"Variables:   {' '.join(v.name for v in model.variables)}")
        if constants:
            self.line(f"Constants:   {_assignment(constants)}")
        for warning in model.warnings:
            if warning not in self.of_models:
                self.of_models.add(warning)
                self.warn(warning)
        self.out.flush()

    def warn_of_model(self, found: Iterable[Diagnostic]) -> None:
        """Warnings about places of a model, each once."""
        for diagnostic in found:
            place = str(diagnostic.span)
            if place not in self.of_models:
                self.of_models.add(place)
                self.warn(f"{place}: {diagnostic.sentence}")
        self.out.flush()

    def built(
        self, engine: Engine, choice: EngineChoice | None, seconds: float, *, partial: bool
    ) -> None:
        """Counts of a built model, or of the part that the properties need."""
        initial = engine.initial.count
        explored = engine.capability(RepresentsOrbits)
        whole = None if explored is None else explored.represented
        self.line()
        self.line(
            f"Engine:      {engine.name}"
            + (f" (chosen automatically: {choice.reason})" if choice is not None else "")
        )
        part = "; only those that the properties need" if partial else ""
        if whole is None:
            self.line(f"States:      {engine.states} ({initial} initial{part})")
            self.line(f"Transitions: {engine.transitions}")
        else:
            self.line(f"States:      {whole.states} ({whole.initial} initial{part})")
            self.line(f"Transitions: {whole.transitions}")
        if engine.model.type.value == "mdp":
            self.line(f"Choices:     {engine.choices if whole is None else whole.choices}")
        if whole is not None:
            if whole.outside_cone:
                ignored, one = ", ".join(whole.outside_cone), len(whole.outside_cone) == 1
                self.line(
                    f"Ignored:     {ignored} (no property depends on {'it' if one else 'them'})"
                )
            if whole.symmetries:
                self.line(f"Symmetry:    {'; '.join(map(str, whole.symmetries))}")
            size = counted(engine.states, "state"), counted(engine.transitions, "transition")
            self.line(f"  checked on {' and '.join(size)}")
        self.line(f"Time for model construction: {seconds:.3f} seconds.")
        deadlocks = engine.deadlocks.count if whole is None else whole.deadlocks
        if deadlocks:
            self.warn(deadlocks_mended(deadlocks, example(engine, engine.deadlocks)))
        self.out.flush()

    def partitioned(self, model: DistributedModel) -> None:
        """Counts of a model whose states are partitioned over workers."""
        self.line()
        workers = counted(len(model.parts), "worker")
        self.line(f"Engine:      explicit, on {workers}")
        self.line(f"States:      {model.states} ({model.initial} initial)")
        self.line(f"Transitions: {model.transitions}")
        if model.model.type.value == "mdp":
            self.line(f"Choices:     {model.choices}")
        self.line(f"Time for model construction: {model.seconds:.3f} seconds.")
        if model.deadlocks:
            self.warn(deadlocks_mended(model.deadlocks, model.deadlock_examples()[0]))
        self.out.flush()

    def property(
        self,
        text: str,
        name: str | None,
        model_constants: Mapping[str, str],
        constants: Mapping[str, str],
    ) -> None:
        """The property that is about to be checked."""
        self.line()
        self.line(_RULE)
        self.line()
        self.line(f'Model checking: "{name}": {text}' if name else f"Model checking: {text}")
        if model_constants:
            self.line(f"Model constants: {_assignment(model_constants)}")
        if constants:
            self.line(f"Property constants: {_assignment(constants)}")

    def result(self, result: Result, method: str = "auto") -> None:
        """A result, with the lines of print filters, a witness, and with -v how it was computed.

        method: that of -method.
        """
        for line in result.lines:
            self.line(str(line))
        for warning in result.warnings:
            if warning not in self.of_models:
                self.warn(warning)
        for note in result.notes:
            self.note(note)
        if isinstance(result.accuracy, Estimate):
            self.warn("the result is an estimate: its error is unknown")
        if result.witness_or_none:
            self.line("Path that shows it:")
            for number, state in enumerate(result.witness):
                self.line(f"  {number}: ({_state(state)})")
        for run in result.runs:
            name = _RUNS.get(run.kind, run.kind)
            counts = f"{counted(run.unknowns, 'unknown')}, {counted(run.iterations, 'iteration')}"
            self.detail(f"{name}: {run.explanation or run.method} ({counts})")
        if method != "auto":
            for kind in dict.fromkeys(r.kind for r in result.runs if r.kind in _OWN_METHODS):
                self.line(f"Note: -method {method} has no effect on {_OWN_METHODS[kind]}")
        if result.front_or_none is not None:
            self.line()
            self.line(str(result.front))
        if result.regions_or_none is not None and result.value is None:
            self.line()
            self.line(str(result.regions))
        self.line()
        self.line(f"Time for model checking: {result.seconds:.3f} seconds.")
        self.line()
        self.line(f"Result: {result}" + (f" ({result.explanation})" if result.explanation else ""))
        self.out.flush()

    def sampled(self, so_far: SampledSoFar) -> None:
        """What the samples give that were taken before the run was stopped."""
        target = "" if so_far.target is None else f" of {so_far.target}"
        accuracy = so_far.accuracy or "no interval"
        self.line()
        self.line(
            f"Result so far: {so_far.mean} ({accuracy}) (first {so_far.samples}{target} samples)"
        )
        self.out.flush()

    def exported(self, path: str) -> None:
        """The name of a file that was written; nothing for 'stdout'."""
        if path != "stdout":
            self.line(f"Exported to '{path}'")

    def error(self, error: object) -> None:
        """An error that stops one property."""
        self.line()
        self.line(f"Error: {error}")
        self.out.flush()

    def verdict(self, verdict: object) -> None:
        """The comparison with a RESULT line."""
        self.line(f"Testing result: {verdict}")
        self.out.flush()

    def tests(self, tests: PropertyTests) -> None:
        """The summary of the tests, and those that failed."""
        self.line()
        self.line(_RULE)
        self.line()
        self.line(f"Tests: {tests.summary}")
        for test in tests.failed:
            self.line(f"  {test.title}: {test.verdict}")

    def end(self) -> None:
        """The number of warnings, at the end of a run."""
        if self.warnings:
            verb = "were" if self.warnings > 1 else "was"
            self.line()
            self.line(f"Note: There {verb} {counted(self.warnings, 'warning')} during computation.")
        self.out.flush()


def fail(error: SymcheckError, status: int, note: str | None = None) -> int:
    """Print an error and a note, after what the output still holds."""
    # Nobody may read the pipe: that must not keep the message back.
    with suppress(RuntimeError):  # no memory for a thread
        flushing = Thread(target=_flush_output, daemon=True)
        flushing.start()
        flushing.join(LAST_WORDS)
    shown = str(error) if isinstance(error, InputError) else f"error: {error}"
    with suppress(OSError):
        print(f"{shown}\n  note: {note}" if note else shown, file=sys.stderr, flush=True)
    return status


def _flush_output() -> None:
    with suppress(OSError, OutputError):
        sys.stdout.flush()


def _assignment(values: Mapping[str, str]) -> str:
    return ",".join(f"{name}={value}" for name, value in values.items())


def _state(state: Mapping[str, Value]) -> str:
    return ",".join(f"{n}={format_value(v)}" for n, v in state.items())
