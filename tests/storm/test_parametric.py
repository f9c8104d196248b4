"""Functions of parameters against those of Storm, at 100 random points each.

The models are the families of the quantitative verification benchmark set whose probabilities are
left open here; Herman's ring starts with all processes equal.
"""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

import symcheck
from peers_folder import PEERS, needs_peers

stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")

INSTANCES = {
    "brp": ("N=16,MAX=2", "P=? [ F s=5 ]", "P<=0.1 [ F s=5 ]"),
    "crowds": ("TotalRuns=3,CrowdSize=5", "P=? [ F observe0>1 ]", "P<=0.1 [ F observe0>1 ]"),
    "nand": ("N=5,K=1", "P=? [ F s=4 & z/N<0.1 ]", "P<=0.3 [ F s=4 & z/N<0.1 ]"),
    "herman": ("", 'R=? [ F "stable" ]', 'R<=5 [ F "stable" ]'),
}


def opened(family: str) -> tuple[str, list[str]]:
    """The text of a family with its probabilities left open, and their names."""
    name = "herman.5" if family == "herman" else family
    text = (PEERS / "qcomp" / "dtmc" / family / f"{name}.prism").read_text()
    if family == "brp":
        for lost, kept, parameter in (("0.02", "0.98", "pK"), ("0.01", "0.99", "pL")):
            text = text.replace(lost, f"(1-{parameter})").replace(kept, parameter)
        return text.replace("const int MAX;", "const int MAX; const double pK; const double pL;"), [
            "pK",
            "pL",
        ]
    names = {"crowds": ["PF", "badC"], "nand": ["perr", "prob1"], "herman": ["p"]}[family]
    for parameter in names:
        text = re.sub(
            rf"^const double +{parameter} *=.*;",
            f"const double {parameter};",
            text,
            flags=re.MULTILINE,
        )
    return re.sub(r"init\s+true\s+endinit", "", text), names


def storms_function(path: Path, constants: str, formula: str) -> object:
    """The function that Storm finds."""
    from stormpy.pars import RationalFunction

    program = stormpy.parse_prism_program(str(path), prism_compatibility=True)
    properties = stormpy.parse_properties(formula, program)
    if constants:
        program, properties = stormpy.instantiate_constants(program, constants, properties)
    model = stormpy.build_model[RationalFunction](program, properties)
    return stormpy.model_checking(model, properties[0]).get_value(model.initial_states[0])


def evaluated(function: object, point: dict[str, Fraction]) -> Fraction:
    """The value of Storm's function at a point, from its text."""
    text = re.sub(r"\^", "**", str(function))
    text = re.sub(r"\b(\d+)\b(?!\*\*)", r"Fraction(\1)", re.sub(r"\*\*(\d+)", r"**int('\1')", text))
    text = re.sub(r"int\('Fraction\((\d+)\)'\)", r"\1", text)
    return Fraction(eval(text, {"Fraction": Fraction, "int": int, **point}))


@needs_peers
@pytest.mark.parametrize("family", INSTANCES)
def test_functions_are_those_of_storm(family: str, tmp_path: Path) -> None:
    constants, formula, _ = INSTANCES[family]
    text, names = opened(family)
    path = tmp_path / "model.prism"
    path.write_text(text)
    ranges = ",".join(f"{n}=0.01:0.99" for n in names)
    ours = symcheck.load(path, constants).parametric(ranges).check(formula).value
    theirs = storms_function(path, constants, formula)
    rng = Random(family)
    for _ in range(100):
        point = {n: Fraction(rng.randint(1, 98), 99) for n in names}
        assert ours(**point) == evaluated(theirs, point)


@needs_peers
@pytest.mark.parametrize("family", INSTANCES)
def test_almost_all_of_the_box_is_decided(family: str) -> None:
    constants, _, formula = INSTANCES[family]
    text, names = opened(family)
    ranges = ",".join(f"{n}=0.01:0.99" for n in names)
    share = 0.9 if family == "brp" else 0.99  # the rest takes longer than a test may
    model = symcheck.loads(text, constants).parametric(ranges).with_options(regions=share)
    regions = model.check(formula).regions
    assert regions.share >= share
    assert {c.value for c in regions.cases if c.boxes} <= {True, False}
