"""Type checking: the types bool, int and double, and the distinction of state and path formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import assert_never

from symcheck.errors import Span
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    BinaryTemporal,
    Bound,
    Call,
    Conditional,
    ConditionalProbability,
    CostBoundedReward,
    CumulativeReward,
    DiscountedReward,
    EndedReward,
    Equilibrium,
    Expression,
    ExpressionNode,
    Filter,
    InstantaneousReward,
    LabelReference,
    Literal,
    MultiObjective,
    Name,
    PathBound,
    PathFormula,
    PathMeasure,
    PathQuantifier,
    Quantile,
    RewardBound,
    RewardBounds,
    RewardOperator,
    RewardQuery,
    StateFilter,
    StateOperator,
    SteadyState,
    SteadyStateReward,
    TimeBound,
    TotalReward,
    Type,
    Unary,
    UnaryTemporal,
)
from symcheck.syntax.operators import Function, Operator, Signature, UnaryOperator

__all__ = ["NUMERIC_FILTERS", "Typer", "article", "rounding_hint", "static_type", "type_of"]

NUMERIC_FILTERS = frozenset({"min", "max", "sum", "avg", "range", "argmin", "argmax"})
_FILTER_TYPES = {
    "avg": Type.DOUBLE,
    "count": Type.INT,
    "forall": Type.BOOL,
    "exists": Type.BOOL,
    "argmin": Type.BOOL,
    "argmax": Type.BOOL,
}
_BOOLEAN_FILTERS = frozenset({"count", "forall", "exists"})


@with_deep_recursion
def type_of(
    expression: Expression,
    lookup: Mapping[str, Type],
    label: Callable[[LabelReference], Type | None] | None = None,
) -> Type:
    """The type of a state expression.

    Args:
        expression: the expression.
        lookup: types of names.
        label: the type of a label or property; None: no references and no operators such as P are
            allowed.

    Raises:
        TypeFault, NameFault: all faults of the expression.
    """
    report = DiagnosticCollector()

    def name(node: Name) -> Type | None:
        if node.name not in lookup:
            report.name("unknown-name", f"unknown name {node.name}", node.span)
        return lookup.get(node.name)

    actual = Typer(report, name, label).state(expression)
    report.raise_all()
    assert actual is not None
    return actual


def static_type(expression: Expression, name: Callable[[str], Type]) -> Type:
    """The type of a well-typed expression without labels, with the types of names."""

    def common(*parts: Expression) -> Type:
        types = [static_type(p, name) for p in parts]
        return Type.DOUBLE if Type.DOUBLE in types else types[0]

    match expression:
        case Literal(_, kind):
            return kind
        case Name(variable):
            return name(variable)
        case Unary(UnaryOperator.NOT, _):
            return Type.BOOL
        case Unary(_, operand):
            return common(operand)
        case Binary(operator, left, right):
            return _result(operator.signature, lambda: common(left, right))
        case Call(function, arguments):
            return _result(function.signature, lambda: common(*arguments))
        case Conditional(_, left, right):
            return common(left, right)
        case LabelReference() | StateOperator():
            raise TypeError(f"not an arithmetic expression: {type(expression).__name__}")
        case _:
            assert_never(expression)


def _result(signature: Signature, common: Callable[[], Type]) -> Type:
    """The type of the result of a signature, given the common type of the operands."""
    match signature:
        case Signature.LOGICAL | Signature.EQUALITY | Signature.ORDER:
            return Type.BOOL
        case Signature.ARITHMETIC:
            return common()
        case Signature.DIVISION:
            return Type.DOUBLE
        case Signature.INTEGER | Signature.ROUNDING:
            return Type.INT
        case _:
            assert_never(signature)


class Typer:
    """Computes types and reports type faults. The type None means that a fault was reported.

    Args:
        report: collects the faults.
        name: the type of a name; reports an unknown name itself.
        label: the type of a label reference; reports an unknown label itself. None: neither labels
            nor operators such as P are allowed.
    """

    def __init__(
        self,
        report: DiagnosticCollector,
        name: Callable[[Name], Type | None],
        label: Callable[[LabelReference], Type | None] | None,
    ) -> None:
        self._report = report
        self._name = name
        self._label = label

    # --------------------------------------------------------------------------------- expectations

    def boolean(self, expression: Expression, what: str) -> bool:
        """Check that a state expression is a bool; messages call it `what`, such as 'the guard'."""
        return self._boolean(expression, what, None)

    def _boolean(self, expression: Expression, what: str, hint: str | None) -> bool:
        if hint is None and isinstance(expression, Name):
            hint = f"compare it, as in {expression.name}=1"
        message = f"{what} must be a bool"
        return self._expect(self.state(expression), (Type.BOOL,), expression.span, message, hint)

    def numeric(self, expression: Expression, what: str) -> bool:
        """Check that a state expression is an int or a double."""
        return self._expect(
            self.state(expression),
            (Type.INT, Type.DOUBLE),
            expression.span,
            f"{what} must be a number",
        )

    def integer(self, expression: Expression, what: str) -> bool:
        """Check that a state expression is an int."""
        return self._expect(
            self.state(expression), (Type.INT,), expression.span, f"{what} must be an int"
        )

    def _expect(
        self,
        actual: Type | None,
        expected: tuple[Type, ...],
        span: Span,
        message: str,
        hint: str | None = None,
    ) -> bool:
        if actual is not None and actual not in expected:
            hint = hint or rounding_hint(actual, expected)
            self._report.type(f"{message}, not {article(actual)}", span, hint)
        return actual in expected

    # ---------------------------------------------------------------------------- state expressions

    def state(self, expression: PathFormula) -> Type | None:
        """The type of a state expression."""
        match expression:
            case Literal():
                return expression.type
            case Name():
                return self._name(expression)
            case Unary(UnaryOperator.NOT, operand):
                self.boolean(operand, "the operand of !")
                return Type.BOOL
            case Unary(_, operand):
                actual = self.state(operand)
                return (
                    actual
                    if self._expect(
                        actual,
                        (Type.INT, Type.DOUBLE),
                        operand.span,
                        "the operand of - must be a number",
                    )
                    else None
                )
            case Binary(operator, left, right):
                return self._applied(operator, (left, right), expression.span)
            case Conditional(condition, then, otherwise):
                self.boolean(condition, "the condition of ?:")
                return self._common(expression.span, self.state(then), self.state(otherwise))
            case Call(function, arguments):
                if arguments and function.arity in (None, len(arguments)):
                    return self._applied(function, arguments, expression.span)
                count, plural = function.arity or "at least 1", "s" * ((function.arity or 1) > 1)
                self._report.type(f"{function} takes {count} argument{plural}", expression.span)
                return None
            case LabelReference():
                if self._label is not None:
                    return self._label(expression)
                self._report.type(
                    "a label cannot be used here", expression.span, "use a formula instead", "label"
                )
                return None
            case StateOperator():
                if self._label is not None:
                    return self._operator(expression)
                self._report.type(
                    "this operator is allowed in properties only",
                    expression.span,
                    code="operator",
                )
                return None
            case UnaryTemporal(symbol=symbol) | BinaryTemporal(symbol=symbol):
                message = f"{symbol} is a path formula, and a state formula is expected here"
                hint = "put an operator around it, such as P=? [ … ], A [ … ] or E [ … ]"
                self._report.type(message, expression.span, hint, "path")
                return None
            case _:
                assert_never(expression)

    def _applied(
        self, operator: Operator | Function, operands: tuple[Expression, ...], span: Span
    ) -> Type | None:
        match operator.signature:
            case Signature.LOGICAL:
                left, right = operands
                self.boolean(left, f"the left operand of {operator}")
                hint = _repeated(operator, left, right)
                self._boolean(right, f"the right operand of {operator}", hint)
                return Type.BOOL
            case Signature.ORDER:
                for side, operand in zip(("left", "right"), operands, strict=True):
                    actual, message = self.state(operand), f"the {side} operand of {operator}"
                    self._expect(
                        actual,
                        (Type.INT, Type.DOUBLE),
                        operand.span,
                        f"{message} must be a number",
                        _repeated(operator, *operands),
                    )
                return Type.BOOL
            case Signature.EQUALITY:
                one, other = map(self.state, operands)
                hint = _repeated(operator, *operands)
                if hint is None and one is Type.BOOL and isinstance(operands[0], Name):
                    hint = f"a bool needs no comparison: {operands[0].name}, or !{operands[0].name}"
                self._common(span, one, other, hint)
                return Type.BOOL
            case Signature.ARITHMETIC:
                return self._arithmetic(operator, operands)
            case Signature.DIVISION:
                self._arithmetic(operator, operands)
                return Type.DOUBLE
            case Signature.INTEGER:
                for operand in operands:
                    self.integer(operand, f"an argument of {operator}")
                return Type.INT
            case Signature.ROUNDING:
                for operand in operands:
                    self.numeric(operand, f"the argument of {operator}")
                return Type.INT
            case _:
                assert_never(operator.signature)

    def _arithmetic(self, operator: str, operands: tuple[Expression, ...]) -> Type | None:
        actual = [self.state(o) for o in operands]
        are_numeric = [
            self._expect(
                t, (Type.INT, Type.DOUBLE), o.span, f"an operand of {operator} must be a number"
            )
            for t, o in zip(actual, operands, strict=True)
        ]
        if Type.DOUBLE in actual:
            return Type.DOUBLE
        return Type.INT if all(are_numeric) else None

    def _common(
        self, span: Span, left: Type | None, right: Type | None, hint: str | None = None
    ) -> Type | None:
        """The common type of two expressions that are compared or are branches of `?:`."""
        if left is None or right is None:
            return None
        if left is right:
            return left
        if Type.BOOL in (left, right):
            message = f"{article(left)} and {article(right)} have no common type"
            self._report.type(message, span, hint)
            return None
        return Type.DOUBLE

    # ------------------------------------------------------------------------------------ operators

    def _operator(
        self,
        node: AnyMeasure
        | PathQuantifier
        | Filter
        | StateFilter
        | Quantile
        | MultiObjective
        | Equilibrium,
    ) -> Type | None:
        match node:
            case PathMeasure(_, bound, path):
                self.path(path)
                return self._bounded(bound)
            case ConditionalProbability(_, bound, path, condition):
                self.path(path)
                self.path(condition)
                return self._bounded(bound)
            case RewardOperator(_, bound, structure, query):
                self._structure(structure)
                self._query(query)
                return self._bounded(bound)
            case SteadyState(_, bound, formula):
                self.boolean(formula, "the formula of S")
                return self._bounded(bound)
            case PathQuantifier(_, path):
                self.path(path)
                return Type.BOOL
            case Filter():
                return self._filter(node)
            case StateFilter(_, formula, states):
                self.boolean(states, "the states of a filter")
                return self.state(formula)
            case Quantile(formula=formula):
                self.boolean(formula, "the formula of a quantile")
                return Type.INT
            case MultiObjective(objectives):
                actual = [self.state(o) for o in objectives]
                return (
                    None if None in actual else Type.DOUBLE if Type.DOUBLE in actual else Type.BOOL
                )
            case Equilibrium(objectives, bound):
                for objective in objectives:
                    self.state(objective)
                return self._bounded(bound)
            case _:
                assert_never(node)

    def _bounded(self, bound: Bound | None) -> Type:
        if bound is None:
            return Type.DOUBLE
        self.numeric(bound.threshold, "a threshold")
        return Type.BOOL

    def _filter(self, node: Filter) -> Type | None:
        actual = self.state(node.formula)
        if node.states is not None:
            self.boolean(node.states, "the states of a filter")
        if node.operator in NUMERIC_FILTERS:
            self._expect(
                actual,
                (Type.INT, Type.DOUBLE),
                node.formula.span,
                f"the formula of filter({node.operator}, …) must be a number",
            )
        elif node.operator in _BOOLEAN_FILTERS:
            self._expect(
                actual,
                (Type.BOOL,),
                node.formula.span,
                f"the formula of filter({node.operator}, …) must be a bool",
            )
        return _FILTER_TYPES.get(node.operator, actual)

    # ---------------------------------------------------------------------------------------- paths

    def path(self, formula: PathFormula, hint: str | None = None) -> None:
        """Check a path formula: temporal and logical operators over boolean state formulas."""
        match formula:
            case UnaryTemporal(operand, bound):
                self.path(operand)
                self._limits(bound)
            case BinaryTemporal(left, right, bound):
                if bound is not None or not self._bound_misplaced(formula):
                    self.path(left)
                self.path(right)
                self._limits(bound)
            case Unary(UnaryOperator.NOT, operand):
                self.path(operand)
            case Binary(operator, left, right) if operator.is_logical:
                self.path(left)
                self.path(right, _repeated(operator, left, right))
            case Conditional(condition, then, otherwise):
                for part in (condition, then, otherwise):
                    self.path(part)
            case ExpressionNode():
                self._boolean(formula, "a path formula", hint)
            case _:
                assert_never(formula)

    def _bound_misplaced(self, formula: BinaryTemporal) -> bool:
        """Report the bound in `a <=5 U b`, which is one of time, and no comparison of a with 5."""
        match _last_operand(formula.left):
            case Binary(equality, x, Binary(sign, operand, limit)) if (
                equality.signature is Signature.EQUALITY and self.state(x) is not Type.BOOL
            ):
                pass  # x=1 <=5 U b, where <= binds closer
            case Binary(sign, operand, limit) if self.state(operand) is Type.BOOL:
                if isinstance(operand, Binary) and not isinstance(operand.right, Literal):
                    return False  # 0<=x<5 U b
            case _:
                return False
        if sign.signature is not Signature.ORDER or not isinstance(limit, Literal | Name):
            return False
        whole = Span(operand.span.source, operand.span.end, formula.right.span.start)
        written = whole.text.lstrip(" )").rstrip(" (")
        if "".join(written.split()) != f"{sign}{limit.span.text}{formula.symbol}":
            return False  # with parentheses or comments
        start = whole.start + whole.text.index(written)
        span = Span(whole.source, start, start + len(written))
        hint = f"write {formula.symbol}{sign}{limit.span.text}"
        self._report.type(f"a bound stands behind {formula.symbol}", span, hint)
        return True

    def _limits(self, bound: PathBound | None) -> None:
        match bound:
            case None:
                pass
            case TimeBound() | RewardBound():
                what = "steps or time"
                if isinstance(bound, RewardBound):
                    self._structure(bound.structure)
                    what = "a reward"
                for limit in (bound.lower, bound.upper):
                    if limit is not None:
                        self.numeric(limit, f"a bound on {what}")
            case RewardBounds(parts):
                for part in parts:
                    self._limits(part)
            case _:
                assert_never(bound)

    def _structure(self, structure: str | Expression | None) -> None:
        if structure is not None and not isinstance(structure, str):
            self.integer(structure, "the number of a reward structure")

    def _query(self, query: RewardQuery) -> None:
        match query:
            case CumulativeReward(bound) | CostBoundedReward(bound):
                self._limits(bound)
            case DiscountedReward(bound, discount):
                self._limits(bound)
                self.numeric(discount, "the discount")
            case EndedReward(_, target):
                self.boolean(target, "what Fc or F0 reaches")
            case InstantaneousReward(time):
                self.numeric(time, "the time of I=")
            case TotalReward() | SteadyStateReward():
                pass
            case ExpressionNode() | UnaryTemporal() | BinaryTemporal():
                self.path(query)
            case _:
                assert_never(query)


def _last_operand(formula: PathFormula) -> PathFormula:
    """What a formula of logical operators ends with."""
    match formula:
        case Binary(operator, _, right) if operator.is_logical:
            return _last_operand(right)
        case Unary(UnaryOperator.NOT, operand):
            return _last_operand(operand)
        case _:
            return formula


_COMPARISONS = (Signature.ORDER, Signature.EQUALITY)


def _repeated(operator: Operator | Function, left: Expression, right: Expression) -> str | None:
    """A hint at `0<=x & x<3` for `0<=x<3`, and at `x=1 | x=2` for `x=1|2`."""
    from symcheck.syntax.printer import pretty

    match left:
        case Binary(comparison, first, middle) if comparison.signature in _COMPARISONS:
            if isinstance(first, Binary) and first.operator.signature in _COMPARISONS:
                return None
            if isinstance(middle, Conditional) or isinstance(right, Conditional):
                return None
            if comparison is operator is Operator.EQ and isinstance(middle, Literal):
                return None  # `(x=1)=1`: of a truth value, perhaps
            if operator.signature in _COMPARISONS:
                return f"write {pretty(left)} & {pretty(middle)}{operator}{pretty(right)}"
            if isinstance(first, Name) and isinstance(right, Literal):
                if comparison is Operator.NE and operator is Operator.OR:
                    operator = Operator.AND  # one of both holds always
                return f"write {pretty(left)} {operator} {pretty(first)}{comparison}{pretty(right)}"
    return None


def article(kind: Type) -> str:
    """A type with its indefinite article: 'an int'."""
    return f"an {kind.value}" if kind is Type.INT else f"a {kind.value}"


def rounding_hint(actual: Type, expected: tuple[Type, ...]) -> str | None:
    """The hint how to convert type `actual` to `expected`; None if there is no conversion."""
    if actual is Type.DOUBLE and Type.INT in expected:
        return "floor(…), ceil(…) or round(…) converts a double to an int (/ always gives a double)"
    return None
