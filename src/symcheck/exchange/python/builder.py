"""Models built in Python, which print as texts in the PRISM language."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from numbers import Integral
from typing import Any, Unpack

from symcheck.api.arguments import ModelTypeName
from symcheck.api.loading import loads
from symcheck.api.model import Model
from symcheck.constant_values import GivenConstants
from symcheck.errors import Diagnostic, NameFault, UsageError
from symcheck.exchange.python.from_matrix import identifier, label, plain_type
from symcheck.options import OptionValues
from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.grammars import load
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.printer import pretty

__all__ = ["BuiltModule", "Expression", "ModelBuilder"]


class Expression:
    """An expression over variables and constants: operators of Python make larger ones.

    `&`, `|` and `~` are and, or and not. In Python they bind more tightly than comparisons:
    `(x > 0) & (x < 3)`. `%` is mod, `**` is pow.
    """

    def __init__(self, node: ast.Expression) -> None:
        self.node = node

    def __str__(self) -> str:
        return pretty(self.node)

    def __repr__(self) -> str:
        return f"<Expression: {self}>"

    def __bool__(self) -> bool:
        raise TypeError(
            f"{self} is an expression, which Python cannot decide: write & | ~ for and, or, not, "
            "with comparisons in parentheses, as in (0 < x) & (x < 2), and choose, min and max of "
            "the builder for if, min and max"
        )

    __hash__ = object.__hash__

    def _with(self, operator: Operator, other: object, swapped: bool = False) -> Expression:
        left, right = self.node, _node(other)
        return Expression(ast.Binary(operator, *((right, left) if swapped else (left, right))))

    def __eq__(self, other: object) -> Expression:  # type: ignore[override]
        return self._with(Operator.EQ, other)

    def __ne__(self, other: object) -> Expression:  # type: ignore[override]
        return self._with(Operator.NE, other)

    def __lt__(self, other: object) -> Expression:
        return self._with(Operator.LT, other)

    def __le__(self, other: object) -> Expression:
        return self._with(Operator.LE, other)

    def __gt__(self, other: object) -> Expression:
        return self._with(Operator.GT, other)

    def __ge__(self, other: object) -> Expression:
        return self._with(Operator.GE, other)

    def __and__(self, other: object) -> Expression:
        return self._with(Operator.AND, other)

    def __rand__(self, other: object) -> Expression:
        return self._with(Operator.AND, other, swapped=True)

    def __or__(self, other: object) -> Expression:
        return self._with(Operator.OR, other)

    def __ror__(self, other: object) -> Expression:
        return self._with(Operator.OR, other, swapped=True)

    def __add__(self, other: object) -> Expression:
        return self._with(Operator.PLUS, other)

    def __radd__(self, other: object) -> Expression:
        return self._with(Operator.PLUS, other, swapped=True)

    def __sub__(self, other: object) -> Expression:
        return self._with(Operator.MINUS, other)

    def __rsub__(self, other: object) -> Expression:
        return self._with(Operator.MINUS, other, swapped=True)

    def __mul__(self, other: object) -> Expression:
        return self._with(Operator.TIMES, other)

    def __rmul__(self, other: object) -> Expression:
        return self._with(Operator.TIMES, other, swapped=True)

    def __truediv__(self, other: object) -> Expression:
        return self._with(Operator.DIVIDE, other)

    def __rtruediv__(self, other: object) -> Expression:
        return self._with(Operator.DIVIDE, other, swapped=True)

    def __floordiv__(self, other: object) -> Expression:
        return _call(Function.FLOOR, self / other)

    def __rfloordiv__(self, other: object) -> Expression:
        return _call(Function.FLOOR, self._with(Operator.DIVIDE, other, swapped=True))

    def __mod__(self, other: object) -> Expression:
        return _call(Function.MOD, self, other)

    def __rmod__(self, other: object) -> Expression:
        return _call(Function.MOD, other, self)

    def __rpow__(self, other: object) -> Expression:
        return _call(Function.POW, other, self)

    def __pow__(self, other: object) -> Expression:
        return _call(Function.POW, self, other)

    def __neg__(self) -> Expression:
        return Expression(ast.Unary(UnaryOperator.MINUS, self.node))

    def __invert__(self) -> Expression:
        return Expression(ast.Unary(UnaryOperator.NOT, self.node))


class _Variables:
    """What declares variables: a module, or a model, whose variables every module can change."""

    def __init__(self) -> None:
        self._variables: list[decl.VariableDeclaration] = []

    def integer(self, name: str, low: object, high: object, initial: object = None) -> Expression:
        """A variable with the values from low to high, and the initial value low by default.

        Without bounds, both are None, and the initial value is 0 by default.

        Raises:
            UsageError: one bound is missing.
        """
        if (low is None) != (high is None):
            raise UsageError(f"variable {name}: give both bounds, or None for both")
        return self._declared(name, ast.Type.INT, low, high, initial)

    def boolean(self, name: str, initial: object = None) -> Expression:
        """A variable that is true or false, and initially false by default."""
        return self._declared(name, ast.Type.BOOL, None, None, initial)

    def _declared(self, name: str, kind: ast.Type, *values: object) -> Expression:
        low, high, initial = (None if value is None else _node(value) for value in values)
        _name("a variable", name)
        self._variables.append(decl.VariableDeclaration(name, kind, low, high, initial))
        return Expression(ast.Name(name))


class BuiltModule(_Variables):
    """A module that is being built: its variables and commands. `ModelBuilder.module` begins it."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = _name("a module", name)
        self._commands: list[decl.Command] = []

    def command(
        self,
        guard: object,
        *updates: Mapping[Expression, object] | tuple[object, Mapping[Expression, object]],
        action: str | None = None,
    ) -> None:
        """Add a command.

        Args:
            guard: the condition under which it can be taken.
            updates: each a mapping from variables to their next values, or a pair of a probability
                (rate of a CTMC) and a mapping. Variables that are not in it keep their values.
            action: that on which it synchronises with other modules; None: none.
        """
        if not updates:
            raise UsageError("a command has at least one update; one that changes nothing is {}")
        changes = tuple(map(_update, updates))
        self._commands.append(decl.Command(_action(action), _node(guard), changes))

    @property
    def declared(self) -> decl.Module:
        """The syntax tree of the module."""
        return decl.Module(self.name, tuple(self._variables), tuple(self._commands))


