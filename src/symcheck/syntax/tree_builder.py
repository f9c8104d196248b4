"""Makes syntax trees while a text is parsed: one method for every rule or alias of the grammars.

A method gets the values of all symbols of its rule and returns the value of the rule. A word has
the attributes `value`, `start_pos` and `end_pos` (offsets in characters); an absent option is None.
The grammars tell what each method gets, so the methods have no docstrings.
"""

# ruff: noqa: D102
from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial, partialmethod
from itertools import product
from string import ascii_uppercase
from typing import Any, NamedTuple, cast, get_args

from symcheck.errors import NO_SPAN, Diagnostic, Source, Span
from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.ast import Expression
from symcheck.syntax.operators import (
    FUNCTION_BY_NAME,
    OPERATOR_BY_TOKEN,
    Function,
    Operator,
    UnaryOperator,
    function_hint,
)
from symcheck.syntax.traversal import Tree, children, nodes

__all__ = [
    "FILTERS",
    "LONGEST_CHAIN",
    "MAX_NESTING",
    "Builder",
    "ModelBuilder",
    "PropertiesBuilder",
]

FILTERS: tuple[ast.FilterOperator, ...] = get_args(ast.FilterOperator)
_FILTER_SIGNS: dict[str, ast.FilterOperator] = {
    "+": "sum",
    "&": "forall",
    "|": "exists",
    "values": "printall",
}

_ASSOCIATIVE = frozenset(o for o in Operator if o.is_associative)

LONGEST_CHAIN = 64
"""Longer chains of an associative operator become balanced trees.

Generated labels with thousands of disjuncts would otherwise nest as deep as they are long.
"""

MAX_NESTING = (
    2000 if sys.version_info[:2] != (3, 12) else 1000 if sys.version_info >= (3, 12, 2) else 320
)
"""Deeper expressions are refused, because later stages follow them by recursion.

The comparison and the hashing of trees recurse through C, for which CPython 3.12 alone has a fixed
limit. Its first two releases had a third of the limit of the later ones.
"""

_SHALLOW = 100
"""The depth of an expression is measured if it has more characters: a level takes at least one."""

_LARGEST_INT = 2**63 - 1
_LARGEST_DOUBLE = Fraction(1.7976931348623157e308)
_MOST_DIGITS = 4000
_LARGEST_EXPONENT = 5000
"""Numbers with more digits or larger exponents are refused, before they take time and memory."""

Value = Any
"""The value of a part of a rule: a word, a node, a tuple, or None for a missing part."""
Values = list[Value]
Chain = list[Value]
"""Operands and the operators between them: operand, operator, operand, …"""

Operand = tuple[Value, int, int]
"""A node with the offsets where it starts and ends, parentheses included."""


class Structure(NamedTuple):
    """The name or the index of a reward structure in braces, and where it stands."""

    value: str | Expression
    start_pos: int
    end_pos: int


class _Invariant(NamedTuple):
    condition: Expression


def _text(word: Value) -> Value:
    """The text of a word, of a name in quotes without them; any other value as it is."""
    if word is None or isinstance(word, ast.Node | tuple):
        return word
    if isinstance(word, list):
        return tuple(map(_text, word))
    return word.value.strip('"').strip() if word.value[0] == '"' else word.value


def _node(kind: type[ast.Node], *indices: int | slice) -> Callable[[Builder, Values], Value]:
    """The method of a rule that makes a node from the values with these indices.

    A slice gives a list without the signs between its parts.
    """

    def method(self: Builder, values: Values) -> ast.Node:
        fields = [_text(values[i]) for i in indices]
        if kind in _DECLARATIONS:
            fields = [self.measure(f) if isinstance(f, ast.Node) else f for f in fields]
        return kind(*fields, span=self._span(values))

    return method


def _listed(_: Builder, values: Values) -> tuple[Value, ...]:
    """The parts of a list without the signs between them."""
    return cast("tuple[Value, ...]", _text(values[::2]))


def _of_words(_: Builder, values: Values) -> Values:
    """The words between the signs of a list in brackets."""
    return values[1::2]


def _actions(given: Value) -> tuple[str | None, tuple[str, ...]]:
    """The first action between brackets, and the others."""
    names = given if isinstance(given, tuple) else (given and given.value,)
    return names[0], names[1:]


def _of_kind(kind: Value, values: Values) -> tuple[Value, ...]:
    return tuple(v for v in values if isinstance(v, kind))


