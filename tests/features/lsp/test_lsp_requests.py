"""The language server as bytes: requests that are wrong, and changes of one letter."""

from __future__ import annotations

import pytest
from lsprotocol import types

from multidrop.shell.programs.program_text import ProgramGrammar
from tests.support.lsp_bytes import URI, Client, message

PLACE = {"textDocument": {"uri": URI}, "position": {"line": 0, "character": 0}}
HOVER = "textDocument/hover"
WRONG: list[tuple[dict[str, object], int]] = [
    ({"id": 1, "method": HOVER, "params": {"textDocument": {"uri": URI}, "position": {"line": "x"}}}, -32602),
    ({"id": 1, "method": HOVER, "params": {"textDocument": {"uri": URI}, "position": {"line": -1}}}, -32602),
    ({"id": "a", "method": HOVER, "params": [1, 2]}, -32602),
    ({"id": 1, "method": HOVER}, -32602),
    ({"id": 1, "method": "textDocument/rename", "params": PLACE}, -32602),
    ({"id": 1, "method": "textDocument/formatting", "params": None}, -32602),
    ({"id": 1, "method": "no/such", "params": {}}, -32601),
    ({"id": 1, "method": HOVER, "params": PLACE, "jsonrpc": "1.0"}, -32600),
    ({"id": [1], "method": HOVER, "params": PLACE}, -32600),
    ({"id": {"a": 1}, "method": HOVER, "params": PLACE}, -32600),
    ({"id": 1.5, "method": HOVER, "params": []}, -32602),
    ({"id": 1, "method": 5, "params": {}}, -32600),
]


@pytest.mark.parametrize(("wrong", "code"), WRONG)
async def test_a_wrong_request_gets_an_error_and_the_next_one_its_reply(wrong: dict[str, object], code: int) -> None:
    client = Client(message(**wrong), message(id=2, method=HOVER, params=PLACE))
    _, refused, right = await client.replies(3)
    number = wrong["id"] if isinstance(wrong["id"], int | float | str) else None
    assert (refused["id"], refused["error"]["code"]) == (number, code)
    assert right == {"jsonrpc": "2.0", "id": 2, "result": None}
    await client.end()


async def test_what_is_no_message_gets_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    bodies = (b'{"id": 7, "method": "textDocument/hover"}', b"[]", b"5")
    client = Client(*(b"Content-Length: %d\r\n\r\n%s" % (len(each), each) for each in bodies))
    _, *refused = await client.replies(4)
    assert [(each["id"], each["error"]["code"]) for each in refused] == [(7, -32600), (None, -32600), (None, -32600)]
    await client.end()
    assert capsys.readouterr().err == ""


async def test_after_shutdown_a_request_gets_an_error() -> None:
    client = Client(message(id=1, method="shutdown"), message(id=2, method=HOVER, params=PLACE))
    assert [each.get("error", {}).get("code") for each in await client.replies(3)] == [None, None, -32600]
    await client.end()


TEXT = "PG 1\nLB G1\n" + "MX 5\n" * 550 + "E\nPG\n"


async def test_one_letter_that_is_inserted_is_one_more_in_the_text() -> None:
    item = {"uri": URI, "languageId": "mcode", "version": 1, "text": TEXT}
    here = {"line": 700, "character": 3}
    end = {"range": {"start": here, "end": here}, "text": "' end"}
    place = {"line": 2, "character": 2}
    letter = {"range": {"start": place, "end": place}, "text": "X"}
    changed = {"textDocument": {"uri": URI, "version": 2}, "contentChanges": [letter, end]}
    client = Client(message(method="textDocument/didOpen", params={"textDocument": item}))
    (begun,) = await client.replies(1)
    assert begun["result"]["capabilities"]["textDocumentSync"]["change"] == types.TextDocumentSyncKind.Incremental
    assert len((await client.read())["params"]["diagnostics"]) == 550
    client.write(message(method="textDocument/didChange", params=changed))
    after = (await client.read())["params"]
    assert (after["version"], len(after["diagnostics"])) == (2, 550)
    assert after["diagnostics"][0]["range"] == {
        "start": {"line": 2, "character": 0},
        "end": {"line": 2, "character": 3},
    }
    await client.end()


PROGRAMS = {
    "a.mxt": "VA Q1\nPG 1\nLB G1\n" + "MR 5\nMR 6\n" * 20 + "E\nPG\n",
    "a.prg": "PRG 0\nIF V1=1\nHSPD=1000\nENDIF\nWHILE V1=1\n" + "X1000\n" * 20 + "ENDWHILE\nEND\nSUB 1\nX5\nENDSUB\n",
    "a.tmc": "JA Begin\nBegin: NOP\n" + "STAP 4, 0\n" * 20 + "STOP\n",
}


@pytest.mark.parametrize("file", PROGRAMS)
@pytest.mark.parametrize("typed", ["x", "\x0b"])
def test_one_more_letter_hides_few_problems(file: str, typed: str) -> None:
    grammar, text = ProgramGrammar(file), PROGRAMS[file]
    before = {each.line for each in grammar.check(text, "LMDCM")}
    assert len(before) >= 19
    for at in [n for n in range(len(text)) if text[n - 1 : n] in ("", "\n") or text[n] == "\n"]:
        problems = grammar.check(text[:at] + typed + text[at:], "LMDCM")
        assert len(before - {each.line for each in problems}) <= 2, (at, problems)
