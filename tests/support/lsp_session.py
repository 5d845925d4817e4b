"""A language server and a client of another project in this process, joined by a pair of sockets."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import socket
import threading
from collections.abc import AsyncIterator

from lsprotocol import types
from pygls.io_ import run_async
from pytest_lsp import client_capabilities
from pytest_lsp.client import LanguageClient, make_test_lsp_client

from multidrop.features.lsp.server import Server

_VERSIONS = itertools.count()


class Editor:
    """A client with one open document."""

    def __init__(self, client: LanguageClient, uri: str = "file:///tmp/a.mxt") -> None:
        self.client, self.uri, self.version = client, uri, next(_VERSIONS)

    @property
    def document(self) -> types.TextDocumentIdentifier:
        return types.TextDocumentIdentifier(self.uri)

    async def open(self, text: str, language_id: str = "plaintext") -> list[types.Diagnostic]:
        """Open the document; return its first problems."""
        item = types.TextDocumentItem(self.uri, language_id, self.version, text)
        self.client.text_document_did_open(types.DidOpenTextDocumentParams(item))
        return await self.problems()

    def change(self, text: str) -> None:
        self.version += 1
        identifier = types.VersionedTextDocumentIdentifier(self.version, self.uri)
        whole = types.TextDocumentContentChangeWholeDocument(text)
        self.client.text_document_did_change(types.DidChangeTextDocumentParams(identifier, [whole]))

    async def problems(self) -> list[types.Diagnostic]:
        """Wait for problems, and return them."""
        params = await self.client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        assert params.uri == self.uri
        return list(params.diagnostics)

    async def hover(self, line: int, column: int) -> str:
        found = await self.client.text_document_hover_async(
            types.HoverParams(self.document, types.Position(line, column))
        )
        return found.contents.value if found is not None else ""

    async def complete(self, line: int, column: int, trigger: str | None = None) -> dict[str, types.CompletionItem]:
        kind = types.CompletionTriggerKind.TriggerCharacter if trigger else types.CompletionTriggerKind.Invoked
        found = await self.client.text_document_completion_async(
            types.CompletionParams(
                self.document, types.Position(line, column), context=types.CompletionContext(kind, trigger)
            )
        )
        return {each.label: each for each in found.items}

    async def rename(self, line: int, column: int, new: str) -> types.WorkspaceEdit:
        return await self.client.text_document_rename_async(
            types.RenameParams(text_document=self.document, position=types.Position(line, column), new_name=new)
        )

    async def format(self) -> list[types.TextEdit] | None:
        options = types.FormattingOptions(tab_size=4, insert_spaces=True)
        return await self.client.text_document_formatting_async(types.DocumentFormattingParams(self.document, options))


@contextlib.asynccontextmanager
async def editing(options: object = None) -> AsyncIterator[LanguageClient]:
    """Yield a client whose session has begun; end the session, and both sides."""
    server, client = Server("LMDCM", delay=0.0), make_test_lsp_client()
    ours, theirs = socket.socketpair()
    tasks, writers = [], []
    over = threading.Event()
    for end, side in ((ours, server.protocol_server), (theirs, client)):
        reader, writer = await asyncio.open_connection(sock=end)
        side.protocol.set_writer(writer)
        writers.append(writer)
        tasks.append(
            asyncio.create_task(
                run_async(over, reader, side.protocol, error_handler=lambda problem, source: errors.append(problem))
            )
        )
    errors: list[Exception] = []
    try:
        await client.initialize_session(
            types.InitializeParams(client_capabilities("visual-studio-code"), initialization_options=options)
        )
        yield client
        await client.shutdown_async(None)
        assert errors == []
    finally:
        over.set()
        for writer in writers:
            writer.close()
        await asyncio.gather(*tasks, return_exceptions=True)
