"""What words and signs mean: every one has a sentence, and an example that is well-formed."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

pytest.importorskip("pygls", reason="the extra lsp is not installed")

from lsprotocol import types as lsp

from lsp.client import Editor, place_in, run
from symcheck.errors import SyntaxFault
from symcheck.lsp.answers import Document
from symcheck.lsp.help import FILTERS, HELP, OF_TERMINAL, Help
from symcheck.syntax.ast import MEASURE_WORDS, FilterOperator
from symcheck.syntax.grammars import load
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.parse import parse_model, parse_properties

ENTRIES = [*HELP.items(), *OF_TERMINAL.items()]


def test_every_word_and_operator_has_help() -> None:
    spelled = [w for name in ("prism", "properties") for w in load(name).spelling.values()]
    words = {*MEASURE_WORDS, *(word for word in spelled if word[0].isalpha())}
    assert words | {*Function, *Operator, *UnaryOperator} <= {*HELP}
    assert set(get_args(FilterOperator)) == {*FILTERS}


@pytest.mark.parametrize(("word", "text"), ENTRIES, ids=[word for word, _ in ENTRIES])
def test_help_is_a_sentence_and_a_well_formed_example(word: str, text: Help) -> None:
    assert text.meaning.endswith(".")
    assert "\n" not in text.meaning
    for parse, frame in (
        (parse_properties, "{}"),
        (parse_model, "{}"),
        (parse_model, "module m {} endmodule"),
    ):
        try:
            parse(frame.format(text.example))
        except SyntaxFault:
            continue
        return
    pytest.fail(f"the example of {word} is faulty")


MODEL = "pta\nmodule m\n  x : [0..1] init 0;\n  c : clock;\n  [] mod(x,2)=0 -> (x'=1);\nendmodule\n"
PROPERTIES = """Pmax=? [ F<=20 x=1 ];
P>=0.5 [ x=0 U x=1 ];
P>=0.5 [ x=1 R x=0 ];
R{"r"}=? [ C<=10 ];
filter(avg, S=? [ x=1 ]);
P=? [ x=0 W x=1 || F x=1 ];
"""


@pytest.mark.parametrize(
    ("text", "piece", "meaning"),
    [
        (MODEL, "pta", "timed automaton"),
        (MODEL, "init 0", "The initial value of a variable"),
        (MODEL, "clock", "grows with time"),
        (MODEL, "mod(", "The remainder of a division"),
        (MODEL, "-> (", "between the guard of a command and its updates"),
        (PROPERTIES, "Pmax", "The largest probability"),
        (PROPERTIES, "P>=0.5 [ x=0", "The probability of the paths in brackets"),
        (PROPERTIES, "F<=20", "F<=k a: within k steps"),
        (PROPERTIES, "U x", "a U b: "),
        (PROPERTIES, "R x", "a R b: "),
        (PROPERTIES, 'R{"r"}', "The expected reward"),
        (PROPERTIES, "C<=10", "the expected reward up to k"),
        (PROPERTIES, "filter", "One value from those of several states"),
        (PROPERTIES, "avg", "the mean value"),
        (PROPERTIES, "S=?", "The long run"),
        (PROPERTIES, "W x", "a W b: "),
        (PROPERTIES, "|| F", "given another one"),
    ],
)
def test_hovering_tells_what_a_word_means_where_it_stands(
    text: str, piece: str, meaning: str
) -> None:
    document = Document("file:///m", text, "prism" if text == MODEL else "properties")
    shown = document.hover(text.index(piece))
    assert shown is not None
    assert meaning in shown[0]


def test_a_declared_name_is_shown_before_a_word_of_the_language() -> None:
    text = "P=? [ F T=1 ]"
    model = Document("file:///m.pm", "dtmc module m T : [0..1]; endmodule", "prism")
    shown = Document("file:///m.pctl", text, "properties", model).hover(text.index("T="))
    assert shown is not None
    assert "variable of module m" in shown[0]


def test_an_editor_shows_the_meaning_and_the_example(tmp_path: Path) -> None:
    async def story(editor: Editor) -> None:
        document = editor.open(tmp_path / "m.pctl", "prism-properties", PROPERTIES)
        where = place_in(PROPERTIES, "filter", 2)
        shown = await editor.text_document_hover_async(lsp.HoverParams(document, where))
        assert shown is not None
        assert isinstance(shown.contents, lsp.MarkupContent)
        assert shown.contents.value == HELP["filter"].markdown
        assert shown.range is not None
        assert shown.range.start == place_in(PROPERTIES, "filter")
        assert shown.range.end == place_in(PROPERTIES, "filter", 6)

    run(story)
