"""Files that are whole or not there: what is synced, what stays of an old file, and what is in the way."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base import atomic
from multidrop.base.atomic import (
    create_atomically,
    make_folder,
    open_private,
    private_folder,
    read_private,
    reserved,
    safe_name,
    sync_folder,
    write_atomically,
)
from tests.support.cases import for_each

pytestmark = pytest.mark.fork


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def descriptors() -> int:
    return len(os.listdir("/dev/fd"))


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, bytes | list[str]]]:
    """Each file that is synced, with what was in it then; each folder with its names."""
    found: list[tuple[str, bytes | list[str]]] = []
    real = os.fsync

    def sync(descriptor: int) -> None:
        path = os.readlink(f"/proc/self/fd/{descriptor}")
        held = sorted(os.listdir(path)) if os.path.isdir(path) else Path(path).read_bytes()
        found.append((os.path.basename(path) if os.path.isdir(path) else "a file", held))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    return found


linux = pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="only Linux names the file of a descriptor")


# Names


@for_each(
    "name, is_one",
    [
        *((each, True) for each in ("CON", "con", "Prn.txt", "AUX .x", "nul.a.b", "COM5.line", "com0", "LPT9")),
        *((each, False) for each in ("CONS", "COM", "COM10", "x.CON", "xCON", ".con", "LPT", "", "CLOCK")),
    ],
)
def test_names_that_windows_takes_for_devices_are_known(name: str, is_one: bool) -> None:
    assert reserved(name) == is_one


@for_each(
    "text, name",
    [
        ("press", "press"),
        ("/dev/ttyUSB0", "%2Fdev%2FttyUSB0"),
        ("COM5", "%43OM5"),
        ("nul.txt", "%6Eul.txt"),
        ("a.", "a%2E"),
        ("a.b", "a.b"),
        ("..", ".%2E"),
        ("", ""),
    ],
)
def test_a_text_becomes_a_name_that_is_one_on_every_system(text: str, name: str) -> None:
    assert safe_name(text) == name


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_a_safe_name_leads_back_to_its_text(text: str) -> None:
    name = safe_name(text)
    assert unquote(name) == text and not reserved(name)
    assert "/" not in name and not name.endswith(".")


# A file in the place of another


@linux
def test_a_file_is_on_the_disk_before_it_has_its_name_and_then_its_name_is(
    tmp_path: Path, synced: list[tuple[str, bytes | list[str]]]
) -> None:
    folder = tmp_path / "conf"
    folder.mkdir()
    write_atomically(folder / "x", b"one")
    assert synced == [("a file", b"one"), ("conf", ["x"])]
    synced.clear()
    write_atomically(folder / "x", b"two", synced=False)
    assert synced == [] and (folder / "x").read_bytes() == b"two"
    create_atomically(folder / "y", b"new")
    assert synced == [("a file", b"new"), ("conf", ["x", "y"])]


def test_a_new_file_has_its_mode_less_the_umask_and_an_old_one_keeps_its_own(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomically(tmp_path / "a", b"1")
        write_atomically(tmp_path / "b", b"1", 0o604)
        assert [mode(tmp_path / name) for name in "ab"] == [0o640, 0o600]
        for kept in (0o751, 0o666, 0o600, 0o001 | 0o600):
            (tmp_path / "a").chmod(kept)
            write_atomically(tmp_path / "a", b"2")
            assert mode(tmp_path / "a") == kept
    finally:
        os.umask(before)
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]


def test_a_file_of_another_owner_stays_his_where_that_can_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple[int, int]] = []
    path = tmp_path / "x"
    path.write_bytes(b"1")
    path.chmod(0o640)
    state = path.stat()
    with monkeypatch.context() as patched:
        patched.setattr(os, "fchown", lambda descriptor, user, group: given.append((user, group)))
        write_atomically(path, b"2")
        assert given == [], "it is ours"
        patched.setattr(os, "getegid", lambda: state.st_gid + 1)
        write_atomically(path, b"3")
        assert given == [(state.st_uid, state.st_gid)]

        def refused(*_: int) -> None:
            raise PermissionError(errno.EPERM, "Operation not permitted")

        patched.setattr(os, "fchown", refused)
        write_atomically(path, b"4")
    assert (path.read_bytes(), mode(path)) == (b"4", 0o640)


@for_each("fails", ["fsync", "replace", "fchmod"])
def test_a_write_that_fails_leaves_the_old_file_and_no_litter(fails: str, tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, fails, full)
        with pytest.raises(OSError, match="No space left"):
            write_atomically(path, b"new")
    assert (path.read_bytes(), os.listdir(tmp_path)) == (b"old", ["x"])


def test_a_folder_that_cannot_be_synced_does_not_undo_a_file_that_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(folder: Path) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(atomic, "sync_folder", broken)
    write_atomically(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"


def test_a_private_file_and_its_folders_are_for_us_only_whatever_stood_there(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    victim.chmod(0o644)
    state = tmp_path / "state"
    path = state / "ports" / "x"
    write_atomically(path, b"1", 0o600, private=True)
    assert [mode(each) for each in (state, state / "ports", path)] == [0o700, 0o700, 0o600]
    path.chmod(0o640)
    write_atomically(path, b"2", 0o600, private=True)
    assert mode(path) == 0o640, "a person's own choice stays"
    path.unlink()
    path.symlink_to(victim)
    write_atomically(path, b"3", 0o600, private=True)
    assert not path.is_symlink() and (path.read_bytes(), mode(path)) == (b"3", 0o600)
    assert victim.read_bytes() == b"precious"


@for_each("held, tries, replaced", [(0.1, range(8, 13), True), (9.0, range(28, 34), False)])
def test_on_windows_a_file_that_another_program_has_open_is_waited_for_a_moment(
    held: float, tries: range, replaced: bool
) -> None:
    with pytest.MonkeyPatch.context() as patched:
        now, asked = [0.0], list[float]()

        def replace(new: object, old: object) -> None:
            asked.append(now[0])
            if now[0] < held:
                raise PermissionError(errno.EACCES, "Access is denied")

        def sleep(seconds: float) -> None:
            now[0] += seconds

        patched.setattr(atomic, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
        patched.setattr(os, "replace", replace)
        with pytest.raises(PermissionError):
            atomic._replace(Path("new"), Path("old"))
        assert asked == [0.0], "elsewhere it is no matter of time"
        patched.setattr("sys.platform", "win32")
        asked.clear()
        try:
            atomic._replace(Path("new"), Path("old"))
        except PermissionError:
            assert not replaced
        else:
            assert replaced
        assert len(asked) in tries


# A new file


@for_each("links", [True, False])
def test_a_new_file_takes_no_name_that_is_taken(links: bool, tmp_path: Path) -> None:
    folder = tmp_path / str(links)
    folder.mkdir()
    (folder / "taken").write_bytes(b"old")
    (folder / "lost").symlink_to("nowhere")

    def none(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")

    with pytest.MonkeyPatch.context() as patched:
        if not links:
            patched.setattr(os, "link", none)
        for name in ("taken", "lost"):
            with pytest.raises(FileExistsError):
                create_atomically(folder / name, b"new")
        create_atomically(folder / "free", b"new")
    assert (folder / "taken").read_bytes() == b"old" and (folder / "free").read_bytes() == b"new"
    assert sorted(os.listdir(folder)) == ["free", "lost", "taken"]


def test_on_windows_a_new_file_gets_its_name_by_a_rename(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise NotImplementedError

    with monkeypatch.context() as patched:
        patched.setattr(os, "link", none)
        patched.setattr("sys.platform", "win32")
        create_atomically(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new" and os.listdir(tmp_path) == ["x"]


def test_a_new_file_whose_name_is_not_on_the_disk_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(folder: Path) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(atomic, "sync_folder", broken)
    with pytest.raises(OSError, match="Input/output error"):
        create_atomically(tmp_path / "x", b"new")
    assert os.listdir(tmp_path) == []


# Folders


@linux
def test_the_names_of_new_folders_are_synced_and_those_that_were_there_are_not(
    tmp_path: Path, synced: list[tuple[str, bytes | list[str]]]
) -> None:
    (tmp_path / "a").mkdir()
    make_folder(tmp_path / "a/b/c")
    assert sorted(synced, key=str) == [("a", ["b"]), ("b", ["c"])]
    synced.clear()
    make_folder(tmp_path / "a/b/c")
    assert synced == []
    before = os.umask(0)
    try:
        make_folder(tmp_path / "open/to/all")
        make_folder(tmp_path / "half", 0o750)
    finally:
        os.umask(before)
    assert [mode(tmp_path / each) for each in ("open", "open/to", "open/to/all", "half")] == [0o777] * 3 + [0o750]


def test_a_folder_whose_place_is_taken_is_told_and_leaves_none_behind(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(FileExistsError):
        make_folder(tmp_path / "file")
    with pytest.raises(NotADirectoryError):
        make_folder(tmp_path / "file/a/b")

    def broken(folder: Path) -> None:
        raise OSError(errno.EIO, "Input/output error")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(atomic, "sync_folder", broken)
        with pytest.raises(OSError, match="Input/output error"):
            make_folder(tmp_path / "a/b")
    assert os.listdir(tmp_path) == ["file"]


@for_each(
    "before, after", [(0o755, 0o700), (0o710, 0o700), (0o701, 0o700), (0o500, 0o500), (0o700, 0o700), (0o770, 0o700)]
)
def test_a_private_folder_loses_the_rights_of_others_only(before: int, after: int, tmp_path: Path) -> None:
    folder = tmp_path / f"{before:o}"
    folder.mkdir()
    folder.chmod(before)
    private_folder(folder)
    assert mode(folder) == after
    folder.chmod(0o755)
    for name, value in (("geteuid", lambda: folder.stat().st_uid + 1), ("platform", "win32")):
        with pytest.MonkeyPatch.context() as patched:
            if callable(value):
                patched.setattr(os, name, value)
            else:
                patched.setattr(f"sys.{name}", value)
            private_folder(folder)
        assert mode(folder) == 0o755, "it is another's, or of a system without modes"


@for_each(
    "number, raised",
    [(errno.EINVAL, False), (errno.ENOTSUP, False), (errno.EACCES, False), (errno.EIO, True), (errno.ENOSPC, True)],
)
def test_a_disk_that_cannot_sync_a_folder_is_one_all_the_same(number: int, raised: bool, tmp_path: Path) -> None:
    before = descriptors()

    def fails(descriptor: int) -> None:
        raise OSError(number, os.strerror(number))

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "fsync", fails)
        if raised:
            with pytest.raises(OSError, match=os.strerror(number)):
                sync_folder(tmp_path)
        else:
            sync_folder(tmp_path)
        patched.setattr("sys.platform", "win32")
        sync_folder(tmp_path / "not even there")
    assert descriptors() == before


# Private files


def in_place(tmp_path: Path) -> dict[str, tuple[Path, int]]:
    (tmp_path / "real").write_bytes(b"precious")
    (tmp_path / "link").symlink_to("real")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    return {
        "link": (tmp_path / "link", os.O_RDONLY),
        "pipe": (tmp_path / "pipe", os.O_RDONLY),
        "pipe that nobody reads": (tmp_path / "pipe", os.O_WRONLY),
        "folder": (tmp_path / "folder", os.O_RDONLY),
    }


def test_what_is_no_regular_file_is_refused_and_no_descriptor_stays(tmp_path: Path) -> None:
    before = descriptors()
    for path, flags in in_place(tmp_path).values():
        with pytest.raises(OSError) as caught:
            open_private(path, flags)
        assert (caught.value.strerror, caught.value.filename) == ("it is not a regular file; remove it", str(path))
    for path, kind in ((tmp_path / "nowhere", FileNotFoundError), (tmp_path / "real" / "x", NotADirectoryError)):
        with pytest.raises(kind) as missing:
            read_private(path)
        assert "regular" not in str(missing.value)
    assert descriptors() == before


def test_a_regular_file_is_opened_with_its_mode_and_not_passed_on_to_programs(tmp_path: Path) -> None:
    path = tmp_path / "x"
    before = os.umask(0)
    try:
        descriptor = open_private(path, os.O_RDWR | os.O_CREAT)
    finally:
        os.umask(before)
    assert not os.get_inheritable(descriptor) and mode(path) == 0o600
    os.write(descriptor, b"\r\nkept as it is\x1a")
    os.close(descriptor)
    assert read_private(path) == b"\r\nkept as it is\x1a"