class Builder:
    """Expressions, constants, formulas and labels.

    `begin` starts a text. Afterwards `diagnostics` has the faults that the grammar does not
    exclude, and `deepest` is the depth of the deepest of the long expressions. One builder serves
    one text at a time.
    """

    def __init__(self) -> None:
        self.begin(NO_SPAN.source)

    def __reduce__(self) -> tuple[Value, ...]:
        return type(self), ()

    def begin(self, source: Source) -> None:
        """Forget the last text and start this one."""
        self.source = source
        self.diagnostics: dict[tuple[int, str], Diagnostic] = {}
        self.deepest = 0
        # By id of a node in parentheses: their offsets, and the node, so that its id stays in use.
        self._outer: dict[int, tuple[int, int, Value]] = {}

    # ------------------------------------------------------------------------------------ positions

    def _extent(self, part: Value) -> tuple[int, int]:
        """Where a word or node starts and ends, with the parentheses around it."""
        if not isinstance(part, ast.Node):
            return part.start_pos, part.end_pos
        outer = self._outer.get(id(part))
        return (part.span.start, part.span.end) if outer is None else outer[:2]

    def _span(self, values: Values) -> Span:
        return Span(self.source, self._extent(values[0])[0], self._extent(values[-1])[1])

    def _words(self, values: Values) -> Span:
        """The span of values of which the first and the last are words."""
        return Span(self.source, values[0].start_pos, values[-1].end_pos)

    def _wrong(self, message: str, span: Span, code: str, hint: str | None = None) -> None:
        self.diagnostics.setdefault((span.start, message), Diagnostic(message, span, code, hint))

    def measure(self, tree: Value) -> Value:
        """A complete expression, or None. Measures its depth if it is long."""
        if tree is None or tree.span.end - tree.span.start <= _SHALLOW:
            return tree
        depth, level = 1, list[Tree](children(tree))
        while level:
            depth += 1
            if depth > MAX_NESTING:
                self._wrong(
                    f"nested more than {MAX_NESTING} levels deep",
                    level[-1].span,
                    "nesting",
                    "give parts of it names with formula … = …;",
                )
                break
            level = [child for node in level for child in children(node)]
        self.deepest = max(self.deepest, depth)
        return tree

    # ---------------------------------------------------------------------------------- expressions

    def integer(self, values: Values) -> ast.Literal:
        digits: str = values[0].value
        if len(digits) > 1 and digits[0] == "0":
            return self.real(values)
        span = self._words(values)
        if len(digits) > 19 or int(digits) > _LARGEST_INT:
            if self._is_of_fraction(span) and len(digits) <= _MOST_DIGITS:
                return ast.Literal(Fraction(int(digits)), ast.Type.DOUBLE, span=span)
            hint = f"integers end at {_LARGEST_INT}; a double may be larger, such as 1e20"
            self._wrong("this integer is too large", span, "number", hint)
            return ast.Literal(0, ast.Type.INT, span=span)
        return ast.Literal(int(digits), ast.Type.INT, span=span)

    def _is_of_fraction(self, span: Span) -> bool:
        """Whether a number is divided, or divides: `/` gives doubles, which may be larger."""
        before, after = (
            self.source.text[: span.start].rstrip(),
            self.source.text[span.end :].lstrip(),
        )
        return before.endswith("/") or (after.startswith("/") and not after.startswith("//"))

    def real(self, values: Values) -> ast.Literal:
        span = self._words(values)
        mantissa, _, exponent = values[0].value.lower().partition("e")
        value: Fraction | None = None
        if len(mantissa) <= _MOST_DIGITS and len(exponent) <= _MOST_DIGITS:
            power = int(exponent or "0")
            if not mantissa.strip("0."):
                value = Fraction(0)
            elif abs(power) <= _LARGEST_EXPONENT:
                value = Fraction(mantissa) * Fraction(10) ** power
        if value is None or value > _LARGEST_DOUBLE:
            hint = "doubles reach from about 1e-308 to 1.8e308"
            self._wrong("this number is out of range", span, "number", hint)
            value = Fraction(0)
        return ast.Literal(value, ast.Type.DOUBLE, span=span)

    def truth(self, values: Values) -> ast.Literal:
        return ast.Literal(values[0].value == "true", ast.Type.BOOL, span=self._words(values))

    def name(self, values: Values) -> ast.Name:
        word = values[0]
        return ast.Name(word.value, span=Span(self.source, word.start_pos, word.end_pos))

    def parentheses(self, values: Values) -> Value:
        opening, inner, closing = values
        self._outer[id(inner)] = (opening.start_pos, closing.end_pos, inner)
        return inner

    def minus(self, values: Values) -> ast.Unary:
        sign, operand = values
        if self._is_open_negation(operand):
            self._misplaced_negation(operand, sign.value)
        return ast.Unary(UnaryOperator.MINUS, operand, span=self._span(values))

    def negation(self, values: Values) -> ast.Unary:
        return ast.Unary(UnaryOperator.NOT, values[1], span=self._span(values))

    def _is_open_negation(self, operand: Value) -> bool:
        """Whether this is `!x` without parentheses: the next operator may bind x more tightly."""
        return (
            type(operand) is ast.Unary
            and operand.operator is UnaryOperator.NOT
            and id(operand) not in self._outer
        )

    def _misplaced_negation(self, operand: ast.Unary, before: str) -> None:
        span = Span(self.source, operand.span.start, operand.span.start + 1)
        hint = f"put it in parentheses: {before} (!…)"
        self._wrong(f"'!' cannot stand behind '{before}'", span, "negation", hint)

    def chain(self, values: Values) -> Chain:
        left, operator, right = values
        if type(left) is list:
            left += (OPERATOR_BY_TOKEN[operator.value], right)
            return left
        return [left, OPERATOR_BY_TOKEN[operator.value], right]

    def operation(self, values: Values) -> Value:
        return self._resolved(values[0])

    def chain_of_paths(self, values: Values) -> Value:
        return self._resolved(self.chain(values))

    def _resolved(self, chain: Value) -> Value:
        """The tree of a chain of operands and operators; any other value as it is.

        Operands wait on one stack, operators with the number of their operands on another one. An
        operator is applied as soon as one follows that does not bind more tightly.

        Source: the shunting-yard algorithm, Dijkstra, ALGOL 60 translation (1961).
        """
        if type(chain) is not list:
            return chain
        operands: list[Operand] = []
        # Precedence, operator, number of operands, start of a negation.
        waiting: list[tuple[int, Operator | UnaryOperator, int, int]] = []
        last = len(chain) - 1
        for i in range(0, last + 1, 2):
            operand = chain[i]
            if i:
                operator = chain[i - 1]
                strength = operator.precedence
                count = 2
                while waiting and waiting[-1][0] >= strength:
                    if waiting[-1][0] == strength:
                        if operator is Operator.IMPLIES:
                            break
                        if operator in _ASSOCIATIVE and waiting[-1][1] is operator:
                            count = waiting.pop()[2] + 1
                            break
                    self._apply(operands, *waiting.pop())
                waiting.append((strength, operator, count, 0))
                if strength > UnaryOperator.NOT.precedence and self._is_open_negation(operand):
                    self._misplaced_negation(operand, operator)
            _, end = self._extent(operand)
            if i < last and chain[i + 1].precedence > UnaryOperator.NOT.precedence:
                while self._is_open_negation(operand):
                    waiting.append(
                        (UnaryOperator.NOT.precedence, UnaryOperator.NOT, 1, operand.span.start)
                    )
                    operand = operand.operand
            operands.append((operand, self._extent(operand)[0], end))
        while waiting:
            self._apply(operands, *waiting.pop())
        return operands[0][0]

    def _apply(
        self,
        operands: list[Operand],
        _: int,
        operator: Operator | UnaryOperator,
        count: int,
        at: int,
    ) -> None:
        """Replace the last `count` operands by the operator applied to them."""
        if isinstance(operator, UnaryOperator):
            operand, _, end = operands.pop()
            node = ast.Unary(operator, operand, span=Span(self.source, at, end))
            operands.append((node, at, end))
            return
        parts = operands[-count:]
        del operands[-count:]
        while count > LONGEST_CHAIN and len(parts) > 1:
            pairs = zip(parts[::2], parts[1::2], strict=False)
            odd = parts[-1:] if len(parts) % 2 else []
            parts = [self._joined(operator, a, b) for a, b in pairs] + odd
        joined = parts[0]
        for part in parts[1:]:
            joined = self._joined(operator, joined, part)
        operands.append(joined)

    def _joined(self, operator: Operator, a: Operand, b: Operand) -> Operand:
        span = Span(self.source, a[1], b[2])
        return ast.Binary(operator, a[0], b[0], span=span), a[1], b[2]

    def conditional(self, values: Values) -> ast.Conditional:
        condition, _, then, _, otherwise = values
        condition = self._resolved(condition)
        span = self._span([condition, otherwise])
        return ast.Conditional(condition, self._resolved(then), otherwise, span=span)

    arguments = _listed

    def call(self, values: Values) -> ast.Call:
        function = values[0 if len(values) == 4 else 2].value
        if function not in FUNCTION_BY_NAME:
            self._wrong(
                f"there is no function '{function}'",
                self._words(values),
                "function",
                function_hint(function),
            )
        return ast.Call(
            FUNCTION_BY_NAME.get(function, Function.MIN), values[-2], span=self._words(values)
        )

    # ------------------------------------------------------------------ constants, formulas, labels

    def constant(self, values: Values) -> decl.Constant:
        *head, name, _, value, _ = values
        kind = ast.Type.DOUBLE
        if len(head) == 2:
            kind = ast.Type(head[1].value if head[1] else "int")
        return decl.Constant(name.value, kind, self.measure(value), span=self._words(values))

    reference = _node(ast.LabelReference, 0)
    formula = _node(decl.Formula, 1, 3)
    label = _node(decl.Label, 1, 3)


