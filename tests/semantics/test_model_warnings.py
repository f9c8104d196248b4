"""Warnings about what a beginner may not have meant, and none about what is."""

from __future__ import annotations

from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main

MODELS = Path(__file__).parents[2] / "models"
OPEN = {
    "crowds.pm": "TotalRuns=3,CrowdSize=5",
    "kanban.sm": "t=1",
    "channels.nm": "p=0.5,q=0.2",
    "multiplex.pm": "N=4,K=1",
    "retransmission.pm": "N=16,MAX=2",
    "tandem.sm": "c=5",
    "zeroconf.pm": "p=0.1,q=0.5",
    "duel.prism": "hit=0.001",
    "piglet.prism": "goal=2",
    "pig.prism": "goal=20",
    "inspection.prism": "n=5,k=2",
    "maze.prism": "slip=0",
    "cell_injection.pm": "CellBoundaryX=104,CellBoundaryY=104,NoisePercentage=0.005,StepSizeXY=27,"
    "InitialPositionXY=100,MaxDistance=250,Damping=1",
}


def codes(text: str, **options: bool) -> list[tuple[str, int]]:
    """The code and the line of each warning."""
    model = symcheck.loads(text, **options)  # type: ignore[arg-type]
    return [
        (d.code, d.span.source.position(d.span.start)[0])
        for d in (*model.warnings, *model.overlaps)
    ]


def dtmc(commands: str, more: str = "") -> str:
    return f"dtmc\nmodule m\nx : [0..3];\n{commands}\nendmodule\n{more}"


@pytest.mark.parametrize("guard", ["x=4", "x>3", "x<0", "x>1 & x<2", "mod(x,5)=4", "false & x=1"])
def test_guards_that_no_value_satisfies(guard: str) -> None:
    found = codes(dtmc(f"[] x<3 -> (x'=x+1);\n[] {guard} -> (x'=0);\n[] x=3 -> true;"))
    assert found == ([] if "false" in guard else [("unsatisfiable", 5)])


def test_labels_that_no_value_satisfies() -> None:
    more = 'label "done" = x=3;\nlabel "late" = x>3;\nlabel "never" = false;'
    assert codes(dtmc("[] true -> (x'=3);", more)) == [("unsatisfiable", 7)]
    assert codes(dtmc("[] true -> (x'=3);", more), warn_unsatisfiable=False) == []


def test_what_a_constant_switches_off_is_meant() -> None:
    text = "const int N=2; " + dtmc("[] x<3 -> (x'=x+1);\n[] N>2 & x=3 -> (x'=0);")
    assert codes(text) == []


def test_what_has_no_bounds_or_too_many_values_is_not_looked_at() -> None:
    text = dtmc("[] true -> true;\n[] y<0 & z>z -> true;")
    wide = "module n y : [0..1000000]; z : int; endmodule"
    assert codes(text + wide) == []


SYNCHRONISED = """mdp
module one x : [0..3]; [go] x=LEFT -> (x'=0); [] true -> true; endmodule
module two y : [0..3]; [go] y=2 & x=1 -> true; [go] y=3 & x=1 -> true; endmodule
"""


def test_actions_on_which_modules_never_agree() -> None:
    never = SYNCHRONISED.replace("LEFT", "2")
    assert codes(never) == [("blocked-action", 3)]
    assert codes(never, warn_blocked=False) == []
    assert "[go] never happens: one and two" in symcheck.loads(never).warnings[0].message
    assert codes(SYNCHRONISED.replace("LEFT", "1")) == []


def test_commands_that_overlap() -> None:
    overlapping = dtmc("[] x<2 -> (x'=x+1);\n[] x>0 -> (x'=x-1);")
    assert codes(overlapping) == [("overlap", 5)]
    assert codes(overlapping, warn_overlaps=False) == []
    (warning,) = symcheck.loads(overlapping).overlaps
    assert "in state (x=1), this command and an earlier one are enabled" in warning.message
    assert warning.hint is not None
    for kind in ("mdp", "ctmc"):
        assert codes(overlapping.replace("dtmc", kind)) == []


def test_commands_overlap_in_reachable_states_only() -> None:
    assert codes(dtmc("[] x<2 -> (x'=1-x);\n[] x>1 -> true;\n[] x>2 -> true;")) == []


@pytest.mark.parametrize(
    "file",
    sorted(p for p in MODELS.glob("*/*") if p.suffix in (".pm", ".sm", ".nm", ".ma", ".prism")),
    ids=lambda p: p.name,
)
def test_models_of_the_literature_have_no_warnings(file: Path) -> None:
    model = symcheck.load(file, OPEN.get(file.name, ""))
    assert model.warnings == ()
    if not model.is_timed and model.growth is None:
        assert model.overlaps == ()


