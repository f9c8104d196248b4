"""Random small models and properties, as texts, from a `random.Random`."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random

from checking import engine_of
from symcheck.errors import InputError, TypeFault
from symcheck.semantics.expressions.types import type_of
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Literal,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.printer import pretty

__all__ = [
    "Generated",
    "bound_models",
    "random_condition",
    "random_copies",
    "random_model",
    "random_property",
    "random_question",
    "wild_model",
]

_WEIGHTS = {
    1: ("1",),
    2: ("0.5,0.5", "0.25,0.75", "1/3,2/3", "0.9,0.1"),
    3: ("0.5,0.25,0.25", "1/3,1/3,1/3", "0.2,0.3,0.5"),
}
_RATES = ("1", "2", "0.5", "3", "1/3", "10")
_NEAR = {  # 0 and 1
    1: ("1",),
    2: ("1e-12,1-1e-12", "1e-6,1-1e-6", "1e-3,0.999", "0,1", "1e-17,1-1e-17"),
    3: ("1e-9,1e-6,1-1e-9-1e-6", "1e-12,0.5,0.5-1e-12", "0,1/7,6/7"),
}
_FAR_RATES = ("1e-12", "1e-6", "1e-3", "1e3", "1e6", "1e12")
_LABELS = ('"a"', '"b"')
_REWARDS = ("0", "1", "2", "0.5", "3")


@dataclass(frozen=True)
class Generated:
    """A model's text with what its properties can speak of."""

    kind: str
    text: str
    variables: tuple[tuple[str, int], ...]
    """Name and highest value (the lowest is 0)."""


def random_model(rng: Random, kind: str, *, largest: int = 3) -> Generated:
    """A model of one or two modules with one or two bounded variables each; some synchronise, some overlap, some deadlock."""
    modules, variables = [], []
    for m in range(rng.choice((1, 1, 2))):
        own = [
            (f"{'xy'[m]}{i}", rng.randint(1, largest))
            for i in range(rng.choice((1, 2)) if m == 0 else 1)
        ]
        variables.extend(own)
        modules.append(own)
    text = [kind, ""]
    for m, own in enumerate(modules):
        text.append(f"module m{m}")
        text.extend(f"    {n} : [0..{h}] init {rng.randint(0, h)};" for n, h in own)
        text.extend("    " + _command(rng, kind, own, variables) for _ in range(rng.randint(2, 5)))
        text.append("endmodule\n")
    text.extend(f"label {name} = {_condition(rng, variables)};" for name in _LABELS)
    text.append('\nrewards "r"')
    text.append(f"    {_condition(rng, variables)} : {rng.choice(_REWARDS)};")
    text.append(f"    [{rng.choice(('', 'go'))}] true : {rng.choice(_REWARDS)};")
    text.append("endrewards\n")
    return Generated(kind, "\n".join(text), tuple(variables))


def bound_models(name: str, kind: str, *, costs: bool = False) -> Iterator[Generated]:
    """Random models without errors, without end: each action of a reward structure exists.

    Args:
        name: the seeds begin with it.
        kind: as in `random_model`.
        costs: whether there is a second reward structure, "c".
    """
    for seed in itertools.count():
        rng = Random(f"{name}{seed}")
        model = random_model(rng, kind)
        if costs:
            variable, high = model.variables[0]
            lines = f"{variable}={rng.randint(0, high)} : 1; {variable}>=1 : 2;"
            model = replace(model, text=f'{model.text}rewards "c" {lines} endrewards\n')
        with contextlib.suppress(InputError):
            engine_of(model.text)
            yield model


