"""Edited copies of macro files: a macro changes only once the whole text is right, and nothing typed is lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import MacroStore
from multidrop.macros.store import begin_draft, finish_draft
from tests.support.posix import has_mode

TEXT = b"# mine\nname = 'm'\n[[step]]\nline = 'MR 1' # far\n"


@pytest.fixture
def store(tmp_path: Path) -> MacroStore:
    store = MacroStore(tmp_path / "macros")
    store.folder.mkdir()
    store.path("m").write_bytes(TEXT)
    return store


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "state" / "drafts"


def test_a_right_text_replaces_the_macro_byte_for_byte(store: MacroStore, folder: Path) -> None:
    draft = begin_draft(store, folder, "m")
    assert draft.file.read_bytes() == TEXT and has_mode(draft.file, 0o600)
    draft.file.write_bytes(TEXT.replace(b"1", b"2"))
    assert finish_draft(store, draft) == f"macro m: 1 line in {store.path('m')}"
    assert store.path("m").read_bytes() == TEXT.replace(b"1", b"2")
    assert list(folder.iterdir()) == []


def test_a_text_that_is_not_changed_writes_nothing(store: MacroStore, folder: Path) -> None:
    before = store.path("m").stat()
    assert finish_draft(store, begin_draft(store, folder, "m")) == "macro m: unchanged"
    assert store.path("m").stat() == before and list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"name = 'm'\n[[step]]\nlin = 'x'\n", "m.toml:3: step 1: unknown key 'lin'"),
        (b"name = 'm'\n[[step]\n", "m.toml:2: not TOML"),
        (b"name = 'n'\n[[step]]\nline = 'x'\n", "name = 'n' in the macro m; write name = 'm'; macro rename m n"),
        (b"name = 'm'\n", "a macro without steps"),
        (b"\xff", "m.toml:1: not UTF-8"),
        (b"name = 'm'\n[[step]]\nline = '{n:int=x}'\n", "m.toml:3: step 1: {n:int=x}: invalid n = 'x'"),
    ],
)
def test_a_wrong_text_leaves_the_macro_and_is_edited_on(
    store: MacroStore, folder: Path, text: bytes, says: str
) -> None:
    draft = begin_draft(store, folder, "m")
    draft.file.write_bytes(text)
    with pytest.raises(Diagnostic) as caught:
        finish_draft(store, draft)
    assert says in str(caught.value)
    assert f"m is as it was; your text is in {draft.file}, and macro edit m goes on with it" in str(caught.value)
    assert store.path("m").read_bytes() == TEXT
    again = begin_draft(store, folder, "m")
    assert again.file.read_bytes() == text and "goes on with the text of the last edit" in again.remark
    again.file.write_bytes(TEXT + b"# right\n")
    finish_draft(store, again)
    assert store.path("m").read_bytes() == TEXT + b"# right\n"


def test_a_macro_that_changed_meanwhile_is_not_overwritten(store: MacroStore, folder: Path) -> None:
    draft = begin_draft(store, folder, "m")
    draft.file.write_bytes(TEXT + b"# one\n")
    store.path("m").write_bytes(TEXT + b"# other\n")
    with pytest.raises(Diagnostic, match="the file has changed meanwhile"):
        finish_draft(store, draft)
    again = begin_draft(store, folder, "m")
    assert again.file.read_bytes() == TEXT + b"# other\n"
    assert again.remark == f"m has changed since the last edit, whose text is in {folder / 'm.1.toml'}"
    assert (folder / "m.1.toml").read_bytes() == TEXT + b"# one\n"


def test_a_broken_file_can_be_mended(store: MacroStore, folder: Path) -> None:
    store.path("m").write_bytes(b"name =")
    draft = begin_draft(store, folder, "m")
    draft.file.write_bytes(TEXT)
    finish_draft(store, draft)
    assert store.load("m").steps[0].line == "MR 1"


def test_there_is_no_draft_of_what_is_not_there(store: MacroStore, folder: Path) -> None:
    with pytest.raises(Diagnostic, match="no macro 'x'.*valid: m"):
        begin_draft(store, folder, "x")
    assert not folder.exists()


def test_there_is_no_draft_of_a_macro_that_appears_meanwhile(
    store: MacroStore, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "contents", lambda name: None)
    with pytest.raises(Diagnostic, match="no macro 'm'"):
        begin_draft(store, folder, "m")
    assert not folder.exists()


def test_a_draft_that_cannot_be_written_is_told(store: MacroStore, folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("in the way")
    with pytest.raises(Diagnostic, match="cannot write the copy"):
        begin_draft(store, folder, "m")
