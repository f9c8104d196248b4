"""The façade: `symcheck.load("die.pm").check("P=? [ F d=6 ]")`.

Everything it does is a call of a stage's own function; `Model` only keeps the values between them, each made on first use.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symcheck.check.checker import check
from symcheck.check.property_instance import Question, lumped, reduced
from symcheck.check.result import Result
from symcheck.engines import registry
from symcheck.engines.base import Engine
from symcheck.errors import UsageError
from symcheck.options import Options
from symcheck.semantics.binding.bind import BoundProperties, BoundProperty, bind, bind_properties
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import ModelType
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.parse import (
    parse_model,
    parse_model_file,
    parse_properties,
    parse_properties_file,
)

if TYPE_CHECKING:
    from symcheck.check.state_distributions import Distribution
    from symcheck.simulate.path import Path as RandomPath

__all__ = ["Model", "load", "loads"]

Given = Mapping[str, Value | str]


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A model text with the constants and options it is checked with.

    program, bound and engine are the stages of the path from text to result; each is made when it is first asked for.
    With the option `reduce`, properties are checked on a smaller model, which is made for each check (or check_all) anew;
    `engine` is that of the whole model.
    """

    program: Program
    constants: Given
    options: Options
    type: ModelType | None = None

    def __repr__(self) -> str:
        given = ", ".join(f"{n}={v}" for n, v in self.constants.items())
        kind = self.type or self.program.type or ModelType.MDP
        return f"<Model: {kind.value}, modules {' '.join(m.name for m in self.program.modules)}{', ' + given if given else ''}>"

    @cached_property
    def bound(self) -> BoundModel:
        """Constants evaluated, names resolved, types checked. Raises InputError."""
        return bind(self.program, self.constants, model_type=self.type, exact=self.options.exact)

    @cached_property
    def engine(self) -> Engine:
        """The built model: reachable states and matrix. Raises ModelFault, UnsupportedError, ResourceError."""
        return registry.build(self.bound, self.options)

    def with_options(self, **changes: Any) -> Model:
        """The same model, to be built and checked otherwise."""
        changed = replace(self.options, **_arithmetic(changes))
        return Model(self.program, self.constants, changed, self.type)

    def check(self, formula: str, constants: Given | None = None) -> Result:
        """Check one property, such as `P=? [ F "done" ]`. Raises SymcheckError."""
        file = parse_properties(formula)
        if len(file.properties) != 1:
            raise UsageError(
                f"one property is wanted here, not {len(file.properties)}; check_all takes several"
            )
        return next(self._answers(file, constants))[1]

    def check_all(
        self, properties: str | Path | PropertiesFile, constants: Given | None = None
    ) -> Iterator[tuple[BoundProperty, Result]]:
        """Check the properties of a file (a Path), of a text, or parsed already, one after the other.

        With the option `bisim`, one quotient serves all of them where that is a gain.
        """
        match properties:
            case PropertiesFile():
                file = properties
            case Path():
                file = parse_properties_file(properties)
            case str():
                file = parse_properties(properties)
        yield from self._answers(file, constants)

    def properties(self, file: PropertiesFile, constants: Given | None = None) -> BoundProperties:
        """Properties bound to this model."""
        return bind_properties(file, self.bound, constants)

    def transient(self, time: float) -> Distribution:
        """The distribution over the states after some time, or steps of a DTMC; initial states have equal probabilities.

        Raises UnsupportedError for an MDP.
        """
        from symcheck.check.state_distributions import transient

        return transient(self.engine, time, self.options)

    def steady_state(self) -> Distribution:
        """The long-run distribution over the states. Raises UnsupportedError for an MDP."""
        from symcheck.check.state_distributions import steady_state

        return steady_state(self.engine, self.options)

    def simulate(
        self,
        steps: int | None = None,
        *,
        time: float | None = None,
        seed: int | None = None,
        loop_check: bool = True,
    ) -> RandomPath:
        """A random path of so many steps (or until a time), without building the model. The same seed gives the same path."""
        from symcheck.simulate.walk import simulate

        return simulate(self.bound, steps, time=time, seed=seed, loop_check=loop_check)

    def estimate(self, formula: str, constants: Given | None = None, **plan: Any) -> Result:
        """Estimate one property from random paths, without building the model.

        `plan`: the fields of `symcheck.simulate.statistics.Plan`, such as samples=100_000, width=0.01, seed=1. The result's
        accuracy is an interval with a confidence. Raises SymcheckError.
        """
        from symcheck.simulate.check import check_by_sampling
        from symcheck.simulate.statistics import Plan

        bound = self.properties(parse_properties(formula), constants)
        if len(bound.properties) != 1:
            raise UsageError(f"one property is wanted here, not {len(bound.properties)}")
        fixed = self.options.fix_deadlocks
        return check_by_sampling(
            self.bound,
            bound.properties[0].formula,
            Plan(**plan),
            labels=bound.labels,
            fix_deadlocks=fixed,
        )

    def _answers(
        self, file: PropertiesFile, constants: Given | None
    ) -> Iterator[tuple[BoundProperty, Result]]:
        questions = [Question(file, i, constants or {}) for i in range(len(file.properties))]
        bound = [
            q.bind(self.bound) for q in questions
        ]  # faults of the text come before anything is built
        engine = self._engine_for(questions)
        shared = lumped(engine, questions, self.options)
        for question, (one, labels) in zip(questions, bound, strict=True):
            yield (
                one,
                check(
                    engine,
                    one.formula,
                    self.options,
                    labels=labels,
                    rebind=question.formula,
                    shared=shared,
                ),
            )

    @cached_property
    def _reduced(self) -> dict[Any, Engine]:
        """The engine built last of a reduced model, by the questions that it was reduced for."""
        return {}

    def _engine_for(self, questions: Sequence[Question]) -> Engine:
        """The engine to which the questions of a file are put: with `reduce`, that of a model made for them."""
        if not self.options.reduce or self.options.fairness:
            return self.engine
        asked = tuple((q.file, q.index, *q.constants.items()) for q in questions)
        if asked not in self._reduced:
            self._reduced.clear()
            self._reduced[asked] = registry.build(
                reduced(self.bound, questions, steps=False).model, self.options
            )
        return self._reduced[asked]


def _arithmetic(options: dict[str, Any]) -> dict[str, Any]:
    """Options in which an engine says its arithmetic: that of the exact engine is rational, from the text on."""
    if "engine" in options and "exact" not in options:
        return options | {"exact": options["engine"] == "exact"}
    return options


def load(
    path: str | Path,
    constants: Given | None = None,
    *,
    type: ModelType | None = None,
    **options: Any,
) -> Model:
    """Read a model file. `options` are the fields of `symcheck.Options`, such as engine="sparse". Raises InputError."""
    return Model(parse_model_file(path), constants or {}, Options(**_arithmetic(options)), type)


def loads(
    text: str, constants: Given | None = None, *, type: ModelType | None = None, **options: Any
) -> Model:
    """A model from its text, as `load`."""
    return Model(parse_model(text), constants or {}, Options(**_arithmetic(options)), type)
