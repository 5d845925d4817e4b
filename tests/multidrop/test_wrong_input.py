"""What no person means and somebody types all the same: each is one clear line, exit 2 (3 where there is nothing), and
never a traceback. Numbers and brackets without end, dates, NULs, names that are too long, bytes that are no text."""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic
from multidrop.base.files import toml_of
from multidrop.base.text import whole
from multidrop.dialects import End
from multidrop.dialects.families import languages
from multidrop.dialects.language import Language
from multidrop.families.lexium.host.classify import INTEGER
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.pmx.host.operations import INTEGER as PMX_INTEGER
from multidrop.macros import parse_macro
from multidrop.shell import configuration
from multidrop.shell.configuration import Settings
from multidrop.shell.connect import urls
from multidrop.shell.events import FAILURES
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import LONGEST_PROBLEM_TEXT, report, shortened
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from tests.support.front_door import Command
from tests.support.processes import environment
from tests.support.until import PATIENCE
from tests.support.virtual import in_virtual_time

pytestmark = pytest.mark.slow

DIGITS = "9" * 5000
BRACKETS = "[" * 5000
NASTY = [
    DIGITS, f"-{DIGITS}", f"0.{DIGITS}", "nan", "inf", "-inf", "1e999", "(" * 5000, "((1" * 300, "!" * 5000, "a" * 5000,
    "a\0b", "\0", "\udcff", "é" * 300, "", " ", "٣", "²", "1_000", "0x" + "f" * 5000, "{" * 5000, "{A", "}", "/" * 5000,
    "~nobody/x", "../" * 2000, "%s%n", "\x1b[31m", "-", "--x", "1,-2", "1." * 2000, "000000001" + DIGITS,
]  # fmt: skip


@pytest.fixture
def told(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Run a command that must end with 2 and one line of a readable length, which is returned."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))
    for name, text in {"a.mxt": "PG 1\nLB SU\nE\nPG\n", "a.prg": "X1\nEND\n"}.items():
        (tmp_path / name).write_text(text)

    def run(*arguments: str, code: int = 2) -> str:
        assert main(arguments) == code, arguments
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and err.endswith("\n") and "Traceback" not in err
        assert len(err) <= LONGEST_PROBLEM_TEXT + 100 and "set_int_max_str_digits" not in err
        return err

    return run


# Numbers.


def test_a_number_is_digits_of_a_size_and_nothing_else() -> None:
    assert [whole(text, -5, 500) for text in ("0", "500", "-5", "+7", "007")] == [0, 500, -5, 7, 7]
    for text in (*NASTY, "501", "-6", "--1", "+", "1.0", "1 "):
        assert whole(text, -5, 500) is None, text[:20]


@given(st.text(max_size=30) | st.integers().map(str))
def test_any_text_is_a_number_in_range_or_none(text: str) -> None:
    found = whole(text, -1000, 10**9)
    assert found is None or (found == int(text) and -1000 <= found <= 10**9)


@pytest.mark.parametrize("pattern", [INTEGER, PMX_INTEGER])
def test_an_answer_of_digits_without_end_is_no_number(pattern: str) -> None:
    assert re.fullmatch(pattern, "-2147483648") and not re.fullmatch(pattern, DIGITS)


def test_a_drive_whose_answer_has_no_end_is_not_believed() -> None:
    """The line is somebody else's, and the answer is still waited for."""
    request = MCodeState(MCode(em=1)).codec.request("", "PR P")
    found = MCode(em=1).decode(request, f"\r\n{DIGITS}\r\n".encode())
    assert found is None or found.reply.end is not End.DONE


# Arguments.


TYPED = [DIGITS, f"-{DIGITS}", "nan", "1e999", "(" * 5000, "a" * 5000, "\udcff", "٣", "{" * 5000, "~nobody/x", "-"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("sim", "--speed", "{}x"),
        ("run", "{}.gone", "--on", "sim:"),
        ("program", "check", "{}.gone"),
        ("program", "test", "a.mxt", "--until", "{}x"),
        ("program", "test", "a.mxt", "--run=X{}"),
        ("program", "test", "a.mxt", "--run={}"),
        ("program", "test", "a.prg", "--run={}"),
        ("program", "test", "a.mxt", "--cell", "{}.gone"),
        ("plot", "sim:", "--serve", "127.0.0.1:{}x"),
        ("plot", "sim:", "--to", "{}/x/gone.rrd"),
        ("plot", "sim:", "--to", "rerun+http://h:{}x/proxy"),
        ("macro", "show", "{}.gone"),
    ],
    ids=" ".join,
)
def test_a_nasty_argument_is_one_line(told: Callable[..., str], arguments: tuple[str, ...]) -> None:
    for text in TYPED:
        if text != "-" or "--run={}" not in arguments:
            told(*(each.replace("{}", text) for each in arguments))


