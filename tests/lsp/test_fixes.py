"""What a hint names as the remedy is a quick fix, which removes the fault."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("pygls", reason="the extra lsp is not installed")

from lsprotocol import types as lsp

from lsp.client import Editor, place_in, run
from symcheck.errors import Diagnostic
from symcheck.lsp.answers import Document, quick_fixes

ERRORS = Path(__file__).parents[1] / "errors"
CASES = sorted(ERRORS.glob("*/*.case"))
NAMES_A_TEXT = re.compile(
    r"put '.+' here|did you mean .*\?|(.* )?choose another name, such as \w+"
    r"|write (\"\w+\"|[^\s\w…]+|\w+|\w[<>]=?\w+|\w+\*\w+)( in place of .*)?|leave out .*"
)
"""Hints that name a text for what is underlined, and no form to be filled in."""


def document(path: Path) -> Document:
    """The text of a case that is faulty."""
    parts = (part.partition("\n") for part in path.read_text("utf-8").split("=== ")[1:])
    sections = {name: text for name, _, text in parts}
    model = Document("m.pm", sections["model"], "prism") if "model" in sections else None
    for name in ("properties", "expression"):
        if name in sections:
            return Document("m.pctl", sections[name], "properties", model)
    assert model is not None
    return model


def fixed(faulty: Document) -> Iterator[tuple[Diagnostic, Document]]:
    """Each fault that has a fix, and the text with this fix."""
    for fault in faulty.diagnostics:
        for _, start, end, new in quick_fixes(fault):
            text = faulty.text[:start] + new + faulty.text[end:]
            yield fault, Document(faulty.uri, text, faulty.language, faulty.model)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_a_fix_removes_its_fault(path: Path) -> None:
    faulty = document(path)
    for fault, mended in fixed(faulty):
        left = [(d.message, d.span.start) for d in mended.diagnostics]
        assert (fault.message, fault.span.start) not in left
        assert len(left) <= len(faulty.diagnostics)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_a_hint_that_names_a_text_has_a_fix(path: Path) -> None:
    for fault in document(path).diagnostics:
        if NAMES_A_TEXT.fullmatch(fault.hint or ""):
            assert quick_fixes(fault), fault.hint


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("[] x<3 -> (x=x+1);", "[] x<3 -> (x'=x+1);"),
        ("[] x<3 -> 0.5 : (x=1) + 0.5 : true;", "[] x<3 -> 0.5 : (x'=1) + 0.5 : true;"),
        ("[] x<3 && x>0 -> true;", "[] x<3 & x>0 -> true;"),
        ("[] -> true;", "[] true -> true;"),
        ("[] x<3 -> (x:=1);", "[] x<3 -> (x'=1);"),
        ("[] x<3 -> (x'=xx);", "[] x<3 -> (x'=x);"),
        ("[] x<3 -> (x'=1)", "[] x<3 -> (x'=1);"),
        ("[] x<2(x-1) -> true;", "[] x<2*(x-1) -> true;"),
        ("y : [0..3] := 2*1; [] true -> true;", "y : [0..3] init 2*1; [] true -> true;"),
        ("y : [0..3] init = 2; [] true -> true;", "y : [0..3] init  2; [] true -> true;"),
    ],
)
def test_commands(text: str, wanted: str) -> None:
    model = "dtmc\nmodule m\n  x : [0..3];\n  {}\nendmodule\n"
    ((_, mended),) = fixed(Document("m.pm", model.format(text), "prism"))
    assert mended.text == model.format(wanted)
    assert mended.diagnostics == []


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("P=? [ F x=3 ]", ["Pmin=? [ F x=3 ]", "Pmax=? [ F x=3 ]"]),
        ('R{"cost"}=? [ F x=3 ]', ['R{"cost"}min=? [ F x=3 ]', 'R{"cost"}max=? [ F x=3 ]']),
        ('Rmax{"cost"}=? [ F x=3 ]', ['R{"cost"}max=? [ F x=3 ]']),
        ('R{"coost"}max=? [ F x=3 ]', ['R{"cost"}max=? [ F x=3 ]']),
        ('Pmax=? [ F "fll" ]', ['Pmax=? [ F "full" ]']),
        ("Pmax=? [ F full ]", ['Pmax=? [ F "full" ]']),
        ("Pmax=? [ F x==3 ]", ["Pmax=? [ F x=3 ]"]),
        ("P>=1 [ []x=3 ]", ["P>=1 [ G x=3 ]"]),
        ("P>=1 [ <>x=3 ]", ["P>=1 [ F x=3 ]"]),
        ("P<=? [ F x=3 ]", []),
        ("Pmax=? [ x<3 <=5 U x=3 ]", ["Pmax=? [ x<3 U<=5 x=3 ]"]),
        ("Pmax=? [ <=5 F x=3 ]", ["Pmax=? [ F<=5 x=3 ]"]),
        ("Pmax=? [ F 2x=2*(x-1) ]", ["Pmax=? [ F 2*x=2*(x-1) ]"]),
    ],
)
def test_properties(text: str, wanted: list[str]) -> None:
    of = (
        'mdp module m x : [0..3]; [a] x<3 -> (x\'=x+1); endmodule label "full" = x=3;'
        'rewards "cost" true : 1; endrewards'
    )
    faulty = Document("m.pctl", text, "properties", Document("m.nm", of, "prism"))
    mended = [one for _, one in fixed(faulty)]
    assert [one.text for one in mended] == wanted
    assert [one.diagnostics for one in mended] == [[] for _ in wanted]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("const int myconst = 2.5;", "const double myconst = 2.5;"),
        (
            "const double constant = 1; const int k = constant;",
            "const double constant = 1; const double k = constant;",
        ),
        ("const r = true;", "const bool r = true;"),
    ],
)
def test_constants(text: str, wanted: str) -> None:
    rest = " module m x : [0..3]; [] true -> true; endmodule"
    ((_, mended),) = fixed(Document("m.pm", f"dtmc {text}{rest}", "prism"))
    assert mended.text == f"dtmc {wanted}{rest}"


def test_a_missing_prime_in_an_editor(tmp_path: Path) -> None:
    text = "dtmc\nmodule m\n  x : [0..3];\n  [] x<3 -> (x=x+1);\nendmodule\n"

    async def story(editor: Editor) -> None:
        document = editor.open(tmp_path / "m.pm", "prism", text)
        await editor.until(lambda: bool(editor.said.get(document.uri)))
        (fault,) = editor.said[document.uri]
        asked = lsp.CodeActionParams(document, fault.range, lsp.CodeActionContext([fault]))
        (fix,) = await editor.text_document_code_action_async(asked) or []
        assert isinstance(fix, lsp.CodeAction)
        assert fix.title == "Change to x'"
        assert fix.edit is not None
        assert fix.edit.changes is not None
        (edit,) = fix.edit.changes[document.uri]
        behind = place_in(text, "x=x+1", 1)
        assert (edit.range, edit.new_text) == (lsp.Range(behind, behind), "'")

    run(story)