class ModelBuilder(_Variables):
    """A model that is being built. Its text in the PRISM language is `str(builder)`.

    Args:
        type: "dtmc", "ctmc" or "mdp".

    Examples:
        >>> import symcheck
        >>> builder = symcheck.ModelBuilder("dtmc")
        >>> p = builder.constant("p", type="double")
        >>> walk = builder.module("walk")
        >>> x = walk.integer("x", 0, 3, initial=1)
        >>> walk.command((x > 0) & (x < 3), (p, {x: x + 1}), (1 - p, {x: x - 1}))
        >>> builder.label("won", x == 3)
        >>> print(builder)
        dtmc
        <BLANKLINE>
        const double p;
        <BLANKLINE>
        module walk
          x : [0..3] init 1;
        <BLANKLINE>
          [] x>0 & x<3 -> p : (x'=x + 1) + 1 - p : (x'=x - 1);
        endmodule
        <BLANKLINE>
        label "won" = x=3;
        <BLANKLINE>
        >>> round(builder.build({"p": 0.5}).check('P=? [ F "won" ]').value, 6)
        0.333333
    """

    def __init__(self, type: ast.ModelType | ModelTypeName = "dtmc") -> None:
        super().__init__()
        self._type = plain_type(type)
        self._constants: list[decl.Constant] = []
        self._formulas: list[decl.Formula] = []
        self._labels: list[decl.Label] = []
        self._modules: list[BuiltModule] = []
        self._rewards: dict[str, list[decl.RewardItem]] = {}

    def constant(self, name: str, value: object = None, *, type: str | None = None) -> Expression:
        """A constant. With no value, `build` needs one.

        Args:
            name: its name.
            value: a number, a truth value or an expression; None: it is given later.
            type: "int", "double" or "bool"; None: that of the value.

        Raises:
            UsageError: a type is needed: there is no value, or it is an expression.
        """
        node = None if value is None else _node(value)
        try:
            kind = ast.Type(type or _type_of(value))
        except ValueError:
            raise UsageError(f"constant {name}: give its type, 'int', 'double' or 'bool'") from None
        self._constants.append(decl.Constant(_name("a constant", name), kind, node))
        return Expression(ast.Name(name))

    def formula(self, name: str, expression: object) -> Expression:
        """A name for an expression."""
        self._formulas.append(decl.Formula(_name("a formula", name), _node(expression)))
        return Expression(ast.Name(name))

    def module(self, name: str) -> BuiltModule:
        """Begin a module."""
        self._modules.append(BuiltModule(name))
        return self._modules[-1]

    def label(self, name: str, condition: object) -> None:
        """Name the states that satisfy a condition."""
        self._labels.append(decl.Label(label(name), _node(condition)))

    def state_reward(self, name: str, value: object, guard: object = True) -> None:
        """Add a reward of the states that satisfy a guard to the reward structure `name`."""
        self._reward(name, decl.RewardItem(False, _node(guard), _node(value)))

    def action_reward(
        self, name: str, value: object, action: str | None = None, guard: object = True
    ) -> None:
        """Add a reward of the transitions with an action (None: with no action) from states that
        satisfy a guard to the reward structure `name`.
        """
        self._reward(name, decl.RewardItem(_action(action), _node(guard), _node(value)))

    def _reward(self, name: str, item: decl.RewardItem) -> None:
        self._rewards.setdefault(identifier("a reward structure", name), []).append(item)

    @staticmethod
    def choose(condition: object, then: object, otherwise: object) -> Expression:
        """`condition ? then : otherwise`."""
        return Expression(ast.Conditional(_node(condition), _node(then), _node(otherwise)))

    @staticmethod
    def min(*values: object) -> Expression:
        """The least of some numbers."""
        return _call(Function.MIN, *values)

    @staticmethod
    def max(*values: object) -> Expression:
        """The greatest of some numbers."""
        return _call(Function.MAX, *values)

    @staticmethod
    def floor(value: object) -> Expression:
        """The greatest integer that is not above a number."""
        return _call(Function.FLOOR, value)

    @staticmethod
    def ceil(value: object) -> Expression:
        """The least integer that is not below a number."""
        return _call(Function.CEIL, value)

    @property
    def program(self) -> decl.Program:
        """The syntax tree of the model."""
        return decl.Program(
            self._type,
            tuple(self._constants),
            tuple(self._formulas),
            tuple(self._labels),
            tuple(self._variables),
            tuple(module.declared for module in self._modules),
            tuple(decl.RewardStructure(n, tuple(items)) for n, items in self._rewards.items()),
        )

    def __str__(self) -> str:
        return pretty(self.program)

    def build(
        self, constants: GivenConstants | str | None = None, **options: Unpack[OptionValues]
    ) -> Model:
        """The model.

        Args:
            constants: one value for each constant without one.
            options: see `symcheck.Options`.

        Raises:
            InputError: syntax, names or types are wrong, at a place of `str(builder)`; other faults
                show when the model is built or checked.
        """
        return loads(str(self), constants, **options)


