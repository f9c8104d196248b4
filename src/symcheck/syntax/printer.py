"""Prints syntax trees as text: `parse(pretty(tree)) == tree` for models and properties."""

from __future__ import annotations

from fractions import Fraction
from typing import assert_never

from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import Tree
from symcheck.syntax.tree_builder import LONGEST_CHAIN

__all__ = ["pretty", "pretty_number"]

# How tightly an operator binds; its operands must bind as tightly or more.
_PATH, _TEMPORAL, _CONDITIONAL = -2, -1, 0
_ATOM = 100

Printable = Tree | decl.Program | decl.PropertiesFile | decl.Property | decl.Composition


def pretty(node: Printable) -> str:
    """The text of a syntax tree.

    Args:
        node: A model, a properties file, a property, an expression or a composition of modules.

    Returns:
        A text that parses to an equal tree. Comments are no part of a tree, so it has none.

    Example:
        >>> pretty(parse_expression("(a&b)|!c"))
        'a & b | !c'
    """
    match node:
        case decl.Program():
            return _program(node)
        case decl.PropertiesFile():
            return _properties(node)
        case decl.Property(name=name, formula=formula):
            return (f'"{name}": ' if name is not None else "") + _tree(formula, _CONDITIONAL)
        case (
            decl.ModuleReference()
            | decl.Parallel()
            | decl.Interleaving()
            | decl.Synchronised()
            | decl.Hiding()
            | decl.Renaming()
        ):
            return _composition(node, 0)
        case _:
            return _tree(node, _PATH)


# -------------------------------------------------------------------------------------- expressions


