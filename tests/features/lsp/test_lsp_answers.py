"""The language server to the letter: what it announces, what it replies for a document that nobody opened, ranges."""

from __future__ import annotations

from typing import Any

from multidrop.features.lsp.replies import LEGEND
from tests.support.lsp_bytes import URI, Client, message

TEXT = "pg 1\nlb g1\nmr 5\nh\ne\npg\n"
PLACE = {"textDocument": {"uri": URI}, "position": {"line": 2, "character": 1}}
OPTIONS = {"options": {"tabSize": 4, "insertSpaces": True}}


def opened(text: str = TEXT, uri: str = URI) -> bytes:
    item = {"uri": uri, "languageId": "mcode", "version": 1, "text": text}
    return message(method="textDocument/didOpen", params={"textDocument": item})


def asked(method: str, number: int, **more: object) -> bytes:
    return message(id=number, method=f"textDocument/{method}", params={**PLACE, **more})


def span(first: int, last: int, character: int = 0) -> dict[str, Any]:
    return {"start": {"line": first, "character": 0}, "end": {"line": last, "character": character}}


async def replies(*written: bytes) -> list[Any]:
    """What a server replies to requests, after what it announces."""
    client = Client(*written)
    found = await client.replies(1 + sum(b'"id"' in each for each in written))
    await client.end()
    return [each["result"] for each in sorted(found, key=lambda each: int(each["id"]))]


async def test_it_announces_what_it_does() -> None:
    [begun] = await replies()
    able = begun["capabilities"]
    assert begun["serverInfo"]["name"] == "multidrop" and able["renameProvider"] is True
    assert able["completionProvider"]["triggerCharacters"] == [" ", ",", "="]
    assert able["semanticTokensProvider"]["legend"]["tokenTypes"] == LEGEND.token_types
    assert able["semanticTokensProvider"]["full"] and able["semanticTokensProvider"]["range"]
    for name in ("hover", "definition", "references", "documentHighlight", "documentSymbol", "foldingRange"):
        assert able[f"{name}Provider"], name
    assert able["documentFormattingProvider"] and able["documentRangeFormattingProvider"]

    prepares = {"textDocument": {"rename": {"prepareSupport": True}}}
    params = {"processId": None, "rootUri": None, "capabilities": prepares}
    client = Client(begin=message(id=0, method="initialize", params=params))
    [begun] = await client.replies(1)
    assert begun["result"]["capabilities"]["renameProvider"] == {"prepareProvider": True}
    await client.end()


EMPTY: list[tuple[str, dict[str, Any], Any]] = [
    ("hover", {}, None),
    ("completion", {}, {"isIncomplete": False, "items": []}),
    ("definition", {}, []),
    ("references", {"context": {"includeDeclaration": True}}, []),
    ("documentHighlight", {}, []),
    ("prepareRename", {}, None),
    ("rename", {"newName": "G2"}, None),
    ("documentSymbol", {}, []),
    ("foldingRange", {}, []),
    ("formatting", OPTIONS, None),
    ("rangeFormatting", {**OPTIONS, "range": span(0, 1)}, None),
    ("semanticTokens/full", {}, {"data": []}),
    ("semanticTokens/range", {"range": span(0, 1)}, {"data": []}),
]


async def test_for_a_document_that_nobody_opened_each_reply_is_empty() -> None:
    requests = [asked(method, number, **more) for number, (method, more, _) in enumerate(EMPTY, 1)]
    _, *found = await replies(*requests)
    assert found == [empty for *_, empty in EMPTY]
    change = {"textDocument": {"uri": URI, "version": 2}, "contentChanges": [{"text": "E"}]}
    closed = message(method="textDocument/didClose", params={"textDocument": {"uri": URI}})
    _, *again = await replies(message(method="textDocument/didChange", params=change), closed, requests[0])
    assert again == [None]


async def lines_of(first: int, last: int, character: int) -> tuple[list[int], list[int]]:
    """The lines that a range formats, and those that it colours."""
    more = {"range": span(first, last, character)}
    formatting, tokens = asked("rangeFormatting", 1, **OPTIONS, **more), asked("semanticTokens/range", 2, **more)
    _, edits, coloured = await replies(opened(), formatting, tokens)
    line, found = 0, list[int]()
    for down in coloured["data"][::5]:
        line += down
        found.append(line)
    return [each["range"]["start"]["line"] for each in edits], sorted({*found})


async def test_a_range_that_ends_at_the_begin_of_a_line_leaves_that_line_out() -> None:
    assert await lines_of(1, 3, 0) == ([1, 2], [1, 2])
    assert await lines_of(1, 3, 1) == ([1, 2, 3], [1, 2, 3])
    assert await lines_of(2, 2, 0) == ([2], [2])
    assert await lines_of(2, 2, 3) == ([2], [2])
    assert await lines_of(0, 99, 0) == (list(range(6)), list(range(6)))


async def test_a_whole_document_is_formatted_and_coloured() -> None:
    _, edits, coloured = await replies(opened(), asked("formatting", 1, **OPTIONS), asked("semanticTokens/full", 2))
    assert [each["newText"] for each in edits] and len(edits) == 6
    assert sum(coloured["data"][::5]) == 5 and len(coloured["data"]) % 5 == 0


async def test_a_name_is_declared_once_and_used_elsewhere() -> None:
    text = "VA Q1=5\nPG 1\nLB G1\nMR Q1\nBR G1,Q1<3\nE\nPG\n"
    place = {"position": {"line": 3, "character": 4}}
    requests = [
        asked("definition", 1, **place),
        asked("references", 2, **place, context={"includeDeclaration": True}),
        asked("references", 3, **place, context={"includeDeclaration": False}),
        asked("documentHighlight", 4, **place),
        asked("prepareRename", 5, **place),
        asked("rename", 6, **place, newName="Q2"),
        asked("definition", 7, position={"line": 1, "character": 0}),
    ]
    _, definition, every, used, lit, prepared, renamed, nothing = await replies(opened(text), *requests)
    assert [each["range"]["start"]["line"] for each in definition] == [0] and nothing == []
    assert [each["range"]["start"]["line"] for each in every] == [0, 3, 4]
    assert [each["range"]["start"]["line"] for each in used] == [3, 4]
    assert [(each["range"]["start"]["line"], each["kind"]) for each in lit] == [(0, 3), (3, 2), (4, 2)]
    assert prepared["placeholder"] == "Q1" and prepared["range"]["start"] == {"line": 3, "character": 3}
    [edits] = renamed["changes"].values()
    assert [(each["range"]["start"]["line"], each["newText"]) for each in edits] == [(0, "Q2"), (3, "Q2"), (4, "Q2")]
