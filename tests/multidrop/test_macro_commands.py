"""`multidrop macro` at the front door: what plays, what is asked, an editor of a person, a deletion at a terminal."""

from __future__ import annotations

import asyncio
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from multidrop.__main__ import main
from multidrop.shell.batch.virtual_loop import VirtualLoop
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.front_door import Command, Done

GO = 'name = "go"\nkey = "F3"\n[[step]]\nafter = 5.0\nline = "@a PR P"\n[[step]]\nline = "@a VM={v:int}"\n'
ON = ("--on", "sim:cell.toml")


@pytest.fixture
def macros(tmp_path: Path) -> Path:
    """The macros of a person: one, `go`."""
    folder = tmp_path / "conf" / "macros"
    folder.mkdir(parents=True)
    (folder / "go.toml").write_text(GO)
    return folder


@pytest.fixture
def run(multidrop: Command, tmp_path: Path, macros: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run commands beside a cell file; time does not wait."""
    runner = asyncio.Runner
    monkeypatch.setattr(asyncio, "Runner", lambda **more: runner(**more | {"loop_factory": VirtualLoop}))
    (tmp_path / "cell.toml").write_text(bus("press", party("a", CK=0), baud=0))
    return multidrop


class Terminal(io.StringIO):
    """A stream that is a terminal, or none."""

    terminal = True

    def isatty(self) -> bool:
        return self.terminal


@pytest.fixture
def person(tmp_path: Path, run: Command) -> Callable[..., Done]:
    """Run a command at a terminal, where something is typed; the `closed` streams are none."""

    def call(*words: str, typed: str = "", closed: Sequence[str] = ()) -> Done:
        streams: dict[str, Any] = {"stdin": Terminal(typed), "stdout": Terminal(), "stderr": Terminal()}
        for name in closed:
            streams[name].terminal = False
        environment = {f"MULTIDROP_{name}_DIR": str(tmp_path / name.lower()) for name in ("STATE", "DATA")}
        environment["MULTIDROP_CONFIG_DIR"] = str(tmp_path / "conf")
        with mock.patch.dict(os.environ, environment), mock.patch.multiple(sys, **streams):
            code = main(words)
        return Done(code, streams["stdout"].getvalue(), streams["stderr"].getvalue())

    return call


# What plays


@for_each("options, printed, rounds", [
    ((), "0\n", "1 round"),
    (("--times", "2"), "0\n0\n", "2 rounds"),
    (("--fast", "--times", "3"), "0\n0\n0\n", "3 rounds"),
])  # fmt: skip
def test_a_macro_prints_what_its_drives_print_in_each_round(
    run: Command, options: tuple[str, ...], printed: str, rounds: str
) -> None:
    done = run("macro", "play", "go", *ON, "--set", "v=600000", *options)
    assert (done.returncode, done.stdout) == (0, printed)
    said, seconds = done.stderr.removesuffix(" s\n").rsplit(" ", 1)
    assert said == f"macro go: {rounds} played in"
    pauses = 0.0 if "--fast" in options else 5.0 * int(rounds.split()[0])
    assert pauses <= float(seconds) < pauses + 1.0


def test_as_json_a_macro_prints_objects_alone(run: Command) -> None:
    done = run("macro", "play", "go", *ON, "--set", "v=600000", "--fast", "--json")
    *lines, last = map(json.loads, done.stdout.splitlines())
    assert [(each["step"], each["line"], each["sent"]) for each in lines] == [(1, 5, "@a PR P"), (2, 7, "@a VM=600000")]
    assert done.returncode == 0 and (last["summary"]["macro"], last["summary"]["rounds"]) == ("go", 1)


def test_the_macro_of_the_project_hides_that_of_the_person_which_is_said(run: Command, tmp_path: Path) -> None:
    assert run("macro", "list") == Done(0, "go               F3   2 lines  values: v (a whole number)\n", "")
    assert run("macro", "show", "go").stdout.splitlines()[1:3] == ['name = "go"', 'key = "F3"']
    (tmp_path / "macros").mkdir()
    (tmp_path / "macros" / "go.toml").write_text('name = "go"\n[[step]]\nline = "@a PR VM"\n')
    hides = f"macro go: the one in macros is played, not that in {tmp_path / 'conf' / 'macros'}\n"
    done = run("macro", "play", "go", *ON)
    assert (done.returncode, done.stdout) == (0, "768000\n") and done.stderr.startswith(hides)
    assert run("macro", "list") == Done(0, "go               -    1 line  [macros]\n", hides)
    assert 'line = "@a PR VM"' in run("macro", "show", "go").stdout


def test_a_macro_that_cannot_be_read_is_told_and_hides_no_other(run: Command, macros: Path) -> None:
    (macros / "bad.toml").write_text("name =\n")
    done = run("macro", "list")
    assert (done.returncode, done.stdout.split()[0]) == (2, "go") and done.stderr.startswith(
        f"{macros / 'bad.toml'}:1:"
    )


def test_options_of_a_play_agree_to_questions_and_to_moves_beyond_the_travel(run: Command, macros: Path) -> None:
    (macros / "ip.toml").write_text('name = "ip"\n[[step]]\nline = "@a IP"\n')
    refused = run("macro", "play", "ip", *ON)
    assert refused.returncode == 2 and "nothing was sent; --yes agrees" in refused.stderr
    assert run("macro", "play", "ip", *ON, "--yes").returncode == 0
    (macros / "far.toml").write_text('name = "far"\n[[step]]\nline = "@a MA {{101 mm}}"\n')
    units = "units = { a = { scale = '5 mm/turn', travel = '0..100 mm' } }"
    cell = macros.parent.parent / "cell.toml"
    (macros.parent / "multidrop.toml").write_text(f"[connections.saved]\nurl = 'sim:{cell}'\n{units}\n")
    refused = run("macro", "play", "far", "--on", "saved", "--yes")
    assert refused.returncode == 2 and "the travel is 0 mm to 100 mm" in refused.stderr
    assert run("macro", "play", "far", "--on", "saved", "--beyond").returncode == 0


def test_a_value_that_is_missing_is_asked_for_at_a_terminal(person: Callable[..., Done], tmp_path: Path) -> None:
    url = f"sim:{tmp_path / 'cell.toml'}"
    done = person("macro", "play", "go", "--on", url, "--fast", "--json", typed="600000\n")
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and facts[1]["sent"] == "@a VM=600000" and "macro go" in done.stderr
    again = person("macro", "play", "go", "--on", url, "--fast", "--json", "--set", "v=500000")
    assert json.loads(again.stdout.splitlines()[1])["sent"] == "@a VM=500000", "what is given is not asked for"
    for more in (
        {"typed": ""},
        {"typed": "600000\n", "closed": ["stdin"]},
        {"typed": "600000\n", "closed": ["stderr"]},
    ):
        done = person("macro", "play", "go", "--on", url, "--fast", **more)
        assert (done.returncode, done.stdout) == (2, "") and "no value for {v}; set v=VALUE" in done.stderr
    assert person("macro", "play", "go").stderr.startswith("multidrop macro play: nothing to open; --on URL")


def test_an_interruption_of_the_questions_plays_nothing(
    person: Callable[..., Done], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("multidrop.shell.prompt.terminal_input.at_terminal", interrupted)
    done = person("macro", "play", "go", "--on", "tcp://127.0.0.1:1")
    assert (done.returncode, done.stdout) == (130, "") and "127.0.0.1" not in done.stderr


# An editor


class Editor:
    """The program of a person's editor: it changes the file that it is given, and ends with a code."""

    def __init__(self, change: Callable[[str], str] = str, code: int = 0) -> None:
        self._change, self._code = change, code
        self.commands: list[list[str]] = []
        self.interrupts: list[object] = []

    def __call__(self, command: list[str]) -> Editor:
        self.commands.append(command)
        return self

    def __enter__(self) -> Editor:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held."""

    def wait(self) -> int:
        self.interrupts.append(signal.getsignal(signal.SIGINT))
        file = Path(self.commands[-1][-1])
        file.write_text(self._change(file.read_text()))
        return self._code


@pytest.fixture
def edit(run: Command, monkeypatch: pytest.MonkeyPatch) -> Callable[[object], Done]:
    monkeypatch.setenv("VISUAL", "ed -s")
    before = signal.getsignal(signal.SIGINT)

    def call(editor: object) -> Done:
        with mock.patch.object(subprocess, "Popen", editor):
            done = run("macro", "edit", "go")
        assert signal.getsignal(signal.SIGINT) is before
        return done

    return call


def test_an_editor_gets_a_copy_and_what_it_leaves_becomes_the_macro(
    edit: Callable[[object], Done], macros: Path
) -> None:
    editor = Editor(lambda text: text.replace("PR P", "PR V"))
    done = edit(editor)
    assert (done.returncode, done.stdout) == (0, "") and done.stderr.startswith("macro go: ")
    assert (macros / "go.toml").read_text() == GO.replace("PR P", "PR V")
    [(program, option, file)] = editor.commands
    assert (program, option) == ("ed", "-s") and Path(file).name == "go.toml" and Path(file).parent != macros
    assert editor.interrupts == [signal.SIG_IGN], "Ctrl+C is the editor's own"
    assert edit(Editor()) == Done(0, "", "macro go: unchanged\n")


def test_an_editor_that_fails_leaves_the_macro_and_the_text(edit: Callable[[object], Done], macros: Path) -> None:
    editor = Editor(lambda text: text.replace("PR P", "PR V"), 3)
    done = edit(editor)
    file = editor.commands[0][-1]
    assert done == Done(2, "", f"ed: the editor ended with 3; go is as it was; your text is in {file}\n")
    assert (macros / "go.toml").read_text() == GO and "PR V" in Path(file).read_text()
    seen: list[str] = []
    again = edit(Editor(lambda text: seen.append(text) or text))  # type: ignore[func-returns-value]
    assert again.stderr.startswith(f"goes on with the text of the last edit, {file}\n") and "PR V" in seen[0]


@for_each("program, why", [("no-such-editor", "No such file or directory"), (sys.executable, "Permission denied")])
def test_an_editor_that_cannot_run_is_told(
    edit: Callable[[object], Done], macros: Path, program: str, why: str
) -> None:
    def cannot(command: list[str]) -> None:
        raise PermissionError(13, "Permission denied")

    with mock.patch.dict(os.environ, VISUAL=program):
        done = edit(cannot)
    assert done == Done(2, "", f"{program}: cannot run ({why}); set VISUAL or EDITOR; go is as it was\n")
    assert (macros / "go.toml").read_text() == GO


# Changes


@for_each("typed, closed, code, gone", [
    ("y\n", (), 0, True), ("Y\n", (), 0, True), ("yes\n", (), 2, False), ("n\n", (), 2, False), ("", (), 2, False),
    ("y\n", ("stdin",), 2, False), ("y\n", ("stderr",), 2, False), ("y\n", ("stdout",), 0, True),
])  # fmt: skip
def test_a_deletion_is_asked_for_at_a_terminal(
    person: Callable[..., Done], macros: Path, typed: str, closed: Sequence[str], code: int, gone: bool
) -> None:
    (macros / "go.toml").write_text(GO)
    done = person("macro", "delete", "go", typed=typed, closed=closed)
    asked = not {"stdin", "stderr"} & {*closed}
    assert (done.returncode, (macros / "go.toml").exists()) == (code, not gone)
    assert ("Go on? [y/N] " in done.stderr) is asked and done.stderr.startswith("macro delete") is True
    assert ("; nothing was deleted; --yes agrees to it" in done.stderr) is not gone


def test_a_deletion_that_is_agreed_to_asks_nothing(person: Callable[..., Done], macros: Path) -> None:
    done = person("macro", "delete", "go", "--yes")
    assert done.returncode == 0 and "[y/N]" not in done.stderr and not (macros / "go.toml").exists()


def test_what_was_changed_is_said_beside_the_output(run: Command, macros: Path, tmp_path: Path) -> None:
    for words, file, text in (
        (("describe", "go", "ten", "turns"), "go", 'note = "ten turns"'),
        (("copy", "go", "went"), "went", 'name = "went"'),
        (("rename", "went", "gone"), "gone", 'name = "gone"'),
        (("key", "F5", "gone", "--page", "jog"), "gone", 'page = "jog"'),
    ):
        done = run("macro", *words)
        assert (done.returncode, done.stdout) == (0, "") and done.stderr.count("\n") >= 1
        assert text in (macros / f"{file}.toml").read_text(), words
    assert run("macro", "copy", "go", "own", "--project").returncode == 0
    assert (tmp_path / "macros" / "own.toml").exists() and not (macros / "own.toml").exists()


def test_an_interrupted_change_is_130(run: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("multidrop.shell.macro_changes.describe", interrupted)
    assert run("macro", "describe", "go", "x").returncode == 130


def test_macros_are_imported_from_standard_input_and_replaced_by_force_only(run: Command, macros: Path) -> None:
    strings = "F5 MR 500^M ; forward\n"
    assert run("macro", "import", "-", stdin=strings).returncode == 0
    [made] = [path for path in macros.iterdir() if path.name != "go.toml"]
    before = made.read_text()
    assert (
        run("macro", "import", "-", stdin=strings.replace("500", "600")).returncode == 2 and made.read_text() == before
    )
    assert run("macro", "import", "-", "--force", stdin=strings.replace("500", "600")).returncode == 0
    assert "MR 600" in made.read_text()
