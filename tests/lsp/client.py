"""A client of the language server, over pipes as an editor is."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

pytest.importorskip("pygls", reason="the extra lsp is not installed")

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

WAIT = 60.0


class Editor(LanguageClient):
    """A client that keeps what the server says of documents.

    settings: what it answers for the section `symcheck`.
    """

    def __init__(self) -> None:
        super().__init__("editor", "1")
        self.settings: Mapping[str, object] | None = None
        self.said: dict[str, list[lsp.Diagnostic]] = {}
        self.refreshed = 0

        @self.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def published(_: Editor, params: lsp.PublishDiagnosticsParams) -> None:
            self.said[params.uri] = list(params.diagnostics)

        @self.feature(lsp.WORKSPACE_CODE_LENS_REFRESH)
        def refresh(_: Editor, __: None) -> None:
            self.refreshed += 1

        @self.feature(lsp.WORKSPACE_CONFIGURATION)
        def configuration(_: Editor, params: lsp.ConfigurationParams) -> list[object]:
            return [self.settings if i.section == "symcheck" else None for i in params.items]

    async def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds."""
        for _ in range(int(WAIT / 0.05)):
            if holds():
                return
            await asyncio.sleep(0.05)
        pytest.fail("the server said nothing of the kind")

    def open(
        self, path: Path, language: str, text: str | None = None
    ) -> lsp.TextDocumentIdentifier:
        if text is None:
            text = path.read_text(encoding="utf-8")
        self.text_document_did_open(
            lsp.DidOpenTextDocumentParams(lsp.TextDocumentItem(path.as_uri(), language, 1, text))
        )
        return lsp.TextDocumentIdentifier(path.as_uri())

    def change(self, document: lsp.TextDocumentIdentifier, text: str, version: int) -> None:
        self.text_document_did_change(
            lsp.DidChangeTextDocumentParams(
                lsp.VersionedTextDocumentIdentifier(version, document.uri),
                [lsp.TextDocumentContentChangeWholeDocument(text)],
            )
        )


@asynccontextmanager
async def editing(log: Path | None = None, configuration: bool = True) -> AsyncIterator[Editor]:
    editor = Editor()
    command = "from symcheck.lsp.server import main; main()"
    if log is not None:
        command = f"import sys; sys.stderr = open({str(log)!r}, 'w', buffering=1); {command}"
    await editor.start_io(sys.executable, "-c", command)
    workspace = lsp.WorkspaceClientCapabilities(
        code_lens=lsp.CodeLensWorkspaceClientCapabilities(refresh_support=True),
        configuration=configuration,
    )
    await editor.initialize_async(lsp.InitializeParams(lsp.ClientCapabilities(workspace=workspace)))
    editor.initialized(lsp.InitializedParams())
    try:
        yield editor
    finally:
        await editor.shutdown_async(None)
        editor.exit(None)
        await editor.stop()


def run(story: Callable[[Editor], Awaitable[None]]) -> None:
    async def told() -> None:
        async with editing() as editor:
            await story(editor)

    asyncio.run(told())


def place(path: Path, piece: str, further: int = 0) -> lsp.Position:
    return place_in(path.read_text(encoding="utf-8"), piece, further)


def place_in(text: str, piece: str, further: int = 0) -> lsp.Position:
    before = text[: text.index(piece) + further]
    return lsp.Position(before.count("\n"), len(before) - (before.rfind("\n") + 1))
