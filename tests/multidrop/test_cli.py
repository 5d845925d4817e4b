"""The command line from outside, and the package: usage, help, exit codes that need no drive, public names."""

import subprocess
import sys
import tomllib

import pytest

import multidrop
from multidrop import cli
from multidrop.shell.operations import table
from multidrop.simulator.declared import simulated
from multidrop.simulator.families import PROGRAMS
from tests.support.paths import ROOT
from tests.support.until import PATIENCE

COMMANDS = ["demo", "tui", "shell", "send", "run", "sim", "program", "macro", "ports", "report", "completion"]
RUN = [each for each in table.COMMANDS.values() if each.run]


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "code", "out", "err"),
    [(["--version"], 0, 1, 0), (["frob"], 2, 0, 1), (["send", "/dev/does-not-exist", "PR P"], 3, 0, 1)],
)
def test_a_process_has_the_exit_code_and_its_lines_on_either_output(home, arguments, code, out, err):
    done = home.process(*arguments)
    assert (done.returncode, done.stdout.count("\n"), done.stderr.count("\n")) == (code, out, err)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["frob"], "frob"),
        (["send"], "URL"),
        (["send", "sim:"], "LINE"),
        (["run", "x.txt"], "--on"),
        (["run", "x.txt", "--on", "sim:", "--set", "STEPS"], "STEPS is not NAME=VALUE"),
        (["sim", "--speed", "never"], "never is not a number"),
        (["macro"], "list|show|play"),
        (["--frob"], "--frob"),
        (["send", "sim:?em=7", "PR P"], "em=7"),
        (["send", "nowhere", "PR P"], "nowhere"),
        (["send", "modbus://127.0.0.1?dialect=mcode", "PR P"], "drop dialect="),
        (["send", "/dev/null?dialect=gcode", "PR P"], "gcode"),
        (["run", "gone.txt", "--on", "sim:"], "gone.txt"),
        (["run", "x.py", "--on", "sim:"], "x.py: cannot be read"),
        (["macro", "show", "gone"], "gone"),
        (["macro", "play", "gone", "--on", "sim:"], "gone"),
        (["sim", "gone.toml"], "gone.toml"),
        (["/plot"], "/plot"),
        ([], "terminal"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(multidrop, arguments, named):
    done = multidrop(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert named in done.stderr and done.stderr.count("\n") == 1


def test_what_cannot_be_reached_is_one_line_and_exit_3(multidrop):
    for url in ("/dev/does-not-exist", "tcp://127.0.0.1:1", "modbus://127.0.0.1:1"):
        done = multidrop("send", url, "PR P")
        assert (done.returncode, done.stdout) == (3, "")
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("command", [[], *([each] for each in COMMANDS), ["macro", "play"]])
def test_help_is_there_for_every_command_with_examples(multidrop, command):
    done = multidrop(*command, "--help")
    assert done.returncode == 0 and done.stderr == ""
    if command:
        assert f"examples:\n  multidrop {command[0]}" in done.stdout


@pytest.mark.parametrize("run", [*RUN, cli.build().get_default("run_by")])
def test_the_table_of_commands_names_functions(run):
    assert callable(run.command_work)


def test_the_help_names_each_personality_that_runs_programs(multidrop):
    told = multidrop("program", "test", "--help").stdout
    for name, row in simulated().items():
        for personality in row.personalities:
            assert (personality in told) == (name in PROGRAMS)


@pytest.mark.process
def test_help_and_version_import_nothing_heavy():
    code = (
        "import sys\nfrom multidrop.__main__ import main\ncode = main(sys.argv[1:])\n"
        "heavy = {'textual', 'prompt_toolkit', 'multidrop.simulator.floor', 'rerun', 'serial', 'pymodbus', 'asyncio'}\n"
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    for asked in ("--version", "--help"):
        done = subprocess.run(
            [sys.executable, "-c", code, asked], capture_output=True, text=True, timeout=PATIENCE, cwd=ROOT, check=True
        )
        assert done.stdout.splitlines()[-1] == "0 []"


def test_a_broken_configuration_is_one_line_that_names_it(home):
    home.settings("[connections.press]\nur = 1\n")
    done = home.run("send", "press", "PR P")
    assert done.returncode == 2 and "multidrop.toml:2: no key connections.press.ur" in done.stderr


def test_macros_are_listed_and_shown_as_their_files_have_them(home):
    home.macro("go", "@a MR {STEPS}", key="F3")
    home.file("conf/macros/bad.toml", "name =\n")
    listed = home.run("macro", "list")
    assert listed.returncode == 2 and "bad.toml" in listed.stderr
    assert listed.stdout.split() == ["go", "F3", "1", "line", "values:", "STEPS"]
    assert 'line = "@a MR {STEPS}"' in home.run("macro", "show", "go").stdout
    played = home.run("macro", "play", "go", "--on", "/dev/does-not-exist")
    assert played.returncode == 2 and "STEPS" in played.stderr


# The package


def test_the_public_names_are_there():
    assert [name for name in multidrop.__all__ if getattr(multidrop, name) is None] == []
    assert multidrop.Session.__name__ == "Session"


def test_what_is_not_public_is_an_attribute_error():
    with pytest.raises(AttributeError, match="frob"):
        multidrop.frob  # noqa: B018


def test_the_version_says_which_extras_are_installed(monkeypatch):
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    assert set(cli.EXTRAS) <= set(cli.extras()) <= set(project["optional-dependencies"])
    monkeypatch.setattr(cli, "extras", lambda: {"here": "json", "absent": "no_such_module"})
    python = ".".join(map(str, sys.version_info[:3]))
    assert cli.version() == f"multidrop {multidrop.__version__}, Python {python}, extras: here"
    monkeypatch.setattr(cli, "extras", dict)
    assert cli.version().endswith("extras: none")


@pytest.mark.parametrize(
    ("arguments", "begins", "ends"),
    [
        (["86"], "error 86: stall", ""),
        (["VM"], "VM: Maximum velocity", ""),
        (["EX"], "EX: Execute", "also: multidrop help EX --dialect pmx"),
        (["EX", "--dialect", "pmx"], "E: encoder's position", ""),
        (["5"], "status 5: the EEPROM is locked", ""),
        (["/plot"], "/plot ", ""),
        (["ja"], "JA: Jump\n", "  use        in programs only"),
        (["DJNZ", "--dialect", "tmcl"], "DJNZ: Count a user variable down", "  use        in programs only"),
        (["wait"], "WAITX: ", "also: the verb /wait; help /wait explains it"),
        (["STOP"], "STOP: ", "also: the verb /stop; help /stop explains it"),
        ([], "Stop and end:\n", ""),
    ],
)
def test_words_and_numbers_are_explained_without_a_connection(multidrop, arguments, begins, ends):
    done = multidrop("help", *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(begins)
    assert not ends or done.stdout.splitlines()[-1] == ends


@pytest.mark.parametrize("arguments", [["VMM"], ["999"], ["VM", "--dialect", "pmx"], ["86", "--dialect", "pmx"]])
def test_a_word_that_no_language_has_is_one_line_and_exit_2(multidrop, arguments):
    done = multidrop("help", *arguments)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