def _node(value: object) -> ast.Expression:
    """The tree of an expression or number. A float is its shortest decimal: 0.1 is 1/10."""
    match value:
        case Expression():
            return value.node
        case bool():
            return ast.Literal(value, ast.Type.BOOL)
        case Integral():
            return _signed(int(value), ast.Type.INT)
        case float() | Fraction():
            try:
                return _signed(Fraction(str(value)), ast.Type.DOUBLE)
            except ValueError:  # infinite, or no number
                pass
        case _:
            pass
    raise UsageError(f"expected an expression or a finite number, not {value!r}")


def _signed(value: Any, kind: ast.Type) -> ast.Expression:
    literal = ast.Literal(abs(value), kind)
    return literal if value >= 0 else ast.Unary(UnaryOperator.MINUS, literal)


def _call(function: Function, *values: object) -> Expression:
    return Expression(ast.Call(function, tuple(map(_node, values))))


def _name(what: str, name: str) -> str:
    """The name, if it is one in the PRISM language. Raises NameFault."""
    if load("prism").reserves(identifier(what, name)):
        hint = f"choose another name, such as {name}_"
        raise NameFault(Diagnostic(f"'{name}' is a reserved word", code="name", hint=hint))
    return name


def _action(name: str | None) -> str | None:
    return None if name is None else _name("an action", name)


def _type_of(value: object) -> str:
    """The word of a number's type; "" of an expression, or of nothing."""
    match value:
        case bool():
            return "bool"
        case Integral():
            return "int"
        case float() | Fraction():
            return "double"
        case _:
            return ""


def _update(given: object) -> decl.Update:
    if isinstance(given, tuple) and len(given) != 2:
        raise UsageError(f"expected a pair of a probability and a mapping, not {given!r}")
    probability, changes = given if isinstance(given, tuple) else (None, given)
    if not isinstance(changes, Mapping):
        raise UsageError(f"expected a mapping from variables to values, not {changes!r}")
    assignments = []
    for variable, value in changes.items():
        if not isinstance(variable, Expression) or not isinstance(variable.node, ast.Name):
            raise UsageError(f"expected a variable, not {variable!r}")
        assignments.append(decl.Assignment(variable.node.name, _node(value)))
    weight = None if probability is None else _node(probability)
    return decl.Update(weight, tuple(assignments))
