"""Prints syntax trees as text: `parse(pretty(tree)) == tree` for models and properties."""

from __future__ import annotations

from collections.abc import Iterable
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
# Among compositions, whose operands are compositions.
_PARALLEL, _INTERLEAVING, _SYNCHRONISED, _RELABELLED = -4, -3, -2, -1

Printable = Tree | decl.Program | decl.PropertiesFile | decl.Property


def pretty(node: Printable) -> str:
    """The text of a syntax tree.

    Args:
        node: A model, a properties file, a property, an expression or a composition of modules.

    Returns:
        A text that parses to an equal tree. Comments are no part of a tree, so it has none.

    Examples:
        >>> from symcheck.syntax.parse import parse_expression
        >>> pretty(parse_expression("(a&b)|!c"))
        'a & b | !c'
    """
    match node:
        case decl.Program():
            return _program(node)
        case decl.PropertiesFile():
            return _properties(node)
        case decl.Property(name, formula):
            return (f'"{name}": ' if name is not None else "") + _tree(formula)
        case _:
            return _tree(node, _PARALLEL)


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
    decimals = max(twos, fives)
    digits = str(numerator * 10**decimals // denominator)
    if decimals > 20 or len(digits) > decimals + 20:
        stripped = digits.rstrip("0")
        return f"{stripped}e{len(digits) - len(stripped) - decimals}"
    if not decimals:
        return f"{digits}.0"
    digits = digits.rjust(decimals + 1, "0")
    return f"{digits[:-decimals]}.{digits[-decimals:]}"


def _tree(node: Tree, least: int = _CONDITIONAL) -> str:
    """The text of a node, in parentheses if it binds more loosely than `least`."""
    text, strength = _text(node)
    return text if strength >= least else f"({text})"


def _text(node: Tree) -> tuple[str, int]:
    """The text of a node and how tightly it binds."""
    match node:
        case ast.Binary():
            return _binary(node), node.operator.precedence
        case ast.Parameter(name=name):
            return name, _ATOM
        case ast.Literal(value):
            return _literal(value)
        case ast.Name(name) | decl.ModuleReference(name):
            return name, _ATOM
        case ast.LabelReference(name):
            return f'"{name}"', _ATOM
        case ast.Unary(operator, operand):
            return operator + _tree(operand, operator.precedence), operator.precedence
        case ast.Conditional(condition, then, otherwise):
            inner = _CONDITIONAL + 1
            branches = f"{_tree(then, inner)} : {_tree(otherwise)}"
            return f"{_tree(condition, inner)} ? {branches}", _CONDITIONAL
        case ast.Call(function, arguments):
            return f"{function}({_list(*arguments)})", _ATOM
        case ast.MultiObjective(objectives, lexicographic):
            return f"multi{'lex' * lexicographic}({_list(*objectives)})", _ATOM
        case ast.Equilibrium():
            return _equilibrium(node), _ATOM
        case ast.Filter(operator, formula, states):
            return f"filter({operator}, {_list(formula, states)})", _ATOM
        case ast.Quantile(optimum, variable, formula):
            return f"quantile({optimum} {variable}, {_tree(formula)})", _ATOM
        case ast.PathQuantifier(quantifier, path):
            return f"{quantifier} [ {_tree(path, _PATH)} ]", _ATOM
        case ast.StateFilter(operators, formula, states):
            if not isinstance(formula, ast.Measure):
                return _tree(formula, _ATOM), _ATOM
            old = "".join(f"{{{part}}}" for part in (_tree(states), *operators))
            return _measure(formula, f" {old}"), _ATOM
        case ast.Measure():
            return _measure(node), _ATOM
        case ast.UnaryTemporal(operand, bound):
            return f"{node.symbol}{_limit(bound)} {_behind(bound, operand)}", _TEMPORAL
        case ast.BinaryTemporal(left, right, bound):
            sign = node.symbol + _limit(bound)
            return f"{_tree(left, _TEMPORAL)} {sign} {_behind(bound, right)}", _PATH
        case ast.Bound() | ast.TimeBound() | ast.RewardBound() | ast.RewardBounds():
            return _limit(node), _ATOM
        case ast.CumulativeReward(bound) | ast.CostBoundedReward(bound):
            return f"C{_limit(bound)}", _PATH
        case ast.DiscountedReward(bound, discount):
            return f"C{_limit(bound)} discount={_tree(discount)}", _PATH
        case ast.TotalReward():
            return "C", _PATH
        case ast.InstantaneousReward(time):
            return f"I={_tree(time)}", _PATH
        case ast.SteadyStateReward():
            return "S", _PATH
        case ast.EndedReward(kept, target):
            return f"{'Fc' if kept else 'F0'} ({_tree(target)})", _PATH
        case decl.Parallel(operands):
            return " || ".join(_tree(o, _INTERLEAVING) for o in operands), _PARALLEL
        case decl.Interleaving(operands):
            return " ||| ".join(_tree(o, _SYNCHRONISED) for o in operands), _INTERLEAVING
        case decl.Synchronised(one, other, actions):
            sign = f"|[{', '.join(actions)}]|"
            return f"{_tree(one, _SYNCHRONISED)} {sign} {_tree(other, _RELABELLED)}", _SYNCHRONISED
        case decl.Hiding(process, actions):
            return f"{_tree(process, _RELABELLED)} / {{{', '.join(actions)}}}", _RELABELLED
        case decl.Renaming(process, pairs):
            renamed = ", ".join(f"{old} <- {new}" for old, new in pairs)
            return f"{_tree(process, _RELABELLED)} {{{renamed}}}", _RELABELLED
        case _:
            assert_never(node)


def _list(*parts: Tree | None) -> str:
    return ", ".join(_tree(p) for p in parts if p is not None)


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
        is_tight = strength >= Operator.EQ.precedence and strength != Operator.PLUS.precedence
        space = "" if is_tight else " "
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
    """The two together, but `< -x` apart, as PRISM reads `<-` as one sign."""
    is_sign = operator.endswith("<") and operand.startswith("-")
    return f"{operator} {operand}" if is_sign else operator + operand


def _behind(bound: ast.PathBound | None, operand: Tree) -> str:
    """The operand of a temporal operator. A minus behind a bound would be read as a part of it."""
    text = _tree(operand, _TEMPORAL)
    return f"({text})" if _limit(bound) and text.startswith("-") else text


def _limit(bound: ast.Bound | ast.PathBound | None) -> str:
    """A bound such as `<=k`. A limit other than a number or a name gets parentheses."""
    match bound:
        case None:
            return ""
        case ast.Bound(operator, threshold):
            return _glued(operator, _tree(threshold, Operator.PLUS.precedence))
        case ast.RewardBounds(parts):
            return "^{" + ", ".join(map(_count, parts)) + "}"
        case ast.RewardBound():
            return f"^{{{_count(bound)}}}"
        case ast.TimeBound():
            return _extent(bound)
        case _:
            assert_never(bound)


def _extent(limits: ast.Limits) -> str:
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None:
        if lower == upper and not limits.lower_strict and not limits.upper_strict:
            return "=" + _tree(lower, _ATOM)
        return f"[{_tree(lower)},{_tree(upper)}]"
    if lower is not None:
        return (">" if limits.lower_strict else ">=") + _tree(lower, _ATOM)
    if upper is not None:
        return ("<" if limits.upper_strict else "<=") + _tree(upper, _ATOM)
    return ""


def _count(bound: ast.RewardBound) -> str:
    """`rew{"a"}<=k`, and `steps<=k`."""
    counted = "steps" if bound.structure is None else f"rew{_structure(bound.structure)}"
    return counted + _extent(bound)


def _structure(structure: str | ast.Expression | None) -> str:
    if structure is None:
        return ""
    name = f'"{structure}"' if isinstance(structure, str) else _tree(structure)
    return f"{{{name}}}"


def _measure(node: ast.AnyMeasure, tail: str = "", *, is_objective: bool = False) -> str:
    """An operator such as `P=? [ … ]`; `tail` is an old filter before the closing bracket.

    is_objective: of an equilibrium, which has the coalition and the direction.
    """
    head = node.letter
    match node:
        case ast.PathMeasure(path=operand):
            text = _tree(operand, _PATH)
        case ast.ConditionalProbability(path=path, condition=condition):
            text = f"{_tree(path, _PATH)} || {_tree(condition, _PATH)}"
        case ast.RewardOperator(structure=structure, query=query):
            head, text = head + _structure(structure), _tree(query, _PATH)
        case ast.SteadyState(formula=formula):
            text = _tree(formula)
            if node.direction and (node.bound or node.direction not in ("min", "max")):
                head += " "  # only Smin=? and Smax=? are read as one word
        case _:
            assert_never(node)
    if is_objective:
        return f"{head} [ {text} ]"
    comparison = "=?" if node.bound is None else _limit(node.bound)
    if node.coalition is not None:
        names = _players(node.coalition)
        head = (f"[[{names}]] " if node.coalition.against else f"<<{names}>> ") + head
    return f"{head}{node.direction or ''}{comparison} [ {text}{tail} ]"


def _players(coalition: ast.Coalition) -> str:
    return "*" if coalition.players is None else ",".join(coalition.players)


def _equilibrium(node: ast.Equilibrium) -> str:
    """An operator such as `<<one:two>> max=? (P [ … ] + P [ … ])`."""
    players = ":".join(map(_players, node.coalitions))
    kind = ("corr" if node.correlated else "nash") + "," + ("fair" if node.fair else "social")
    direction = node.objectives[0].direction
    comparison = "=?" if node.bound is None else _limit(node.bound)
    gains = " + ".join(_measure(o, is_objective=True) for o in node.objectives)
    return f"<<{players}>>{{{kind}}} {direction}{comparison} ({gains})"


# -------------------------------------------------------------------------------------------- files


def _joined(*blocks: Iterable[str]) -> str:
    """Blocks of lines, with an empty line between those that are not empty."""
    return "\n\n".join(filter(None, map("\n".join, blocks)))


def _program(program: decl.Program) -> str:
    initial, system = program.initial, program.system
    text = _joined(
        [program.type.value] if program.type else [],
        map(_constant, program.constants),
        map(_formula, program.formulas),
        ["global " + _variable(v) for v in program.globals],
        *([_module(m)] for m in program.modules),
        map(_player, program.players),
        map(_label, program.labels),
        map(_observable, program.observables),
        *([_rewards(r)] for r in program.rewards),
        [] if initial is None else [f"init\n  {_tree(initial)}\nendinit"],
        [] if system is None else [f"system\n  {_tree(system, _PARALLEL)}\nendsystem"],
    )
    return text + "\n"


def _properties(file: decl.PropertiesFile) -> str:
    text = _joined(
        map(_constant, file.constants),
        map(_formula, file.formulas),
        map(_label, file.labels),
        [pretty(p) + ";" for p in file.properties],
    )
    return text + "\n"


def _constant(constant: decl.Constant) -> str:
    value = "" if constant.value is None else f" = {_tree(constant.value)}"
    return f"const {constant.type.value} {constant.name}{value};"


def _formula(formula: decl.Formula) -> str:
    return f"formula {formula.name} = {_tree(formula.expression)};"


def _observable(observable: decl.Observable) -> str:
    text = _tree(observable.expression)
    if observable.name is None:
        return f"observables {text} endobservables"
    return f'observable "{observable.name}" = {text};'


def _label(label: decl.Label) -> str:
    return f'label "{label.name}" = {_tree(label.expression)};'


def _variable(variable: decl.VariableDeclaration) -> str:
    if variable.low is not None and variable.high is not None:
        kind = f"[{_tree(variable.low)}..{_tree(variable.high)}]"
    else:
        kind = "clock" if variable.clock else variable.type.value
    initial = "" if variable.initial is None else f" init {_tree(variable.initial)}"
    return f"{variable.name} : {kind}{initial};"


def _module(module: decl.Module | decl.RenamedModule) -> str:
    match module:
        case decl.Module(name, variables, commands, invariant):
            body = _joined(
                [f"  {_variable(v)}" for v in variables],
                [] if invariant is None else [f"  invariant {_tree(invariant)} endinvariant"],
                [f"  {_command(c)}" for c in commands],
            )
            return f"module {name}\n{body}\nendmodule"
        case decl.RenamedModule(name, base, renaming):
            pairs = ", ".join(f"{old}={new}" for old, new in renaming)
            return f"module {name} = {base} [ {pairs} ] endmodule"
        case _:
            assert_never(module)


def _player(player: decl.Player) -> str:
    owned = ", ".join((*player.modules, *(f"[{a}]" for a in player.actions)))
    return f"player {player.name} {owned} endplayer"


def _command(command: decl.Command) -> str:
    updates = " + ".join(map(_update, command.updates))
    opening, closing = "<>" if command.is_markovian else "[]"
    actions = ",".join((command.action or "", *command.others))
    return f"{opening}{actions}{closing} {_tree(command.guard)} -> {updates};"


def _update(update: decl.Update) -> str:
    assignments = [f"({a.variable}'={_tree(a.expression)})" for a in update.assignments]
    probability = "" if update.probability is None else f"{_tree(update.probability)} : "
    if update.probability is not None and update.upper is not None:
        probability = f"[{_tree(update.probability)},{_tree(update.upper)}] : "
    return probability + (" & ".join(assignments) or "true")


def _rewards(rewards: decl.RewardStructure) -> str:
    lines = ["rewards" if rewards.name is None else f'rewards "{rewards.name}"']
    for item in rewards.items:
        actions = ",".join((item.action or "", *item.others))
        action = "" if item.action is False else f"[{actions}] "
        lines.append(f"  {action}{_tree(item.guard)} : {_tree(item.value)};")
    return "\n".join([*lines, "endrewards"])
