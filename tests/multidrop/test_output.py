"""What becomes of the command line's output when nobody can take it: a closed pipe, a full disk."""

import shlex
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from multidrop.shell.log.files import LogEntry, line_of
from tests.support.processes import environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

FULL = Path("/dev/full")


@pytest.mark.fork
@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@pytest.mark.parametrize("variables", [{}, {"PYTHONUNBUFFERED": "1"}])
@pytest.mark.parametrize("arguments", [["send", "sim:#press", "PR P", "PR V"], ["--version"], ["send", "--help"]])
def test_a_full_disk_is_one_line_and_exit_1(home, arguments, variables):
    with FULL.open("w") as full:
        done = home.process(*arguments, stdout=full, env=environment(home.folder) | variables)
    assert (done.returncode, done.stderr) == (1, "the output cannot be written: No space left on device\n")


MOVES = "@b MR 5000000\n/wait stopped 100\n"
PROGRAM = """from time import sleep
from multidrop.script import session

print("begun", flush=True)
session.send("@b MR 5000000")
while True:
    sleep(0.1)
"""
FOREVER = "name = 'go'\n" + "".join(
    f"[[step]]\nline = '{line}'\n" for line in ("/print round", "@b MR 5000000", "/wait stopped 100")
)


def left(home, *arguments, typed=""):
    """Run a command until it has printed a line, and leave. Return its exit code and standard error."""
    process = home.start(*arguments)
    process.stdin.write(typed)
    process.stdin.flush()
    assert process.stdout.readline()
    process.stdout.close()
    return process.wait(PATIENCE), process.stderr.read()


@pytest.mark.parametrize(
    "arguments",
    [
        ["send", "sim:#press", "PR P", *MOVES.splitlines()],
        ["shell", "sim:#press"],
        ["run", "s.txt", "--on", "sim:#press"],
        ["run", "s.py", "--on", "sim:#press"],
        ["macro", "play", "go", "--on", "sim:#press", "--times", "forever"],
    ],
    ids=lambda arguments: arguments[0] + arguments[1].removeprefix("s"),
)
def test_a_reader_that_leaves_stops_what_automation_moves_although_nothing_is_printed(home, arguments):
    for name, text in {"s.txt": f"PR P\n{MOVES}", "s.py": PROGRAM, "conf/macros/go.toml": FOREVER}.items():
        home.file(name, text)
    code, said = left(home, *arguments, typed=f"PR P\n{MOVES}" if arguments[0] == "shell" else "")
    assert code == 141
    assert "the reader of standard output is gone" in said and "stopped b" in said


def test_a_reader_that_leaves_a_session_of_reads_alone_stops_nothing(home):
    code, said = left(home, "send", "sim:#press", "@b PR P", "/sleep 100")
    assert (code, said) == (141, "the reader of standard output is gone\n")


def test_a_reader_that_has_its_last_line_is_a_good_end(home):
    assert left(home, "send", "sim:#press", "@b MR 5000", "/wait stopped", "@b PR P") == (0, "")


@pytest.mark.parametrize(
    "arguments",
    [["sim", "--json"], ["program", "test", "endless.mxt", "--until", "100000"], ["log", "follow", "day.jsonl"]],
    ids=lambda arguments: arguments[0],
)
def test_a_reader_that_leaves_ends_what_prints(home, arguments):
    home.file("endless.mxt", 'PG 1\nLB G1\nPR "begun"\nLB G2\nR1=1\nBR G2\nE\nPG\n')
    home.file("day.jsonl", line_of(LogEntry(datetime(2026, 1, 1, tzinfo=UTC), "typed", "PR P")))
    assert left(home, *arguments) == (141, "")


def test_the_reader_of_a_persons_own_program_leaves(home):
    home.file(
        "own.py",
        "import multidrop, sys, time\n"
        "with multidrop.connect('sim:#press') as session:\n"
        "    print('begun', flush=True)\n"
        "    session.send('@b MR 5000000')\n"
        "    time.sleep(100)\n",
    )
    process = subprocess.Popen(
        [sys.executable, "own.py"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=home.folder,
        env=environment(home.folder),
    )  # fmt: skip
    assert process.stdout.readline() == "begun\n"
    process.stdout.close()
    assert process.wait(PATIENCE) == 141
    with process.stderr:
        assert "stopped b" in process.stderr.read()


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
@pytest.mark.fork
def test_closed_standard_streams_are_no_crash(home, arguments, closed, code, told):
    words = shlex.join([sys.executable, "-m", "multidrop", *arguments])
    done = subprocess.run(
        ["/bin/sh", "-c", f"exec {words} {closed}"], capture_output=True, text=True, timeout=PATIENCE, cwd=home.folder,
        env=environment(home.folder),
    )  # fmt: skip
    assert done.returncode == code
    assert "Traceback" not in done.stderr and done.stderr.count("\n") <= 1
    assert told is None or done.stderr == told
