"""The open documents of a client, each with its text and what is known of it; their problems are published."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

from dialects.families import program_languages
from dialects.problems import Problem
from shell.program_text import ProgramGrammar, ProgramText

DELAY = 0.25
"""Seconds without a change after which a text is checked."""


class Document(NamedTuple):
    """One state of an open document."""

    uri: str
    version: int | None
    text: ProgramText


Publish = Callable[[Document | str, list[Problem]], None]


class Documents:
    """The open documents. `publish` gets the problems of a document; for the URI of a closed one, none.

    One thread checks texts, one after the other: the loop answers meanwhile. A text that changed is not published.
    """

    def __init__(self, publish: Publish, product: str, delay: float = DELAY) -> None:
        self._publish, self.product, self._delay = publish, product, delay
        self._open: dict[str, Document] = {}
        self._grammars: dict[str, ProgramGrammar] = {}
        self._checks: dict[str, asyncio.Task[None]] = {}
        self.thread = ThreadPoolExecutor(1, "check")

    def find(self, uri: str) -> Document | None:
        """Return an open document. A file that no client opened is not read."""
        return self._open.get(uri)

    def open(self, uri: str, file: str, language_id: str, text: str, version: int | None) -> None:
        """Take a document that the client opened, and check it."""
        self._grammars[uri] = ProgramGrammar(file, _language(language_id))
        self._take(uri, text, version, 0.0)

    def change(self, uri: str, text: str, version: int | None) -> None:
        """Take another text, and check it once it stays for a moment."""
        if uri in self._grammars:
            self._take(uri, text, version, self._delay)

    def close(self, uri: str) -> None:
        """Forget a document, and clear its problems."""
        self._cancel(uri)
        self._grammars.pop(uri, None)
        if self._open.pop(uri, None) is not None:
            self._publish(uri, [])

    def end(self) -> None:
        """End the checks."""
        for uri in list(self._checks):
            self._cancel(uri)
        self.thread.shutdown(wait=False, cancel_futures=True)

    def _take(self, uri: str, text: str, version: int | None, delay: float) -> None:
        document = Document(uri, version, ProgramText(text, self._grammars[uri], self.product))
        self._open[uri] = document
        self._cancel(uri)
        self._checks[uri] = asyncio.get_running_loop().create_task(self._check(document, delay))

    def _cancel(self, uri: str) -> None:
        if task := self._checks.pop(uri, None):
            task.cancel()

    async def _check(self, document: Document, delay: float) -> None:
        await asyncio.sleep(delay)
        problems = await asyncio.get_running_loop().run_in_executor(self.thread, _problems, document.text)
        if self._open.get(document.uri) is document:
            self._publish(document, problems)


def _problems(text: ProgramText) -> list[Problem]:
    """Return the problems of a text; its names are known first, as hover and completion need them soon."""
    _ = text.names
    return list(text.problems)


def _language(language_id: str) -> str:
    """Return the family of a language by its name in editors; empty where the name of the file decides."""
    named = language_id.lower()
    return next((name for name, files in program_languages().items() if named in files.ids), "")
