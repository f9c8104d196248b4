"""The context in which formulas are checked (engine, options, names), and the log of a check."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np

from symcheck.check.result import Line, SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import Engine, Equations, StateSet, Values, erased
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import Diagnostic, NameFault, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Int64s
from symcheck.numerics.linear.problem import Observer, largest_width
from symcheck.options import Options
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.query import Query
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import Expression, LabelReference, Type

if TYPE_CHECKING:
    from symcheck.numerics.concurrent_games import Game

__all__ = ["CheckLog", "Context"]

T = TypeVar("T")


@dataclass
class CheckLog:
    """The log of the check of a property.

    Attributes:
        runs: the numerical computations.
        lines: the lines to print.
        warnings: the warnings, each once.
        wide: whether a warning tells that bounds are further apart than requested.
        witness: a path that explains the result, as the values of the variables in each state.
        objectives: their values in the last equilibrium that was computed.
        no_strategy: why there is no strategy, although one is asked for.
        exact_engine: the model explored in rational arithmetic, once a comparison needed it.
        chosen: per solution, if a strategy is asked for, the engine, the unknowns, and the choice
            of each (see `SolvedValues`).
        kept: what else a strategy needs of the computation of a value (see `Context.once`).
    """

    runs: list[SolverRun] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    wide: bool = False
    witness: Sequence[Mapping[str, int | bool]] | None = None
    objectives: tuple[Values, ...] = ()
    no_strategy: str | None = None
    exact_engine: Engine | None = None
    chosen: list[tuple[Engine, StateSet, Int64s]] = field(default_factory=list)
    kept: list[tuple[tuple[object, ...], object]] = field(default_factory=list)

    def warn(self, text: str) -> None:
        """Add a warning unless it is there already."""
        if text not in self.warnings:
            self.warnings.append(text)


@dataclass(frozen=True)
class Context:
    """An engine, the options, and the meaning of the names in formulas.

    Attributes:
        engine: the model, as sets, values and equations.
        options: the options, such as accuracy and method.
        labels: the labels of the properties file; those of the model are stored with the model.
        properties: the named properties.
        log: the log, shared by all contexts of a check.
        formula: the formula that is checked; None: any.
        open: the properties that are being expanded, to detect one that refers to itself.
        relevant_states: the states at which values need the requested accuracy (None: all); at
            other states, bounds may be wider.
        observer: receives each step of a computation, and may raise an exception to stop it.
        trimmed: whether the model holds only states that matter to the initial one, so that no
            method need look for fewer.
    """

    engine: Engine
    options: Options
    labels: Mapping[str, Expression] = field(default_factory=dict)
    properties: Mapping[str, Expression] = field(default_factory=dict)
    log: CheckLog = field(default_factory=CheckLog)
    formula: Expression | None = None
    open: frozenset[str] = frozenset()
    relevant_states: StateSet | None = None
    observer: Observer | None = None
    trimmed: bool = False

    def referred(self, reference: LabelReference) -> Expression:
        """The expression of a label or a property; "init" and "deadlock" have none.

        Raises:
            NameFault: the name is unknown, or the property refers to itself.
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
        """The context in which the expression of a reference is checked."""
        return replace(self, open=self.open | {reference.name})

    def relevant_at(self, states: StateSet) -> Context:
        """A context in which these states are relevant (all states, if the options say so)."""
        return replace(self, relevant_states=None if self.options.everywhere else states)

    def on(self, engine: Engine) -> Context:
        """A context with the states of another engine, all of which are relevant."""
        return replace(self, engine=engine, relevant_states=None)

    def with_epsilon(self, epsilon: float) -> Context:
        """A context with another requested accuracy and the same log."""
        return replace(self, options=replace(self.options, epsilon=epsilon))

    def playing(self, query: Query[StateSet]) -> tuple[Context, Direction | None]:
        """The context in which a query of a game is computed, and its direction.

        If only one side has choices, it is that of a decision process.
        """
        if query.coalition is None or query.direction is None:
            return self, query.direction
        rows = self.engine.capability(ExplicitEngine)
        if rows is None:
            raise UnsupportedError(f"games are not solved by the engine {self.engine.name}")
        if rows.model.type.concurrent:
            mine = rows.concurrent_game(query.coalition).maximiser
            return self, query.direction if mine.chooses else query.direction.dual
        game = rows.playing(query.coalition)
        assert game.opponents is not None
        assert rows.weights.groups is not None
        choosing = np.diff(rows.weights.groups) > 1
        if not (choosing & game.opponents).any():
            return self, query.direction
        if not (choosing & ~game.opponents).any():
            return self, query.direction.dual
        return replace(self, engine=erased(game)), query.direction

    def concurrent_game(self, query: Query[StateSet]) -> Game | None:
        """The concurrent game in which both sides of a query choose; None if it is none."""
        if query.coalition is None or query.direction is None:
            return None
        rows = self.engine.capability(ExplicitEngine)
        if rows is None or not rows.model.type.concurrent:
            return None
        maximisers = query.coalition
        if query.direction is Direction.MIN:
            maximisers = frozenset(range(len(rows.model.players))) - maximisers
        game = rows.concurrent_game(maximisers)
        return game if game.maximiser.chooses and game.minimiser.chooses else None

    def with_any_method(self) -> Context:
        """The context of what needs proved bounds on the way, by whatever method."""
        return replace(self, options=replace(self.options, method="auto"))

    def within(self, engine: ExplicitEngine, relevant: Bools, *, strategy: bool = False) -> Context:
        """The context of an engine that is solved on the way, with bounds at relevant states and a
        log of its own.
        """
        options = replace(
            self.options, certify=True, bisim=False, everywhere=False, strategy=strategy
        )
        return replace(
            self,
            engine=erased(engine),
            options=options,
            log=CheckLog(),
            relevant_states=ArraySet(relevant),
        )

    def without_strategy(self) -> Context:
        """The context of what needs no strategy, such as formulas within an operator."""
        if not self.options.strategy:
            return self
        return replace(self, options=replace(self.options, strategy=False))

    def once(self, key: Sequence[object], make: Callable[[], T]) -> T:
        """What a value and its strategy both need: made once for each engine and key.

        It is kept only where a strategy is asked for.
        """
        if not self.options.strategy:
            return make()
        whole = (id(self.engine), *key)
        for known, value in self.log.kept:
            if known == whole:
                return cast(T, value)
        made = make()
        self.log.kept.append((whole, made))
        return made

    def solve(self, equations: Equations, known: Sequence[tuple[StateSet, float]]) -> Values:
        """Solve equations, and log the run.

        Args:
            equations: the equations of the unknown states.
            known: sets of other states with their constants; the remaining states have value 0.

        Returns:
            Values of all states.
        """
        solved = equations.solve(known, self.options, self.observer)
        if solved.choices is not None:
            self.log.chosen.append((self.engine, equations.states, solved.choices))
        if solved.unknowns:
            width = solved.width
            if width > self.options.epsilon and self.relevant_states is not None:
                width = largest_width(
                    *solved.values.at(self.relevant_states), self.options.relative
                )
            self.warn_if_wide(width, solved.explanation)
            self.log.runs.append(
                SolverRun(
                    "linear",
                    solved.method,
                    solved.unknowns,
                    solved.iterations,
                    solved.explanation,
                    solved.certified,
                )
            )
        return solved.values

    def choices(self, states: StateSet) -> Int64s | None:
        """The choices of the last solution over some unknowns; None if there was none."""
        for engine, unknowns, choices in reversed(self.log.chosen):
            if engine is self.engine and unknowns == states:
                return choices
        return None

    def warn_if_wide(self, width: float, explanation: str) -> None:
        """Warn if bounds are further apart than requested."""
        if width > self.options.epsilon * (1 + 1e-9):
            self.log.wide = True
            how = "relative to their value, " if self.options.relative else ""
            self.log.warn(
                f"the bounds are {width:.1E} apart, {how}further than asked for: {explanation}"
            )

    def example(self, states: StateSet) -> str:
        """The text of the first state of a non-empty set."""
        values = next(iter(self.engine.valuations(self.engine.first(states))))
        return describe_state(self.engine.model.variables, values)

    @cached_property
    def _names(self) -> Mapping[str, Type]:
        model = self.engine.model
        parameters = dict.fromkeys(model.parameters, Type.DOUBLE)
        return {v.name: v.type for v in model.variables} | parameters

    def type(self, expression: Expression) -> Type:
        """The type of a formula."""
        return type_of(expression, self._names, self._label_type)

    def _label_type(self, reference: LabelReference) -> Type:
        """The type of a reference: a label is a bool, a property has the type of its formula."""
        labels = (*self.labels, *self.engine.model.labels, "init", "deadlock")
        if reference.name in labels:
            return Type.BOOL
        return self.inside(reference).type(self.referred(reference))
