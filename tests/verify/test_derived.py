"""Rules about models that are made of the given one: in time, and with a memory."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from itertools import product
from math import exp
from pathlib import Path
from random import Random
from typing import Any

import pytest
import symcheck_verify_derived as derived
from symcheck_verify import Rejected

import symcheck
from proofs import CLOCK, GAME, certificate, proved, until, vector, written
from symcheck.automata.ltl import LtlFactory
from symcheck.automata.translate import translate

# GF a over the letters 0 (not a) and 1 (a): one state, and a pair that visits its a-edge.
INFINITELY_OFTEN = {
    "letters": [0, 1],
    "table": [[0, 0]],
    "pairs": [{"avoid": [], "visits": [[[0, 1]]]}],
}
EVENTUALLY = ["U", True, 0]
ALWAYS_EVENTUALLY = ["not", ["U", True, ["not", EVENTUALLY]]]


def same(automaton: dict[str, Any], formula: object, atoms: int = 1) -> bool:
    return derived.same_language(derived.Automaton.read(automaton), formula, atoms)


def test_an_automaton_is_compared_with_its_formula() -> None:
    assert same(INFINITELY_OFTEN, ALWAYS_EVENTUALLY)
    with pytest.raises(Rejected, match="accepts words that its formula does not"):
        same(INFINITELY_OFTEN, ["not", ["U", True, ["not", 0]]])
    with pytest.raises(Rejected, match="rejects words of its formula"):
        same(INFINITELY_OFTEN, EVENTUALLY)


@pytest.mark.parametrize(
    "change",
    [
        {"pairs": []},
        {"pairs": [{"avoid": [], "visits": []}]},
        {"pairs": [{"avoid": [[0, 0]], "visits": [[[0, 1]]]}]},
        {"pairs": [{"avoid": [], "visits": [[[0, 0]]]}]},
        {"pairs": [{"avoid": [[0, 1]], "visits": [[[0, 1]]]}]},
    ],
)
def test_other_acceptance_is_another_language(change: dict[str, Any]) -> None:
    with pytest.raises(Rejected, match="the automaton"):
        same({**INFINITELY_OFTEN, **change}, ALWAYS_EVENTUALLY)


@pytest.mark.parametrize(
    "change",
    [
        {"table": [[0]]},
        {"table": [[0, 1]]},
        {"table": []},
        {"letters": [1, 1]},
        {"letters": ["a", 1]},
    ],
)
def test_an_automaton_is_complete(change: dict[str, Any]) -> None:
    with pytest.raises(Rejected, match="a successor for each of its states and letters"):
        derived.Automaton.read({**INFINITELY_OFTEN, **change})


@pytest.mark.parametrize(
    "formula", [1, -1, "a", ["F", 0], ["U", 0], ["U", 0, 0, "2"], ["not"], None]
)
def test_what_is_no_formula_is_rejected(formula: object) -> None:
    with pytest.raises(Rejected, match="no LTL formula"):
        same(INFINITELY_OFTEN, formula)


def _drawn(rng: Random, depth: int) -> Any:
    if depth == 0 or rng.random() < 0.2:
        return rng.choice((0, 1, ["not", 0], ["not", 1]))
    operator = rng.choice(("and", "or", "X", "U", "U", "not", "bounded"))
    left, right = _drawn(rng, depth - 1), _drawn(rng, depth - 1)
    if operator == "bounded":
        return ["U", left, right, rng.choice((0, 1, 2))]
    return [operator, left] if operator in ("X", "not") else [operator, left, right]


def _formula(factory: LtlFactory, data: Any) -> Any:
    match data:
        case int():
            return factory.literal(data)
        case ["not", inner]:
            return factory.negation(_formula(factory, inner))
        case ["X", inner]:
            return factory.next(_formula(factory, inner))
        case ["U", left, right, *bound]:
            parts = _formula(factory, left), _formula(factory, right)
            return factory.until(*parts, bound[0] if bound else None)
        case [operator, *parts]:
            inner = [_formula(factory, part) for part in parts]
            return factory.conjunction(inner) if operator == "and" else factory.disjunction(inner)


def _holds(data: Any, word: list[int], start: int, loop: int) -> bool:
    """Whether the suffix from `start` of a word that repeats from `loop` on satisfies a formula."""
    length = len(word)

    def following(i: int) -> int:
        return i + 1 if i + 1 < length else loop

    match data:
        case int():
            return bool(word[start] >> data & 1)
        case ["not", inner]:
            return not _holds(inner, word, start, loop)
        case ["and", a, b]:
            return _holds(a, word, start, loop) and _holds(b, word, start, loop)
        case ["or", a, b]:
            return _holds(a, word, start, loop) or _holds(b, word, start, loop)
        case ["X", inner]:
            return _holds(inner, word, following(start), loop)
        case ["U", a, b, *bound]:
            for _ in range(2 * length if not bound else bound[0] + 1):
                if _holds(b, word, start, loop):
                    return True
                if not _holds(a, word, start, loop):
                    return False
                start = following(start)
            return False
    raise AssertionError(data)


@pytest.mark.parametrize("seed", range(60))
def test_languages_are_compared_right(seed: int) -> None:
    """With the automata of symcheck, and with those of other formulas, decided by short words."""
    rng = Random(seed)
    data, other = _drawn(rng, 3), _drawn(rng, 2)
    letters = [0, 1, 2, 3]
    factory = LtlFactory()
    automaton = translate(factory, _formula(factory, data), letters)
    given = {
        "letters": letters,
        "table": automaton.table.tolist(),
        "pairs": [
            {
                "avoid": sorted(automaton.edges(p.avoid)),
                "visits": [sorted(automaton.edges(v)) for v in p.visits],
            }
            for p in automaton.pairs
        ],
    }
    if automaton.initial != 0:
        pytest.fail("automata of certificates begin in state 0")
    assert same(given, data, 2)
    words = [(list(w), i) for n in (1, 2, 3) for w in product(letters, repeat=n) for i in range(n)]
    differ = any(_holds(data, w, 0, i) != _holds(other, w, 0, i) for w, i in words)
    if differ:
        with pytest.raises(Rejected, match="the automaton"):
            same(given, other, 2)


def linear(low: str, high: str, **more: Any) -> dict[str, Any]:
    return {
        "measure": "ltl", "atoms": [{"label": "won"}], "formula": ALWAYS_EVENTUALLY,
        "optimum": None, "negated": False, "bounds": {"0": [low, high]}, **more,
    }  # fmt: skip


@pytest.fixture
def recurrent(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """The probability 2/3 of winning the game again and again."""
    path = written(tmp_path, GAME)
    evidence = {
        "automaton": INFINITELY_OFTEN,
        "lower": {"vector": vector("2/3", "1", "0"), "ranks": [1, 0, None]},
        "upper": {"vector": vector("2/3", "1", "0")},
    }
    return path, certificate(path, "dtmc", linear("2/3", "2/3"), evidence)


def test_an_ltl_formula_is_proved_by_a_product(recurrent: tuple[Path, dict[str, Any]]) -> None:
    path, given = recurrent
    assert proved(path, "dtmc", given)
    for key, value in (("formula", EVENTUALLY), ("formula", True), ("atoms", ["all"])):
        changed = copy.deepcopy(given)
        changed["statement"][key] = value
        with pytest.raises(Rejected):
            proved(path, "dtmc", changed)
    given["evidence"]["automaton"] = {**INFINITELY_OFTEN, "letters": [0, 2]}
    with pytest.raises(Rejected, match="does not know the letter"):
        proved(path, "dtmc", given)


def test_a_large_automaton_is_trusted_and_said_to_be(
    recurrent: tuple[Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(derived, "_MOST_EDGES", 1)
    assert any("is trusted" in line for line in proved(recurrent[0], "dtmc", recurrent[1]))


def test_formulas_with_too_many_ways_are_not_compared() -> None:
    """Each of forty alternatives doubles the ways to satisfy all of them."""
    formula: object = True
    for distance in range(1, 41):
        near: object = 0
        for _ in range(distance):
            near = ["X", near]
        formula = ["and", formula, ["or", near, ["X", ["not", near]]]]
    assert same(INFINITELY_OFTEN, ["not", formula]) is False


def test_the_least_probability_is_not_that_of_reaching_accepted_components(tmp_path: Path) -> None:
    """A strategy may leave an accepting component again: the negation has to be maximised."""
    path = written(tmp_path, {"tra": "2 3 3\n0 0 0 1\n0 1 1 1\n1 0 1 1\n", "srew": "2 0\n"})
    side = {"vector": vector("1", "1"), "ranks": [0, 0], "choices": [0, 0]}
    evidence = {"automaton": INFINITELY_OFTEN, "lower": side, "upper": side}
    about = linear("1", "1", optimum="min", atoms=["all"])
    with pytest.raises(Rejected, match="the greatest one of the negation"):
        proved(path, "mdp", certificate(path, "mdp", about, evidence))


def test_a_condition_has_to_be_possible(recurrent: tuple[Path, dict[str, Any]]) -> None:
    path, given = recurrent
    given["statement"] = {
        "measure": "conditional", "atoms": [{"label": "won"}], "optimum": None,
        "formula": ALWAYS_EVENTUALLY, "condition": ALWAYS_EVENTUALLY,
        "bounds": {"0": ["1", "1"]},
    }  # fmt: skip
    given["evidence"] = {"both": given["evidence"], "given": copy.deepcopy(given["evidence"])}
    assert proved(path, "dtmc", given)
    given["evidence"]["given"]["lower"] = {
        "vector": vector("0", "1", "0"),
        "ranks": [None, 0, None],
    }
    with pytest.raises(Rejected, match="not proved that the condition is possible"):
        proved(path, "dtmc", given)


def test_rewards_in_time_are_uniformised(tmp_path: Path) -> None:
    """In 0 with probability 3/4 + exp(-8 t)/4, where 8 is earned per unit of time."""
    path = written(tmp_path, CLOCK)
    for measure, time, value in (
        ("instantaneous", "0", 8.0),
        ("instantaneous", "1/2", 8 * (0.75 + exp(-4) / 4)),
        ("cumulative", "0", 0.0),
        ("cumulative", "1/2", 3 + (1 - exp(-4)) / 4),
        ("cumulative", "1000", 6000.25),
        ("cumulative", "10000", 60000.25),
    ):
        ends = [str(Fraction(value * (1 - 1e-15))), str(Fraction(value * (1 + 1e-15)))]
        about = {"measure": measure, "reward": "r", "time": time, "optimum": None}
        given = certificate(path, "ctmc", {**about, "bounds": {"0": ends}}, {})
        assert proved(path, "ctmc", given)
        given["statement"]["bounds"]["0"][0] = str(Fraction(ends[1]) + Fraction(1, 1000))
        with pytest.raises(Rejected, match="not proved to be at least"):
            proved(path, "ctmc", given)


def test_stiff_chains_end_with_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """1e7 jumps are expected, and the slow rate does not let the values settle."""
    path = written(tmp_path, {**CLOCK, "tra": "3 4\n0 1 1e9\n1 0 1e9\n1 2 1e-9\n2 2 1\n"})
    monkeypatch.setattr("symcheck_verify.BUDGET", 10_000)
    given = certificate(path, "ctmc", until(None, "0", "1", time="0.01"), {})
    given["statement"]["right"] = {"states": [2]}
    with pytest.raises(Rejected, match="the budget of 10000 transitions"):
        proved(path, "ctmc", given)
    given["statement"]["time"] = "1000"
    with pytest.raises(Rejected, match="1000000000000 jumps are expected"):
        proved(path, "ctmc", given)


def test_discounted_rewards_have_no_signs(tmp_path: Path) -> None:
    """From 0, -3 + (x/2 + ...)/2: x0 = -3 + x0/4 gives -4."""
    path = written(tmp_path, {**GAME, "srew": "3 1\n0 -3\n"})
    about = {"measure": "cumulative", "reward": "r", "factor": "1/2", "optimum": None}
    about["bounds"] = {"0": ["-4", "-4"]}
    side = {"vector": vector("-4", "0", "0")}
    given = certificate(path, "dtmc", about, {"lower": side, "upper": side})
    assert proved(path, "dtmc", given)
    for factor in ("1/3", "1", "-1/2"):
        given["statement"]["factor"] = factor
        with pytest.raises(Rejected, match=r"factor P x|less than 1|at least 0"):
            proved(path, "dtmc", given)


def test_a_reward_bound_counts_what_is_earned_before(tmp_path: Path) -> None:
    """Each step from 0 costs 3: two of them win with 1/3 + 1/6."""
    path = written(tmp_path, GAME)
    about = {**until(None, "1/2", "1/2"), "reward": "r", "most": "6"}
    model = symcheck.loads(
        "dtmc module m s:[0..2]; [] s=0 -> 1/2:(s'=0)+1/3:(s'=1)+1/6:(s'=2); [] s>0 -> true;"
        'endmodule rewards "r" s=0:3; endrewards'
    )
    proof = model.check('P=? [ F^{rew{"r"}<=6} s=1 ]').certificate()
    given = certificate(path, "dtmc", about, json.loads(json.dumps(proof.evidence)))
    low, high = (str(end) for end in proof.bounds[0])
    given["statement"]["bounds"]["0"] = [low, high]
    assert proved(path, "dtmc", given)
    for most in ("5", "9", "-1", "1e12"):  # the last one has a memory of 1e12 numbers
        given["statement"]["most"] = most
        with pytest.raises(Rejected):
            proved(path, "dtmc", given)
