"""`multidrop run SCRIPT.py`: a program with a session, its exit code, and what it leaves behind."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from multidrop.api import threads
from tests.support.cell_session import bus, party
from tests.support.processes import environment
from tests.support.until import PATIENCE
from tests.support.virtual import VirtualLoop

HEAD = "from multidrop.script import session, values\na = session.drive('a')\n"
POSIX = pytest.mark.fork


@pytest.fixture
def run(tmp_path: Path, multidrop: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run a program on a simulated line, on which time does not wait."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)

    def execute(text: str, *options: str, head: str = HEAD) -> Any:
        (tmp_path / "job.py").write_text(head + text)
        return multidrop("run", "job.py", *(options or ("--on", "sim:cell.toml")))

    return execute


def test_a_program_has_the_session_and_the_values(run: Any) -> None:
    text = (
        "a.move(int(values['steps']))\na.wait()\nprint(a.position, __name__, __file__)\nprint(session.send('@b PR P'))"
    )
    done = run(text, "--role", "gantry=sim:cell.toml", "--set", "steps=200")
    assert (done.returncode, done.stdout, done.stderr) == (0, "200 __main__ job.py\n['0']\n", "")


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("a.send('VM=5')", 1, "job.py:3: a refused 'VM=5': error 23: VM must be above VI (lower VI or raise VM first)"),
        ("session.drive('z')", 2, "job.py:3: session.drive: no drive z; found: a, b"),
        ("session.send('/sim unplug press')\na.position", 3, "job.py:4: "),
        ("session.stop()\na.move(1)", 4, "stop: velocity 0 was read from both"),
        ("session.stop()", 0, "stop: velocity 0 was read from both"),
        (
            "session.person_stopped()\nsession.stop()\nsession.resume()",
            4,
            "stop: velocity 0 was read from both",
        ),
        ("import sys\nsys.exit(7)", 7, ""),
        ("raise SystemExit('not today')", 1, "not today"),
        ("raise KeyboardInterrupt", 130, "interrupted"),
    ],
)
def test_exit_codes(run: Any, text: str, code: int, said: str) -> None:
    done = run(text)
    assert done.returncode == code and "Traceback" not in done.stderr
    assert done.stderr.startswith(said) and len(done.stderr.splitlines()) <= 2


def test_an_uncaught_exception_shows_the_frames_of_the_program_only(run: Any) -> None:
    done = run("def turn():\n    a.move(1.5)\na.send('SL 1000')\nturn()")
    assert done.returncode == 1
    assert done.stderr.splitlines()[:2] == [
        "stopped a: velocity 0 was read from a",
        "program ended, if one was running: a",
    ]
    assert done.stderr.count('  File "') == 2 == done.stderr.count('  File "job.py"')
    assert done.stderr.endswith("TypeError: 'float' object cannot be interpreted as an integer\n")


def test_what_is_wrong_beforehand_opens_nothing(run: Any, tmp_path: Path) -> None:
    done = run("x = (", "--on", "tcp://127.0.0.1:1")
    assert (done.returncode, done.stderr) == (2, "job.py:3: '(' was never closed\n")
    done = run("print('never')", "--on", "tcp://127.0.0.1:1")
    assert (done.returncode, done.stdout) == (3, "") and "nothing listens there" in done.stderr
    done = run("", "--set", "a=1")
    assert done.returncode == 2 and "nothing to open" in done.stderr


def test_files_of_a_person_beside_the_program_break_nothing(run: Any, tmp_path: Path) -> None:
    for name in ("drives", "macros", "shell", "tests", "transports"):
        (tmp_path / f"{name}.py").write_text(f"OWN = '{name}'")
    done = run("import drives, shell\nprint(drives.OWN, shell.OWN, a.position)", "--on", "sim:cell.toml")
    assert (done.returncode, done.stdout) == (0, "drives shell 0\n")


def test_reports_of_what_was_sent_and_where(run: Any, tmp_path: Path) -> None:
    text = "print('hello')\na.send('PR P')\ntry:\n    a.send('VM=5')\nexcept Exception:\n    pass\n"
    text += "assert a.position == 5, 'far'"
    done = run(text, "--on", "sim:cell.toml", "--json", "--junit", "report.xml")
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 1 and "hello" in done.stderr
    assert [(each["line"], each["sent"], each["printed"], each["ok"]) for each in facts[:-1]] == [
        (4, "@press:a PR P", ["0"], True),
        (6, "@press:a VM=5", [], False),
        (9, "assert a.position == 5, 'far'", [], False),
    ]
    assert (facts[0]["bus"], facts[0]["drive"], facts[0]["file"]) == ("press", "a", "job.py")
    assert facts[-1]["summary"] | {"seconds": 0} == {"lines": 3, "failed": 2, "seconds": 0}
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    assert (suite.attrib["tests"], suite.attrib["failures"], suite.attrib["errors"]) == ("1", "1", "0")
    done = run("a.send('VM=5')", "--on", "sim:cell.toml", "--json", "--junit", "report.xml")
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each.get("sent") for each in facts] == ["@press:a VM=5", None]
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    assert (suite.attrib["tests"], suite.attrib["failures"], suite.attrib["errors"]) == ("1", "0", "1")
    done = run("a.send('PR P')", "--on", "sim:cell.toml", "--junit", "report.xml")
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    assert done.returncode == 0 and suite.attrib["tests"] == "0"


@POSIX
@pytest.mark.parametrize("name", ["INT", "TERM", "HUP", "QUIT", "ALRM", "USR1", "USR2", "XCPU"])
def test_a_signal_interrupts_the_program_and_stops_what_it_moved(run: Any, name: str) -> None:
    number = signal.Signals[f"SIG{name}"]
    before = signal.getsignal(number)
    done = run(
        "import os, time\na.send('SL 1000')\n"
        f"try:\n    os.kill(os.getpid(), {number:d})\n    time.sleep(60)\nfinally:\n    print('finally')"
    )
    assert done.returncode == 130 and done.stdout == "finally\n"
    assert done.stderr.splitlines()[0] == "stopped a: velocity 0 was read from a"
    assert done.stderr.splitlines()[-1] == "interrupted"
    assert signal.getsignal(number) is before


@POSIX
def test_a_broken_pipe_of_the_programs_own_ends_nothing(run: Any) -> None:
    text = "import os\ngone, pipe = os.pipe()\nos.close(gone)\ntry:\n    os.write(pipe, b'x')\nexcept OSError:\n"
    assert run(text + "    print(a.position)").stdout == "0\n"


@POSIX
def test_a_program_that_swallows_a_signal_is_interrupted_all_the_same_and_leaves_nothing_moving(run: Any) -> None:
    kill = f"os.kill(os.getpid(), {signal.SIGTERM:d})"
    done = run(f"import os\na.send('SL 1000')\ntry:\n    {kill}\nexcept BaseException:\n    print(a.moving)")
    assert (done.returncode, done.stdout) == (130, "True\n")
    assert done.stderr.splitlines()[0] == "stopped a: velocity 0 was read from a"
    assert done.stderr.splitlines()[-1] == "interrupted"


def test_the_session_is_only_there_under_run() -> None:
    with pytest.raises(ImportError, match=r"under `multidrop run SCRIPT.py`; use multidrop.connect"):
        from multidrop.script import session  # noqa: F401


def in_one_file(shop: Any, *command: str) -> str:
    """What a Python process writes to standard output and standard error, which are the same file."""
    with (shop.folder / "out").open("w") as file:
        environ, python = environment(shop.folder), [sys.executable, *command]
        subprocess.run(python, cwd=shop.folder, env=environ, stdout=file, stderr=file, timeout=PATIENCE, check=False)
    return (shop.folder / "out").read_text()


@pytest.mark.process
@pytest.mark.parametrize(
    ("end", "said"),
    [
        ("1 / 0", "Traceback"),
        ("session.send('VM=5')", "job.py:3: b refused"),
        ("raise SystemExit('not today')", "not today"),
        ("session.stop()", "stop: velocity 0 was read from b"),
        pytest.param("import os; os.kill(os.getpid(), 15)", "interrupted", marks=POSIX),
    ],
)
def test_what_a_program_printed_comes_before_what_is_said_of_its_end(shop: Any, end: str, said: str) -> None:
    text = f"from multidrop.script import session\nprint('turned', end='. ')\n{end}\n"
    (shop.folder / "job.py").write_text(text)
    assert in_one_file(shop, "-m", "multidrop", "run", "job.py", "--on", "press").startswith(f"turned. {said}")


@pytest.mark.process
def test_what_a_plain_program_printed_comes_before_a_warning_and_its_traceback(shop: Any) -> None:
    text = "session.drive('b').send('SL 1000')\n    print('turns', end='. ')\n    1 / 0\n"
    (shop.folder / "plain.py").write_text(
        f"import multidrop\nwith multidrop.connect({shop.urls['press']!r}) as session:\n    {text}"
    )
    written = in_one_file(shop, "plain.py")
    assert written.startswith(
        "turns. stopped b: velocity 0 was read from b\nprogram ended, if one was running: b\nTraceback"
    )


@pytest.mark.process
@POSIX
def test_the_stop_key_ends_a_program_that_does_not_look(shop: Any) -> None:
    (shop.folder / "job.py").write_text(
        "from multidrop.script import session\nimport time\ntry:\n    input()\n"
        "except Exception as refusal:\n    print(refusal)\nsession.drive('b').send('SL 100000')\n"
        "print('moves', flush=True)\ntime.sleep(1000)\n"
    )
    terminal = shop.terminal("run", "job.py", "--on", "press")
    terminal.expect_exact("the terminal belongs to the stop key here")
    terminal.expect_exact("moves")
    terminal.send("\x18")
    terminal.expect_exact("stop: velocity 0 was read from b")
    terminal.wait()
    assert terminal.exitstatus == 4 and shop.velocity() == 0


@pytest.mark.process
@POSIX
def test_a_plain_program_that_crashes_leaves_nothing_moving(shop: Any) -> None:
    (shop.folder / "plain.py").write_text(
        f"import multidrop\nsession = multidrop.connect({shop.urls['press']!r})\n"
        "b = session.drive('b')\nb.send('SL 100000')\nassert b.moving\n1 / 0\n"
    )
    done = subprocess.run(
        [sys.executable, "plain.py"],
        cwd=shop.folder,
        env=environment(shop.folder),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 1 and "ZeroDivisionError" in done.stderr
    assert (
        done.stderr.endswith("stopped b: velocity 0 was read from b\nprogram ended, if one was running: b\n")
        and shop.velocity() == 0
    )