class ModelBuilder(Builder):
    """The methods of prism.lark."""

    def model_type(self, values: Values) -> tuple[ast.ModelType, Span]:
        word = values[0].value
        return ast.TYPE_WORDS[word], self._words(values)

    def program(self, values: Values) -> decl.Program:
        tagged = _of_kind(tuple, values)
        return decl.Program(
            self._single([v for v in tagged if isinstance(v[0], ast.ModelType)], "model type"),
            _of_kind(decl.Constant, values),
            _of_kind(decl.Formula, values),
            _of_kind(decl.Label, values),
            _of_kind(decl.VariableDeclaration, values),
            _of_kind(decl.Module | decl.RenamedModule, values),
            _of_kind(decl.RewardStructure, values),
            self._single([v[1:] for v in tagged if v[0] == "init"], "init … endinit"),
            self._single([v[1:] for v in tagged if v[0] == "system"], "system … endsystem"),
            _of_kind(decl.Player, values),
            (
                *(o for v in tagged if v[0] == "observables" for o in v[1]),
                *_of_kind(decl.Observable, values),
            ),
            span=Span(self.source, 0, len(self.source.text)),
        )

    def _single(self, items: list[tuple[Value, Span]], what: str) -> Value:
        for _, span in items[1:]:
            if span == items[0][1]:
                continue  # the same one, in a part of a broken text that was read twice
            self._wrong(f"a second {what}", span, "repeated", f"a model has one {what} at most")
        return items[0][0] if items else None

    def observables(self, values: Values) -> tuple[str, tuple[decl.Observable, ...], Span]:
        names = [v for v in values[1:-1:2] if v is not None]
        spans = [self._span([name]) for name in names]
        nodes = (
            decl.Observable(None, ast.Name(name.value, span=span), span=span)
            for name, span in zip(names, spans, strict=True)
        )
        return "observables", tuple(nodes), self._words(values)

    observable = _node(decl.Observable, 1, 3)

    def initial(self, values: Values) -> tuple[str, Expression, Span]:
        return "init", self.measure(values[1]), self._words(values)

    def system(self, values: Values) -> tuple[str, decl.Composition, Span]:
        return "system", values[1], self._words(values)

    # -------------------------------------------------------------------------------------- modules

    def variable(self, values: Values) -> decl.VariableDeclaration:
        name, _, *domain, _, initial, _ = values
        kind, low, high = ast.Type.INT, None, None
        clock = len(domain) == 1 and domain[0].value == "clock"
        if len(domain) == 1:
            kind = kind if clock else ast.Type(domain[0].value)
        else:
            low, high = self.measure(domain[1]), self.measure(domain[3])
            if self.source.text.startswith("...", domain[2].start_pos):
                place = Span(self.source, domain[2].start_pos, domain[2].end_pos + 1)
                self._wrong("a range has two points", place, "range", "write [low..high]")
        initial, span = self.measure(initial), self._words(values)
        return decl.VariableDeclaration(name.value, kind, low, high, initial, clock, span=span)

    def global_variable(self, values: Values) -> decl.VariableDeclaration:
        return cast(decl.VariableDeclaration, values[1])

    def module(self, values: Values) -> decl.Module:
        variables = _of_kind(decl.VariableDeclaration, values)
        commands = _of_kind(decl.Command, values)
        (invariant,) = _of_kind(_Invariant, values) or (None,)
        condition = invariant and invariant.condition
        name, span = values[1].value, self._words(values)
        return decl.Module(name, variables, commands, condition, span=span)

    def invariant(self, values: Values) -> _Invariant:
        return _Invariant(self.measure(values[1]))

    def owned_module(self, values: Values) -> tuple[str, str]:
        return "module", values[0].value

    def owned_action(self, values: Values) -> tuple[str, str]:
        return "action", values[1].value

    def player(self, values: Values) -> decl.Player:
        owned = [v for v in values if isinstance(v, tuple)]
        modules, actions = (
            tuple(name for kind, name in owned if kind == wanted) for wanted in ("module", "action")
        )
        return decl.Player(values[1].value, modules, actions, span=self._words(values))

    def command(self, values: Values) -> decl.Command:
        opening, given, _, guard, _, updates, _ = values
        self._outer.clear()
        action, others = _actions(given)
        span, has_rates = self._words(values), opening.value == "<"
        return decl.Command(action, self.measure(guard), updates, has_rates, others, span=span)

    updates = _listed

    def certain(self, values: Values) -> decl.Update:
        assignments, span = values[0]
        return decl.Update(None, assignments, span=span)

    def update(self, values: Values) -> decl.Update:
        probability, _, (assignments, span) = values
        upper = None
        if isinstance(probability, tuple):
            bracket, probability, upper = probability
            start = bracket.start_pos
        else:
            start = self._extent(probability)[0]
        span = Span(self.source, start, span.end)
        return decl.Update(self.measure(probability), assignments, self.measure(upper), span=span)

    def interval(self, values: Values) -> tuple[Value, Value, Value]:
        bracket, lower, _, upper, _ = values
        return bracket, lower, upper

    def assignments(self, values: Values) -> tuple[tuple[decl.Assignment, ...], Span]:
        return _of_kind(decl.Assignment, values), self._span(values)

    def primed(self, values: Values) -> ast.Name:
        """The value of a variable after the step."""
        return ast.Name(values[0].value + ast.PRIME, span=self._words(values))

    def assignment(self, values: Values) -> decl.Assignment:
        _, variable, _, _, value, _ = values
        return decl.Assignment(variable.value, self.measure(value), span=self._words(values))

    renamed_module = _node(decl.RenamedModule, 1, 3, slice(5, -2, 2))
    rename = _listed

    def action_pair(self, values: Values) -> tuple[str, str]:
        return values[0].value, values[-1].value

    # -------------------------------------------------------------------------------------- rewards

    rewards = _node(decl.RewardStructure, 1, slice(2, -1))

    def state_reward(self, values: Values) -> decl.RewardItem:
        guard, _, value, _ = values
        span = self._span(values)
        return decl.RewardItem(False, self.measure(guard), self.measure(value), span=span)

    def transition_reward(self, values: Values) -> decl.RewardItem:
        _, given, _, guard, _, value, _ = values
        (action, others), span = _actions(given), self._words(values)
        return decl.RewardItem(action, self.measure(guard), self.measure(value), others, span=span)

    # ---------------------------------------------------------------------------------- composition

    parallel = _node(decl.Parallel, slice(None, None, 2))
    interleaving = _node(decl.Interleaving, slice(None, None, 2))
    renaming = _node(decl.Renaming, 0, slice(2, -1, 2))
    synchronised = _node(decl.Synchronised, 0, 4, 2)
    hiding = _node(decl.Hiding, 0, 3)
    module_reference = _node(decl.ModuleReference, 0)
    actions = _listed


