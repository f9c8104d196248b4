"""The server, asked by a client over pipes as an editor does."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from shutil import copytree

import pytest

pytest.importorskip("pygls", reason="the extra lsp is not installed")

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from lsp.client import WAIT, Editor, editing, place, place_in, run

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(copytree(MODELS / "modelling", tmp_path / "m"))


def test_a_text_is_mended_while_it_is_typed(folder: Path) -> None:
    path = folder / "printer.pm"
    good = path.read_text(encoding="utf-8")

    async def story(editor: Editor) -> None:
        document = editor.open(path, "prism")
        await editor.until(lambda: editor.said.get(document.uri) == [])
        editor.change(document, good.replace("0.1 : (state'=0)", "0.2 : (state'=0)"), 2)
        await editor.until(lambda: bool(editor.said[document.uri]))
        (fault,) = editor.said[document.uri]
        assert fault.code == "update-sum"
        assert "sum to 1.1" in fault.message
        editor.change(document, good.replace("state=1 ->", "stat=1 ->"), 3)
        await editor.until(lambda: [d.code for d in editor.said[document.uri]] == ["unknown-name"])
        (fault,) = editor.said[document.uri]
        fixes = await editor.text_document_code_action_async(
            lsp.CodeActionParams(document, fault.range, lsp.CodeActionContext([fault]))
        )
        assert fixes is not None
        assert [fix.title for fix in fixes] == ["Change to 'state'"]
        editor.change(document, good, 4)
        await editor.until(lambda: editor.said[document.uri] == [])

    run(story)


def test_the_number_of_states_is_shown_at_the_type(folder: Path) -> None:
    path = folder / "office.sm"

    async def story(editor: Editor) -> None:
        document = editor.open(path, "prism")
        position = place(path, "ctmc", 1)
        for _ in range(int(WAIT / 0.2)):
            shown = await editor.text_document_hover_async(lsp.HoverParams(document, position))
            if shown is not None and "18 reachable states" in shown.contents.value:
                return
            await asyncio.sleep(0.2)
        pytest.fail("no number of states")

    run(story)


def test_a_property_is_checked_by_its_lens(folder: Path) -> None:
    path = folder / "printer.pctl"

    async def story(editor: Editor) -> None:
        document = editor.open(path, "prism-properties")
        asked = lsp.CodeLensParams(document)
        (lens,) = await editor.text_document_code_lens_async(asked) or []
        assert lens.command is not None
        assert lens.command.title == "check"
        answer = await editor.workspace_execute_command_async(
            lsp.ExecuteCommandParams(lens.command.command, arguments=lens.command.arguments)
        )
        assert str(answer).startswith("0.1176470588235")
        await editor.until(lambda: editor.refreshed == 1)
        (lens,) = await editor.text_document_code_lens_async(asked) or []
        assert lens.command is not None
        assert lens.command.title == answer

    run(story)


OPEN = """dtmc
const int N;
module m
  x : [0..N] init 1;
  [] x>0 & x<N -> 0.5 : (x'=x-1) + 0.5 : (x'=x+1);
