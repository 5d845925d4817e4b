"""The record and the memory of a port: any contents of the files, and places where they cannot be written."""

import asyncio
import json
import os
from dataclasses import asdict, replace
from urllib.parse import unquote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base import atomic
from multidrop.dialects import Owed
from multidrop.dialects.state import Remembered
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.tmcl.host.codec import Tmcl, TmclState
from multidrop.shell.state.port_state import MOST_OWED_ROWS, MOST_REPLIED, PortMemory, PortState

PORT = "/dev/serial/by-id/usb-FTDI/RS485: 1"
OWED = Owed(1, "a", "LMDCM", "LMDCM 6.002", "LMDCM571", "0401")


def known(owed=OWED, restore=None):
    return MCodeState(
        MCode(), owed.name, owed.name, owed.product, owed.version, owed.part, owed.serial, restore=restore
    )


@pytest.fixture
def port(tmp_path):
    """Opens the port, and closes what is open of it before."""
    opened = []

    def make(name=PORT):
        for each in opened:
            each.close()
        opened.append(PortState(tmp_path, name))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def kept(tmp_path):
    return sorted(path for path in (tmp_path / "ports").iterdir() if path.suffix == ".json")


def test_the_first_session_finds_nothing(port):
    state = port()
    assert (state.cut, state.owed, state.remarks) == ("", (), [])


def test_a_line_that_was_cut_off_is_known_to_the_next_session_until_the_drives_have_overflowed(port):
    port().begun("aMR 51200")
    assert port().cut == "aMR 51200"
    state = port()
    assert state.cut == "aMR 51200"
    state.ended()
    assert port().cut == ""


def test_a_line_that_is_answered_is_no_more_known(port):
    state = port()
    for number in range(3):
        state.begun(f"aMR {number}")
        state.ended()
    assert port().cut == ""


@given(st.binary(max_size=200))
def test_whatever_stands_in_the_lines_file_is_one_printable_line(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("state")
    PortState(folder, PORT).close()
    [file] = (folder / "ports").iterdir()
    file.write_bytes(data)
    state = PortState(folder, PORT)
    assert state.cut.isprintable() and len(state.cut) <= 128
    state.ended()
    state.close()
    state = PortState(folder, PORT)
    assert state.cut == ""
    state.close()


async def test_what_is_owed_is_written_before_it_is_changed_and_gone_once_it_is_put_back(port, tmp_path):
    state, drive = port(), known(restore=OWED)
    await state.owes(drive)
    [path] = kept(tmp_path)
    assert json.loads(path.read_text()) == {"port": PORT, "owed": [asdict(OWED)]}
    assert port().owed == (OWED,)
    state = port()
    drive.restore = None
    await state.owes(drive)
    assert kept(tmp_path) == [] and port().owed == ()


async def test_a_download_of_a_module_is_kept_until_the_module_executes_commands_again(port):
    state, modules = port(), [TmclState(Tmcl(), each, name=each, product="TMCM-1241", version="1.15") for each in "13"]
    for module in modules:
        module.found_storing()
        await state.owes(module)
    state = port()
    assert [each.name for each in state.owed] == ["1", "3"]
    modules[0].executes()
    modules[0].owes_nothing()
    await state.owes(modules[0])
    assert [each.name for each in port().owed] == ["3"]


async def test_another_drive_strikes_nothing_out(port):
    state = port()
    await state.owes(known(restore=OWED))
    for other in (
        Owed(1, "a", "LMDCM", "LMDCM 6.002", "LMDCM571", "0402"),
        Owed(1, "b", "LMDCM", "LMDCM 6.002", "LMDCM571", "0401"),
        Owed(1, "a", "LMDOM", "LMDCM 6.002", "LMDCM571", "0401"),
    ):
        await state.owes(known(other))
    assert port().owed == (OWED,)


async def test_several_drives_are_kept_and_the_oldest_forgotten(port):
    state = port()
    drives = [Owed(2, "a", "LMDCM", "v", "p", str(number)) for number in range(MOST_OWED_ROWS + 3)]
    await asyncio.gather(*(state.owes(known(each, each)) for each in drives))
    assert port().owed == tuple(drives[3:])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "{}",
        "null",
        '{"owed": 5}',
        '{"owed": [5]}',
        '{"owed": [{}]}',
        pytest.param("[" * 100_000, id="deep"),
        '{"owed": [{"em": 7, "name": "", "product": "", "version": "", "part": "", "serial": ""}]}',
        '{"owed": [{"em": true, "name": "", "product": "", "version": "", "part": "", "serial": ""}]}',
        '{"owed": [{"em": 1, "name": 1, "product": "", "version": "", "part": "", "serial": ""}]}',
        b"\xff\xfe\x00",
    ],
)
async def test_a_damaged_file_is_passed_over_with_a_word_and_replaced(port, tmp_path, text):
    state = port()
    await state.owes(known(restore=OWED))
    [path] = kept(tmp_path)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    state = port()
    assert state.owed == () and state.remarks == [f"{path} is damaged and is ignored; delete it"]
    await state.owes(known(restore=OWED))
    assert port().owed == (OWED,)


