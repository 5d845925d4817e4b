"""Editing a text file: every byte comes back, and nobody's work is overwritten."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects import Diagnostic
from multidrop.shell.programs.edited_file import ChangedMeanwhile, EditedFile, edited, real_text
from multidrop.shell.state.backups import Copy, Drafts


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PG 1\nE\nPG\n",
        b"PG 1\r\nE\r\nPG",
        b"' \x85 \x1b[2J \x0c form feed\n\x1a",
        "\ufeffPR \u201cx\u201d\n".encode(),
        "' soft\u00adhyphen \u202e\u2028\n".encode(),
        b"' caf\xe9\n",
    ],
)
def test_a_file_that_is_saved_unchanged_has_the_same_bytes(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.mxt"
    path.write_bytes(data)
    file = EditedFile(path)
    file.save(file.text)
    assert path.read_bytes() == data
    assert len(file.text.splitlines()) == len(file.text.removesuffix("\n").split("\n")) or not file.text


@given(st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\r")))
def test_stand_ins_come_back_as_their_characters(text: str) -> None:
    shown = edited(text)
    assert shown.isprintable() or not set(map(ord, shown)).intersection([*range(9), *range(11, 32), 0x7F, 0x85, 0x9B])
    if shown != text or not any("\uf700" <= each <= "\uf77f" for each in text):
        assert real_text(shown) == text or any("\uf700" <= each <= "\uf77f" for each in text)


def test_a_file_that_changed_meanwhile_is_not_overwritten_unless_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    file = EditedFile(path)
    path.write_text("another's\n")
    with pytest.raises(ChangedMeanwhile, match="has changed on the disk"):
        file.save("mine\n")
    assert path.read_text() == "another's\n"
    file.save("mine\n", over=True)
    assert path.read_text() == "mine\n"
    file.save("mine again\n")
    assert path.read_text() == "mine again\n"


def test_a_new_file_is_not_put_over_one_that_appeared(tmp_path: Path) -> None:
    path = tmp_path / "new.mxt"
    file = EditedFile(path)
    assert file.new
    path.write_text("another's\n")
    with pytest.raises(ChangedMeanwhile, match="is new on the disk"):
        file.save("mine\n")


def test_a_file_that_is_gone_is_said_and_can_be_written_again(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    file = EditedFile(path)
    path.unlink()
    with pytest.raises(ChangedMeanwhile, match="is gone"):
        file.save("mine\n")
    file.save("mine\n", over=True)
    assert path.read_text() == "mine\n"


def test_mixed_line_ends_become_one_kind_and_are_known(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_bytes(b"A\r\nB\r\nC\n")
    file = EditedFile(path)
    assert file.mixed and file.newline == "\r\n" and file.text == "A\nB\nC\n"


def test_what_the_editor_cannot_keep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    for data, why in ((b"A\0", "not a text file"), ("\uf703".encode(), "private area"), (b"x" * 600_000, "larger")):
        path.write_bytes(data)
        with pytest.raises(Diagnostic, match=why):
            EditedFile(path)
    with pytest.raises(Diagnostic, match="regular"):
        EditedFile(tmp_path)


def test_a_character_that_the_encoding_lacks_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_bytes(b"' caf\xe9\n")
    file = EditedFile(path)
    with pytest.raises(Diagnostic, match=r"'→' cannot be written.*cp1252") as caught:
        file.save("H\n' →\n")
    assert caught.value.where.endswith("a.mxt:2")
    assert path.read_bytes() == b"' caf\xe9\n"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind this user")
def test_a_read_only_file_is_left(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    path.chmod(0o444)
    with pytest.raises(Diagnostic, match="read-only"):
        EditedFile(path).save("mine\n")


def test_a_draft_is_found_again_until_it_is_forgotten(tmp_path: Path) -> None:
    drafts, file = Drafts(tmp_path), str(tmp_path / "a.mxt")
    assert drafts.find(file) is None
    drafts.keep(Copy(file, "MR 5\n", "12:40"))
    assert Drafts(tmp_path).find(file) == Copy(file, "MR 5\n", "12:40")
    drafts.forget(file)
    drafts.forget(file)
    assert drafts.find(file) is None


def test_a_damaged_draft_is_none_and_a_full_disk_is_a_diagnostic(tmp_path: Path) -> None:
    drafts, file = Drafts(tmp_path), "a.mxt"
    drafts.keep(Copy(file, "x", "12:40"))
    next((tmp_path / "drafts").iterdir()).write_text("{")
    assert drafts.find(file) is None
    (tmp_path / "other").write_text("a file, no folder")
    with pytest.raises(Diagnostic, match="no copy"):
        Drafts(tmp_path / "other").keep(Copy(file, "x", "12:40"))


def test_a_draft_is_kept_where_an_old_one_cannot_be_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drafts = Drafts(tmp_path)
    for number in range(50):
        drafts.keep(Copy(f"{number}.mxt", "x", "12:40"))

    def gone(*_: object, **__: object) -> None:
        raise FileNotFoundError(2, "deleted by another session")

    monkeypatch.setattr(Path, "unlink", gone)
    drafts.keep(Copy("new.mxt", "y", "12:41"))
    assert drafts.find("new.mxt") == Copy("new.mxt", "y", "12:41")
