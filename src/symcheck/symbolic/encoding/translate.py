"""Translation of expressions to diagrams over row bits: conditions become BDDs, numbers MTBDDs.

There are three ways, by the number of valuations that an expression reads:

- *tabulated*: it is evaluated with numpy on all valuations of its variables, and the table is
  reduced bottom-up. This is done for every expression that reads at most
  `EncodingLimits.table_bits` bits.
- *composed*: operators are applied to the diagrams of the operands.
- *on the fly*: it is evaluated only on the valuations that are reached (`on_the_fly_relations.py`).

A variable whose range is no power of two has unused codes. In tables these have the value of the
highest valid code, which keeps diagrams small; sets of states never contain them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LARGEST_WHOLE
from symcheck.semantics.expressions.running_errors import is_accurate
from symcheck.semantics.expressions.types import static_type
from symcheck.semantics.expressions.vectorised import Lanes, evaluate_columns
from symcheck.semantics.model import BoundCommand
from symcheck.symbolic.encoding.expressions import contains, leaf_bound, mesh, support
from symcheck.symbolic.encoding.on_the_fly_relations import (
    OnTheFly,
    OnTheFlyAssignment,
    OnTheFlyCondition,
    OnTheFlyNumber,
    code_values,
)
from symcheck.symbolic.encoding.variables import EncodedVariable, Encoding
from symcheck.symbolic.tuning import EncodingLimits
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator, connect
from symcheck.syntax.traversal import operands

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd

__all__ = ["EncodedAssignment", "TooLarge", "Translator"]


class TooLarge(UnsupportedError):
    """An expression reads too many valuations to be encoded in full; it is encoded on the fly
    instead.
    """


@dataclass(frozen=True, slots=True)
class EncodedAssignment:
    """An assignment `x' = expression`.

    Attributes:
        relation: over row bits and the column bits of x.
        in_range: the rows where the value is in the range of x.
    """

    relation: Bdd
    in_range: Bdd


_LEAST_BOUND = 1e-300
_CANCELLATION = 2.0**30
"""Composed numbers up to so many times their error are computed in exact arithmetic."""


class Translator:
    """Translates the expressions of a model into diagrams of one manager, each expression once.

    Args:
        limits: where one way of translating ends and the next begins; None: the default limits.
    """

    def __init__(
        self, manager: DiagramManager, encoding: Encoding, limits: EncodingLimits | None = None
    ) -> None:
        self.manager = manager
        self.encoding = encoding
        self.limits = limits or EncodingLimits()
        self.on_the_fly: dict[tuple[str, Expression], OnTheFly] = {}
        self._parts: dict[
            tuple[int, int], tuple[BoundCommand, tuple[list[OnTheFly], list[OnTheFly]]]
        ] = {}
        self._booleans: dict[Expression, Bdd] = {}
        self._numbers: dict[Expression, Mtbdd] = {}
        self._assignments: dict[tuple[str, Expression], EncodedAssignment] = {}
        self._undefined: dict[Expression, Bdd] = {}
        self._faults: dict[Expression, Bdd] = {}
        self._errors: dict[Expression, float] = {}
        self._settled: dict[Expression, Mtbdd] = {}
        self._natural = {v.name for v in encoding.variables if v.low >= 0}
        self._identities: dict[tuple[int, ...], Bdd] = {}
        self._types = {v.name: v.variable.type for v in encoding.variables}
        self._supports: dict[Expression, frozenset[str]] = {}

    # ---------------------------------------------------------------------------------------- sizes

    def support(self, expression: Expression) -> frozenset[str]:
        """Names of the variables in `expression`."""
        result = self._supports.get(expression)
        if result is None:
            result = self._supports[expression] = support(expression)
        return result

    def width(self, expression: Expression) -> int:
        """Number of row bits that `expression` reads."""
        return sum(self.encoding.by_name[name].width for name in self.support(expression))

    def on_the_fly_parts(self, command: BoundCommand) -> tuple[list[OnTheFly], list[OnTheFly]]:
        """The parts of a command that are encoded on the fly: those needed in every state, and
        those needed where its guard holds.
        """
        if not self.on_the_fly:
            return [], []
        # Cached, as this is called at every step of a search and comparing long expressions takes
        # long.
        key = id(command), len(self.on_the_fly)
        if key not in self._parts:
            self._parts[key] = command, self._on_the_fly_parts(command)
        return self._parts[key][1]

    def _on_the_fly_parts(self, command: BoundCommand) -> tuple[list[OnTheFly], list[OnTheFly]]:
        names = {
            (self.encoding.variables[i].name, e) for u in command.updates for i, e in u.assignments
        }
        behind = {
            e for u in command.updates for e in (u.probability, *(e for _, e in u.assignments))
        }
        always, guarded = [], []
        for (name, part), on_the_fly in self.on_the_fly.items():
            if name or isinstance(on_the_fly, OnTheFlyNumber):
                if (name, part) in names or part in behind:
                    guarded.append(on_the_fly)
            elif any(part == e or contains(e, part) for e in (command.guard, *behind)):
                always.append(on_the_fly)
        return always, guarded

    def reads_on_the_fly(self, expression: Expression) -> bool:
        """Whether the diagram of `expression` contains a part that is encoded on the fly, and so
        may change.
        """
        return any(
            not name and (part == expression or contains(expression, part))
            for name, part in self.on_the_fly
        )

    def define(self, name: Expression, states: Bdd) -> None:
        """Let a name stand for a set of states."""
        self._booleans[name] = states
        self._supports[name] = frozenset()

    # ------------------------------------------------------------------------------------- booleans

    def boolean(self, expression: Expression) -> Bdd:
        """The states that satisfy a boolean expression; a part that is encoded on the fly is right
        on its known valuations only.
        """
        known = self.on_the_fly.get(("", expression))
        if isinstance(known, OnTheFlyCondition):
            return known.holds
        result = self._booleans.get(expression)
        if result is None:
            try:
                result = self._boolean(expression)
            except TooLarge:
                condition = OnTheFlyCondition(*self._parts_of(expression))
                self.on_the_fly["", expression] = condition
                return condition.holds
            if not self.reads_on_the_fly(expression):
                self._booleans[expression] = result
        return result

    def _boolean(self, expression: Expression) -> Bdd:
        if self.width(expression) <= self.limits.table_bits:
            return self._bdd_table(expression)
        match expression:
            case Unary(UnaryOperator.NOT, operand):
                return ~self.boolean(operand)
            case Binary(operator, left, right) if operator.is_logical:
                return connect(operator, self.boolean(left), self.boolean(right))
            case Conditional(condition, then, otherwise):
                return self.boolean(condition).ite(self.boolean(then), self.boolean(otherwise))
            case Binary(operator, left, right) if operator.is_comparison:
                return self._comparison(expression, operator, left, right)
            case _:
                return self._bdd_table(expression)

    def _comparison(
        self, expression: Expression, operator: Operator, left: Expression, right: Expression
    ) -> Bdd:
        if self._type(left) is Type.BOOL:
            same = self.boolean(left).equivalent(self.boolean(right))
            return same if operator is Operator.EQ else ~same
        try:
            x, y = self.number(left), self.number(right)
        except TooLarge:
            return self._bdd_table(expression)
        if not (self._is_exact(left, x) and self._is_exact(right, y)):
            return self._bdd_table(expression)
        holds = x.compare(operator.value, y)
        error = self._error(left) + self._error(right)
        if error > 0:
            try:
                difference = self._arithmetic(Operator.MINUS, x, y, expression)
            except NumericalError:  # infinities
                return self._bdd_table(expression)
            holds = self._decided_nearby(expression, holds, difference, 1.001 * error)
        undefined = self.undefined(left) | self.undefined(right)
        # A comparison with NaN is false, and != is true.
        return holds | undefined if operator is Operator.NE else holds - undefined

    def _decided_nearby(
        self, expression: Expression, holds: Bdd, difference: Mtbdd, error: float
    ) -> Bdd:
        """A comparison of doubles, decided in exact arithmetic where they are as close as their
        errors. Raises TooLarge if this is in too many states.
        """
        near = self._near_zero(expression, difference, error)
        if not near:
            return holds
        condition = OnTheFlyCondition(*self._parts_of(expression))
        self._extend(condition, near)
        self._faults[expression] = self.manager.disjunction(
            [condition.faults, *(self.faults(e) for e in operands(expression))]
        )
        return near.ite(condition.holds, holds)

    def _near_zero(self, expression: Expression, number: Mtbdd, error: float) -> Bdd:
        """The valuations where a number is at most `error`, or not finite. Raises TooLarge."""
        if not math.isfinite(error):
            raise TooLarge(
                f"the rounding errors of an expression have no bound ({expression.span})"
            )
        near = number.compare("<=", error) & number.compare(">=", -error)
        return near & self.manager.conjunction(
            [self.valid(v) for v in self.encoding.sorted(self.support(expression))]
        )

    def _extend(self, part: OnTheFly, states: Bdd) -> None:
        """Evaluate an expression on some states at once. Raises TooLarge if there are too many."""
        try:
            part.extend(states)
        except UnsupportedError as error:
            raise TooLarge(str(error)) from None

    def _error(self, expression: Expression) -> float:
        """A bound on the errors of the diagram of a number that has been translated."""
        return self._errors.get(expression, 0.0)

    def _type(self, expression: Expression) -> Type:
        return static_type(expression, self._types.__getitem__)

    def _bdd_table(self, expression: Expression) -> Bdd:
        variables, lanes = self._tabulate(expression)
        return self.manager.bdd_table(_row_bits(variables), lanes.values)

    # -------------------------------------------------------------------------------------- numbers

    def number(self, expression: Expression) -> Mtbdd:
        """The value of a numeric expression (a boolean one counts as 0 or 1) in each state. Raises
        TooLarge.
        """
        diagram = self._numbers.get(expression)
        if diagram is None:
            diagram = self._number(expression)
            if diagram.node_count > self.limits.max_nodes:
                raise TooLarge(
                    f"the diagram of an expression has {diagram.node_count} nodes "
                    f"({expression.span})"
                )
            if not self.reads_on_the_fly(expression):
                self._numbers[expression] = diagram
        return diagram

    def number_on_the_fly(self, expression: Expression) -> Mtbdd:
        """As `number`; an expression that is too large is encoded on the fly, right on its known
        valuations only.
        """
        known = self.on_the_fly.get(("", expression))
        if isinstance(known, OnTheFlyNumber):
            return known.value
        try:
            return self._without_cancellation(expression, self.number(expression))
        except TooLarge:
            number = OnTheFlyNumber(*self._parts_of(expression))
            self.on_the_fly["", expression] = number
            return number.value

    def _without_cancellation(self, expression: Expression, number: Mtbdd) -> Mtbdd:
        """A number whose leaves of few right digits are computed in exact arithmetic. Raises
        TooLarge.
        """
        error = self._error(expression)
        if self.width(expression) <= self.limits.table_bits or error == 0:
            return number
        if is_accurate(expression, self._type, self._natural.__contains__):
            return number
        if expression not in self._settled:
            near = self._near_zero(expression, number, error * _CANCELLATION)
            settled = OnTheFlyNumber(*self._parts_of(expression))
            if near:
                self._extend(settled, near)
            self._settled[expression] = near.ite(settled.value, number)
        return self._settled[expression]

    def _parts_of(
        self, expression: Expression
    ) -> tuple[DiagramManager, Encoding, frozenset[str], Expression]:
        """The arguments of an expression that is encoded on the fly."""
        return self.manager, self.encoding, self.support(expression), expression

    def boolean_on(self, expression: Expression, states: Bdd) -> Bdd:
        """As `boolean`, but right on all of `states`: parts that are encoded on the fly are
        extended to them.
        """
        result = self.boolean(expression)
        if self.on_the_fly and sum(part.extend(states) for part in self._conditions_in(expression)):
            result = self.boolean(expression)
        return result

    def number_on(self, expression: Expression, states: Bdd) -> Mtbdd:
        """As `number`, but 0 outside of `states`, and right on them also where it is encoded on the
        fly.
        """
        self.number_on_the_fly(expression)
        for part in (self.on_the_fly.get(("", expression)), *self._conditions_in(expression)):
            if part is not None:
                part.extend(states)
        return self.number_on_the_fly(expression).times_bdd(states)

    def _conditions_in(self, expression: Expression) -> list[OnTheFly]:
        return [
            on_the_fly
            for (name, part), on_the_fly in self.on_the_fly.items()
            if isinstance(on_the_fly, OnTheFlyCondition)
            and not name
            and (part == expression or contains(expression, part))
        ]

    def undefined(self, expression: Expression) -> Bdd:
        """The states where a number is NaN, such as 0/0; its diagram has some number there."""
        if self._type(expression) is not Type.DOUBLE:
            return self.manager.false
        self.number_on_the_fly(expression)
        known = self.on_the_fly.get(("", expression))
        if isinstance(known, OnTheFlyNumber):
            return known.undefined
        if expression in self._undefined:
            return self._undefined[expression]
        match expression:
            case Conditional(condition, then, otherwise):
                return self.boolean(condition).ite(self.undefined(then), self.undefined(otherwise))
            case _:  # what is composed is NaN where an operand is
                return self.manager.disjunction([self.undefined(e) for e in operands(expression)])

    def faults(self, expression: Expression) -> Bdd:
        """Where an expression that has been translated has no value, so that the scalar evaluation
        raises an error.
        """
        known = self.on_the_fly.get(("", expression))
        if known is not None:
            return known.faults
        if expression in self._faults:
            return self._faults[expression]
        if not self._faults and not any(part.faults for part in self.on_the_fly.values()):
            return self.manager.false
        match expression:
            case Binary(operator, left, right) if operator.is_logical:
                result = self.faults(right)
                if operator.decided(True) is not None:
                    result = result - self.boolean(left)
                if operator.decided(False) is not None:
                    result = result & self.boolean(left)
                return self.faults(left) | result
            case Conditional(condition, then, otherwise):
                chosen = self.boolean(condition)
                return self.faults(condition) | chosen.ite(
                    self.faults(then), self.faults(otherwise)
                )
            case _:
                return self.manager.disjunction([self.faults(e) for e in operands(expression)])

    def probability(self, expression: Expression) -> float | Mtbdd:
        """A probability or rate: a float where it is constant."""
        if not self.support(expression):
            return float(evaluate_columns(expression, {}).numbers())
        return self.number_on_the_fly(expression)

    def _number(self, expression: Expression) -> Mtbdd:
        if self.width(expression) <= self.limits.table_bits:
            return self._mtbdd_table(expression)
        if self._type(expression) is Type.BOOL:
            return self.boolean(expression).to_mtbdd()
        match expression:
            case Unary(UnaryOperator.MINUS, operand):
                number = -self.number(operand)
                self._errors[expression] = self._error(operand)
                exact = self._is_exact(expression, number)
                return number if exact else self._mtbdd_table(expression)
            case Binary(Operator.PLUS | Operator.MINUS | Operator.TIMES as operator, left, right):
                x, y = self.number(left), self.number(right)
                try:
                    number = self._arithmetic(operator, x, y, expression)
                except NumericalError:  # NaN in some state: tabulate
                    return self._mtbdd_table(expression)
                # A large int may be rounded in an operand, and the result be small again.
                composed = ((left, x), (right, y), (expression, number))
                exact = all(self._is_exact(e, n) for e, n in composed)
                if not exact:
                    return self._mtbdd_table(expression)
                if self._type(expression) is Type.DOUBLE:
                    self._errors[expression] = self._composed_error(expression, x, y, number)
                return number
            case Conditional(condition, then, otherwise):
                chosen = self.boolean(condition).ite(self.number(then), self.number(otherwise))
                self._errors[expression] = max(self._error(then), self._error(otherwise))
                return chosen
            case Call(Function.MIN | Function.MAX as function, arguments):
                values = [self.number(a) for a in arguments]
                self._errors[expression] = max(map(self._error, arguments))
                result = values[0]
                for value in values[1:]:
                    result = (
                        result.minimum(value) if function is Function.MIN else result.maximum(value)
                    )
                return result
            case _:
                return self._mtbdd_table(expression)

    def _arithmetic(self, operator: str, x: Mtbdd, y: Mtbdd, expression: Expression) -> Mtbdd:
        """The diagram of x op y.

        Raises TooLarge if it may have too many leaves, and NumericalError if it may be NaN.
        """
        leaves = leaf_bound(operator, x.leaves, y.leaves)
        if leaves > self.limits.max_leaves:
            raise TooLarge(
                f"the diagram of an expression may have {leaves} different values "
                f"({expression.span})"
            )
        if operator == "*" and any(
            np.any(a.leaves == 0) and np.any(np.isinf(b.leaves)) for a, b in ((x, y), (y, x))
        ):  # CUDD takes it as 0
            raise NumericalError("zero times infinity")
        return x + y if operator == "+" else x - y if operator == "-" else x * y

    def _composed_error(self, expression: Binary, x: Mtbdd, y: Mtbdd, number: Mtbdd) -> float:
        """A bound on the errors of a sum, difference or product."""
        a, b = self._error(expression.left), self._error(expression.right)
        most_x, most_y, most = (float(np.abs(d.leaves).max(initial=0)) for d in (x, y, number))
        inherited = (
            a + b if expression.operator is not Operator.TIMES else most_x * b + most_y * a + a * b
        )
        return 1.001 * (inherited + UNIT_ROUNDOFF * most) + _LEAST_BOUND

    def _is_exact(self, expression: Expression, number: Mtbdd) -> bool:
        """Whether no leaf stands for an int so large that a double may stand for several."""
        leaves = np.abs(number.leaves)
        return (
            not bool(np.any((leaves >= LARGEST_WHOLE) & np.isfinite(leaves)))
            or self._type(expression) is Type.DOUBLE
        )

    def _mtbdd_table(self, expression: Expression) -> Mtbdd:
        variables, lanes = self._tabulate(expression)
        numbers = lanes.numbers()
        if lanes.errors is not None:
            # Infinities have no error, and NaN is kept apart.
            errors = np.where(np.isfinite(numbers), lanes.errors, 0)
            self._errors[expression] = float(errors.max(initial=0))
        if (
            self.width(expression) > self.limits.table_bits
            and len(np.unique(numbers)) > self.limits.max_leaves
        ):
            raise TooLarge(
                f"the diagram of an expression has more than {self.limits.max_leaves} different "
                f"values ({expression.span})"
            )
        nan = np.isnan(numbers)
        self._undefined[expression] = self.manager.bdd_table(_row_bits(variables), nan)
        numbers = np.where(nan, 0.0, numbers)
        return self.manager.table(_row_bits(variables), numbers)

    # --------------------------------------------------------------------------------------- tables

    def _tabulate(self, expression: Expression) -> tuple[tuple[EncodedVariable, ...], Lanes]:
        """Variables in diagram order and the expression's values, one per code combination, first
        variable slowest.
        """
        variables = self.encoding.sorted(self.support(expression))
        width = sum(v.width for v in variables)
        if width > self.limits.wide_table_bits:
            raise TooLarge(
                f"an expression reads {width} bits at once, a table may have "
                f"{self.limits.wide_table_bits} ({expression.span})"
            )
        lanes = evaluate_columns(expression, mesh(variables)).spread(
            tuple(1 << v.width for v in variables)
        )
        if lanes.faults is not None:
            self._faults[expression] = self.manager.bdd_table(_row_bits(variables), lanes.faults)
        return variables, lanes

    # ---------------------------------------------------------------------------------- assignments

    def assignment(self, target: EncodedVariable, expression: Expression) -> EncodedAssignment:
        """The assignment `target' = expression`; where that is too large, on its known valuations
        only.
        """
        key = (target.name, expression)
        known = self.on_the_fly.get(key)
        if isinstance(known, OnTheFlyAssignment):
            return EncodedAssignment(known.relation, known.in_range)
        result = self._assignments.get(key)
        if result is None:
            try:
                result = self._assignment(target, expression)
            except TooLarge:
                assignment = OnTheFlyAssignment(*self._parts_of(expression), target)
                self.on_the_fly[key] = assignment
                return EncodedAssignment(assignment.relation, assignment.in_range)
            if not self.reads_on_the_fly(expression):
                self._assignments[key] = result
        return result

    def _assignment(self, target: EncodedVariable, expression: Expression) -> EncodedAssignment:
        if isinstance(expression, Name) and expression.name == target.name:
            return EncodedAssignment(self.unchanged(target), self.manager.true)
        if self.width(expression) <= self.limits.table_bits:
            return self._assignment_table(target, expression)
        # A counter that reads only itself gives a small relation, whereas copying a wide variable
        # takes a node per value.
        if self.support(expression) <= {target.name}:
            return self._assignment_table(target, expression)
        try:
            return self._assignment_composed(target, expression)
        except TooLarge:
            if self.width(expression) > self.limits.assignment_bits:
                raise
            return self._assignment_table(target, expression)

    def _assignment_table(
        self, target: EncodedVariable, expression: Expression
    ) -> EncodedAssignment:
        variables, lanes = self._tabulate(expression)
        codes, valid = code_values(target, lanes)
        rows = _row_bits(variables)
        exponents = range(target.width - 1, -1, -1)
        bits = [self.manager.bdd_table(rows, (codes >> e) & 1 == 1) for e in exponents]
        relation = self.bits_equal(target, bits)
        if bool(valid.all()):
            return EncodedAssignment(relation, self.manager.true)
        in_range = self.manager.bdd_table(rows, valid)
        return EncodedAssignment(relation & in_range, in_range)

    def _assignment_composed(
        self, target: EncodedVariable, expression: Expression
    ) -> EncodedAssignment:
        if target.is_bool:
            relation = self.manager.variable(target.columns[0]).equivalent(self.boolean(expression))
            in_range = ~self.faults(expression)
            return EncodedAssignment(relation & in_range, in_range)
        number = self.number(expression)
        if max(abs(target.low), abs(target.high)) >= LARGEST_WHOLE:
            raise TooLarge(f"{target.name} holds ints of 2^53 or more ({expression.span})")
        next_value = self.manager.table(target.columns, target.column().astype(np.float64))
        relation = number.equal(next_value) & self.next_valid(target)
        least, most = float(target.low), float(target.high)
        in_range = number.compare(">=", least) & number.compare("<=", most)
        in_range = in_range - self.faults(expression)
        return EncodedAssignment(relation & in_range, in_range)

    def bits_equal(self, target: EncodedVariable, bits: Sequence[Bdd]) -> Bdd:
        """The relation in which the column bits of `target` equal these functions of the row bits,
        highest first.
        """
        result = self.manager.true
        for column, bit in zip(reversed(target.columns), reversed(bits), strict=True):
            result = result & self.manager.variable(column).equivalent(bit)
        return result

    def identity(self, indices: tuple[int, ...]) -> Bdd:
        """The relation that keeps the variables with these indices."""
        result = self._identities.get(indices)
        if result is None:
            result = self.manager.true
            names = (self.encoding.variables[i].name for i in indices)
            for v in reversed(self.encoding.sorted(names)):
                result = result & self.unchanged(v)
            self._identities[indices] = result
        return result

    def unchanged(self, target: EncodedVariable) -> Bdd:
        """The relation `target' = target`."""
        return self.bits_equal(target, [self.manager.variable(row) for row in target.rows])

    def next_valid(self, target: EncodedVariable) -> Bdd:
        """The set where the column bits of `target` are a valid code."""
        return self._valid(target, target.columns)

    def valid(self, target: EncodedVariable) -> Bdd:
        """The set where the row bits of `target` are a valid code."""
        return self._valid(target, target.rows)

    def valuations(self) -> Bdd:
        """The set where the row bits of every variable are a valid code."""
        return self.manager.conjunction([self.valid(v) for v in reversed(self.encoding.ordered)])

    def _valid(self, target: EncodedVariable, bits: Sequence[str]) -> Bdd:
        largest, result = target.high - target.low, self.manager.true
        for bit, name in enumerate(reversed(bits)):  # from the least significant one
            zero = ~self.manager.variable(name)
            result = zero | result if largest >> bit & 1 else zero & result
        return result

    def state(self, values: Mapping[str, int | bool]) -> Bdd:
        """The states with these values of some variables."""
        result = self.manager.true
        for v in reversed(self.encoding.sorted(values)):
            code = v.code(values[v.name])
            for bit, row in enumerate(reversed(v.rows)):
                literal = self.manager.variable(row)
                result = result & (literal if code >> bit & 1 else ~literal)
        return result


def _row_bits(variables: Sequence[EncodedVariable]) -> tuple[str, ...]:
    return tuple(bit for v in variables for bit in v.rows)
