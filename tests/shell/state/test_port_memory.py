"""The memory of a port: any contents of the file, and places where it cannot be written."""

import os
from dataclasses import asdict, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.state import Remembered
from multidrop.shell.state.port_state import MOST_REPLIED, PortMemory, PortState

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
    import json

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
