"""The language server, asked by a client of another project: problems, help, completion, names, spelling, colours."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from lsprotocol import types
from pygls.exceptions import JsonRpcException
from pytest_lsp import LanguageClient

from multidrop.dialects.families import program_languages
from multidrop.features.lsp.replies import LEGEND
from multidrop.shell.programs.checking import examine_text
from tests.support.lsp_session import Editor, editing

PROGRAM = "VA Q1=5\t' half\r\nPG 1\r\nLB G1 ' 20 °C 😀 go\r\n  mr q1  ' one\r\n H\r\n br g1,q1<3\r\nE\r\nPG\r\n"
SCRIPT = "V1=0 ; count\nWHILE V1<3\n GOSUB 3\n V1=V1+1\nENDWHILE\nEND\nSUB 3 ; lamp\n DO1=1\nENDSUB\n"

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def client() -> AsyncIterator[LanguageClient]:
    """One session for all tests: its beginning takes longer than a test. Each test has a document of its own."""
    async with editing() as begun:
        yield begun


def spans(edit: types.WorkspaceEdit) -> list[tuple[int, int, int, str]]:
    (changes,) = edit.document_changes
    return [_span(each.range) + (each.new_text,) for each in changes.edits]


def _span(place: types.Range) -> tuple[int, int, int]:
    assert place.start.line == place.end.line
    return place.start.line, place.start.character, place.end.character


@pytest.fixture
def editor(client) -> Editor:
    return Editor(client)


async def test_problems_are_those_of_the_check_at_their_places(client: LanguageClient) -> None:
    text = 'VA Q1=5\nPG 1\n \' 😀\n\tPR "😀",QX\n MR *\nBR K1\nH 99999\nE\nPG\n'
    editor = Editor(client)
    found = await editor.open(text)
    checked = examine_text(text, "a.mxt", "LMDCM").problems
    assert [each.message for each in found] == [f"{p.what}; {p.hint}" if p.hint else p.what for p in checked]
    lines = text.split("\n")
    places = [(each.range.start.line, each.range.start.character) for each in found]
    units = [len(lines[p.line - 1][: p.column - 1].encode("utf-16-le")) // 2 for p in checked]
    assert places == [(p.line - 1, unit) for p, unit in zip(checked, units, strict=True)]
    assert {each.severity for each in found} == {types.DiagnosticSeverity.Error, types.DiagnosticSeverity.Warning}
    assert {each.source for each in found} == {"multidrop"}


async def test_problems_follow_the_text_and_go_with_the_document(client: LanguageClient, editor: Editor) -> None:
    assert len(await editor.open("PG 1\nMX 5\nE\nPG\n")) == 1
    editor.change("PG 1\nMR 5\nH\nE\nPG\n")
    assert await editor.problems() == []
    client.text_document_did_close(types.DidCloseTextDocumentParams(editor.document))
    assert await editor.problems() == []
    assert await editor.hover(1, 0) == "" and await editor.complete(1, 0) == {}
    assert await editor.format() is None


@pytest.mark.parametrize(
    ("uri", "language_id", "text", "wrong"),
    [
        ("file:///tmp/a.txt", "plaintext", "PG 1\nMR 5\nH\nE\nPG\n", 0),
        ("file:///tmp/a.PRG", "plaintext", "V1=5\nEND\n", 0),
        ("file:///tmp/a%20b.prg", "plaintext", "V1=\nEND\n", 1),
        ("untitled:Untitled-1", "ascript", "V1=5\nEND\n", 0),
        ("untitled:Untitled-1", "mcode", "PG 1\nMR 5\nH\nE\nPG\n", 0),
        ("file:///tmp/a.mxt", "mcode", "HSPD=5000\nX100\nWAITX\nEND\n", 1),
        ("file:///tmp/a.mxt", "ascript", "HSPD=5000\nX100\nWAITX\nEND\n", 0),
        ("file:///tmp/a.mxt", "mcode", "\ufeffPG 1\nMR 5\nH\nE\nPG\n", 0),
        ("file:///tmp/a.mxt", "mcode", " \n", 0),
    ],
)
async def test_the_language_is_that_of_the_editor_or_of_the_name(
    client: LanguageClient, uri: str, language_id: str, text: str, wrong: int
) -> None:
    assert len(await Editor(client, uri).open(text, language_id)) == wrong


async def test_the_client_names_the_drive() -> None:
    text = "PG 1\nLB G1\nS1=0,0,0\nE\nPG\n"
    async with editing(options={"personality": "mdi"}) as client:
        assert await Editor(client).open(text) == []
    async with editing(options={"personality": "XYZ"}) as client:
        assert len(await Editor(client).open(text)) > 0
        assert "no personality XYZ; valid: LMDOM" in client.messages[0].message


async def test_help_is_that_of_the_prompt_and_of_the_file(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    assert "MR: Move relative" in (shown := await editor.hover(3, 3)) and "range " in shown
    assert shown.startswith("```text\n")
    assert "Q1: variable, line 1: half" in (shown := await editor.hover(3, 5)) and "in 3 lines" in shown
    assert await editor.hover(2, 12) == await editor.hover(99, 5) == await editor.hover(0, 10) == ""


async def test_no_remark_ends_the_frame_of_the_help(client: LanguageClient, editor: Editor) -> None:
    await editor.open("PG 1\nLB G1 ' ```\nBR G1\nPG\n")
    shown = await editor.hover(1, 3)
    assert shown.startswith("````text\n") and shown.endswith("\n````")


async def test_completion_offers_what_fits_the_place(client: LanguageClient, editor: Editor) -> None:
    await editor.open("VA Q1=5\nPG 1\nLB G1 ' start\nBR \nPR \n P\nVA \n\nE\nPG\n")
    label = (await editor.complete(3, 3, " "))["G1"]
    assert label.detail == "label, line 3: start" and _span(label.text_edit.range) == (3, 3, 3)
    printed = await editor.complete(4, 3)
    assert {"Q1", "G1", "P", "VM"} <= set(printed) and "MR" not in printed
    vm = printed["VM"]
    assert vm.detail and "range" in vm.documentation.value and "default" in vm.documentation.value
    begun = await editor.complete(5, 2)
    assert "PG" in begun and "VM" not in begun and _span(begun["P"].text_edit.range) == (5, 1, 2)
    assert await editor.complete(6, 3) == {} and await editor.complete(7, 0, " ") == {}
    assert {"MR", "Q1"} <= set(await editor.complete(7, 0))


async def test_a_name_is_found_where_it_is_declared_and_used(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    at = types.Position(5, 5)
    (place,) = await client.text_document_definition_async(types.DefinitionParams(editor.document, at))
    assert _span(place.range) == (2, 3, 5)
    context = types.ReferenceContext(include_declaration=False)
    uses = await client.text_document_references_async(types.ReferenceParams(context, editor.document, at))
    assert [_span(each.range) for each in uses] == [(5, 4, 6)]
    shown = await client.text_document_document_highlight_async(types.DocumentHighlightParams(editor.document, at))
    assert [each.kind for each in shown] == [types.DocumentHighlightKind.Write, types.DocumentHighlightKind.Read]


async def test_a_rename_changes_every_use_and_nothing_else(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    place = await client.text_document_prepare_rename_async(
        types.PrepareRenameParams(editor.document, types.Position(3, 6))
    )
    assert (place.placeholder, _span(place.range)) == ("q1", (3, 5, 7))
    assert spans(await editor.rename(3, 6, "Zz")) == [(0, 3, 5, "Zz"), (3, 5, 7, "Zz"), (5, 7, 9, "Zz")]
    for new, why in (("MR", "is a word of the drive"), ("long", "is not a name"), ("g1", "in use already")):
        with pytest.raises(JsonRpcException, match=why):
            await editor.rename(3, 6, new)
    with pytest.raises(JsonRpcException, match="only a label"):
        await client.text_document_prepare_rename_async(
            types.PrepareRenameParams(editor.document, types.Position(4, 1))
        )


async def test_the_spelling_is_canonical_and_the_second_time_nothing_changes(
    client: LanguageClient, editor: Editor
) -> None:
    await editor.open(PROGRAM)
    edits = await editor.format()
    assert [_span(each.range) + (each.new_text,) for each in edits] == [
        (3, 2, 6, "MR Q"),
        (5, 1, 8, "BR G1,Q"),
    ]
    editor.change(program_languages()["mcode"].language.formatted(PROGRAM))
    assert await editor.problems() == [] and not await editor.format()


async def test_a_range_is_formatted_alone_and_a_wrong_text_not_at_all(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    options = types.FormattingOptions(tab_size=4, insert_spaces=True)
    asked = types.Range(types.Position(5, 0), types.Position(6, 0))
    edits = await client.text_document_range_formatting_async(
        types.DocumentRangeFormattingParams(editor.document, asked, options)
    )
    assert [each.range.start.line for each in edits] == [5]
    editor.change("pg1\nmr *\npg\n")
    await editor.problems()
    assert await editor.format() is None
    assert "not formatted: an error in line 2" in client.messages[-1].message


async def test_the_outline_has_programs_labels_and_variables(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    variable, program = await client.text_document_document_symbol_async(types.DocumentSymbolParams(editor.document))
    assert (variable.name, variable.detail) == ("Q1", "=5  half")
    assert (program.name, program.range.end.line) == ("PG 1", 7)
    (label,) = program.children
    assert (label.name, label.range.start.line, label.range.end.line) == ("G1", 2, 6)
    folds = await client.text_document_folding_range_async(types.FoldingRangeParams(editor.document))
    assert [(each.start_line, each.end_line) for each in folds] == [(1, 7), (2, 6)]


async def test_colours_count_code_units(client: LanguageClient, editor: Editor) -> None:
    await editor.open(PROGRAM)
    found = await client.text_document_semantic_tokens_full_async(types.SemanticTokensParams(editor.document))
    line, start, seen = 0, 0, []
    for at in range(0, len(found.data), 5):
        down, right, width, kind, modifiers = found.data[at : at + 5]
        line, start = line + down, right if down else start + right
        seen.append((line, start, width, LEGEND.token_types[kind], modifiers))
    assert seen[:6] == [
        (0, 0, 2, "keyword", 0),
        (0, 3, 2, "variable", 1),
        (0, 8, 6, "comment", 0),
        (1, 0, 2, "keyword", 0),
        (2, 0, 2, "keyword", 0),
        (2, 3, 2, "label", 1),
    ]
    assert seen[6] == (2, 6, len("' 20 °C 😀 go") + 1, "comment", 0)
    assert (3, 2, 2, "function", 0) in seen and (3, 5, 2, "variable", 0) in seen


async def test_a_script_of_a_pmx(client: LanguageClient) -> None:
    editor = Editor(client, "file:///tmp/a.prg")
    assert await editor.open(SCRIPT) == []
    assert "repeats the lines" in await editor.hover(1, 2)
    assert "SUB 3: subroutine, line 7: lamp" in await editor.hover(2, 7)
    assert (await editor.complete(2, 7))["3"].detail == "subroutine, line 7: lamp"
    assert spans(await editor.rename(6, 4, "SUB 5")) == [(2, 7, 8, "5"), (6, 4, 5, "5")]
    assert [each[0] for each in spans(await editor.rename(0, 1, "V9"))] == [0, 1, 3, 3]
    with pytest.raises(JsonRpcException, match="STORE keeps V40 and does not keep V1"):
        await editor.rename(0, 1, "V40")
    with pytest.raises(JsonRpcException, match="runs after an error"):
        await editor.rename(6, 4, "31")
