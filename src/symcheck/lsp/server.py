"""The language server: the protocol of editors, spoken by pygls. `main` is `symcheck-lsp`."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit
from weakref import WeakKeyDictionary

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from symcheck.errors import Diagnostic
from symcheck.lsp.answers import COLOURS, MODELS, Document, Place, formatted, quick_fixes
from symcheck.lsp.checks import Fault, Verdict, check, explore
from symcheck.lsp.symbols import Kind, Symbol
from symcheck.semantics.binding.kept_modules import KeptModules
from symcheck.version import __version__

__all__ = ["SymcheckServer", "main", "make_server"]

SETTLES = 0.02
"""Seconds without a change after which faults are told."""

PAUSE = 0.4
"""Seconds without typing after which a model is explored."""

CHECK = "symcheck.check"
"""The command of a lens: check a property."""

_TOKEN_TYPES = sorted({*COLOURS.values(), "comment", "number", "function", "keyword"})
_SYMBOLS = {
    Kind.VARIABLE: lsp.SymbolKind.Variable,
    Kind.CONSTANT: lsp.SymbolKind.Constant,
    Kind.FORMULA: lsp.SymbolKind.Function,
    Kind.LABEL: lsp.SymbolKind.String,
    Kind.MODULE: lsp.SymbolKind.Module,
    Kind.ACTION: lsp.SymbolKind.Event,
    Kind.REWARDS: lsp.SymbolKind.Struct,
    Kind.PROPERTY: lsp.SymbolKind.Property,
    Kind.PLAYER: lsp.SymbolKind.Class,
}
_ITEMS = {
    "variable": lsp.CompletionItemKind.Variable,
    "constant": lsp.CompletionItemKind.Constant,
    "formula": lsp.CompletionItemKind.Function,
    "module": lsp.CompletionItemKind.Module,
    "reward structure": lsp.CompletionItemKind.Struct,
    "function": lsp.CompletionItemKind.Function,
    "filter": lsp.CompletionItemKind.Function,
    "action": lsp.CompletionItemKind.Event,
    "command": lsp.CompletionItemKind.Event,
    "declaration": lsp.CompletionItemKind.Snippet,
    "keyword": lsp.CompletionItemKind.Keyword,
    "measure": lsp.CompletionItemKind.Operator,
    "query": lsp.CompletionItemKind.Operator,
    "path operator": lsp.CompletionItemKind.Operator,
    "sign": lsp.CompletionItemKind.Operator,
}


class SymcheckServer(LanguageServer):
    """The server, the documents that are open, and what is known of them."""

    def __init__(self) -> None:
        super().__init__("symcheck-lsp", __version__)
        self.documents: dict[str, Document] = {}
        self.states: WeakKeyDictionary[Document, int | None] = WeakKeyDictionary()
        self.verdicts: dict[tuple[str, str, str], Verdict] = {}
        self.following: dict[str, asyncio.Task[None]] = {}

    # ------------------------------------------------------------------------------------ documents

    def document(self, uri: str) -> Document:
        """The present version of a document, with the model of its properties."""
        source = self.workspace.get_text_document(uri)
        language = "prism" if _is_model(uri, source.language_id) else "properties"
        model = None if language == "prism" else self.model_of(uri)
        known = self.documents.get(uri)
        if known is None or known.text != source.source or known.model is not model:
            kept = KeptModules() if known is None else known.kept
            known = self.documents[uri] = Document(uri, source.source, language, model, kept)
        return known

    def model_of(self, uri: str) -> Document | None:
        """The model of properties: of the files beside them the one with the same name, or the
        only one.
        """
        path = Path(unquote(urlsplit(uri).path))
        beside = [p for p in _listed(path.parent) if p.suffix in MODELS]
        same = [p for p in beside if p.stem == path.stem]
        found = same[:1] or (beside if len(beside) == 1 else [])
        return self.document(found[0].as_uri()) if found else None

    def others(self) -> list[Document]:
        """All documents that are open."""
        return [self.document(uri) for uri in self.workspace.text_documents]

    # --------------------------------------------------------------------------------------- client

    async def constants(self, uri: str) -> str:
        """The values of constants in the settings of the editor; "" for none.

        The whole section is asked for, because not every editor follows the points in a name.
        """
        workspace = self.client_capabilities.workspace
        if workspace is None or not workspace.configuration:
            return ""
        asked = lsp.ConfigurationItem(scope_uri=uri, section="symcheck")
        (found,) = await self.workspace_configuration_async(lsp.ConfigurationParams([asked]))
        return str(found.get("constants") or "") if isinstance(found, Mapping) else ""

    def refresh_lenses(self) -> None:
        """Let the editor ask for the lenses anew, if it can."""
        workspace = self.client_capabilities.workspace
        if workspace and workspace.code_lens and workspace.code_lens.refresh_support:
            self.workspace_code_lens_refresh(None)

    # --------------------------------------------------------------------------------------- places

    def offset(self, uri: str, position: lsp.Position) -> int:
        """The offset of a position of the client."""
        return self.workspace.get_text_document(uri).offset_at_position(position)

    def range(self, place: Place) -> lsp.Range:
        """A piece of a text as a range of the client."""
        return _range(self, place.document, place.start, place.end)

    def location(self, place: Place) -> lsp.Location:
        """A piece of a text as a location of the client."""
        return lsp.Location(place.document.uri, self.range(place))

    # ---------------------------------------------------------------------------------- diagnostics

    def publish(self, uri: str, faults: Sequence[Diagnostic | Fault] = ()) -> None:
        """Tell the faults of a document: those of its text, and further ones."""
        document = self.document(uri)
        known = [_diagnostic(self, document, d) for d in document.diagnostics]
        further = [_diagnostic(self, document, fault) for fault in faults]
        version = self.workspace.get_text_document(uri).version
        self.text_document_publish_diagnostics(
            lsp.PublishDiagnosticsParams(uri, [*known, *further], version)
        )

    def changed(self, uri: str, settles: float = 0.0) -> None:
        """Follow a document: tell its faults and those of its properties, and after a pause what
        its states show. If it changes again meanwhile, this begins anew: a text that is typed
        faster than it is read has an answer at its end, not one for each key.

        Args:
            uri: the document.
            settles: seconds to wait for another change.
        """
        self.leave(uri)
        self.following[uri] = asyncio.ensure_future(self._follow(uri, settles))

    def leave(self, uri: str) -> None:
        """Follow a document no longer."""
        if uri in self.following:
            self.following.pop(uri).cancel()

    async def _follow(self, uri: str, settles: float) -> None:
        await asyncio.sleep(settles)
        self.publish(uri)
        document = self.document(uri)
        for other in self.others():
            if other.model is not None and other.model.uri == uri:
                self.publish(other.uri)
        if document.language == "prism" and document.bound is not None and not document.bound.given:
            await asyncio.sleep(PAUSE)
            found = await explore(document.text)
            self.states[document] = found.states
            self.publish(uri, (*document.warnings, *found.faults))


def _is_model(uri: str, language: str | None) -> bool:
    return language == "prism" or (language != "prism-properties" and uri.lower().endswith(MODELS))


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _range(server: SymcheckServer, document: Document, start: int, end: int) -> lsp.Range:
    first, last = (
        lsp.Position(line - 1, column - 1)
        for line, column in map(document.source.position, (start, end))
    )
    if document.text.isascii():
        return lsp.Range(first, last)
    source = server.workspace.get_text_document(document.uri)
    return source.position_codec.range_to_client_units(source.lines, lsp.Range(first, last))


def _diagnostic(
    server: SymcheckServer, document: Document, fault: Diagnostic | Fault
) -> lsp.Diagnostic:
    match fault:
        case Fault():
            start, end, severity = fault.start, fault.end, fault.severity
        case Diagnostic():
            start, end, severity = fault.span.start, fault.span.end, fault.severity
    hint = f"\nhint: {fault.hint}" if fault.hint else ""
    return lsp.Diagnostic(
        _range(server, document, start, max(end, min(start + 1, len(document.text)))),
        fault.message + hint,
        lsp.DiagnosticSeverity.Warning if severity == "warning" else lsp.DiagnosticSeverity.Error,
        fault.code,
        source="symcheck",
    )


def make_server() -> SymcheckServer:
    """A server with all that it answers."""
    server = SymcheckServer()

    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def opened(ls: SymcheckServer, params: lsp.DidOpenTextDocumentParams) -> None:
        ls.changed(params.text_document.uri)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def changed(ls: SymcheckServer, params: lsp.DidChangeTextDocumentParams) -> None:
        ls.changed(params.text_document.uri, SETTLES)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def closed(ls: SymcheckServer, params: lsp.DidCloseTextDocumentParams) -> None:
        uri = params.text_document.uri
        ls.leave(uri)
        ls.documents.pop(uri, None)
        ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, []))

    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    def hover(ls: SymcheckServer, params: lsp.HoverParams) -> lsp.Hover | None:
        document = ls.document(params.text_document.uri)
        offset = ls.offset(document.uri, params.position)
        found = document.hover(offset, ls.states.get(document))
        if found is None:
            return None
        text, place = found
        return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text), ls.range(place))

    @server.feature(
        lsp.TEXT_DOCUMENT_COMPLETION,
        lsp.CompletionOptions(trigger_characters=["[", "(", ":", '"', "{"]),
    )
    def completion(ls: SymcheckServer, params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
        document = ls.document(params.text_document.uri)
        offset = ls.offset(document.uri, params.position)
        typed = ls.range(Place(document, document.typed(offset), offset))
        return [
            lsp.CompletionItem(
                item.word,
                kind=_ITEMS.get(item.what),
                detail=item.detail or item.what,
                documentation=lsp.MarkupContent(
                    lsp.MarkupKind.Markdown, f"```prism\n{item.example}\n```"
                )
                if item.example
                else None,
                sort_text=f"{place:04}",
                text_edit=lsp.TextEdit(typed, item.word),
            )
            for place, item in enumerate(document.completions(offset))
        ]

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    def definition(ls: SymcheckServer, params: lsp.DefinitionParams) -> lsp.Location | None:
        document = ls.document(params.text_document.uri)
        found = document.declaration(ls.offset(document.uri, params.position))
        return None if found is None else ls.location(found[0])

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    def references(ls: SymcheckServer, params: lsp.ReferenceParams) -> list[lsp.Location]:
        document = ls.document(params.text_document.uri)
        offset = ls.offset(document.uri, params.position)
        declared = document.declaration(offset)
        return [
            ls.location(use)
            for use in document.uses(offset, ls.others())
            if params.context.include_declaration or declared is None or use != declared[0]
        ]

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare_rename(ls: SymcheckServer, params: lsp.PrepareRenameParams) -> lsp.Range | None:
        document = ls.document(params.text_document.uri)
        offset = ls.offset(document.uri, params.position)
        found = document.names.at(offset)
        if found is None or document.declaration(offset) is None:
            return None
        return ls.range(Place(document, found.start, found.end))

    @server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
    def rename(ls: SymcheckServer, params: lsp.RenameParams) -> lsp.WorkspaceEdit:
        document = ls.document(params.text_document.uri)
        offset = ls.offset(document.uri, params.position)
        try:
            edits = document.renamed(offset, params.new_name, ls.others())
        except ValueError as error:
            raise JsonRpcInvalidParams(str(error)) from None
        changes: dict[str, list[lsp.TextEdit]] = {}
        for place, text in edits:
            changes.setdefault(place.document.uri, []).append(lsp.TextEdit(ls.range(place), text))
        return lsp.WorkspaceEdit(changes)

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def outline(ls: SymcheckServer, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        document = ls.document(params.text_document.uri)

        def shown(symbol: Symbol, inner: Sequence[Symbol]) -> lsp.DocumentSymbol:
            return lsp.DocumentSymbol(
                symbol.name,
                _SYMBOLS[symbol.kind],
                ls.range(Place(document, symbol.first, symbol.last)),
                ls.range(Place(document, symbol.start, symbol.end)),
                symbol.kind.value,
                children=[shown(one, ()) for one in inner],
            )

        return [shown(symbol, inner) for symbol, inner in document.outline()]

    @server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
    def formatting(ls: SymcheckServer, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
        document = ls.document(params.text_document.uri)
        text = formatted(document.text)
        if text == document.text:
            return []
        return [lsp.TextEdit(ls.range(Place(document, 0, len(document.text))), text)]

    @server.feature(
        lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, lsp.SemanticTokensLegend(_TOKEN_TYPES, [])
    )
    def colours(ls: SymcheckServer, params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
        document = ls.document(params.text_document.uri)
        data: list[int] = []
        before = lsp.Position(0, 0)
        for start, end, kind in document.colours():
            at = ls.range(Place(document, start, end))
            line, column = at.start.line, at.start.character
            same = line == before.line
            data += [
                line - before.line,
                column - before.character if same else column,
                at.end.character - column,
                _TOKEN_TYPES.index(kind),
                0,
            ]
            before = at.start
        return lsp.SemanticTokens(data)

    @server.feature(
        lsp.TEXT_DOCUMENT_CODE_ACTION,
        lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix]),
    )
    def fixes(ls: SymcheckServer, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        document = ls.document(params.text_document.uri)
        first = ls.offset(document.uri, params.range.start)
        last = ls.offset(document.uri, params.range.end)
        return [
            lsp.CodeAction(
                title,
                lsp.CodeActionKind.QuickFix,
                [_diagnostic(ls, document, fault)],
                edit=lsp.WorkspaceEdit(
                    {document.uri: [lsp.TextEdit(ls.range(Place(document, start, end)), text)]}
                ),
            )
            for fault in document.diagnostics
            if fault.span.start <= last and first <= max(fault.span.end, fault.span.start + 1)
            for title, start, end, text in quick_fixes(fault)
        ]

    @server.feature(lsp.TEXT_DOCUMENT_CODE_LENS)
    def lenses(ls: SymcheckServer, params: lsp.CodeLensParams) -> list[lsp.CodeLens]:
        document = ls.document(params.text_document.uri)
        if document.model is None:
            return []
        found = []
        for number, (start, end, text) in enumerate(document.properties()):
            verdict = ls.verdicts.get((document.model.text, document.text, text))
            title = "check" if verdict is None else verdict.text
            command = lsp.Command(title, CHECK, arguments=[document.uri, number])
            found.append(lsp.CodeLens(ls.range(Place(document, start, end)), command))
        return found

    @server.command(CHECK)
    async def checked(ls: SymcheckServer, uri: str, number: int) -> str | None:
        document = ls.document(uri)
        properties = document.properties()
        if document.model is None or not 0 <= number < len(properties):
            return None
        model, text = document.model.text, properties[number][2]
        verdict = await check(model, document.text, number, await ls.constants(uri))
        ls.verdicts[model, document.text, text] = verdict
        ls.refresh_lenses()
        return verdict.text

    @server.feature(lsp.WORKSPACE_DID_CHANGE_CONFIGURATION)
    def configured(ls: SymcheckServer, _: lsp.DidChangeConfigurationParams) -> None:
        if ls.verdicts:  # they are those of other constants
            ls.verdicts.clear()
            ls.refresh_lenses()

    @server.feature(lsp.SHUTDOWN)
    def ended(ls: SymcheckServer, _: None) -> None:
        for uri in [*ls.following]:
            ls.leave(uri)

    return server


def main() -> None:
    """Serve an editor over standard input and output."""
    # What an editor asks for in vain is answered, and is no error of the server.
    logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_no_refusal)
    make_server().start_io()


def _is_no_refusal(record: logging.LogRecord) -> bool:
    return record.exc_info is None or not isinstance(record.exc_info[1], JsonRpcInvalidParams)
