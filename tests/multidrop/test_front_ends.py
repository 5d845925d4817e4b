"""What each command of the front door hands on: URLs and options to the screen, the prompt, plots, servers, ports."""

from __future__ import annotations

import asyncio
import io
import json
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from multidrop.__main__ import main
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.transports.serial_ports import PortInfo
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.front_door import Called, Command, Done, at_terminal, on_lines

CELL = bus("press", party("a", CK=0), party("b", CK=0), baud=0)


Person = Callable[..., Done]


@pytest.fixture
def person(tmp_path: Path) -> Person:
    """Run a command at a terminal; those of the standard streams that are `closed` are none."""
    return partial(at_terminal, tmp_path)


# The screen and the prompt


@for_each("words, given", [
    ([], ([], True, False)),
    (["demo"], (["sim:"], True, False)),
    (["tui"], ([], True, False)),
    (["tui", "a", "b"], (["a", "b"], True, False)),
    (["tui", "a", "--no-reconnect"], (["a"], False, False)),
    (["tui", "a", "--raw"], (["a"], True, True)),
])  # fmt: skip
def test_the_screen_gets_urls_and_options(person: Person, words: list[str], given: tuple[Any, ...]) -> None:
    with pytest.MonkeyPatch.context() as patched:
        screen = Called(7)
        patched.setattr("multidrop.tui.launch.run", screen)
        assert person(*words) == Done(7, "", "")
    [(urls, *more, prepare, around)] = screen.calls
    assert ([*urls], *more) == given and callable(prepare) and callable(around)


@for_each("closed", ["stdin", "stdout"])
def test_the_screen_needs_a_terminal_on_both_sides(person: Person, closed: str) -> None:
    with pytest.MonkeyPatch.context() as patched:
        screen = Called()
        patched.setattr("multidrop.tui.launch.run", screen)
        said = "the screen needs a terminal; multidrop shell reads lines from anywhere\n"
        assert person("demo", closed=[closed]) == Done(2, "", said) and screen.calls == []


@for_each("words, given", [
    ([], {}),
    (["--no-reconnect"], {"reconnect": False}),
    (["--yes"], {"agreed": True}),
    (["--beyond"], {"beyond": True}),
    (["--raw"], {"raw": True}),
])  # fmt: skip
def test_the_prompt_gets_urls_and_options(person: Person, words: list[str], given: dict[str, bool]) -> None:
    with pytest.MonkeyPatch.context() as patched:
        prompt = Called(6)
        patched.setattr("multidrop.shell.prompt.prompt.run", prompt)
        assert person("shell", "a", "b", *words).returncode == 6
    usual = {"reconnect": True, "agreed": False, "beyond": False, "raw": False}
    [(urls, named)] = prompt.calls
    assert callable(named.pop("prepare")) and ([*urls], named) == (["a", "b"], usual | given)


