"""`multidrop certify` from outside: exit codes, files, and sessions that are killed in the middle of a question."""

from __future__ import annotations

import contextlib
import signal
import time

import pytest

from tests.support.cell_session import bus, drive, party, pmx
from tests.support.until import PATIENCE

PMX = bus("w", pmx("00"), baud=0)


@pytest.fixture
def certify(multidrop, tmp_path):
    (tmp_path / "cell.toml").write_text(PMX)
    return lambda *arguments: multidrop("certify", *arguments)


def test_a_report_is_written_whole_and_compared(certify, tmp_path):
    done = certify("sim:cell.toml", "-o", "r.toml")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "00: 15 questions answered, 0 not asked in r.toml\n"
    same = certify("--compare", "r.toml", "sim:cell.toml")
    assert (same.returncode, same.stdout) == (0, "")
    text = (tmp_path / "r.toml").read_text()
    (tmp_path / "r.toml").write_text(text.replace('["?SAP"]', '["0"]'))
    other = certify("--compare", "r.toml", "sim:cell.toml")
    assert (other.returncode, other.stdout) == (1, "polarity-word: here ?SAP; in r.toml 0\n")
    assert "14 of 15 answers of r.toml are the same" in other.stderr
    assert certify("sim:cell.toml", "-o", "-").stdout == text


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("sim:cell.toml",), 2, "-o/--output --compare"),
        (("sim:cell.toml", "-o", "cell.toml"), 2, "cell.toml: exists already"),
        (("sim:cell.toml", "-o", "no/r.toml"), 2, "its folder does not exist"),
        (("sim:cell.toml", "-o", "r.toml", "--drive", "all"), 2, "a report is of one drive"),
        (("sim:cell.toml", "-o", "r.toml", "--drive", "07"), 1, "07 was not found"),
        (("--compare", "r.toml", "sim:cell.toml"), 2, "r.toml: cannot be read"),
        (("--compare", "cell.toml", "sim:cell.toml"), 2, "is not a report with answers"),
        (("tcp://127.0.0.1:1", "-o", "r.toml"), 3, "nothing listens there"),
    ],
)
def test_the_exit_code_and_one_line_say_what_happened(certify, tmp_path, arguments, code, said):
    done = certify(*arguments)
    assert done.returncode == code and said in done.stderr and done.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.glob("*.toml")) == ["cell.toml"]


def test_a_full_disk_is_said_before_anything_is_asked(certify, monkeypatch):
    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("multidrop.base.atomic.create_atomically", full)
    monkeypatch.setattr("multidrop.features.certify.certificate.Asking", None)
    done = certify("sim:cell.toml", "-o", "r.toml", "--yes")
    assert (done.returncode, done.stderr) == (2, "r.toml: cannot be written: No space left on device\n")


SETTINGS = 'PR EM," ",CK," ",PY," ",VM," ",R1'
SET = {"EM": 1, "CK": 0, "VM": 500000, "R1": 7}
KILLED = [
    ("CK=0", drive("LMDCM", "", **SET), ""),
    pytest.param("PY=0", drive("LMDCM", "", **SET), "", marks=pytest.mark.nightly),
    pytest.param("EM=1", drive("MDI", "", **SET), "", marks=pytest.mark.nightly),
    ("R1=7", party("a", **SET), "&drives=a&party=1"),
]


@pytest.mark.process
@pytest.mark.parametrize(("owed", "table", "how"), KILLED, ids=lambda each: each[:4])
def test_what_a_killed_certificate_has_changed_is_restored_by_the_next_session(home, owed, table, how):
    home.serve(bus("w", table, baud=9600, serve=["pty:w.tty"]))
    url = f"{home.folder / 'w.tty'}?baud=9600{how}"
    before = home.run("send", url, SETTINGS).stdout
    folder, ends = home.folder / "state" / "ports", time.monotonic() + PATIENCE

    def kept():
        with contextlib.suppress(FileNotFoundError):  # it is replaced meanwhile
            return "".join(path.read_text() for path in folder.glob("*.json"))
        return ""

    while f'"lines": "{owed}' not in kept():  # a kill that comes too late is tried again
        asking = home.start("certify", url, "-o", "r.toml")
        while f'"lines": "{owed}' not in kept() and asking.poll() is None:
            time.sleep(0.001)
        asking.send_signal(signal.SIGKILL)
        asking.communicate()
        assert time.monotonic() < ends
    done = home.run("send", url, SETTINGS)
    assert done.stdout == before and f"an interrupted certificate left other settings; restored: {owed}" in done.stderr
    assert not kept() and not (home.folder / "r.toml").exists()