def wild_model(rng: Random, kind: str) -> Generated:
    """As `random_model`, with up to three modules, renamed copies, many initial states, and probabilities and rates of all sizes."""
    share = rng.choice((0.0, 0.1, 0.5))  # of extreme weights
    modules, variables = [], []
    count = rng.choice((1, 2, 2, 3))
    largest = 3 if count == 1 else 2
    for m in range(count):
        own = [(f"{'xyz'[m]}{i}", rng.randint(1, largest)) for i in range(rng.choice((1, 1, 2)))]
        variables.extend(own)
        modules.append(own)
    copied = count < 3 and rng.random() < 0.25
    shown = [*variables, *((f"c{n}", h) for n, h in modules[0])] if copied else variables
    several = rng.random() < 0.25
    text = [kind, ""]
    for m, own in enumerate(modules):
        text.append(f"module m{m}")
        starts = ("" if several else f" init {rng.randint(0, h)}" for _, h in own)
        text.extend(f"    {n} : [0..{h}]{i};" for (n, h), i in zip(own, starts, strict=True))
        text.extend(
            "    " + _command(rng, kind, own, variables, share) for _ in range(rng.randint(2, 5))
        )
        text.append("endmodule\n")
    if copied:
        renamed = ", ".join(f"{n}=c{n}" for n, _ in modules[0])
        text.append(f"module copy = m0 [ {renamed} ] endmodule\n")
    if several:
        text.append(f"init {_condition(rng, shown)} endinit")
    text.extend(
        f"label {name} = {random_condition(rng, shown) if rng.random() < 0.2 else _condition(rng, shown)};"
        for name in _LABELS
    )
    for name, rewards in (("r", _REWARDS), ("c", ("0", "1", "2"))):
        text.append(f'\nrewards "{name}"')
        text.append(f"    {_condition(rng, shown)} : {rng.choice(rewards)};")
        if name == "r" or kind != "ctmc":
            action = rng.choice(("", "go")) if any("[go]" in line for line in text) else ""
            text.append(f"    [{action}] true : {rng.choice(rewards)};")
        text.append("endrewards\n")
    return Generated(kind, "\n".join(text), tuple(shown))


def _command(
    rng: Random,
    kind: str,
    own: list[tuple[str, int]],
    variables: list[tuple[str, int]],
    extreme: float = 0.0,
) -> str:
    action = rng.choice(("", "", "", "go"))
    count = rng.choice((1, 2, 2, 3))
    far = extreme > 0 and rng.random() < extreme
    if kind == "ctmc":
        weights = [rng.choice(_RATES + _FAR_RATES if far else _RATES) for _ in range(count)]
    else:
        weights = rng.choice((_NEAR if far else _WEIGHTS)[count]).split(",")
    updates = " + ".join(f"{w} : {_update(rng, own)}" for w in weights)
    return (
        f"[{action}] {_condition(rng, variables)} -> {updates};".replace(" -> 1 : ", " -> ")
        if count == 1
        else (f"[{action}] {_condition(rng, variables)} -> {updates};")
    )


def _update(rng: Random, own: list[tuple[str, int]]) -> str:
    name, high = rng.choice(own)
    value = rng.choice(
        (
            str(rng.randint(0, high)),
            f"mod({name}+1,{high + 1})",
            f"max({name}-1,0)",
            f"min({name}+1,{high})",
        )
    )
    return f"({name}'={value})"


def _condition(rng: Random, variables: list[tuple[str, int]]) -> str:
    name, high = rng.choice(variables)
    value = rng.randint(0, high)
    simple = rng.choice(
        (f"{name}={value}", f"{name}>={value}", f"{name}<={value}", f"{name}!={value}", "true")
    )
    if rng.random() < 0.2:
        return f"({simple}) {rng.choice('&|')} ({_condition(rng, variables)})"
    return simple


def random_condition(rng: Random, variables: list[tuple[str, int]]) -> str:
    """A condition of any operators and functions."""
    return pretty(
        _tree(rng, dict.fromkeys((name for name, _ in variables), Type.INT), Type.BOOL, 2)
    )


def _tree(rng: Random, variables: dict[str, Type], kind: Type, depth: int) -> Expression:
    """An expression of a type: operands are drawn until their types fit an operator or function."""
    if depth == 0:
        number = Literal(rng.randint(0, 3), Type.INT)
        return {
            Type.INT: rng.choice((Name(rng.choice(list(variables))), number)),
            Type.DOUBLE: Literal(Fraction(rng.randint(0, 5), 2), Type.DOUBLE),
            Type.BOOL: Literal(rng.random() < 0.5, Type.BOOL),
        }[kind]
    while True:
        drawn = rng.choice((None, *Operator, *UnaryOperator, *Function))
        for _ in range(6):
            same = rng.choice(list(Type))
            types = [
                rng.choice((same, same, rng.choice(list(Type)))) for _ in range(rng.randint(1, 3))
            ]
            if drawn is None:
                types[:1] = [Type.BOOL]
            parts = tuple(_tree(rng, variables, t, rng.randrange(depth)) for t in types)
            tree: Expression
            match drawn, parts:
                case Function(), _:
                    tree = Call(drawn, parts)
                case Operator(), (left, right):
                    tree = Binary(drawn, left, right)
                case UnaryOperator(), (operand,):
                    tree = Unary(drawn, operand)
                case None, (condition, then, otherwise):
                    tree = Conditional(condition, then, otherwise)
                case _:
                    continue
            with contextlib.suppress(TypeFault):
                if type_of(tree, variables) is kind:
                    return tree


