"""The part of a model that one worker holds, as its owner calls it: exploration and iteration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple, assert_never

import numpy as np

from symcheck.direction import Direction
from symcheck.distributed import tuning
from symcheck.distributed.backward_search import BackwardSearch
from symcheck.distributed.checkpoints import PartFiles
from symcheck.distributed.end_components import CollapsedComponents, StayingRows
from symcheck.distributed.exploration import PartExploration, PartRows
from symcheck.distributed.messages import Boundary, Message
from symcheck.distributed.partition import Partition
from symcheck.distributed.substitution import PartEquations, Substitution
from symcheck.errors import UnsupportedError
from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.tables import total_reward
from symcheck.kernels.arrays import Masks
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.part_sweeps import PartSweeps
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.settings import Settings
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Steps, Structure, Time
from symcheck.semantics.state_faults import describe_state
from symcheck.simulate.state_predicates import compile_predicate
from symcheck.syntax.ast import Expression

__all__ = ["Counts", "Part"]

_UNIT_ROUNDOFF = float(np.finfo(np.float64).eps)


class Counts(NamedTuple):
    """Sizes of a part."""

    states: int
    transitions: int
    choices: int
    ghosts: int
    deadlocks: int
    initial: int


class Part:
    """The part of a model that one worker holds.

    Args:
        model: a DTMC, CTMC or MDP with commands.
        number: of this part, from 0.
        files: of its checkpoints; None: it has none. What they hold is not explored again.
    """

    def __init__(
        self,
        model: BoundModel,
        number: int,
        partition: Partition,
        files: PartFiles | None = None,
        *,
        check_sums: bool = True,
    ) -> None:
        self._model, self._number, self._partition = model, number, partition
        self._files = files
        self._layout = StateLayout.of(model.variables)
        self._exploration: PartExploration | None = None
        self._generation, self._round = -1, 0  # of the exchange; no exchange has begun
        self._early: dict[int, Sequence[Rows]] = {}
        rows = None if files is None else files.load_rows()
        if rows is not None:
            self._start(rows)
        else:
            known = None if files is None else files.load_states(self._layout.words)
            self._exploration = PartExploration(
                model, number, partition, check_sums=check_sums, known=known
            )

    # ------------------------------------------------------------------------- exploration

    def is_explored(self) -> bool:
        """Whether the rows are complete."""
        return self._exploration is None

    def begin_exchange(self, generation: int) -> None:
        """Begin the exchange of the exploration anew: all ghosts are sent again.

        generation: rounds with another number are those of an earlier exchange.
        """
        assert self._exploration is not None
        self._exploration.resend()
        self._generation, self._round = generation, 0
        self._early.clear()

    def explore(
        self, incoming: Sequence[Rows], generation: int, number: int
    ) -> list[tuple[bool, list[Rows]]]:
        """Number ghosts of the other parts, and expand states.

        Args:
            incoming: the ghosts.
            generation: see `begin_exchange`.
            number: of the round. A round that arrives before its turn waits for it: ghosts have
                numbers in the order of the rounds.

        Returns:
            For each round whose turn it is: whether states are left, and the new ghosts of each
            part.
        """
        if generation != self._generation:
            return []
        self._early[number] = incoming
        answers = []
        while self._round in self._early:
            answers.append(self._expand(self._early.pop(self._round)))
            self._round += 1
        return answers

    def _expand(self, incoming: Sequence[Rows]) -> tuple[bool, list[Rows]]:
        assert self._exploration is not None
        busy, outgoing, own = self._exploration.explore(incoming)
        if self._files is not None:
            self._files.append_states(own)
        return busy, outgoing

    def finish(self) -> Counts:
        """End the exploration."""
        if self._exploration is not None:
            rows = self._exploration.finish()
            self._exploration = None
            if self._files is not None:
                self._files.save_rows(rows)
            self._start(rows)
        rows = self._rows
        ghosts = int(rows.starts[-1] - rows.starts[0])
        groups = rows.matrix.groups
        return Counts(
            self._n,
            rows.matrix.entries,
            self._n if groups is None else int(groups[-1]),
            ghosts,
            int(rows.deadlocks.sum()),
            len(rows.initial),
        )

    def _start(self, rows: PartRows) -> None:
        self._rows, self._matrix = rows, rows.matrix
        self._boundary = Boundary(rows)
        self._n, self._total = len(rows.states), int(rows.starts[-1])
        self._sets: dict[str, Bools] = {}
        self._collapsed: CollapsedComponents | None = None

    @cached_property
    def _columns(self) -> tuple[Int64s, Int32s]:
        """The transposed structure, which bounded properties do without."""
        return sparse.transpose(self._matrix.indptr, self._matrix.indices, self._total)

    @cached_property
    def _row_state(self) -> Int32s:
        return self._matrix.state_of_row.astype(np.int32)

    def deadlock_examples(self) -> list[str]:
        """The first deadlock states of this part, as texts."""
        rows = self._rows.states[np.flatnonzero(self._rows.deadlocks)[:3]]
        return [describe_state(self._model.variables, self._layout.unpack(row)) for row in rows]

    # ------------------------------------------------------------------------------- sets

    def evaluate(
        self, left: Expression, right: Expression, labels: Mapping[str, Expression]
    ) -> list[Message]:
        """Find the states that satisfy two state formulas, the sets `left` and `right`."""
        self._sets.clear()
        bits = np.zeros(self._total, np.uint8)
        for bit, formula in enumerate((left, right)):
            holds = compile_predicate(formula, self._model, self._layout, labels)
            members = np.asarray(holds(self._rows.states, self._rows.deadlocks), np.bool_)
            bits[: self._n] |= members.astype(np.uint8) << np.uint8(bit)
        self._bits = bits
        return self._boundary.all(bits)

    def receive_sets(self, incoming: Sequence[Message]) -> None:
        """Complete the sets by the ghosts; `through` are the states of `left` and not `right`."""
        self._boundary.receive(self._bits, incoming)
        left, right = (self._bits & 1).astype(np.bool_), (self._bits & 2).astype(np.bool_)
        self._sets |= {"left": left, "right": right, "through": left & ~right}

    def complement(self, name: str, *excluded: str) -> None:
        """Keep the states that are in none of some sets as a set."""
        self._sets[name] = ~np.logical_or.reduce([self._sets[e] for e in excluded])

    def members(self, name: str) -> tuple[int, int]:
        """How many initial states of this part are in a set, and how many states."""
        members = self._sets[name][: self._n]
        return int(members[self._rows.initial].sum()), int(members.sum())

    def begin_search(
        self, source: str, through: str, every_choice: bool, inside: str | None = None
    ) -> list[Message]:
        """Begin a backward search from a set, over states of another.

        every_choice: a state is reached if all of its choices may lead to reached states.
        inside: only choices count whose successors are all in this set.
        """
        hit = np.zeros(self._matrix.rows, np.uint8)
        if inside is not None:
            hit |= self._matrix.multiply((~self._sets[inside]).astype(np.float64)) > 0
        return self._begin(self._sets[source].copy(), self._sets[through], hit, every_choice)

    def begin_loop_search(self, unknown: str) -> list[Message]:
        """Begin the search for states that must leave the choices of `unknown` without reward.

        Choices that only lead back to their state are left out: sweeps do not take them.
        """
        m = self._matrix
        excluded = m.lengths == 1
        successors = m.indices[m.indptr[:-1][excluded]]
        excluded[excluded] = successors == self._row_state[excluded]
        if self._constant is not None:
            excluded |= self._constant > 0
        free = np.bincount(self._row_state[~excluded], minlength=self._total)
        source = ~self._sets[unknown] | (free == 0)
        source[self._n :] = ~self._sets[unknown][self._n :]
        return self._begin(source, self._sets[unknown], excluded.view(np.uint8), True)

    def _begin(self, source: Bools, through: Bools, hit: Masks, every: bool) -> list[Message]:
        self._search = BackwardSearch(
            self._boundary, self._columns, self._row_state, source, through, hit, every
        )
        return self._search.messages()

    def continue_search(self, incoming: Sequence[Message]) -> list[Message]:
        """Go on from the ghosts that are reached."""
        self._search.go_on(incoming)
        return self._search.messages()

    def end_search(self, name: str) -> None:
        """Keep the reached states as a set."""
        self._sets[name] = self._search.reached

    # ----------------------------------------------------------------------- end components

    def number_staying(self, firsts: Sequence[int]) -> list[Message]:
        """Number the own states of `staying`, from the first number of this part."""
        own = self._sets["staying"][: self._n]
        self._numbers = np.full(self._total, -1, np.int32)
        self._numbers[: self._n][own] = firsts[self._number] + np.arange(np.count_nonzero(own))
        return self._boundary.all(self._numbers)

    def staying_rows(self, incoming: Sequence[Message]) -> StayingRows:
        """The choices without a reward that lead to states of `staying` only, after its search."""
        self._boundary.receive(self._numbers, incoming)
        own = np.flatnonzero(self._sets["staying"][: self._n])
        rows = np.flatnonzero((self._search.hit == 0) & self._sets["staying"][self._row_state])
        matrix = self._matrix.choose(rows)
        choices = np.bincount(self._row_state[rows], minlength=self._n)[own]
        return StayingRows(choices, matrix.lengths, self._numbers[matrix.indices])

    def number_components(self, given: Sequence[Int32s]) -> list[Message]:
        """Take the components of the own states of `staying` (-1 for none)."""
        (components,) = given
        self._components = np.full(self._total, -1, np.int32)
        self._components[: self._n][self._sets["staying"][: self._n]] = components
        return self._boundary.all(self._components)

    def collapse(self, incoming: Sequence[Message], count: int) -> None:
        """Let the values of components come from all parts, instead of sweeps."""
        self._boundary.receive(self._components, incoming)
        self._collapsed = CollapsedComponents(
            self._matrix, self._row_state, self._components, count, self._constant
        )
        self._unknown_own &= self._components < 0

    # ---------------------------------------------------------------------------- iteration

    def begin_iteration(
        self, known: str, zero: str, direction: Direction | None, reward: Reward | None
    ) -> None:
        """Begin with the least values: 1 on `known` and 0 elsewhere; for a reward, infinite on
        `zero` and 0 elsewhere.

        The unknowns are the states outside of `known` and `zero`.
        """
        self._unknown = ~(self._sets[known] | self._sets[zero])
        self._known = self._sets[known]
        self._unknown_own = self._unknown.copy()
        self._unknown_own[self._n :] = False
        self._sets["unknown"] = self._unknown
        self._substitution: Substitution | None = None
        self._collapsed = None
        self._direction = direction
        self._constant = None if reward is None else self._rewards(reward)
        if reward is None:
            self._lower = self._known.astype(np.float64)
        else:
            self._lower = np.where(self._sets[zero], np.inf, 0.0)
        self._total_sum = np.zeros(len(self._rows.initial))
        self._upper: Floats | None = None
        self._upper_of_known = self._lower
        self._sent_lower = [self._lower[s] for s in self._boundary.sent]

    @property
    def _mode(self) -> int:
        if self._matrix.groups is None:
            return 0
        return 2 if self._direction is Direction.MAX else 1

    @property
    def _continuous_time(self) -> bool:
        return self._model.type.continuous_time

    def _sweeps(self) -> PartSweeps:
        return PartSweeps(
            *self._matrix.arrays,
            self._matrix.groups,
            *self._columns,
            self._row_state,
            self._constant,
            self._unknown_own.view(np.uint8),
            self._mode,
            self._continuous_time,
        )

    def _rewards(self, reward: Reward) -> Floats:
        """The expected reward of each row; in a CTMC, times the exit rate."""
        groups, rows = self._matrix.groups, self._matrix.rows
        states, transitions = np.zeros(self._total), np.zeros(rows)
        match reward:
            case Structure(index):
                items = [i for i in self._model.rewards[index].items if i.on_states]
                if items:
                    code = compile_expression(total_reward(items), self._model)
                    states[: self._n] = code.run_packed(self._layout, self._rows.states)
                transitions = self._rows.rewards[index]
            case Time() if self._continuous_time:
                states[: self._n] = 1.0
            case Steps() | Time():
                transitions = self._matrix.row_sums()
            case _:
                assert_never(reward)
        found = transitions + (states if groups is None else np.repeat(states, np.diff(groups)))
        if not bool(((found >= 0) & np.isfinite(found)).all()):
            raise UnsupportedError(
                "rewards that are negative or infinite are not computed on distributed models",
                hint="check it on one machine",
            )
        return found

    def _equations(self) -> tuple[SparseMatrix, Floats | None]:
        """The rows and their rewards, without choices that may lead to an infinite least reward."""
        matrix, constant = self._matrix, self._constant
        if constant is None or self._mode != 1:
            return matrix, constant
        kept = ~(matrix.multiply(np.isinf(self._lower).astype(np.float64)) > 0)
        kept |= ~matrix.rows_of(self._unknown)
        sizes = np.bincount(self._row_state[kept], minlength=self._total)
        return matrix.choose(np.flatnonzero(kept), starts_of(sizes)), constant[kept]

    def solve_alone(self, settings: Settings) -> tuple[float, float, str]:
        """Bounds on the value of the initial state, where there is no other part."""
        from symcheck.numerics.linear.methods import solve_linear

        matrix, constant = self._equations()
        problem = MaskedProblem(
            matrix,
            self._unknown,
            [(self._known, 1.0)] if constant is None else [],
            constant,
            self._direction,
            constant is None,
            self._continuous_time,
        )
        solution = solve_linear(problem, settings)
        place = int(np.count_nonzero(self._unknown[: self._rows.initial[0]]))
        lower, upper = float(solution.lower[place]), float(solution.upper[place])
        if constant is None:
            upper = min(upper, 1.0)
        return lower, upper, solution.explanation

    # ------------------------------------------------------------------ backward substitution

    def begin_substitution(
        self, settings: Settings, formula: str, number: int | None
    ) -> list[Message]:
        """Solve the components of unknown states that lead to known ones, before an iteration.

        number: of a checkpoint of the substitution to go on from; None: there is none.
        """
        values = np.stack([self._lower, self._lower], axis=1)
        self._told = [~self._unknown[s] for s in self._boundary.sent]
        unknown = self._unknown.copy()
        if number is not None:
            assert self._files is not None
            saved = self._files.load_values(formula, number)["values"]
            found = np.flatnonzero(unknown[: self._n] & ~np.isnan(saved[:, 0]))
            values[found], unknown[found] = saved[found], False
        matrix, constant = self._equations()
        self._lower = self._upper_of_known = np.empty(0)  # until its end
        self._substitution = Substitution(
            PartEquations(
                matrix,
                constant,
                self._mode,
                self._continuous_time,
                *self._columns,
                self._row_state,
            ),
            unknown,
            self._n,
            values,
            settings,
        )
        return self.solve_ready([])

    def solve_ready(self, incoming: Sequence[Message]) -> list[Message]:
        """Solve the components whose last successors have become known, and tell the others."""
        substitution = self._substitution
        assert substitution is not None
        self._boundary.receive(substitution.values, incoming)
        substitution.decide(self._boundary.ghosts(incoming))
        return self._boundary.of_new(~substitution.unknown, self._told, substitution.values)

    def end_substitution(self) -> tuple[float, list[tuple[float, float]]]:
        """Continue with the states that are still unknown: the largest relative width of the bounds
        of the others, and the bounds of initial states that are known.
        """
        assert self._substitution is not None
        values, width = self._substitution.values, self._substitution.width
        self._sets["unknown"] = self._unknown = self._substitution.unknown
        self._substitution = None
        self._unknown_own &= self._unknown
        self._lower, self._upper_of_known = values[:, 0].copy(), values[:, 1].copy()
        self._sent_lower = [self._lower[s] for s in self._boundary.sent]
        known = self._rows.initial[~self._unknown[self._rows.initial]]
        return width, [(float(low), float(high)) for low, high in values[known]]

    # -------------------------------------------------------------------- interval iteration

    def begin_phase(self) -> list[Message]:
        """Begin a phase of `improve`, in which all lower bounds may rise."""
        self._system = self._sweeps()
        self._active = self._unknown_own.astype(np.uint8)
        return self._boundary.of_changes(self._lower, self._sent_lower, 0.0)

    def improve(
        self, incoming: Sequence[Message], threshold: float, components: Floats | None
    ) -> tuple[bool, list[Message], Floats | None]:
        """Raise lower bounds; whether states are left whose bounds may rise, messages, and the
        values of components as far as this part knows.

        threshold: relative changes up to this one are not passed on.
        components: the values of components by all parts; None: not yet, or there are none.
        """
        self._boundary.receive(self._lower, incoming)
        self._activate_before(self._boundary.ghosts(incoming))
        if self._collapsed is not None and components is not None:
            self._activate_before(self._collapsed.raise_lower(self._lower, components))
        left = self._system.raise_lower(
            self._lower, self._active, threshold, tuning.SWEEPS_PER_ROUND
        )
        return (
            left,
            self._boundary.of_changes(self._lower, self._sent_lower, threshold),
            self._leave(self._lower, upwards=False),
        )

    def _leave(self, values: Floats, *, upwards: bool) -> Floats | None:
        if self._collapsed is None:
            return None
        return self._collapsed.best_values(values, upwards=upwards)

    def _activate_before(self, changed: Int32s) -> None:
        column_ptr, column_rows = self._columns
        entries = spans(column_ptr[changed], column_ptr[changed + 1])
        self._active[self._row_state[column_rows[entries]]] = 1

    def begin_bounding(self, width: float | None) -> list[Message]:
        """Begin a phase of `lower`, in which all candidates for upper bounds may fall.

        width: guess them anew, greater than the lower bounds by this relative width; None: go on
            from the bounds that there are, at first the greatest probability.
        """
        if self._upper is None or width is not None:
            guess = np.full(self._total, 1.0) if width is None else self._lower * (1 + width)
            self._upper = np.where(
                self._unknown, np.minimum(guess, self._cap), self._upper_of_known
            )
            self._violated = self._unknown.astype(np.uint8)
            self._violated[self._n :] = 0
            self._sent_upper = [np.full(len(s), np.nan) for s in self._boundary.sent]
        self._active = self._unknown_own.astype(np.uint8)
        return self._boundary.of_changes(self._upper, self._sent_upper, 0.0)

    def lower(
        self, incoming: Sequence[Message], threshold: float, components: Floats | None
    ) -> tuple[bool, list[Message], Floats | None, int]:
        """Lower candidates for upper bounds, as `improve` raises lower bounds; also how many
        candidates are not yet bounds.
        """
        assert self._upper is not None
        self._boundary.receive(self._upper, incoming)
        self._activate_before(self._boundary.ghosts(incoming))
        if self._collapsed is not None and components is not None:
            values = np.minimum(components, self._cap)
            self._activate_before(self._collapsed.lower_upper(self._upper, self._violated, values))
        left, violated = self._system.lower_upper(
            self._upper,
            self._active,
            self._violated,
            self._cap,
            threshold,
            tuning.SWEEPS_PER_ROUND,
        )
        messages = self._boundary.of_changes(self._upper, self._sent_upper, threshold)
        return left, messages, self._leave(self._upper, upwards=True), violated

    @property
    def _cap(self) -> float:
        return 1.0 if self._constant is None else np.inf

    def initial(self, upper: bool) -> list[float]:
        """The lower or upper values of the initial states of this part."""
        values = self._upper if upper and self._upper is not None else self._lower
        return [float(x) for x in values[self._rows.initial]]

    # ------------------------------------------------------------------------------- steps

    def begin_steps(self, rate: float | None) -> list[Message]:
        """Begin steps with given values on all states outside of the unknowns.

        rate: of uniformisation; None: the steps of the chain.
        """
        self._rate = rate
        self._step_states = np.flatnonzero(self._unknown_own).astype(np.int32)
        self._step_values = np.empty(len(self._step_states))
        if rate is not None:
            self._stay = 1 - self._matrix.row_sums()[self._step_states] / rate
        return self._boundary.of_changes(self._lower, self._sent_lower, 0.0)

    def greatest_rate(self) -> float:
        """The greatest exit rate of the unknowns."""
        return float(self._matrix.row_sums()[self._unknown_own].max(initial=0.0))

    def slack(self) -> float:
        """The relative error of a step by rounding."""
        return (self._matrix.longest + 8) * _UNIT_ROUNDOFF

    def step(self, incoming: Sequence[Message], weight: float) -> tuple[list[float], list[Message]]:
        """Add the weighted values of the initial states, and go a step; the sums, and messages."""
        self._boundary.receive(self._lower, incoming)
        x, states, new = self._lower, self._step_states, self._step_values
        self._total_sum += weight * x[self._rows.initial]
        sparse.best_products(
            *self._matrix.arrays, self._matrix.groups, states, x, self._mode == 2, new
        )
        if self._rate is not None:
            new = new / self._rate + self._stay * x[states]
        x[states] = new
        return [float(s) for s in self._total_sum], self._boundary.of_changes(
            x, self._sent_lower, 0.0
        )

    # ------------------------------------------------------------------------- checkpoints

    def save_values(self, formula: str, number: int) -> None:
        """Write the values of an iteration, as a checkpoint with a number."""
        assert self._files is not None
        values = {"values": self._lower[: self._n], "sums": self._total_sum}
        self._files.save_values(formula, number, values)

    def load_values(self, formula: str, number: int) -> None:
        """Go on from a checkpoint: the values of this part, which are sent to the others."""
        assert self._files is not None
        saved = self._files.load_values(formula, number)
        self._lower[: self._n], self._total_sum = saved["values"], saved["sums"]

    def save_substitution(self, formula: str, number: int) -> None:
        """Write the bounds of the states whose values are known, as a checkpoint with a number."""
        assert self._files is not None
        assert self._substitution is not None
        values = self._substitution.values[: self._n].copy()
        values[self._substitution.unknown[: self._n]] = np.nan
        self._files.save_values(formula, number, {"values": values})