def test_the_command_line_shows_each_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.pm"
    file.write_text(dtmc("[] x<2 -> (x'=x+1);\n[] x>0 -> (x'=x-1);\n[] x=7 -> true;"))
    main([str(file), "-pf", "P=? [ F x=2 ]"])
    out = capsys.readouterr().out
    assert out.count(f"Warning: {file}:6:4: the guard holds for no values of its variables") == 1
    assert out.count(f"Warning: {file}:5:4: in state (x=1), this command and an earlier one") == 1
    main([str(file), "-nowarnunsatisfiable", "-nowarnoverlaps", "-nowarnblocked"])
    assert "Warning" not in capsys.readouterr().out


def test_labels_that_are_lists_of_states_are_not_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    main([str(MODELS / "queue/queue.sm"), "-exportmodel", "out.all", "-pf", "true"])
    assert symcheck.load_explicit("out.all").warnings == ()


def of_property(formula: str, **options: bool) -> tuple[str, ...]:
    text = dtmc("[] x<3 -> (x'=x+1);\n[] x=3 -> true;", 'label "end" = x=3;')
    return symcheck.loads(text, **options).check(formula).warnings  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("formula", "condition"),
    [
        ("P=? [ F x=7 ]", "x=7"),
        ("P=? [ x<3 U x>3 ]", "x>3"),
        ('P=? [ F x<0 & "end" ]', "x<0"),
        ("S=? [ x>1 & x<2 ]", "x>1 & x<2"),
        ("P>=0.5 [ F P>0 [ X x=4 ] ]", "x=4"),
        ("const int k = 9; T=? [ F x=k ]", "x=9"),
    ],
)
def test_conditions_of_properties_that_no_value_satisfies(formula: str, condition: str) -> None:
    expected = f"{condition} holds for no values of its variables: x is in [0..3]"
    assert of_property(formula) == (expected,)
    assert of_property(formula, warn_unsatisfiable=False) == ()


@pytest.mark.parametrize(
    "formula",
    [
        'P=? [ F "end" ]',
        "P=? [ F x=3 | x=7 ]",
        "P=? [ G !(x=7) ]",
        "P=? [ F false ]",
        "x+7",
        "P>=0.7 [ F<=7 x=3 ]",
        "T=? [ F x=3 ]",
    ],
)
def test_conditions_of_properties_that_some_values_satisfy(formula: str) -> None:
    assert of_property(formula) == ()


@pytest.mark.parametrize(
    ("old", "warned"), [("lamda1", True), ("lambda1", False), ("mu", False), ("unrelated", False)]
)
def test_a_renamed_name_that_is_misspelt(old: str, warned: bool) -> None:
    text = (
        "ctmc const double lambda1=1; const double lambda2=2; const double mu=3;\n"
        "module a s : [0..1]; [] s=0 -> lambda1 : (s'=1); endmodule\n"
        f"module b = a [ s=t, {old}=lambda2 ] endmodule"
    )
    found = [d.message for d in symcheck.loads(text).warnings]
    assert found == (["module a has no lamda1; did you mean lambda1?"] if warned else [])
    assert symcheck.loads(text, warn_renaming=False).warnings == ()


ELECTION = """mdp
formula all = c1>0 & c2>0;
module one c1 : [0..2]; [] c1=0 -> (c1'=1); [go] all -> (c1'=2); endmodule
"""


@pytest.mark.parametrize(
    ("renaming", "doubtful"),
    [("c1=c2", True), ("c1=c2, go=stop", True), ("c1=c2, c2=c1", False), ("c2=c3, c1=c2", False)],
)
def test_a_copy_in_which_one_name_stands_for_two_variables(renaming: str, doubtful: bool) -> None:
    others = "module three c3 : [0..2]; [] true -> true; endmodule"
    text = f"{ELECTION}module two = one [ {renaming} ] endmodule\n{others}"
    found = [(d.message, d.hint) for d in symcheck.loads(text).warnings if d.code == "renaming"]
    message = "in module two, c2 stands for c1 and for c2 of one"
    hint = "rename c2 too, as in c2=c1; formulas are renamed as well"
    assert found == ([(message, hint)] if doubtful else [])
    assert "renaming" not in {d.code for d in symcheck.loads(text, warn_renaming=False).warnings}


def test_a_copy_that_reads_the_variable_of_a_third_module_is_meant() -> None:
    text = """dtmc
module leader at : [0..1]; [] true -> (at'=1-at); endmodule
module a x : [0..1]; [] at=0 -> (x'=1); [] at=1 -> (x'=0); endmodule
module b = a [ x=y ] endmodule"""
    assert [d.code for d in symcheck.loads(text).warnings] == []
