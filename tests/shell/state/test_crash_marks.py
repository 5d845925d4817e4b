"""Marks of work under way: what a killed session leaves on a port is told once to the next one there."""

from __future__ import annotations

import json
import os
from datetime import datetime

import pytest

from multidrop.shell.state import crash_marks

PORT, OTHER = "/dev/ttyUSB0", "/dev/ttyUSB1"
GONE = 999_999_999
"""No system has processes of this number."""
BEGUN = datetime(2026, 2, 3, 4, 5, 6)
MACRO = (
    "macro shuttle, begun at 2026-02-03 04:05:06, was cut off with its session; nothing stopped its drives: "
    "they may still move, and on_early_end was not executed"
)


@pytest.fixture
def state(tmp_path):
    return tmp_path / "state"


def marks(state):
    return sorted(state.glob("unfinished/*/*.json"))


def killed(state):
    """Have the marks be those of a process that does not run."""
    for path in marks(state):
        path.write_text(json.dumps({**json.loads(path.read_text()), "pid": GONE}))


def download(state, address="a", port=PORT):
    return crash_marks.marked(state, port, address, "p.mxt", state / "b.mxt")


def lost(address, state):
    return (
        f"{address}the download of p.mxt was cut off with its session; the program may be incomplete; "
        f"what was in the drive before is in {state / 'b.mxt'}"
    )


@pytest.mark.parametrize(("address", "named"), [("a", "a: "), ("A", "A: "), ("", "")])
def test_a_download_that_was_cut_off_is_told_once_on_its_port_only(state, address, named):
    with download(state, address):
        killed(state)
        assert crash_marks.left(state, OTHER) == []
        assert crash_marks.left(state, PORT) == [lost(named, state)]
        assert crash_marks.left(state, PORT) == [] and marks(state) == []


def test_drives_whose_names_differ_in_their_case_have_a_mark_each(state):
    with download(state, "a"), download(state, "A"), download(state, ""):
        assert len({each.name.lower() for each in marks(state)}) == 3
        killed(state)
        assert sorted(crash_marks.left(state, PORT)) == sorted(lost(name, state) for name in ("a: ", "A: ", ""))


def test_work_that_ends_leaves_no_mark_whatever_ends_it(state):
    with download(state):
        (mark,) = marks(state)
        assert json.loads(mark.read_text()) == {"pid": os.getpid(), "text": lost("a: ", state)}
    assert marks(state) == []
    with pytest.raises(KeyboardInterrupt), crash_marks.playing(state, [PORT, OTHER], "shuttle", BEGUN):
        assert len(marks(state)) == 2
        raise KeyboardInterrupt
    assert marks(state) == []


def test_a_macro_that_was_cut_off_is_told_on_each_of_its_ports(state):
    with crash_marks.playing(state, [PORT, OTHER], "shuttle", BEGUN), crash_marks.playing(state, [PORT], "b", BEGUN):
        killed(state)
        assert crash_marks.left(state, OTHER) == [MACRO]
        assert crash_marks.left(state, PORT) == [MACRO.replace("shuttle", "b"), MACRO]


def test_work_of_a_process_that_runs_is_not_told(state):
    with download(state):
        (mark,) = marks(state)
        mark.write_text(json.dumps({"pid": os.getppid(), "text": "of another session"}))
        assert crash_marks.left(state, PORT) == [] and mark.exists()


def test_the_marks_of_an_earlier_process_with_the_number_of_this_one_are_told(state):
    with download(state):
        assert crash_marks.left(state, PORT) == [lost("a: ", state)]


def test_without_a_port_no_mark_is_made_and_none_is_told(state):
    with download(state, port=""), crash_marks.playing(state, [], "shuttle", BEGUN):
        assert not state.exists()
    assert crash_marks.left(state, "") == []


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"pid": "x", "text": "y"}', '{"pid": 1}'])
def test_a_damaged_mark_is_not_told(state, text):
    with download(state):
        (mark,) = marks(state)
        mark.write_text(text)
        assert crash_marks.left(state, PORT) == []


def test_a_disk_that_cannot_be_written_ends_nothing(state):
    state.write_text("a file")
    with download(state):
        pass
    assert crash_marks.left(state, PORT) == []
