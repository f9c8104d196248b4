"""A property is resolved once, into a query: a quantity, a direction and a threshold, which all interpret."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import get_args, get_origin

import pytest

import symcheck
from symcheck.check.context import Context
from symcheck.check.explanation.path_search import path_search
from symcheck.check.multi_objective.query import solve_query
from symcheck.check.state_formulas import query_of as query_over_sets
from symcheck.check.strategies.strategy import strategy_of
from symcheck.direction import Direction
from symcheck.distributed.measures import supported
from symcheck.engines.registry import build
from symcheck.errors import InputError, UnsupportedError
from symcheck.options import Options
from symcheck.semantics import query
from symcheck.semantics.binding.bind import bind, bind_properties, exactly_bound
from symcheck.semantics.path_formulas import LtlPathFormula, UntilPath, as_ltl, over_leaves
from symcheck.semantics.query import Quantity, direction_of, query_of
from symcheck.semantics.time_bounds import Window
from symcheck.simulate.check import check_by_sampling
from symcheck.simulate.statistics import Plan
from symcheck.syntax.ast import MultiObjective, ProbabilityOperator
from symcheck.syntax.parse import parse_model, parse_properties
from symcheck.syntax.printer import pretty

MDP = """
mdp
const double half = 1/2;
module m
  x : [0..2];
  [a] x=0 -> 0.25:(x'=1) + 0.75:(x'=2);
  [b] x=0 -> 0.75:(x'=1) + 0.25:(x'=2);
  [] x>0 -> true;
