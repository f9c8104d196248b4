"""Writing certificates: vectors that prove bounds of a value to a checker of its own.

The inequalities are those of `symcheck_verify`, which imports nothing of symcheck.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf, lcm
from typing import Any, assert_never

import numpy as np

from symcheck.check import tuning
from symcheck.check.certificate import Certificate
from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.check.measures.reachability import until
from symcheck.check.measures.reward_bounded_until import check_uniform_rewards
from symcheck.check.omega_regular.ltl import numbered_automaton
from symcheck.check.queries.values import values
from symcheck.check.state_formulas import query_of, satisfying
from symcheck.check.strategies.strategy import strategy_of
from symcheck.check.strategies.to_explicit import rows_engine
from symcheck.direction import Direction
from symcheck.engines.base import Engine, Number, StateSet, System, Values, erased
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.transition_actions import state_order
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.numbers import (
    Numbers,
    Rationals,
    distinct,
    doubles,
    full,
    is_rational,
    rationals,
)
from symcheck.matrices.rows import (
    Bools,
    Int32s,
    Int64s,
    SparseMatrix,
    per_row,
    spans,
    starts_of,
)
from symcheck.numerics import graph, rational_limits
from symcheck.numerics.inductive_bounds import (
    InductiveVector,
    Inequalities,
    RationalRows,
    average_vectors,
    both_inductive,
    contracted,
    exactly_inductive,
    inductive,
)
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics import query as asked
from symcheck.semantics.features import Feature, require
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    UntilPath,
    as_ltl,
)
from symcheck.semantics.path_normal_form import (
    Connected,
    Extent,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    with_leaves,
)
from symcheck.semantics.query import Query
from symcheck.semantics.query import query_of as resolve
from symcheck.semantics.rewards import Reward, Structure, Time
from symcheck.semantics.time_bounds import RewardWindow, StepRange, Window
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    Expression,
    Filter,
    LabelReference,
    Literal,
    Unary,
    letters_of,
)
from symcheck.syntax.operators import Operator, UnaryOperator, connect
from symcheck.syntax.printer import pretty

__all__ = ["certify"]

_STEP_ERROR = Fraction(1, 2**90)
"""More than what a checker's step of bounded measures adds to the width of bounds."""
_STATED = Fraction(1, 10**11)
"""Relative width that is stated of values within steps or a time; the checker computes them."""

_JUMPS = 10**9
"""Jumps within a time up to which the checker takes a step for each of them."""
_PART_OF_EPSILON = 1e-2
"""Accuracy of the values from which vectors are made: slack makes their bounds wider."""

Json = dict[str, Any]


def certify(context: Context, formula: Expression) -> Certificate:
    """A certificate of the value of a measure in the initial states.

    Args:
        context: the model, and the accuracy of the values.
        formula: a P, R, T or S formula, or its least or greatest value in the initial states.

    Raises:
        UnsupportedError: there are no certificates for such a formula, or the model cannot be
            explored in rational arithmetic.
        NumericalError: no vectors were found that satisfy the inequalities, or the bounds do not
            decide the comparison of the formula.
    """
    require(context.engine.model, Feature.CERTIFICATES)
    match formula:
        case Filter("min" | "max", inner, LabelReference("init")):
            formula = inner  # bounds in each initial state say what the least and greatest are
        case _:
            pass
    if not isinstance(formula, AnyMeasure):
        raise UnsupportedError(f"certificates are for {letters_of(AnyMeasure)} formulas")
    if context.options.fairness:
        raise UnsupportedError("certificates are not supported with -fair")
    exact = context if context.engine.is_rational else exact_twin(context)
    options = replace(context.options, strategy=False)
    exact = replace(exact, relevant_states=None, options=options)
    return _Writer(exact, rows_engine(exact), formula).certificate()


