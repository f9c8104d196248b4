"""A model whose states are partitioned over workers, and the check of its properties."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

from symcheck.check.result import Certified, Exact, Result
from symcheck.check.tuning import REFINED_ACCURACIES
from symcheck.distributed.checkpoints import Folder
from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.measures import Measures, supported
from symcheck.distributed.part import Counts, Part
from symcheck.distributed.partition import choose_partition
from symcheck.distributed.parts import Cluster, PartLost, Parts
from symcheck.errors import ModelFault, NumericalError, UnsupportedError, UsageError
from symcheck.explicit.states import Rows
from symcheck.options import Options
from symcheck.semantics import state_faults
from symcheck.semantics.binding.bind import bind_properties
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.query import Query, Threshold
from symcheck.syntax.ast import Expression
from symcheck.syntax.parse import parse_properties
from symcheck.syntax.printer import pretty

__all__ = ["DistributedModel", "explore_on_cluster"]


class LoadedModel(Protocol):
    """A model with the constants and options that it is checked with, a `symcheck.Model`."""

    @property
    def bound(self) -> BoundModel:
        """Constants evaluated, names resolved, types checked."""

    @property
    def options(self) -> Options:
        """How the model is built and checked."""


def explore_on_cluster(
    model: LoadedModel | BoundModel,
    cluster: Cluster,
    options: Options | None = None,
    *,
    checkpoints: str | Path | None = None,
) -> DistributedModel:
    """Explore a model on the workers of a Dask cluster, each of which keeps a part of the states.

    The owner of a state is a hash or a block of variables that few transitions change. Workers
    explore in rounds, and exchange the states that they find for each other. The states of a worker
    that is lost are explored again, by another one.

    Args:
        model: a DTMC, CTMC or MDP with commands and one initial state.
        cluster: a `distributed.Client`.
        options: `fix_deadlocks`, `check_sums`, `certify` and the accuracy are read; None for those
            of the model.
        checkpoints: a folder that all workers and this process share. Parts and iterations are
            written there: a worker that is lost is replaced, and a later call with the same folder
            and as many workers goes on where this one ended.

    Raises:
        ModelFault: the model breaks a rule in a state.
        UnsupportedError: the model has no commands.
        UsageError: the cluster has no workers, or the folder belongs to another model.
        ResourceError: workers are lost again and again, or have not enough memory.

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
    require(bound, Feature.PARTS)
    if bound.builder is not None:
        raise UnsupportedError("only models with commands are explored on a cluster")
    bound = replace(bound, observed=None, derivation=None)
    started = perf_counter()
    workers = sorted(cluster.nthreads())
    if not workers:
        raise UsageError("the cluster has no workers", hint="dask worker tcp://HOST:8786")
    partition, folder = choose_partition(bound, len(workers)), None
    if checkpoints is not None:
        # Workers may have another working directory.
        folder, partition = Folder.open(Path(checkpoints).absolute(), _name(bound), partition)
    parts = Parts(bound, cluster, workers, partition, folder, check_sums=chosen.check_sums)
    counts, rounds = _explored(parts)
    total = Counts(*map(sum, zip(*counts, strict=True)))
    explored = DistributedModel(bound, chosen, parts, total, rounds, perf_counter() - started)
    if total.deadlocks and not chosen.fix_deadlocks:
        raise ModelFault(state_faults.deadlocks(explored.deadlock_examples(), total.deadlocks))
    return explored


def _name(model: BoundModel) -> str:
    """What a model depends on, as a text."""
    constants = {name: str(value) for name, value in sorted(model.constants.items())}
    return f"{pretty(model.program)}\n{constants}"


def _explored(parts: Parts) -> tuple[list[Counts], int]:
    """The sizes of the explored parts, and the number of rounds."""
    rounds = 0
    while True:
        try:
            if not all(parts.call(Part.is_explored)):
                rounds += _explore_in_rounds(parts)
            counts = parts.call(Part.finish)
            if parts.folder is not None:
                parts.folder.complete_exploration()
            return counts, rounds
        except PartLost as error:
            parts.recover(error)


def _explore_in_rounds(parts: Parts) -> int:
    """Let the parts explore until no states are left; the number of rounds.

    Two rounds are begun at a time, so that parts expand states while the messages of the round
    before travel. What they find does not depend on how long these take.
    """
    generation, rounds = parts.losses, 0
    parts.call(Part.begin_exchange, generation)
    begun: deque[list[Any]] = deque()
    for number in range(min(2, len(parts))):
        begun.append(parts.begin(Part.explore, [], generation, number))
    answered: list[deque[tuple[bool, list[Rows]]]] = [deque() for _ in range(len(parts))]
    while begun:
        for known, new in zip(answered, parts.results(begun.popleft()), strict=True):
            known.extend(new)
        if lost := [i for i, known in enumerate(answered) if not known]:
            raise PartLost(lost, OSError("they began anew"))
        answers, rounds = [known.popleft() for known in answered], rounds + 1
        if any(left or any(map(len, messages)) for left, messages in answers):
            outgoing = [messages for _, messages in answers]
            begun.append(parts.begin(Part.explore, outgoing, generation, rounds + len(begun)))
    return rounds


