"""What the server replies for any text: places within the text, in the code units of the client."""

from __future__ import annotations

import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from lsprotocol import types

from multidrop.dialects.program_files import Problem
from multidrop.features.lsp import replies
from multidrop.features.lsp.replies import ColumnConverter, Document
from multidrop.shell.programs.program_text import ProgramGrammar, ProgramText
from tests.support.program_texts import TEXTS

SIZES = {
    types.PositionEncodingKind.Utf8: ("utf-8", 1),
    types.PositionEncodingKind.Utf16: ("utf-16-le", 2),
    types.PositionEncodingKind.Utf32: ("utf-32-le", 4),
}
ENCODINGS = st.sampled_from(list(SIZES))


def size(text: str, encoding: str) -> int:
    name, unit = SIZES[types.PositionEncodingKind(encoding)]
    return len(text.encode(name, "surrogatepass")) // unit


@given(st.text(max_size=8), ENCODINGS)
def test_a_column_is_its_code_units_and_the_reverse(line: str, encoding: str) -> None:
    positions = ColumnConverter(encoding)
    for column in range(len(line) + 1):
        units = positions.units(line, column)
        assert units == size(line[:column], encoding)
        assert positions.column(line, units) == column
        assert positions.column(line, units + 1) in (column, column + 1) or column == len(line)
    assert positions.column(line, 999) == len(line)


def test_utf_16_unless_something_else_was_agreed_on() -> None:
    assert ColumnConverter(None).units("a😀b", 2) == 3 and ColumnConverter(None).column("a😀b", 2) == 1


@given(TEXTS, st.sampled_from(["a.mxt", "a.prg"]), ENCODINGS)
def test_every_place_of_a_reply_is_in_the_text(text: str, file: str, encoding: str) -> None:
    tested = ProgramText(text, ProgramGrammar(file), "LMDCM")
    document, positions = Document("file:///a", 1, tested), ColumnConverter(encoding)
    ends = [size(line, encoding) for line in tested.lines]

    def inside(place: types.Range) -> bool:
        at = (place.start.line, place.start.character), (place.end.line, place.end.character)
        return at[0] <= at[1] and all(0 <= column <= ends[line] for line, column in at)

    for problem in (*tested.problems, Problem(999, 999, "beyond the text")):
        assert inside(replies.diagnostic(document, positions, problem).range)
    found = replies.symbols(document, positions, tested.outline)
    while found:
        symbol = found.pop()
        assert inside(symbol.range) and inside(symbol.selection_range) and symbol.name
        assert symbol.range.start <= symbol.selection_range.start and symbol.selection_range.end <= symbol.range.end
        found += symbol.children or ()
    line = start = 0
    data = replies.tokens(document, positions, tested.coloured(0, len(ends))).data
    for at in range(0, len(data), 5):
        down, right, width, kind, _ = data[at : at + 5]
        line, start = line + down, right if down else start + right
        assert right >= 0 and width > 0 and start + width <= ends[line] and kind < len(replies.LEGEND.token_types)


@pytest.mark.parametrize("markdown", [True, False])
def test_help_is_framed_for_clients_that_show_markdown(markdown: bool) -> None:
    shown = replies.markup(["a `b`", "  ~~~ ```` c"], markdown)
    assert shown.kind == (types.MarkupKind.Markdown if markdown else types.MarkupKind.PlainText)
    text = "a `b`\n  ~~~ ```` c"
    assert shown.value == (f"`````text\n{text}\n`````" if markdown else text)


def test_edits_have_a_version_only_where_the_client_heeds_it() -> None:
    document = Document("file:///a", 7, ProgramText("E", ProgramGrammar("a.mxt"), ""))
    edit = types.TextEdit(types.Range(types.Position(0, 0), types.Position(0, 1)), "RT")
    assert replies.workspace_edit(document, [edit], False).changes == {"file:///a": [edit]}
    (change,) = replies.workspace_edit(document, [edit], True).document_changes
    assert change.text_document.version == 7 and list(change.edits) == [edit]


PIECES = st.text(st.sampled_from("aé€😀 \n\r"), max_size=12)


@given(PIECES, PIECES, PIECES, PIECES, ENCODINGS)
def test_a_change_of_a_part_is_the_change_of_the_whole(
    before: str, old: str, after: str, new: str, encoding: str
) -> None:
    text, places = before + old + after, []
    for part in (before, before + old):
        assume(not (part.endswith("\r") and text[len(part) :].startswith("\n")))  # no place of a client
        lines = re.split(r"\r\n|\r|\n", part)
        places.append(types.Position(len(lines) - 1, size(lines[-1], encoding)))
    change = types.TextDocumentContentChangePartial(types.Range(*places), new)
    assert ColumnConverter(encoding).changed(text, change) == before + new + after
    assert ColumnConverter(encoding).changed(text, types.TextDocumentContentChangeWholeDocument(new)) == new


@given(PIECES, st.tuples(*[st.integers(0, 2**31 - 1)] * 4))
def test_a_change_at_any_place_changes_a_part(text: str, numbers: tuple[int, int, int, int]) -> None:
    one, two = types.Position(*numbers[:2]), types.Position(*numbers[2:])
    found = ColumnConverter(None).changed(text, types.TextDocumentContentChangePartial(types.Range(one, two), "NEW"))
    head, _, tail = found.partition("NEW")
    assert text.startswith(head) and text.endswith(tail) and len(head + tail) <= len(text)
