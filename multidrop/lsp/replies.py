"""The replies of the server, as types of the protocol."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from lsprotocol import types

from multidrop.dialects.program_editing import Block, Offer, Span
from multidrop.dialects.program_files import Problem
from multidrop.lsp.documents import Document
from multidrop.lsp.positions import Positions
from multidrop.shell.program_text import Coloured, Edit, Fold

SOURCE = "multidrop"
TOKENS = {
    "word": "keyword",
    "starts": "function",
    "label": "label",
    "program": "label",
    "subroutine": "label",
    "variable": "variable",
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
    "starts": types.CompletionItemKind.Event,
}
_SYMBOLS = {
    "program": types.SymbolKind.Module,
    "subroutine": types.SymbolKind.Function,
    "label": types.SymbolKind.Key,
    "variable": types.SymbolKind.Variable,
}
_WORD = re.compile(r"\w+|.", re.DOTALL)
_FENCES = re.compile(r"`+")


def diagnostic(document: Document, positions: Positions, problem: Problem) -> types.Diagnostic:
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


def symbols(document: Document, positions: Positions, blocks: Iterable[Block]) -> list[types.DocumentSymbol]:
    """Return an outline, without IF and WHILE."""
    lines = document.text.lines
    found = []
    for block in blocks:
        if block.kind not in _SYMBOLS:
            continue
        last = min(block.last, len(lines) - 1)
        place = positions.range(lines, block.place)
        begin = types.Position(block.place.line, 0)
        end = types.Position(last, positions.units(lines[last], len(lines[last])))
        found.append(
            types.DocumentSymbol(
                name=block.name,
                detail=block.detail or None,
                kind=_SYMBOLS[block.kind],
                range=types.Range(begin, end),
                selection_range=place,
                children=symbols(document, positions, block.parts) or None,
            )
        )
    return found


def folding(fold: Fold) -> types.FoldingRange:
    """Return lines that may be folded away."""
    kind = types.FoldingRangeKind.Comment if fold.remarks else types.FoldingRangeKind.Region
    return types.FoldingRange(fold.first, fold.last, kind=kind)


def tokens(document: Document, positions: Positions, parts: Iterable[Coloured]) -> types.SemanticTokens:
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


def text_edits(document: Document, positions: Positions, edits: Iterable[Edit]) -> list[types.TextEdit]:
    """Return edits of a document."""
    return [types.TextEdit(positions.range(document.text.lines, each.place), each.text) for each in edits]


def workspace_edit(document: Document, edits: list[types.TextEdit], versioned: bool) -> types.WorkspaceEdit:
    """Return edits with the version that they are for, where the client heeds it."""
    if not versioned:
        return types.WorkspaceEdit(changes={document.uri: edits})
    identifier = types.OptionalVersionedTextDocumentIdentifier(uri=document.uri, version=document.version)
    return types.WorkspaceEdit(document_changes=[types.TextDocumentEdit(identifier, list(edits))])