@pytest.fixture
def piped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Run `multidrop shell` on lines from a file."""
    (tmp_path / "cell.toml").write_text(CELL)
    return on_lines(tmp_path, monkeypatch, capfd)


def test_lines_from_a_file_are_run_one_after_the_other(piped: Callable[..., Done]) -> None:
    assert piped("@a PR P\n@b PR DN\n") == Done(0, '0\n"b"\n', "")
    refused = piped("@a VM=5\n@a PR P\n")
    assert refused.returncode == 1 and refused.stdout in ("", "0\n") and "a refused 'VM=5'" in refused.stderr
    assert piped("") == Done(0, "", "")


def test_options_of_the_prompt_count_for_lines_from_a_file(piped: Callable[..., Done]) -> None:
    refused = piped("@a IP\n")
    assert refused.returncode == 2 and "nothing was sent; --yes agrees to it" in refused.stderr
    assert piped("@a IP\n", "--yes").returncode == 0
    raw, usual = piped("/drives\n", "--raw"), piped("/drives\n")
    assert "LMDCM" in usual.stdout and "LMDCM" not in raw.stdout + raw.stderr


# Plots


@for_each("words, given", [
    (["P", "--every", "1"], (["P"], "all", 1.0, 0, False, True)),
    (["P", "b.VM", "--every", "0.5", "--drive", "a", "--rows", "3"], (["P", "b.VM"], "a", 0.5, 3, False, True)),
    (["P", "--every", "1", "--drive", "a", "--drive", "b", "--json", "--no-reconnect"],
     (["P"], "a,b", 1.0, 0, True, False)),
])  # fmt: skip
def test_a_poll_gets_its_arguments(multidrop: Command, words: list[str], given: tuple[Any, ...]) -> None:
    with pytest.MonkeyPatch.context() as patched:
        poll = Called(9)
        patched.setattr("multidrop.shell.plots.poll.poll", poll)
        assert multidrop("poll", "sim:", *words).returncode == 9
    [(url, asked, named)] = poll.calls
    asked = ([*asked[0]], *asked[1:])
    assert url == "sim:" and (*asked, named["reconnect"]) == (given[0], given[1], given[2], asked[3], *given[4:])
    assert (asked[3] or 0) == given[3]


# A cell that is served


def test_a_cell_is_served_as_its_options_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[Any] = []

    async def serve(cell: str, **named: Any) -> None:
        calls.append((cell, {name: named[name] for name in ("json", "speed", "allow")}))

    monkeypatch.setattr("multidrop.simulator.serving.command.serve", serve)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    (tmp_path / "multidrop.toml").write_text('[simulator]\nallow = ["own.mxt"]\n')
    assert main(["sim"]) == main(["sim", "a.toml", "--json", "--speed", "3"]) == main(["sim", "--allow", "x"]) == 0
    own = (tmp_path / "own.mxt",)
    given = [Path(each).resolve() for each in (Path.cwd() / "x",)]
    assert calls[:2] == [
        (None, {"json": False, "speed": 1.0, "allow": ()}),
        ("a.toml", {"json": True, "speed": 3.0, "allow": own}),
    ]
    assert [Path(each).resolve() for each in calls[2][1]["allow"]] == given, "the demo cell needs no configuration"
    assert capsys.readouterr().err == ""


# A port that is lent


@pytest.mark.fork
def test_a_relay_lends_the_port_that_is_named_until_a_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    made, before = Called(), {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    codes: list[object] = []

    def serve(port: object) -> None:
        for number in before:
            with pytest.raises(SystemExit) as ended:
                signal.raise_signal(number)
            codes.append(ended.value.code)

    monkeypatch.setattr("multidrop.transports.serial_port.opened", made)
    monkeypatch.setattr("multidrop.transports.relay.serve", serve)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    try:
        assert main(["relay", "/dev/ttyUSB7", "--baud", "19200"]) == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert [call[1:] for call in made.calls] == [("/dev/ttyUSB7", 19200)]
    assert codes == [128 + signal.SIGTERM, 128 + signal.SIGHUP]


@pytest.mark.fork
def test_a_relay_takes_no_url_no_person_and_no_port_of_windows(multidrop: Command, person: Person) -> None:
    said = "tcp://***@h:1: is no serial port of this machine; as in /dev/ttyUSB0\n"
    assert multidrop("relay", "tcp://me:pw@h:1") == Done(2, "", said)
    for name in ("COM3", "/com12", "com1"):
        done = multidrop("relay", name)
        said = f"{name.strip('/')} is a port of Windows, and this is none; see `multidrop ports`\n"
        assert done == Done(3, "", said)
    assert multidrop("relay", "COM").stderr.startswith("no port COM")
    assert person("relay", "/dev/ttyUSB7") == Done(
        2,
        "",
        "multidrop relay: another multidrop starts this, through ssh, and speaks frames to it; "
        "open ssh://THIS-HOST/dev/ttyUSB7 on the other machine\n",
    )


# Ports and completion


PORTS = [PortInfo("/dev/ttyUSB0", "/dev/serial/by-id/x", "FT232"), PortInfo("/dev/ttyS0", "", "")]


def test_ports_are_listed_for_a_person_and_for_a_program(multidrop: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.shell.connect.schemes.local_ports", lambda: PORTS)
    assert multidrop("ports") == Done(0, "/dev/ttyUSB0  /dev/serial/by-id/x  FT232\n/dev/ttyS0\n", "")
    facts = [json.loads(line) for line in multidrop("ports", "--json").stdout.splitlines()]
    assert facts == [
        {"port": "/dev/ttyUSB0", "stable": "/dev/serial/by-id/x", "description": "FT232"},
        {"port": "/dev/ttyS0", "stable": "", "description": ""},
    ]
    monkeypatch.setattr("multidrop.shell.connect.schemes.local_ports", list)
    assert multidrop("ports") == Done(0, "", "no serial port was found; multidrop demo needs none\n")
    assert multidrop("ports", "--json") == Done(0, "", "")


@for_each("shell, sign", [("bash", "complete -o"), ("zsh", "#compdef multidrop"), ("fish", "complete -c multidrop"),
                          ("powershell", "Register-ArgumentCompleter")])  # fmt: skip
def test_a_completion_is_that_of_its_shell(multidrop: Command, shell: str, sign: str) -> None:
    done = multidrop("completion", shell)
    assert (done.returncode, done.stderr) == (0, "") and sign in done.stdout


# Help on a word


@for_each("words, code, first", [
    (["86"], 0, "error 86: stall"),
    (["5", "--dialect", "tmcl"], 0, "status 5: the EEPROM is locked"),
    (["5", "--dialect", "pmx"], 2, 'no error 5 on a PMX-2ED; it replies in words: /help "?Moving" explains one'),
    (["86", "--dialect", "mcode"], 0, "error 86: stall"),
    (["EX", "--dialect", "mcode"], 0, "EX: Execute"),
    (["123456789012"], 2, "no error 123456789; they are 0 to 111, with gaps"),
    (["²"], 2, "/help: no verb or command ²; /help lists the verbs"),
])  # fmt: skip
def test_help_explains_words_and_numbers_of_a_language(
    multidrop: Command, words: list[str], code: int, first: str
) -> None:
    done = multidrop("help", *words)
    lines = (done.stderr if code else done.stdout).splitlines()
    assert done.returncode == code and lines[0].startswith(first)


def test_help_names_the_other_languages_that_say_something_else_on_a_word(multidrop: Command) -> None:
    said = {word: multidrop("help", word).stdout.splitlines() for word in ("VM", "JA", "EX", "A")}
    also = {word: [line for line in lines if line.startswith("also: multidrop")] for word, lines in said.items()}
    assert also["VM"] == ["also: multidrop help VM --dialect modbus"] and also["JA"] == []
    assert also["EX"] == [f"also: multidrop help EX --dialect {each}" for each in ("modbus", "pmx")]
    for word, lines in also.items():
        for line in lines:
            other = multidrop(*line.split()[2:]).stdout
            assert other and other.splitlines() != said[word][: -len(lines)], "the other one says something else"


# Lines that are sent


@pytest.fixture
def cell(multidrop: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run commands beside a cell file; time does not wait."""
    runner = asyncio.Runner
    monkeypatch.setattr(asyncio, "Runner", lambda **more: runner(**more | {"loop_factory": VirtualLoop}))
    (tmp_path / "cell.toml").write_text(CELL)
    return multidrop