def random_property(rng: Random, model: Generated, *, timed: bool = True) -> str:
    """A numeric property (`=?`); `timed` False leaves out what has no rational value (time bounds in a CTMC)."""
    direction = rng.choice(("min", "max")) if model.kind == "mdp" else ""
    steps = model.kind != "ctmc"
    paths = [
        f"F {_states(rng, model)}",
        f"G {_states(rng, model)}",
        f"{_states(rng, model)} U {_states(rng, model)}",
        f"{_states(rng, model)} W {_states(rng, model)}",
        f"{_states(rng, model)} R {_states(rng, model)}",
        f"X {_states(rng, model)}",
    ]
    if steps or timed:
        bound = _bound(rng, model.kind)
        paths += [f"{letter}{bound} {_states(rng, model)}" for letter in "FG"]
        paths.append(f"{_states(rng, model)} U{bound} {_states(rng, model)}")
    properties = [f"P{direction}=? [ {p} ]" for p in paths]
    properties.append(f'R{{"r"}}{direction}=? [ F {_states(rng, model)} ]')
    properties.append(f'R{{"r"}}{direction}=? [ C ]')
    if steps or timed:
        time = rng.choice(("0", "1", "3", "7")) if steps else rng.choice(("0", "0.5", "2"))
        properties += [
            f'R{{"r"}}{direction}=? [ C<={time} ]',
            f'R{{"r"}}{direction}=? [ I={time} ]',
        ]
    if model.kind != "mdp":
        properties += [f"S=? [ {_states(rng, model)} ]", 'R{"r"}=? [ S ]']
    return rng.choice(properties)


def random_question(rng: Random, model: Generated) -> str:
    """A property of any operator: a number, a verdict, or points of a Pareto front."""
    direction = rng.choice(("min", "max")) if model.kind == "mdp" else ""

    def states() -> str:
        return _states(rng, model)

    def number() -> str:
        return random_property(rng, model)

    steps = rng.randint(0, 6)
    pick = rng.random()
    if pick < 0.3:
        return number()
    if pick < 0.45:
        bound = rng.choice((">", ">=", "<", "<="))
        bound += rng.choice(("0", "1", "0.5", "1e-9", "1-1e-9", "1/3", "2", "0.2"))
        return number().replace("=?", bound, 1)
    if pick < 0.6:
        return f"P{direction}=? [ {_path(rng, model, rng.randint(1, 4))} ]"
    if pick < 0.68:
        condition = rng.choice(("forall", "exists", "count"))
        if rng.random() < 0.3:
            return f"filter({condition}, {states()}, {states()})"
        wide = rng.choice(("min", "max", "sum", "avg", "range", "first"))
        return f"filter({wide}, {number()}, {states()})"
    if pick < 0.74:
        return f"{rng.choice('AE')} [ {rng.choice('FG')} {states()} ]"
    if pick < 0.78:
        return f"{number()} {rng.choice('+-*')} {rng.choice(('1', '2', number()))}"
    asked = [
        f"P{direction}=? [ {rng.choice('FG')} {states()} || F {states()} ]",
        f"T{direction}=? [ F {states()} ]",
        f"S{direction}=? [ {states()} ]",
        f'R{{"r"}}{direction}=? [ S ]',
        f'R{{"r"}}{direction}=? [ F ({states()} & X {states()}) ]',
        f"P{direction}=? [ F {states()} {{{states()}}}{rng.choice(('', '{min}', '{max}', '{min}{max}'))} ]",
    ]
    if model.kind != "ctmc":
        asked += [
            f'P{direction}=? [ {states()} U{{"c"}}<={steps} {states()} ]',
            f'P{direction}=? [ F{{"c"}}>={steps} {states()} ]',
            f'R{{"r"}}{direction}=? [ C{{"c"}}<={steps} ]',
            f'P{direction}=? [ F^{{rew{{"c"}}<={steps}, steps<=3}} {states()} ]',
            f'R{{"r"}}{direction}=? [ C discount={rng.choice(("0.9", "0.5", "0", "0.999"))} ]',
            f'R{{"r"}}{direction}=? [ C<={steps} discount=0.9 ]',
            f'quantile(min B, P{direction}>{rng.choice(("0.5", "0", "0.9"))} [ F{{"c"}}<=B {states()} ])',
            f"quantile(max B, P{direction}<{rng.choice(('0.5', '1', '0.1'))} [ F<=B {states()} ])",
        ]
    if model.kind == "mdp":
        goals = [
            f"P{rng.choice(('min', 'max'))}=? [ {rng.choice('FG')} {states()} ]",
            f"P{rng.choice(('min', 'max'))}=? [ {states()} U {states()} ]",
            f'R{{"c"}}{rng.choice(("min", "max"))}=? [ C<={steps} ]',
            f'R{{"c"}}{rng.choice(("min", "max"))}=? [ S ]',
            'R{"r"}min=? [ C ]',
        ]
        first, second = rng.sample(goals, 2)
        bounded = f"P{rng.choice(('>=', '<='))}{rng.choice(('0', '0.5', '1'))} [ F {states()} ]"
        asked += [
            f"multi({first}, {second})",
            f"multi({first}, {bounded})",
            f"multilex({first}, {second})",
        ]
    return rng.choice(asked)


