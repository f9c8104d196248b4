"""A text that is typed is bound as if it were new, although modules that stay are bound once."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from symcheck.errors import Diagnostic, SymcheckError
from symcheck.lsp.pieces import parse_pieces
from symcheck.semantics.binding.bind import bind, undefined_constants
from symcheck.semantics.binding.kept_modules import KeptModules
from symcheck.semantics.model import BoundModel

MODELS = Path(__file__).parents[2] / "models"
FILES = sorted(
    path
    for path in MODELS.rglob("*.*m")
    if path.read_text(encoding="utf-8").count("endmodule") >= 2 and path.stat().st_size < 10_000
)
PLACES = re.compile(r"\w+|[-+<>=!&|;:\[\]()]")
WORDS = ("0", "1", "2", "0.5", "1e-17", "true", "N", "x", "[]", "&", "+", "", " ", "// note\n")


def outcome(text: str, kept: KeptModules | None) -> tuple[BoundModel | None, list[Diagnostic]]:
    try:
        pieces = parse_pieces(text, "typed.prism")
    except SymcheckError as error:
        return None, [*error.diagnostics]
    given = {
        c.name: "true" if c.type.value == "bool" else "1"
        for c in undefined_constants(pieces.program)
    }
    try:
        return bind(pieces.program, given, kept=kept), []
    except SymcheckError as error:
        return None, [pieces.placed(d) for d in error.diagnostics]


def places(model: BoundModel) -> list[tuple[int, int]]:
    commands = (c for m in model.modules for c in m.commands)
    return [
        (part.span.start, part.span.end)
        for c in commands
        for part in (c, c.guard, *c.updates, *(u.probability for u in c.updates))
    ]


def test_files_are_found() -> None:
    assert len(FILES) > 10


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_typed_text_is_bound_as_if_it_were_new(path: Path) -> None:
    """Models are equal, and so are the places of their commands; faults are the same."""
    draw = random.Random(path.stem)
    first = text = path.read_text(encoding="utf-8")
    kept = KeptModules()
    bound = 0
    for _ in range(30):
        model, faults = outcome(text, kept)
        fresh, as_new = outcome(text, None)
        assert [(d.message, d.code, d.span) for d in faults] == [
            (d.message, d.code, d.span) for d in as_new
        ]
        assert model == fresh
        if model is not None and fresh is not None:
            bound += 1
            assert places(model) == places(fresh)
        if model is None and draw.random() < 0.7:
            text = first
        else:
            place = draw.choice([*PLACES.finditer(text)])
            text = text[: place.start()] + draw.choice(WORDS) + text[place.end() :]
    assert bound > 3


TEXT = """dtmc
const int N = 3;
const double p = 0.5;
formula most = N;
module one
  x : [0..N];
  [] x<most -> p : (x'=x+1) + 1-p : (x'=0);
  [] x=most -> (x'=x);
endmodule
module two
  y : [0..N];
  [] y<most & x>0 -> (y'=y+1);
endmodule
"""


def bound_after(old: str, new: str) -> tuple[BoundModel, BoundModel]:
    """The models before and after a change."""
    kept = KeptModules()
    before, _ = outcome(TEXT, kept)
    after, faults = outcome(TEXT.replace(old, new, 1), kept)
    assert old in TEXT
    assert before is not None
    assert after is not None, faults
    return before, after


@pytest.mark.parametrize(("old", "new", "stays"), [("x>0", "x>1", 0), ("x=most ->", "x=N ->", 1)])
def test_a_module_that_stays_is_bound_once(old: str, new: str, stays: int) -> None:
    before, after = bound_after(old, new)
    assert after.modules[stays] is before.modules[stays]
    assert after.modules[1 - stays] is not before.modules[1 - stays]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("N = 3", "N = 2"),
        ("p = 0.5", "p = 0.25"),
        ("most = N", "most = N-1"),
        ("formula most", "// the places of a formula are part of it\nformula most"),
        ("dtmc", "mdp"),
        ("y : [0..N]", "y : [0..1]"),
        ("module one", "global z : bool;\nmodule one"),
    ],
)
def test_all_modules_are_bound_anew_after_a_change_of_what_they_may_refer_to(
    old: str, new: str
) -> None:
    before, after = bound_after(old, new)
    assert not {*map(id, before.modules)} & {*map(id, after.modules)}


def test_sums_are_looked_at_where_a_module_changes() -> None:
    kept = KeptModules()
    outcome(TEXT, kept)
    model, _ = outcome(TEXT.replace("1-p", "1-p-1e-10"), kept)
    assert model is not None
    assert len(model.warnings) == 1
    again, _ = outcome(TEXT.replace("1-p", "1-p-1e-10").replace("x>0", "x>1"), kept)
    assert again is not None
    assert again.warnings == model.warnings


def test_a_fault_of_a_formula_is_told_as_long_as_a_module_uses_it() -> None:
    """Also if the module that told it first is mended."""
    kept = KeptModules()
    text = TEXT.replace("formula most = N", "formula most = N + bad")
    faults = outcome(text, kept)[1]
    assert [d.span.text for d in faults] == ["bad"]
    assert outcome(text.replace("x<most", "x<N").replace("x=most", "x=N"), kept)[1]
