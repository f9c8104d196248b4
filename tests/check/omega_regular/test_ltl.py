from __future__ import annotations

from fractions import Fraction
from random import Random

import numpy as np
import pytest

import symcheck
from automata.words import random_tree
from check.omega_regular.linear import Chain, spelled
from generate import random_model
from symcheck.errors import InputError, UnsupportedError


def _tree(random: Random, size: int):
    """Without bounds, which the oracles do not know."""
    while _bounded(tree := random_tree(random, 2, size)):
        pass
    return tree


def _bounded(tree) -> bool:
    return tree[0] != "p" and any(isinstance(part, int) or _bounded(part) for part in tree[1:])


def _chain(random: Random, n: int) -> tuple[str, Chain]:
    rows, commands = [], []
    for s in range(n):
        targets = random.sample(range(n), random.randint(1, min(3, n)))
        weights = [random.randint(1, 3) for _ in targets]
        row = np.zeros(n)
        row[targets] = np.array(weights) / sum(weights)
        rows.append(row)
        updates = [f"{w}/{sum(weights)} : (s'={t})" for w, t in zip(weights, targets, strict=True)]
        commands.append(f"[] s={s} -> {' + '.join(updates)};")
    labels = [[random.random() < 0.5 for _ in range(n)] for _ in range(2)]
    lines = ["dtmc", "module m", f"s : [0..{n - 1}] init 0;", *commands, "endmodule"]
    for name, truth in zip("ab", labels, strict=True):
        lines.append(
            f'label "{name}" = '
            + " | ".join([f"s={s}" for s in range(n) if truth[s]] or ["false"])
            + ";"
        )
    return "\n".join(lines), Chain(rows, np.eye(n)[0], labels)


@pytest.mark.parametrize("seed", range(40))
def test_markov_chains_agree_with_splitting_states(seed):
    random = Random(seed)
    for _ in range(5):
        text, chain = _chain(random, random.randint(2, 5))
        tree = _tree(random, random.randint(2, 6))
        expected = chain.probability(tree)
        model = symcheck.loads(text, engine="explicit")
        assert model.check(f"P=? [ {spelled(tree)} ]").value == pytest.approx(expected, abs=1e-7), (
            text,
            spelled(tree),
        )


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("seed", range(25))
def test_models_agree_with_storm(kind, seed, tmp_path):
    stormpy = pytest.importorskip("stormpy")
    random = Random(f"{kind} {seed}")
    source = random_model(random, kind).text.split("rewards")[0]
    (tmp_path / "model.prism").write_text(source)
    program = stormpy.parse_prism_program(str(tmp_path / "model.prism"))
    model = symcheck.loads(source, engine="explicit")
    for _ in range(4):
        tree = _tree(random, random.randint(2, 6))
        for direction in ("min", "max") if kind == "mdp" else ("",):
            text = f"P{direction}=? [ {spelled(tree, plain=True)} ]"
            properties = stormpy.parse_properties(text, program)
            built = stormpy.build_model(program, properties)
            result = stormpy.model_checking(built, properties[0])
            expected = result.get_value(built.initial_states[0])
            assert model.check(text).value == pytest.approx(expected, abs=1e-5), (source, text)


COINS = """
dtmc
module coin
  s : [0..2] init 0;  // not tossed, heads, tails
  [] true -> 1/2 : (s'=1) + 1/2 : (s'=2);
endmodule
rewards "tosses"
  true : 1;
endrewards
"""


@pytest.mark.parametrize(
    ("path", "tosses"),
    [
        ("F (s=1 & (X s=1))", 6),  # two heads in a row (Feller 1968, XIII.7)
        ("F (s=1 & (X s=2))", 4),
        ("F (s=1 & (X (s=1 & (X s=1))))", 14),
        ("(F s=1) & (F s=2)", 3),
        ("X X s>=0", 2),
        ("X X true", 2),
        ("s=0", 0),
        ("s=1 | (X true)", 1),
        ("!(X false)", 1),
        ("!(G s!=1)", 2),
        ("X X (F s=2)", Fraction(3)),
        ("(F[2,2] s>=0) & (F s>=0)", 2),
        ("X (s=1 ? (X true) : true)", Fraction(3, 2)),
    ],
)
@pytest.mark.parametrize("exact", [False, True])
def test_rewards_until_a_formula_is_shown(path, tosses, exact):
    result = symcheck.loads(COINS, engine="explicit", exact=exact).check(f"R=? [ {path} ]")
    assert result.value == (tosses if exact else pytest.approx(float(tosses)))


def test_rewards_are_infinite_where_the_formula_may_fail():
    model = symcheck.loads(COINS, engine="explicit")
    assert model.check("R=? [ X s=1 ]").value == float("inf")
    assert model.check("R=? [ X false ]").value == float("inf")
    assert model.check("R=? [ (F<=3 s=1) | (X false) ]").value == float("inf")


@pytest.mark.parametrize(
    "formula",
    ["R=? [ F<=3 s=1 ]", "R<4 [ s=0 U<=3 s=1 ]", 'T=? [ F{"r"}<=3 s=1 ]', "R=? [ F=3 s=1 ]"],
)
def test_expectations_take_no_bound_on_their_formula(formula):
    with pytest.raises(InputError, match="takes no bound"):
        symcheck.loads(COINS, engine="explicit").check(formula)


