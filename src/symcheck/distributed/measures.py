"""Probabilities and expected rewards in the initial state of a distributed model, with bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, nextafter
from time import perf_counter
from typing import NamedTuple, assert_never

import numpy as np

from symcheck.direction import Direction
from symcheck.distributed import tuning
from symcheck.distributed.component_search import ComponentSearch
from symcheck.distributed.end_components import end_components
from symcheck.distributed.iteration import Iteration
from symcheck.distributed.messages import Message
from symcheck.distributed.part import Part
from symcheck.distributed.parts import Parts
from symcheck.distributed.state_sets import StateSets
from symcheck.distributed.steps import PartSteps
from symcheck.distributed.substitution import Substitution
from symcheck.errors import MemoryLimitError, NumericalError, ResourceError, UnsupportedError
from symcheck.matrices.rows import Floats
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics.transient.poisson import poisson
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
)
from symcheck.semantics.path_normal_form import reward_bound_refused
from symcheck.semantics.query import PathProbability, Query, ReachReward, query_of
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import AnyMeasure, Expression, Literal, Type
from symcheck.syntax.printer import pretty

__all__ = ["Bounds", "Measures", "supported"]

_SUPPORTED = (
    "a distributed model is checked for P [ … ] with F, G, U, W or R, without a bound or with an "
    "upper bound on steps or time, and for R [ F … ] and T [ F … ]"
)
_TRUE = Literal(True, Type.BOOL)


def supported(formula: Expression, model: BoundModel) -> Query[Expression]:
    """What a bound formula asks for.

    Raises:
        UnsupportedError: a distributed model is not checked for it.
    """
    query = query_of(formula, model) if isinstance(formula, AnyMeasure) else None
    if query is None or not isinstance(query.quantity, PathProbability | ReachReward):
        raise UnsupportedError(f"{_SUPPORTED}, not for '{pretty(formula)}'")
    return query


class Bounds(NamedTuple):
    """Bounds on a value, and how they were found."""

    lower: float
    upper: float
    method: str


@dataclass(eq=False)
class Measures:
    """The values of formulas in the initial state.

    Args:
        epsilon: the requested relative width.
        formula: names the checkpoints of its iteration.
    """

    model: BoundModel
    options: Options
    parts: Parts
    epsilon: float
    formula: str
    _saved: float = field(default_factory=perf_counter, init=False)
    _saving: float = field(default=0.0, init=False)
    _is_least_reward: bool = field(default=False, init=False)

    def bounds(self, query: Query[Expression], labels: Mapping[str, Expression]) -> Bounds:
        """Bounds on the value of a query.

        Args:
            query: what is asked for; its threshold is not read.
            labels: state formulas by name.

        Raises:
            UnsupportedError: another quantity (see `supported`).
            NumericalError: no bounds are proved.
        """
        match query.quantity:
            case PathProbability(path):
                return self._probability(path, query.direction, labels)
            case ReachReward(reward, target):
                return self._reward(reward, target, query.direction, labels)
            case _:
                raise UnsupportedError(_SUPPORTED)

    # ------------------------------------------------------------------------ probabilities

    def _probability(
        self,
        path: PathFormula[Expression],
        direction: Direction | None,
        labels: Mapping[str, Expression],
    ) -> Bounds:
        match path:
            case StatePath() | NextPath() | LtlPathFormula():
                raise UnsupportedError(_SUPPORTED)
            case RewardPath():
                raise reward_bound_refused()
            case UntilPath(negative=True):
                dual = None if direction is None else direction.dual
                lower, upper, method = self._probability(
                    replace(path, negative=False), dual, labels
                )
                return Bounds(_complement(upper, 0.0), _complement(lower, 1.0), method)
            case UntilPath(left, right, window):
                if not window.contains_zero:
                    raise UnsupportedError(f"{_SUPPORTED}; not with lower bounds")
                self._evaluate(left, right, labels)
                if window.upper is None:
                    return self._until(direction)
                return self._bounded_until(window, direction)
            case _:
                assert_never(path)

    def _evaluate(
        self, left: Expression, right: Expression, labels: Mapping[str, Expression]
    ) -> None:
        known = {**self.model.labels, **labels}
        try:
            outgoing = self.parts.call(Part.begin_formulas, left, right, known)
        except UnsupportedError:  # an operator inside: what the simulator says is about paths
            raise UnsupportedError(f"{_SUPPORTED}, over state formulas without operators") from None
        self.parts.exchange(StateSets.receive, outgoing)

    def _finish_search(self, name: str, outgoing: list[list[Message]]) -> None:
        """Backward search over all parts, in rounds."""
        while _any_messages(outgoing):
            outgoing = self.parts.exchange(StateSets.continue_search, outgoing)
        self.parts.call(StateSets.end_search, name)

    def _search(
        self, name: str, source: str, *, every_choice: bool, inside: str | None = None
    ) -> None:
        begin = self.parts.call(StateSets.begin_search, source, "through", every_choice, inside)
        self._finish_search(name, begin)

    def _prob0(self, direction: Direction | None) -> None:
        """The states with probability 0 (minimum, maximum) as the set `zero`."""
        self._search("reaching", "right", every_choice=direction is Direction.MIN)
        self.parts.call(StateSets.complement, "zero", "reaching")

    def _prob1(self) -> None:
        """The states from which all strategies have probability 1, by the set `zero` of those from
        which some strategy has probability 0, as the set `one`.

        Source: Baier & Katoen (2008), 10.1.1 and 10.6.1.
        """
        self._search("missing", "zero", every_choice=False)
        self.parts.call(StateSets.complement, "one", "missing")

    def _prob1_of_some_strategy(self) -> None:
        """The states from which some strategy has probability 1, as the set `one`.

        Source: de Alfaro (1997), section 3.5: states are removed that do not reach the target by
        choices which stay among the others.
        """
        self._search("one", "right", every_choice=False)
        before, count = -1, self._count("one")
        while count != before:
            self._search("one", "right", every_choice=False, inside="one")
            before, count = count, self._count("one")

    def _is_initial(self, name: str) -> bool:
        return sum(initial for initial, _ in self.parts.call(StateSets.members, name)) > 0

    def _count(self, name: str) -> int:
        return sum(members for _, members in self.parts.call(StateSets.members, name))

    def _until(self, direction: Direction | None) -> Bounds:
        self._prob0(direction)
        if direction is Direction.MAX:
            self._prob1_of_some_strategy()
        else:
            self._prob1()
        for name, value in (("one", 1.0), ("zero", 0.0)):
            if self._is_initial(name):
                return Bounds(value, value, "decided by precomputation")
        return self._solve("one", "zero", direction, None)

    def _bounded_until(self, window: Window, direction: Direction | None) -> Bounds:
        self.parts.call(StateSets.complement, "zero", "left", "right")
        self.parts.call(Part.begin_iteration, "right", "zero", direction, None)
        if self.model.type.continuous_time:
            _, time = window.times()
            assert time is not None
            return self._uniformised(time)
        steps = window.steps().upper
        assert steps is not None
        begin = self._resume()
        outgoing = self.parts.call(Part.begin_steps, None)
        for k in range(begin, steps):
            answers = self.parts.exchange(PartSteps.step, outgoing, 0.0)
            outgoing = [messages for _, messages in answers]
            self._save(k + 1)
        self._forget()
        (value,) = self._initial(upper=False)
        error = (1 + max(self.parts.call(PartSteps.slack))) ** steps - 1
        if steps == 0 or self._is_initial("right") or self._is_initial("zero"):
            return Bounds(value, value, f"{steps} steps")
        # A product may have underflowed to 0, or a sum may have been rounded to 1.
        low, high = value * (1 - error) - UNDERFLOW_MARGIN, value * (1 + error) + UNDERFLOW_MARGIN
        return Bounds(max(low, 0.0), min(high, 1.0), f"{steps} steps")

    def _uniformised(self, time: float) -> Bounds:
        """Uniformisation (Jensen 1953), with the values of k jumps from below.

        They grow with k, up to 1: so the last one bounds the terms that are left out.
        """
        rate = max(self.parts.call(Iteration.greatest_rate))
        window = poisson(rate * time)
        weights = window.masses()
        begin = self._resume()
        outgoing = self.parts.call(Part.begin_steps, rate or 1.0)
        slack = max(self.parts.call(PartSteps.slack))
        lower, upper = 0.0, 1.0
        for k in range(begin, len(weights)):
            weight = float(weights.between(k, k + 1)[0])
            answers = self.parts.exchange(PartSteps.step, outgoing, weight)
            outgoing = [messages for _, messages in answers]
            (total,) = [s for sums, _ in answers for s in sums]
            (value,) = self._initial(upper=False)
            left = weights.tail_sum(k + 1)
            error = (k + 4) * slack + window.error + tuning.SERIES_ERROR
            lower = (total + left * value) * (1 - error)
            upper = min((total + left + window.missing) * (1 + error), 1.0)
            if upper - lower <= self.epsilon * upper:
                break
            self._save(k + 1)
        self._forget()
        if rate == 0.0:
            (value,) = self._initial(upper=False)
            return Bounds(value, value, "no jumps")
        return Bounds(lower, upper, f"uniformisation, {k + 1} of {len(weights)} steps")

    # ------------------------------------------------------------------------------ rewards

    def _reward(
        self,
        reward: Reward,
        target: Expression,
        direction: Direction | None,
        labels: Mapping[str, Expression],
    ) -> Bounds:
        self._evaluate(_TRUE, target, labels)
        if direction is Direction.MIN:
            self._prob1_of_some_strategy()
        else:
            self._prob0(None if direction is None else Direction.MIN)
            self._prob1()
        if not self._is_initial("one"):
            method = "the target is not reached almost surely"
            return Bounds(float("inf"), float("inf"), method)
        if self._is_initial("right"):
            return Bounds(0.0, 0.0, "the initial state is in the target")
        self.parts.call(StateSets.complement, "infinite", "one")
        return self._solve("right", "infinite", direction, reward)

    def _collapse_components(self) -> None:
        """Find the end components of the unknowns (for a reward, those in which it is 0), whose
        states have one value.

        Raises:
            ResourceError: the choices between their states are too many for this process.
        """
        begin = self.parts.call(Part.begin_component_search)
        self._finish_search("leaving", begin)
        self.parts.call(StateSets.complement, "staying", "leaving")
        members = [states for _, states in self.parts.call(StateSets.members, "staying")]
        if sum(members) > tuning.COMPONENT_STATES:
            raise ResourceError(
                f"a strategy may stay away from the target for ever in {sum(members)} states, and "
                f"end components are found among {tuning.COMPONENT_STATES} states at most",
                hint="check it on one machine",
            )
        if not sum(members):
            return
        firsts = [sum(members[:i]) for i in range(len(members))]
        rows = self.parts.exchange(
            ComponentSearch.rows, self.parts.call(ComponentSearch.number_states, firsts)
        )
        components, count = end_components(rows)
        if count:
            outgoing = self.parts.exchange(ComponentSearch.number_components, [components])
            self.parts.exchange(ComponentSearch.collapse, outgoing, count)

    # ---------------------------------------------------------------------------- iteration

    def _solve(
        self, known: str, zero: str, direction: Direction | None, reward: Reward | None
    ) -> Bounds:
        """Bounds from those of the sets `known` and `zero` (see `Iteration`)."""
        problem = (known, zero, direction, reward)
        self.parts.call(Part.begin_iteration, *problem)
        # Estimates of other methods are no bounds.
        settings = replace(self.options, epsilon=self.epsilon, method="auto")
        if len(self.parts) == 1:
            ((lower, upper, method),) = self.parts.call(Iteration.solve_alone, settings)
            return Bounds(lower, upper, method)
        try:
            rounds, width, found = self._substitute(replace(settings, relative=True))
        except MemoryLimitError:  # the iteration needs less
            rounds, width, found = 0, inf, None
        if found is None or width > self.epsilon:
            if width > tuning.SUBSTITUTION_WIDTH * self.epsilon:
                self.parts.call(Part.begin_iteration, *problem)
            # Elsewhere, staying in an end component for ever is the best or the worst choice.
            if direction is (Direction.MAX if reward is None else Direction.MIN):
                self._collapse_components()
            self._is_least_reward = reward is not None
            found = self._iterate(reward is not None, rounds)
        self._forget()
        return found

    def _substitute(self, settings: Options) -> tuple[int, float, Bounds | None]:
        """Backward substitution: the number of rounds, the largest width of the bounds that are
        known, and bounds on the initial state if they are among them.
        """
        folder, name = self.parts.folder, self._substitution_name
        last = None if folder is None else folder.last(name)
        outgoing = self.parts.call(Part.begin_substitution, settings, name, last)
        rounds = (last or 0) + 1
        while _any_messages(outgoing):
            self._save(rounds, substitution=True)
            outgoing = self.parts.exchange(Substitution.solve_ready, outgoing)
            rounds += 1
        ends = self.parts.call(Part.end_substitution)
        width, known = max(w for w, _ in ends), [b for _, bounds in ends for b in bounds]
        if not known:
            return rounds, width, None
        method = f"backward substitution, {rounds} rounds"
        return rounds, width, Bounds(*known[0], method)

    def _iterate(self, is_reward: bool, begin: int) -> Bounds:
        """Interval iteration (Haddad & Monmege 2018) for probabilities, and optimistic value
        iteration (Hartmanns & Kaminski 2020) for rewards and where upper bounds do not fall.

        In each phase, smaller changes are passed on than before.
        """
        rounds, threshold = max(begin, self._resume()), tuning.FIRST_TOLERANCE * self.epsilon
        guess = self.epsilon if is_reward else None
        upper = 1.0
        while threshold >= tuning.MIN_CHANGE and rounds < tuning.MAX_ROUNDS:
            rounds = self._raise_lower(threshold, rounds)
            (lower,) = self._initial(upper=False)
            rounds, bounded = self._lower_upper(threshold, rounds, guess)
            if bounded:
                before, (upper,) = upper, self._initial(upper=True)
                if upper - lower <= self.epsilon * upper:
                    name = "interval iteration" if guess is None else "optimistic value iteration"
                    return Bounds(lower, upper, f"{name}, {rounds} rounds")
                if upper == before:
                    guess = self.epsilon
            threshold /= 10
        raise NumericalError(
            f"no bounds are proved in {rounds} rounds: the iteration converges slowly",
            hint="check it on one machine",
        )

    def _raise_lower(self, threshold: float, rounds: int) -> int:
        """A phase of lower bounds; the number of rounds so far."""
        outgoing, busy = self.parts.call(Iteration.begin_phase), True
        components = None
        while busy and rounds < tuning.MAX_ROUNDS:
            answers = self.parts.exchange(Iteration.raise_lower, outgoing, threshold, components)
            outgoing = [messages for _, messages, _ in answers]
            changed, components = self._combined([x for *_, x in answers], components, threshold)
            busy = changed or any(left for left, *_ in answers) or _any_messages(outgoing)
            rounds += 1
            self._save(rounds)
        return rounds

    def _lower_upper(self, threshold: float, rounds: int, guess: float | None) -> tuple[int, bool]:
        """A phase of upper bounds; the number of rounds so far, and whether they are proved."""
        outgoing, busy, violated = self.parts.call(Iteration.begin_bounding, guess), True, 1
        components = None
        while busy and rounds < tuning.MAX_ROUNDS and not (guess and not violated):
            answers = self.parts.exchange(Iteration.lower_upper, outgoing, threshold, components)
            outgoing = [messages for _, messages, *_ in answers]
            changed, components = self._combined([x for *_, x, _ in answers], components, threshold)
            violated = sum(count for *_, count in answers)
            busy = changed or any(left for left, *_ in answers) or _any_messages(outgoing)
            rounds += 1
        return rounds, not violated

    def _combined(
        self, found: Sequence[Floats | None], before: Floats | None, threshold: float
    ) -> tuple[bool, Floats | None]:
        """The best values of components of all parts, and whether they differ from those before."""
        of_parts = [x for x in found if x is not None]
        if not of_parts:
            return False, None
        best = np.minimum if self._is_least_reward else np.maximum
        new: Floats = best.reduce(of_parts)
        if before is None:
            return True, new
        with np.errstate(invalid="ignore"):  # both infinite
            return bool((np.abs(new - before) > threshold * new).any()), new

    def _initial(self, *, upper: bool) -> list[float]:
        """The values of the initial states."""
        found = [x for part in self.parts.call(Iteration.initial, upper) for x in part]
        if len(found) != 1:
            raise UnsupportedError("a distributed model is checked from one initial state")
        return found

    # -------------------------------------------------------------------------- checkpoints

    @property
    def _substitution_name(self) -> str:
        return f"{self.formula} substitution"

    def _save(self, number: int, *, substitution: bool = False) -> None:
        """Write a checkpoint, if that takes little of the time since the last one."""
        folder, now = self.parts.folder, perf_counter()
        if folder is None or now - self._saved < self._saving / tuning.SAVING_SHARE:
            return
        name = self._substitution_name if substitution else self.formula
        save = Part.save_substitution if substitution else Iteration.save_values
        self.parts.call(save, name, number)
        folder.complete(name, number)
        self._saved = perf_counter()
        self._saving = self._saved - now

    def _resume(self) -> int:
        """Load the last checkpoint; its number, 0 if there is none."""
        folder = self.parts.folder
        last = None if folder is None else folder.last(self.formula)
        if last is None:
            return 0
        self.parts.call(Iteration.load_values, self.formula, last)
        return last

    def _forget(self) -> None:
        if self.parts.folder is not None:
            self.parts.folder.forget(self.formula)
            self.parts.folder.forget(self._substitution_name)


def _complement(bound: float, towards: float) -> float:
    """1 minus a bound, rounded towards a value; exact for 0 and 1."""
    return 1.0 - bound if bound in (0.0, 1.0) else nextafter(1.0 - bound, towards)


def _any_messages(outgoing: list[list[Message]]) -> bool:
    return any(places is None or len(places) > 0 for messages in outgoing for places, _ in messages)
