"""Checking properties on a model: one, several, or a test of expected results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Generic, Self, TypeVar

from symcheck.api.arguments import properties_file, single_property
from symcheck.api.stages import Smaller, Stages, limited
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
from symcheck.engines.states import States
from symcheck.errors import ResourceError, SymcheckError, UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.numerics.linear.problem import Observer as IterationObserver
from symcheck.options import Options
from symcheck.semantics.binding.bind import BoundProperties, BoundProperty, bind_properties
from symcheck.semantics.features import Feature, offers
from symcheck.syntax.declarations import PropertiesFile
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient
    from symcheck.check.results import PropertyResults
    from symcheck.check.testing.property_tests import PropertyTests

__all__ = ["CheckedModel", "PreparedModel"]

ModelT = TypeVar("ModelT", bound="CheckedModel")


@dataclass(frozen=True, eq=False, repr=False)
class CheckedModel(Stages):
    """A model whose properties are checked.

    With the options `reduce`, `stop_at_targets` and `symmetry`, a smaller model takes its place,
    made for each `check` (or `check_all`).
    """

    def reduced_for(
        self, instances: Sequence[PropertyInstance], *, all_states: bool = False
    ) -> Self:
        """The model on which properties are checked.

        It is smaller with the options `reduce`, `stop_at_targets` and `symmetry`. Under fairness it
        is the model itself, because which strategies are fair depends on the states. The last two
        are used only if neither strategies nor values in all states are asked for.

        Args:
            instances: the properties.
            all_states: explore all states, because more than the properties is asked for.
        """
        options = self.options
        only_values = not all_states and self._asks_values_only(options)
        stops = options.stop_at_targets and only_values
        exchanges = options.symmetry and only_values and bool(instances)
        if not (options.reduce or stops or exchanges):
            return self
        if not self._has_smaller_ones:
            return self
        key = tuple((p.file, p.index, *p.constants.items(), all_states) for p in instances)
        if key not in self._reduced_models:
            self._reduced_models.clear()
            smaller = stopped(self.bound, instances) if stops else self.bound
            stopped_early, reduction = smaller is not self.bound, None
            if options.reduce:
                reduction = reduced(smaller, instances)
                smaller = reduction.model
            if exchanges:
                observed = partial(observations_up_to_symmetry, instances=instances)
                smaller = replace(smaller, observed=observed)
            if smaller is self.bound:
                return self
            self._reduced_models[key] = replace(
                self, smaller=Smaller(smaller, reduction, stopped_early)
            )
        return self._reduced_models[key]

    def prepared_for(
        self, instances: Sequence[PropertyInstance], *, all_states: bool = False
    ) -> PreparedModel[Self]:
        """The model for properties that are checked together. Arguments: those of `reduced_for`."""
        return PreparedModel(self.reduced_for(instances, all_states=all_states), instances)

    def deciding(self, instance: PropertyInstance) -> Self | None:
        """The model that decides a property of a timed automaton; None for other models."""
        clocks = self.bound.clocks
        if clocks is None and not self.bound.type.has_clocks:
            return None
        if clocks is not None and clocks.for_property:
            return self
        from symcheck.api.timed import deciding_model

        automaton = self.bound if clocks is None else clocks.automaton
        return replace(self, smaller=Smaller(deciding_model(automaton, instance, self.options)))

    @staticmethod
    def _asks_values_only(options: Options) -> bool:
        """Whether nothing is asked for but values in initial states."""
        return not (options.everywhere or options.strategy)

    @property
    def _has_smaller_ones(self) -> bool:
        """Whether a model with fewer states may take its place."""
        kept = self.options.fairness or self.parameters or self.is_timed
        return not kept and self.bound.builder is None

    def decided(self, instance: PropertyInstance) -> Self | None:
        """The model up to the states that decide a property; None if that may need every state."""
        if not (self._has_smaller_ones and self._asks_values_only(self.options)):
            return None
        smaller = self.smaller or Smaller(self.bound)
        if smaller.partial or not offers(self.bound, Feature.TRUNCATION):
            return None
        part = stopped(self.bound, [instance])
        if part is self.bound:
            return None
        return replace(self, smaller=smaller._replace(bound=part, partial=True))

    def has_region(self, instance: PropertyInstance) -> bool:
        """Whether a property is checked on a region of the states: paths need no others within its
        bound on time, or the search up to the states that decide it is given up.
        """
        from symcheck.check.truncation import has_bounds_on_a_part, truncates

        formula = instance.bind(self.bound)[0].formula
        if not has_bounds_on_a_part(formula, self.bound):
            return False
        return truncates(formula, self.bound) or (self.decided(instance) or self).is_endless

    @cached_property
    def _reduced_models(self) -> dict[tuple[object, ...], Self]:
        """The last reduced model, by the properties that it was reduced for."""
        return {}

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
        instance = PropertyInstance(single_property(formula), 0, {})
        satisfying = self.check_instance(instance, options=everywhere).satisfying_or_none
        if satisfying is None:
            raise UsageError(f"a condition is expected, and {formula} is a number")
        return satisfying

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
        return self._results(single_property(formula), constants, observer)[0]

    def check_all(
        self,
        properties: str | Path | PropertiesFile,
        constants: GivenConstants | str | None = None,
    ) -> PropertyResults:
        """Check several properties, each when its result is asked for.

        With the option `bisim`, one quotient serves all of them if it is small enough.

        Args:
            properties: a file (a Path, or its name such as "die.pctl"), a text, or parsed ones.
            constants: one value for each constant that the properties leave open.

        Returns:
            An iterator of each property with its result; an index, or the name of a property, gives
            a result too.

        Raises:
            SyntaxFault: a text does not follow the grammar. Asking for a result raises what `check`
                does.

        Examples:
            >>> import symcheck
            >>> die = symcheck.load("models/die/die.pm")
            >>> results = die.check_all('"six": P=? [ F d=6 ]; "tosses": R=? [ F "done" ]')
            >>> print(results["six"], "|", results[1].value)
            0.16666666666666669 (exact up to rounding) | 3.6666666666666665
            >>> [(bound.name, round(float(result), 3)) for bound, result in results]
            [('six', 0.167), ('tosses', 3.667)]
        """
        return self._results(properties_file(properties), constants, None)

    @limited
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
        fault = None
        instances = self.instances(file, {n: (v,) for n, v in given.items()})
        try:
            prepared = self.prepared_for(instances)
            if not self.builds_per_property:
                _ = prepared.model.engine, prepared.shared
        except ResourceError:
            raise
        except SymcheckError as error:  # RESULT lines may expect it
            fault = error
        for instance in instances:
            known = instance.bind(self.bound)[0].constants
            outcome: Result | SymcheckError
            try:
                outcome = fault or prepared.check(instance)
            except ResourceError:
                raise
            except SymcheckError as error:
                outcome = error
            exact = self.options.exact
            of_model = {n: str(v) for n, v in self.given_constants.items()}
            tests.append(property_test(instance, outcome, of_model, known, exact=exact))
        sources = (s.span.source.name for s in (self.program, *file.properties[:1]))
        return PropertyTests(tuple(tests), " ".join(sources))

    @limited
    def _results(
        self,
        file: PropertiesFile,
        constants: GivenConstants | str | None,
        observer: IterationObserver | None,
    ) -> PropertyResults:
        from symcheck.check.results import PropertyResults

        given = constant_values(constants)
        instances = self.instances(file, {n: (v,) for n, v in given.items()})
        faults = [instance.bind(self.bound)[0].fault for instance in instances]
        if (first := faults[0] if faults else None) is not None and None not in faults:
            raise first  # nothing is built for faulty properties alone
        prepared = self.prepared_for(instances)

        def checked(index: int) -> tuple[BoundProperty, Result]:
            bound, _ = instances[index].bind(prepared.model.bound)
            return bound, prepared.check(instances[index], observer)

        return PropertyResults(
            [instance.name for instance in instances],
            lambda index: self.within_limits(lambda: checked(index)),
        )

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

    def _require_answerable(self, instance: PropertyInstance) -> None:
        """Raise UnsupportedError if the model does not tell what a property asks for."""
        if self.bound.delays is not None:
            from symcheck.semantics.timed.delays import refuse_steps

            bound, labels = instance.bind(self.bound)
            refuse_steps(bound.formula, labels, self.bound.delays)

    @limited
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
        self._require_answerable(instance)
        options = options or self.options
        timed = self.deciding(instance)
        if timed is not None:
            from symcheck.api.timed import check_timed

            return check_timed(timed.engine, instance, options, observer)
        bound, labels = instance.bind(self.bound)
        if self.is_truncated and not options.everywhere:
            if self.has_region(instance):
                from symcheck.check.truncation import check_by_truncation

                return check_by_truncation(self.bound, bound.formula, options, labels, observer)
            if (part := self.decided(instance)) is not None:
                started, engine = perf_counter(), part.engine
                bound, labels = instance.bind(part.bound)
                result = check(engine, bound.formula, options, labels=labels, observer=observer)
                size = f"{counted(engine.states, 'state')}, which are all that matter"
                explanation = "; ".join(filter(None, (result.explanation, size)))
                seconds = perf_counter() - started
                return replace(result, explanation=explanation, seconds=seconds)
        if self.parameters:
            from symcheck.check.parametric import check_parametric

            return check_parametric(
                self.engine, bound.formula, options, model=self.bound, labels=labels
            )
        return check(
            self.engine,
            bound.formula,
            options,
            labels=labels,
            observer=observer,
            shared=shared,
        )


@dataclass(frozen=True, eq=False)
class PreparedModel(Generic[ModelT]):
    """A model with what several properties share, which are checked on it one by one.

    Attributes:
        model: the model that is reduced for the properties.
        instances: the properties.
    """

    model: ModelT
    instances: Sequence[PropertyInstance]

    @cached_property
    def shared(self) -> SharedQuotient | None:
        """One quotient for the properties, with the option `bisim` and if it pays."""
        model = self.model
        if not model.options.bisim or len(self.instances) < 2 or model.builds_per_property:
            return None
        return model.within_limits(
            lambda: shared_quotient(model.engine, self.instances, model.options)
        )

    def check(
        self, instance: PropertyInstance, observer: IterationObserver | None = None
    ) -> Result:
        """Check one of the properties. Arguments and exceptions are those of `check_instance`."""
        return self.model.check_instance(instance, shared=self.shared, observer=observer)
