"""What becomes of the command line's output when nobody can take it: a closed pipe, a full disk."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.processes import environment

pytestmark = pytest.mark.process

FULL = Path("/dev/full")


def run(folder, *arguments, stdout, **variables):
    command = [sys.executable, "-m", "multidrop", *arguments]
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=60, cwd=folder,
        env=environment(folder) | variables,
    )  # fmt: skip


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@pytest.mark.parametrize("variables", [{}, {"PYTHONUNBUFFERED": "1"}])
@pytest.mark.parametrize("arguments", [["send", "sim:#press", "PR P", "PR V"], ["--version"], ["send", "--help"]])
def test_a_full_disk_is_one_line_and_exit_1(tmp_path, arguments, variables):
    with FULL.open("w") as full:
        done = run(tmp_path, *arguments, stdout=full, **variables)
    assert (done.returncode, done.stderr) == (1, "the output cannot be written: No space left on device\n")


def test_a_reader_that_went_away_ends_nothing(tmp_path):
    lines = ["PR P", "PR V", "@b MR 5000", "/wait stopped", "/log moved.log", "@b PR P"]
    command = [sys.executable, "-m", "multidrop", "send", "sim:#press", *lines]
    sender = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, env=environment(tmp_path)
    )
    assert sender.stdout.readline() == b"0\n"
    sender.stdout.close()
    assert (sender.wait(60), sender.stderr.read()) == (0, b"")
    sender.stderr.close()
    assert '"bus": "press", "drive": "b", "text": "5000"}' in (tmp_path / "moved.log").read_text()


@pytest.mark.parametrize(
    ("arguments", "closed", "code", "told"),
    [
        (["send", "sim:#press", "PR P"], "<&- >&-", 0, ""),
        (["shell", "sim:#press"], "<&-", 0, None),
        (["tui", "sim:"], "<&-", 2, None),
        (["send", "sim:#press", "PR QQ"], "<&- >&- 2>&-", 1, ""),
        (["--version"], ">&-", 0, ""),
    ],
)
def test_closed_standard_streams_are_no_crash(tmp_path, arguments, closed, code, told):
    words = shlex.join([sys.executable, "-m", "multidrop", *arguments])
    done = subprocess.run(
        ["/bin/sh", "-c", f"exec {words} {closed}"], capture_output=True, text=True, timeout=60, cwd=tmp_path,
        env=environment(tmp_path),
    )  # fmt: skip
    assert done.returncode == code
    assert "Traceback" not in done.stderr and done.stderr.count("\n") <= 1
    assert told is None or done.stderr == told
