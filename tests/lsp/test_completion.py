"""What is offered where: what can stand there, the likeliest first."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("pygls", reason="the extra lsp is not installed")

from lsprotocol import types as lsp

from lsp.client import Editor, run
from symcheck.lsp.answers import Document
from symcheck.lsp.completion import Item

MODEL = """mdp
const int N = 3;
formula high = x>2;
module one
  x : [0..N] init 0;
  y : bool;
  {variable}
  [go] x<N & {guard} -> 0.5 : (x'=x+1) + 0.5 : ({update});
  [stop] true -> ({first});
endmodule
module two
  z : {type};
  [{action}] true -> true;
endmodule
global g : bool;
module three = two [ {renamed}=w ] endmodule
label "full" = x=N;
label "other" = {label};
system {system} || two / { {hidden} } endsystem
rewards "cost"
  [{rewarded}] true : {reward};
endrewards
{top}
"""
FUNCTIONS = {"min(", "max(", "floor(", "mod("}


def offered(text: str, language: str = "prism", of: str | None = None) -> list[Item]:
    """What is offered at the sign ¦."""
    model = None if of is None else Document("file:///m.nm", of, "prism")
    place = text.index("¦")
    document = Document("file:///m", text.replace("¦", ""), language, model)
    return document.completions(place)


def at(place: str) -> list[Item]:
    """What is offered at a place of the model. Nothing stands at the other places."""
    return offered(re.sub(r"\{(\w+)\}", lambda m: "¦" if m[1] == place else "", MODEL))


def words(items: list[Item]) -> list[str]:
    return [item.word for item in items]


def test_actions_behind_a_bracket() -> None:
    assert words(at("action")) == ["go", "stop"]
    assert words(at("rewarded")) == ["go", "stop"]


@pytest.mark.parametrize("place", ["guard", "reward"])
def test_names_and_functions_in_expressions(place: str) -> None:
    found = words(at(place))
    assert {"x", "y", "z", "g", "N", "high", "true", "!"} | FUNCTIONS <= {*found}
    assert not {"module", "endmodule", "&", "go", "dtmc"} & {*found}
    assert found.index("x") < found.index("N") < found.index("floor(")


def test_the_variables_of_the_module_come_first() -> None:
    assert words(at("guard"))[:2] == ["x", "y"]


def test_primed_variables_of_the_module_in_an_update() -> None:
    assert words(at("update")) == ["x'=", "y'=", "g'="]
    behind_the_arrow = words(at("first"))  # a probability may begin there, too
    assert behind_the_arrow[:3] == ["x'=", "y'=", "g'="]
    assert "N" in behind_the_arrow


def test_types_in_a_declaration() -> None:
    assert words(at("type")) == ["[", "bool", "int", "clock"]


def test_the_beginning_of_a_line_in_a_module() -> None:
    found = words(at("variable"))
    assert {"[] ", "[go] ", "[stop] ", "x : bool init false;", "endmodule"} <= {*found}
    assert not {"module", "invariant", "<> ", "x"} & {*found}  # of other models, or of no line
    behind_a_command = "mdp\nmodule m\n  [go] true -> true;\n  ¦\nendmodule"
    assert words(offered(behind_a_command)) == ["[] ", "[go] ", "endmodule"]


def test_lines_that_a_type_of_models_has() -> None:
    timed, automaton = (words(offered(f"{t}\nmodule m\n¦\nendmodule")) for t in ("pta", "ma"))
    assert {"x : clock;", "invariant"} <= {*timed}
    assert "<> " in automaton


def test_the_words_that_begin_a_block_at_top_level() -> None:
    found = words(at("top"))
    assert {"module", "const", "formula", "label", "rewards", "global", "init"} <= {*found}
    assert not {"x", "endmodule", "mdp", "floor("} & {*found}
    assert words(offered("¦"))[:3] == ["dtmc", "ctmc", "mdp"]


def test_what_is_renamed_and_labels_within_labels() -> None:
    assert "z" in words(at("renamed"))
    assert "x" not in words(at("renamed"))
    assert words(offered("module a = b [x=y, z=w, ¦] endmodule")) == []  # no module b
    assert words(at("system")) == ["one", "three", "two"]
    assert words(at("hidden")) == ["go", "stop"]
    assert words(at("label"))[:2] == ['"full"', '"other"']


@pytest.mark.parametrize("text", ["module ¦", "const int ¦", "formula ¦", 'label "¦', "// a ¦"])
def test_nothing_where_a_name_is_made(text: str) -> None:
    assert offered(text) == []


DTMC = 'dtmc module m x : [0..1]; endmodule label "l" = x=1; rewards "r" x=0 : 1; endrewards'
MDP = DTMC.replace("dtmc", "mdp")
SMG = "smg player p m endplayer module m x : [0..1]; [] true -> true; endmodule"


def test_measures_of_the_type_of_the_model() -> None:
    chain, process, game, unknown = (
        words(offered("¦", "properties", of)) for of in (DTMC, MDP, SMG, None)
    )
    assert chain[:3] == ["P=? [ ", 'R{"r"}=? [ ', "R=? [ "]
    assert {"S=? [ ", "T=? [ ", "E [ "} <= {*chain}
    assert not {"Pmax=? [ ", "multi("} & {*chain}
    assert process[:4] == ["Pmax=? [ ", "Pmin=? [ ", 'R{"r"}max=? [ ', 'R{"r"}min=? [ ']
    assert "multi(" in process
    assert "P=? [ " not in process
    assert game[0] == "<<1>> Pmax=? [ "
    assert "<<1>> Smax=? [ " not in game
    assert {"P=? [ ", "Pmax=? [ "} <= {*unknown}


def test_path_operators_behind_a_bracket() -> None:
    found = words(offered("P=? [ ¦", "properties", DTMC))
    assert found[:4] == ["F", "G", "X", '"l"']
    assert "x" in found
    rewards = words(offered("R=? [ ¦", "properties", DTMC))
    assert rewards[:5] == ["F", "C<=", "C", "I=", "S"]
    assert words(offered("P=? [ x=0 ¦", "properties", DTMC))[:3] == ["U", "W", "R"]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('P=? [ F "¦', ["l", "init", "deadlock"]),
        ('P=? [ F "¦" ]', ["l", "init", "deadlock"]),
        ('"p": x=1; P=? [ F "¦', ["l", "init", "deadlock", "p"]),
        ('P=? [ F x=1 {"¦', ["l", "init", "deadlock"]),
        ('R{"¦', ["r"]),
        ('R{"¦"}=? [ C ]', ["r"]),
        ('P=? [ F{"¦', ["r"]),
    ],
)
def test_names_in_quotes(text: str, wanted: list[str]) -> None:
    assert words(offered(text, "properties", DTMC)) == wanted


def test_the_functions_of_filters() -> None:
    assert {"max", "avg", "forall"} <= {*words(offered("filter(¦", "properties", DTMC))}


@pytest.mark.parametrize(
    "fault", ["[] x<3 & -> true;", "[] x<3 -> (x=1);", "w : [0..; ", "[] )) -> ;"]
)
def test_the_place_is_known_in_a_faulty_text(fault: str) -> None:
    text = f"dtmc\nmodule m\n  x : [0..3];\n  {fault}\n  [] x<3 & -> 0.5 : (¦"
    assert words(offered(text))[0] == "x'="


def test_everything_that_is_offered_has_a_detail() -> None:
    places = re.findall(r"\{(\w+)\}", MODEL)
    texts = ["¦", "P=? [ ¦", "R=? [ x=1 ¦", 'R{"¦', "filter(¦"]
    found = [i for place in places for i in at(place)]
    found += [i for text in texts for i in offered(text, "properties", DTMC)]
    assert len(found) > 200
    assert [item for item in found if not item.detail or not item.what] == []


def test_an_editor_writes_the_first_item_in_place_of_what_is_typed(tmp_path: Path) -> None:
    text = "dtmc\nmodule m\n  xyz : [0..3];\n  b : bool;\n  [] b -> 1 : (xy"

    async def story(editor: Editor) -> None:
        document = editor.open(tmp_path / "m.pm", "prism", text)
        end = lsp.Position(4, len("  [] b -> 1 : (xy"))
        items = await editor.text_document_completion_async(lsp.CompletionParams(document, end))
        assert isinstance(items, list)
        assert [i.label for i in sorted(items, key=lambda i: i.sort_text or "")] == ["xyz'=", "b'="]
        first = items[0]
        start = lsp.Position(4, end.character - 2)
        assert first.text_edit == lsp.TextEdit(lsp.Range(start, end), "xyz'=")
        assert first.detail == "xyz : [0..3];"
        asked = editor.open(tmp_path / "m.pctl", "prism-properties", "P=? [ ")
        items = await editor.text_document_completion_async(
            lsp.CompletionParams(asked, lsp.Position(0, 6))
        )
        assert isinstance(items, list)
        first = min(items, key=lambda i: i.sort_text or "")
        assert (first.label, first.kind) == ("F", lsp.CompletionItemKind.Operator)
        assert isinstance(first.documentation, lsp.MarkupContent)
        assert "P=? [ F<=20" in first.documentation.value

    run(story)
