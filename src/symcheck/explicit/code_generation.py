"""Code generation: from expressions to instructions of the register machine.

The semantics is that of `symcheck.semantics.expressions.evaluate`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import assert_never, cast

from symcheck.errors import ModelFault, UnsupportedError
from symcheck.explicit import tuning
from symcheck.explicit.assembler import Assembler, Register, is_constant
from symcheck.explicit.decider import Decider
from symcheck.kernels.explore.register_machine import Op
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, to_signed_float
from symcheck.semantics.expressions.operations import (
    DECISIONS,
    ROUNDINGS,
    Instruction,
    compose,
    is_on_doubles,
)
from symcheck.semantics.expressions.running_errors import (
    Enclosed,
    RunningErrors,
    is_accurate,
)
from symcheck.semantics.expressions.types import static_type
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Name,
    StateOperator,
    Type,
    Unary,
)
from symcheck.syntax.operators import (
    Function,
    Operator,
    Signature,
    UnaryOperator,
    complete,
    connect,
)
from symcheck.syntax.traversal import Tree, names, nodes

__all__ = ["CodeGenerator", "Value"]

Value = tuple[Register, Type]

_COMPARISONS: Mapping[Operator, tuple[Op, Op]] = complete(
    {
        Operator.EQ: (Op.EQI, Op.EQD),
        Operator.NE: (Op.NEI, Op.NED),
        Operator.LT: (Op.LTI, Op.LTD),
        Operator.LE: (Op.LEI, Op.LED),
        # The operands of these are swapped.
        Operator.GT: (Op.LTI, Op.LTD),
        Operator.GE: (Op.LEI, Op.LED),
    },
    [o for o in Operator if o.is_comparison],
)
"""The instructions for ints and for doubles."""

# Per comparison of doubles: the jumps if it holds and if it does not, which differ for NaN.
_JUMP_REAL = {
    Op.EQD: (Op.JEQD, Op.JNED),
    Op.NED: (Op.JNED, Op.JEQD),
    Op.LTD: (Op.JLTD, Op.JNLTD),
    Op.LED: (Op.JLED, Op.JNLED),
}
_EXPENSIVE = frozenset({Operator.POWER, Function.POW, Function.LOG})


class CodeGenerator:
    """Writes code for expressions over the given variables into an assembler.

    Attributes:
        decider: makes the decisions that the code asks for.
    """

    def __init__(self, assembler: Assembler, variables: tuple[Variable, ...]) -> None:
        self.assembler = assembler
        self.decider = Decider(variables)
        self._natural = {v.name for v in variables if v.low is not None and v.low >= 0}
        self._errors: RunningErrors[Register] = RunningErrors(self._emit_double, assembler.constant)
        self._variables: Mapping[str, Value] = {
            v.name: (i, v.type) for i, v in enumerate(variables)
        }
        self._wide = {
            v.name
            for v in variables
            if v.low is None or v.high is None or max(-v.low, v.high) > LARGEST_WHOLE
        }

    # --------------------------------------------------------------------------------------- values

    def value(self, expression: Expression) -> Value:
        """Write code that computes an expression; returns its register and type."""
        asm = self.assembler
        match expression:
            case Literal(value, Type.DOUBLE):
                return asm.constant(to_signed_float(value)), Type.DOUBLE
            case Literal(value, type):
                return asm.constant(int(value)), type
            case Name(name):
                return self._variables[name]
            case Unary(UnaryOperator.NOT, operand):
                return asm.emit(Op.NOT, self.value(operand)[0]), Type.BOOL
            case Unary(_, operand):
                register, kind = self.value(operand)
                return asm.emit(Op.NEGD if kind is Type.DOUBLE else Op.NEGI, register), kind
            case Binary(operator) if operator.is_logical:
                return self._logical(expression), Type.BOOL
            case Binary():
                return self._binary(expression)
            case Conditional():
                return self._conditional(expression)
            case Call(function, (argument,)) if function.signature is Signature.ROUNDING:
                if self.type_of(argument) is not Type.DOUBLE:
                    return self.value(argument)
                value, error = self._enclosed(argument)
                if error is None:
                    return asm.emit(ROUNDINGS[function], value), Type.INT
                return self._ask(DECISIONS[function], value, error, expression), Type.INT
            case Call(function, arguments):
                return self._emit(function, [self.value(a) for a in arguments])
            case LabelReference() | StateOperator():
                raise UnsupportedError(
                    f"{type_name(expression)} has no value at a single state by itself: check it "
                    "on the model"
                )
            case _:
                assert_never(expression)

    def real(self, expression: Expression) -> Register:
        """Write code that computes an expression as a double without cancellation; returns its
        register.
        """
        return self._real(self.number(expression))

    def number(self, expression: Expression) -> Value:
        """As `value`; a double that cancels is computed in exact arithmetic."""
        if self.type_of(expression) is not Type.DOUBLE or is_accurate(
            expression, self.type_of, self._natural.__contains__
        ):
            return self.value(expression)
        if not names(expression):
            try:
                return self.assembler.constant(cast("float", evaluate(expression, {}))), Type.DOUBLE
            except ModelFault:
                pass  # it is found where it is evaluated
        value, error = self._enclosed(expression)
        if error is not None:
            value = self._ask(Op.NUMBER, value, error, expression)
        return value, Type.DOUBLE

    def _ask(self, op: Op, value: Register, error: Register, expression: Expression) -> Register:
        return self.assembler.ask(op, value, error, self.decider.number(expression))

    def _emit_double(self, op: Op, a: Register, b: Register) -> Register:
        return self.assembler.emit(op, a) if op is Op.NEGD else self.assembler.emit(op, a, b)

    def _enclosed(self, expression: Expression) -> Enclosed[Register]:
        """Write code that computes a number as a double, and a bound on its error."""
        if self.type_of(expression) is not Type.DOUBLE:
            value = self.value(expression)
            error = self.assembler.emit(Op.REALE, value[0]) if self._may_round(expression) else None
            return Enclosed(self._real(value), error)
        match expression:
            case Literal():
                return self._errors.literal(Fraction(expression.value))
            case Unary(_, operand):
                return self._errors.negative(self._enclosed(operand))
            case Binary(operator, left, right):
                operands = self._enclosed(left), self._enclosed(right)
                return self._errors.apply(operator, *operands)
            case Call(function, arguments):
                return self._errors.apply(function, *map(self._enclosed, arguments))
            case Conditional():
                return self._enclosed_conditional(expression)
            case _:
                raise TypeError(f"not a double: {type_name(expression)}")

    def _may_round(self, expression: Expression) -> bool:
        """Whether an int may be too large for a double."""
        return not isinstance(expression, Name | Literal) or self._is_wide(expression)

    def _enclosed_conditional(self, expression: Conditional) -> Enclosed[Register]:
        asm = self.assembler
        value, error, no, end = asm.temporary(), asm.temporary(), asm.label(), asm.label()
        with asm.scope():
            self.jump(expression.condition, False, no)
            self._assign_enclosed(value, error, expression.then)
            asm.jump(Op.JUMP, end)
        asm.place(no)
        with asm.scope():
            self._assign_enclosed(value, error, expression.otherwise)
        asm.place(end)
        return Enclosed(value, error)

    def _assign_enclosed(self, value: Register, error: Register, source: Expression) -> None:
        asm = self.assembler
        found = self._enclosed(source)
        asm.move(value, found.value, asm.position)
        asm.move(error, asm.constant(0.0) if found.error is None else found.error, asm.position)

    def _real(self, value: Value) -> Register:
        register, kind = value
        if kind is Type.DOUBLE:
            return register
        if is_constant(register):
            return self.assembler.constant(float(self.assembler.bits(register)))
        return self.assembler.emit(Op.REAL, register)

    def _alike(self, a: Value, b: Value) -> tuple[Register, Register, bool]:
        """Two values, both as doubles if one of them is a double; and whether they are doubles."""
        if Type.DOUBLE in (a[1], b[1]):
            return self._real(a), self._real(b), True
        return a[0], b[0], False

    def _binary(self, expression: Binary) -> Value:
        if expression.operator.is_comparison:
            op, a, b = self._comparison(expression)
            return self.assembler.emit(op, a, b), Type.BOOL
        left, right = self.value(expression.left), self.value(expression.right)
        return self._emit(expression.operator, [left, right])

    def _emit(self, operation: Operator | Function, operands: Sequence[Value]) -> Value:
        """An operation on ints or on doubles."""
        if is_on_doubles(operation, [kind is Type.DOUBLE for _, kind in operands]):
            reals = [self._real(v) for v in operands]
            return compose(operation, self._on_doubles, reals), Type.DOUBLE
        return compose(operation, self._on_ints, [r for r, _ in operands]), Type.INT

    def _on_ints(self, instruction: Instruction, a: Register, b: Register) -> Register:
        asm = self.assembler
        if instruction is Instruction.POWER and is_constant(b) and asm.bits(b) == 2:
            return asm.emit(Op.MULI, a, a)
        assert instruction.ints is not None
        return asm.emit(instruction.ints, a, b)

    def _on_doubles(self, instruction: Instruction, a: Register, b: Register) -> Register:
        assert instruction.doubles is not None
        return self.assembler.emit(instruction.doubles, a, b)

    def _comparison(self, expression: Binary) -> tuple[Op, Register, Register]:
        types = self.type_of(expression.left), self.type_of(expression.right)
        if Type.DOUBLE in types:
            x, y = self._enclosed(expression.left), self._enclosed(expression.right)
            if x.error is not None or y.error is not None:
                return self._decided(expression, self._errors.difference(x, y))
            a, b, real = x.value, y.value, True
        else:
            a, b, real = self._alike(self.value(expression.left), self.value(expression.right))
        integer_op, real_op = _COMPARISONS[expression.operator]
        if expression.operator.is_lower_bound:
            a, b = b, a
        return (real_op if real else integer_op), a, b

    def _decided(
        self, expression: Binary, difference: Enclosed[Register]
    ) -> tuple[Op, Register, Register]:
        """A comparison of numbers whose difference is enclosed."""
        value, error = difference
        assert error is not None
        answer = self._ask(DECISIONS[expression.operator], value, error, expression)
        return Op.EQI, answer, self.assembler.constant(True)

    def _logical(self, expression: Binary) -> Register:
        asm, operator = self.assembler, expression.operator
        both = operator.decided(True) is None and operator.decided(False) is None
        if both or (
            self.cost(expression.right) <= tuning.MAX_EAGER_COST and self.total(expression.right)
        ):
            return connect(
                operator,
                self.value(expression.left)[0],
                self.value(expression.right)[0],
                conjunction=partial(asm.emit, Op.AND),
                disjunction=partial(asm.emit, Op.OR),
                negation=partial(asm.emit, Op.NOT),
            )
        return self._branch(
            expression, (asm.constant(True), Type.BOOL), (asm.constant(False), Type.BOOL)
        )

    def _branch(
        self,
        condition: Expression,
        then: Expression | Value,
        otherwise: Expression | Value,
        real: bool = False,
    ) -> Register:
        """Write code that computes one of two values; returns its register, a double if `real`."""
        asm = self.assembler
        result, no, end = asm.temporary(), asm.label(), asm.label()
        with asm.scope():
            self.jump(condition, False, no)
            self._assign(result, then, real)
            asm.jump(Op.JUMP, end)
        asm.place(no)
        with asm.scope():
            self._assign(result, otherwise, real)
        asm.place(end)
        return result

    def _assign(self, result: Register, source: Expression | Value, real: bool) -> None:
        start = self.assembler.position
        value = source if isinstance(source, tuple) else self.value(source)
        self.assembler.move(result, self._real(value) if real else value[0], start)

    def _conditional(self, expression: Conditional) -> Value:
        then, otherwise = self.type_of(expression.then), self.type_of(expression.otherwise)
        kind = Type.DOUBLE if Type.DOUBLE in (then, otherwise) else then
        if (result := self.assembler.recall(expression)) is None:
            result = self._branch(
                expression.condition, expression.then, expression.otherwise, kind is Type.DOUBLE
            )
            self.assembler.remember(expression, result)
        return result, kind

    # ---------------------------------------------------------------------------------------- jumps

    def jump(self, condition: Expression, sense: bool, label: int) -> None:
        """Write code that jumps to `label` if the condition has the truth value `sense`, and
        continues otherwise.

        The values that it computes are valid where it continues. At the label, the caller must have
        closed a scope around the jump.
        """
        asm = self.assembler
        match condition:
            case Literal(value, _):
                if bool(value) is sense:
                    asm.jump(Op.JUMP, label)
            case Unary(UnaryOperator.NOT, operand):
                self.jump(operand, not sense, label)
            case Binary(operator, left, right) if (row := operator.distinguished) is not None:
                a, b, value = row
                self._jump_both(left, a, right, b, sense is value, label)
            case Binary(operator) if operator.is_comparison:
                self._jump_compare(condition, sense, label)
            case _:
                asm.jump(Op.JTRUE if sense else Op.JFALSE, label, self.value(condition)[0])

    def _jump_both(
        self, left: Expression, a: bool, right: Expression, b: bool, sense: bool, label: int
    ) -> None:
        """Jump if (left is a and right is b) is `sense`."""
        asm = self.assembler
        if not sense:
            self.jump(left, not a, label)
            self.jump(right, not b, label)
            return
        skip = asm.label()
        self.jump(left, not a, skip)
        with asm.scope():
            self.jump(right, b, label)
        asm.place(skip)

    def _jump_compare(self, condition: Binary, sense: bool, label: int) -> None:
        op, a, b = self._comparison(condition)
        if op in _JUMP_REAL:
            self.assembler.jump(_JUMP_REAL[op][0 if sense else 1], label, a, b)
        elif op in (Op.EQI, Op.NEI):
            self.assembler.jump(Op.JEQI if (op == Op.EQI) is sense else Op.JNEI, label, a, b)
        elif op == Op.LTI:
            self.assembler.jump(Op.JLTI if sense else Op.JGEI, label, a, b)
        else:  # a <= b is not b < a
            self.assembler.jump(Op.JGEI if sense else Op.JLTI, label, b, a)

    # ---------------------------------------------------------------------------------------- facts

    def type_of(self, expression: Expression) -> Type:
        """The type of a well-typed expression."""
        return static_type(expression, lambda name: self._variables[name][1])

    def total(self, expression: Expression) -> bool:
        """Whether the expression has a value in every state.

        Sums of few integer variables with bounds do, as they cannot leave 64 bits.
        """
        return all(map(self._is_total, nodes(expression)))

    def _is_total(self, node: Tree) -> bool:
        """Whether a node has a value if those below it have one."""
        match node:
            case Literal() | Name():
                return True
            case Binary(operator, left, right) if operator.is_comparison:
                # Enclosures may not decide, and a jump around the decision costs less.
                return Type.DOUBLE not in (self.type_of(left), self.type_of(right))
            case Binary(Operator.TIMES):
                return self.type_of(node) is Type.DOUBLE
            case Binary(Operator.PLUS | Operator.MINUS) | Unary(UnaryOperator.MINUS):
                is_int = self.type_of(node) is Type.INT
                return not is_int or not any(map(self._is_wide, nodes(node)))
            case Call(function, (argument,)) if function.signature is Signature.ROUNDING:
                return self.type_of(argument) is Type.INT
            case Binary(operation) | Call(operation):
                return operation.is_total
            case Unary() | Conditional():
                return True
            case _:  # nodes that the machine does not evaluate
                return False

    def _is_wide(self, node: Tree) -> bool:
        """Whether a sum of a few such ints may leave 64 bits."""
        match node:
            case Name(name):
                return name in self._wide
            case Literal(int(value), Type.INT):
                return not -LARGEST_WHOLE <= value <= LARGEST_WHOLE
            case _:
                return False

    def cost(self, expression: Expression) -> int:
        """The approximate number of instructions that evaluate an expression."""
        return sum(map(_cost, nodes(expression)))


def _cost(node: Tree) -> int:
    """The approximate number of instructions of a node without those below it."""
    match node:
        case Literal() | Name():
            return 0
        case Binary(operator) | Call(operator) if operator in _EXPENSIVE:
            return 20
        case Call() | Conditional():
            return 2
        case _:
            return 1


def type_name(node: Expression) -> str:
    """The words for a node that is not arithmetic, in messages."""
    return f'"{node.name}"' if isinstance(node, LabelReference) else f"a {type(node).__name__}"
