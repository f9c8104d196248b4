"""No switch is ignored in silence: each says when it has no effect, as an error or as a note."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.cli import main
from symcheck.cli.switches.arguments import make_parser
from symcheck.cli.switches.needs import (
    ALWAYS,
    BUILT,
    MDP,
    PROPERTY,
    VALUES,
    Given,
    unmet_needs,
)

MODELS = Path(__file__).parents[2] / "models"
DIE, GAME = MODELS / "die/die.pm", MODELS / "gambler/stakes.nm"
PARSER = make_parser()
DECLARED = {name: needs for name, needs in PARSER.needs.items() if needs != ALWAYS}

EVERYWHERE = (
    *("-pf", "-const", "-dtmc", "-ctmc", "-mdp", "-importmodel", "-importtrans", "-importstrat"),
    *("-v", "-nobuild", "-batch", "-help", "-completion", "-version", "-javaversion"),
    *("-scheduler", "-exact", "-fixdl", "-nofixdl", "-noprobchecks", "-reduce", "-symmetry"),
    *("-param", "-regions", "-lifting", "-beliefs", "-gridresolution", "-ptamethod"),
    *("-nosymmetry", "-cuddmaxmem", "-timeout", "-workdir", "-relative", "-nofair"),
    *(
        "-notruncate",
        "-nowarnunsatisfiable",
        "-nowarnblocked",
        "-nowarnrenaming",
        "-nowarnoverlaps",
    ),
)
"""Switches that have an effect in every run, or say themselves why not. Some set a default."""

VALUE_OF = {
    "-prop": "1",
    "-simpath": "3 stdout",
    "-simmethod": "ci",
    "-simconf": "0.1",
    "-epsilon": "1e-3",
    "-method": "power",
    "-order": "s,d",
    "-transient": "1",
    "-exportresults": "stdout",
    "-exporttests": "t.xml",
    "-exportpage": "p.html",
    "-exportcounterexample": "c.txt",
    "-exportpareto": "p.csv",
    "-exportregions": "r.csv",
    "-exportcertificate": "p.json",
    "-exportiterations": "i.csv",
    "-exportstrat": "s.txt",
    "-exportmodel": "m.tra",
    "-exportrewards": "r.srew r.trew",
    "-ltl2datool": "program",
    "-ltl2dasyntax": "spin",
    "-with": "prism",
    "-mainlog": "log.txt",
    "-scheduler": "tcp://localhost:1",
    "-checkpoints": "folder",
}


def words(name: str) -> list[str]:
    """The switch with a value."""
    action = PARSER._option_string_actions[name]
    if name in VALUE_OF:
        return [name, *VALUE_OF[name].split()]
    return [name] if action.nargs in (0, "?") else [name, "2"]


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Runs the command line in an empty folder; gives status and all output."""
    monkeypatch.chdir(tmp_path)

    def run(*line: str | Path) -> tuple[int, str]:
        status = main([str(word) for word in line])
        printed = capsys.readouterr()
        assert not list(tmp_path.iterdir()) or status == 0, "a refused run writes no file"
        return status, printed.out + printed.err

    return run


def test_every_switch_is_in_one_of_the_two_lists():
    assert sorted([*DECLARED, *EVERYWHERE]) == sorted(PARSER.needs)


@pytest.mark.parametrize(
    "name", [n for n, needs in DECLARED.items() if needs.all_of and n != "-with"]
)
def test_a_switch_that_misses_what_it_needs_says_so(name, said):
    needs = DECLARED[name]
    facts = {PROPERTY: False, MDP: False, VALUES: False, BUILT: False}
    (first, *_) = unmet_needs({name: Given(name, needs)}, facts)
    assert first.reason.startswith(" without ")
    line = [DIE, *words(name)]
    if BUILT in needs.all_of:
        line += ["-simpath", "1", "stdout"]
    status, out = said(*line)
    assert (status, f"no effect{first.reason}" in out) == (0 if needs.note else 2, True)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        (n, other)
        for n, needs in DECLARED.items()
        if n != "-with"
        for other in (
            *needs.not_with,
            *(("-nobuild", "-sim", "-scheduler", "-resume", "-with") if needs.model else ()),
        )
    ],
)
def test_a_switch_without_effect_beside_another_says_so(name, other, said):
    needs = DECLARED[name]
    given = {n: Given(n, PARSER.needs[n]) for n in (name, other)}
    reason = next(u.reason for u in unmet_needs(given, {}) if u.switch == name)
    if needs.note and other in ("-scheduler", "-distributed", "-resume", "-with"):
        return  # the run itself would start programs
    line = [DIE, *words(name), *words(other)]
    line += [] if other == "-batch" else ["-pf", "true"]
    if other == "-with":
        line = ["compare", *line]
    for item in needs.all_of:
        extra = item.split("|")[0]
        line += words(extra) if extra.startswith("-") else []
    status, out = said(*line)
    assert f"no effect{reason}" in out
    assert (status == 2) is not needs.note


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("-transient 1 -exportss f", "-exportss has no effect without -steadystate"),
        ("-steadystate -exporttr f", "-exporttr has no effect without -transient"),
        ("-seed 3", "-seed has no effect without -sim, -simpath or -step"),
        ("-pf true -simsamples 9", "-simsamples has no effect without -sim"),
        ("-pf true -sim -simvar 9", "-simvar has no effect without -simwidth or -simapprox"),
        ("-exportrows -exportlabels stdout", "-exportrows has no effect without -exportmodel"),
        ("-noexportheaders -pf true", "-noexportheaders has no effect without -exportmodel"),
        ("-testall", "-testall has no effect without a property to check\n  hint: name a file"),
        ("-pf true -sim -exportvector f", "-exportvector has no effect: -sim builds no model"),
        ("-seed 1 -seed 2 -step", "-seed is given twice"),
    ],
)
def test_a_request_that_would_be_ignored_is_an_error(line, message, said):
    status, out = said(DIE, *line.split())
    assert (status, message in out) == (2, True)


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("-pf true -fair", "-fair has no effect without an MDP"),
        ("-epsilon 1e-9 -maxiters 5", "-epsilon, -maxiters have no effect without a property"),
        ("-pf true -sim -bisim -m", "-bisim, -m have no effect: -sim builds no model"),
        ("-pf true -exact -abs", "-abs has no effect: -exact computes without rounding"),
        ("-pf true -jobs 2", "-jobs has no effect without several values of a constant"),
    ],
)
def test_an_option_of_computing_without_effect_is_noted(line, note, said):
    _, out = said(DIE, *line.split())
    assert note in out


def test_options_with_an_effect_are_not_noted(said):
    for line in ("-fair -epsilon 1e-3 -bisim -method interval", "-relative -nofair -fixdl"):
        assert "no effect" not in said(GAME, "-pf", "Pmax=? [ F money=8 ]", *line.split())[1]