@dataclass(frozen=True, eq=False)
class _Proof:
    """What is stated, what proves it, and the bounds in each initial state; None: not yet known."""

    statement: Json
    evidence: Json
    bounds: Sequence[tuple[Number, Number]] | None = None


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of a model or of a product, and the order in which the checker numbers its states.

    order: the state with each number, int64[n].
    """

    rows: RationalRows
    order: Int64s

    @property
    def matrix(self) -> SparseMatrix:
        """The probabilities of all rows."""
        return self.rows.matrix

    def until(
        self, left: Bools, right: Bools, direction: Direction | None, *, upper: bool
    ) -> Inequalities:
        """The inequalities of one side of the probability of `left U right`."""
        free, certain = left & ~right, np.zeros_like(right)
        if not upper:  # a probability of 1 is proved without slack
            certain = graph.prob1(self.matrix, left, right, direction) & free
        return Inequalities(
            self.rows,
            free=free & ~certain,
            fixed=(right | certain).astype(np.float64),
            earned=None,
            upper=upper,
            all_rows=_all_rows(direction, upper=upper),
            ends=None if upper else right,
            certain=certain,
            limit=1.0,
        )

    def both_sides(
        self, left: Bools, right: Bools, direction: Direction | None, guess: Numbers
    ) -> Json:
        """The proof of both bounds of the probability of `left U right`."""
        sides = [self.until(left, right, direction, upper=upper) for _, upper in _SIDES]
        return self.sides(sides, guess)

    def sides(self, problems: Sequence[Inequalities], guess: Numbers) -> Json:
        """The vectors, the choices and the ranks of both sides, from values or exact values."""
        if is_rational(guess):
            sides = [self.side(problem, guess) for problem in problems]
        else:  # what one side needs serves the other one
            lower, upper = problems
            sides = [self.written(found) for found in both_inductive(lower, upper, guess)]
        return {name: side for (name, _), side in zip(_SIDES, sides, strict=True)}

    def side(self, problem: Inequalities, guess: Numbers) -> Json:
        """The vector, the choices and the ranks of one side, from values or exact values."""
        of_values = exactly_inductive if is_rational(guess) else inductive
        return self.written(of_values(problem, guess))

    def written(self, found: InductiveVector) -> Json:
        """The vector, the choices and the ranks of one side."""
        side: Json = {"vector": self.vector(found), **self.choices(found.choices)}
        if found.ranks is not None:
            ranks = found.ranks[self.order].tolist()
            side["ranks"] = [None if rank < 0 else rank for rank in ranks]
        return side

    def vector(self, found: InductiveVector) -> Json:
        """A vector, as the checker reads it."""
        numerators = found.numerators[self.order].tolist()
        return {"denominator": str(found.denominator), "numerators": numerators}

    def choices(self, rows: Int64s | None) -> Json:
        """The choices of a strategy, as the checker reads them."""
        groups = self.matrix.groups
        if rows is None or groups is None:
            return {}
        return {"choices": (rows - groups[:-1])[self.order].tolist()}


@dataclass(frozen=True, eq=False)
class _Writer:
    """A measure of a model, its values, and the parts of its certificate.

    exact, model: the model in rationals, its engine with rows. exactly: whether the values are
    computed as rationals, because bounds do not decide a threshold.
    """

    exact: Context
    model: ExplicitEngine
    formula: AnyMeasure
    exactly: bool = False

    def certificate(self) -> Certificate:
        """The statement and its evidence."""
        proof = self._proof(resolve(self.formula, self.model.model))
        statement, direction = proof.statement, self._query.direction
        if statement.get("negated"):
            direction = direction and direction.dual
        statement["optimum"] = None if direction is None else direction.value
        stated = self._in_steps(statement) if proof.bounds is None else proof.bounds
        bounds = dict(zip(self._initial, stated, strict=True))
        statement["bounds"] = {str(s): list(map(_number, ends)) for s, ends in bounds.items()}
        if (threshold := self._query.threshold) is not None:
            verdicts = [{threshold.admits(e) for e in ends} for ends in bounds.values()]
            if any(len(of_ends) > 1 for of_ends in verdicts):
                if self._may_be_exact and proof.evidence:
                    return replace(self, exactly=True).certificate()
                raise NumericalError(
                    "a value is so near to the threshold that the bounds of a certificate do not "
                    "decide the comparison"
                )
            held = set[bool]().union(*verdicts)
            statement["comparison"] = {
                "operator": threshold.operator.value,
                "threshold": str(threshold.value),
                "holds": held == {True},
            }
        return Certificate(self.exact.engine, pretty(self.formula), statement, proof.evidence)

    @property
    def _may_be_exact(self) -> bool:
        averages = asked.LongRunProbability, asked.LongRunReward, asked.ProbabilityGiven
        return (
            not self.exactly
            and not isinstance(self._query.quantity, averages)
            and self.model.states <= rational_limits.CONDITIONAL_STATES
        )

    @cached_property
    def _query(self) -> Query[StateSet]:
        return query_of(self.exact, self.formula)

    def _proof(self, text: Query[Expression]) -> _Proof:
        """The statement, without bounds, the evidence of both sides, and the bounds."""
        direction = self._query.direction
        match text.quantity, self._query.quantity:
            case asked.PathProbability(path), asked.PathProbability(over):
                return self._path(path, over, direction)
            case asked.ProbabilityGiven() as quantity, asked.ProbabilityGiven() as over:
                return self._given(quantity, over, direction)
            case asked.ReachReward(reward, target), asked.ReachReward(_, over):
                statement = self._of(reward, "reward", target=self._set(target))
                evidence = self._reach_reward(reward, self.model_set(over), direction)
                return _Proof(statement, evidence, self._ends(evidence))
            case asked.CumulativeReward(reward, window), _:
                if self._continuous:
                    self._refuse_negative(reward)
                    assert window.upper is not None
                    time = self._within_budget(window.upper)
                    return _Proof(self._of(reward, "cumulative", time=time), {})
                return _Proof(self._of(reward, "cumulative", steps=_steps(window)), {})
            case asked.InstantaneousReward(reward, time), _:
                if self._continuous:
                    self._refuse_negative(reward)
                    at = self._within_budget(time)
                    return _Proof(self._of(reward, "instantaneous", time=at), {})
                return _Proof(self._of(reward, "instantaneous", steps=int(time)), {})
            case asked.DiscountedReward(reward, discount, steps), _:
                statement = self._of(reward, "cumulative", factor=str(discount))
                if steps is not None:
                    return _Proof({**statement, "steps": steps}, {})
                evidence = self._discounted(reward, discount, direction)
                return _Proof(statement, evidence, self._ends(evidence))
            case asked.LongRunReward(reward), _:
                rewards = self._system.step_rewards(reward)
                evidence = self._average(rewards, direction)
                return _Proof(self._of(reward, "average"), evidence, self._ends(evidence))
            case asked.LongRunProbability(states), asked.LongRunProbability(over):
                inside = per_row(self.model.matrix.groups, rationals(self.model_set(over).tolist()))
                evidence = self._average(inside * self._stay, direction)
                statement = {"measure": "average", "states": self._set(states)}
                return _Proof(statement, evidence, self._ends(evidence))
            case _:
                raise _unsupported()

    @cached_property
    def _order(self) -> Int64s:
        """The state of the model with each number of the exported files."""
        order = state_order(self.exact.engine)
        return np.arange(self.model.states) if order is None else order

    @cached_property
    def _initial(self) -> list[int]:
        """The numbers of the initial states."""
        members = self.model_set(self.exact.engine.initial)[self._order]
        return np.flatnonzero(members).tolist()

    @property
    def _continuous(self) -> bool:
        return self.model.model.type.continuous_time

    @cached_property
    def _system(self) -> System:
        """The transitions among all states, in rationals."""
        return self.exact.engine.system(self.exact.engine.all)

    def model_set(self, states: StateSet) -> Bools:
        """A set of states, bool[n]."""
        return self.exact.engine.to_bools(states)

    @cached_property
    def _matrix(self) -> SparseMatrix:
        """The probabilities of all rows."""
        return self.model.matrix

    @cached_property
    def _rows(self) -> _Rows:
        """The rows, which all inequalities share."""
        return _Rows(RationalRows(self._matrix), self._order)

    @cached_property
    def _stay(self) -> Rationals:
        """The mean time of a step of each row."""
        exit_rates = self._system.exit_rates
        if exit_rates is None:
            return full(self._matrix.rows, 1, rational=True)
        return rationals((1 / exit_rates).tolist())

    def _of(self, reward: Reward, measure: str, **about: object) -> Json:
        """The statement of an expected reward."""
        match reward:
            case Structure(index):
                structures = self.model.model.rewards
                name: str | None = structures[index].name or ""
                if sum((r.name or "") == name for r in structures) > 1:
                    raise UnsupportedError(
                        "a certificate names its reward structure: give each of them a name"
                    )
            case Time():
                name = None
            case _:
                raise _unsupported()
        return {"measure": measure, "reward": name, **about}

    # ------------------------------------------------------------------------------------- values

    @cached_property
    def _context(self) -> Context:
        """The context in which values are computed: in doubles, or in rationals if asked for."""
        if self.exactly:
            return self.exact
        explored: Any = self.model.explored  # one of the data classes of this protocol
        rounded = replace(
            explored,
            matrix=explored.matrix.doubles(),
            state_rewards=[doubles(r) for r in explored.state_rewards],
            choice_rewards=[doubles(r) for r in explored.choice_rewards],
        )
        # Each entry is the double that is closest to a fraction, not what an expression gives.
        error = (rounded.matrix.longest + 3) * UNIT_ROUNDOFF
        engine = erased(
            ExplicitEngine(
                rounded, "explicit", represented=self.model.represented, number_error=error
            )
        )
        inner = replace(self.exact, engine=engine)
        return inner.with_epsilon(inner.options.epsilon * _PART_OF_EPSILON)

    def _values(self) -> Numbers:
        """The values in all states, from the middle of their bounds."""
        return self._middle(values(self._context, self._query))

    def _middle(self, found: Values, context: Context | None = None) -> Numbers:
        low, high = found.at((context or self._context).engine.all)
        if self.exactly:
            return low
        low, high = doubles(low), doubles(high)
        with np.errstate(invalid="ignore"):  # both are infinite
            return np.where(low == high, low, low + (high - low) / 2)

    def _in_steps(self, statement: Json) -> list[tuple[Number, Number]]:
        """The bounds of what the checker computes itself, within steps or a time."""
        context = self._context.relevant_at(self.exact.engine.initial)
        found = values(context, self._query).at(context.engine.all)
        initial = self._order[self._initial]
        low, high = (rationals(side[initial].tolist()) for side in found)
        room = (int(statement.get("steps", 0)) + 1000) * _STEP_ERROR
        stated = []
        for below, above in zip(low, high, strict=True):
            ends = below - abs(below) * _STATED - room, above + abs(above) * _STATED + room
            if statement["measure"] == "until":
                ends = max(ends[0], Fraction(0)), min(ends[1], Fraction(1))
            stated.append(ends)
        return stated

    def _ends(
        self, evidence: Json, entry: Int64s | None = None, *, complement: bool = False
    ) -> list[tuple[Number, Number]]:
        """The bounds of the vectors in the initial states, or in their entries to a product."""
        states = self._initial if entry is None else entry.tolist()
        sides = [_bound_of(evidence[name], states) for name, _ in _SIDES]
        if complement:
            sides = [[1 - v for v in side] for side in reversed(sides)]
        return list(zip(*sides, strict=True))

    # -------------------------------------------------------------------------------------- paths

    def _path(
        self,
        path: PathFormula[Expression],
        over: PathFormula[StateSet],
        direction: Direction | None,
    ) -> _Proof:
        """The proof of the probability of a path formula."""
        match path, over:
            case UntilPath(left, right, window, negative), UntilPath(passing, goal):
                statement = self._until(left, right, negative=negative)
                if window.is_unbounded:
                    guess, towards = self._values(), direction
                    if negative:
                        guess, towards = 1 - guess, direction and direction.dual
                    sets = self.model_set(passing), self.model_set(goal)
                    evidence = self._rows.both_sides(*sets, towards, guess)
                    ends = self._ends(evidence, complement=negative)
                    return _Proof(statement, evidence, ends)
                if window.contains_zero and self._continuous:
                    assert window.upper is not None
                    return _Proof({**statement, "time": self._within_budget(window.upper)}, {})
                if window.contains_zero:
                    return _Proof({**statement, "steps": _steps(window)}, {})
                return self._linear_time(as_ltl(path), as_ltl(over), direction)
            case NextPath(target, window, negative), _ if (
                window.is_unbounded and not self._continuous
            ):
                inside = {"not": self._set(target)} if negative else self._set(target)
                return _Proof({"measure": "instantaneous", "states": inside, "steps": 1}, {})
            case RewardPath(UntilPath(left, right), counts, negative), RewardPath(
                UntilPath(passing, goal)
            ) if len(counts) == 1:
                within, window = counts[0], counts[0].window
                both = window.upper is not None and not window.contains_zero
                strict = window.upper_strict or window.lower_strict
                if both or strict or window.is_unbounded:
                    raise _unsupported()
                statement = self._until(left, right, negative=negative)
                statement = {**self._of(within.reward, "until"), **statement}
                if window.upper is None:
                    statement["least"] = str(window.lower)
                else:
                    statement["most"] = str(window.upper)
                towards = direction and direction.dual if negative else direction
                sets = self.model_set(passing), self.model_set(goal)
                evidence, entry = self._within_reward(within, *sets, towards)
                return _Proof(statement, evidence, self._ends(evidence, entry, complement=negative))
            case LtlPathFormula(), LtlPathFormula():
                return self._linear_time(path, over, direction)
            case _:
                raise _unsupported()

    def _until(self, left: Expression, right: Expression, *, negative: bool) -> Json:
        sets = {"left": self._set(left), "right": self._set(right)}
        return {"measure": "until", **sets, "negated": negative}

    def _linear_time(
        self,
        path: LtlPathFormula[Expression],
        over: LtlPathFormula[StateSet],
        direction: Direction | None,
    ) -> _Proof:
        """The proof of an LTL formula; the least probability is that of the negation."""
        complement = direction is Direction.MIN
        statement = {
            "measure": "ltl",
            "atoms": [self._set(atom) for atom in path.atoms],
            "formula": _json(Negated(path.form) if path.negative is not complement else path.form),
            "negated": complement,
        }
        asked_for = replace(over, negative=over.negative is not complement)
        evidence, entry = self._automaton(asked_for, direction)
        return _Proof(statement, evidence, self._ends(evidence, entry, complement=complement))

    def _automaton(
        self, path: LtlPathFormula[StateSet], direction: Direction | None
    ) -> tuple[Json, Int64s]:
        """The evidence of the greatest probability of an LTL formula, and the entries."""
        letters, coded, automaton = numbered_automaton(self.exact, path)
        sets = [ArraySet(self.model_set(states)) for states in coded]
        given: Json = {
            "letters": list(letters),
            "table": automaton.table[:, : len(letters)].tolist(),
            "pairs": [
                {
                    "avoid": sorted(automaton.edges(pair.avoid)),
                    "visits": [sorted(automaton.edges(visit)) for visit in pair.visits],
                }
                for pair in automaton.pairs
            ],
        }
        base = self._context.engine.capability(ExplicitEngine)
        assert base is not None
        product = base.product(sets, automaton)
        pairs, starts = product.pairs, self._matrix.indptr
        entries = spans(starts[:-1][pairs.rows], starts[1:][pairs.rows])
        matrix = replace(pairs.matrix, data=self._matrix.data[entries])
        rows, entry = self._product(matrix, pairs.state, pairs.automaton, product.entry)
        accepted = graph.accepting_end_components(
            rows.rows.edges,
            [
                (
                    product.edges(automaton.edges(p.avoid)).members,
                    [product.edges(automaton.edges(v)).members for v in p.visits],
                )
                for p in automaton.pairs
            ],
        )
        everywhere, towards = np.ones_like(accepted), direction and Direction.MAX
        guess = self._reached(erased(product.engine), everywhere, accepted, towards)
        return {"automaton": given, **rows.both_sides(everywhere, accepted, towards, guess)}, entry

    def _reached(
        self, engine: Engine, left: Bools, right: Bools, direction: Direction | None
    ) -> Numbers:
        """The probabilities of `left U right` in a product."""
        context = self._context.on(engine)
        sets = context.engine.from_bools(left), context.engine.from_bools(right)
        return self._middle(until(context, *sets, direction), context)

    def _product(
        self, matrix: SparseMatrix, state: Int32s, memory: Int32s, first: Int64s
    ) -> tuple[_Rows, Int64s]:
        """The rows of a product in the order of the checker, and the entry of initial states.

        first: the pair of each state with its first memory.
        """
        number = np.empty(self.model.states, np.int64)
        number[self._order] = np.arange(self.model.states)
        order = np.lexsort((memory, number[state]))
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return _Rows(RationalRows(matrix), order), place[first[self._order[self._initial]]]

    def _given(
        self,
        text: asked.ProbabilityGiven[Expression],
        over: asked.ProbabilityGiven[StateSet],
        direction: Direction | None,
    ) -> _Proof:
        """The proof of a conditional probability of a chain."""
        both = as_ltl(over.both)
        path, condition = as_ltl(text.path), as_ltl(text.condition)
        if direction is not None:
            raise UnsupportedError("certificates of conditional probabilities are for chains")
        atoms = [self._set(atom) for atom in (*path.atoms, *condition.atoms)]
        statement = {
            "measure": "conditional",
            "atoms": atoms,
            "formula": _json(path.form),
            "condition": _json(condition.form, len(path.atoms)),
        }
        one, other = as_ltl(over.path), as_ltl(over.condition)
        shifted = with_leaves(other.form, lambda i: i + len(one.atoms))
        atoms_of_both = (*one.atoms, *other.atoms)
        forms = {"both": Connected(Operator.AND, one.form, shifted), "given": shifted}
        evidence, ends = {}, []
        for name, form in forms.items():
            whole = LtlPathFormula(form, atoms_of_both, span=both.span)
            evidence[name], entry = self._automaton(whole, None)
            ends.append(self._ends(evidence[name], entry))
        bounds: list[tuple[Number, Number]] = []
        for (low, high), (least, most) in zip(*ends, strict=True):
            if least <= 0:
                raise NumericalError("the condition is not proved to be possible")
            bounds.append((Fraction(low) / Fraction(most), min(Fraction(high) / least, 1)))
        return _Proof(statement, evidence, bounds)

    def _within_reward(
        self, within: RewardWindow, left: Bools, right: Bools, direction: Direction | None
    ) -> tuple[Json, Int64s]:
        """The evidence of `left U right` with a bound on a reward, and the entries."""
        earned, window = self._system.step_rewards(within.reward), within.window
        bound = window.lower if window.upper is None else window.upper
        growing = self._continuous and (self._system.state_rewards(within.reward) != 0).any()
        if growing or isinstance(within.reward, Time) or (earned < 0).any():
            raise _unsupported()
        of_rows = self._system.rewards(within.reward)[1]
        check_uniform_rewards(self.exact, within.reward, paying=bool((of_rows != 0).any()))
        unit = lcm(bound.denominator, *{Fraction(r).denominator for r in earned.tolist()})
        limit = int(bound * unit)
        least = limit if window.upper is None else 0
        units = np.array([min(int(r * unit), limit + 1) for r in earned.tolist()], np.int64)
        matrix, width = self._matrix, limit + 2
        if self.model.states * width > tuning.REWARD_PAIRS:
            raise UnsupportedError(
                f"a certificate of a bound on rewards has more than {tuning.REWARD_PAIRS:,} pairs "
                "of a state and a reward"
            )
        groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups

        def steps(keys: Int64s) -> tuple[Int64s, Int64s, Int64s]:
            """The rows and entries of pairs, and the pair that each entry leads to."""
            state, memory = keys // width, keys % width - 1
            rows = spans(groups[:-1][state], groups[1:][state])
            each = np.diff(groups)[state]
            stops = ~left[state] | (right[state] & (memory >= least)) | (memory < 0)
            after = np.repeat(memory, each)
            after = np.where(np.repeat(stops, each), after, after + units[rows])
            after = np.where(after > limit, least or -1, after)
            entries = spans(matrix.indptr[:-1][rows], matrix.indptr[1:][rows])
            target = matrix.indices[entries].astype(np.int64)
            return rows, entries, target * width + np.repeat(after, matrix.lengths[rows]) + 1

        first = np.arange(self.model.states) * width + 1
        seen, new = np.zeros(self.model.states * width, np.bool_), first
        while len(new):
            seen[new] = True
            targets = steps(new)[2]
            new = np.unique(targets[~seen[targets]])
        known = np.flatnonzero(seen)
        rows, entries, targets = steps(known)
        state, memory = known // width, known % width - 1
        of_pairs = SparseMatrix(
            starts_of(matrix.lengths[rows]),
            np.searchsorted(known, targets).astype(np.int32),
            matrix.data[entries],
            len(known),
            None if matrix.groups is None else starts_of(np.diff(groups)[state]),
        )
        space, entry = self._product(
            of_pairs, state.astype(np.int32), memory.astype(np.int32), np.searchsorted(known, first)
        )
        base = self._context.engine.capability(ExplicitEngine)
        assert base is not None
        inner = of_pairs if self.exactly else of_pairs.doubles()
        pairs = ProductModel(base, state.astype(np.int32), memory.astype(np.int32), inner, rows)
        allowed = memory >= 0
        sets = left[state] & allowed, right[state] & (memory >= least)
        guess = self._reached(erased(ExplicitEngine(pairs, "rewards")), *sets, direction)
        return space.both_sides(*sets, direction, guess), entry

    # ------------------------------------------------------------------------------------ rewards

    def _within_budget(self, time: Fraction) -> str:
        """A time as the checker reads it, which takes a step for each jump."""
        exit_rates = self._system.exit_rates
        assert exit_rates is not None
        if exit_rates.max() * time > _JUMPS:
            raise UnsupportedError(
                f"certificates in time are for at most {_JUMPS:.0E} jumps, each of which is a step "
                "of the checker"
            )
        return str(time)

    def _refuse_negative(self, reward: Reward) -> None:
        if any(v < 0 for v in distinct(self._system.step_rewards(reward))):
            raise UnsupportedError(
                "certificates of rewards in time are not supported with negative rewards"
            )

    def _reach_reward(self, reward: Reward, target: Bools, direction: Direction | None) -> Json:
        everywhere = np.ones_like(target)
        dual = direction and direction.dual
        certain = graph.prob1(self._matrix, everywhere, target, dual)
        guess = self._values()
        if not np.isfinite(doubles(guess[certain])).all():  # finite values: iteration gave up
            raise NumericalError("the solver found no upper bound of the values for a certificate")
        earned = self._system.step_rewards(reward)
        counted = earned[per_row(self.model.matrix.groups, certain & ~target)]
        if any(v < 0 for v in distinct(counted)):
            raise UnsupportedError(
                "certificates of rewards until states are reached are not supported with negative "
                "rewards"
            )
        sides = [
            Inequalities(
                self._rows.rows,
                free=certain & ~target,
                fixed=np.where(certain, 0.0, np.inf),
                earned=earned,
                upper=upper,
                all_rows=_all_rows(direction, upper=upper),
                ends=target if upper else None,
            )
            for _, upper in _SIDES
        ]
        evidence = self._rows.sides(sides, guess)
        if not certain.all():
            engine = self._context.engine
            within = until(self._context, engine.all, engine.from_bools(target), dual)
            missed = within.at(engine.all)[1]
            proof = self._rows.until(everywhere, target, dual, upper=True)
            evidence["lower"]["missed"] = self._rows.side(proof, missed)
        return evidence

    def _discounted(self, reward: Reward, discount: Fraction, direction: Direction | None) -> Json:
        guess, evidence = self._values(), {}
        rows = RationalRows(replace(self._matrix, data=self._matrix.data * discount))
        for name, upper in _SIDES:
            problem = Inequalities(
                rows,
                free=np.ones(self._matrix.states, np.bool_),
                fixed=np.zeros(self._matrix.states),
                earned=self._system.step_rewards(reward),
                upper=upper,
                all_rows=_all_rows(direction, upper=upper),
                ends=None,
            )
            of_values = exactly_inductive if self.exactly else contracted
            evidence[name] = self._rows.written(of_values(problem, guess))
        return evidence

    def _average(self, earned: Rationals, direction: Direction | None) -> Json:
        gain, strategy = self._values(), None
        if direction is not None:
            asking = replace(self._context.options, strategy=True)
            strategy = strategy_of(replace(self._context, options=asking), self.formula).rows
        evidence: Json = {}
        for name, upper in _SIDES:
            problem = Inequalities(
                self._rows.rows,
                free=np.ones(self._matrix.states, np.bool_),
                fixed=np.zeros(self._matrix.states),
                earned=earned,
                upper=upper,
                all_rows=_all_rows(direction, upper=upper),
                ends=None,
                strategy=strategy,
            )
            found = average_vectors(problem, self._stay, doubles(gain))
            sides = {"gain": self._rows.vector(found.gain), "bias": self._rows.vector(found.bias)}
            evidence[name] = {**sides, **self._rows.choices(found.gain.choices)}
        return evidence

    def _set(self, formula: Expression) -> object:
        """A set of states by labels of the model, where its formula has no other names."""
        match formula:
            case Literal(value=True):
                return "all"
            case LabelReference(name=name) if name in (
                *self.model.model.labels,
                "init",
                "deadlock",
            ):
                return {"label": name}
            case Unary(UnaryOperator.NOT, operand):
                return {"not": self._set(operand)}
            case Binary(Operator.OR, left, right):
                return {"or": [self._set(left), self._set(right)]}
            case Binary(Operator.AND, left, right):
                parts = [{"not": self._set(left)}, {"not": self._set(right)}]
                return {"not": {"or": parts}}
            case _:
                members = satisfying(self.exact, formula, self.exact.engine.all)
                return {"states": np.flatnonzero(self.model_set(members)[self._order]).tolist()}


_SIDES = (("lower", False), ("upper", True))


def _all_rows(direction: Direction | None, *, upper: bool) -> bool:
    """Whether a bound has to hold for all strategies; for the others, one suffices."""
    return direction is None or (direction is Direction.MAX) is upper


def _bound_of(side: Json, states: Sequence[int]) -> list[Number]:
    vector = side.get("gain") or side["vector"]
    denominator = int(vector["denominator"])
    numerators = [vector["numerators"][state] for state in states]
    return [inf if v is None else Fraction(v, denominator) for v in numerators]


def _number(value: Number) -> str:
    return "Infinity" if isinstance(value, float) else str(value)


def _steps(window: Window) -> int:
    steps = window.steps().upper
    assert steps is not None
    return steps


def _json(form: NormalForm[int], shift: int = 0) -> object:
    """An LTL formula as the checker reads it; `shift` is added to the numbers of its atoms."""

    def negation(inner: object) -> object:
        return ["not", inner]

    match form:
        case StateFormula(number):
            return number + shift
        case Negated(operand):
            return negation(_json(operand, shift))
        case Connected(operator, left, right):
            return connect(
                operator,
                _json(left, shift),
                _json(right, shift),
                conjunction=lambda a, b: ["and", a, b],
                disjunction=lambda a, b: ["or", a, b],
                negation=negation,
            )
        case NextState(operand, extent):
            steps = _step_range(extent)
            possible = steps.lower <= 1 and (steps.upper is None or steps.upper >= 1)
            return ["X", _json(operand, shift)] if possible else False
        case UntilReached(left, right, extent):
            steps, first = _step_range(extent), _json(left, shift)
            bound = [] if steps.upper is None else [steps.upper - steps.lower]
            result = ["U", first, _json(right, shift), *bound]
            for _ in range(steps.lower):
                result = ["and", first, ["X", result]]
            return result
        case _:
            assert_never(form)


def _step_range(extent: Extent) -> StepRange:
    if not isinstance(extent, Window):
        raise _unsupported()
    return extent.steps()


def _unsupported() -> UnsupportedError:
    return UnsupportedError(
        "certificates are for probabilities of path formulas (in continuous time, with at most an "
        "upper bound, and of LTL formulas without bounds), given conditions in chains, with one "
        "bound on a reward, for rewards until states are reached, of the first steps, within "
        "a time, after some or discounted, and for long-run averages"
    )