def test_ports_of_any_name_have_files_of_their_own(tmp_path):
    names = ["COM3", "com3", "/a/b", "%2Fa%2Fb", "10.0.0.5:503", "..", "x" * 300, "x" * 299 + "y", "a:b", "a*b"]
    for number, name in enumerate(names):
        state = PortState(tmp_path, name)
        state.begun(f"MR {number}")
        state.close()
    for number, name in enumerate(names):
        state = PortState(tmp_path, name)
        assert (state.cut, state.remarks) == (f"MR {number}", [])
        state.close()


@pytest.mark.wine("its C library gives no reason where a lock is refused")
async def test_while_one_session_has_the_port_another_keeps_nothing_and_says_so_when_it_matters(tmp_path):
    told = []
    first, second = PortState(tmp_path, PORT), PortState(tmp_path, PORT)
    second.notify = told.append
    first.begun("aMR 51200")
    second.begun("aMR 5")
    second.ended()
    await second.owes(known())
    assert (second.cut, second.remarks, told) == ("", [], [])
    for _ in range(2):
        await second.owes(known(restore=OWED))
    assert len(told) == 1 and "another session" in told[0]
    first.close()
    second.close()
    third = PortState(tmp_path, PORT)
    assert third.cut == "aMR 51200"
    third.close()


async def test_without_a_folder_that_can_be_written_a_session_works_and_says_so(tmp_path, monkeypatch):
    def read_only(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, "open", read_only)
    told = []
    state = PortState(tmp_path, PORT)
    state.notify = told.append
    await state.owes(known())
    state.ended()
    assert (state.remarks, told) == ([], [])
    for _ in range(2):
        state.begun("aMR 5")
        state.ended()
        await state.owes(known(restore=OWED))
    assert len(told) == 1 and "Read-only file system" in told[0]
    state.close()


async def test_a_folder_that_is_a_file_is_said_and_nothing_else_happens(tmp_path):
    (tmp_path / "ports").write_text("mine")
    state, told = PortState(tmp_path, PORT), []
    state.notify = told.append
    await state.owes(known(restore=OWED))
    state.begun("aMR 5")
    assert len(told) == 1 and "cannot be used" in told[0]
    state.close()
    assert (tmp_path / "ports").read_text() == "mine"


async def test_a_disk_that_becomes_full_is_said_once(tmp_path, monkeypatch):
    told = []
    state = PortState(tmp_path, PORT)
    state.notify = told.append

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    for _ in range(2):
        await state.owes(known(restore=OWED))
        state.begun("aMR 5")
    state.close()
    assert len(told) == 1 and "No space left on device" in told[0]
    assert [path.suffix for path in (tmp_path / "ports").iterdir()] == [".line"]