@dataclass(frozen=True, eq=False, repr=False)
class DistributedModel:
    """An explored model, whose states and rows stay on the workers of a cluster.

    Attributes:
        counts: the sizes of all parts together.
        rounds: rounds of the exploration.
        seconds: time of the exploration.
    """

    model: BoundModel
    options: Options
    parts: Parts
    counts: Counts
    rounds: int
    seconds: float

    @property
    def states(self) -> int:
        """Number of states."""
        return self.counts.states

    @property
    def transitions(self) -> int:
        """Number of transitions."""
        return self.counts.transitions

    @property
    def choices(self) -> int:
        """Number of choices; of states, if the model has none."""
        return self.counts.choices

    @property
    def initial(self) -> int:
        """Number of initial states."""
        return self.counts.initial

    @property
    def deadlocks(self) -> int:
        """Number of states that had no transition."""
        return self.counts.deadlocks

    @property
    def ghosts(self) -> int:
        """Number of states of other parts that the rows of parts lead to."""
        return self.counts.ghosts

    def deadlock_examples(self) -> list[str]:
        """Some deadlock states, as texts."""
        return [text for part in self.parts.call(ExploredPart.deadlock_examples) for text in part]

    def __repr__(self) -> str:
        return (
            f"<DistributedModel: {self.model.type.value}, {self.states:,} states, "
            f"{self.transitions:,} transitions on {len(self.parts)} workers>"
        )

    def check(self, formula: str) -> Result:
        """The value or verdict of a property in the initial state, with proved bounds.

        Args:
            formula: `P=? [ … ]` with F, G, U, W or R over state formulas, without a bound or with
                an upper bound on steps or time, `R=? [ F … ]`, `T=? [ F … ]`, or one of them with a
                threshold; in an MDP with a direction.

        Raises:
            InputError: the text is faulty.
            UnsupportedError: another property.
            NumericalError: no bounds are proved, or they do not decide a threshold.
            ResourceError: a worker is lost, and there are no checkpoints, or end components are
                too large to be found in this process.
        """
        bound = bind_properties(parse_properties(formula), self.model, {})
        return self.check_formula(bound.properties[0].formula, bound.labels)

    def check_formula(self, formula: Expression, labels: Mapping[str, Expression]) -> Result:
        """As `check`, for a bound formula.

        Args:
            formula: the formula, bound to the model.
            labels: state formulas of the properties file by name.
        """
        if self.initial != 1:
            raise UnsupportedError("a distributed model is checked from one initial state")
        started, query = perf_counter(), supported(formula, self.model)
        finer = [e for e in REFINED_ACCURACIES if query.threshold and e < self.options.epsilon]
        for epsilon in (self.options.epsilon, *finer):
            text = f"{pretty(formula)} {epsilon}"
            lower, upper, method = self._bounds(query, labels, epsilon, text)
            value = _value(lower, upper, query.threshold)
            if value is not None:
                verdict = query.threshold is not None or lower == upper
                return Result(
                    value,
                    Exact() if verdict else Certified(lower, upper),
                    f"on {len(self.parts)} workers; {method}",
                    seconds=perf_counter() - started,
                )
            if lower == upper:
                break
        raise NumericalError(
            f"the value lies between {lower!r} and {upper!r}, which does not decide the threshold"
        )

    def _bounds(
        self, query: Query[Expression], labels: Mapping[str, Expression], epsilon: float, text: str
    ) -> tuple[float, float, str]:
        """Bounds, by another attempt from the checkpoints, named `text`, if workers are lost."""
        while True:
            measures = Measures(self.model, self.options, self.parts, epsilon, text)
            try:
                return measures.bounds(query, labels)
            except PartLost as error:
                if self.parts.folder is None:
                    raise
                self.parts.recover(error)


def _value(lower: float, upper: float, threshold: Threshold | None) -> float | bool | None:
    """The value between two bounds, or the verdict; None if they do not decide the threshold."""
    if threshold is None:
        return (lower + upper) / 2 if lower < upper < float("inf") else lower
    verdict = threshold.admits(lower)
    return verdict if verdict is threshold.admits(upper) else None
