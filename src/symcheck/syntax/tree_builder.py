"""Makes syntax trees: one method for every action of the grammars, f(values, start, end), so they need no docstrings.

`values` holds what the rule keeps: nodes, and the characters of words. `start` and `end` are character offsets.
"""

# ruff: noqa: D102
from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from typing import Any, cast

from symcheck.errors import Diagnostic, Source, Span
from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.ast import Expression

__all__ = ["FUNCTIONS", "LONGEST_CHAIN", "Builder", "ModelBuilder", "PropertiesBuilder"]

FUNCTIONS = ("min", "max", "floor", "ceil", "round", "pow", "mod", "log")

FILTERS = (
    "min",
    "max",
    "sum",
    "avg",
    "count",
    "range",
    "forall",
    "exists",
    "first",
    "state",
    "argmin",
    "argmax",
    "print",
    "printall",
)
_FILTER_SIGNS = {"+": "sum", "&": "forall", "|": "exists"}

LONGEST_CHAIN = 64
"""Longer chains of one of & | + * are balanced, as those are associative: generated labels with thousands of disjuncts would
otherwise nest as deep as they are long."""

_LARGEST_INT = 2**63 - 1
_LARGEST_DOUBLE = Fraction(1.7976931348623157e308)
_MOST_DIGITS = 4000
_LARGEST_EXPONENT = 5000

Values = list[Any]


