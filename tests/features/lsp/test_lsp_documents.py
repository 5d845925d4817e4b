"""The open documents of the language server: what is checked, when, and what is published."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import pytest

from multidrop.dialects.program_files import Problem
from multidrop.features.lsp.replies import DELAY, Document, Documents

T = TypeVar("T")
URI = "file:///a.mxt"
WRONG, RIGHT = "PG 1\nMX 5\nE\nPG\n", "PG 1\nMR 5\nH\nE\nPG\n"

pytestmark = pytest.mark.virtual


class Checked(Documents):
    """Documents that are checked in the loop, and what they publish: URI, version and the lines of the problems."""

    def __init__(self) -> None:
        super().__init__(self._note, "LMDCM")
        self.published: list[tuple[str, int | None, list[int]]] = []
        self.checks = 0

    def _note(self, document: Document | str, problems: Sequence[Problem]) -> None:
        uri, version = (document, None) if isinstance(document, str) else (document.uri, document.version)
        self.published.append((uri, version, [each.line for each in problems]))

    async def beside(self, work: Callable[[], T]) -> T:
        self.checks += 1
        return work()


@pytest.fixture
def documents() -> Iterator[Checked]:
    yield Checked()


async def test_a_text_is_checked_at_once_when_it_is_opened(documents: Checked) -> None:
    documents.open(URI, "a.mxt", "mcode", WRONG, 1)
    await asyncio.sleep(0.01)
    assert documents.published == [(URI, 1, [2])]


async def test_a_text_that_changes_on_is_checked_once_after_a_pause(documents: Checked) -> None:
    documents.open(URI, "a.mxt", "mcode", WRONG, 0)
    for version in range(1, 20):
        await asyncio.sleep(DELAY / 2)
        documents.change(URI, WRONG if version < 19 else RIGHT, version)
    assert documents.checks == 1
    await asyncio.sleep(DELAY * 0.9)
    assert documents.checks == 1
    await asyncio.sleep(DELAY * 0.2)
    assert documents.published == [(URI, 0, [2]), (URI, 19, [])] and documents.checks == 2


async def test_a_closed_document_has_no_problems_and_is_not_checked_any_more(documents: Checked) -> None:
    documents.open(URI, "a.mxt", "mcode", WRONG, 0)
    await asyncio.sleep(0.01)
    documents.change(URI, WRONG + "' more\n", 1)
    documents.close(URI)
    documents.change(URI, WRONG, 2)
    documents.close(URI)
    await asyncio.sleep(9 * DELAY)
    assert documents.published == [(URI, 0, [2]), (URI, None, [])] and documents.find(URI) is None


async def test_each_document_has_its_own_pause(documents: Checked) -> None:
    for name in ("a", "b"):
        documents.open(f"file:///{name}.mxt", f"{name}.mxt", "", RIGHT, 0)
    documents.change("file:///a.mxt", WRONG, 1)
    await asyncio.sleep(2 * DELAY)
    assert documents.published == [("file:///b.mxt", 0, []), ("file:///a.mxt", 1, [2])]
