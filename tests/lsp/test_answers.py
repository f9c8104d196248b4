"""What an editor shows of a text, also of one with faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.errors import InputError
from symcheck.lsp.answers import Document, formatted
from symcheck.lsp.symbols import Kind
from symcheck.semantics.binding.bind import bind
from symcheck.syntax.parse import parse_model

MODELS = Path(__file__).parents[2] / "models"
OFFICE = (MODELS / "modelling" / "office.sm").read_text(encoding="utf-8")
PRINTERS = (MODELS / "modelling" / "two_printers.sm").read_text(encoding="utf-8")
PROPERTIES = '"q": P=? [ F<=60 "full" ];\nR{"waiting"}=? [ S ];\nP=? [ F queue=places ];\n'


def model(text: str) -> Document:
    return Document("file:///m.sm", text, "prism")


def properties(text: str, of: str = OFFICE) -> Document:
    return Document("file:///m.csl", text, "properties", model(of))


def at(document: Document, piece: str, further: int = 0) -> int:
    """The offset of a piece of the text, which stands there once."""
    assert document.text.count(piece) == 1
    return document.text.index(piece) + further


def test_the_declarations_of_a_model() -> None:
    found = [(s.kind, s.name, s.within) for s in model(OFFICE).names.symbols]
    assert (Kind.VARIABLE, "away", "technician") in found
    assert (Kind.REWARDS, "waiting", None) in found
    assert [n for k, n, _ in found if k is Kind.ACTION] == ["send", "print", "repair"]


@pytest.mark.parametrize("path", sorted(MODELS.glob("*/*.[pns]m")), ids=lambda p: p.name)
def test_names_are_those_of_the_syntax_tree(path: Path) -> None:
    document = model(path.read_text(encoding="utf-8"))
    bound = document.bound
    assert document.diagnostics == []
    assert bound is not None
    found = {s.name for s in document.names.symbols if s.kind is Kind.VARIABLE}
    assert found == {v.name for v in bound.variables}
    assert {s.name for s in document.names.symbols if s.kind is Kind.LABEL} == set(bound.labels)
    assert {s.name for s in document.names.symbols if s.kind is Kind.MODULE} == {
        m.name for m in bound.modules
    }


def test_a_declaration_is_found_from_a_use() -> None:
    document = model(OFFICE)
    place, symbol = document.declaration(at(document, "queue<places", 7)) or pytest.fail("none")
    assert (symbol.kind, symbol.name) == (Kind.CONSTANT, "places")
    assert place.start == at(document, "const int places", 10)


def test_a_declaration_is_found_in_a_faulty_text() -> None:
    broken = model(OFFICE.replace("queue>0 & !jammed -> 2 :", "queue>0 & -> 2"))
    assert broken.diagnostics
    assert broken.bound is None
    found = broken.declaration(at(broken, "queue<places", 7))
    assert found is not None
    assert found[1].name == "places"


def test_a_fault_of_one_property_leaves_the_others_checked() -> None:
    document = properties('P=? [ F<=60 "full" ];\nP=? [ F queue= ];\nP=? [ F quue=1 ];\n')
    assert [d.code for d in document.diagnostics] == ["syntax", "unknown-name"]
    assert [d.span.start for d in document.diagnostics] == [
        at(document, "= ]", 2),
        at(document, "quue"),
    ]
    assert [text for _, _, text in document.properties()] == [
        'P=? [ F<=60 "full" ]',
        "P=? [ F quue=1 ]",
    ]


def test_a_faulty_definition_is_told_once() -> None:
    document = properties("const int k = ;\nP=? [ F queue=k ];\nP=? [ G queue=k ];\n")
    assert [d.code for d in document.diagnostics] == ["syntax"]


def test_a_declaration_of_a_property_is_that_of_its_model() -> None:
    document = properties(PROPERTIES)
    for piece, kind in (
        ('"full"', Kind.LABEL),
        ('"waiting"', Kind.REWARDS),
        ("queue", Kind.VARIABLE),
    ):
        place, symbol = document.declaration(at(document, piece, 2)) or pytest.fail("none")
        assert symbol.kind is kind
        assert place.document is document.model


def test_a_variable_made_by_renaming() -> None:
    document = model(PRINTERS)
    found = document.declaration(at(document, "a=places & b=places", 11))
    assert found is not None
    assert (found[1].name, found[1].copy_of, found[1].within) == ("b", "a", "second")
    shown = document.hover(at(document, "a=places & b=places", 11))
    assert shown is not None
    assert "variable of module second, a copy of a, int from 0 to 4" in shown[0]


def test_hover_tells_type_range_value_and_definition() -> None:
    document = model(OFFICE)
    for piece, further, text in (
        ("true : queue", 7, "variable of module printer, int from 0 to 4"),
        ("pages : (queue'=queue+1)", 0, "= 0.5"),
        ('"full"', 1, 'label "full" = queue=places;'),
        ("[repair] !away", 1, "action of printer, technician"),
    ):
        shown = document.hover(at(document, piece, further))
        assert shown is not None
        assert text in shown[0]


def test_renaming_changes_models_and_properties() -> None:
    office = model(OFFICE)
    asked = Document("file:///m.csl", PROPERTIES, "properties", office)
    edits = office.renamed(at(office, "queue : [0..places]"), "waiting_pages", [asked])
    texts = {office: office.text, asked: asked.text}
    for place, text in sorted(edits, key=lambda e: -e.place.start):
        old = texts[place.document]
        assert old[place.start : place.end] == "queue"
        texts[place.document] = old[: place.start] + text + old[place.end :]
    assert model(texts[office]).diagnostics == []
    assert "waiting_pages=places" in texts[asked]
    assert "queue" not in texts[office].replace("with a queue", "")


@pytest.mark.parametrize(
    ("name", "why"),
    [("2x", "is no name"), ("module", "word of the language"), ("places", "already")],
)
def test_a_new_name_must_be_one(name: str, why: str) -> None:
    document = model(OFFICE)
    with pytest.raises(ValueError, match=why):
        document.renamed(at(document, "queue : [0..places]"), name)


def test_a_new_name_is_taken_in_the_model_or_in_properties_of_it() -> None:
    office = model(OFFICE)
    asked = Document("file:///m.csl", "const int k; P=? [ F<=k queue=k ]", "properties", office)
    with pytest.raises(ValueError, match=r"already a variable in m\.sm"):
        asked.renamed(at(asked, "k;"), "queue", [office, asked])
    with pytest.raises(ValueError, match=r"already a constant in m\.csl"):
        office.renamed(at(office, "places = 4"), "k", [office, asked])
    assert office.renamed(at(office, "places = 4"), "n", [office, asked])


@pytest.mark.parametrize("path", sorted(MODELS.glob("*/*.[pns]m")), ids=lambda p: p.name)
def test_formatting_changes_space_alone(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    once = formatted(text)
    assert formatted(once) == once
    assert "".join(once.split()) == "".join(text.split())
    unindented = "\n".join(line.strip() for line in text.splitlines())
    assert "".join(formatted(unindented).split()) == "".join(text.split())


def test_the_outline_has_variables_within_their_modules() -> None:
    found = {s.name: [i.name for i in inner] for s, inner in model(OFFICE).outline()}
    assert found["printer"] == ["queue", "jammed"]
    assert found["technician"] == ["away"]
    assert "full" in found


def test_the_outline_of_properties_has_those_without_a_name() -> None:
    found = [symbol.name for symbol, _ in properties(PROPERTIES).outline()]
    assert found == ["q", 'R{"waiting"}=? [ S ]', "P=? [ F queue=places ]"]


def test_colours_tell_names_apart() -> None:
    document = model(OFFICE)
    found = {(document.text[a:b], kind) for a, b, kind in document.colours()}
    assert {
        ("queue", "variable"),
        ("places", "parameter"),
        ("send", "event"),
        ("ctmc", "keyword"),
        ('"full"', "string"),
        ("0.5", "number"),
    } <= found
    starts = [a for a, _, _ in document.colours()]
    assert starts == sorted(set(starts))


MODULES = """mdp
const int N = 2; // module of a comment
module first x : [0..N]; [a] x<N -> (x'=x+1); endmodule
module second = first [ x=y ] endmodule
label "module" = x=N;
module third z : [0..1]; [a] z=0 -> (z'=1); endmodule
"""


@pytest.mark.parametrize(
    ("old", "new", "marked"),
    [
        ("", "", None),
        ("z=0 ->", "q=0 ->", "q"),
        ("[ x=y ]", "[ q=y ]", "q=y"),
        ("x=N;", "x=q;", "q"),
        ("(z'=1)", "(z'=true)", "true"),
        ("third", "first", "module first"),
        ("(x'=x+1)", "(x'=x+)", ")"),
        ("endmodule\nlabel", "label", "]"),
        ("// module", "module", "comment"),
        ("N = 2;", "N = module a endmodule 2;", "module"),
        ("N;\nmodule third", "N\nmodule third", "N"),
        ("= x=N;", "= module a endmodule x=N;", "module"),
        ("label", "rewards true : 1; module a endmodule endrewards label", ";"),
        ("module third", "formula f = 1 module third", "1"),
    ],
)
def test_faults_of_a_model_that_is_parsed_in_pieces(old: str, new: str, marked: str) -> None:
    """They are those of the whole text, at the same places."""
    text = MODULES.replace(old, new, 1)
    known = Document("file:///m.prism", MODULES, "prism")
    assert known.diagnostics == []
    found = Document("file:///m.prism", text, "prism").diagnostics
    try:
        bind(parse_model(text, "m.prism"), {})
        whole = []
    except InputError as error:
        whole = list(error.diagnostics)
    assert [(d.message, d.code, d.span.start, d.span.end, d.span.text) for d in found] == [
        (d.message, d.code, d.span.start, d.span.end, d.span.text) for d in whole
    ]
    assert not marked or any(marked in d.span.text for d in found)


def test_an_action_made_by_renaming() -> None:
    text = """mdp
module one x : [0..1]; [go1] x=0 -> (x'=1); [both] true -> true; endmodule
module two = one [ x=y, go1=go2 ] endmodule
rewards "r" [go2] true : 1; endrewards
"""
    document = Document("file:///m.nm", text, "prism")
    used = text.index("[go2] true") + 2
    found = document.declaration(used)
    assert found is not None
    assert text[found[0].start : found[0].end] == "go2"
    assert "action of two" in document.hover(used)[0]  # type: ignore[index]
    assert "action of one\n" in document.hover(text.index("[go1]") + 2)[0] + "\n"  # type: ignore[index]
    assert "action of one, two" in document.hover(text.index("[both]") + 2)[0]  # type: ignore[index]
    assert "go2" in [item.word for item in document.completions(text.index("[go2] true") + 1)]
    edits = document.renamed(used, "start")
    assert sorted(text[e.place.start : e.place.end] for e in edits) == ["go2", "go2"]


def test_names_in_quotes_are_completed_by_their_place() -> None:
    of_model = (
        'dtmc module m x : [0..1]; endmodule label "l" = x=1; rewards "r" x=0 : 1; endrewards'
    )
    for text, wanted in (('R{"', ["r"]), ('P=? [ F "', ["deadlock", "init", "l"])):
        found = properties(text, of_model).completions(len(text))
        assert sorted(item.word for item in found) == wanted
