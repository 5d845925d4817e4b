"""`multidrop config` and `multidrop report` to the letter: what counts, where it comes from, what is wrong."""

from __future__ import annotations

import io
import os
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from unittest import mock

import pytest

import multidrop as package
from multidrop.base.errors import Diagnostic
from multidrop.commands import machine
from multidrop.commands.machine import SECTIONS, not_in_force, shown
from multidrop.dialects.units import scale
from multidrop.shell.configuration import Guarding, SavedConnection, Settings
from multidrop.shell.sections import sections
from multidrop.transports.serial_ports import PortInfo
from tests.support.cases import for_each
from tests.support.front_door import Command, Done, tables


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The configuration file of a person, which is not there yet, and a state of its own."""
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "conf"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    (tmp_path / "conf").mkdir()
    return tmp_path / "conf" / "multidrop.toml"


# What counts


def test_without_a_file_every_setting_is_a_default(multidrop: Command, file: Path) -> None:
    done = multidrop("config", "show")
    found, added = tables(done), {f"[{name}]" for name in sections()}
    assert (done.returncode, done.stderr) == (0, "")
    assert found[""] == [f"# {file} does not exist: all settings are the defaults"]
    assert [each for each in found if each not in added] == [
        "",
        "[screen]",
        "[keys]",
        "[log]",
        "[simulator]",
        "[guards]",
    ]
    assert found["[screen]"] == [
        'theme = "by the terminal"   # default',
        'signs = "auto"   # default',
        'times = "clock"   # default',
    ]
    assert found["[log]"] == ["always = false   # default", "megabytes = 16.0   # default", "files = 8   # default"]
    assert found["[guards]"] == ["off = []   # default", "also = []   # default"]
    assert found["[simulator]"] == ["allow = []   # default"]
    assert 'palette = "^P"   # default' in found["[keys]"]
    assert multidrop("config", "path") == Done(0, f"{file}\n", "")


WHOLE = """[connections.press]
url = "sim:"
names = { a = "left", b = "right" }
[connections.far]
url = "ssh://me@pc/dev/x"
[screen]
theme = "multidrop-light"
signs = "ascii"
[keys]
find = "Alt+f"
[log]
always = true
megabytes = 2.5
[simulator]
allow = ["x"]
[guards]
also = ["VM", "EX"]
off = ["CP"]
"""


def test_what_the_file_sets_has_no_remark(multidrop: Command, file: Path) -> None:
    file.write_text(WHOLE)
    done = multidrop("config", "show")
    found = tables(done)
    assert (done.returncode, done.stderr, found[""]) == (0, "", [f"# {file}"])
    assert found["[connections.press]"] == ['url = "sim:"', 'names = { a = "left", b = "right" }']
    assert found["[connections.far]"] == ['url = "ssh://me@pc/dev/x"']
    assert found["[screen]"] == ['theme = "multidrop-light"', 'signs = "ascii"', 'times = "clock"   # default']
    assert 'find = "Alt+f"' in found["[keys]"] and 'palette = "^P"   # default' in found["[keys]"]
    assert found["[log]"] == ["always = true", "megabytes = 2.5", "files = 8   # default"]
    assert found["[simulator]"] == [f'allow = ["{file.parent / "x"}"]']
    assert found["[guards]"] == ['off = ["CP"]', 'also = ["EX", "VM"]']
    assert multidrop("config", "check") == Done(0, f"{file} is right\n", "")


def test_what_does_not_count_says_so_and_what_counts_in_its_place(file: Path) -> None:
    screen = Settings().screen
    settings = Settings(screen=screen.__class__(theme="pink", keys={"palette": "^G", "find": "F9"}))
    text = "[screen]\ntheme = 'pink'\n[keys]\npalette = '^G'\nfind = 'F9'\n"
    lines = shown(settings, {"palette": "^P", "find": "F9", "drive": "^O"}, text)
    refused = "   # default; the file's does not count"
    assert f'theme = "by the terminal"{refused}' in lines
    assert lines[lines.index("[keys]") + 1 :][:3] == [
        f'palette = "^P"{refused}',
        'find = "F9"',
        'drive = "^O"   # default',
    ]


@for_each("settings, said", [
    (Settings(), ""),
    (Settings(guards=Guarding(also=frozenset({"VM", "EX"}))), "the guards on EX, VM"),
    (Settings(guards=Guarding(off=frozenset({"FD", "CP"}))), "'off' of the guards CP, FD"),
    (Settings({"a": SavedConnection("a", "sim:", {"b": "left"})}), "the names of a"),
    (Settings({"a": SavedConnection("a", "sim:", {}, {"b": scale("5 mm/turn")})}), "the units of a"),
    (Settings({"a": SavedConnection("a", "sim:")}), ""),
    (Settings(problems=(Diagnostic("x"), Diagnostic("y"))), "what has errors in the file: 2"),
    (Settings({"a": SavedConnection("a", "sim:", {"b": "left"}, {"b": scale("5 mm/turn")})},
              guards=Guarding(frozenset({"FD"}), frozenset({"VM"})), problems=(Diagnostic("x"),)),
     "the guards on VM, 'off' of the guards FD, the names of a, the units of a, what has errors in the file: 1"),
])  # fmt: skip
def test_what_is_not_in_force_without_the_file(settings: Settings, said: str) -> None:
    assert not_in_force(settings) == said


def test_a_command_without_the_file_says_what_is_not_in_force_only_where_something_is_not(
    multidrop: Command, file: Path
) -> None:
    assert multidrop("config", "path", "--no-config") == Done(0, f"{file}\n", "")
    file.write_text("[guards]\nalso = ['VM']\n[log]\nalways = true\n")
    done = multidrop("config", "show", "--no-config")
    assert done.stderr == "--no-config: not in force: the guards on VM\n"
    assert tables(done)["[log]"][0] == "always = false" and tables(done)["[guards]"][1] == "also = []"
    assert tables(multidrop("config", "show"))["[log]"][0] == "always = true", "the next command reads the file again"


def test_a_check_names_all_that_is_wrong_or_says_that_nothing_is(multidrop: Command, file: Path) -> None:
    none = f"{file} does not exist: all settings are the defaults\n"
    assert multidrop("config", "check") == Done(0, none, "")
    file.write_text("[log]\nfiles = 0\n")
    assert multidrop("config", "check") == Done(2, "", f"{file}:2: log.files is not a number from 1 to 1000\n")
    file.write_text("[screen]\ntheme = 'pink'\n[log]\nfiles = 0\n")
    done = multidrop("config", "check")
    first, second = done.stderr.splitlines()
    assert (done.returncode, done.stdout, first) == (2, "", f"{file}:4: log.files is not a number from 1 to 1000")
    assert second.startswith(f"{file}:2: screen.theme: no theme pink")
    file.write_text("[screen]\ntheme = 'pink'\n")
    assert multidrop("config", "check").returncode == 2


# The report


def lines(title: str) -> list[str]:
    return list(SECTIONS[title]())


def test_the_report_names_program_interpreter_system_and_time() -> None:
    program, python, system, time = lines("multidrop")
    assert program.startswith(f"multidrop {package.__version__} in ")
    assert Path(program.partition(" in ")[2], "multidrop", "__init__.py").exists()
    assert sys.executable in python and ".".join(map(str, sys.version_info[:3])) in python
    assert os.name != "posix" or os.uname().release in system
    assert time.startswith("time 20") and len(time) == len("time 2026-11-29T15:12:38+00:00")


def test_the_report_names_each_package_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    needs = ["tomlkit>=0.12", "pyserial<4,>=3.5", "a[b]==1 ; extra == 'x'", 'gone; extra == "usb"', "textual"]
    found = {"tomlkit": "0.15", "pyserial": "3.5", "a": "1", "textual": "8"}

    def version(name: str) -> str:
        if name not in found:
            raise PackageNotFoundError(name)
        return found[name]

    monkeypatch.setattr(machine, "requires", lambda name: needs)
    monkeypatch.setattr(machine, "version", version)
    assert lines("packages") == [
        "tomlkit 0.15",
        "pyserial 3.5",
        "a 1 (extra x)",
        "gone not installed (extra usb)",
        "textual 8",
    ]
    monkeypatch.setattr(machine, "requires", lambda name: None)
    assert lines("packages") == []
    monkeypatch.setattr(machine, "requires", version)
    assert lines("packages") == ["not installed: it runs from a source tree"]


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


@pytest.mark.fork  # a console of Windows has facts of its own
def test_the_report_names_terminals_and_the_variables_that_matter() -> None:
    kept = {"TERM": "xterm", "NO_COLOR": "1", "SSH_CONNECTION": "1.2.3.4", "TMUX": "/tmp/x", "HOME": "/root"}
    kept |= {"COLUMNS": "100", "LINES": "30"}
    with mock.patch.dict(os.environ, kept, clear=True), mock.patch.object(sys, "stdout", Terminal()) as out:
        with mock.patch.object(sys, "stdin", io.StringIO()), mock.patch.object(sys, "stderr", io.StringIO()):
            one = lines("terminal")
        with mock.patch.object(sys, "stdin", Terminal()), mock.patch.object(sys, "stderr", Terminal()):
            three = lines("terminal")
        with mock.patch.object(sys, "stdin", io.StringIO()), mock.patch.object(sys, "stderr", io.StringIO()):
            out.isatty = lambda: False  # type: ignore[method-assign]
            none = lines("terminal")
    assert one == [
        "terminals: stdout; 100x30; encoding utf-8", "TERM=xterm", "NO_COLOR=1", "SSH_CONNECTION is set", "TMUX is set",
    ]  # fmt: skip
    assert three[0].startswith("terminals: stdin, stdout, stderr; 100x30")
    assert none[0].startswith("terminals: none; 100x30")


def test_the_report_has_the_configuration_without_secrets_and_its_problems(file: Path) -> None:
    assert lines("configuration") == [str(file), "no such file"]
    file.write_text("[mqtt]\npassword = 'secret'\n[log]\nfiles = 0")
    path, *text, problem = lines("configuration")
    assert path == str(file) and text[0] == "[mqtt]" and text[2:] == ["[log]", "files = 0"]
    assert "secret" not in text[1] and problem == f"problem: {file}:4: log.files is not a number from 1 to 1000"
    for count, more in ((200, []), (201, ["... 1 more lines"]), (350, ["... 150 more lines"])):
        file.write_text("\n".join(["# a"] * count))
        assert lines("configuration") == [str(file), *["# a"] * 200, *more]
    file.write_text("[log\n")
    *_, last = lines("configuration")
    assert last.startswith(f"problem: {file}")
    file.unlink()
    file.mkdir()
    path, first, *_ = lines("configuration")
    assert first.startswith("problem: ")


def test_the_report_names_macros_and_in_place_of_a_wrong_one_its_problem(file: Path) -> None:
    folder = file.parent / "macros"
    assert lines("macros") == [str(folder)]
    folder.mkdir()
    (folder / "bad.toml").write_text("name =\n")
    (folder / "go.toml").write_text("name = 'go'\nkey = 'F3'\n[[step]]\nline = 'PR P'\n")
    (folder / "to.toml").write_text("name = 'to'\n[[step]]\nline = 'PR P'\n")
    path, problem, go, to = lines("macros")
    assert (path, go, to) == (str(folder), "go F3", "to") and problem.startswith(f"problem: {folder / 'bad.toml'}:1: ")


def test_the_report_names_ports_and_the_files_of_the_state(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports = [PortInfo("/dev/ttyUSB0", "by-id/x", "FT232"), PortInfo("/dev/ttyS0")]
    monkeypatch.setattr("multidrop.shell.connect.schemes.local_ports", lambda: ports)
    assert lines("serial ports") == ["/dev/ttyUSB0  by-id/x  FT232", "/dev/ttyS0"]
    monkeypatch.setattr("multidrop.shell.connect.schemes.local_ports", list)
    assert lines("serial ports") == ["no serial port"]
    state = tmp_path / "state"
    assert lines("state folder") == [str(state)]
    (state / "logs").mkdir(parents=True)
    (state / "history").write_text("12345")
    (state / "logs" / "day.jsonl").write_text("1" * 1234)
    assert lines("state folder") == [str(state), "         5 history", f"      1234 logs{os.sep}day.jsonl"]
    for number in range(250):
        (state / f"x{number:03}").touch()
    assert len(lines("state folder")) == 201


def test_a_report_is_written_where_that_is_agreed_to_and_never_over_a_file(
    file: Path, multidrop: Command, tmp_path: Path
) -> None:
    def report(*words: str) -> Done:
        return multidrop("report", *words)

    printed = report()
    assert (printed.returncode, printed.stderr) == (0, "") and printed.stdout.startswith("== multidrop\n  multidrop ")
    assert "\n\n== packages\n" in printed.stdout and report("-o", "-")[::2] == (0, "")
    assert not [each for each in tmp_path.iterdir() if each.suffix == ".txt"]
    refused = report("-o", "r.txt")
    said = "r.txt: not written: this is not a terminal; read the report above, then add --yes\n"
    assert (refused.returncode, refused.stderr) == (2, said) and not (tmp_path / "r.txt").exists()
    written = report("-o", "r.txt", "--yes")
    assert (written.returncode, written.stderr) == (0, "the report is in r.txt\n")
    assert (tmp_path / "r.txt").read_text() == written.stdout
    again = report("-o", "r.txt", "--yes")
    assert (again.returncode, again.stderr) == (2, "r.txt: exists already; choose another name with -o\n")
    gone = report("-o", "gone/r.txt", "--yes")
    assert (gone.returncode, gone.stderr) == (2, "gone/r.txt: cannot be written: No such file or directory\n")


@for_each("typed, written", [("y", True), ("YES ", True), ("", False), ("no", False), (None, False)])
def test_at_a_terminal_a_person_is_asked_once(file: Path, tmp_path: Path, typed: str | None, written: bool) -> None:
    path = tmp_path / "r.txt"
    path.unlink(missing_ok=True)
    asking, said = Terminal("" if typed is None else f"{typed}\n"), io.StringIO()
    with mock.patch.multiple(sys, stdin=asking, stdout=Terminal(), stderr=said):
        assert machine.report(str(path), False) == 0
    assert path.exists() is written and said.getvalue().startswith(f"\nWrite the report to {path}? [y/N] ")
    assert said.getvalue().endswith(f"the report is in {path}\n" if written else "nothing was written\n")