class PropertiesBuilder(Builder):
    """The methods of properties.lark."""

    def properties(self, values: Values) -> decl.PropertiesFile:
        return decl.PropertiesFile(
            _of_kind(decl.Constant, values),
            _of_kind(decl.Formula, values),
            _of_kind(decl.Label, values),
            _of_kind(decl.Property, values),
            span=Span(self.source, 0, len(self.source.text)),
        )

    def property(self, values: Values) -> decl.Property:
        name, _, formula = values
        text = self.source.text
        (start, _), (_, end) = self._extent(name or formula), self._extent(formula)
        word = _LAST_WORD.search(text, max(start, end - _LONGEST_WORD), end)
        if word and _OPENING.match(text, end):
            span = Span(self.source, word.start(), end)
            hint = function_hint(word[0])
            self._wrong(f"there is no function '{word[0]}'", span, "function", hint)
        span = Span(self.source, start, end)
        comments = comments_above(text, start)
        self._outer.clear()
        return decl.Property(_text(name), self.measure(formula), comments, span=span)

    # ---------------------------------------------------------------------------------------- paths

    def unary_path(self, values: Values) -> ast.UnaryTemporal:
        operator, bound, operand = values
        return _UNARY_PATHS[operator.value](operand, bound, span=self._span(values))

    def binary_path(self, values: Values) -> ast.BinaryTemporal:
        left, operator, bound, right = values
        return _BINARY_PATHS[operator.value](left, right, bound, span=self._span(values))

    def time_bound(self, values: Values) -> ast.TimeBound:
        operator, limit = values[0].value, values[1]
        span = self._span(values)
        if operator == "=":
            return ast.TimeBound(limit, False, limit, False, span=span)
        if operator in ("<", "<="):
            return ast.TimeBound(upper=limit, upper_strict=operator == "<", span=span)
        return ast.TimeBound(lower=limit, lower_strict=operator == ">", span=span)

    def time_interval(self, values: Values) -> ast.TimeBound:
        return ast.TimeBound(lower=values[1], upper=values[3], span=self._words(values))

    def reward_bound(self, values: Values) -> ast.RewardBound | ast.RewardBounds:
        parts = _of_kind(ast.RewardBound, values)
        return parts[0] if len(parts) == 1 else ast.RewardBounds(parts, span=self._span(values))

    def count(self, values: Values) -> ast.RewardBound:
        word, structure, _ = values
        if word.value != ("steps" if structure is None else "rew"):
            hint = 'a bound on a reward is written ^{rew{"name"}<=k}, one on steps ^{steps<=k}'
            self._wrong(f"'{word.value}' is no kind of bound", self._span(values), "bound", hint)
        return self.plain_count(values)

    def plain_count(self, values: Values) -> ast.RewardBound:
        *_, structure, limits = values
        return ast.RewardBound(
            limits.lower,
            limits.lower_strict,
            limits.upper,
            limits.upper_strict,
            structure and structure.value,
            span=self._span(values),
        )

    # -------------------------------------------------------------------------- operators on states

    def value(self, _: Values) -> None:
        return None

    def threshold(self, values: Values) -> ast.Bound:
        return ast.Bound(OPERATOR_BY_TOKEN[values[0].value], values[1], span=self._span(values))

    def _measure(self, kind: Value, values: Values) -> Expression:
        """An operator such as P: its letter or glued word and direction, bound, and operand."""
        *head, bound, _, operand, old, _ = values
        direction = (head[-1] or head[0]).value.lstrip(ascii_uppercase) or None
        operands = [operand]
        if kind is ast.RewardOperator:
            operands.insert(0, head[-2] and head[-2].value if len(head) > 2 else None)
        node = kind(direction, bound, *operands, span=self._words(values))
        return node if old is None else ast.StateFilter(old[1], node, old[0], span=node.span)

    probability = partialmethod(_measure, ast.ProbabilityOperator)

    def conditional_probability(self, values: Values) -> Expression:
        *head, bound, opening, path, sign, condition, old, closing = values
        if not (_is_temporal(path) and _is_temporal(condition)):
            hint = "or is written |; P=? [ F a || F b ] is the probability of F a given F b"
            span = self._words([sign])
            self._wrong("'||' is not an operator of expressions", span, "syntax", hint)
        kind = partial(ast.ConditionalProbability, condition=condition)
        return self._measure(kind, [*head, bound, opening, path, old, closing])

    def reward(self, values: Values) -> Expression:
        match values[-3]:
            case ast.Binary(Operator.EQ, ast.Name("Cdiscount"), discount) as query:
                # Storm writes C discount=0.9 without the space.
                values[-3] = ast.DiscountedReward(None, discount, span=query.span)
            case _:
                pass
        return self._measure(ast.RewardOperator, values)

    def total_reward(self, values: Values) -> Expression:
        """`C {states}`, in which the brace after C could also begin a bound on a cost."""
        values[-3] = self.total(values[-3:-2])
        return self._measure(ast.RewardOperator, values)

    def coalition(self, values: Values) -> Expression:
        """`<<players>> P>=p […]`, names or numbers; binding tells who they are."""
        word, measure = values
        coalition = self._players(word, word.value[2:-2])
        return _with_coalition(measure, coalition, self._span(values))

    def _players(self, word: Value, text: str) -> ast.Coalition:
        """The coalition with these names or numbers, which stand between brackets."""
        names = tuple(p.strip() for p in text.split(",")) if text.strip() else ()
        place = self._words([word])
        if not all(map(_PLAYER.fullmatch, names)) and names != ("*",):
            hint = "names or numbers, as in <<1,2>>; * for all"
            self._wrong("this is no coalition of players", place, "coalition", hint)
        return ast.Coalition(None if names == ("*",) else names, word.value[0] == "[", place)

    def objective(self, values: Values) -> Expression:
        *head, opening, operand, closing = values
        kind = ast.RewardOperator if len(head) > 1 else ast.ProbabilityOperator
        return self._measure(kind, [*head, None, None, opening, operand, None, closing])

    equilibrium_words = _of_words

    def equilibrium(self, values: Values) -> ast.Equilibrium:
        """`<<one:two>>{nash,social}max=? (P […] + R […])`."""
        word, words, direction, bound, _, *terms, closing = values
        players = [self._players(word, part) for part in word.value[2:-2].split(":")]
        kind = {w.value for w in words or ()}
        if not any(kind <= set(known) for known in _EQUILIBRIA):
            hint = "kinds are " + ", ".join(f"{{{','.join(known)}}}" for known in _EQUILIBRIA)
            self._wrong("there is no such equilibrium", self._words(words), "equilibrium", hint)
        objectives = terms[::2]
        if word.value[0] == "[" or len(objectives) != len(players):
            message = "the coalitions of an equilibrium stand in <<…>>"
            if word.value[0] != "[":
                found = f"{len(players)} in <<…>>, and {len(objectives)} in (…)"
                message = f"an equilibrium has an objective for each coalition; here are {found}"
            hint = "as in <<one:two>> max=? (P [ … ] + P [ … ])"
            self._wrong(message, self._words([word]), "equilibrium", hint)
        return ast.Equilibrium(
            tuple(
                replace(objective, direction=direction.value, coalition=coalition)
                for objective, coalition in zip(objectives, players, strict=False)
            ),
            bound,
            "corr" in kind,
            "fair" in kind,
            span=self._words([word, closing]),
        )

    time = partialmethod(_measure, ast.ExpectedTime)
    steady = partialmethod(_measure, ast.SteadyState)
    quantifier = _node(ast.PathQuantifier, 0, 2)

    def multi(self, values: Values) -> ast.MultiObjective:
        lexicographic = values[0].value == "multilex"
        return ast.MultiObjective(values[2], lexicographic, span=self._span(values))

    def structure(self, values: Values) -> Structure:
        opening, inner, closing = values
        name = inner.name if isinstance(inner, ast.LabelReference) else inner
        return Structure(name, opening.start_pos, closing.end_pos)

    cost_bounded = _node(ast.CostBoundedReward, 1)
    total = _node(ast.TotalReward)
    instantaneous = _node(ast.InstantaneousReward, 2)

    def ended(self, values: Values) -> ast.EndedReward:
        return ast.EndedReward(values[0].value == "Fc", values[1], span=self._span(values))

    long_run = _node(ast.SteadyStateReward)

    def cumulative(self, values: Values) -> ast.CumulativeReward:
        return ast.CumulativeReward(self.time_bound(values[1:]), span=self._span(values))

    def discounted(self, values: Values) -> ast.DiscountedReward:
        _, sign, limit, word, _, discount = values
        if word.value != "discount":
            hint = "write R=? [ C discount=0.9 ], or ']' before the next word"
            self._wrong(f"unexpected '{word.value}' after C", self._words([word]), "syntax", hint)
        bound = None if sign is None else self.time_bound([sign, limit])
        return ast.DiscountedReward(bound, discount, span=self._span(values))

    def sought(self, values: Values) -> tuple[Value, ...]:
        return tuple(values)

    def quantile(self, values: Values) -> ast.Quantile:
        _, _, (optimum, name), *others, _, formula, _ = values
        variable, span = name.value, self._words(values)
        if others:
            hint = "give the other bounds as constants, and vary them with -const"
            self._wrong("a quantile has one variable", span, "quantile", hint)
        path = formula.path if isinstance(formula, ast.ProbabilityOperator) else None
        if (
            not isinstance(path, ast.UnaryTemporal | ast.BinaryTemporal)
            or formula.bound is None
            or path.bound is None
        ):
            hint = 'such as quantile(min B, P>=0.9 [ F{"cost"}<=B "goal" ])'
            message = "a quantile is over P with a threshold and one path operator with a bound"
            self._wrong(message, span, "quantile", hint)
            return ast.Quantile(optimum.value, variable, formula, span=span)

        def limit(value: Expression | None) -> Expression | None:
            if isinstance(value, ast.Name) and value.name == variable:
                return ast.Parameter(0, ast.Type.INT, variable, span=value.span)
            return value

        def limits(part: Value) -> Value:
            return replace(part, lower=limit(part.lower), upper=limit(part.upper))

        bound: ast.PathBound
        if isinstance(path.bound, ast.RewardBounds):
            parts = tuple(map(limits, path.bound.parts))
            bound = replace(path.bound, parts=parts)
        else:
            bound = limits(path.bound)
            parts = (bound,)
        result = replace(formula, path=replace(path, bound=bound))
        proper = [
            p
            for p in parts
            if (isinstance(p.upper, ast.Parameter) and p.lower is None and not p.upper_strict)
            or (isinstance(p.lower, ast.Parameter) and p.upper is None)
        ]
        count = sum(isinstance(n, ast.Parameter) for n in nodes(bound))
        elsewhere = [n for n in nodes(result) if isinstance(n, ast.Name) and n.name == variable]
        if len(proper) != 1 or count != 1 or elsewhere:
            message = f"{variable} stands once, as <={variable}, >={variable} or >{variable}"
            self._wrong(message, span, "quantile", "other constants may have any expression")
        return ast.Quantile(optimum.value, variable, result, span=span)

    # -------------------------------------------------------------------------------------- filters

    def filter(self, values: Values) -> ast.Filter:
        _, _, word, _, formula, _, states, _ = values
        name: str = word.value
        operator = _FILTER_SIGNS.get(name) or next((f for f in FILTERS if f == name), None)
        span = self._words(values)
        if operator is None:
            from difflib import get_close_matches

            known = (*FILTERS, "values")
            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"the filters are {', '.join(known)}"
            position = Span(self.source, word.start_pos, word.end_pos)
            self._wrong(f"there is no filter '{name}'", position, "filter", hint)
        return ast.Filter(operator or "state", formula, states, span=span)

    def old_filter(self, values: Values) -> tuple[Expression, tuple[Value, ...]]:
        return values[1], tuple(v.value for v in values[4::3])


