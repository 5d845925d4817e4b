"""The open documents of a client, each with its text and what is known of it; their problems are published."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from math import inf
from typing import NamedTuple, TypeVar

from multidrop.dialects.families import program_languages
from multidrop.dialects.program_files import Problem
from multidrop.shell.program_text import ProgramGrammar, ProgramText
from multidrop.shell.threads import in_thread

T = TypeVar("T")
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

    One thread at a time checks a text: the loop answers meanwhile, and the process may end. The problems of a text that
    changed are not published.
    """

    def __init__(self, publish: Publish, product: str, delay: float = DELAY) -> None:
        self._publish, self._product, self._delay = publish, product, delay
        self._open: dict[str, Document] = {}
        self._grammars: dict[str, ProgramGrammar] = {}
        self._checks: dict[str, asyncio.Task[None]] = {}
        self._turn = asyncio.Lock()
        self._work: set[asyncio.Task[object]] = set()

    def check_for(self, product: str) -> None:
        """Check texts that come from now on for this personality."""
        self._product = product

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

    async def beside(self, work: Callable[[], T]) -> T:
        """Do slow work in a thread, after what was begun before. A caller that goes leaves it to its end."""
        task: asyncio.Task[T] = asyncio.get_running_loop().create_task(self._in_turn(work))
        self._work.add(task)
        task.add_done_callback(self._ended)
        return await asyncio.shield(task)

    def _ended(self, task: asyncio.Task[T]) -> None:
        """Forget work that ended; a failure is the caller's, if there still is one."""
        self._work.discard(task)
        if not task.cancelled():
            task.exception()

    async def _in_turn(self, work: Callable[[], T]) -> T:
        async with self._turn:
            return await in_thread(work, inf, "check of a text")

    def _take(self, uri: str, text: str, version: int | None, delay: float) -> None:
        document = Document(uri, version, ProgramText(text, self._grammars[uri], self._product))
        self._open[uri] = document
        self._cancel(uri)
        self._checks[uri] = asyncio.get_running_loop().create_task(self._check(document, delay))

    def _cancel(self, uri: str) -> None:
        if task := self._checks.pop(uri, None):
            task.cancel()

    async def _check(self, document: Document, delay: float) -> None:
        await asyncio.sleep(delay)
        problems = await self.beside(partial(self._problems, document))
        if self._open.get(document.uri) is document:
            self._publish(document, problems)

    def _problems(self, document: Document) -> list[Problem]:
        """Return the problems of a text; its names are known first, as hover and completion need them soon."""
        if self._open.get(document.uri) is not document:  # it changed while another text was checked
            return []
        _ = document.text.names
        return list(document.text.problems)


def _language(language_id: str) -> str:
    """Return the family of a language by its name in editors; empty where the name of the file decides."""
    named = language_id.lower()
    return next((name for name, files in program_languages().items() if named in files.ids), "")