URLS = [
    f"tcp://h:{DIGITS}", "tcp://h:0", "tcp://h:٣", f"sim:?baud={DIGITS}", f"sim:?em={DIGITS}", "sim:?timeout=inf",
    f"sim:?timeout={DIGITS}", "sim:?timeout=nan", f"sim:{'a' * 5000}", "sim:%00\0", f"tcp://{'a' * 5000}", BRACKETS,
    f"sim:?drives={'a,' * 3000}", "sim:\udcff",
]  # fmt: skip


@pytest.mark.parametrize("url", URLS, ids=[ascii(each[:20]) for each in URLS])
def test_a_nasty_url_is_one_line(told: Callable[..., str], url: str) -> None:
    code = 3 if url == f"tcp://{'a' * 5000}" else 2
    told("send", url, "PR P", code=code)
    told("program", "list", url, code=code)


def test_a_plot_is_refused_where_it_cannot_be(told: Callable[..., str]) -> None:
    pytest.importorskip("rerun")
    assert "cannot write" in told("plot", "sim:#pmx", "--to", f"{'a' * 300}.rrd")
    assert "not a host name" in told("plot", "sim:#pmx", "--serve", "a..b:1")
    assert "not a host name" in told("plot", "sim:#pmx", "--serve", f"{'a' * 70}:1")


NASTY_FILES = {
    "digits in a URL": (["send", f"tcp://127.0.0.1:{DIGITS}", "PR P"], 2, "valid: 1 to 65535"),
    "digits in a baud rate": (["send", f"sim:?baud={DIGITS}", "PR P"], 2, "300 to 1000000"),
    "digits in a label": (["program", "test", "a.mxt", "--run", DIGITS], 2, "nothing to run at 9"),
    "digits in a port": (["plot", "sim:", "--serve", DIGITS], 2, "to serve at"),
    "no number at all": (["sim", "--speed", "nan"], 2, "nan is not a number from 0.001 to 1000"),
    "an hour without end": (
        ["program", "test", "a.mxt", "--until", "inf"],
        2,
        "inf is not a number of seconds above 0",
    ),
    "a home that there is not": (["plot", "sim:", "--to", "~nobody-at-all/a.rrd"], 2, "no folder ~nobody-at-all"),
    "settings of digits": (["send", "press", "PR P"], 2, "multidrop.toml:3: not TOML: a number without end"),
    "a macro of brackets": (["macro", "show", "deep"], 2, "deep.toml:2: not TOML: nested deeper than 50 levels"),
    "a macro of years": (["macro", "show", "dates"], 2, "dates.toml:3: step 1: after must be a number"),
    "a cell of digits": (["sim", "cell.toml"], 2, "cell.toml:2: not TOML: a number without end"),
}


@pytest.mark.parametrize("name", NASTY_FILES)
def test_what_is_nasty_in_a_file_or_a_word_ends_with_one_line(name: str, multidrop: Command, tmp_path: Path) -> None:
    arguments, code, says = NASTY_FILES[name]
    conf = tmp_path / "conf"
    (conf / "macros").mkdir(parents=True)
    if name == "settings of digits":
        (conf / "multidrop.toml").write_text(f'[connections.press]\nurl = "sim:"\nnames = {DIGITS}\n')
    (conf / "macros" / "deep.toml").write_text(f'name = "deep"\nstep = {BRACKETS}\n')
    (conf / "macros" / "dates.toml").write_text('name = "dates"\n[[step]]\nafter = 1979-05-27\nline = "PR P"\n')
    (tmp_path / "a.mxt").write_text("PG 1\nLB SU\nE\nPG\n")
    (tmp_path / "cell.toml").write_text(f"# digits\nseed = {DIGITS}\n")
    done = multidrop(*arguments)
    assert done.returncode == code and done.stderr.count("\n") == 1 and says in done.stderr, done.stderr[-500:]


@pytest.mark.process
def test_bytes_that_are_no_text_end_a_process_with_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "multidrop", "program", "check", b"\xff.prg"],
        cwd=tmp_path,
        env=environment(tmp_path),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1) and b"cannot be read" in done.stderr