class Builder:
    """Expressions, constants, formulas and labels. `diagnostics` gathers what the grammar cannot tell."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.diagnostics: list[Diagnostic] = []
        # The last node that was balanced: it nests no deeper than the one before it.
        self.balanced: ast.Binary | None = None
        # By id of the last node of an operator chain: its first offset, and its parts (length, tree).
        self._chains: dict[int, tuple[Expression, list[tuple[int, Expression]]]] = {}

    def _span(self, start: int, end: int) -> Span:
        return Span(self.source, start, end)

    def _wrong(
        self, message: str, start: int, end: int, code: str, hint: str | None = None
    ) -> None:
        self.diagnostics.append(Diagnostic(message, Span(self.source, start, end), code, hint))

    # -------------------------------------------------------------------------------------------- expressions

    def integer(self, values: Values, start: int, end: int) -> ast.Literal:
        digits: str = values[0]
        span = Span(self.source, start, end)
        if len(digits) > 1 and digits[0] == "0":
            return self.real(values, start, end)
        if len(digits) > 19 or int(digits) > _LARGEST_INT:
            hint = f"integers end at {_LARGEST_INT}; a double may be larger, such as 1e20"
            self._wrong("this integer is too large", start, end, "number", hint)
            return ast.Literal(0, ast.Type.INT, span=span)
        return ast.Literal(int(digits), ast.Type.INT, span=span)

    def real(self, values: Values, start: int, end: int) -> ast.Literal:
        span = Span(self.source, start, end)
        mantissa, _, exponent = values[0].lower().partition("e")
        value: Fraction | None = None
        if len(mantissa) <= _MOST_DIGITS and len(exponent) <= _MOST_DIGITS:
            power = int(exponent or "0")
            if not mantissa.strip("0."):
                value = Fraction(0)
            elif abs(power) <= _LARGEST_EXPONENT:
                value = Fraction(mantissa) * Fraction(10) ** power
        if value is None or value > _LARGEST_DOUBLE:
            self._wrong(
                "this number is out of range",
                start,
                end,
                "number",
                "doubles reach from about 1e-308 to 1.8e308",
            )
            value = Fraction(0)
        return ast.Literal(value, ast.Type.DOUBLE, span=span)

    def truth(self, values: Values, start: int, end: int) -> ast.Literal:
        return ast.Literal(values[0] == "true", ast.Type.BOOL, span=Span(self.source, start, end))

    def name(self, values: Values, start: int, end: int) -> ast.Name:
        return ast.Name(values[0], span=Span(self.source, start, end))

    def unary(self, values: Values, start: int, end: int) -> ast.Unary:
        return ast.Unary(values[0], values[1], span=Span(self.source, start, end))

    def binary(self, values: Values, start: int, end: int) -> ast.Binary:
        left, operator, right = values
        node = ast.Binary(operator, left, right, span=Span(self.source, start, end))
        return self._chained(node, start) if operator in "&|+*" else node

    def _chained(self, node: ast.Binary, start: int) -> ast.Binary:
        """Keep count of a chain `a op b op …`, and balance it where it gets long: as equal halves of halves, oldest first."""
        left = node.left
        last, parts = self._chains.pop(id(left), (None, []))
        unbroken = (
            last is left
            and isinstance(left, ast.Binary)
            and left.operator == node.operator
            and left.span.start == start
        )
        if not unbroken:
            parts = [(1, left)]
        if len(parts) == 1 and parts[0][0] < LONGEST_CHAIN:
            parts = [(parts[0][0] + 1, node)]
        else:
            parts.append((1, node.right))
            while len(parts) > 1 and parts[-2][0] <= parts[-1][0]:
                (m, a), (n, b) = parts[-2:]
                parts[-2:] = [(m + n, ast.Binary(node.operator, a, b, span=a.span | b.span))]
            tree = parts[0][1]
            for _, part in parts[1:]:
                tree = ast.Binary(node.operator, tree, part, span=tree.span | part.span)
            node = self.balanced = replace(cast(ast.Binary, tree), span=node.span)
        self._chains[id(node)] = (node, parts)
        return node

    def conditional(self, values: Values, start: int, end: int) -> ast.Conditional:
        return ast.Conditional(*values, span=Span(self.source, start, end))

    def call(self, values: Values, start: int, end: int) -> ast.Call:
        function = values[0]
        if function not in FUNCTIONS:
            self._wrong(
                f"there is no function '{function}'",
                start,
                end,
                "function",
                f"the functions are {', '.join(FUNCTIONS)}",
            )
        return ast.Call(function, tuple(values[1:]), span=Span(self.source, start, end))

    # -------------------------------------------------------------------------------------------- constants, formulas, labels

    def constant(self, values: Values, start: int, end: int) -> decl.Constant:
        type_, name, value = values
        kind = ast.Type.DOUBLE if type_ in ("rate", "prob") else ast.Type(type_ or "int")
        return decl.Constant(name, kind, value, span=Span(self.source, start, end))

    def formula(self, values: Values, start: int, end: int) -> decl.Formula:
        return decl.Formula(values[0], values[1], span=Span(self.source, start, end))

    def label(self, values: Values, start: int, end: int) -> decl.Label:
        return decl.Label(_unquoted(values[0]), values[1], span=Span(self.source, start, end))


class ModelBuilder(Builder):
    """The actions of prism.lark."""

    def model_type(self, values: Values, start: int, end: int) -> tuple[ast.ModelType, Span]:
        return _MODEL_TYPES[values[0]], Span(self.source, start, end)

    def program(self, values: Values, start: int, end: int) -> decl.Program:
        def those(kind: Any) -> tuple[Any, ...]:
            return tuple(v for v in values if isinstance(v, kind))

        tagged = [v for v in values if isinstance(v, tuple)]
        return decl.Program(
            self._single([v for v in tagged if isinstance(v[0], ast.ModelType)], "model type"),
            constants=those(decl.Constant),
            formulas=those(decl.Formula),
            labels=those(decl.Label),
            globals=those(decl.VariableDeclaration),
            modules=those(decl.Module | decl.RenamedModule),
            rewards=those(decl.RewardStructure),
            initial=self._single([v[1:] for v in tagged if v[0] == "init"], "init … endinit"),
            system=self._single([v[1:] for v in tagged if v[0] == "system"], "system … endsystem"),
            span=Span(self.source, start, end),
        )

    def _single(self, found: list[tuple[Any, Span]], what: str) -> Any:
        for _, span in found[1:]:
            self._wrong(
                f"a second {what}",
                span.start,
                span.end,
                "repeated",
                f"a model has one {what} at most",
            )
        return found[0][0] if found else None

    def initial(self, values: Values, start: int, end: int) -> tuple[str, Expression, Span]:
        return "init", values[0], Span(self.source, start, end)

    def system(self, values: Values, start: int, end: int) -> tuple[str, decl.Composition, Span]:
        return "system", values[0], Span(self.source, start, end)

    # -------------------------------------------------------------------------------------------- modules

    def ranged(self, values: Values, start: int, end: int) -> decl.VariableDeclaration:
        name, low, high, initial = values
        return decl.VariableDeclaration(
            name, ast.Type.INT, low, high, initial, span=Span(self.source, start, end)
        )

    def unranged(self, values: Values, start: int, end: int) -> decl.VariableDeclaration:
        name, type_, initial = values
        return decl.VariableDeclaration(
            name, ast.Type(type_), None, None, initial, span=Span(self.source, start, end)
        )

    def global_variable(self, values: Values, _start: int, _end: int) -> decl.VariableDeclaration:
        return cast(decl.VariableDeclaration, values[0])

    def module(self, values: Values, start: int, end: int) -> decl.Module:
        name, *parts = values
        variables = tuple(p for p in parts if isinstance(p, decl.VariableDeclaration))
        return decl.Module(
            name, variables, tuple(parts[len(variables) :]), span=Span(self.source, start, end)
        )

    def command(self, values: Values, start: int, end: int) -> decl.Command:
        action, guard, *updates = values
        return decl.Command(action, guard, tuple(updates), span=Span(self.source, start, end))

    def certain(self, values: Values, start: int, end: int) -> decl.Update:
        return decl.Update(None, tuple(values), span=Span(self.source, start, end))

    def update(self, values: Values, start: int, end: int) -> decl.Update:
        return decl.Update(values[0], tuple(values[1:]), span=Span(self.source, start, end))

    def assignment(self, values: Values, start: int, end: int) -> decl.Assignment:
        return decl.Assignment(values[0], values[1], span=Span(self.source, start, end))

    def renamed_module(self, values: Values, start: int, end: int) -> decl.RenamedModule:
        name, base, *pairs = values
        return decl.RenamedModule(name, base, tuple(pairs), span=Span(self.source, start, end))

    def rename(self, values: Values, _start: int, _end: int) -> tuple[str, str]:
        return values[0], values[1]

    # -------------------------------------------------------------------------------------------- rewards

    def rewards(self, values: Values, start: int, end: int) -> decl.RewardStructure:
        name, *items = values
        return decl.RewardStructure(
            name and _unquoted(name), tuple(items), span=Span(self.source, start, end)
        )

    def state_reward(self, values: Values, start: int, end: int) -> decl.RewardItem:
        return decl.RewardItem(False, values[0], values[1], span=Span(self.source, start, end))

    def transition_reward(self, values: Values, start: int, end: int) -> decl.RewardItem:
        return decl.RewardItem(values[0], values[1], values[2], span=Span(self.source, start, end))

    # -------------------------------------------------------------------------------------------- composition

    def parallel(self, values: Values, start: int, end: int) -> decl.Parallel:
        return decl.Parallel(tuple(values), span=Span(self.source, start, end))

    def interleaving(self, values: Values, start: int, end: int) -> decl.Interleaving:
        return decl.Interleaving(tuple(values), span=Span(self.source, start, end))

    def synchronised(self, values: Values, start: int, end: int) -> decl.Synchronised:
        return decl.Synchronised(
            values[0], values[-1], tuple(values[1:-1]), span=Span(self.source, start, end)
        )

    def hiding(self, values: Values, start: int, end: int) -> decl.Hiding:
        return decl.Hiding(values[0], tuple(values[1:]), span=Span(self.source, start, end))

    def renaming(self, values: Values, start: int, end: int) -> decl.Renaming:
        return decl.Renaming(values[0], tuple(values[1:]), span=Span(self.source, start, end))

    def action_pair(self, values: Values, _start: int, _end: int) -> tuple[str, str]:
        return values[0], values[1]

    def module_reference(self, values: Values, start: int, end: int) -> decl.ModuleReference:
        return decl.ModuleReference(values[0], span=Span(self.source, start, end))


class PropertiesBuilder(Builder):
    """The actions of properties.lark."""

    def properties(self, values: Values, start: int, end: int) -> decl.PropertiesFile:
        def those(kind: Any) -> tuple[Any, ...]:
            return tuple(v for v in values if isinstance(v, kind))

        span = Span(self.source, start, end)
        return decl.PropertiesFile(
            those(decl.Constant),
            those(decl.Formula),
            those(decl.Label),
            those(decl.Property),
            span=span,
        )

    def property(self, values: Values, start: int, end: int) -> decl.Property:
        name, formula = values
        called = _CALLED.search(self.source.text, start, min(end + 40, len(self.source.text)))
        if called and called.end(1) == end:
            hint = f"the functions are {', '.join(FUNCTIONS)}"
            self._wrong(
                f"there is no function '{called[1]}'", called.start(1), end, "function", hint
            )
        return decl.Property(
            name and _unquoted(name),
            formula,
            comments_above(self.source.text, start),
            span=Span(self.source, start, end),
        )

    def reference(self, values: Values, start: int, end: int) -> ast.LabelReference:
        return ast.LabelReference(_unquoted(values[0]), span=Span(self.source, start, end))

    # -------------------------------------------------------------------------------------------- paths

    def unary_path(self, values: Values, start: int, end: int) -> ast.PathFormula:
        operator, bound, operand = values
        return cast(
            ast.PathFormula,
            _UNARY_PATHS[operator](operand, bound, span=Span(self.source, start, end)),
        )

    def binary_path(self, values: Values, start: int, end: int) -> ast.PathFormula:
        left, operator, bound, right = values
        return cast(
            ast.PathFormula,
            _BINARY_PATHS[operator](left, right, bound, span=Span(self.source, start, end)),
        )

    def time_bound(self, values: Values, start: int, end: int) -> ast.TimeBound:
        operator, limit = values
        span = Span(self.source, start, end)
        if operator == "=":
            return ast.TimeBound(limit, False, limit, False, span=span)
        if operator in ("<", "<="):
            return ast.TimeBound(upper=limit, upper_strict=operator == "<", span=span)
        return ast.TimeBound(lower=limit, lower_strict=operator == ">", span=span)

    def time_interval(self, values: Values, start: int, end: int) -> ast.TimeBound:
        return ast.TimeBound(lower=values[0], upper=values[1], span=Span(self.source, start, end))

    def reward_bound(
        self, values: Values, start: int, end: int
    ) -> ast.RewardBound | ast.RewardBounds:
        return (
            values[0]
            if len(values) == 1
            else ast.RewardBounds(tuple(values), span=Span(self.source, start, end))
        )

    def count(self, values: Values, start: int, end: int) -> ast.RewardBound:
        word, structure, extent = values
        if word != ("steps" if structure is None else "rew"):
            hint = 'a bound on a reward is written ^{rew{"name"}<=k}, one on steps ^{steps<=k}'
            self._wrong(f"'{word}' is no kind of bound", start, end, "bound", hint)
        return self.plain_count([structure, extent], start, end)

    def plain_count(self, values: Values, start: int, end: int) -> ast.RewardBound:
        structure, extent = values
        return ast.RewardBound(
            structure,
            extent.lower,
            extent.lower_strict,
            extent.upper,
            extent.upper_strict,
            span=Span(self.source, start, end),
        )

    # -------------------------------------------------------------------------------------------- operators on states

    def value(self, _values: Values, _start: int, _end: int) -> None:
        return None

    def threshold(self, values: Values, start: int, end: int) -> ast.Bound:
        return ast.Bound(values[0], values[1], span=Span(self.source, start, end))

    def direction(self, values: Values, _start: int, _end: int) -> str:
        return cast(str, values[0])

    def glued(self, values: Values, _start: int, _end: int) -> str:
        return cast(str, values[0][1:])

    def probability(self, values: Values, start: int, end: int) -> Expression:
        direction, bound, path, old = values
        return self._filtered(
            ast.ProbabilityOperator(direction, bound, path, span=Span(self.source, start, end)), old
        )

    def reward(self, values: Values, start: int, end: int) -> Expression:
        structure, direction, bound, query, old = values
        return self._filtered(
            ast.RewardOperator(
                structure, direction, bound, query, span=Span(self.source, start, end)
            ),
            old,
        )

    def reward_of_first(self, values: Values, start: int, end: int) -> Expression:
        return self.reward([None, *values], start, end)

    def steady(self, values: Values, start: int, end: int) -> Expression:
        direction, bound, formula, old = values
        return self._filtered(
            ast.SteadyState(bound, formula, direction, span=Span(self.source, start, end)), old
        )

    def steady_glued(self, values: Values, start: int, end: int) -> Expression:
        return self.steady(
            [values[0].removeprefix("S").removeprefix("LRA") or None, *values[1:]], start, end
        )

    def quantifier(self, values: Values, start: int, end: int) -> ast.PathQuantifier:
        return ast.PathQuantifier(values[0], values[1], span=Span(self.source, start, end))

    def multi(self, values: Values, start: int, end: int) -> ast.MultiObjective:
        return ast.MultiObjective(tuple(values[1:]), span=Span(self.source, start, end))

    def structure_name(self, values: Values, _start: int, _end: int) -> str:
        return _unquoted(values[0])

    def structure_index(self, values: Values, _start: int, _end: int) -> Expression:
        return cast(Expression, values[0])

    def total(self, _values: Values, start: int, end: int) -> ast.TotalReward:
        return ast.TotalReward(span=Span(self.source, start, end))

    def cumulative(self, values: Values, start: int, end: int) -> ast.CumulativeReward:
        bound = ast.TimeBound(upper=values[0], span=Span(self.source, start + 1, end))
        return ast.CumulativeReward(bound, span=Span(self.source, start, end))

    def instantaneous(self, values: Values, start: int, end: int) -> ast.InstantaneousReward:
        return ast.InstantaneousReward(values[0], span=Span(self.source, start, end))

    def long_run(self, _values: Values, start: int, end: int) -> ast.SteadyStateReward:
        return ast.SteadyStateReward(span=Span(self.source, start, end))

    # -------------------------------------------------------------------------------------------- filters

    def filter(self, values: Values, start: int, end: int) -> ast.Filter:
        word: str
        word, formula, states = values
        operator = _FILTER_SIGNS.get(word, word)
        if operator not in FILTERS:
            self._wrong(
                f"there is no filter '{word}'",
                start,
                end,
                "filter",
                f"the filters are {', '.join(FILTERS)}",
            )
        return ast.Filter(operator, formula, states, span=Span(self.source, start, end))

    def old_filter(
        self, values: Values, _start: int, _end: int
    ) -> tuple[Expression, tuple[Any, ...]]:
        return values[0], tuple(values[1:])

    def _filtered(
        self, formula: Expression, old: tuple[Expression, tuple[Any, ...]] | None
    ) -> Expression:
        return (
            formula if old is None else ast.StateFilter(old[1], formula, old[0], span=formula.span)
        )


_MODEL_TYPES = {
    "dtmc": ast.ModelType.DTMC,
    "probabilistic": ast.ModelType.DTMC,
    "ctmc": ast.ModelType.CTMC,
    "stochastic": ast.ModelType.CTMC,
    "mdp": ast.ModelType.MDP,
    "nondeterministic": ast.ModelType.MDP,
}
_UNARY_PATHS: dict[str, Any] = {"X": ast.Next, "F": ast.Eventually, "G": ast.Globally}
_BINARY_PATHS: dict[str, Any] = {"U": ast.Until, "W": ast.WeakUntil, "R": ast.Release}


# A name before a parenthesis on the same line is meant as a function, though it could be two properties.
_CALLED = re.compile(r"([A-Za-z_][A-Za-z_0-9]*)[ \t]*\(")


def _unquoted(word: str) -> str:
    return word[1:-1].strip()


def comments_above(text: str, start: int) -> tuple[str, ...]:
    """The comment lines directly above the line of `start`, without their slashes; the first may stand behind other text."""
    lines = text[:start].split("\n")
    found: list[str] = []
    if lines.pop().strip():
        return ()
    while lines:
        before, slashes, comment = lines.pop().partition("//")
        if not slashes:
            break
        found.append(comment.strip())
        if before.strip():
            break
    return tuple(reversed(found))
