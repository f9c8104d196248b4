"""Constraints on clocks: comparisons of a clock, or the difference of two, with a bound."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import suppress
from fractions import Fraction
from itertools import product
from math import prod

from symcheck.errors import Diagnostic, InputError, Span, SymcheckError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.model import BoundModel, Variable
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Name, Node, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import names, nodes

__all__ = [
    "ClockConstraint",
    "check_clocks",
    "clock_constraints",
    "clocks_of",
    "constraint",
    "possible_values",
]

_MOST_VALUATIONS = 1 << 16
_ZERO = Literal(0, Type.INT)


@dataclass(frozen=True, slots=True)
class ClockConstraint(Node):
    """`clock operator bound`, or `clock - other operator bound` (a diagonal constraint).

    The bound reads no clock, but may depend on other variables.
    """

    clock: str
    other: str | None
    operator: Operator
    bound: Expression

    def is_closed(self, holds: bool) -> bool:
        """Whether it (`holds`), or else its negation, admits its limit."""
        limits = (Operator.LE, Operator.GE, Operator.EQ)
        return (self.operator in limits) is holds


def clocks_of(model: BoundModel) -> frozenset[str]:
    """The names of the clocks."""
    return frozenset(v.name for v in model.variables if v.clock)


def constraint(node: Binary, clocks: Set[str]) -> ClockConstraint | None:
    """The constraint that a comparison writes; None if it reads no clock.

    Raises InputError: it is no comparison of a clock, or of the difference of two, with a bound.
    """
    if not names(node) & clocks:
        return None
    signs: dict[str, int] = {}
    rest: list[tuple[int, Expression]] = []

    def add(part: Expression, sign: int) -> None:
        match part:
            case Name(name) if name in clocks:
                signs[name] = signs.get(name, 0) + sign
            case Binary(Operator.PLUS | Operator.MINUS as operator, left, right):
                add(left, sign)
                add(right, sign if operator is Operator.PLUS else -sign)
            case Unary(UnaryOperator.MINUS, operand):
                add(operand, -sign)
            case _ if names(part) & clocks:
                raise _misused(part.span, part, clocks)
            case _:
                rest.append((sign, part))

    add(node.left, 1)
    add(node.right, -1)
    left = [name for name, sign in signs.items() if sign == 1]
    right = [name for name, sign in signs.items() if sign == -1]
    if len(left) > 1 or len(right) > 1 or len(left) + len(right) != sum(map(bool, signs.values())):
        raise _misused(node.span, node, clocks)
    if not left and not right:
        raise _misused(node.span, node, clocks)
    turned = not left  # c <= x is read as x >= c
    bound: Expression = _ZERO
    for sign, part in rest:
        operator = Operator.PLUS if (sign == 1) is turned else Operator.MINUS
        first = bound is _ZERO and operator is Operator.PLUS
        bound = part if first else Binary(operator, bound, part)
    if turned:
        left, right = right, left
    return ClockConstraint(
        left[0],
        right[0] if right else None,
        node.operator.mirrored if turned else node.operator,
        simplify(bound),
        span=node.span,
    )


def clock_constraints(
    expression: Expression, clocks: Set[str], holds: bool = True
) -> Iterator[tuple[ClockConstraint, bool]]:
    """The constraints in a condition, each with whether it, or else its negation, is required.

    Args:
        expression: the condition; labels in it are not read.
        clocks: the names of the clocks.
        holds: whether the condition, or else its negation, is required.

    Raises:
        InputError: a clock is read in another way.
    """
    if not names(expression) & clocks:
        return
    match expression:
        case Unary(UnaryOperator.NOT, operand):
            yield from clock_constraints(operand, clocks, not holds)
        case Binary(operator, left, right) if operator.is_logical:
            f = operator.apply
            rows = (
                (left, [(f(False, q), f(True, q)) for q in (False, True)]),
                (right, [(f(q, False), f(q, True)) for q in (False, True)]),
            )
            for part, pairs in rows:  # the values of the operator without the part, and with it
                if any(without < having for without, having in pairs):
                    yield from clock_constraints(part, clocks, holds)
                if any(without > having for without, having in pairs):
                    yield from clock_constraints(part, clocks, not holds)
        case Binary(operator) if operator.is_comparison:
            found = constraint(expression, clocks)
            if found is not None:
                yield found, holds
        case Conditional(condition, then, otherwise):
            yield from clock_constraints(condition, clocks, True)
            yield from clock_constraints(condition, clocks, False)
            yield from clock_constraints(then, clocks, holds)
            yield from clock_constraints(otherwise, clocks, holds)
        case _:
            raise _misused(expression.span, expression, clocks)


def _misused(span: Span, part: Expression, clocks: Set[str]) -> InputError:
    name = next(iter(sorted(names(part) & clocks)))
    return InputError(
        Diagnostic(
            f"clock {name} is read here, but not compared with a number",
            span,
            "clock",
            f"a clock is compared with an expression without clocks, as in {name}<=5, or with "
            "another clock, as in x-y<=5",
        )
    )


def check_clocks(model: BoundModel) -> None:
    """Check where a timed automaton reads and writes its clocks.

    Raises InputError: a clock is read outside of comparisons, or its first value is not 0.
    """
    clocks = clocks_of(model)

    def refuse_reading(part: Expression, what: str) -> None:
        for node in nodes(part):
            if isinstance(node, Name) and node.name in clocks:
                message = f"{what} cannot read the clock {node.name}"
                hint = "let a command whose guard compares the clock set a variable, and read that"
                raise InputError(Diagnostic(message, node.span, "clock", hint))

    conditions = [c.guard for m in model.modules for c in m.commands]
    conditions += [m.invariant for m in model.modules if m.invariant is not None]
    for condition in conditions:
        for _ in clock_constraints(condition, clocks):
            pass
    for update in (u for m in model.modules for c in m.commands for u in c.updates):
        refuse_reading(update.probability, "a probability")
        for _, value in update.assignments:
            refuse_reading(value, "an update")
    for item in (i for r in model.rewards for i in r.items):
        refuse_reading(item.guard, "the guard of a reward")
        refuse_reading(item.value, "a reward")
    if model.initial is not None:
        message = "a timed automaton has one initial state, in which its clocks are 0"
        hint = "give initial values to its variables, in place of init … endinit"
        raise InputError(Diagnostic(message, model.initial.span, "initial", hint))
    for variable in model.variables:
        if variable.clock and variable.initial != 0:
            message = f"clock {variable.name} begins at 0"
            raise InputError(Diagnostic(message, variable.span, "clock", "omit its initial value"))


def possible_values(
    expression: Expression, variables: Mapping[str, Variable]
) -> Iterable[Fraction]:
    """The values that an expression without clocks has for some values of its variables.

    Raises UnsupportedError: there are too many to list.
    """
    used = sorted(names(expression))
    domains = [variables[name].domain for name in used]
    if None in domains or prod(len(d) for d in domains if d is not None) > _MOST_VALUATIONS:
        raise UnsupportedError(
            f"the bound of a clock depends on too many values of {', '.join(used)}",
            hint="give bounds to these variables",
        )
    found = set[Fraction]()
    for values in product(*(d for d in domains if d is not None)):
        with suppress(SymcheckError):  # told if such a state is reached
            valuation = dict(zip(used, values, strict=True))
            found.add(Fraction(evaluate(expression, valuation, exact=True)))
    return sorted(found)
