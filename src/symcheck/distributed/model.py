"""A model whose states are partitioned over workers, and the check of its properties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol, assert_never

from symcheck.check.result import Certified, Exact, Result
from symcheck.direction import Direction
from symcheck.distributed import tuning
from symcheck.distributed.part import Part
from symcheck.distributed.parts import Cluster, Parts
from symcheck.errors import ModelFault, NumericalError, UnsupportedError
from symcheck.options import Options
from symcheck.semantics import state_faults
from symcheck.semantics.binding.bind import bind_properties
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_normal_form import (
    Connected,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    normal_form,
    only_window,
)
from symcheck.semantics.rewards import Reward, operator_reward
from symcheck.syntax.ast import (
    Eventually,
    Expression,
    ModelType,
    ProbabilityOperator,
    RewardOperator,
)
from symcheck.syntax.parse import parse_properties
from symcheck.syntax.printer import pretty

__all__ = ["DistributedModel", "explore_on_cluster"]

_SUPPORTED = (
    "a distributed model is checked for P=? [ … ] with F, G, U, W or R, without a bound or with an "
    "upper bound on steps, and for R=? [ F … ]"
)


class LoadedModel(Protocol):
    """A model with the constants and options that it is checked with, a `symcheck.Model`."""

    @property
    def bound(self) -> BoundModel:
        """Constants evaluated, names resolved, types checked."""

    @property
    def options(self) -> Options:
        """How the model is built and checked."""


def explore_on_cluster(
    model: LoadedModel | BoundModel, cluster: Cluster, options: Options | None = None
) -> DistributedModel:
    """Explore a model on the workers of a Dask cluster, each of which keeps a part of the states.

    The owner of a state is a hash of it. Workers explore in rounds, and exchange the states that
    they find for each other.

    Args:
        model: a DTMC, CTMC or MDP with commands and one initial state.
        cluster: a `distributed.Client`.
        options: `fix_deadlocks` and `epsilon` are read; None for those of the model.

    Raises:
        ModelFault: the model breaks a rule in a state.
        UnsupportedError: the model has no commands.
        ResourceError: a worker is lost, or has not enough memory.

    Source: H. Garavel, R. Mateescu, I. Smarandache: Parallel state space construction for
        model-checking (SPIN 2001).

    Examples:
        >>> import symcheck
        >>> from distributed import Client
        >>> from symcheck.distributed import explore_on_cluster
        >>> with Client(n_workers=1, dashboard_address=":0") as client:
        ...     die = explore_on_cluster(symcheck.load("models/die/die.pm"), client)
        ...     die.states, f"{die.check('P=? [ F d=6 ]').value:.6f}"
        (13, '0.166667')
    """
    match model:
        case BoundModel():
            bound, chosen = model, options or Options()
        case _:
            bound, chosen = model.bound, options or model.options
    if bound.builder is not None:
        raise UnsupportedError("only models with commands are explored on a cluster")
    started = perf_counter()
    parts = Parts(bound, cluster)
    rounds, left = 0, True
    while left:
        left = any(parts.exchange(Part.receive, parts.call(Part.expand)))
        rounds += 1
    counts = parts.call(Part.finish)
    deadlocks = sum(c.deadlocks for c in counts)
    if deadlocks and not chosen.fix_deadlocks:
        examples = [text for part in parts.call(Part.deadlock_examples) for text in part]
        raise ModelFault(state_faults.deadlocks(examples, deadlocks))
    return DistributedModel(
        bound,
        chosen,
        parts,
        sum(c.states for c in counts),
        sum(c.transitions for c in counts),
        deadlocks,
        sum(c.ghosts for c in counts),
        rounds,
        perf_counter() - started,
    )


@dataclass(frozen=True, eq=False, repr=False)
class DistributedModel:
    """An explored model, whose states and rows stay on the workers of a cluster.

    Attributes:
        states, transitions, deadlocks: their numbers.
        ghosts: number of values that workers exchange in a round of an iteration.
        rounds: rounds of the exploration.
        seconds: time of the exploration.
    """

    model: BoundModel
    options: Options
    parts: Parts
    states: int
    transitions: int
    deadlocks: int
    ghosts: int
    rounds: int
    seconds: float

    def __repr__(self) -> str:
        return (
            f"<DistributedModel: {self.model.type.value}, {self.states:,} states, "
            f"{self.transitions:,} transitions on {len(self.parts)} workers>"
        )

    def check(self, formula: str) -> Result:
        """The value of a property in the initial state, with proved bounds.

        Args:
            formula: `P=? [ … ]` with F, G, U, W or R over state formulas, without a bound or with
                an upper bound on steps, or `R=? [ F … ]`; in an MDP with a direction.

        Raises:
            InputError: the text is faulty.
            UnsupportedError: another property.
            NumericalError: no bounds are proved, for example because of end components.
            ResourceError: a worker is lost.
        """
        bound = bind_properties(parse_properties(formula), self.model, {})
        started = perf_counter()
        lower, upper, method = self._bounds(bound.properties[0].formula, bound.labels)
        value = (lower + upper) / 2 if lower < upper < float("inf") else lower
        return Result(
            value,
            Exact() if lower == upper else Certified(lower, upper),
            f"on {len(self.parts)} workers; {method}",
            seconds=perf_counter() - started,
        )

    def _bounds(
        self, formula: Expression, labels: Mapping[str, Expression]
    ) -> tuple[float, float, str]:
        known = {**self.model.labels, **labels}
        match formula:
            case ProbabilityOperator(direction, None, path):
                form = normal_form(path, self.model)
                return self._probability(form, self._direction(direction), known)
            case RewardOperator(direction, None, _, Eventually() as query):
                reward = operator_reward(formula, self.model)
                form = normal_form(query, self.model)
                return self._reward(reward, form, self._direction(direction), known)
            case _:
                raise UnsupportedError(f"{_SUPPORTED}, not for '{pretty(formula)}'")

    def _direction(self, given: str | None) -> Direction | None:
        if self.model.type is not ModelType.MDP:
            return None
        if given is None:
            raise UnsupportedError("a direction is missing: Pmin=? or Pmax=? in an mdp")
        return Direction(given)

    # ------------------------------------------------------------------------ probabilities

    def _probability(
        self, form: NormalForm, direction: Direction | None, labels: Mapping[str, Expression]
    ) -> tuple[float, float, str]:
        match form:
            case Negated(operand):
                dual = None if direction is None else direction.dual
                lower, upper, method = self._probability(operand, dual, labels)
                return 1 - upper, 1 - lower, method
            case UntilReached(StateFormula(left), StateFormula(right), extent):
                steps = only_window(extent)
                if steps.trivial:
                    self._evaluate(left, right, labels)
                    return self._until(direction)
                if self.model.type is ModelType.CTMC or steps.steps().lower:
                    raise UnsupportedError(
                        f"{_SUPPORTED}; not with lower bounds, nor times of a ctmc"
                    )
                self._evaluate(left, right, labels)
                return self._bounded_until(direction, steps.steps().upper or 0)
            case StateFormula() | NextState() | Connected() | UntilReached():
                raise UnsupportedError(_SUPPORTED)
            case _:
                assert_never(form)

    def _evaluate(
        self, left: Expression, right: Expression, labels: Mapping[str, Expression]
    ) -> None:
        try:
            self.parts.call(Part.evaluate, "left", left, labels)
            self.parts.call(Part.evaluate, "right", right, labels)
        except UnsupportedError:  # an operator inside: what the simulator says is about paths
            raise UnsupportedError(f"{_SUPPORTED}, over state formulas without operators") from None
        self.parts.call(Part.combine, "through", "left", "right")

    def _search(self, name: str, source: str, through: str, *, every_choice: bool) -> None:
        """Backward search over all parts, in rounds."""
        outgoing = self.parts.call(Part.begin_search, source, through, every_choice)
        new = True
        while new:
            answers = self.parts.exchange(Part.continue_search, outgoing)
            new, outgoing = any(a for a, _ in answers), [m for _, m in answers]
        self.parts.call(Part.end_search, name)

    def _prob0(self, direction: Direction | None) -> None:
        """The states with probability 0 (minimum, maximum) as the set `zero`."""
        every_choice = direction is Direction.MIN
        self._search("reaching", "right", "through", every_choice=every_choice)
        self.parts.call(Part.complement, "zero", "reaching")

    def _prob1(self) -> None:
        """The states from which all strategies have probability 1, by the set `zero` of those from
        which some strategy has probability 0, as the set `one`.

        Source: Baier & Katoen (2008), 10.1.1 and 10.6.1.
        """
        self._search("missing", "zero", "through", every_choice=False)
        self.parts.call(Part.complement, "one", "missing")

    def _is_initial(self, name: str) -> bool:
        return sum(initial for initial, _ in self.parts.call(Part.members, name)) > 0

    def _until(self, direction: Direction | None) -> tuple[float, float, str]:
        self._prob0(direction)
        if direction is Direction.MAX:  # values 1 are not needed: they are bounds as others
            self.parts.call(Part.combine, "one", "right", "zero")
        else:
            self._prob1()
        for name, value in (("one", 1.0), ("zero", 0.0)):
            if self._is_initial(name):
                return value, value, "decided by precomputation"
        return self._solve("one", "zero", direction, None)

    def _bounded_until(self, direction: Direction | None, steps: int) -> tuple[float, float, str]:
        self.parts.call(Part.complement, "zero", "left")
        self.parts.call(Part.combine, "zero", "zero", "right")
        outgoing = self.parts.call(Part.begin_iteration, "right", "zero", direction, None)
        for _ in range(steps):
            outgoing = self.parts.exchange(Part.step, outgoing)
        (value,) = self._initial(upper=False)
        error = (1 + max(self.parts.call(Part.slack))) ** steps - 1
        method = f"{steps} steps"
        if value in (0.0, 1.0):
            return value, value, method
        return value * (1 - error), min(value * (1 + error), 1.0), method

    # ------------------------------------------------------------------------------ rewards

    def _reward(
        self,
        reward: Reward,
        form: NormalForm,
        direction: Direction | None,
        labels: Mapping[str, Expression],
    ) -> tuple[float, float, str]:
        if direction is Direction.MIN:
            raise UnsupportedError("least rewards are not computed on distributed models")
        match form:
            case UntilReached(StateFormula(left), StateFormula(target), extent):
                if not only_window(extent).trivial:
                    raise UnsupportedError(_SUPPORTED)
                self._evaluate(left, target, labels)
            case _:
                raise UnsupportedError(_SUPPORTED)
        self._prob0(None if direction is None else Direction.MIN)
        self._prob1()
        if not self._is_initial("one"):
            return float("inf"), float("inf"), "the target is not reached almost surely"
        self.parts.call(Part.complement, "infinite", "one")
        return self._solve("right", "infinite", direction, reward)

    def _solve(
        self, known: str, zero: str, direction: Direction | None, reward: Reward | None
    ) -> tuple[float, float, str]:
        """Optimistic value iteration (Hartmanns & Kaminski, CAV 2020), with outward rounding.

        Any vector that a step does not raise is an upper bound of the least solution.
        """
        epsilon, rounds = self.options.epsilon, 0
        tolerance = tuning.FIRST_TOLERANCE * epsilon
        outgoing = self.parts.call(Part.begin_iteration, known, zero, direction, reward)
        while tolerance >= tuning.MIN_CHANGE and rounds < tuning.MAX_ROUNDS:
            change = 1.0
            while change > tolerance and rounds < tuning.MAX_ROUNDS:
                answers = self.parts.exchange(Part.improve, outgoing)
                change, outgoing = max(c for c, _ in answers), [m for _, m in answers]
                rounds += 1
            guess = self.parts.call(Part.begin_verification, epsilon)
            for _ in range(tuning.VERIFICATION_ROUNDS):
                verified = self.parts.exchange(Part.verify, guess)
                guess, rounds = [m for _, _, m in verified], rounds + 1
                if all(inductive for inductive, _, _ in verified):
                    (lower,), (upper,) = self._initial(upper=False), self._initial(upper=True)
                    return lower, upper, f"optimistic value iteration, {rounds} rounds"
                if not any(lowered for _, lowered, _ in verified):
                    break
            tolerance /= 10
        raise NumericalError(
            f"no bounds are proved in {rounds} rounds: the iteration converges slowly, or the "
            "model has end components\n  hint: check it on one machine"
        )

    def _initial(self, *, upper: bool) -> list[float]:
        """The values of the initial states."""
        found = [float(x) for part in self.parts.call(Part.initial, upper) for x in part]
        if len(found) != 1:
            raise UnsupportedError(f"the model has {len(found)} initial states: one is supported")
        return found