def _path(rng: Random, model: Generated, size: int) -> str:
    """A path formula of linear time with about `size` operators."""
    if size <= 0:
        return _states(rng, model)
    operator = rng.choice("!XFGFG&|UWR")
    if operator in "!XFG":
        return f"({operator} {_path(rng, model, size - 1)})"
    left = rng.randrange(size)
    return f"({_path(rng, model, left)} {operator} {_path(rng, model, size - 1 - left)})"


def _states(rng: Random, model: Generated) -> str:
    if rng.random() < 0.15:
        direction = rng.choice(("min", "max")) if model.kind == "mdp" else ""
        bound = rng.choice((">", ">=", "<", "<=")) + rng.choice(("0", "0.5", "1", "1/3", "0.25"))
        return f"(P{direction}{bound} [ F {rng.choice(_LABELS)} ])"
    return rng.choice(
        (
            '"a"',
            '"b"',
            '"a"&"b"',
            '!"a"',
            '"init"',
            '"deadlock"',
            f"({_condition(rng, list(model.variables))})",
        )
    )


def _bound(rng: Random, kind: str) -> str:
    if kind == "ctmc":
        return rng.choice(("<=0.5", "<2", ">=1", "[0.5,2]", "[1,1]", "=0.3", ">0"))
    return rng.choice(("<=0", "<=2", "<5", ">=1", ">2", "[1,3]", "=2", "<=20"))


def random_copies(rng: Random, kind: str) -> tuple[str, str]:
    """A model of copies of one module, which share a variable, and a property of all of them."""
    copies = rng.randint(2, 4)
    variables = [("x0", 2), ("y0", 1), ("g", 2)]
    text = [kind, "global g : [0..2];", "module m0", "x0 : [0..2]; y0 : [0..1];"]
    text += [_command(rng, kind, variables[:2], variables) for _ in range(rng.randint(2, 4))]
    if kind != "dtmc" or rng.random() < 0.5:
        text.append(f"[] g<2 & {_condition(rng, variables)} -> (g'=g+1);")
    text += [f"[go] {_condition(rng, variables)} -> (x0'=0);", "endmodule"]
    for i in range(1, copies):
        text.append(f"module m{i} = m0 [ x0=x{i}, y0=y{i} ] endmodule")
    total = "+".join(f"x{i}" for i in range(copies))
    text.append(f"rewards {total}>1 : {total}; [go] true : 1; endrewards")
    goal = f"{total}>={rng.randint(1, 2 * copies)}"
    optimum = rng.choice(("min", "max")) if kind == "mdp" else ""
    asked = rng.choice((f"P{optimum}=? [ F {goal} ]", f"R{optimum}=? [ C<=3 ]"))
    return "\n".join(text), asked
