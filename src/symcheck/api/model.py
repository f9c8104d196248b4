"""A model as users see it: built, checked, sampled and shown on a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, Self

import numpy as np

from symcheck.api.arguments import single_property
from symcheck.api.checking import CheckedModel
from symcheck.api.stages import limited
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.constant_values import GivenConstants, constant_values, parameter_ranges
from symcheck.direction import Direction
from symcheck.engines.states import Named, StateKey, States
from symcheck.errors import UnsupportedError, UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.semantics.model import Value, Variable
from symcheck.semantics.rewards import Structure
from symcheck.syntax.declarations import PropertiesFile

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from networkx import DiGraph
    from scipy.sparse import csr_array

    from symcheck.check.parametric import Search
    from symcheck.check.regions import Extremum
    from symcheck.check.state_distributions import Distribution
    from symcheck.engines.base import Engine, StateSet
    from symcheck.engines.transition_table import Choice, TransitionTable
    from symcheck.parallel.dask import Cluster
    from symcheck.parallel.workers import Workers
    from symcheck.simulate.check import SamplesObserver
    from symcheck.simulate.path import Path as RandomPath
    from symcheck.simulate.statistics import Method, Plan
    from symcheck.simulate.stepper import Simulator
    from symcheck.simulate.steps import CommandSuccessors
    from symcheck.teach.model_page import Page

__all__ = ["Model", "StructureRewards"]


class StructureRewards(NamedTuple):
    """A reward structure as arrays: float64, or rationals.

    Attributes:
        states: the reward of each state (per unit of time in a CTMC).
        choices: the expected transition reward of each choice, a row of the matrix (per unit of
            time in a CTMC).
    """

    states: Numbers
    choices: Numbers


@dataclass(frozen=True, eq=False, repr=False)
class Model(CheckedModel):
    """A model with the constants and options that it is checked with.

    `states`, `transitions`, `matrix`, `labels`, `rewards` and `where` show the built model.
    `bound` and `engine` are the stages of the path from text to result; each is made when it is
    first used. With the option `reduce`, properties are checked on a smaller model, made for each
    `check` (or `check_all`); `engine` is that of the whole model.

    Attributes:
        program: the parsed text.
        given_constants: one value for each constant that the text leaves open.
        options: how the model is built and checked.
        given_type: read the model as this type, whatever its keyword says.
        observer: is told of the progress of building, and of the choice of an engine.
        smaller: what is built in place of the model, for some properties (see `reduced_for`).
        parameters: the ranges of the constants that are left open (see `parametric`).
    """

    def parametric(self, parameters: Mapping[str, tuple[object, object]] | Iterable[str]) -> Self:
        """The model with constants that are left open: its values are functions of them.

        Args:
            parameters: their open ranges: a mapping, a text such as "p=0.1:0.9,q", or a list of
                such parts; a range that is not given is 0:1.

        Returns:
            A model whose `check` gives rational functions, and truth values by regions
            (`Result.regions`).

        Raises:
            InputError: there is no such open constant, or a parameter stands where it may not.
            UsageError: a range is faulty.

        Examples:
            >>> import symcheck
            >>> coin = symcheck.loads(
            ...     "dtmc const double p;"
            ...     "module m x:[0..2]; [] x=0 -> p:(x'=1) + 1-p:(x'=2); endmodule"
            ... )
            >>> print(coin.parametric("p=0.1:0.9").check("P=? [ F x=2 ]").value)
            -p+1
        """
        return replace(self, parameters=parameter_ranges(parameters)).checked()

    @limited
    def feasible(
        self, formula: str, constants: GivenConstants | str | None = None
    ) -> Mapping[str, Fraction] | None:
        """A point of the parameters at which a formula holds exactly; None if there is none.

        Raises:
            NumericalError: no point is found, and it is not proved that there is none.
            UnsupportedError: the formula is neither true nor false.
        """
        return self._search(formula, constants).feasible()

    @limited
    def extremum(
        self,
        formula: str,
        direction: Literal["min", "max"],
        gap: float = 0.001,
        constants: GivenConstants | str | None = None,
    ) -> Extremum:
        """The least or greatest value of a numeric formula over the ranges of the parameters.

        Returns:
            A value that is attained at a point, and a proved bound of all values, up to `gap` from
            it.

        Raises:
            NumericalError: the bounds do not come so close.
            UsageError: the direction is neither, or the gap is not above 0.
        """
        if direction not in ("min", "max"):
            raise UsageError(f"direction {direction!r} is neither 'min' nor 'max'")
        if not 0 < gap < inf:
            raise UsageError(f"gap={gap}: expected a number above 0")
        search = self._search(formula, constants)
        return search.extremum(Direction(direction), Fraction(str(gap)))

    def _search(self, formula: str, constants: GivenConstants | str | None) -> Search:
        from symcheck.check.parametric import Search

        if not self.parameters:
            raise UsageError("the model has no parameters", hint='model.parametric("p=0.1:0.9")')
        file = single_property(formula)
        bound, labels = PropertyInstance(file, 0, constant_values(constants)).bind(self.bound)
        return Search(self.engine, bound.formula, self.options, labels, self.bound)

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

    @cached_property
    def transitions(self) -> TransitionTable:
        """The transitions: source, action, target, probability (a rate in a CTMC)."""
        from symcheck.engines.transition_table import TransitionTable

        return TransitionTable(self.engine)

    def successors(
        self, state: StateKey | None = None, /, **values: bool | int
    ) -> tuple[Choice, ...]:
        """The choices of a state: their actions, and the probabilities (rates) of its successors.

        A chain has one choice. As in `matrix`, a deadlock has a self-loop. `simulator` has the
        choices with their commands, of models that are too large to be built, too.

        Args:
            state: a state, its number, or the values of its variables as a mapping or a tuple.
            values: the values of the variables, in place of `state`.

        Raises:
            KeyError: the state is not reachable.
            UnsupportedError: there are more than ten million transitions.

        Examples:
            >>> import symcheck
            >>> gambler = symcheck.load("models/gambler/stakes.nm")
            >>> for choice in gambler.successors(money=2):
            ...     print(choice.action, choice.successors)
            stake1 {(money=1): 0.6, (money=3): 0.4}
            stake2 {(money=0): 0.6, (money=4): 0.4}
        """
        if state is not None and values:
            raise TypeError("a state is given by one argument, or by the values of its variables")
        return self.transitions.choices(self.states[values if state is None else state])

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

    @property
    def sccs(self) -> list[States]:
        """The strongly connected components, in the order of their first states.

        A state to which no path leads back is a component of its own, and is left out.

        Raises UnsupportedError if there are more than ten million transitions.

        Examples:
            >>> import symcheck
            >>> die = symcheck.load("models/die/die.pm")
            >>> [component.numbers.tolist() for component in die.sccs]
            [[1, 3], [2, 6], [7], [8], [9], [10], [11], [12]]
        """
        from symcheck.engines.explicit.intervals import IntervalEngine
        from symcheck.numerics.graph import nontrivial_sccs

        engine = self.engine
        intervals = engine.capability(IntervalEngine)  # whose ends are all positive
        matrix = self.transitions.matrix if intervals is None else intervals.weights
        found = nontrivial_sccs(matrix)
        return self._components(
            engine.from_bools(np.bincount(states, minlength=engine.states) > 0) for states in found
        )

    @property
    def bsccs(self) -> list[States]:
        """The bottom strongly connected components, which are never left, in the order of their
        first states.

        Examples:
            >>> import symcheck
            >>> die = symcheck.load("models/die/die.pm")
            >>> len(die.bsccs), die.bsccs[0][0]
            (6, (s=7, d=1))
        """
        return self._components(self.engine.graph.bsccs())

    @property
    def mecs(self) -> list[States]:
        """The maximal end components of an MDP, in the order of their first states.

        Raises:
            UnsupportedError: the model is a chain.

        Examples:
            >>> import symcheck
            >>> symcheck.load("models/gambler/stakes.nm").mecs
            [<States: 1 of 9>, <States: 1 of 9>]
        """
        if not self.type.has_choices:
            raise UnsupportedError(
                "end components exist only in MDPs", hint="bsccs are the bottom ones of a chain"
            )
        return self._components(self.engine.graph.end_components(self.engine.all))

    def _components(self, found: Iterable[StateSet]) -> list[States]:
        ordered = sorted(found, key=lambda states: int(self.engine.numbers(states, 1)[0]))
        return [States(self.engine, states) for states in ordered]

    def to_networkx(self) -> DiGraph:
        """The states and transitions as a graph (see `TransitionTable.to_networkx`)."""
        return self.transitions.to_networkx()

    # --------------------------------------------------------- distributions and paths

    @limited
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

    @limited
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
        max_states: int | None = None,
        title: str = "",
    ) -> Page:
        """A page to step through; see `symcheck.teach.model_page`.

        Examples:
            >>> load("die.pm").page("P=? [ F d=6 ]").save("die.html")  # doctest: +SKIP
        """
        from symcheck.teach.model_page import model_page

        return model_page(self, properties, constants, max_states=max_states, title=title)

    @limited
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
        from symcheck.simulate.stepper import simulate

        return simulate(
            self._steps, steps, time=time, seed=seed, loop_check=loop_check, max_steps=max_steps
        )

    def simulator(self, seed: int | None = None, start: str | None = None) -> Simulator:
        """A path that grows step by step; the model is not built (see its class).

        Args:
            seed: of the random numbers; None draws one.
            start: the first state: the values of all variables, such as "x=2, lost=true", or a
                condition that one reachable state satisfies, for which the model is built; None
                for an initial state.

        Raises:
            InputError: the condition is faulty.
            UsageError: no state or several satisfy it, or a value is outside of its range.
        """
        from symcheck.api.chosen_state import chosen_state
        from symcheck.simulate.stepper import Simulator

        return Simulator(self._steps, seed, None if start is None else chosen_state(self, start))

    @cached_property
    def _steps(self) -> CommandSuccessors:
        from symcheck.simulate.steps import CommandSuccessors

        return CommandSuccessors(self.bound, self.options.check_sums)

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
        result is an interval with a confidence; for an MDP it is one for the value of the uniform
        strategy, which takes each choice of a state with equal probability. The processes (`jobs`)
        or the executor that sample the paths (see `symcheck.experiment`) do not change the result.
        Raises SymcheckError.
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
        instance = PropertyInstance(single_property(formula), 0, constant_values(constants))
        with Workers(jobs, executor) as workers:
            return self.estimate_instance(instance, plan, workers)

    @property
    def _table(self) -> Engine | None:
        """The explicit engine of a model without commands."""
        return None

    @limited
    def estimate_instance(
        self,
        instance: PropertyInstance,
        plan: Plan,
        workers: Workers | None = None,
        observer: SamplesObserver | None = None,
    ) -> Result:
        """Estimate a property from random paths, sampled as planned. Raises SymcheckError."""
        from symcheck.simulate.check import check_by_sampling

        self._require_answerable(instance)
        bound, labels = instance.bind(self.bound)
        fixed = self.options.fix_deadlocks
        return check_by_sampling(
            self.bound,
            bound.formula,
            plan,
            labels=labels,
            fix_deadlocks=fixed,
            table=self._table,
            workers=workers,
            observer=observer,
        )
