"""Certificates that symcheck writes: the checker accepts them, and no lie that is made of them."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from random import Random

import certificates
import pytest
import symcheck_verify

import symcheck
from oracles.statements import draw
from symcheck.errors import NumericalError, UnsupportedError, UsageError

MODELS = Path(__file__).resolve().parents[2] / "models"


@pytest.mark.parametrize("seed", range(40))
def test_certificates_are_accepted_and_lies_are_not(seed: int, tmp_path: Path) -> None:
    counts = certificates.Counter[str]()
    assert not certificates.attack(draw(seed), Random(seed), 5, tmp_path, counts)
    assert counts["accepted"] == 1


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd", "exact"])
@pytest.mark.parametrize(
    ("model", "formula", "value"),
    [
        ("die/die.pm", "P=? [ F d=6 ]", Fraction(1, 6)),
        ("die/die.pm", "P=? [ G s<7 ]", 0),
        ("die/die.pm", "R=? [ F s=7 ]", Fraction(11, 3)),
        ("gambler/stakes.nm", 'Pmax=? [ F "rich" ]', Fraction(32, 125)),
        ("gambler/stakes.nm", 'R{"bets"}min=? [ F "rich" | "ruined" ]', Fraction(41, 25)),
    ],
)
def test_engines_write_certificates_of_published_values(
    engine: str, model: str, formula: str, value: Fraction, tmp_path: Path
) -> None:
    """Numbers of states are those of exported files, whatever the order of the engine."""
    loaded = symcheck.load(MODELS / model, engine=engine)  # type: ignore[arg-type]
    proof = loaded.check(formula).certificate()
    ((low, high),) = proof.bounds.values()
    assert low <= value <= high
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "exact"])
@pytest.mark.parametrize(
    ("model", "formula", "value"),
    [
        ("die/die.pm", "P=? [ F (d=1 | d=2) & G !(s=2) ]", Fraction(1, 3)),
        ("die/die.pm", "P=? [ F d=6 || X s=2 ]", Fraction(1, 3)),
        ("die/die.pm", "P=? [ F G d=6 ]", Fraction(1, 6)),
        ("die/die.pm", "R=? [ C discount=1/2 ]", Fraction(9, 5)),
        ("die/die.pm", 'P=? [ F^{rew{"tosses"}<=3} s=7 ]', Fraction(3, 4)),
    ],
)
def test_engines_write_certificates_of_products(
    engine: str, model: str, formula: str, value: Fraction, tmp_path: Path
) -> None:
    loaded = symcheck.load(MODELS / model, engine=engine)  # type: ignore[arg-type]
    proof = loaded.check(formula).certificate()
    ((low, high),) = proof.bounds.values()
    assert low <= value <= high
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0


def test_bounds_are_about_rationals_and_not_about_doubles(tmp_path: Path) -> None:
    """0.1 and 0.9 are no doubles, and 0.1+0.2 is 0.3."""
    text = "dtmc module m s:[0..2]; [] s=0 -> 0.1:(s'=1)+0.2:(s'=1)+0.7:(s'=2); [] s>0 -> true;"
    model = symcheck.loads(f"{text} endmodule")
    proof = model.check("P=? [ F s=1 ]").certificate()
    low, high = proof.bounds[0]
    assert low <= Fraction(3, 10) <= high


def test_bounds_decide_a_comparison(tmp_path: Path) -> None:
    """The bounds decide what they do not contain."""
    die = symcheck.load(MODELS / "die/die.pm")
    proof = die.check("P<0.2 [ F d=6 ]").certificate()
    assert proof.statement["comparison"] == {"operator": "<", "threshold": "1/5", "holds": True}
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0


@pytest.mark.parametrize(
    ("model", "formula", "holds"),
    [
        ("die/die.pm", "P>=1 [ F s=7 ]", True),
        ("die/die.pm", "P<1 [ F s=7 ]", False),
        ("die/die.pm", "P>0 [ G s<7 ]", False),
        ("gambler/stakes.nm", 'Pmin>=1 [ F "rich" | "ruined" ]', True),
        ("gambler/stakes.nm", 'Pmax<1 [ F "rich" | "ruined" ]', False),
        ("gambler/stakes.nm", 'Pmax>0 [ G !("rich" | "ruined") ]', False),
    ],
)
def test_probabilities_of_0_and_1_are_proved_without_error(
    model: str, formula: str, holds: bool, tmp_path: Path
) -> None:
    proof = symcheck.load(MODELS / model).check(formula).certificate()
    ((low, high),) = proof.bounds.values()
    assert low == high
    assert low in (0, 1)
    assert proof.statement["comparison"]["holds"] is holds
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0


def test_the_greatest_value_of_initial_states_has_the_bounds_of_each(tmp_path: Path) -> None:
    text = "dtmc module m s:[0..2]; [] s<2 -> (s+1)/3:(s'=2)+(2-s)/3:(s'=s); [] s=2 -> true;"
    model = symcheck.loads(f'{text} endmodule init s<2 endinit rewards "r" s<2:1; endrewards')
    proof = model.check('filter(max, R{"r"}=? [ F s=2 ], "init")').certificate()
    assert [low <= value <= high for value, (low, high) in zip(
        (3, Fraction(3, 2)), proof.bounds.values(), strict=True)] == [True, True]  # fmt: skip
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0
    with pytest.raises(UnsupportedError):
        model.check('filter(sum, R{"r"}=? [ F s=2 ], "init")').certificate()


def test_bounds_of_rewards_are_about_as_narrow_as_those_of_values(tmp_path: Path) -> None:
    """Slack makes them wider: in a walk, by as much as the steps that it takes."""
    text = "dtmc module m s:[0..60] init 30; [] s>0&s<60 -> 1/2:(s'=s+1)+1/2:(s'=s-1);"
    model = symcheck.loads(f"{text} [] s=0|s=60 -> true; endmodule")
    ((low, high),) = model.check("T=? [ F s=0|s=60 ]").certificate().bounds.values()
    assert low <= 900 <= high
    assert high - low < 900e-6


@pytest.mark.parametrize(
    ("rewards", "message"),
    [
        ("rewards s=0:1; endrewards rewards s=1:5; endrewards", "give each of them a name"),
        ('rewards "r" s=0:1; s=1:-5; endrewards', "negative rewards"),
    ],
)
def test_rewards_that_the_rules_are_not_about_are_refused(rewards: str, message: str) -> None:
    text = "dtmc module m s:[0..2]; [] s<2 -> (s'=s+1); [] s=2 -> true; endmodule"
    result = symcheck.loads(f"{text} {rewards}").check("R{1}=? [ F s=2 ]")
    with pytest.raises(UnsupportedError, match=message):
        result.certificate()


def test_certificates_in_one_folder_keep_their_rewards_apart(tmp_path: Path) -> None:
    """The files of proof1.json are named as further rewards of proof.json are."""
    text = "dtmc module m s:[0..1]; [a] s=0 -> 1/2:(s'=0)+1/2:(s'=1); [] s=1 -> true; endmodule"
    model = symcheck.loads(f'{text} rewards "r" [a] true:3; endrewards')
    proof = model.check('R{"r"}=? [ F s=1 ]').certificate()
    files = [symcheck.save_certificate(proof, tmp_path / f"proof{i}.json") for i in ("", 1, 2)]
    assert [symcheck_verify.main([file[1], file[0]]) for file in files] == [0, 0, 0]


def test_averages_have_certificates_where_rates_differ_much(tmp_path: Path) -> None:
    """The bias is 600000 where a step takes a millionth: no gain of the average is its room."""
    model = symcheck.loads(
        "ctmc module m s:[0..4]; [] s=0 -> 1/3:(s'=1)+1e-6:(s'=2); [] s=1 -> 1e6:(s'=0)+2:(s'=3);"
        "[] s=2 -> 5:(s'=2)+1:(s'=4); [] s=3 -> 7:(s'=4); [] s=4 -> true; endmodule"
    )
    for formula, value in (("S=? [ s=4 ]", 1), ("S=? [ s=1 ]", 0)):
        proof = model.check(formula).certificate()
        ((low, high),) = proof.bounds.values()
        assert low <= value <= high <= low + Fraction(1, 10**6)
        files = symcheck.save_certificate(proof, tmp_path / "proof.json")
        assert symcheck_verify.main([files[1], files[0]]) == 0


@pytest.mark.parametrize(
    ("model", "formula", "holds"),
    [
        ("die/die.pm", "P<0.5 [ F s=7 & d<=3 ]", False),
        ("die/die.pm", "P>=1/6 [ F d=6 ]", True),
        ("die/die.pm", "P<=5/6 [ G !(d=6) ]", True),
        ("die/die.pm", "R<=11/3 [ F s=7 ]", True),
        ("die/die.pm", "P>=1/6 [ F G d=6 ]", True),
        ("gambler/stakes.nm", 'Pmax<32/125 [ F "rich" ]', False),
        ("gambler/stakes.nm", 'R{"bets"}min>=1.64 [ F "rich" | "ruined" ]', True),
    ],
)
def test_values_at_a_threshold_are_proved_as_rationals(
    model: str, formula: str, holds: bool, tmp_path: Path
) -> None:
    proof = symcheck.load(MODELS / model).check(formula).certificate()
    ((low, high),) = proof.bounds.values()
    assert low == high
    assert proof.statement["comparison"]["holds"] is holds
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0


def test_a_value_at_the_threshold_is_refused_where_the_checker_rounds() -> None:
    """It would say that the bounds do not decide the comparison."""
    text = "dtmc module m s:[0..1]; [] s=0 -> 1/3:(s'=1)+2/3:(s'=0); [] s=1 -> true; endmodule"
    with pytest.raises(NumericalError, match="near to the threshold"):
        symcheck.loads(text).check("P<=5/9 [ F<=2 s=1 ]").certificate()


@pytest.mark.parametrize(
    "formula",
    ["R=? [ C ]", "R=? [ F (s=3 & X s=7) ]", "P=? [ d=6 ]", "d=6", "1/3"],
)
def test_other_quantities_are_refused_by_name(formula: str) -> None:
    result = symcheck.load(MODELS / "die/die.pm").check(formula)
    with pytest.raises(UnsupportedError, match=r"^certificates are for"):
        result.certificate()


def test_a_wrong_value_of_a_peer_is_rejected(tmp_path: Path) -> None:
    """A tool that stops when values change little prints 0.24, and calls it precise."""
    game = symcheck.load(MODELS / "gambler/stakes.nm")
    proof = game.check('Pmax=? [ F "rich" ]').certificate()
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    given = json.loads(Path(files[0]).read_text())
    ((state, _),) = given["statement"]["bounds"].items()
    given["statement"]["bounds"][state] = ["0.239999", "0.240001"]
    Path(files[0]).write_text(json.dumps(given))
    assert symcheck_verify.main([files[1], files[0]]) == 1


def test_the_file_is_json(tmp_path: Path) -> None:
    proof = symcheck.load(MODELS / "die/die.pm").check("P=? [ F d=6 ]").certificate()
    with pytest.raises(UsageError, match=r"a certificate is a \.json file"):
        symcheck.save_certificate(proof, tmp_path / "proof.txt")
    assert not list(tmp_path.iterdir())


def test_stiff_chains_are_refused_where_the_checker_would_not_end() -> None:
    text = "ctmc module m s:[0..1]; [] s=0 -> 1e6:(s'=0)+1e-3:(s'=1); [] s=1 -> true; endmodule"
    model = symcheck.loads(text)
    with pytest.raises(UnsupportedError, match=r"at most 1E\+09 jumps"):
        model.check("P=? [ F<=10000 s=1 ]").certificate()


def test_a_bias_has_more_digits_than_doubles(tmp_path: Path) -> None:
    """A policy leaves two states after 1e12 steps, and so its bias is 1e15 times its gain."""
    slow = "1/1000001:(s'=s+1)+1000000/1000001:(s'=0)"
    text = f"dtmc module m s:[0..3]; [] s=0|s=1 -> {slow}; [] s=2 -> 1/3:(s'=2)+2/3:(s'=3);"
    model = symcheck.loads(
        f'{text} [] s=3 -> (s\'=2); endmodule rewards "r" s=0:7; s=1:1/3; s=2:1000; endrewards'
    )
    proof = model.check('R{"r"}=? [ S ]').certificate()
    ((low, high),) = proof.bounds.values()
    assert low <= 600 <= high <= low + Fraction(1, 1000)
    files = symcheck.save_certificate(proof, tmp_path / "proof.json")
    assert symcheck_verify.main([files[1], files[0]]) == 0
