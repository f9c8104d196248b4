"""What a formula is checked against, and the log that checking keeps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter

from symcheck.check.result import Line, SolverRun
from symcheck.engines.base import Engine, Equations, StateSet, Values
from symcheck.errors import Diagnostic, NameFault
from symcheck.numerics.linear.problem import Observer
from symcheck.options import Options
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.model import BoundModel
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import Expression, LabelReference, Type

__all__ = ["CheckLog", "Context"]


@dataclass
class CheckLog:
    """What is noted while a property is checked: numerical runs, lines to print, warnings, and a path that shows why."""

    runs: list[SolverRun] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    witness: Sequence[Mapping[str, int | bool]] | None = None
    exact_engine: Engine | None = None
    """The model explored in rational arithmetic, once a comparison needed it."""

    def warn(self, text: str) -> None:
        """Add a warning, once."""
        if text not in self.warnings:
            self.warnings.append(text)


@dataclass(frozen=True)
class Context:
    """An engine, the options, and what the names in formulas stand for.

    labels: those of the properties file (the model's are with the model). properties: the named properties.
    rebind: gives the formula that is checked, bound to the same model in exact arithmetic (thresholds such as 1/6 then are
      rationals). open: the properties that are being expanded, so that one that refers to itself is found. relevant_states: the
      states at which values are needed to the accuracy asked for (None: all); elsewhere their bounds may be wider.
    observer: is told of each step of a computation, and may raise to end it.
    """

    engine: Engine
    options: Options
    labels: Mapping[str, Expression] = field(default_factory=dict)
    properties: Mapping[str, Expression] = field(default_factory=dict)
    log: CheckLog = field(default_factory=CheckLog)
    rebind: Callable[[BoundModel], Expression] | None = None
    open: frozenset[str] = frozenset()
    relevant_states: StateSet | None = None
    observer: Observer | None = None

    def referred(self, reference: LabelReference) -> Expression:
        """The expression that a reference to a label or a property stands for ("init" and "deadlock" are none).

        Raises NameFault for an unknown name and for a property that refers to itself.
        """
        for table in (self.labels, self.engine.model.labels, self.properties):
            if reference.name in table:
                if reference.name in self.open:
                    raise NameFault(
                        Diagnostic(
                            f'property "{reference.name}" refers to itself',
                            reference.span,
                            "cyclic-property",
                        )
                    )
                return table[reference.name]
        known = [*self.engine.model.labels, *self.labels, *self.properties, "init", "deadlock"]
        hint = "known are " + ", ".join(f'"{k}"' for k in known)
        raise NameFault(
            Diagnostic(f'unknown label "{reference.name}"', reference.span, "unknown-label", hint)
        )

    def inside(self, reference: LabelReference) -> Context:
        """The context for what a reference stands for."""
        return replace(self, open=self.open | {reference.name})

    def relevant_at(self, states: StateSet) -> Context:
        """The same where values are needed at these states (at all, if the options say so)."""
        return replace(self, relevant_states=None if self.options.everywhere else states)

    def with_epsilon(self, epsilon: float) -> Context:
        """The same with another accuracy wanted; the log is shared."""
        return replace(self, options=replace(self.options, epsilon=epsilon))

    def solve(self, equations: Equations, known: Sequence[tuple[StateSet, float]]) -> Values:
        """The solution of equations on all states; `known`: constants on other sets, 0 elsewhere. The run is logged."""
        started = perf_counter()
        solved = equations.solve(known, self.options, self.observer)
        if solved.unknowns:
            if solved.width > self.options.epsilon:
                self.log.warn(
                    f"the bounds are {solved.width:.1E} apart, further than asked for: {solved.explanation}"
                )
            seconds = perf_counter() - started
            self.log.runs.append(
                SolverRun(
                    "linear",
                    solved.method,
                    solved.unknowns,
                    solved.iterations,
                    seconds,
                    solved.explanation,
                    solved.certified,
                )
            )
        return solved.values

    def example(self, states: StateSet) -> str:
        """One of the states, of which there must be one, as it is shown."""
        values = next(iter(self.engine.valuations(self.engine.first(states))))
        return describe_state(self.engine.model.variables, values)

    @cached_property
    def _names(self) -> Mapping[str, Type]:
        return {v.name: v.type for v in self.engine.model.variables}

    def type(self, expression: Expression) -> Type:
        """The type of a formula."""
        return type_of(expression, self._names, _LabelTypes(self))


@dataclass(frozen=True)
class _LabelTypes(Mapping[str, Type]):
    """Types of references: a label is a bool, a property has the type of its formula."""

    context: Context

    def __getitem__(self, name: str) -> Type:
        context = self.context
        if (
            name in ("init", "deadlock")
            or name in context.labels
            or name in context.engine.model.labels
        ):
            return Type.BOOL
        reference = LabelReference(name)
        return context.inside(reference).type(context.referred(reference))

    def __contains__(self, name: object) -> bool:
        return True  # an unknown name is reported, with what is known, when it is looked up

    def __iter__(self) -> Iterator[str]:
        yield from (
            "init",
            "deadlock",
            *self.context.labels,
            *self.context.engine.model.labels,
            *self.context.properties,
        )

    def __len__(self) -> int:
        return (
            len(self.context.labels)
            + len(self.context.engine.model.labels)
            + len(self.context.properties)
            + 2
        )
