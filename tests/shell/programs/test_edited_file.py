"""Editing a text file: every byte comes back, and nobody's work is overwritten."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
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
    with pytest.raises(ChangedMeanwhile, match="has changed on the disk") as told:
        file.save("mine\n")
    assert path.read_text() == "another's\n"
    path.write_text("a third one's\n")  # nobody was asked about this one
    with pytest.raises(ChangedMeanwhile, match="has changed on the disk") as now:
        file.save("mine\n", told.value)
    assert path.read_text() == "a third one's\n"
    file.save("mine\n", now.value)
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
    with pytest.raises(ChangedMeanwhile, match="is gone") as told:
        file.save("mine\n")
    file.save("mine\n", told.value)
    assert path.read_text() == "mine\n"


def test_a_text_that_another_program_has_saved_already_needs_no_question(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    file = EditedFile(path)
    path.write_text("mine\n")
    file.save("mine\n")
    assert file.text == "mine\n" and not file.look().said


# A look at the disk


def changed(path: Path) -> None:
    """Write another text of the same size, with the same time of the last change."""
    state = path.stat()
    path.write_bytes(bytes(path.stat().st_size - 1).replace(b"\0", b"E") + b"\n")
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def a_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda path: None, ""),
        (lambda path: os.utime(path, (1, 1)), ""),
        (lambda path: path.write_bytes(path.read_bytes()), ""),
        (changed, "has changed on the disk"),
        (Path.unlink, "is gone from the disk"),
        (a_folder, "cannot be read again: is not a regular file"),
        pytest.param(
            a_pipe,
            "cannot be read again: is not a regular file",
            marks=pytest.mark.skipif(os.name != "posix", reason="no pipes with a name"),
        ),
        (lambda path: path.write_bytes(b"A\0"), "cannot be read again: is not a text file"),
        (lambda path: path.write_bytes(b"x" * 600_000), "cannot be read again: is larger than 512 KB"),
        (lambda path: path.write_bytes("\uf703".encode()), "cannot be read again: holds characters of the private"),
    ],
)
def test_a_look_at_the_disk_compares_the_content(tmp_path: Path, act: Callable[[Path], None], said: str) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("PG 1\nE\nPG\n")
    file = EditedFile(path)
    act(path)
    seen = file.look()
    assert seen.said.startswith(said) and bool(seen.said) == bool(said)
    assert (seen.now is not None) == (said == "has changed on the disk") and seen.gone == ("gone" in said)
    assert file.text == "PG 1\nE\nPG\n"  # a look changes nothing


def test_what_was_read_again_is_saved_as_it_is_then(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    file = EditedFile(path)
    path.write_bytes(b"' caf\xe9\r\nMR 5\r\n")
    now = file.look().now
    assert now is not None and now.text == "' caf\u00e9\nMR 5\n"
    now.save(now.text + "E\n")
    assert path.read_bytes() == b"' caf\xe9\r\nMR 5\r\nE\r\n"


def test_a_text_whose_file_is_gone_is_not_saved_and_keeps_its_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_bytes(b"H\r\n")
    file = EditedFile(path)
    path.unlink()
    file.lost()
    assert file.new and file.text == "" and not file.look().said
    path.write_text("another's\n")
    assert file.look().said == "is new on the disk"
    path.unlink()
    file.save("H\n")
    assert path.read_bytes() == b"H\r\n"


def test_the_name_of_a_content_is_32_characters_and_that_of_no_file_is_that_of_an_empty_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    absent = EditedFile(path).digest
    path.write_bytes(b"")
    assert EditedFile(path).digest == absent and len(absent) == 32
    path.write_bytes(b"PG\n")
    assert EditedFile(path).digest != absent and len(EditedFile(path).digest) == 32


def test_an_outdated_text_is_asked_about_before_it_is_saved(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("H\n")
    file = EditedFile(path)
    file.outdated()
    assert file.look().said == "has changed on the disk" and not file.new
    with pytest.raises(ChangedMeanwhile):
        file.save("mine\n")


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
