"""`multidrop run SCRIPT.py`: the stop key, what a report quotes, tracebacks, and what a program finds around it."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import pytest

from multidrop import script
from multidrop.api import threads
from multidrop.commands import python_program
from multidrop.shell.batch.virtual_loop import VirtualLoop
from tests.support.behind_api import thread_of
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.front_door import Command, Done

HEAD = "from multidrop.script import session, values\na = session.drive('a')\n"
Run = Callable[..., Done]


@pytest.fixture
def run(tmp_path: Path, multidrop: Command, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a program on a simulated line, on which time does not wait."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)

    def execute(text: str | bytes | None, *options: str, on: str = "sim:cell.toml") -> Done:
        """Without a text there is no file; bytes are all of it."""
        (tmp_path / "job.py").unlink(missing_ok=True)
        if text is not None:
            (tmp_path / "job.py").write_bytes(text if isinstance(text, bytes) else f"{HEAD}{text}".encode())
        return multidrop("run", "job.py", "--on", on, *options)

    return execute


def facts(done: Done) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


# The stop key


class Keys(ModuleType):
    """The stop key of a terminal, as a program of a test presses it: `import keys`."""

    def __init__(self) -> None:
        super().__init__("keys")
        self.ahead: list[int] = []
        self.continued: list[str] = []
        self.watched: list[str] = []
        self.has_terminal = False

    @contextlib.contextmanager
    def on_stop_key(
        self,
        ahead: Callable[[], None],
        stop: Callable[[], None],
        gone: Callable[[], None],
        continued: Callable[[Callable[[], None]], Callable[[], object]],
    ) -> Iterator[None]:
        self._ahead, self._stop, self._gone = ahead, stop, gone
        self.watched.append(threading.current_thread().name)
        forget = (
            continued(lambda: self.continued.append(threading.current_thread().name)) if self.has_terminal else None
        )
        yield
        if forget is not None:
            forget()
        self.watched.append("over")

    def press(self, session: Any) -> None:
        """As a keyboard does: its thread writes the stop, then the loop takes over."""
        self._ahead()
        thread_of(session).soon(self._stop)

    def hang_up(self, session: Any) -> None:
        thread_of(session).soon(self._gone)


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> Keys:
    found = Keys()
    monkeypatch.setattr(python_program, "on_stop_key", found.on_stop_key)
    monkeypatch.setitem(sys.modules, "keys", found)
    return found


WAIT = "import keys, threading\na.send('SL 1000')\n{}\nthreading.Event().wait(20)\nprint('went on')"
POSIX = pytest.mark.fork


@POSIX
def test_the_stop_key_ends_a_program_that_waits(run: Run, keys: Keys) -> None:
    done = run(WAIT.format("keys.press(session)"))
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr.splitlines()[0] == "stop: velocity 0 was read from both" and "Ctrl+X" in done.stderr
    assert keys.watched == ["multidrop", "over"], "the session's thread watches, to its end"


@POSIX
def test_after_the_stop_key_a_program_sends_nothing_more(run: Run, keys: Keys) -> None:
    text = (
        "import keys, multidrop, threading\ntry:\n    keys.press(session)\n    threading.Event().wait(20)\n"
        "except multidrop.Stopped as end:\n    print(end)\n"
        "for call in (lambda: a.move(1), session.resume):\n"
        "    try:\n        call()\n        print('sent')\n    except multidrop.Stopped as end:\n        print(end)\n"
    )
    done = run(text)
    assert done.returncode == 4, "the key counts, whatever the program makes of it"
    key, move, resume = done.stdout.splitlines()
    assert key == "Ctrl+X stopped every drive" and "sent" not in (move, resume)
    assert resume == "Ctrl+X stopped every drive; this program sends nothing more"


@POSIX
def test_a_terminal_that_hangs_up_interrupts_the_program(run: Run, keys: Keys) -> None:
    done = run(WAIT.format("keys.hang_up(session)"))
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.splitlines()[0] == "stopped a: velocity 0 was read from a"
    assert done.stderr.splitlines()[-1] == "interrupted"


@POSIX
def test_the_terminal_belongs_to_the_stop_key_while_the_session_is_open(run: Run, keys: Keys) -> None:
    keys.has_terminal = True
    before = sys.stdin
    reading = (
        "import sys, multidrop\nfor read in (input, sys.stdin.read, sys.stdin.readline):\n    try:\n        read()\n"
    )
    reading += "    except multidrop.Diagnostic as refusal:\n        print(refusal)\n"
    said = "input: the terminal belongs to the stop key here; give values with --set NAME=VALUE\n"
    assert run(reading) == Done(0, 3 * said, "") and sys.stdin is before
    keys.has_terminal = False
    assert run("print(input())").stderr.endswith("EOFError: EOF when reading a line\n")


@POSIX
def test_a_program_that_is_continued_takes_its_terminal_back(run: Run, keys: Keys) -> None:
    keys.has_terminal = True
    before = signal.getsignal(signal.SIGCONT)
    text = "import os, signal\nos.kill(os.getpid(), signal.SIGCONT)\na.position\n"
    assert run(text).returncode == 0 and keys.continued == ["multidrop"]
    assert signal.getsignal(signal.SIGCONT) is before
    keys.has_terminal = False
    assert run(text).returncode == 0 and len(keys.continued) == 1


# Reports


def test_a_line_of_the_report_has_its_place_its_times_and_what_was_printed(run: Run, tmp_path: Path) -> None:
    (tmp_path / "lines.txt").write_text("@a VM=600000\n@b PR P\n")
    (tmp_path / "helper.py").write_text("def asked(drive):\n    return drive.send('PR VM')\n")
    text = "import helper, threading\nhelper.asked(a)\nsession.run('lines.txt')\na.position\n"
    text += (
        "other = threading.Thread(target=a.send, args=('PR P',))\nother.start()\nother.join()\nsession.send('/drives')"
    )
    done = run(text, "--json")
    sent = [
        (each["line"], each["sent"], each["printed"], each.get("bus"), each.get("drive")) for each in facts(done)[:-1]
    ]
    assert (done.returncode, sent[:3]) == (
        0,
        [
            (4, "@press:a PR VM", ["768000"], "press", "a"),
            (5, "@a VM=600000; @b PR P", ["0"], "press", "a"),
            (0, "@press:a PR P", ["0"], "press", "a"),
        ],
    )
    first = facts(done)[0]
    assert first["ok"] is True and "error" not in first and first["file"] == "job.py"
    assert len(sent) == 4 and sent[3][:2] == (10, "/drives") and any("LMDCM" in line for line in sent[3][2])


CAUGHT = "try:\n    a.send('VM=5')\nexcept Exception:\n    pass\n"


@for_each("text, ok, said", [
    (f"{CAUGHT}a.send('PR P')", [False, True], ""),
    (CAUGHT, [False], ""),
    (f"{CAUGHT}raise RuntimeError", [False, False], "RuntimeError"),
    (f"{CAUGHT}raise RuntimeError('far')", [False, False], "RuntimeError: far"),
    (f"{CAUGHT}assert not a", [False, False], "AssertionError"),
    ("a.send('VM=5')", [False], "a refused 'VM=5': error 23: VM must be above VI (lower VI or raise VM first)"),
    ("a.position\nsession.drive('z')", [False], "session.drive: no drive z; found: a, b"),
    ("a.send('PR P')", [True], ""),
])  # fmt: skip
def test_a_call_that_failed_is_reported_once_and_before_what_came_after_it(
    run: Run, text: str, ok: list[bool], said: str
) -> None:
    *lines, last = facts(run(text, "--json"))
    assert [each["ok"] for each in lines] == ok
    assert last["summary"] | {"seconds": 0} == {"lines": len(ok), "failed": ok.count(False), "seconds": 0}
    assert not said or lines[-1]["error"] == said


def test_a_junit_report_quotes_the_line_that_ran_whatever_the_file_holds_by_then(run: Run, tmp_path: Path) -> None:
    text = "from pathlib import Path\nPath('job.py').write_text('')\n# ä\nassert a.position == 5, 'ä'  # far"
    done = run(text, "--junit", "report.xml")
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    [case] = suite
    assert (done.returncode, case.get("name"), case[0].tag, case[0].get("message")) == (
        1,
        "job.py:6: assert a.position == 5, 'ä'  # far",
        "failure",
        "AssertionError: ä",
    )
    done = run("raise RuntimeError", "--junit", "report.xml")
    (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
    assert (suite[0][0].tag, suite[0][0].get("message")) == ("error", "RuntimeError")


def test_a_program_that_was_not_begun_is_a_case_of_its_own(run: Run, tmp_path: Path) -> None:
    for text, said in (
        (b"x = (\n", "job.py:1: '(' was never closed"),
        (b"\n\nx = 1 +\n", "job.py:3: invalid syntax"),
    ):
        for more in ((), ("--json",)):
            done = run(text, "--junit", "report.xml", *more)
            assert (done.returncode, done.stderr) == (2, f"{said}\n")
        (suite,) = ElementTree.parse(tmp_path / "report.xml").getroot()
        assert (suite.get("tests"), suite.get("errors")) == ("1", "1")
    nothing = run(b"x\0")  # which is an error with a line in some versions of Python
    assert nothing.returncode == 2 and nothing.stderr.endswith("source code string cannot contain null bytes\n")
    assert run(None).stderr == "job.py: cannot be read: No such file or directory\n"


# Ends


@for_each("text, code, said", [
    ("import sys\nsys.exit()", 0, ""),
    ("import sys\nsys.exit(None)", 0, ""),
    ("import sys\nsys.exit(0)", 0, ""),
    ("import sys\nsys.exit(3)", 3, ""),
    ("import sys\nsys.exit('no')", 1, "no\n"),
    ("import sys\nsys.exit(['a'])", 1, "['a']\n"),
    ("def f():\n    a.send('VM=5')\nf()", 1,
     "job.py:4: a refused 'VM=5': error 23: VM must be above VI (lower VI or raise VM first)\n"),
])  # fmt: skip
def test_the_exit_code_is_that_of_the_end(run: Run, text: str, code: int, said: str) -> None:
    assert run(text) == Done(code, "", said)


def test_what_fails_before_the_program_has_no_line_of_it(run: Run, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text("frob = 1\n")
    done = run("print('never')")
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.startswith("cell.toml:1: ")
    *lines, last = facts(run("print('never')", "--json"))
    assert [(each["line"], each["ok"]) for each in lines] == [(0, False)] and last["summary"]["failed"] == 1


def test_a_signal_while_the_end_is_reported_cuts_nothing_off(run: Run, tmp_path: Path, monkeypatch: Any) -> None:
    (tmp_path / "cell.toml").write_text("frob = 1\n")
    say = python_program.fail

    def fail(failure: BaseException) -> int:
        signal.raise_signal(signal.SIGINT)
        return say(failure)

    monkeypatch.setattr(python_program, "fail", fail)
    done = run("print('never')")
    assert done.returncode == 2 and done.stderr.startswith("cell.toml:1: ") and done.stderr.count("\n") == 1


def test_a_traceback_has_the_frames_of_the_program_for_each_of_its_exceptions(run: Run) -> None:
    text = (
        "def ask():\n    a.send('VM=5')\ndef turn():\n    try:\n        ask()\n    except Exception as refusal:\n"
        "        raise ValueError('first') from refusal\ntry:\n    turn()\nexcept ValueError:\n    1 / 0\n"
    )
    done = run(text)
    lines = done.stderr.splitlines()
    assert done.returncode == 1
    assert [line for line in lines if line.startswith("  File")] == [
        '  File "job.py", line 7, in turn',
        '  File "job.py", line 4, in ask',
        '  File "job.py", line 11, in <module>',
        '  File "job.py", line 9, in turn',
        '  File "job.py", line 13, in <module>',
    ]
    assert "multidrop/" not in done.stderr and "    1 / 0" in lines
    assert lines[-1] == "ZeroDivisionError: division by zero" and "ValueError: first" in lines


# Around the program


def test_a_program_is_the_main_module_of_its_process_and_leaves_nothing_behind(run: Run, tmp_path: Path) -> None:
    before = sys.modules["__main__"], sys.argv, [*sys.path]
    text = "import sys, __main__\nfrom pathlib import Path\n"
    text += "print(__main__.a is a, sys.argv, Path(sys.path[0]) == Path.cwd())"
    text += "\nsys.path.append('x')\nsys.argv.append('y')\nraise SystemExit(values['code'])"
    done = run(text, "--set", "code=9")
    assert (done.returncode, done.stdout, done.stderr) == (1, "True ['job.py'] True\n", "9\n")
    assert (sys.modules["__main__"], sys.argv, sys.path) == before
    for name in ("session", "values"):
        with pytest.raises(ImportError, match=f"multidrop.script has a {name} only under `multidrop run SCRIPT.py`"):
            getattr(script, name)


def test_a_name_that_the_module_of_a_script_never_has_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"^module 'multidrop.script' has no attribute 'sesion'$"):
        script.sesion  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(script, "__wrapped__") and hasattr(script, "__getattr__")


def test_a_program_is_compiled_as_it_is_written(run: Run) -> None:
    done = run("def f(x: int) -> None: ...\nprint(f.__annotations__['x'])\nprint(values)")
    assert (done.returncode, done.stdout) == (0, "<class 'int'>\n{}\n")


def test_with_json_what_a_program_prints_is_beside_its_report(run: Run) -> None:
    done = run("print('one')\na.send('PR P')\nprint('two')", "--json")
    assert [each.get("sent") for each in facts(done)] == ["@press:a PR P", None]
    assert done.stderr == "one\ntwo\n"
    assert run("print('one')\na.send('PR P')") == Done(0, "one\n", "")


def test_questions_and_the_travel_are_answered_by_options(run: Run, tmp_path: Path) -> None:
    (tmp_path / "kept.toml").write_text("[parameters]\nRC = 33\n")
    text = "print(a.parameters.restore('kept.toml'))"
    refused = run(text)
    assert (refused.returncode, refused.stdout) == (2, "") and "; --yes agrees to it" in refused.stderr
    assert run(text, "--yes").stdout == "['a: RC=33 (was 25)']\n"
    (tmp_path / "conf").mkdir(exist_ok=True)
    units = "units = { a = { scale = '5 mm/turn', travel = '0..100 mm' } }"
    (tmp_path / "conf" / "multidrop.toml").write_text(
        f"[connections.press]\nurl = 'sim:{tmp_path}/cell.toml'\n{units}\n"
    )
    move = "session.drive('a').move_to(101, 'mm')"
    refused = run(move, "--yes", on="press")
    assert refused.returncode == 2 and "the travel is 0 mm to 100 mm" in refused.stderr
    assert "--beyond" in refused.stderr and run(move, "--beyond", on="press").returncode == 0


def test_with_no_config_the_session_of_a_program_reads_no_configuration(run: Run, tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir(exist_ok=True)
    (tmp_path / "conf" / "multidrop.toml").write_text("wrong")
    assert run("print(a.read('P'))").returncode == 2
    done = run("print(a.read('P'))", "--no-config")
    assert (done.returncode, done.stdout) == (0, "0\n")
