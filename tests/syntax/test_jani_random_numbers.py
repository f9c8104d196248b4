"""Random numbers of finitely many values in assignments of JANI: a branch for each value."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.errors import SyntaxFault, UnsupportedError
from symcheck.syntax.jani.read import read_jani
from syntax.jani_models import automaton, binary, edge, model, text, variable

CONSTANTS = [{"name": "N", "type": "int", "value": 3}, {"name": "M", "type": "int"}]


def uniform(low, high):
    return {"distribution": "DiscreteUniform", "args": [low, high]}


def drawing(*destinations, shared=(), kind="dtmc", constants=CONSTANTS[:1]):
    first = edge("first", *destinations)
    if shared:
        first["assignments"] = list(shared)
    edges = [first, edge("last", ("last", {}))]
    variables = [variable("x", 0, 9), variable("y", 0, 9)]
    return model(
        kind,
        [automaton("a", ["first", "last"], edges, variables)],
        properties=[],
        constants=constants,
    )


def values(tmp_path, found, variable="x", direction=""):
    path = tmp_path / "model.jani"
    path.write_text(text(found))
    checked = symcheck.load(path, exact=True)
    numbers = (checked.check(f"P{direction}=? [ F {variable}={i} ]").value for i in range(10))
    return {i: p for i, p in enumerate(numbers) if p}


@pytest.mark.parametrize("low", [1, binary("-", "N", 2)])
@pytest.mark.parametrize("high", [4, binary("+", "N", 1)])
def test_a_uniform_number_has_all_values_with_the_same_probability(tmp_path, low, high):
    quarter = Fraction(1, 4)
    found = values(tmp_path, drawing(("last", {"x": uniform(low, high)})))
    assert found == {0: 1, 1: quarter, 2: quarter, 3: quarter, 4: quarter}


@pytest.mark.parametrize("kind", ["mdp", "pta"])
def test_other_types_draw_too(tmp_path, kind):
    found = values(tmp_path, drawing(("last", {"x": uniform(1, 2)}), kind=kind), direction="max")
    assert found == {0: 1, 1: Fraction(1, 2), 2: Fraction(1, 2)}


def test_destinations_divide_their_probability(tmp_path):
    found = drawing(("last", {"x": uniform(1, 3)}, 0.25), ("last", {"x": 5}, 0.75))
    twelfth = Fraction(1, 12)
    assert values(tmp_path, found) == {0: 1, 1: twelfth, 2: twelfth, 3: twelfth, 5: Fraction(3, 4)}


def test_several_numbers_are_independent(tmp_path):
    coin = {"distribution": "Bernoulli", "args": [0.25]}
    found = drawing(("last", {"x": binary("+", uniform(1, 3), coin), "y": uniform(1, 2)}))
    sixth = Fraction(1, 6)
    expected = {0: 1, 1: Fraction(1, 4), 2: 2 * sixth, 3: 2 * sixth, 4: sixth / 2}
    assert values(tmp_path, found) == expected
    assert values(tmp_path, found, "y") == {0: 1, 1: Fraction(1, 2), 2: Fraction(1, 2)}


def test_the_assignments_of_an_edge_draw_for_each_destination(tmp_path):
    shared = [{"ref": "x", "value": uniform(1, 2)}]
    found = drawing(("last", {"y": 1}, 0.25), ("last", {"y": 2}, 0.75), shared=shared)
    half = Fraction(1, 2)
    assert values(tmp_path, found) == {0: 1, 1: half, 2: half}
    assert values(tmp_path, found, "y") == {0: 1, 1: Fraction(1, 4), 2: Fraction(3, 4)}


@pytest.mark.parametrize(
    ("value", "kind", "message"),
    [
        (uniform(3, 1), SyntaxFault, "there is no number from 3 to 1"),
        (uniform(0, 10_000), UnsupportedError, "more than 10,000 random values are too many"),
        (uniform("x", 3), UnsupportedError, "a bound of DiscreteUniform is an integer"),
        (uniform(0, "M"), UnsupportedError, "to which the model gives values"),
        (uniform(0, 2.5), UnsupportedError, "a bound of DiscreteUniform is an integer"),
        ({"distribution": "DiscreteUniform", "args": [1]}, SyntaxFault, "DiscreteUniform has 2"),
        ({"distribution": "Bernoulli", "args": ["x"]}, UnsupportedError, "reads no variable"),
        ({"distribution": "Normal", "args": [0, 1]}, UnsupportedError, "distribution 'Normal'"),
    ],
)
def test_what_cannot_be_drawn_is_told_with_its_place(value, kind, message):
    found = drawing(("last", {"x": value}), constants=CONSTANTS)
    with pytest.raises(kind, match=r"model\.jani:\d+:\d+: error") as error:
        read_jani(text(found), "model.jani")
    assert message in str(error.value)


def test_two_numbers_with_many_values_are_too_many():
    found = drawing(("last", {"x": uniform(0, 200), "y": uniform(0, 200)}))
    with pytest.raises(UnsupportedError, match="more than 10,000 values here"):
        read_jani(text(found), "model.jani")
