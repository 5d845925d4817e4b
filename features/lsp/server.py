"""The language server: each request of the protocol as a question to a `ProgramText`.

The handlers know the protocol and no language. The reply is empty for a document that the client did not open, and for
a place without a name or a word. A `Diagnostic` becomes an error of the request, in one line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams, JsonRpcInvalidRequest
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol
from pygls.protocol.json_rpc import RPCRequest

import multidrop
from multidrop.base.errors import Diagnostic
from multidrop.dialects.program_files import Problem
from multidrop.features.lsp import replies
from multidrop.features.lsp.replies import DELAY, ColumnConverter, Document, Documents
from multidrop.shell.streams.stdout import shortened
from multidrop.simulator.declared import simulated

TRIGGERS = (" ", ",", "=")
Found = list[types.Location]


At = (
    types.HoverParams
    | types.CompletionParams
    | types.DefinitionParams
    | types.ReferenceParams
    | types.DocumentHighlightParams
    | types.PrepareRenameParams
    | types.RenameParams
)
"""The requests that name a place."""


NUMBER = int | float | str | None
"""The number of a request."""


class Protocol(LanguageServerProtocol):
    """The protocol of the library, which leaves a request without a reply that it cannot take."""

    def structure_message(self, data: dict[str, Any]) -> Any:
        try:
            return super().structure_message(data)
        except JsonRpcException:
            if "method" in data and "id" in data:
                self._refuse(data["id"], JsonRpcInvalidParams(f"{data['method']}: its parameters are wrong"))
            raise

    def handle_message(self, message: Any) -> None:
        own, method = getattr(message, "id", None), getattr(message, "method", "")
        if not hasattr(message, "jsonrpc"):
            number = message.get("id") if isinstance(message, dict) else None
            self._refuse(number, JsonRpcInvalidRequest("no message of JSON-RPC 2.0"))
        elif not isinstance(own, NUMBER) or not isinstance(method, str):
            self._refuse(own, JsonRpcInvalidRequest("an id is a number or a text, and a method a text"))
        elif isinstance(message, RPCRequest) and (self._shutdown or message.jsonrpc != self.VERSION):
            what = "after shutdown only exit is valid" if self._shutdown else f"JSON-RPC {self.VERSION} is valid"
            self._refuse(message.id, JsonRpcInvalidRequest(what))
        else:
            super().handle_message(message)

    def _refuse(self, number: object, why: JsonRpcException) -> None:
        known = number if isinstance(number, NUMBER) else None
        self._send_data({"jsonrpc": self.VERSION, "id": known, "error": why.to_response_error()})


class Server:
    """The handlers of a client's requests. `product`: the personality for which texts are checked."""

    def __init__(self, product: str, delay: float = DELAY) -> None:
        self.protocol_server = LanguageServer("multidrop", multidrop.__version__, protocol_cls=Protocol)
        self.documents = Documents(self._publish, product, delay)
        features: list[tuple[str, Callable[..., object], object | None]] = [
            (types.INITIALIZE, self.initialize, None),
            (types.TEXT_DOCUMENT_DID_OPEN, self.opened, None),
            (types.TEXT_DOCUMENT_DID_CHANGE, self.changed, None),
            (types.TEXT_DOCUMENT_DID_CLOSE, self.closed, None),
            (types.TEXT_DOCUMENT_HOVER, self.hover, None),
            (types.TEXT_DOCUMENT_COMPLETION, self.completion, types.CompletionOptions(list(TRIGGERS))),
            (types.TEXT_DOCUMENT_DEFINITION, self.definition, None),
            (types.TEXT_DOCUMENT_REFERENCES, self.references, None),
            (types.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT, self.highlight, None),
            (types.TEXT_DOCUMENT_PREPARE_RENAME, self.prepare_rename, None),
            (types.TEXT_DOCUMENT_RENAME, self.rename, types.RenameOptions(prepare_provider=True)),
            (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, self.symbols, None),
            (types.TEXT_DOCUMENT_FOLDING_RANGE, self.folding, None),
            (types.TEXT_DOCUMENT_FORMATTING, self.formatting, None),
            (types.TEXT_DOCUMENT_RANGE_FORMATTING, self.formatting, None),
            (types.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, self.tokens, replies.LEGEND),
            (types.TEXT_DOCUMENT_SEMANTIC_TOKENS_RANGE, self.tokens, replies.LEGEND),
        ]
        for name, handler, options in features:
            self.protocol_server.feature(name, options)(partial(handler))  # it sets attributes

    @property
    def _positions(self) -> ColumnConverter:
        return ColumnConverter(self.protocol_server.workspace.position_encoding)

    @property
    def _client(self) -> types.ClientCapabilities:
        return self.protocol_server.client_capabilities

    def _publish(self, document: Document | str, problems: Sequence[Problem]) -> None:
        if isinstance(document, str):
            published = types.PublishDiagnosticsParams(uri=document, diagnostics=[])
        else:
            positions = self._positions
            listed = [replies.diagnostic(document, positions, problem) for problem in problems]
            published = types.PublishDiagnosticsParams(document.uri, listed, document.version)
        self.protocol_server.text_document_publish_diagnostics(published)

    def _show(self, message: str) -> None:
        warning = types.ShowMessageParams(types.MessageType.Warning, f"multidrop: {message}")
        self.protocol_server.window_show_message(warning)

    def _place(self, params: At) -> tuple[Document, int, int] | None:
        """Return the document of a request, with line and column; None for one that is not open."""
        document = self.documents.find(params.text_document.uri)
        if document is None:
            return None
        line = params.position.line
        return document, line, self._positions.column(document.text.line(line), params.position.character)

    # Documents

    def initialize(self, params: types.InitializeParams) -> None:
        options = params.initialization_options
        product = options.get("personality") if isinstance(options, dict) else None
        if product is None:
            return
        known = [personality for row in simulated().values() if row.programs for personality in row.personalities]
        if isinstance(product, str) and product.upper() in known:
            self.documents.check_for(product.upper())
        else:
            self._show(f"no personality {shortened(str(product))}; valid: {', '.join(known)}")

    def opened(self, params: types.DidOpenTextDocumentParams) -> None:
        given = params.text_document
        file = self.protocol_server.workspace.get_text_document(given.uri).path
        self.documents.open(given.uri, file, given.language_id, given.text, given.version)

    def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        if (document := self.documents.find(params.text_document.uri)) is not None:
            text = reduce(self._positions.changed, params.content_changes, document.text.text)
            self.documents.change(document.uri, text, params.text_document.version)

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        self.documents.close(params.text_document.uri)

    # At a place

    def hover(self, params: types.HoverParams) -> types.Hover | None:
        if (at := self._place(params)) is None or (help_there := at[0].text.help_at(*at[1:])) is None:
            return None
        wanted = self._client.text_document.hover if self._client.text_document else None
        shown = replies.markup(help_there.lines, _shows_markdown(wanted.content_format if wanted else None))
        return types.Hover(shown, self._positions.range(at[0].text.lines, help_there.place))

    def completion(self, params: types.CompletionParams) -> types.CompletionList:
        items: list[types.CompletionItem] = []
        at = self._place(params)
        if at is not None and not _typed_only(params.context, at[0].text.line(at[1])[: at[2]]):
            document, text = at[0], at[0].text
            place, offers = text.offers_at(*at[1:])
            wanted = self._client.text_document.completion if self._client.text_document else None
            formats = wanted.completion_item.documentation_format if wanted and wanted.completion_item else None
            span = self._positions.range(document.text.lines, place)
            for number, offer in enumerate(offers):
                lines = text.described(offer.text)
                about = replies.markup(lines, _shows_markdown(formats)) if lines else None
                items.append(replies.item(offer, number, span, about))
        return types.CompletionList(is_incomplete=False, items=items)

    def _named(self, params: At, declared: bool, used: bool) -> Found:
        if (at := self._place(params)) is None or (named := at[0].text.name_at(*at[1:])) is None:
            return []
        name, lines = named[0], at[0].text.lines
        places = [place for place in name.places if (declared if place in name.declared else used)]
        return [types.Location(at[0].uri, self._positions.range(lines, place)) for place in places]

    def definition(self, params: types.DefinitionParams) -> Found:
        return self._named(params, declared=True, used=False)

    def references(self, params: types.ReferenceParams) -> Found:
        return self._named(params, declared=params.context.include_declaration, used=True)

    def highlight(self, params: types.DocumentHighlightParams) -> list[types.DocumentHighlight]:
        declared = [location.range for location in self._named(params, declared=True, used=False)]
        write, read = types.DocumentHighlightKind.Write, types.DocumentHighlightKind.Read
        places = [location.range for location in self._named(params, declared=True, used=True)]
        return [types.DocumentHighlight(place, write if place in declared else read) for place in places]

    def prepare_rename(self, params: types.PrepareRenameParams) -> types.PrepareRenamePlaceholder | None:
        """Return the name at a place. Raises an error where it cannot be another one."""
        if (at := self._place(params)) is None:
            return None
        try:
            _, place = at[0].text.renamable_at(*at[1:])
        except Diagnostic as problem:
            raise _refused(problem) from problem
        word = at[0].text.lines[place.line][place.start : place.stop]
        return types.PrepareRenamePlaceholder(self._positions.range(at[0].text.lines, place), word)

    def rename(self, params: types.RenameParams) -> types.WorkspaceEdit | None:
        """Return the edits that rename the name at a place. Raises an error where the new name is wrong."""
        if (at := self._place(params)) is None:
            return None
        try:
            edits = at[0].text.renamed_at(at[1], at[2], params.new_name)
        except Diagnostic as problem:
            raise _refused(problem) from problem
        wanted = self._client.workspace.workspace_edit if self._client.workspace else None
        versioned = bool(wanted and wanted.document_changes)
        return replies.workspace_edit(at[0], replies.text_edits(at[0], self._positions, edits), versioned)

    # All of a document

    def symbols(self, params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        document = self.documents.find(params.text_document.uri)
        return replies.symbols(document, self._positions, document.text.outline) if document is not None else []

    def folding(self, params: types.FoldingRangeParams) -> list[types.FoldingRange]:
        document = self.documents.find(params.text_document.uri)
        return [replies.folding(fold) for fold in document.text.folds()] if document is not None else []

    async def formatting(
        self, params: types.DocumentFormattingParams | types.DocumentRangeFormattingParams
    ) -> list[types.TextEdit] | None:
        """Return the edits to the canonical spelling: of all lines, or of those of a range."""
        document = self.documents.find(params.text_document.uri)
        if document is None:
            return None
        first, last = _lines(params, len(document.text.lines))
        try:
            edits = await self.documents.beside(partial(document.text.formatted, first, last))
        except Diagnostic as problem:
            self._show(str(problem))
            return None
        return replies.text_edits(document, self._positions, edits)

    def tokens(self, params: types.SemanticTokensParams | types.SemanticTokensRangeParams) -> types.SemanticTokens:
        """Return the coloured parts: of all lines, or of those of a range."""
        document = self.documents.find(params.text_document.uri)
        if document is None:
            return types.SemanticTokens(data=[])
        first, last = _lines(params, len(document.text.lines))
        return replies.tokens(document, self._positions, document.text.coloured(first, last))


def _lines(params: object, count: int) -> tuple[int, int]:
    """Return the first and the last line of a request; one that ends at the begin of a line leaves that out."""
    asked = getattr(params, "range", None)
    if not isinstance(asked, types.Range):
        return 0, count
    begin, end = asked.start, asked.end
    return begin.line, end.line if end.character or end.line == begin.line else end.line - 1


def _typed_only(context: types.CompletionContext | None, before: str) -> bool:
    """Whether a character that may trigger completion triggers none: a blank that no word, comma or `=` precedes."""
    if context is None or context.trigger_kind != types.CompletionTriggerKind.TriggerCharacter:
        return False
    words = before.split()
    return len(words) != 1 and not before.rstrip().endswith((",", "="))


def _shows_markdown(formats: Sequence[types.MarkupKind] | None) -> bool:
    return types.MarkupKind.Markdown in (formats or ())


def _refused(problem: Diagnostic) -> JsonRpcException:
    return JsonRpcException(str(problem), types.LSPErrorCodes.RequestFailed.value)