A = Remembered("a", "a", "LMDCM", "LMDCM 6.002, Hw: 3.2", "LMDCM571", "0401", True, 1, 2)
B, ALONE = replace(A, address="b", name="b", serial="0402"), replace(A, address="", party=False)


def test_drives_are_remembered_by_address_and_forgotten(tmp_path):
    path = tmp_path / "port.drives"
    memory = PortMemory(path)
    assert (memory.drives, memory.remark) == ((), "")
    memory.update({"a": A})
    memory.update({"b": B})
    assert PortMemory(path).drives == (A, B)
    memory.update({"a": None, "c": None})
    assert PortMemory(path).drives == (B,)
    memory.update({"": ALONE})
    assert PortMemory(path).drives == (ALONE,)
    memory.update({"a": A})
    assert PortMemory(path).drives == (A,)
    assert [each.name for each in tmp_path.iterdir()] == ["port.drives"]


def test_the_file_is_written_only_where_something_is_new(tmp_path):
    path = tmp_path / "port.drives"
    PortMemory(path).update({"a": A, "b": B})
    before = path.stat()
    PortMemory(path).update({"b": B, "a": A})
    assert path.stat().st_mtime_ns == before.st_mtime_ns and path.stat().st_ino == before.st_ino


def test_the_oldest_of_too_many_are_dropped(tmp_path):
    memory = PortMemory(tmp_path / "port.drives")
    names = [chr(number) for number in range(33, 33 + MOST_REPLIED + 5)]
    memory.update({name: replace(A, address=name) for name in names})
    assert [each.address for each in memory.drives] == names[5:]


@given(st.binary(max_size=60))
def test_any_bytes_in_the_file_are_ignored(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("memory") / "port.drives"
    path.write_bytes(data)
    memory = PortMemory(path)
    assert memory.drives == () and "is ignored" in memory.remark
    memory.update({"a": A})
    assert PortMemory(path).drives == (A,)


ROW = asdict(A)
WRONG = [
    {}, [ROW], {"drives": 5}, {"drives": [5]}, {"drives": [{}]}, {"drives": [ROW | {"more": 1}]},
    {"drives": [ROW | {"em": 4}]}, {"drives": [ROW | {"em": "1"}]}, {"drives": [ROW | {"checksum": -1}]},
    {"drives": [ROW | {"party": 1}]}, {"drives": [ROW | {"address": "ab"}]}, {"drives": [ROW | {"address": ""}]},
    {"drives": [ROW | {"em": True}]}, {"drives": {"a": ROW}},
]  # fmt: skip


@pytest.mark.parametrize("content", WRONG)
def test_a_file_with_other_content_is_ignored_with_one_remark(tmp_path, content):
    path = tmp_path / "port.drives"
    path.write_text(json.dumps(content))
    memory = PortMemory(path)
    assert memory.drives == () and memory.remark.count("\n") == 0 and str(path) in memory.remark


def test_a_folder_that_cannot_be_written_costs_nothing_but_the_memory(tmp_path):
    memory = PortMemory(tmp_path / "none" / "port.drives")
    memory.update({"a": A})
    assert memory.drives == (A,) and not (tmp_path / "none").exists()


def test_a_full_disk_leaves_the_old_memory(tmp_path, monkeypatch):
    path = tmp_path / "port.drives"
    PortMemory(path).update({"a": A})

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "open", full)
    PortMemory(path).update({"b": B})
    monkeypatch.undo()
    assert PortMemory(path).drives == (A,) and len(list(tmp_path.iterdir())) == 1


def test_a_second_session_on_a_port_reads_the_memory_and_leaves_it_alone(tmp_path):
    first, second = PortState(tmp_path, "host:503"), PortState(tmp_path, "host:503")
    second.remember({"a": A})
    assert PortState(tmp_path, "host:503").memory.drives == ()
    first.remember({"b": B})
    assert PortState(tmp_path, "host:503").memory.drives == (B,)
    first.close()
    second.close()