@pytest.mark.parametrize("path", ["G s=0", "(F s=1) & (G s<2)", "s=0 W s=1", "!(F s=1)"])
def test_rewards_are_for_co_safe_formulas(path):
    with pytest.raises(InputError, match="co-safe"):
        symcheck.loads(COINS, engine="explicit").check(f"R=? [ {path} ]")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("F<=2 (s=1 & (X s=1))", Fraction(3, 8)),
        ("(F<=1 s=1) & (F[2,3] s=2)", Fraction(3, 8)),
        ("G<=3 (s=1 => (X s=2))", Fraction(1, 2)),
        ("F=2 (s=1 & (X s=1))", Fraction(1, 4)),
        ("(X[0,0] s=1) | (s=0 & (X s=1))", Fraction(1, 2)),
        ("(G F s=1) & (G F s=2)", 1),
        ("F G s=1", 0),
    ],
)
def test_bounds_on_steps(path, value):
    assert (
        symcheck.loads(COINS, engine="explicit", exact=True).check(f"P=? [ {path} ]").value == value
    )


# From the middle to the left or the right by choice, and back.
SWING = """
mdp
module swing
  s : [0..2] init 1;
  [] s=1 -> (s'=0);
  [] s=1 -> (s'=2);
  [] s!=1 -> (s'=1);
endmodule
"""


@pytest.mark.parametrize(
    ("path", "least", "greatest", "fair_least", "fair_greatest"),
    [
        ("(G F s=0) & (G F s=2)", 0, 1, 1, 1),
        ("F G (s!=2)", 0, 1, 0, 0),
        # To take turns for ever is fair, though in each state of an automaton only one choice is taken.
        ("G ((s=0 => (X X s=2)) & (s=2 => (X X s=0)))", 0, 1, 0, 1),
        ("X (F s=2 & (X X s=2))", 0, 1, 0, 1),
    ],
)
def test_fair_strategies(path, least, greatest, fair_least, fair_greatest):
    for fairness, expected in ((False, (least, greatest)), (True, (fair_least, fair_greatest))):
        model = symcheck.loads(SWING, engine="explicit", fairness=fairness)
        found = tuple(
            model.check(f"P{direction}=? [ {path} ]").value for direction in ("min", "max")
        )
        assert found == expected


def test_a_threshold_that_is_met_exactly_is_decided():
    model = symcheck.loads(COINS, engine="explicit")
    assert model.check("P>=1/2 [ (X s=1) & (G F s=2) ]").value is True
    assert model.check("P>1/2 [ (X s=1) & (G F s=2) ]").value is False


def test_many_atoms_are_no_trouble_where_few_combinations_occur():
    commands = "".join(f"[] s={i} -> (s'={(i + 1) % 30});" for i in range(30))
    model = symcheck.loads(
        f"dtmc module m s : [0..29] init 0; {commands} endmodule", engine="explicit"
    )
    often = " & ".join(f"(G F s={i})" for i in range(30))
    assert model.check(f"P=? [ {often} ]").value == 1
    assert (
        model.check(
            "P=? [ G ((" + ") & (".join(f"s={i} => (X s={i + 1})" for i in range(29)) + ")) ]"
        ).value
        == 1
    )


def test_time_in_a_ctmc_is_refused_within_such_formulas():
    model = symcheck.loads(COINS.replace("dtmc", "ctmc"), engine="explicit")
    assert model.check("P=? [ G F s=1 ]").value == 1
    assert model.check("P=? [ X (s=1 & (X s=2)) ]").value == pytest.approx(0.25)
    with pytest.raises(UnsupportedError, match="bounds on time"):
        model.check("P=? [ (F<=2 s=1) & (F s=2) ]")
    assert model.check("P=? [ F (s=1 & P>=1/2 [ F<=2 s=2 ]) ]").value == 1


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("formula", ["F (a U b)", "(b U a) U a", "!(F (a U b))", "a U (a U b)"])
def test_what_is_only_an_until_needs_no_automaton(kind, formula, monkeypatch):
    text = f"""{kind} module m s : [0..3];
    [] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=3); [] s=1 -> 0.5 : (s'=2) + 0.5 : (s'=3); [] s>1 -> true;
    {"[] s=0 -> (s'=3);" if kind == "mdp" else ""} endmodule"""
    sets = {"a": "s<2", "b": "s=2"}
    spelled = formula
    for name, states in sets.items():
        spelled = spelled.replace(name, f"({states})")
    model = symcheck.loads(text, engine="explicit")
    operators = ["Pmin=?", "Pmax=?"] if kind == "mdp" else ["P=?"]
    questions = [f"{o} [ {spelled} ]" for o in operators]
    short = [model.check(q).value for q in questions]
    with monkeypatch.context() as patched:
        patched.setattr("symcheck.check.omega_regular.ltl.as_until", lambda *_: None)
        assert short == pytest.approx([model.check(q).value for q in questions], abs=1e-15)
    monkeypatch.setattr("symcheck.check.omega_regular.ltl.linear_product", None)
    assert short == [model.check(q).value for q in questions]
