"""Checks of the thresholds, bounds and reward structures of a formula once constants are known."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from math import isfinite

from symcheck.errors import Diagnostic, InputError
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.semantics.expressions.evaluate import evaluate, evaluate_constant
from symcheck.semantics.expressions.literals import format_value, to_float
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import (
    Binary,
    BinaryTemporal,
    Call,
    Conditional,
    DiscountedReward,
    Equilibrium,
    Expression,
    InstantaneousReward,
    Literal,
    Measure,
    PathFormula,
    PathMeasure,
    RewardBound,
    RewardOperator,
    RewardQuery,
    TimeBound,
    Unary,
    UnaryTemporal,
)
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = ["check_conditions", "for_one_player"]


def check_conditions(formula: Expression, model: BoundModel) -> None:
    """Check the thresholds, bounds and reward structures of an expanded formula.

    Thresholds and bounds must be constant, and those of P and S must be probabilities. Step bounds
    of a DTMC or MDP must be ints. A query about an MDP must ask for a minimum or maximum.

    Raises:
        InputError: all faults of the formula.
    """
    check = _Conditions(model)
    for node in nodes(formula):
        check.node(node)
    check.report.raise_all()


def _shown(value: Value) -> str:
    """A value as a decimal, as most are written."""
    return format_value(to_float(value) if isinstance(value, Fraction) else value)


def for_one_player(formula: Expression, model: BoundModel) -> Expression:
    """The formula without coalitions, which only games have: others have one player, or chance.

    A bound without a direction must hold under all strategies; under some strategy if the player
    takes part in <<…>>, or does not in [[…]].

    Raises:
        InputError: a player is named.
    """
    if model.type.players > 1 or not any(
        isinstance(n, Measure) and n.coalition is not None for n in nodes(formula)
    ):
        return formula

    def alone(node: Tree) -> Tree:
        if not isinstance(node, Measure) or node.coalition is None:
            return node
        coalition, direction = node.coalition, node.direction
        if coalition.players:
            message = f"named players belong to stochastic games, and these are {model.type.called}"
            hint = "<<*>> is some strategy, <<>> are all strategies"
            raise InputError(Diagnostic(message, coalition.span, "model-type", hint))
        takes_part = coalition.players is None
        if direction is None and node.bound is not None and takes_part != coalition.against:
            direction = "max" if node.bound.operator.is_lower_bound else "min"
        return replace(node, direction=direction, coalition=None)

    return transform(formula, alone)


class _Conditions:
    """Checks the nodes of one formula."""

    def __init__(self, model: BoundModel) -> None:
        self.model = model
        self.report = DiagnosticCollector()

    def node(self, node: Tree) -> None:
        match node:
            case Measure():
                self._direction(node)
                self._coalition(node)
                self._threshold(node)
                if isinstance(node, RewardOperator):
                    self._structure(node.structure, node)
                    self._unbounded(node, node.query)
                elif isinstance(node, PathMeasure) and not node.is_probability:
                    self._unbounded(node, node.path)
            case Equilibrium():
                self._partition(node)
                if node.bound is not None:
                    self._constant(node.bound.threshold, "a threshold")
            case TimeBound():
                self._time(node)
            case DiscountedReward(_, discount):
                self._discount(discount)
            case InstantaneousReward(time):
                self._moment(time, "the time of I=")
            case RewardBound():
                if node.structure is not None:
                    self._structure(node.structure, node)
                for limit in (node.lower, node.upper):
                    if limit is not None:
                        self._constant(limit, "a bound on a reward")
            case _:
                pass

    def _constant(self, expression: Expression, what: str) -> Value | None:
        """The value of an expression that must be constant."""
        if not all(
            isinstance(n, Literal | Unary | Binary | Call | Conditional) for n in nodes(expression)
        ):
            self.report.input("not-constant", f"{what} must be constant", expression.span)
            return None
        try:
            if self.model.is_rational:
                return evaluate(expression, {}, exact=True)
            return evaluate_constant(expression)
        except InputError as fault:
            self.report.absorb(fault)
            return None

    def _direction(self, node: Measure) -> None:
        kind = self.model.type
        if kind.has_choices and node.direction is None and node.bound is None:
            hint = f"write {node.letter}min=? or {node.letter}max=?"
            program = self.model.program
            if program.type is None and program.span.source.text:
                hint += "; the text names no type, so it is an MDP: begin it with dtmc, say"
            self.report.input(
                "direction",
                f"{node.letter}=? has no unique value in {kind.one}: it depends on the strategy",
                node.span,
                hint,
            )

    def _coalition(self, node: Measure) -> None:
        if node.coalition is not None:
            from symcheck.semantics.players import members

            try:
                members(node.coalition, self.model)
            except InputError as fault:
                self.report.absorb(fault)

    def _partition(self, node: Equilibrium) -> None:
        """Each player belongs to one of the coalitions, which are checked as those of measures."""
        from symcheck.semantics.players import members

        with suppress(InputError):
            taken = [i for c in node.coalitions for i in members(c, self.model)]
            for i, player in enumerate(self.model.players):
                if (count := taken.count(i)) != 1:
                    where = "several coalitions" if count else "no coalition"
                    message = f"player {player.name} is in {where} of the equilibrium"
                    hint = "each player belongs to one of them: <<one:two,three>>"
                    self.report.input("coalition", message, node.coalitions[0].span, hint)

    def _unbounded(self, node: Measure, until: PathFormula | RewardQuery) -> None:
        """Refuse an expectation until a bounded formula: runs that miss the bound have none."""
        if isinstance(until, UnaryTemporal | BinaryTemporal) and until.bound is not None:
            letter, symbol = node.letter, until.symbol
            hint = (
                f"{letter} [ {symbol} … ] without the bound is the value until states are reached"
            )
            if letter == "R":
                hint += ", and R [ C<=k ] is the reward of the first k steps or units of time"
            message = f"{letter} takes no bound on {symbol}: a run that misses it has no value"
            self.report.input("bound-reward", message, until.bound.span, hint)

    def _threshold(self, node: Measure) -> None:
        if node.bound is None:
            return
        threshold = node.bound.threshold
        value = self._constant(threshold, "a threshold")
        if node.is_probability and value is not None and not 0 <= value <= 1:
            message = f"{node.letter} is compared with {_shown(value)}, which is not a probability"
            self.report.input("threshold", message, threshold.span)

    def _discount(self, discount: Expression) -> None:
        value = self._constant(discount, "the discount")
        if value is not None and not 0 <= value < 1:
            self.report.input(
                "discount",
                f"the discount must be at least 0 and less than 1, not {_shown(value)}",
                discount.span,
                "R [ C ] without a discount is the total reward",
            )

    def _structure(self, structure: str | Expression | None, node: Tree) -> None:
        rewards = self.model.rewards
        if not rewards:
            self.report.name("no-rewards", "the model has no reward structure", node.span)
        elif isinstance(structure, str):
            named = [r.name for r in rewards if r.name is not None]
            if structure not in named:
                self.report.name(
                    "unknown-rewards",
                    f'there is no reward structure "{structure}"',
                    node.span,
                    suggest(structure, named)
                    or (f"the names are {', '.join(named)}" if named else "the model has none"),
                )
        elif structure is not None:
            number = self._constant(structure, "the number of a reward structure")
            if number is not None and not 1 <= number <= len(rewards):
                message = (
                    f"there is no reward structure {format_value(number)}: they are numbered from "
                    f"1 to {len(rewards)}"
                )
                self.report.name("unknown-rewards", message, structure.span)

    def _time(self, bound: TimeBound) -> None:
        lower = None if bound.lower is None else self._moment(bound.lower, "a lower bound")
        upper = None if bound.upper is None else self._moment(bound.upper, "an upper bound")
        if upper is None or (lower is None and bound.lower is not None):
            return
        least = 0 if lower is None else lower
        if least > upper or (least == upper and (bound.lower_strict or bound.upper_strict)):
            self.report.input("bound-empty", "no time satisfies these bounds", bound.span)

    def _moment(self, expression: Expression, what: str) -> Value | None:
        """The value of a number of steps, or of a time in a CTMC; None if it is faulty."""
        value = self._constant(expression, what)
        if value is None:
            return None
        if not self.model.type.continuous_time and not isinstance(value, int):
            counted = "units of time" if self.model.type.has_clocks else "steps"
            message = (
                f"{what} counts {counted} in a {self.model.type.value.upper()}: it must be an int, "
                "not a double"
            )
            self.report.type(message, expression.span)
            return None
        if value < 0 or (isinstance(value, float) and not isfinite(value)):
            self.report.input(
                "bound-negative",
                f"{what} must be finite and non-negative, not {_shown(value)}",
                expression.span,
            )
            return None
        return value