endmodule
"""


def test_constants_of_a_check_come_from_the_settings(tmp_path: Path) -> None:
    (tmp_path / "walk.pm").write_text(OPEN, encoding="utf-8")
    asked = tmp_path / "walk.pctl"
    asked.write_text("const int k; const int other;\nP=? [ F x=N ];\nP=? [ F<=k x=0 ];\n")

    async def story(editor: Editor) -> None:
        document = editor.open(asked, "prism-properties")

        async def titles() -> list[str]:
            wanted = lsp.CodeLensParams(document)
            lenses = await editor.text_document_code_lens_async(wanted) or []
            return [lens.command.title for lens in lenses if lens.command]

        async def check(number: int) -> str:
            wanted = lsp.ExecuteCommandParams("symcheck.check", arguments=[document.uri, number])
            return str(await editor.workspace_execute_command_async(wanted))

        missing = "N without a value: set symcheck.constants to N=…"
        assert await check(0) == missing
        assert await titles() == [missing, "check"]
        editor.settings = {"constants": "N=4, unused=1"}
        settings = lsp.DidChangeConfigurationParams(None)
        editor.workspace_did_change_configuration(settings)
        await editor.until(lambda: editor.refreshed == 2)
        assert await titles() == ["check", "check"]
        value = await check(0)
        assert value.startswith("0.25 ")
        assert value.endswith(", N=4")
        assert await titles() == [value, "check"]
        assert await check(1) == "k without a value: set symcheck.constants to k=…"
        editor.settings = {"constants": "N=4,k=1"}
        assert (await check(1)).startswith("0.5 ")
        editor.settings = {"constants": "N=1:4"}
        assert (await check(0)).startswith("symcheck.constants: N is given 4 values")

    run(story)


def test_an_editor_without_settings_is_told_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "walk.pm").write_text(OPEN, encoding="utf-8")
    asked = tmp_path / "walk.pctl"
    asked.write_text("P=? [ F x=N ]")

    async def story() -> None:
        async with editing(configuration=False) as editor:
            document = editor.open(asked, "prism-properties")
            wanted = lsp.ExecuteCommandParams("symcheck.check", arguments=[document.uri, 0])
            said = await editor.workspace_execute_command_async(wanted)
            assert "set symcheck.constants to N=…" in str(said)

    asyncio.run(story())


def test_a_refused_renaming_is_answered_and_is_no_error_of_the_server(
    folder: Path, tmp_path: Path
) -> None:
    path, log = folder / "office.sm", tmp_path / "log"

    async def story() -> None:
        async with editing(log) as editor:
            document = editor.open(path, "prism")
            asked = lsp.RenameParams(document, place(path, "queue<places"), "endmodule")
            with pytest.raises(JsonRpcException, match="'endmodule' is a word of the language"):
                await editor.text_document_rename_async(asked)

    asyncio.run(story())
    assert log.read_text() == ""


def test_navigation_renaming_outline_formatting_and_colours(folder: Path) -> None:
    path, asked = folder / "office.sm", folder / "office.csl"

    async def story(editor: Editor) -> None:
        document, queries = editor.open(path, "prism"), editor.open(asked, "prism-properties")
        position = place(path, "queue<places", 8)
        found = await editor.text_document_definition_async(
            lsp.DefinitionParams(document, position)
        )
        assert isinstance(found, lsp.Location)
        assert found.range.start == place(path, "places = 4")
        label = place(path, '"full"', 2)
        edit = await editor.text_document_rename_async(lsp.RenameParams(document, label, "busy"))
        assert edit is not None
        assert edit.changes is not None
        assert {uri: len(edits) for uri, edits in edit.changes.items()} == {
            document.uri: 1,
            queries.uri: 1,
        }
        outline = await editor.text_document_document_symbol_async(
            lsp.DocumentSymbolParams(document)
        )
        assert "printer" in [symbol.name for symbol in outline or []]
        edits = await editor.text_document_formatting_async(
            lsp.DocumentFormattingParams(document, lsp.FormattingOptions(2, True))
        )
        assert not edits
        tokens = await editor.text_document_semantic_tokens_full_async(
            lsp.SemanticTokensParams(document)
        )
        assert tokens is not None
        assert len(tokens.data) % 5 == 0
        items = await editor.text_document_completion_async(
            lsp.CompletionParams(queries, lsp.Position(0, 0))
        )
        assert items
        uses = await editor.text_document_references_async(
            lsp.ReferenceParams(lsp.ReferenceContext(True), document, position)
        )
        assert [use.range.start.line for use in uses or []] == [4, 9, 12, 26]

    run(story)


def test_jupyterlab_finds_the_server() -> None:
    from importlib.metadata import entry_points

    (entry,) = [e for e in entry_points(group="jupyter_lsp_spec_v1") if e.name == "symcheck-lsp"]
    (found,) = entry.load()(None).values()
    assert found["version"] == 2
    assert found["argv"][0] == sys.executable

    async def story() -> None:
        editor = Editor()
        await editor.start_io(*found["argv"])
        answer = await editor.initialize_async(lsp.InitializeParams(lsp.ClientCapabilities()))
        assert answer.capabilities.hover_provider
        await editor.shutdown_async(None)
        editor.exit(None)
        await editor.stop()

    asyncio.run(story())


def edited(text: str, edits: Sequence[lsp.TextEdit | lsp.AnnotatedTextEdit]) -> str:
    """A text of ASCII after edits."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for edit in sorted(edits, key=lambda e: (-e.range.start.line, -e.range.start.character)):
        start, end = edit.range.start, edit.range.end
        first, last = starts[start.line] + start.character, starts[end.line] + end.character
        text = text[:first] + edit.new_text + text[last:]
    return text


