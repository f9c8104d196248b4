"""Properties of timed automata, and how they are read on the model that decides them.

A strategy of a timed automaton has to let time go on for ever. Reaching a state takes a finite
path, after which time can go on; not reaching it is a matter of infinite paths, among which those
count in which time goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import field, replace
from fractions import Fraction
from itertools import chain
from typing import ClassVar, cast

from symcheck.direction import Direction
from symcheck.errors import Diagnostic, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.query import PathProbability, Query, ReachReward, query_of
from symcheck.semantics.reduction.reset_dead_variables import expanded
from symcheck.semantics.rewards import Time
from symcheck.semantics.timed.digital import Asked, DigitalClocks, NotDigital
from symcheck.syntax import ast
from symcheck.syntax.ast import Expression, LabelReference, Literal, Type
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import Tree, children, names, nodes, transform

__all__ = [
    "OnZones",
    "Reach",
    "asked_of",
    "has_states_of",
    "measures",
    "on_digital_clocks",
    "translated",
]

Labels = Mapping[str, Expression]


@dataclass(frozen=True, slots=True)
class Reach:
    """A measure of a timed automaton: `left U right` or a reward until `right`, without labels.

    Attributes:
        measure: as the property writes it.
        query: what it asks for.
        left, right: state formulas; `left` is true for a reward.
    """

    measure: ast.AnyMeasure
    query: Query[Expression]
    left: Expression
    right: Expression

    @property
    def path(self) -> UntilPath[Expression] | None:
        """The path formula; None for a reward."""
        quantity = self.query.quantity
        path = quantity.path if isinstance(quantity, PathProbability) else None
        return path if isinstance(path, UntilPath) else None

    @property
    def avoids(self) -> bool:
        """Whether the strategy wants paths that do not satisfy `left U right`."""
        path = self.path
        if self.query.coalition is not None:  # of a game, in which one side avoids it anyway
            return False
        return path is not None and (self.query.direction is Direction.MIN) != path.negative


def measures(formula: Expression, model: BoundModel, labels: Labels) -> Iterator[Reach]:
    """The measures of a property of a timed automaton.

    Args:
        formula: the bound property.
        model: the automaton.
        labels: those that the property may use.

    Raises:
        UnsupportedError: a measure is within another one, is of a kind that timed automata have
            not, or is asked for in other states than the initial one.
    """
    waiting: list[Tree] = [formula]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.AnyMeasure):
            yield _reach(node, model, labels)
        elif isinstance(node, ast.StateOperator) and not _is_initial(node):
            raise UnsupportedError(
                Diagnostic(
                    "a property of a timed automaton is a value in its initial state",
                    node.span,
                    "timed-property",
                    'use P, R and T directly, or in a filter over the states "init"',
                )
            )
        else:
            waiting += reversed(children(node))


def _is_initial(node: ast.StateOperator) -> bool:
    return isinstance(node, ast.Filter) and node.states == LabelReference("init")


def _reach(measure: ast.AnyMeasure, model: BoundModel, labels: Labels) -> Reach:
    below: list[Tree] = list(children(measure))
    while below:
        node = below.pop()
        if isinstance(node, ast.StateOperator):
            raise UnsupportedError(
                Diagnostic(
                    "nested operators are not supported for timed automata",
                    node.span,
                    "timed-property",
                    "check it as a property of its own: it depends on the values of clocks",
                )
            )
        below += children(node)
    query = query_of(measure, model)
    match query.quantity:
        case PathProbability(UntilPath(left, right)):
            return Reach(measure, query, _whole(left, labels), _whole(right, labels))
        case ReachReward(_, target):
            return Reach(measure, query, Literal(True, Type.BOOL), _whole(target, labels))
        case _:
            raise UnsupportedError(
                Diagnostic(
                    "this property is not supported for timed automata",
                    measure.span,
                    "timed-property",
                    "P [ … ] with one of F, G, U, W and R over state formulas, R [ F … ] and "
                    "T [ F … ] are",
                )
            )


def _whole(condition: Expression, labels: Labels) -> Expression:
    whole = expanded(condition, labels)
    if whole is None or '"deadlock"' in names(whole):
        raise UnsupportedError(
            Diagnostic(
                'the labels "init" and "deadlock" are not available for timed automata',
                condition.span,
                "timed-property",
            )
        )
    return whole


def asked_of(reached: list[Reach], clocks: Set[str]) -> Asked:
    """What measures need of digital clocks.

    Args:
        reached: the measures.
        clocks: the names of the clocks.

    Raises:
        NotDigital: an interval of times needs zones.
        UnsupportedError: a reward, or a game, has a target that reads a clock.
    """
    conditions: list[tuple[Expression, bool]] = []
    horizon: list[Fraction] = []
    for reach in reached:
        path = reach.path
        window = None if path is None else path.window
        if path is None or reach.query.coalition is not None:
            # It depends on when states are entered and left: each constraint would have to be
            # closed, and its negation, too.
            _refuse_clocks(reach, clocks)
            if window is None:
                continue
            if window.upper_strict or window.lower or window.lower_strict:
                message = "timed games have bounds <=k only"
                raise UnsupportedError(Diagnostic(message, window.span, "timed-property"))
            horizon += [] if window.upper is None else [window.upper, Fraction(0)]
            continue
        closed = not reach.avoids
        conditions += [(reach.left, closed), (reach.right, closed)]
        window = path.window
        # Times are rounded down to keep them below a limit, or up to keep them above one.
        down = window.lower > 0 and not window.lower_strict if not closed else window.upper_strict
        up = window.upper is not None and not window.upper_strict
        up = up if not closed else window.lower_strict
        if down and up:
            message = "digital clocks cannot be used: this interval of times is not closed"
            raise NotDigital(Diagnostic(message, window.span, "digital"))
        horizon += [] if window.is_unbounded else [window.upper or Fraction(0), window.lower]
    return Asked(tuple(conditions), tuple(horizon), any(r.avoids for r in reached))


def _refuse_clocks(reach: Reach, clocks: Set[str]) -> None:
    what = "an expected reward or time" if reach.path is None else "a timed game"
    for node in chain(nodes(reach.left), nodes(reach.right)):
        if isinstance(node, ast.Name) and node.name in clocks:
            message = f"the states that {what} is about cannot read the clock {node.name}"
            hint = "let a command whose guard compares the clock set a variable, and read that"
            raise UnsupportedError(Diagnostic(message, node.span, "timed-property", hint))


@dataclass(frozen=True)
class OnZones:
    """How a timed automaton is read on the decision process over zones.

    Attributes:
        automaton: the automaton.
        measure: the measure that the process was made for.
        avoids: its paths are those that reach the states "reached"; else those that do not.
    """

    automaton: BoundModel = field(repr=False)
    measure: ast.AnyMeasure
    avoids: bool
    time: ClassVar[None] = None
    for_property: ClassVar[bool] = True
    lists_states: ClassVar[bool] = False

    def __str__(self) -> str:
        """How time is treated, in words."""
        return "zones, searched backwards"

    def read(self, formula: Expression, labels: Labels) -> Expression:
        """The property as one of the process."""
        reached: Expression = LabelReference("reached")
        not_reached: Expression = ast.Unary(UnaryOperator.NOT, reached)

        def convert(node: Tree) -> Tree:
            if not isinstance(node, ast.ProbabilityOperator):
                return node
            (reach,) = measures(node, self.automaton, labels)
            maximal = reach.query.direction is Direction.MAX
            path = ast.Eventually(reached) if maximal else ast.Globally(not_reached)
            return replace(node, path=path)

        return transform(formula, convert)


def has_states_of(model: BoundModel, shown: BoundModel) -> bool:
    """Whether states of the model that decided a property are those of the model that is shown."""
    ours, theirs = model.clocks, shown.clocks
    if not isinstance(ours, DigitalClocks) or not isinstance(theirs, DigitalClocks):
        return ours is theirs
    same_variables = (model.variables, ours.unit) == (shown.variables, theirs.unit)
    return same_variables and ours.ceilings == theirs.ceilings


def translated(model: BoundModel, formula: Expression, labels: Labels) -> tuple[Expression, Labels]:
    """A property of a timed automaton on the model that decides it, and the labels that it uses.

    Without measures it is a condition on one state, and the model need not be made for it.
    """
    match model.clocks:
        case OnZones() as clocks:
            return clocks.read(formula, labels), {}
        case DigitalClocks(asked=None) as clocks:
            return clocks.condition(formula), {n: clocks.condition(x) for n, x in labels.items()}
        case DigitalClocks():
            return on_digital_clocks(formula, model, labels), {}
        case _:
            return formula, labels


def on_digital_clocks(formula: Expression, model: BoundModel, labels: Labels) -> Expression:
    """The property as one of the model with digital clocks, which is made for it.

    Args:
        formula: the property, bound to the automaton.
        model: the model with digital clocks.
        labels: those that the property may use.
    """
    clocks = model.clocks
    assert isinstance(clocks, DigitalClocks)
    found = {id(r.measure): r for r in measures(formula, clocks.automaton, labels)}

    def convert(node: Tree) -> Tree:
        reach = found.get(id(node))
        return node if reach is None else _converted(reach, clocks, model)

    return clocks.condition(transform(formula, convert))


def _converted(reach: Reach, clocks: DigitalClocks, model: BoundModel) -> Expression:
    measure, path = reach.measure, reach.path
    if path is None:
        if isinstance(reach.query.quantity, ReachReward) and isinstance(
            reach.query.quantity.reward, Time
        ):
            number = Literal(len(model.rewards), Type.INT)
            query = ast.Eventually(reach.right)
            return ast.RewardOperator(
                measure.direction,
                measure.bound,
                number,
                query,
                coalition=measure.coalition,
                span=measure.span,
            )
        assert isinstance(measure, ast.RewardOperator)
        return replace(measure, query=ast.Eventually(reach.right))
    target, window = reach.right, path.window
    if window.lower > 0 or window.lower_strict:
        operator = Operator.GT if window.lower_strict else Operator.GE
        target = ast.Binary(Operator.AND, target, clocks.time_is(operator, window.lower))
    if window.upper is not None:
        operator = Operator.LT if window.upper_strict else Operator.LE
        target = ast.Binary(Operator.AND, target, clocks.time_is(operator, window.upper))
    whole: ast.PathFormula = (
        ast.Eventually(target)
        if reach.left == Literal(True, Type.BOOL)
        else ast.Until(reach.left, target)
    )
    if path.negative:
        whole = ast.Unary(UnaryOperator.NOT, _operand(whole))
    if clocks.tick is not None and reach.avoids:
        tick = ast.Name(clocks.tick)
        stops = ast.Eventually(ast.Globally(ast.Unary(UnaryOperator.NOT, tick)))
        goes_on = ast.Globally(ast.Eventually(tick))
        operator, other = (
            (Operator.OR, stops)
            if reach.query.direction is Direction.MIN
            else (Operator.AND, goes_on)
        )
        whole = ast.Binary(operator, _operand(whole), _operand(other))
    return ast.ProbabilityOperator(
        measure.direction, measure.bound, whole, coalition=measure.coalition, span=measure.span
    )


def _operand(path: ast.PathFormula) -> Expression:
    """A path formula where the syntax tree has an expression: logical operators join both."""
    return cast(Expression, path)
