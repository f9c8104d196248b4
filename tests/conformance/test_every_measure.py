"""Whoever adds a measure, a reward query or an operator and forgets a list of them is told which."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from random import Random
from typing import Any, get_args

import pytest

import symcheck
from checking import RESULTS, engine_of
from conformance.test_results import RUNS
from generate import random_condition, random_question, wild_model
from oracles import draw_games
from oracles.draw import draw
from symcheck.check.bisimulation.atomic_observations import atomic_observations
from symcheck.check.context import Context
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bind import split_constants
from symcheck.semantics.reduction.reset_dead_variables import observe
from symcheck.simulate.statistics import Plan
from symcheck.syntax import ast
from symcheck.syntax.ast import MEASURES, Bound, Literal, Name, Node, Type
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.parse import (
    parse_expression,
    parse_model_file,
    parse_properties,
    parse_properties_file,
)
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import nodes
from syntax.test_walk import FORMULAS

QUERIES = {kind for kind in get_args(ast.RewardQuery) if issubclass(kind, ast.RewardQueryNode)}
PATHS = {
    kind
    for kind in get_args(ast.PathFormula)
    if issubclass(kind, ast.UnaryTemporal | ast.BinaryTemporal)
}


def leaves(base: type[Node]) -> set[type[Node]]:
    """The kinds of node that inherit from a base, and from which none inherits."""
    kinds = {k for k in vars(ast).values() if isinstance(k, type) and issubclass(k, base)}
    return {k for k in kinds if not any(issubclass(other, k) and other is not k for other in kinds)}


def kinds(texts: Iterable[str]) -> set[type[Node]]:
    """The kinds of node of properties."""
    return {
        type(node)
        for text in texts
        for one in parse_properties(text).properties
        for node in nodes(one.formula)
    }


MDP = "mdp module m x : [0..1]; [] x=0 -> (x'=1); endmodule"


@pytest.mark.parametrize(
    ("options", "text", "message"),
    [
        ({}, "multi(Pmax=? [ F x=1 ], x=1)", "must be a P, R, S or T operator"),
        ({"strategy": True}, "1 - Pmax=? [ F x=1 ]", "supported for P, R, S and T formulas"),
    ],
)
def test_messages_list_the_measures_that_there_are(options, text, message) -> None:
    try:
        said = symcheck.loads(MDP, **options).check(text).no_strategy
    except symcheck.SymcheckError as error:
        said = error.message
    assert message in said


def test_every_kind_is_in_its_union() -> None:
    assert leaves(ast.Measure) == set(MEASURES), "AnyMeasure in syntax/ast.py"
    assert leaves(ast.RewardQueryNode) == QUERIES, "RewardQuery in syntax/ast.py"
    operators = {k for k in get_args(ast.Expression) if issubclass(k, ast.StateOperator)}
    assert leaves(ast.StateOperator) == operators, "Expression in syntax/ast.py"


def measures() -> Iterator[ast.Measure]:
    """One of each kind."""
    found = (n for formula in FORMULAS for n in nodes(formula))
    yield from {type(n): n for n in found if isinstance(n, ast.Measure)}.values()


def test_every_measure_is_read_with_each_direction_and_bound() -> None:
    """As it is printed, so that the grammar, the builder and the printer agree on the letter."""
    for measure in measures():
        for direction in (None, "min", "max", "minmax", "maxmin"):
            for bound in (None, Bound(Operator.GE, Literal(1, Type.INT))):
                asked = replace(measure, direction=direction, bound=bound)
                assert parse_expression(pretty(asked)) == asked, pretty(asked)


def test_every_measure_has_a_result() -> None:
    files = [p for p in RESULTS.iterdir() if p.suffix in (".pctl", ".csl")]
    found = kinds(p.read_text() for p in files)
    assert not {*MEASURES, *QUERIES, *PATHS} - found, "RESULT lines in tests/results"


def first_missing(needed: set[Any], draws: Iterable[Iterable[Any]]) -> set[Any]:
    """What none of the draws has, of which no more are drawn once they have everything."""
    for found in draws:
        needed -= set(found)
        if not needed:
            break
    return needed


def test_every_measure_is_drawn() -> None:
    def asked(seed: int) -> str:
        rng = Random(f"every measure {seed}")
        return random_question(rng, wild_model(rng, rng.choice(("dtmc", "ctmc", "mdp"))))

    of_games = {ast.EndedReward, ast.Equilibrium}
    needed = {*leaves(ast.StateOperator), *QUERIES, *PATHS} - of_games
    missing = first_missing(needed, (kinds([asked(seed)]) for seed in range(1500)))
    assert not missing, "random_question in tests/generate.py"


def test_every_operator_is_drawn() -> None:
    def operations(seed: int) -> Iterator[object]:
        for node in nodes(parse_expression(random_condition(Random(seed), [("x", 3)]))):
            match node:
                case ast.Binary(operator) | ast.Unary(operator):
                    yield type(operator), operator
                case ast.Call(function):
                    yield Function, function

    needed = {(kind, member) for kind in (Operator, UnaryOperator, Function) for member in kind}
    missing = first_missing(needed, map(operations, range(1500)))
    assert not missing, "_tree in tests/generate.py"


def test_every_measure_has_an_oracle() -> None:
    """But for rewards within a cost, which are drawn and compared with rationals only."""
    needed = {*MEASURES, *QUERIES, *PATHS} - {ast.CostBoundedReward}
    games = kinds(q.text for q in draw_games.draw("every measure").questions)
    cases = (draw(f"every measure {seed}") for seed in range(400))
    found = (kinds(q.text for q in case.questions) for case in cases)
    missing = first_missing(needed - games, found)
    assert not missing, "tests/oracles/draw.py"


@pytest.mark.parametrize("kind", [*MEASURES, *sorted(QUERIES, key=lambda k: k.__name__)])
def test_every_measure_is_estimated_or_refused(kind: type[Node]) -> None:
    """With a sentence: sampling never ends with an internal error."""
    for model, properties, constants in RUNS:
        file = parse_properties_file(RESULTS / properties)
        program = parse_model_file(RESULTS / model)
        given = split_constants(program, file, constants)
        loaded = symcheck.load(RESULTS / model, constants=given.of_model)
        values = {n: (v,) for n, v in given.of_properties.items()}
        for i, asked in enumerate(file.properties):
            if kind in map(type, nodes(asked.formula)):
                (instance,) = loaded.instances(file, values, [i])
                with suppress(UnsupportedError):
                    loaded.estimate_instance(instance, Plan(samples=20, seed=1))
                return
    raise AssertionError(f"{kind.__name__}: RESULT lines in tests/results")


@dataclass(frozen=True, slots=True)
class New(ast.StateOperator):
    """An operator that declares nothing."""

    formula: ast.Expression


@dataclass(frozen=True, slots=True)
class NewReward(New):
    """An operator that declares that bisimilar states have the same value."""

    is_bisimulation_invariant = True


def test_reductions_keep_what_a_new_operator_may_read() -> None:
    """All variables and rewards, until it declares what it does without."""
    engine = engine_of((RESULTS / "die.pm").read_text())
    inner = parse_expression("s=7")
    seen = observe(engine.model, [New(inner)], {})
    assert (seen.expressions, seen.rewards) == ((Name("s"), Name("d")), True)
    seen = observe(engine.model, [NewReward(inner)], {})
    assert (seen.expressions, seen.rewards) == ((inner,), True)
    context = Context(engine, symcheck.Options())
    with pytest.raises((UnsupportedError, AssertionError), match="New"):  # has no text
        atomic_observations(context, New(inner))
    assert atomic_observations(context, NewReward(inner)).structures == {0, 1}