@pytest.mark.parametrize(
    ("model", "properties", "variable"),
    [
        ("die/die.pm", "die/die.pctl", "d"),
        ("modelling/printer.pm", "modelling/printer.pctl", "state"),
        ("modelling/office.sm", "modelling/office.csl", "queue"),
    ],
)
def test_every_capability_on_a_model(
    model: str, properties: str, variable: str, tmp_path: Path
) -> None:
    path, asked = tmp_path / Path(model).name, tmp_path / Path(properties).name
    good, queries = ((MODELS / n).read_text(encoding="utf-8") for n in (model, properties))
    path.write_text(good, encoding="utf-8")
    asked.write_text(queries, encoding="utf-8")
    module, body = re.findall(r"^module (\w+)(.*?)^endmodule", good, re.DOTALL | re.MULTILINE)[0]
    pairs = ", ".join(f"{name}={name}_2" for name in re.findall(r"^  (\w+) :", body, re.MULTILINE))
    copy = f"module twin = {module} [ {pairs} ] endmodule\n"
    declared, used = place(path, f"{variable} : ["), place(path, f"({variable}'=", 1)

    async def story(editor: Editor) -> None:
        document, questions = editor.open(path, "prism"), editor.open(asked, "prism-properties")
        both = (document.uri, questions.uri)
        await editor.until(lambda: all(editor.said.get(uri) == [] for uri in both))
        shown = await editor.text_document_hover_async(lsp.HoverParams(document, used))
        assert shown is not None
        assert variable in shown.contents.value
        found = await editor.text_document_definition_async(lsp.DefinitionParams(document, used))
        assert isinstance(found, lsp.Location)
        assert found.range.start == declared
        uses = await editor.text_document_references_async(
            lsp.ReferenceParams(lsp.ReferenceContext(True), document, used)
        )
        assert len(uses or []) >= 3
        outline = await editor.text_document_document_symbol_async(
            lsp.DocumentSymbolParams(document)
        )
        inner = [c.name for s in outline or [] for c in getattr(s, "children", None) or []]
        assert variable in inner
        tokens = await editor.text_document_semantic_tokens_full_async(
            lsp.SemanticTokensParams(document)
        )
        assert tokens is not None
        assert len(tokens.data) >= 5 * len(uses or [])
        items = await editor.text_document_completion_async(
            lsp.CompletionParams(questions, lsp.Position(0, 0))
        )
        assert items
        words = items if isinstance(items, list) else items.items
        assert {"P=? [ ", variable} <= {item.label for item in words}
        wanted = lsp.CodeLensParams(questions)
        lenses = await editor.text_document_code_lens_async(wanted) or []
        command = lenses[0].command
        assert command is not None
        answer = await editor.workspace_execute_command_async(
            lsp.ExecuteCommandParams(command.command, arguments=command.arguments)
        )
        lenses = await editor.text_document_code_lens_async(wanted) or []
        assert lenses[0].command is not None
        assert lenses[0].command.title == answer != "check"
        # A missing semicolon, and the fix that puts it in.
        editor.change(document, re.sub(rf"(\b{variable} : \[[^;]*);", r"\1", good), 2)
        await editor.until(lambda: bool(editor.said[document.uri]))
        (fault,) = editor.said[document.uri]
        fixes = await editor.text_document_code_action_async(
            lsp.CodeActionParams(document, fault.range, lsp.CodeActionContext([fault]))
        )
        assert "Insert ';'" in [fix.title for fix in fixes or []]
        # A fault that only states show, found in the background.
        faulty = "module faulty\n  z : [0..1];\n  [] true -> (z'=z+1);\nendmodule\n"
        editor.change(document, good + faulty, 3)
        await editor.until(lambda: "z=1" in str(editor.said[document.uri]))
        (fault,) = editor.said[document.uri]
        assert fault.range.start.line == good.count("\n") + 2
        # A copy of the module, whose variables are known.
        editor.change(document, good + copy, 4)
        await editor.until(lambda: editor.said[document.uri] == [])
        for name, said in (
            (f"{variable}_2", f"a copy of {variable}"),
            ("twin", "a copy of module"),
        ):
            where = place_in(good + copy, name)
            shown = await editor.text_document_hover_async(lsp.HoverParams(document, where))
            assert shown is not None
            assert said in shown.contents.value
        renamed = await editor.text_document_rename_async(
            lsp.RenameParams(document, used, "renamed")
        )
        assert renamed is not None
        assert renamed.changes is not None
        text = edited(good + copy, renamed.changes[document.uri])
        assert f"renamed={variable}_2" in text
        assert not re.search(rf"\b{variable}=", text)
        # Renamed and formatted texts have no faults; formatting again changes nothing.
        editor.change(document, good, 5)
        await editor.until(lambda: editor.said[document.uri] == [])
        renamed = await editor.text_document_rename_async(
            lsp.RenameParams(document, used, "renamed")
        )
        assert renamed is not None
        assert renamed.changes is not None
        text = edited(good, renamed.changes[document.uri])
        assert len(renamed.changes[document.uri]) >= len(uses or []) - queries.count(variable)
        editor.change(questions, edited(queries, renamed.changes.get(questions.uri, [])), 2)
        editor.change(document, text, 6)
        await editor.until(lambda: all(editor.said[uri] == [] for uri in both))
        asking = lsp.DocumentFormattingParams(document, lsp.FormattingOptions(2, True))
        text = edited(text, await editor.text_document_formatting_async(asking) or [])
        editor.change(document, text, 7)
        assert not await editor.text_document_formatting_async(asking)

    run(story)
