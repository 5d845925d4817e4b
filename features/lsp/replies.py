"""The open documents of a client, and the replies of the server about them, as types of the protocol."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import inf
from typing import NamedTuple, TypeVar

from lsprotocol import types

from multidrop.dialects.editing import Block, Offer, Span
from multidrop.dialects.families import program_languages
from multidrop.dialects.program_files import Problem
from multidrop.shell.programs.program_text import Coloured, Fold, ProgramGrammar, ProgramText, TextEdit
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
        self._product = product

    def find(self, uri: str) -> Document | None:
        return self._open.get(uri)

    def open(self, uri: str, file: str, language_id: str, text: str, version: int | None) -> None:
        named = language_id.lower()  # where no editor calls a language so, the name of the file decides
        language = next((name for name, files in program_languages().items() if named in files.ids), "")
        self._grammars[uri] = ProgramGrammar(file, language)
        self._take(uri, text, version, 0.0)

    def change(self, uri: str, text: str, version: int | None) -> None:
        """Take another text, and check it once it stays for a moment."""
        if uri in self._grammars:
            self._take(uri, text, version, self._delay)

    def close(self, uri: str) -> None:
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


_LIMITS: Mapping[str, tuple[int, ...]] = {
    types.PositionEncodingKind.Utf8: (0x80, 0x800, 0x10000),
    types.PositionEncodingKind.Utf16: (0x10000,),
    types.PositionEncodingKind.Utf32: (),
}
"""The characters from which on each takes one code unit more."""


_LINE_END = re.compile(r"\r\n|\r|\n")
"""The end of a line for every client."""


class ColumnConverter:
    """Converts columns of lines between characters and code units; UTF-16 unless both agreed on another encoding."""

    def __init__(self, encoding: str | None) -> None:
        self._limits = _LIMITS[encoding or types.PositionEncodingKind.Utf16]

    def _width(self, character: str) -> int:
        return 1 + sum(ord(character) >= limit for limit in self._limits)

    def units(self, line: str, column: int) -> int:
        """Return the code units of the first characters of a line."""
        part = line[:column]
        return len(part) if part.isascii() or not self._limits else sum(map(self._width, part))

    def column(self, line: str, units: int) -> int:
        """Return the characters before a number of code units; a position inside a character is before it."""
        if line.isascii() or not self._limits:
            return min(units, len(line))
        for column, character in enumerate(line):
            units -= self._width(character)
            if units < 0:
                return column
        return len(line)

    def changed(self, text: str, change: types.TextDocumentContentChangeEvent) -> str:
        """Return the text after a change of all of it or of a range; an end before its start is there, too."""
        if isinstance(change, types.TextDocumentContentChangeWholeDocument):
            return change.text
        ends = [0, *(match.end() for match in _LINE_END.finditer(text))]

        def offset(place: types.Position) -> int:
            if place.line >= len(ends):
                return len(text)
            line = _LINE_END.split(text[ends[place.line] :], maxsplit=1)[0]
            return ends[place.line] + self.column(line, place.character)

        start = offset(change.range.start)
        return text[:start] + change.text + text[max(start, offset(change.range.end)) :]

    def range(self, lines: Sequence[str], place: Span) -> types.Range:
        line = lines[place.line] if place.line < len(lines) else ""
        start, stop = self.units(line, place.start), self.units(line, place.stop)
        return types.Range(types.Position(place.line, start), types.Position(place.line, stop))


SOURCE = "multidrop"
TOKENS = {
    "word": "keyword",
    "starts": "function",
    "label": "label",
    "program": "label",
    "subroutine": "label",
    "variable": "variable",
    "constant": "variable",
    "text": "string",
    "remark": "comment",
}
"""The type of a token, by the kind of a part of a line. `starts`, a word that can start motion, is a function."""
LEGEND = types.SemanticTokensLegend(token_types=list(dict.fromkeys(TOKENS.values())), token_modifiers=["declaration"])
_NUMBERS = {kind: LEGEND.token_types.index(name) for kind, name in TOKENS.items()}
_ITEMS = {
    "label": types.CompletionItemKind.Reference,
    "subroutine": types.CompletionItemKind.Function,
    "variable": types.CompletionItemKind.Variable,
    "constant": types.CompletionItemKind.Constant,
    "starts": types.CompletionItemKind.Event,
}
_SYMBOLS = {
    "program": types.SymbolKind.Module,
    "subroutine": types.SymbolKind.Function,
    "label": types.SymbolKind.Key,
    "variable": types.SymbolKind.Variable,
    "constant": types.SymbolKind.Constant,
}
_WORD = re.compile(r"\w+|.", re.DOTALL)
_FENCES = re.compile(r"`+")


def diagnostic(document: Document, positions: ColumnConverter, problem: Problem) -> types.Diagnostic:
    """Return a problem at the word where it begins."""
    lines = document.text.lines
    line = min(problem.line - 1, len(lines) - 1)
    source = lines[line]
    start = min(problem.column - 1, len(source))
    word = _WORD.match(source, start)
    kind = types.DiagnosticSeverity.Warning if problem.warning else types.DiagnosticSeverity.Error
    return types.Diagnostic(
        range=positions.range(lines, Span(line, start, word.end() if word else start)),
        message=f"{problem.what}; {problem.hint}" if problem.hint else problem.what,
        severity=kind,
        source=SOURCE,
    )


def markup(lines: Sequence[str], markdown: bool) -> types.MarkupContent:
    """Return help with its columns kept, where the client shows Markdown."""
    text = "\n".join(lines)
    if not markdown:
        return types.MarkupContent(types.MarkupKind.PlainText, text)
    fence = "`" * max([3, *(len(run) + 1 for run in _FENCES.findall(text))])
    return types.MarkupContent(types.MarkupKind.Markdown, f"{fence}text\n{text}\n{fence}")


def item(offer: Offer, number: int, place: types.Range, about: types.MarkupContent | None) -> types.CompletionItem:
    """Return a completion; the client shows them in the order of their numbers."""
    return types.CompletionItem(
        label=offer.text,
        kind=_ITEMS.get(offer.kind, types.CompletionItemKind.Keyword),
        detail=offer.meaning,
        documentation=about,
        sort_text=f"{number:04}",
        text_edit=types.TextEdit(place, offer.text),
    )


def symbols(document: Document, positions: ColumnConverter, blocks: Iterable[Block]) -> list[types.DocumentSymbol]:
    """Return an outline, without IF and WHILE."""
    lines = document.text.lines
    outline = []
    for block in blocks:
        if block.kind not in _SYMBOLS:
            continue
        last = min(block.last, len(lines) - 1)
        place = positions.range(lines, block.place)
        begin = types.Position(block.place.line, 0)
        end = types.Position(last, positions.units(lines[last], len(lines[last])))
        outline.append(
            types.DocumentSymbol(
                name=block.name,
                detail=block.detail or None,
                kind=_SYMBOLS[block.kind],
                range=types.Range(begin, end),
                selection_range=place,
                children=symbols(document, positions, block.parts) or None,
            )
        )
    return outline


def folding(fold: Fold) -> types.FoldingRange:
    kind = types.FoldingRangeKind.Comment if fold.remarks else types.FoldingRangeKind.Region
    return types.FoldingRange(fold.first, fold.last, kind=kind)


def tokens(document: Document, positions: ColumnConverter, parts: Iterable[Coloured]) -> types.SemanticTokens:
    """Return the coloured parts, each by its distance from the one before."""
    data: list[int] = []
    line = start = 0
    for part in parts:
        number = _NUMBERS.get(part.kind)
        if number is None:  # what is wrong is a diagnostic
            continue
        source = document.text.lines[part.place.line]
        begin = positions.units(source, part.place.start)
        width = positions.units(source, part.place.stop) - begin
        before = start if part.place.line == line else 0
        data += (part.place.line - line, begin - before, width, number, int(part.declares))
        line, start = part.place.line, begin
    return types.SemanticTokens(data=data)


def text_edits(document: Document, positions: ColumnConverter, edits: Iterable[TextEdit]) -> list[types.TextEdit]:
    return [types.TextEdit(positions.range(document.text.lines, edit.place), edit.text) for edit in edits]


def workspace_edit(document: Document, edits: list[types.TextEdit], versioned: bool) -> types.WorkspaceEdit:
    """Return edits with the version that they are for, where the client heeds it."""
    if not versioned:
        return types.WorkspaceEdit(changes={document.uri: edits})
    identifier = types.OptionalVersionedTextDocumentIdentifier(uri=document.uri, version=document.version)
    return types.WorkspaceEdit(document_changes=[types.TextDocumentEdit(identifier, list(edits))])
