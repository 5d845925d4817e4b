import errno
import os
import signal
import subprocess
import sys

import pytest

from multidrop.shell.prompt import line_queue
from multidrop.shell.prompt.line_queue import History
from tests.support.posix import has_mode
from tests.support.until import PATIENCE


@pytest.fixture
def three_kept(monkeypatch):
    monkeypatch.setattr(line_queue, "MOST_HISTORY_LINES", 3)


def test_lines_are_kept_between_runs_oldest_first(tmp_path):
    kept = History(tmp_path / "new" / "history")
    for line in ("PR P", "  ", "MR 100", "two\nlines"):
        kept.append(line)
    assert History(kept.path).lines() == ["PR P", "MR 100"]
    assert has_mode(kept.path, 0o600)


def test_a_history_that_cannot_be_kept_costs_no_line(tmp_path):
    (tmp_path / "file").write_text("")
    kept = History(tmp_path / "file" / "history")
    kept.append("PR P")
    assert kept.lines() == []


def test_a_long_history_is_cut(tmp_path, three_kept):
    kept = History(tmp_path / "history")
    for number in range(7):
        kept.append(f"MR {number}")
    assert kept.lines() == ["MR 4", "MR 5", "MR 6"]
    assert kept.path.read_text().splitlines() == ["MR 4", "MR 5", "MR 6"]


def filled(path, lines=7):
    path.write_text("".join(f"MR {number}\n" for number in range(lines)))
    return History(path)


def test_a_file_that_is_cut_keeps_its_mode(tmp_path, three_kept):
    kept = filled(tmp_path / "history")
    for mode in (0o600, 0o640, 0o400):
        kept.path.chmod(0o600)
        filled(kept.path)
        kept.path.chmod(mode)
        kept.lines()
        assert has_mode(kept.path, mode)


def test_a_file_made_anew_is_for_its_user_only(tmp_path, three_kept):
    kept = History(tmp_path / "history")
    for number in range(9):
        kept.append(f"MR {number}")
        assert kept.lines()[-1] == f"MR {number}"
    assert has_mode(kept.path, 0o600)
    assert len(kept.path.read_text().splitlines()) <= 6


@pytest.mark.fork
def test_a_line_that_another_process_adds_while_the_file_is_cut_is_kept(tmp_path, monkeypatch, three_kept):
    ours, theirs = filled(tmp_path / "history"), History(tmp_path / "history")
    write = line_queue.write_atomically

    def slow(path, data, mode, **how):
        theirs.append("PR P")  # it cannot have the lock, and writes to the file that goes
        write(path, data, mode, **how)

    with monkeypatch.context() as patch:
        patch.setattr(line_queue, "write_atomically", slow)
        ours.lines()
    theirs.append("PR V")
    assert ours.lines() == ["MR 6", "PR P", "PR V"]


@pytest.mark.process
def test_two_processes_lose_no_line(tmp_path):
    script = (
        "import sys; from multidrop.shell.prompt.line_queue import History\n"
        "kept = History(__import__('pathlib').Path(sys.argv[1]))\n"
        "for n in range(200): kept.append(f'{sys.argv[2]} {n}'); n % 20 or kept.lines()\n"
    )
    path = tmp_path / "history"
    both = [subprocess.Popen([sys.executable, "-c", script, str(path), name]) for name in "ab"]
    assert [each.wait(PATIENCE) for each in both] == [0, 0]
    lines = path.read_text().splitlines()
    assert sorted(lines) == sorted(f"{name} {n}" for name in "ab" for n in range(200))


def test_a_full_disk_costs_one_line_and_not_the_next(tmp_path):
    resource = pytest.importorskip("resource")
    kept = History(tmp_path / "history")
    kept.append("MR 1")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, hard))
    try:
        kept.append("PR P")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert kept.lines() == ["MR 1"], "a part of a line is no line: MR 5 of MR 51200"
    kept.append("MR 2")
    assert kept.lines() == ["MR 1", "MR 2"]


def test_a_part_of_a_line_is_gone_once_the_file_is_cut(tmp_path, three_kept):
    kept = filled(tmp_path / "history")
    with kept.path.open("a") as file:
        file.write("MR 5")
    kept.append("MR 7")
    kept.lines()
    assert kept.path.read_text() == "MR 5\nMR 6\nMR 7\n"


def test_a_full_disk_leaves_a_long_history_as_it_was(tmp_path, monkeypatch, three_kept):
    kept = filled(tmp_path / "history")

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        assert kept.lines() == ["MR 4", "MR 5", "MR 6"]
    assert len(kept.path.read_text().splitlines()) == 7
    assert [each for each in os.listdir(tmp_path) if each != "history.lock"] == ["history"]