def pretty_number(value: Fraction) -> str:
    """The digits of a double that is exactly this fraction, or a quotient if no digits are."""
    numerator, denominator = value.as_integer_ratio()
    twos = (denominator & -denominator).bit_length() - 1
    rest, fives = denominator >> twos, 0
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    if rest != 1:
        return f"({numerator}.0/{denominator}.0)"
    places = max(twos, fives)
    digits = str(numerator * 10**places // denominator)
    if places > 20 or len(digits) > places + 20:
        stripped = digits.rstrip("0")
        return f"{stripped}e{len(digits) - len(stripped) - places}"
    if not places:
        return f"{digits}.0"
    digits = digits.rjust(places + 1, "0")
    return f"{digits[:-places]}.{digits[-places:]}"


def _tree(node: Tree, least: int) -> str:
    """The text of a node, in parentheses if it binds more loosely than `least`."""
    text, strength = _text(node)
    return text if strength >= least else f"({text})"


def _text(node: Tree) -> tuple[str, int]:
    """The text of a node and how tightly it binds."""
    match node:
        case ast.Binary():
            return _binary(node), node.operator.precedence
        case ast.Literal(value=value):
            return _literal(value)
        case ast.Name(name=name):
            return name, _ATOM
        case ast.LabelReference(name=name):
            return f'"{name}"', _ATOM
        case ast.Unary(operator=operator, operand=operand):
            return operator + _tree(operand, operator.precedence), operator.precedence
        case ast.Conditional(condition=condition, then=then, otherwise=otherwise):
            inner = _CONDITIONAL + 1
            return (
                f"{_tree(condition, inner)} ? {_tree(then, inner)}"
                f" : {_tree(otherwise, _CONDITIONAL)}",
                _CONDITIONAL,
            )
        case ast.Call(function=function, arguments=arguments):
            return f"{function}({_list(arguments)})", _ATOM
        case ast.MultiObjective(objectives=objectives):
            return f"multi({_list(objectives)})", _ATOM
        case ast.Filter(operator=operator, formula=formula, states=states):
            return (
                f"filter({operator}, {_list((formula,) if states is None else (formula, states))})",
                _ATOM,
            )
        case (
            ast.PathMeasure()
            | ast.RewardOperator()
            | ast.SteadyState()
            | ast.PathQuantifier()
            | ast.StateFilter()
        ):
            return _operator(node, ""), _ATOM
        case (
            ast.Next()
            | ast.Eventually()
            | ast.Globally()
            | ast.Until()
            | ast.WeakUntil()
            | ast.Release()
        ):
            return _path(node)
        case ast.Bound() | ast.TimeBound() | ast.RewardBound() | ast.RewardBounds():
            return _limit(node), _ATOM
        case (
            ast.CumulativeReward()
            | ast.TotalReward()
            | ast.InstantaneousReward()
            | ast.SteadyStateReward()
        ):
            return _query(node), _PATH
        case _:
            assert_never(node)


def _list(parts: tuple[Tree, ...]) -> str:
    return ", ".join(_tree(p, _CONDITIONAL) for p in parts)


def _literal(value: bool | int | Fraction) -> tuple[str, int]:
    if isinstance(value, bool):
        return ("true" if value else "false"), _ATOM
    if value < 0:
        return "-" + _literal(-value)[0], UnaryOperator.MINUS.precedence
    return (str(value) if isinstance(value, int) else pretty_number(value)), _ATOM


def _binary(node: ast.Binary) -> str:
    """A chain of operations of the same precedence, which is printed without recursion."""
    operator, strength = node.operator, node.operator.precedence
    if operator is Operator.IMPLIES:
        return _implications(node, strength)
    spine = [node]
    while isinstance(node.left, ast.Binary) and node.left.operator.precedence == strength:
        node = node.left
        spine.append(node)
    text = _tree(spine[-1].left, strength)
    length = 1
    for part in reversed(spine):
        # The parser balances longer chains of these; parentheses keep the tree as it is.
        if length >= LONGEST_CHAIN and operator.is_associative:
            text, length = f"({text})", 1
        space = (
            ""
            if strength >= Operator.EQ.precedence and strength != Operator.PLUS.precedence
            else " "
        )
        text += _glued(f"{space}{part.operator}", space + _tree(part.right, strength + 1))
        length += 1
    return text


def _implications(node: ast.Binary, strength: int) -> str:
    """The same for =>, which associates to the right."""
    parts: list[str] = []
    rest: Tree = node
    while isinstance(rest, ast.Binary) and rest.operator is Operator.IMPLIES:
        parts.append(_tree(rest.left, strength + 1))
        rest = rest.right
    return " => ".join((*parts, _tree(rest, strength)))


def _glued(operator: str, operand: str) -> str:
    """The two together, but `< -x` apart, as `<-` is a sign of its own."""
    return (
        f"{operator} {operand}"
        if operator.endswith("<") and operand.startswith("-")
        else operator + operand
    )


def _path(
    node: ast.Next | ast.Eventually | ast.Globally | ast.Until | ast.WeakUntil | ast.Release,
) -> tuple[str, int]:
    bound = "" if node.bound is None else _limit(node.bound)
    match node:
        case ast.Next() | ast.Eventually() | ast.Globally():
            sign = (
                "X"
                if isinstance(node, ast.Next)
                else "F"
                if isinstance(node, ast.Eventually)
                else "G"
            )
            return f"{sign}{bound} {_behind(bound, node.operand)}", _TEMPORAL
        case ast.Until() | ast.WeakUntil() | ast.Release():
            sign = (
                "U"
                if isinstance(node, ast.Until)
                else "W"
                if isinstance(node, ast.WeakUntil)
                else "R"
            )
            return (
                f"{_tree(node.left, _TEMPORAL)} {sign}{bound} {_behind(bound, node.right)}",
                _PATH,
            )
        case _:
            assert_never(node)


def _behind(bound: str, operand: Tree) -> str:
    """The operand of a temporal operator. A minus behind a bound would be read as a part of it."""
    text = _tree(operand, _TEMPORAL)
    return f"({text})" if bound and text.startswith("-") else text


def _limit(bound: ast.Bound | ast.PathBound) -> str:
    """A bound such as `<=k`. A limit other than a number or a name gets parentheses."""
    match bound:
        case ast.Bound(operator=operator, threshold=threshold):
            return _glued(operator, _tree(threshold, Operator.PLUS.precedence))
        case ast.RewardBound():
            return f"^{{{_count(bound)}}}"
        case ast.RewardBounds(parts=parts):
            return "^{" + ", ".join(map(_count, parts)) + "}"
        case ast.TimeBound(lower=lower, upper=None) if lower is not None:
            return (">" if bound.lower_strict else ">=") + _tree(lower, _ATOM)
        case ast.TimeBound(lower=None, upper=upper) if upper is not None:
            return ("<" if bound.upper_strict else "<=") + _tree(upper, _ATOM)
        case ast.TimeBound(lower=lower, upper=upper) if lower is not None and upper is not None:
            if lower == upper and not bound.lower_strict and not bound.upper_strict:
                return "=" + _tree(lower, _ATOM)
            return f"[{_tree(lower, _CONDITIONAL)},{_tree(upper, _CONDITIONAL)}]"
        case ast.TimeBound():
            return ""
        case _:
            assert_never(bound)


def _count(bound: ast.RewardBound) -> str:
    """`rew{"a"}<=k`, and `steps<=k`."""
    counted = "steps" if bound.structure is None else f"rew{_structure(bound.structure)}"
    return counted + _limit(
        ast.TimeBound(bound.lower, bound.lower_strict, bound.upper, bound.upper_strict)
    )


def _structure(structure: str | ast.Expression | None) -> str:
    if structure is None:
        return ""
    return (
        f'{{"{structure}"}}'
        if isinstance(structure, str)
        else f"{{{_tree(structure, _CONDITIONAL)}}}"
    )


def _query(query: ast.RewardQuery) -> str:
    match query:
        case ast.CumulativeReward(bound=bound):
            return "C" + _limit(bound)
        case ast.TotalReward():
            return "C"
        case ast.InstantaneousReward(time=time):
            return "I=" + _tree(time, _CONDITIONAL)
        case ast.SteadyStateReward():
            return "S"
        case _:
            return _tree(query, _PATH)


_Operator = ast.AnyMeasure | ast.PathQuantifier | ast.StateFilter


def _operator(node: _Operator, tail: str) -> str:
    """A state operator such as `P=? [ … ]`; `tail` is an old filter before the closing bracket."""
    match node:
        case ast.PathMeasure(direction=direction, bound=bound, path=path):
            return f"{node.letter}{direction or ''}{_asked(bound)} [ {_tree(path, _PATH)}{tail} ]"
        case ast.RewardOperator(structure=structure, direction=direction, bound=bound, query=query):
            head = f"R{_structure(structure)}{direction or ''}{_asked(bound)}"
            return f"{head} [ {_query(query)}{tail} ]"
        case ast.SteadyState(bound=bound, formula=formula, direction=direction):
            space = (
                " " if direction and (bound is not None or direction not in ("min", "max")) else ""
            )
            return (
                f"S{space}{direction or ''}{_asked(bound)} [ {_tree(formula, _CONDITIONAL)}{tail} ]"
            )
        case ast.PathQuantifier(quantifier=quantifier, path=path):
            return f"{quantifier} [ {_tree(path, _PATH)} ]"
        case ast.StateFilter(operators=operators, formula=formula, states=states):
            old = f" {{{_tree(states, _CONDITIONAL)}}}" + "".join(f"{{{o}}}" for o in operators)
            if isinstance(formula, ast.Measure):
                return _operator(formula, old)
            return _tree(formula, _ATOM)
        case _:
            assert_never(node)


def _asked(bound: ast.Bound | None) -> str:
    return "=?" if bound is None else _limit(bound)


# -------------------------------------------------------------------------------------------- files


def _program(program: decl.Program) -> str:
    blocks = [
        [program.type.value] if program.type else [],
        [_constant(c) for c in program.constants],
        [_formula(f) for f in program.formulas],
        ["global " + _variable(v) for v in program.globals],
        *([_module(m)] for m in program.modules),
        [_label(item) for item in program.labels],
        *([_rewards(r)] for r in program.rewards),
        [f"init\n  {_tree(program.initial, _CONDITIONAL)}\nendinit"]
        if program.initial is not None
        else [],
        [f"system\n  {_composition(program.system, 0)}\nendsystem"]
        if program.system is not None
        else [],
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block) + "\n"


def _properties(file: decl.PropertiesFile) -> str:
    blocks = [
        [_constant(c) for c in file.constants],
        [_formula(f) for f in file.formulas],
        [_label(item) for item in file.labels],
        [pretty(p) + ";" for p in file.properties],
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block) + "\n"


def _constant(constant: decl.Constant) -> str:
    value = "" if constant.value is None else f" = {_tree(constant.value, _CONDITIONAL)}"
    return f"const {constant.type.value} {constant.name}{value};"


def _formula(formula: decl.Formula) -> str:
    return f"formula {formula.name} = {_tree(formula.expression, _CONDITIONAL)};"


def _label(label: decl.Label) -> str:
    return f'label "{label.name}" = {_tree(label.expression, _CONDITIONAL)};'


def _variable(variable: decl.VariableDeclaration) -> str:
    if variable.low is not None and variable.high is not None:
        kind = f"[{_tree(variable.low, _CONDITIONAL)}..{_tree(variable.high, _CONDITIONAL)}]"
    else:
        kind = variable.type.value
    initial = "" if variable.initial is None else f" init {_tree(variable.initial, _CONDITIONAL)}"
    return f"{variable.name} : {kind}{initial};"


def _module(module: decl.Module | decl.RenamedModule) -> str:
    match module:
        case decl.Module(name=name, variables=variables, commands=commands):
            parts = [
                [f"  {_variable(v)}" for v in variables],
                [f"  {_command(c)}" for c in commands],
            ]
            body = "\n\n".join("\n".join(part) for part in parts if part)
            return f"module {name}\n{body}\nendmodule"
        case decl.RenamedModule(name=name, base=base, renaming=renaming):
            pairs = ", ".join(f"{old}={new}" for old, new in renaming)
            return f"module {name} = {base} [ {pairs} ] endmodule"
        case _:
            assert_never(module)


def _command(command: decl.Command) -> str:
    guard = _tree(command.guard, _CONDITIONAL)
    return f"[{command.action or ''}] {guard} -> {' + '.join(map(_update, command.updates))};"


def _update(update: decl.Update) -> str:
    assignments = (
        " & ".join(
            f"({a.variable}'={_tree(a.expression, _CONDITIONAL)})" for a in update.assignments
        )
        or "true"
    )
    return (
        assignments
        if update.probability is None
        else f"{_tree(update.probability, _CONDITIONAL)} : {assignments}"
    )


def _rewards(rewards: decl.RewardStructure) -> str:
    title = "rewards" if rewards.name is None else f'rewards "{rewards.name}"'
    lines = []
    for item in rewards.items:
        action = "" if item.action is False else f"[{item.action or ''}] "
        lines.append(
            f"  {action}{_tree(item.guard, _CONDITIONAL)} : {_tree(item.value, _CONDITIONAL)};"
        )
    return "\n".join([title, *lines, "endrewards"])


def _composition(node: decl.Composition, least: int) -> str:
    """A composition of modules, in parentheses if it binds more loosely than `least`.

    `least` is 0 at the outside, 1 in `||`, 2 in `|||`, 3 in `|[…]|` and 4 before `/` and `{`.
    """
    match node:
        case decl.ModuleReference(name=name):
            return name
        case decl.Parallel(operands=operands):
            text, strength = " || ".join(_composition(o, 1) for o in operands), 0
        case decl.Interleaving(operands=operands):
            text, strength = " ||| ".join(_composition(o, 2) for o in operands), 1
        case decl.Synchronised(left=left, right=right, actions=actions):
            text, strength = (
                f"{_composition(left, 2)} |[{', '.join(actions)}]| {_composition(right, 3)}",
                2,
            )
        case decl.Hiding(operand=operand, actions=actions):
            text, strength = f"{_composition(operand, 3)} / {{{', '.join(actions)}}}", 3
        case decl.Renaming(operand=operand, pairs=pairs):
            text, strength = (
                f"{_composition(operand, 3)} {{{', '.join(f'{a} <- {b}' for a, b in pairs)}}}",
                3,
            )
        case _:
            assert_never(node)
    return text if strength >= least else f"({text})"