def _with_coalition(measure: Expression, coalition: ast.Coalition, span: Span) -> Expression:
    match measure:
        case ast.StateFilter(_, inner):
            return replace(
                measure, formula=_with_coalition(inner, coalition, inner.span), span=span
            )
        case ast.Measure():
            return replace(measure, coalition=coalition, span=span)
        case _:
            return measure


def _is_temporal(path: ast.PathFormula) -> bool:
    return any(isinstance(n, ast.UnaryTemporal | ast.BinaryTemporal) for n in nodes(path))


_UNARY_PATHS = {kind.symbol: kind for kind in (ast.Next, ast.Eventually, ast.Globally)}
_BINARY_PATHS = {kind.symbol: kind for kind in (ast.Until, ast.WeakUntil, ast.Release)}
_DECLARATIONS = frozenset({decl.Formula, decl.Label, decl.Observable})
"""The nodes whose expressions are complete, so that their depth is measured."""


# A name before a parenthesis on the same line is meant as a function, even if the two could be
# properties of their own.
_PLAYER = re.compile(r"\w+")
_EQUILIBRIA = tuple(product(("nash", "corr"), ("social", "fair")))
_LAST_WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*\Z")
_OPENING = re.compile(r"[ \t]*\(")
_LONGEST_WORD = 40


def comments_above(text: str, start: int) -> tuple[str, ...]:
    """The comment lines directly above the line of `start`, without their slashes.

    The first of them may stand behind other text.
    """
    comments: list[str] = []
    end = text.rfind("\n", 0, start)
    if text[end + 1 : start].strip():
        return ()
    while end >= 0:
        begin = text.rfind("\n", 0, end)
        before, slashes, comment = text[begin + 1 : end].partition("//")
        if not slashes:
            break
        comments.append(comment.strip())
        if before.strip():
            break
        end = begin
    return tuple(reversed(comments))