def test_sent_lines_are_reported_as_json_with_a_summary(cell: Command) -> None:
    done = cell("send", "sim:cell.toml", "@a PR P", "@b PR VM", "--json")
    *lines, last = map(json.loads, done.stdout.splitlines())
    assert (done.returncode, done.stderr) == (0, "")
    assert [(each["line"], each["sent"], each["printed"], each["ok"]) for each in lines] == [
        (1, "@a PR P", ["0"], True),
        (2, "@b PR VM", ["768000"], True),
    ]
    assert last["summary"] | {"seconds": 0} == {"lines": 2, "failed": 0, "seconds": 0}
    said = "a refused 'PR ZZ': error 35: this cannot be printed\n"
    assert cell("send", "sim:cell.toml", "@a PR ZZ", "@a PR P") == Done(1, "", said)
    done = cell("send", "sim:cell.toml", "@a PR ZZ", "@a PR P", "--json")
    first, last = map(json.loads, done.stdout.splitlines())
    assert (done.returncode, done.stderr, first["ok"], last["summary"]["failed"]) == (1, said, False, 1)


def test_a_script_needs_something_to_open_and_prints_objects_only_with_json(cell: Command, tmp_path: Path) -> None:
    (tmp_path / "s.txt").write_text("@a PR P\n/assert @a P == {place}\n")
    words = ("run", "s.txt", "--set", "place=0")
    for where in (("--on", "sim:cell.toml"), ("--role", "press=sim:cell.toml")):
        done = cell(*words, *where)
        assert (done.returncode, done.stdout) == (0, "0\n") and "2 lines, 1 check, 0 failed" in done.stderr
    done = cell(*words, "--on", "sim:cell.toml", "--json")
    assert [json.loads(line).get("sent") for line in done.stdout.splitlines()] == ["@a PR P", "/assert @a P == 0", None]
    said = "multidrop run: nothing to open; --on URL, or --role NAME=URL\n"
    assert cell(*words) == cell("run", "gone.py") == Done(2, "", said)
    assert cell("run", "s.txt", "--set", "place=5", "--on", "sim:cell.toml").returncode == 1


def test_questions_of_sent_lines_and_scripts_are_answered_by_yes(cell: Command, tmp_path: Path) -> None:
    (tmp_path / "s.txt").write_text("@a IP\n")
    sent = ("send", "sim:cell.toml", "@a IP")
    for words in (sent, (*sent, "--json"), ("run", "s.txt", "--on", "sim:cell.toml")):
        refused = cell(*words)
        assert refused.returncode == 2 and "nothing was sent; --yes agrees" in refused.stderr
        assert cell(*words, "--yes").returncode == 0


def test_a_line_for_one_drive_is_sent_although_others_do_not_reply(cell: Command) -> None:
    url = "sim:cell.toml?drives=a,z"
    for more in ((), ("--json",)):
        assert cell("send", url, "@a PR P", *more).returncode == 0
        assert cell("send", url, "@z PR P", *more).returncode == 1