def test_the_folder_of_a_record_survives_a_power_cut(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(atomic, "sync_folder", synced.append)
    for _ in range(2):
        PortState(tmp_path / "state", "port").close()
    assert synced == [tmp_path / "state", tmp_path], "once, as they are made"


def test_no_file_of_a_port_has_the_name_of_a_device(tmp_path):
    names = ("COM5", "com5", "CON", "nul", "LPT1", "aux.example.com:503", "COM10", "usb-0403-6001-A5069RR4", "end.")
    for port in names:
        state = PortState(tmp_path, port)
        assert state.remarks == []
        state.close()
    found = sorted(path.name for path in (tmp_path / "ports").iterdir())
    assert {unquote(name.removesuffix(".line")) for name in found} == set(names)
    assert not any(atomic.reserved(name) for name in found)
    assert "%43OM5.line" in found and "COM10.line" in found and "end%2E.line" in found


@pytest.mark.fork
def test_what_an_earlier_version_has_left_is_found_under_its_name(tmp_path):
    (tmp_path / "ports").mkdir()
    (earlier := tmp_path / "ports" / "aux.example.com%3A503.line").write_bytes(b"aMR 5".ljust(128, b"\0"))
    state = PortState(tmp_path, "aux.example.com:503")
    assert state.cut == "aMR 5"
    state.close()
    assert list((tmp_path / "ports").iterdir()) == [earlier]


@given(st.text(max_size=20))
def test_a_safe_name_stands_for_one_text_and_is_no_path(text):
    name = atomic.safe_name(text)
    assert unquote(name, errors="surrogatepass") == text
    assert not set(name) & set('<>:"/\\|?* ') and name.isascii() and not name.endswith(".")
    assert not atomic.reserved(name) and not atomic.reserved(f"{name}.json")


GONE, ADAPTER = "/dev/pts/4294967", "/dev/serial/by-id/usb-GONE-if00"


def files_of(tmp_path, name):
    return {path.suffix for path in (tmp_path / "ports").iterdir() if unquote(path.stem) == name}


@pytest.mark.fork
def test_the_files_of_ports_that_are_gone_are_deleted_once_nothing_depends_on_them(tmp_path):
    long_ago = 61 * 86400
    drives = {"": Remembered("", "", "LMDCM", "LMDCM 6.002", "x", "1", False, 0, 1)}
    for name in (GONE, ADAPTER, "10.0.0.5:503", "/dev/null"):
        state = PortState(tmp_path, name)
        state.remember(drives)
        state.close()
    assert files_of(tmp_path, GONE) == set()  # its own end has found it gone
    assert files_of(tmp_path, ADAPTER) == files_of(tmp_path, "/dev/null") == {".line", ".drives"}
    for path in (tmp_path / "ports").iterdir():
        os.utime(path, (path.stat().st_atime - long_ago, path.stat().st_mtime - long_ago))
    PortState(tmp_path, "/dev/zero").close()
    assert files_of(tmp_path, ADAPTER) == set()
    for kept in ("10.0.0.5:503", "/dev/null", "/dev/zero"):
        assert ".line" in files_of(tmp_path, kept)


@pytest.mark.fork
def test_what_a_session_uses_or_has_left_of_a_port_that_is_gone_stays(tmp_path):
    cut, held, owed = (f"{GONE}{number}" for number in range(3))
    state = PortState(tmp_path, cut)
    state.begun("MR 5")
    state.close()
    using = PortState(tmp_path, held)
    owing = PortState(tmp_path, owed)
    asyncio.run(owing.owes(known(restore=OWED)))
    owing.close()
    assert files_of(tmp_path, cut) == files_of(tmp_path, held) == {".line"}
    assert files_of(tmp_path, owed) == {".line", ".json"}
    assert PortState(tmp_path, cut).cut == "MR 5"
    using.close()