endmodule
rewards [a] true : 2; [b] true : 2; endrewards
"""
CHAIN = MDP.replace("mdp", "dtmc")

FORMULAS = {
    query.PathProbability: "P{} [ F x=1 ]",
    query.ProbabilityGiven: "P{} [ F x=1 || F x>0 ]",
    query.LongRunProbability: "S{} [ x=1 ]",
    query.LongRunReward: "R{} [ S ]",
    query.ReachReward: "R{} [ F x>0 ]",
    query.CoSafeReward: "R{} [ (F x=0) & (F x>0) ]",
    query.TotalReward: "R{} [ C ]",
    query.CumulativeReward: "R{} [ C<=2 ]",
    query.CostBoundedReward: "R{} [ C{{1}}<=2 ]",
    query.DiscountedReward: "R{} [ C discount=1/2 ]",
    query.InstantaneousReward: "R{} [ I=1 ]",
}
"""A formula of each quantity, without its direction and bound."""


def bound_model(text: str = MDP):
    return bind(parse_model(text))


def bound_formula(text: str, model, constants=None):
    return bind_properties(parse_properties(text), model, constants or {}).properties[0].formula


def classes(union) -> set[type]:
    """The classes of a union, without the types of their leaves."""
    return {get_origin(member) or member for member in get_args(union)}


def test_every_quantity_is_in_the_union_and_has_a_formula_here() -> None:
    assert classes(Quantity) == {*FORMULAS, query.EndedReward}  # that of games, see their tests
    declared = {kind.__name__ for kind in query._Quantity.__subclasses__()}
    assert declared == {kind.__name__ for kind in (*FORMULAS, query.EndedReward)}


@pytest.mark.parametrize("kind", FORMULAS)
class TestEveryQuantity:
    """Each interpreter gives an answer for each quantity, or says that it does not."""

    def test_its_formula_is_resolved_and_mapped_to_it(self, kind) -> None:
        model = bound_model()
        resolved = query_of(bound_formula(FORMULAS[kind].format("max=?"), model), model)
        assert type(resolved.quantity) is kind
        mapped = resolved.over(pretty)
        assert type(mapped.quantity) is kind
        assert (mapped.direction, mapped.threshold) == (Direction.MAX, None)

    @pytest.mark.parametrize("text", [MDP, CHAIN])
    def test_it_has_values(self, kind, text) -> None:
        asked = "max=?" if text is MDP else "=?"
        assert symcheck.loads(text).check(FORMULAS[kind].format(asked)).value >= 0

    def test_others_interpret_or_refuse_it(self, kind) -> None:
        model = bound_model()
        formula = bound_formula(FORMULAS[kind].format("max=?"), model)
        options = Options(engine="explicit", strategy=True)
        context = Context(build(model, options), options)
        bounded = bound_formula(FORMULAS[kind].format("<=0.1"), model)
        chain = bound_model(CHAIN)
        plain = bound_formula(FORMULAS[kind].format("=?"), chain)
        answered = set()
        for name, ask in {
            "strategy": lambda: strategy_of(context, formula),
            "paths": lambda: path_search(context, bounded),
            "multi": lambda: solve_query(context, MultiObjective((formula,))),
            "samples": lambda: check_by_sampling(chain, plain, Plan(samples=100)),
            "cluster": lambda: supported(formula, model),
        }.items():
            try:
                ask()
            except (InputError, UnsupportedError):
                continue
            answered.add(name)
        assert answered == INTERPRETED.get(kind, set())

    def test_it_is_refused_over_fair_strategies_unless_it_says_otherwise(self, kind) -> None:
        for direction in Direction:
            asked = FORMULAS[kind].format(f"{direction.value}=?")
            model = symcheck.loads(MDP, fairness=True)
            if direction in FAIR.get(kind, ()):
                assert model.check(asked).value >= 0
            else:
                with pytest.raises(UnsupportedError, match="over fair strategies only"):
                    model.check(asked)
            # A chain has no strategies.
            assert (
                symcheck.loads(CHAIN, fairness=True).check(FORMULAS[kind].format("=?")).value >= 0
            )


INTERPRETED = {
    query.PathProbability: {"strategy", "paths", "multi", "samples", "cluster"},
    query.LongRunProbability: {"strategy", "multi"},
    query.LongRunReward: {"strategy", "multi"},
    query.ReachReward: {"strategy", "paths", "multi", "samples", "cluster"},
    query.CoSafeReward: {"strategy"},
    query.TotalReward: {"strategy", "multi"},
    query.CumulativeReward: {"strategy", "paths", "multi", "samples"},
    query.DiscountedReward: {"strategy"},
    query.InstantaneousReward: {"strategy", "samples"},
}
"""Who answers for a quantity, beside values; all others refuse it."""
FAIR = {
    query.PathProbability: Direction,
    query.TotalReward: (Direction.MAX,),
    query.CumulativeReward: Direction,
    query.DiscountedReward: Direction,
    query.InstantaneousReward: Direction,
}


# ---------------------------------------------------------------------------------------- direction


@pytest.mark.parametrize(
    ("asked", "direction"),
    [
        ("min=?", Direction.MIN),
        ("max=?", Direction.MAX),
        (">0.5", Direction.MIN),
        (">=0.5", Direction.MIN),
        ("<0.5", Direction.MAX),
        ("<=0.5", Direction.MAX),
        ("max>=0.5", Direction.MAX),
        ("min<0.5", Direction.MIN),
    ],
)
@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_a_bound_without_a_direction_is_about_all_strategies(kind, asked, direction) -> None:
    model = bound_model(MDP.replace("mdp", kind))
    formula = bound_formula(f"P{asked} [ F x=1 ]", model)
    found = query_of(formula, model)
    assert found.direction is (direction if kind == "mdp" else None)
    # Values and strategies follow it.
    loaded = symcheck.loads(MDP.replace("mdp", kind), strategy=kind == "mdp", engine="explicit")
    result = loaded.check(f"P{asked} [ F x=1 ]")
    value = 0.5 if kind != "mdp" else {Direction.MIN: 0.25, Direction.MAX: 0.75}[direction]
    expected = value if found.threshold is None else found.threshold.admits(value)
    assert result.value == expected
    if kind == "mdp":
        (strategy,) = result.strategies
        assert strategy.direction is direction


def test_a_model_with_choices_needs_a_direction() -> None:
    model = bound_model()
    formula = ProbabilityOperator(None, None, bound_formula("P>0 [ F x=1 ]", model).path)
    with pytest.raises(InputError, match="P=\\? has no single value in an MDP"):
        direction_of(formula, model.type)
    with pytest.raises(UnsupportedError, match="Pminmax is not supported on an MDP"):
        direction_of(replace(formula, direction="minmax"), model.type)


# ---------------------------------------------------------------------------------------- threshold


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("P>=1/6 [ F x=1 ]", Fraction(1, 6)),
        ("P<0.1+0.2 [ F x=1 ]", Fraction(3, 10)),
        ("P>half/3 [ F x=1 ]", Fraction(1, 6)),
        ("const double p; P<=p [ F x=1 ]", Fraction(1, 10)),
    ],
)
def test_thresholds_are_the_rationals_of_the_text(text, value) -> None:
    model = bound_model()
    constants = {"p": "0.1"} if "const" in text else {}
    formula = bound_formula(text, model, constants)
    assert query_of(formula, model).threshold.value == value
    # Nothing is gained by binding to the model in rational arithmetic.
    assert formula == bound_formula(text, exactly_bound(model), constants)


def test_an_infinite_threshold_is_refused() -> None:
    model = bound_model(MDP.replace("mdp", "dtmc const double big = log(0, 2);"))
    with pytest.raises(InputError, match="finite number"):
        query_of(bound_formula("R>=big [ C<=1 ]", model), model)


# ------------------------------------------------------------------------------------ path formulas


def test_a_state_formula_is_one_atom_wherever_it_stands() -> None:
    model = bound_model()
    path = query_of(bound_formula("Pmax=? [ (G F x=1) & (X x=1) ]", model), model).quantity.path
    assert isinstance(path, LtlPathFormula)
    assert [pretty(atom) for atom in path.atoms] == ["true", "x=1"]
    assert over_leaves(path, pretty).atoms == ("true", "x=1")


def test_an_until_formula_is_an_ltl_formula_of_two_atoms() -> None:
    path = UntilPath("a", "b", Window(upper=Fraction(3)), negative=True)
    ltl = as_ltl(path)
    assert ltl.atoms == ("a", "b")
    assert not ltl.negative  # the negation is in its normal form


def test_state_formulas_of_a_query_are_evaluated_once(monkeypatch) -> None:
    model = bound_model(CHAIN)
    context = Context(build(model, Options(engine="explicit")), Options(engine="explicit"))
    asked: list[str] = []
    where = type(context.engine).where

    def counted(engine, formula):
        asked.append(pretty(formula))
        return where(engine, formula)

    monkeypatch.setattr(type(context.engine), "where", counted)
    query_over_sets(context, bound_formula("P=? [ (F x=1) & (F (x=1 & x<2)) || F x=1 ]", model))
    assert len(asked) == len(set(asked))