@pytest.mark.process
def test_the_simulator_outlives_what_it_is_told(tmp_path: Path) -> None:
    lines = [f"/sim push a {DIGITS}", f"/sim input a 000000001{DIGITS} 0", "/sim \0", "/sim analog a nan", "/sim push"]
    (tmp_path / "lines").write_bytes("\n".join(lines).encode() + b"\n/sim push \xff\xfe 1\n/sim power a off\n")
    with open(tmp_path / "lines", "rb") as stdin:  # a file cannot be waited for: it is read at once
        sim = subprocess.Popen(
            [sys.executable, "-m", "multidrop", "sim", "--json"],
            cwd=tmp_path, env=environment(tmp_path), stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
    assert sim.stdout is not None
    while b"ready" not in sim.stdout.readline():
        assert sim.poll() is None
    sim.terminate()
    _, err = sim.communicate(timeout=PATIENCE)
    assert sim.returncode == 0 and b"Traceback" not in err and len(err.splitlines()) == 6


@pytest.mark.process
def test_a_folder_that_is_gone_is_told(tmp_path: Path) -> None:
    code = (
        "import os, sys\nos.makedirs('gone'); os.chdir('gone'); os.rmdir('../gone')\n"
        "from multidrop.__main__ import main\nsys.exit(main(['send', 'sim:cell.toml', 'PR P']))"
    )
    program = tmp_path / "program.py"  # with -c, Python itself searches the folder that is gone for modules
    program.write_text(code)
    done = subprocess.run(
        [sys.executable, str(program)],
        cwd=tmp_path,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 2 and done.stderr == "cell.toml: cannot be read: No such file or directory\n"


# Files.

VALUES = [
    DIGITS, f"-{DIGITS}", "0x" + "f" * 4000, "1" + "0" * 400, "1e999", "inf", "-inf", "nan", "1979-05-27", "07:32:00",
    "1979-05-27T07:32:00Z", BRACKETS, "[" * 300 + "]" * 300, "{a=" * 2000 + "1" + "}" * 2000, "true", '"a\\u0000b"',
    '"' + "a" * 5000 + '"', "[]", "{}", "[[1]]", "''", "1e308", "1e-320", '"\\u001b[31m"', "9223372036854775808",
    "a", "", f'"sim:?baud={DIGITS}"', f'"tcp://127.0.0.1:{DIGITS}"',
]  # fmt: skip
CELL = """seed = 1
[[bus]]
name = "l"
serve = ["tcp://127.0.0.1:0"]
baud = 9600
[bus.faults]
flip = 0.0
delay = [0.0, 0.0]
hangup_after = 1.0
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
program = "gone.mxt"
instruction_us = 200
set = { EM = 1 }
[bus.drive.world]
home = 0
limit_plus = 200000
load = 0.3
inputs = [[2.0, 1, 0]]
analog = [[0.0, 2048]]
locked = [[0.0, 1.0]]
"""
MACRO = 'name = "m"\nkey = "F3"\nnote = "n"\n[[step]]\nafter = 0.0\nline = "@a PR P"\n'
CONFIG = '[connections.press]\nurl = "sim:#pmx"\nnames = { a = "gantry" }\n'


def saved(text: str) -> list[str]:
    return [each.url for each in configuration.parse(text, "multidrop.toml").connections.values()]


READERS: dict[str, tuple[str, Callable[[str], object]]] = {
    "cell": (CELL.replace('program = "gone.mxt"\n', ""), lambda text: Floor(cells.read(text, "cell.toml"))),
    "macro": (MACRO, lambda text: parse_macro(text, "m.toml")),
    "settings": (CONFIG, lambda text: [urls.parse(each) for each in saved(text)]),
}


def mutants(text: str, whole: bool) -> list[str]:
    """The file with each of its values, and each number in a list, made nasty in turn; and nothing but nasty text."""
    found = list(VALUES) + [f"x = {value}" for value in VALUES] + ["a." * 5000 + "a = 1", "[" + "a." * 5000 + "a]"]
    for number, place in enumerate(re.finditer(r"(?<=[=\[, ])\s*(\"[^\"]*\"|[\d.]+|true)", text)):
        values = VALUES if whole else VALUES[number % 2 :: 2]
        found += [text[: place.start(1)] + value + text[place.end(1) :] for value in values]
    return found


@pytest.mark.parametrize("kind", READERS)
def test_a_file_with_a_nasty_value_is_read_or_told_in_one_line(kind: str, nightly: bool) -> None:
    text, read = READERS[kind]
    read(text)
    refused = 0
    for mutant in mutants(text, nightly or kind != "cell"):
        try:
            read(mutant)
        except Diagnostic as problem:
            refused += 1
            assert "\n" not in str(problem) and str(problem).strip()
    assert refused > 100


@given(st.text(alphabet="[]{}=\"'.,-+:#\n \\abc019eT_u", max_size=60))
def test_any_toml_is_a_table_or_a_line(text: str) -> None:
    try:
        toml_of(text, "x.toml")
    except Diagnostic as problem:
        assert str(problem).startswith("x.toml") and "\n" not in str(problem)


def test_where_in_the_file_it_is_stands_in_front() -> None:
    for text, says in (
        (f"a = 1\nb = {DIGITS}\n", "x.toml:2: not TOML: a number without end"),
        ("a = 1\n\nb = \n", "x.toml:3: not TOML: Invalid value"),
        (f"a = {BRACKETS}", "x.toml:1: not TOML: nested deeper than 50 levels"),
    ):
        with pytest.raises(Diagnostic, match=f"^{re.escape(says)}"):
            toml_of(text, "x.toml")


@given(st.sampled_from(["", "tcp://", "sim:", "udp://h:", "serial:", "modbus://", "sim:?"]), st.text(max_size=40))
def test_any_text_is_a_connection_or_none(head: str, text: str) -> None:
    try:
        urls.parse(head + text)
    except Diagnostic as problem:
        assert str(problem)


# Lines, as the prompt, scripts and macros run them.

LINES = [
    "%s", "@%s", "@%s PR P", "@l:%s PR P", "@a %s", "@* %s", "PR %s", "P=%s", "R1=1+%s", "R1=(%s", "DN=%s",
    "IS=1,%s,0", "VA %s", "/%s", "/open %s", "/open sim:%s", "/open sim:?baud=%s", "/close %s", "/use %s",
    "/status %s", "/list a %s.x", "/list %s", "/download %s", "/sleep %s", "/wait stopped %s", "/sim input a %s 0",
    "/sim analog a %s", "/sim push a %s", "/sim power %s on", "/record %s", "/play %s", "/play x A=%s", "/key F3 %s",
    "/key %s x", "/register %s", "/coil 1 %s", "/help %s", "/log %s", "/resume %s",
]  # fmt: skip
FAMILIES = {
    "mcode": CELL.replace('program = "gone.mxt"\n', "").replace("[bus.faults]\nflip = 0.0\n", "[bus.faults]\n")
    .replace("hangup_after = 1.0\n", "").replace("baud = 9600\n", ""),
    "pmx": '[[bus]]\nname = "l"\n[[bus.drive]]\npersonality = "PMX"\n',
}  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_a_nasty_line_is_carried_out_or_told(
    family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nightly: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(FAMILIES[family])

    @in_virtual_time
    async def typed() -> None:
        session = Session(Settings({}, tmp_path / "conf", tmp_path / "state", data=tmp_path / "data"))
        await session.open("sim:cell.toml?timeout=0.3")
        pairs = enumerate(product(LINES, NASTY))
        for line in (each.replace("%s", text) for number, (each, text) in pairs if nightly or number % 5 == 0):
            if re.match(r"/open (serial:|[/~.]|.*/)", line) or "/sleep" in line and "9" in line:
                continue  # what is a port, or waits
            try:
                async with asyncio.timeout(10_000):
                    await session.run(line)
            except FAILURES as failure:
                assert "\n" not in report(failure) and len(report(failure)) <= LONGEST_PROBLEM_TEXT + 2
            for name in [each for each in session.buses if each != "l"]:
                await session.forget(session.bus(name))
        await session.close()

    typed()


@pytest.mark.parametrize("language", languages())
def test_help_and_hints_take_any_text(language: Language) -> None:
    for text in NASTY:
        for line in (text, f"MR {text}", f"PR {text}", f"X{text}", f"V1={text}", f"BR SU,{text}", f"{text} 1"):
            language.hint(line)
            language.complete(line)
            language.knows(line)
            language.typing(line)


def test_a_message_keeps_its_beginning_and_its_end() -> None:
    assert shortened("a" * LONGEST_PROBLEM_TEXT) == "a" * LONGEST_PROBLEM_TEXT
    short = shortened(f"x.toml: {'b' * 5000} is no number; write 1 to 5")
    assert (
        short.startswith("x.toml: bbb")
        and short.endswith("b is no number; write 1 to 5")
        and len(short) <= LONGEST_PROBLEM_TEXT
    )
