"""`multidrop log`, and what a killed process leaves in a log."""

import os
import signal
import subprocess
import sys

import pytest

from multidrop.commands.log import Following, joined, text
from multidrop.shell.log.files import line_of, whole
from multidrop.shell.log.writer import Disk
from tests.support.log_entries import ENTRIES, entry, log_command, newest_log
from tests.support.until import PATIENCE

SHOWN = [
    "2026-11-22 12:41:06.020 *  session log",
    "2026-11-22 12:41:06.020 >  press:b PR P",
    r"2026-11-22 12:41:06.020 >> press:b bPR P\n",
    r"2026-11-22 12:41:06.020 << press:b \x06512\r\n",
    "2026-11-22 12:41:06.020 <  press:b 512",
    r"2026-11-22 12:41:06.020 >> press:c cPR V\n",
    "2026-11-22 12:41:08.020 !  b refused 'ZZ': error 60",
    "2026-11-22 12:41:06.020 >  /drives",
]


@pytest.fixture
def log(tmp_path, monkeypatch):
    path = newest_log(tmp_path, monkeypatch)
    path.write_bytes(b"".join(map(line_of, ENTRIES)))
    return path


@pytest.fixture
def done(capsys):
    return log_command(capsys)


def test_the_newest_log_is_shown_in_lines_for_people_without_polls(log, done):
    assert done("show") == (0, [each for each in SHOWN if "press:c" not in each], [])
    assert done("show", log, "--all") == (0, SHOWN, [])


def test_json_is_the_file_as_it_is(log, done):
    assert done("show", "--json", "--all")[1] == log.read_text().splitlines()


@pytest.mark.parametrize("drive", ["c", "press:c"])
def test_one_drive_is_shown_by_itself(log, done, drive):
    assert done("show", "--drive", drive, "--all") == (0, SHOWN[5:6], [])


@pytest.mark.parametrize(
    ("words", "code", "found"),
    [(("512",), 0, SHOWN[3:5]), (("REFUSED",), 1, []), (("REFUSED", "-i"), 0, SHOWN[6:7]), (("cPR",), 1, [])],
    ids=str,
)
def test_grep_finds_what_is_shown_and_the_exit_code_says_whether(log, done, words, code, found):
    assert done("grep", *words) == (code, found, [])


def test_a_pattern_or_file_that_is_wrong_is_one_line(log, done, tmp_path):
    code, out, err = done("grep", "(")
    assert (code, out, len(err)) == (2, [], 1) and "is not a regular expression" in err[0]
    code, out, err = done("show", tmp_path / "gone")
    assert (code, out) == (2, []) and err[0].endswith("gone: cannot be read: No such file or directory")
    why = "Permission denied" if sys.platform == "win32" else "Is a directory"
    for words in (["show"], ["grep", "x"], ["follow"]):
        assert done(*words, "/") == (2, [], [f"/: cannot be read: {why}"])
    (tmp_path / "text").write_text("hello\n")
    code, out, err = done("show", tmp_path / "text")
    assert (code, out, len(err)) == (2, [], 1) and "text:1: is not an entry of a session log" in err[0]


def test_a_line_that_was_cut_off_is_said_and_the_rest_is_shown(log, done):
    log.write_bytes(line_of(ENTRIES[0]) + b'{"time": "20\n' + line_of(ENTRIES[-1]) + b'{"kind"')
    code, out, err = done("show")
    assert (code, out) == (0, [SHOWN[0], SHOWN[-1]])
    assert [each.partition(".jsonl:")[2][:25] for each in err] == [
        "2: not a whole entry: b'{",
        "4: not a whole entry: b'{",
    ]


def test_control_characters_of_a_drive_do_not_reach_the_terminal():
    assert text(entry("printed", "\x1b]0;x\x07")).endswith(r"\x1b]0;x\x07")
    assert text(entry("received", "\x9b")).endswith(r"\x9b")


def test_pieces_of_several_buses_and_after_an_end_of_line_stay_apart(tmp_path):
    pieces = [entry("received", each, bus) for each, bus in (("a", "x"), ("b", "y"), ("c\n", "y"), ("d", "y"))]
    (tmp_path / "log").write_bytes(b"".join(map(line_of, pieces)))
    assert [each.entry.text for each in joined(whole(tmp_path / "log"))] == ["a", "bc\n", "d"]


@pytest.fixture
def waited_for(monkeypatch):
    """An entry is written before `put` returns, however busy the machine is."""
    monkeypatch.setattr("multidrop.shell.log.writer.WRITE_TIMEOUT", PATIENCE)


@pytest.mark.usefixtures("waited_for")
def test_following_gives_each_line_once_whole_and_across_rotation(tmp_path):
    path = tmp_path / "log"
    disk = Disk(path, 300, 4, lambda: b"", lambda number: b"")
    following = Following(path)
    seen = []
    for number in range(30):
        disk.put(line_of(entry("notice", f"n {number}")))
        if number % 4 == 0:
            seen += [line.entry.text for line in following.look()]
    with path.open("ab") as file:
        file.write(b'{"time"')
    seen += [line.entry.text for line in following.look()]
    assert seen == [f"n {number}" for number in range(30)] and not following.lost
    disk.close()


@pytest.mark.usefixtures("waited_for")
def test_parts_that_went_before_they_were_read_are_noticed(tmp_path):
    disk = Disk(tmp_path / "log", 300, 2, lambda: b"", lambda number: b"")
    following = Following(tmp_path / "log")
    disk.put(line_of(entry("notice", "first")))
    assert len([*following.look()]) == 1
    for number in range(20):
        disk.put(line_of(entry("notice", f"n {number}")))
    assert [line.entry.text for line in following.look()][-1] == "n 19" and following.lost
    disk.close()


def test_follow_begins_with_the_last_lines_and_ends_with_an_interruption(log, done, monkeypatch):
    log.write_bytes(b"".join(line_of(entry("notice", f"n {number}")) for number in range(40)))
    waits = []

    def wait(seconds):
        waits.append(seconds)
        if len(waits) == 3:
            raise KeyboardInterrupt
        with log.open("ab") as file:
            file.write(line_of(entry("notice", f"added {len(waits)}")))

    monkeypatch.setattr("multidrop.commands.log.time.sleep", wait)
    code, out, err = done("follow")
    assert (code, err) == (0, []) and [each.partition("*  ")[2] for each in out] == [
        *(f"n {n}" for n in range(30, 40)),
        "added 1",
        "added 2",
    ]


KILLED = """
import os, sys
from pathlib import Path
from multidrop.shell.log import writer as at
at.PATIENCE = 60  # a machine under load
disk = at.Disk(Path(sys.argv[1]), 10**6, 3, lambda: b"", lambda number: b"missing")
for number in range(10**9):
    disk.put(b"%d\\n" % number)
    os.write(1, b"%d\\n" % number)
"""


@pytest.mark.process
def test_a_kill_loses_nothing_that_was_put(tmp_path):
    with subprocess.Popen([sys.executable, "-c", KILLED, tmp_path / "log"], stdout=subprocess.PIPE) as child:
        put = [child.stdout.readline() for _ in range(200)]
        os.kill(child.pid, signal.SIGKILL)
        put += [line for line in child.stdout.readlines() if line.endswith(b"\n")]
    written = (tmp_path / "log").read_bytes().splitlines()
    assert written[: int(put[-1]) + 1] == [b"%d" % number for number in range(int(put[-1]) + 1)]
