"""The façade: `symcheck.load("die.pm").check("P=? [ F d=6 ]")`.

Every step from text to result is a function of another package; `Model` calls them in order and
keeps the values between them, each made when it is first used. The command line and sweeps use the
same methods.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial, wraps
from inspect import Parameter, signature
from os import PathLike
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Concatenate,
    Literal,
    NamedTuple,
    ParamSpec,
    TypeVar,
    Unpack,
    cast,
)

from symcheck.check.checker import check
from symcheck.check.property_instance import (
    PropertyInstance,
    observations_up_to_symmetry,
    property_instances,
    reduced,
    shared_quotient,
    stopped,
)
from symcheck.check.result import Result
from symcheck.constant_values import ConstantValue, GivenConstants, constant_values
from symcheck.engines import registry
from symcheck.engines.base import Engine
from symcheck.engines.states import Named, States
from symcheck.errors import ResourceError, SymcheckError, UsageError
from symcheck.matrices.numbers import Numbers
from symcheck.numerics.linear.problem import Observer as IterationObserver
from symcheck.options import Options, OptionValues, make_options
from symcheck.semantics.binding.bind import (
    BoundProperties,
    BoundProperty,
    bind,
    bind_properties,
    check_constant_names,
    undefined_constants,
)
from symcheck.semantics.diagnostics import suggest
from symcheck.semantics.expressions.literals import as_expression
from symcheck.semantics.model import BoundModel, Value, Variable
from symcheck.semantics.rewards import Structure
from symcheck.syntax.ast import WITHOUT_KEYWORD, ModelType
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.parse import (
    parse_model,
    parse_model_file,
    parse_properties,
    parse_properties_file,
)
from symcheck.time_limit import seconds_left, within

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from networkx import DiGraph
    from scipy.sparse import csr_array

    from symcheck.check.bisimulation.on_quotient import SharedQuotient
    from symcheck.check.state_distributions import Distribution
    from symcheck.check.testing.property_tests import PropertyTests
    from symcheck.engines.transition_table import TransitionTable
    from symcheck.parallel.dask import Cluster
    from symcheck.parallel.workers import Workers
    from symcheck.semantics.reduction.reset_dead_variables import Reduction
    from symcheck.simulate.check import SamplesObserver
    from symcheck.simulate.path import Path as RandomPath
    from symcheck.simulate.statistics import Method, Plan
    from symcheck.simulate.stepper import Simulator
    from symcheck.simulate.steps import Steps
    from symcheck.teach.model_page import Page

__all__ = [
    "Model",
    "ModelTypeName",
    "ReducedModel",
    "StructureRewards",
    "load",
    "loads",
    "model_type",
    "properties_file",
    "takes_options",
]

F = TypeVar("F", bound=Callable[..., object])
P = ParamSpec("P")
T = TypeVar("T")
Observer = Callable[[object], None]
ModelTypeName = Literal["dtmc", "ctmc", "mdp"]

_FILE_NAME = re.compile(r"[^\s\[\]]+\.(pctl|csl|ltl|props|prop|prctl|jani)(\.gz|\.xz)?")
"""A text that names a file of properties and is none itself."""


class StructureRewards(NamedTuple):
    """A reward structure as arrays: float64, or rationals.

    Attributes:
        states: the reward of each state (per unit of time in a CTMC).
        choices: the expected transition reward of each choice, a row of the matrix (per unit of
            time in a CTMC).
    """

    states: Numbers
    choices: Numbers


def takes_options(function: F) -> F:
    """A decorator: `help` and completion show the options as keyword parameters."""
    declared = signature(function)
    kept = [p for p in declared.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    options = [
        Parameter(f.name, Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type)
        for f in fields(Options)
    ]
    function.__signature__ = declared.replace(parameters=[*kept, *options])  # type: ignore[attr-defined]
    return function


def _limited(
    method: Callable[Concatenate[Model, P], T],
) -> Callable[Concatenate[Model, P], T]:
    """A decorator: a call keeps to the options `time_limit` and `workdir`."""

    @wraps(method)
    def limited(self: Model, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self._within_limits(lambda: method(self, *args, **kwargs))

    return limited


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A model with the constants and options that it is checked with.

    `states`, `transitions`, `matrix`, `labels`, `rewards` and `where` show the built model.
    `bound` and `engine` are the stages of the path from text to result; each is made when it is
    first used. With the option `reduce`, properties are checked on a smaller model, made for each
    `check` (or `check_all`); `engine` is that of the whole model.

    Args:
        program: the parsed text.
        given_constants: one value for each constant that the text leaves open.
        options: how the model is built and checked.
        given_type: read the model as this type, whatever its keyword says.
        observer: is told of the progress of building, and of the choice of an engine.
    """

    program: Program
    given_constants: GivenConstants
    options: Options
    given_type: ModelType | None = None
    observer: Observer | None = None

    def __repr__(self) -> str:
        given = "".join(f", {n}={v}" for n, v in self.given_constants.items())
        modules = " ".join(m.name for m in self.program.modules)
        return f"<Model: {self.type.value}, modules {modules}{given}>"

    @property
    def type(self) -> ModelType:
        """The model type: the given one, or that of the text, in which no keyword means MDP."""
        return self.given_type or self.program.type or WITHOUT_KEYWORD

    def _repr_html_(self) -> str:
        from symcheck.tables import Table

        facts = {
            "type": [self.type.value],
            "modules": [m.name for m in self.program.modules],
            "constants": [f"{n}={v}" for n, v in self.given_constants.items()],
            "labels": [x.name for x in self.program.labels],
            "states": [f"{self.engine.states:,}"] if "engine" in vars(self) else [],
        }
        rows = [(name, ", ".join(texts)) for name, texts in facts.items() if texts]
        return Table.of(("", ""), rows)._repr_html_()

    # ------------------------------------------------------------------------- stages

    @cached_property
    def bound(self) -> BoundModel:
        """Constants evaluated, names resolved, types checked. Raises InputError."""
        return bind(
            self.program,
            self.given_constants,
            model_type=self.given_type,
            exact=self.options.exact,
            normalise=self.options.check_sums and not self.options.exact,
        )

    def _within_limits(self, compute: Callable[[], T]) -> T:
        """What a function returns within `time_limit`, with `threads`, and with its large arrays
        in `workdir`.

        Raises TimeLimitError, and UsageError if the folder cannot be used.
        """
        from symcheck.parallel.threads import use_threads

        folder, limit = self.options.workdir, self.options.time_limit
        compute = use_threads(self.options.threads)(compute)
        if folder is not None:
            from symcheck.explicit.file_arrays import arrays_in

            compute = arrays_in(folder)(compute)
        if limit is None:
            return compute()

        def timed() -> T:
            if "engine" in vars(self):  # diagrams of an earlier call have its limit
                from symcheck.engines.symbolic.diagrams import HasDiagrams

                if (symbolic := self.engine.capability(HasDiagrams)) is not None:
                    symbolic.diagrams.manager.limit_time(seconds_left())
            return compute()

        return within(limit, timed)

    @cached_property
    @_limited
    def engine(self) -> Engine:
        """The built model: reachable states and matrix.

        Raises ModelFault, UnsupportedError, ResourceError.
        """
        return registry.build(self.bound, self.options, self.observer)

    # ----------------------------------------------------------------------- variants

    @takes_options
    def with_options(self, **options: Unpack[OptionValues]) -> Model:
        """The same model with other options. Raises UsageError."""
        return replace(self, options=make_options(options, self.options))

    def with_constants(self, constants: GivenConstants | str) -> Model:
        """The same model with other values of its constants. Raises UsageError."""
        return _checked(replace(self, given_constants=constant_values(constants)))

    def with_observer(self, observer: Observer | None) -> Model:
        """The same model, which tells the observer of the progress of building."""
        return replace(self, observer=observer)

    def reduced_for(
        self, instances: Sequence[PropertyInstance], *, keep_steps: bool = False
    ) -> Model:
        """The model on which properties are checked.

        It is smaller with the options `reduce`, `stop_at_targets` and `symmetry`. Under fairness it
        is the model itself, because which strategies are fair depends on the states. The last two
        are used only if neither strategies nor values in all states are asked for.

        Args:
            instances: the properties.
            keep_steps: more than the properties is asked for: preserve the number of steps of each
                path, and explore all states.
        """
        options = self.options
        only_values = not (keep_steps or options.everywhere or options.strategy)
        stops = options.stop_at_targets and only_values
        exchanges = options.symmetry and only_values and bool(instances)
        if not (options.reduce or stops or exchanges):
            return self
        if options.fairness or self.bound.builder is not None:
            return self
        key = tuple((p.file, p.index, *p.constants.items(), keep_steps) for p in instances)
        if key not in self._reduced_models:
            self._reduced_models.clear()
            smaller = stopped(self.bound, instances) if stops else self.bound
            stopped_early, reduction = smaller is not self.bound, None
            if options.reduce:
                reduction = reduced(smaller, instances, keep_steps=keep_steps)
                smaller = reduction.model
            if exchanges:
                observed = partial(observations_up_to_symmetry, instances=instances)
                smaller = replace(smaller, observed=observed)
            if smaller is self.bound:
                return self
            self._reduced_models[key] = ReducedModel(
                self.program,
                self.given_constants,
                self.options,
                self.given_type,
                self.observer,
                smaller,
                reduction,
                stopped_early,
            )
        return self._reduced_models[key]

    @cached_property
    def _reduced_models(self) -> dict[tuple[object, ...], Model]:
        """The last reduced model, by the properties that it was reduced for."""
        return {}

    def instantiated(self) -> Program:
        """The text of the model with the values of all constants. Raises InputError."""
        values = self.bound.constants
        constants = tuple(
            replace(c, value=as_expression(values[c.name], c.type, c.span))
            for c in self.program.constants
        )
        return replace(self.program, constants=constants)

    # ------------------------------------------------------------------ the built model

    @property
    def constants(self) -> Mapping[str, Value]:
        """The value of each constant."""
        return self.bound.constants

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables with their types and ranges, in the order of declaration."""
        return self.bound.variables

    @property
    def states(self) -> States:
        """The reachable states. They are listed only when they are asked for."""
        return States(self.engine, self.engine.all)

    @property
    def deadlocks(self) -> States:
        """The states without a transition, before they were given a self-loop."""
        return States(self.engine, self.engine.deadlocks)

    @property
    def transitions(self) -> TransitionTable:
        """The transitions: source, action, target, probability (a rate in a CTMC)."""
        from symcheck.engines.transition_table import TransitionTable

        return TransitionTable(self.engine)

    @cached_property
    def labels(self) -> Named[States]:
        """The states of each label, "init" and "deadlock" among them."""
        names = (*self.bound.labels, "init", "deadlock")
        return Named({name: self.where(f'"{name}"') for name in names})

    @property
    def rewards(self) -> Named[StructureRewards]:
        """The numbers of each reward structure, as arrays; one without a name is `""`."""
        system, result = self.engine.system(self.engine.all), Named[StructureRewards]()
        for number, structure in enumerate(self.bound.rewards):
            arrays = system.rewards(Structure(number))
            result[structure.name or ""] = StructureRewards(*(a.copy() for a in arrays))
        return result

    @property
    def matrix(self) -> csr_array:
        """The probabilities (rates) as a sparse matrix of scipy, float64[choices, states].

        A chain has a row per state. `transitions.source` and `transitions.choice` relate the rows
        of an MDP, its choices, to states. A deadlock has a self-loop.
        """
        from scipy.sparse import csr_array

        rows = self.transitions.matrix.doubles()
        shape = rows.rows, rows.columns
        return csr_array((rows.data, rows.indices, rows.indptr), shape, copy=True)

    def to_networkx(self) -> DiGraph:
        """The states and transitions as a graph (see `TransitionTable.to_networkx`)."""
        return self.transitions.to_networkx()

    def where(self, formula: str) -> States:
        """The reachable states that satisfy a formula.

        Args:
            formula: may use variables, constants, formulas, labels, and operators such as P>0.5.

        Raises:
            SymcheckError: as for `check`; UsageError if the formula is a number.

        Examples:
            >>> import symcheck
            >>> model = symcheck.loads("dtmc module m x : [0..1]; [] x=0 -> (x'=1); endmodule")
            >>> print(*model.where('x=1 & "deadlock"'))
            (x=1)
        """
        everywhere = replace(self.options, everywhere=True, strategy=False)
        instance = PropertyInstance(_single_property(formula), 0, {})
        satisfying = self.check_instance(instance, options=everywhere).satisfying_or_none
        if satisfying is None:
            raise UsageError(f"a condition is expected, and {formula} is a number")
        return satisfying

    # ---------------------------------------------------------------------- properties

    def check(
        self,
        formula: str,
        constants: GivenConstants | str | None = None,
        *,
        observer: IterationObserver | None = None,
    ) -> Result:
        """Check one property.

        Args:
            formula: text in PRISM's property language.
            constants: one value for each constant that the text declares and leaves open.
            observer: is told of each iteration of a numerical method, and may raise to end it.

        Raises:
            SymcheckError: the text is faulty, the property is not supported, or a limit was
                reached.

        Examples:
            >>> import symcheck
            >>> model = symcheck.loads("dtmc module m x : [0..1]; [] x=0 -> (x'=1); endmodule")
            >>> model.check("P=? [ F x=1 ]").value
            1.0
        """
        return next(self._check_all(_single_property(formula), constants, observer))[1]

    def check_all(
        self,
        properties: str | Path | PropertiesFile,
        constants: GivenConstants | str | None = None,
    ) -> Iterator[tuple[BoundProperty, Result]]:
        """Check several properties one after the other: an iterator of each with its result.

        They are a file (a Path, or its name such as "die.pctl"), a text, or parsed properties.

        With the option `bisim`, one quotient serves all of them if it is small enough.
        """
        return self._check_all(properties_file(properties), constants, None)

    @_limited
    def test(
        self,
        properties: str | Path | PropertiesFile,
        constants: GivenConstants | str | None = None,
    ) -> PropertyTests:
        r"""Compare the results of properties with the comments `// RESULT: …` above them.

        An error of a property, or of building the model, is the result of the property. The
        convention is that of PRISM's tests: see `symcheck.check.testing.expected_results`.

        Args:
            properties: as for `check_all`.
            constants: one value for each constant that the properties leave open.

        Returns:
            A sequence of one test per property, with a report: `ok`, `failed`, `save("t.xml")`.

        Raises:
            SyntaxFault: the text does not follow the grammar.
            ResourceError: a limit was reached.

        Examples:
            >>> import symcheck
            >>> model = symcheck.load("models/die/die.pm")
            >>> model.test("// RESULT: 1/6\\nP=? [ F d=6 ]").ok
            True
        """
        from symcheck.check.testing.property_tests import PropertyTests, property_test

        file = properties_file(properties)
        given = constant_values(constants)
        tests = []
        fault, model, shared = None, self, None
        instances = self.instances(file, {n: (v,) for n, v in given.items()})
        try:
            model = self.reduced_for(instances)
            shared = model.shared_quotient(instances)
            _ = model.engine
        except ResourceError:
            raise
        except SymcheckError as error:  # RESULT lines may expect it
            fault = error
        for instance in instances:
            known = instance.bind(self.bound)[0].constants
            outcome: Result | SymcheckError
            try:
                outcome = fault or model.check_instance(instance, shared=shared)
            except ResourceError:
                raise
            except SymcheckError as error:
                outcome = error
            exact = self.options.exact
            of_model = {n: str(v) for n, v in self.given_constants.items()}
            tests.append(property_test(instance, outcome, of_model, known, exact=exact))
        sources = (s.span.source.name for s in (self.program, *file.properties[:1]))
        return PropertyTests(tuple(tests), " ".join(sources))

    def _check_all(
        self,
        file: PropertiesFile,
        constants: GivenConstants | str | None,
        observer: IterationObserver | None,
    ) -> Iterator[tuple[BoundProperty, Result]]:
        results = self._results(file, constant_values(constants), observer)
        while (result := self._within_limits(lambda: next(results, None))) is not None:
            yield result

    def _results(
        self,
        file: PropertiesFile,
        constants: GivenConstants,
        observer: IterationObserver | None,
    ) -> Iterator[tuple[BoundProperty, Result]]:
        instances = self.instances(file, {n: (v,) for n, v in constants.items()})
        for instance in instances:
            instance.bind(self.bound)  # faults of the text are reported before anything is built
        model = self.reduced_for(instances)
        shared = model.shared_quotient(instances)
        for instance in instances:
            bound, _ = instance.bind(model.bound)
            yield bound, model.check_instance(instance, shared=shared, observer=observer)

    def properties(
        self, file: PropertiesFile, constants: GivenConstants | str | None = None
    ) -> BoundProperties:
        """Properties bound to this model. Raises InputError."""
        return bind_properties(file, self.bound, constant_values(constants))

    def instances(
        self,
        file: PropertiesFile,
        values: Mapping[str, Sequence[ConstantValue]],
        indices: Sequence[int] | None = None,
    ) -> list[PropertyInstance]:
        """The properties of a file for every combination of values of their constants.

        Each property is combined with the constants on which it depends.

        Args:
            file: the properties.
            values: for each constant that the file leaves open, its values.
            indices: the properties, from 0; None for all.
        """
        return property_instances(self.program, file, values, indices)

    @_limited
    def shared_quotient(self, instances: Sequence[PropertyInstance]) -> SharedQuotient | None:
        """One quotient for several properties, with the option `bisim` and if it pays."""
        return shared_quotient(self.engine, instances, self.options)

    @_limited
    def check_instance(
        self,
        instance: PropertyInstance,
        *,
        options: Options | None = None,
        shared: SharedQuotient | None = None,
        observer: IterationObserver | None = None,
    ) -> Result:
        """Check a property on this model as it is (see `reduced_for`).

        Args:
            instance: the property.
            options: how it is checked; None for the options of the model.
            shared: a quotient for several properties, of this model.
            observer: is told of each iteration of a numerical method, and may raise to end it.

        Raises:
            SymcheckError: see `check`.
        """
        bound, labels = instance.bind(self.bound)
        return check(
            self.engine,
            bound.formula,
            options or self.options,
            labels=labels,
            observer=observer,
            shared=shared,
        )

    # --------------------------------------------------------- distributions and paths

    @_limited
    def transient(self, time: float, initial: Numbers | None = None) -> Distribution:
        """The distribution over the states at a time.

        Args:
            time: in the unit of the rates of a CTMC; for a DTMC, a number of steps.
            initial: the distribution at time 0, float64[states] or Fractions; None for the initial
                states with equal probabilities.

        Raises:
            UnsupportedError: the model is an MDP.
        """
        from symcheck.check.state_distributions import transient

        return transient(self.engine, time, self.options, initial)

    @_limited
    def steady_state(self, initial: Numbers | None = None) -> Distribution:
        """The long-run distribution over the states.

        Args:
            initial: as for `transient`.

        Raises:
            UnsupportedError: the model is an MDP.
        """
        from symcheck.check.state_distributions import steady_state

        return steady_state(self.engine, self.options, initial)

    def page(
        self,
        properties: str | Path | PropertiesFile | Sequence[str] = (),
        constants: GivenConstants | str | None = None,
        *,
        max_states: int = 500,
        title: str = "",
    ) -> Page:
        """A page to step through; see `symcheck.teach.model_page`.

        Examples:
            >>> load("die.pm").page("P=? [ F d=6 ]").save("die.html")  # doctest: +SKIP
        """
        from symcheck.teach.model_page import model_page

        return model_page(self, properties, constants, max_states=max_states, title=title)

    @_limited
    def simulate(
        self,
        steps: int | None = None,
        *,
        time: float | None = None,
        seed: int | None = None,
        loop_check: bool = True,
        max_steps: int = 10_000,
    ) -> RandomPath:
        """A random path; the model is not built. The same seed gives the same path.

        Args:
            steps: length of the path; None for no bound but `time` and `max_steps`.
            time: the path ends at this time.
            seed: of the random numbers; None draws one, which is part of the result.
            loop_check: end the path in a state from which it can only repeat itself.
            max_steps: the path ends after so many steps at the latest.
        """
        from symcheck.simulate.walk import simulate

        return simulate(
            self._steps, steps, time=time, seed=seed, loop_check=loop_check, max_steps=max_steps
        )

    def simulator(self, seed: int | None = None) -> Simulator:
        """A path that grows step by step; the model is not built (see its class)."""
        from symcheck.simulate.stepper import Simulator

        return Simulator(self._steps, seed)

    @cached_property
    def _steps(self) -> Steps:
        from symcheck.simulate.steps import Steps

        return Steps(self.bound, self.options.check_sums)

    def estimate(
        self,
        formula: str,
        constants: GivenConstants | str | None = None,
        *,
        method: Method = "ci",
        samples: int | None = None,
        error: float | None = None,
        width: float | None = None,
        pilot: int = 1000,
        most: float | None = None,
        max_steps: int = 10_000,
        seed: int | None = None,
        jobs: int = 1,
        executor: Executor | Cluster | None = None,
    ) -> Result:
        """Estimate one property from random paths; the model is not built.

        The keyword parameters are those of `symcheck.simulate.statistics.Plan`. The accuracy of the
        result is an interval with a confidence. The processes (`jobs`) or the executor that sample
        the paths (see `symcheck.experiment`) do not change the result. Raises SymcheckError.
        """
        from symcheck.parallel.workers import Workers
        from symcheck.simulate.statistics import METHODS, Plan

        if method not in METHODS:
            raise UsageError(f"method={method!r}: expected one of {', '.join(METHODS)}")
        plan = Plan(
            method=method,
            samples=samples,
            error=error,
            width=width,
            pilot=pilot,
            most=most,
            max_steps=max_steps,
            seed=seed,
        )
        instance = PropertyInstance(_single_property(formula), 0, constant_values(constants))
        with Workers(jobs, executor) as workers:
            return self.estimate_instance(instance, plan, workers)

    @_limited
    def estimate_instance(
        self,
        instance: PropertyInstance,
        plan: Plan,
        workers: Workers | None = None,
        observer: SamplesObserver | None = None,
    ) -> Result:
        """Estimate a property from random paths, sampled as planned. Raises SymcheckError."""
        from symcheck.simulate.check import check_by_sampling

        bound, labels = instance.bind(self.bound)
        fixed = self.options.fix_deadlocks
        return check_by_sampling(
            self.bound,
            bound.formula,
            plan,
            labels=labels,
            fix_deadlocks=fixed,
            workers=workers,
            observer=observer,
        )


@dataclass(frozen=True, eq=False, repr=False)
class ReducedModel(Model):
    """A model with fewer states, and the same values of some properties in its initial states.

    Attributes:
        smaller: the bound model. It may let a state represent those that symmetries make of it.
        reduction: how variables whose values are not read again are reset; None without `reduce`.
        partial: whether exploration stops where the properties are decided.
    """

    smaller: BoundModel | None = None
    reduction: Reduction | None = None
    partial: bool = False

    @cached_property
    def bound(self) -> BoundModel:
        """The reduced model."""
        assert self.smaller is not None
        return self.smaller


def properties_file(properties: str | Path | PropertiesFile) -> PropertiesFile:
    """A file (a Path, or its name), a text, or parsed ones. Raises UsageError, SyntaxFault."""
    match properties:
        case PropertiesFile():
            return properties
        case str() if not _FILE_NAME.fullmatch(properties):
            return parse_properties(properties)
        case str() | Path():
            return parse_properties_file(properties)
        case _:
            hint = "a text has several properties, with ; between them"
            raise UsageError(f"properties are a text or a file, not {properties!r}\n  hint: {hint}")


def _single_property(formula: str) -> PropertiesFile:
    """A text with one property, parsed. Raises UsageError, SyntaxFault."""
    if not isinstance(formula, str):
        hint = "check_all takes a file, or a text with several properties"
        raise UsageError(
            f"a property is a text such as 'P=? [ F x=1 ]', not {formula!r}\n  hint: {hint}"
        )
    if _FILE_NAME.fullmatch(formula):
        hint = f"check_all({formula!r})"
        raise UsageError(f"one property is expected here, not a file\n  hint: {hint}")
    file = parse_properties(formula)
    if len(file.properties) != 1:
        raise UsageError(
            f"one property is expected here, not {len(file.properties)}; check_all takes several"
        )
    return file


def model_type(given: ModelType | str | None) -> ModelType | None:
    """The model type of a name such as "mdp". Raises UsageError."""
    try:
        return given if given is None or isinstance(given, ModelType) else ModelType(given)
    except ValueError:
        names = [t.value for t in ModelType]
        near = suggest(str(given), names)
        message = f"type={given!r}: expected one of {', '.join(names)}"
        raise UsageError(message + (f"\n  hint: {near}" if near else "")) from None


def _checked(model: Model) -> Model:
    """The model; a faulty text or constant is an error now, unless values are still missing."""
    missing = {c.name for c in undefined_constants(model.program)}
    if missing <= model.given_constants.keys():
        _ = model.bound
    else:
        check_constant_names(model.program, model.given_constants)
    return model


@takes_options
def load(
    path: str | Path,
    constants: GivenConstants | str | None = None,
    *,
    type: ModelType | ModelTypeName | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """Read a model file in the PRISM language, or in the JANI format (.jani).

    `check_all` of the same JANI file checks its properties.

    Args:
        path: the file.
        constants: one value for each constant that the file leaves open: a mapping, or a text such
            as "N=3,p=0.5".
        type: read the model as this type ("dtmc", "ctmc" or "mdp"), whatever its keyword says.
        options: see `symcheck.Options`.

    Raises:
        InputError: the text is faulty, or there is no such constant.
        UsageError: the file cannot be read, or an option or constant has a wrong value.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/die/die.pm", engine="sparse")
        >>> print(f"{model.check('P=? [ F d=6 ]'):.6f}")
        0.166667
    """
    if not isinstance(cast(object, path), str | PathLike) or "endmodule" in str(path):
        raise UsageError(
            f"load takes the name of a file, not {path!r}\n  hint: symcheck.loads takes a text"
        )
    given, chosen = constant_values(constants), make_options(options)
    return _checked(Model(parse_model_file(path), given, chosen, model_type(type)))


@takes_options
def loads(
    text: str,
    constants: GivenConstants | str | None = None,
    *,
    type: ModelType | ModelTypeName | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """A model from its text; everything else is as for `load`."""
    if not isinstance(cast(object, text), str) or re.fullmatch(r"\S+\.\S+", text):
        raise UsageError(
            f"loads takes the text of a model, not {text!r:.80}\n  hint: symcheck.load reads a file"
        )
    given, chosen = constant_values(constants), make_options(options)
    return _checked(Model(parse_model(text), given, chosen, model_type(type)))
