"""The command line from outside: usage, help, exit codes that need no drive."""

import importlib
import subprocess
import sys

import pytest

from multidrop import cli
from multidrop.shell.operations import table
from multidrop.simulator.families import PROGRAMS, TABLE
from tests.support.paths import ROOT
from tests.support.processes import environment
from tests.support.until import PATIENCE

COMMANDS = ["demo", "tui", "shell", "send", "run", "sim", "program", "macro", "plot", "ports", "report", "completion"]
RUN = [each.run for each in table.COMMANDS.values() if each.run]


@pytest.fixture
def process(tmp_path):
    """Run a command as a process, in a folder of its own."""

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "multidrop", *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            cwd=tmp_path,
            env=environment(tmp_path),
        )

    return run


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "code", "out", "err"),
    [(["--version"], 0, 1, 0), (["frob"], 2, 0, 1), (["send", "/dev/does-not-exist", "PR P"], 3, 0, 1)],
)
def test_a_process_has_the_exit_code_and_its_lines_on_either_output(process, arguments, code, out, err):
    done = process(*arguments)
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
        (["plot", "sim:"], "--to"),
        (["plot", "sim:", "--to", "a.rrd", "--serve", "1"], "--serve"),
        (["plot", "sim:", "--to", "a.txt"], "a.txt"),
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
    file, _, function = run.partition(".")
    assert callable(getattr(importlib.import_module(f"multidrop.commands.{file}"), function))


def test_the_help_names_each_personality_that_runs_programs(multidrop):
    told = multidrop("program", "test", "--help").stdout
    for name, row in TABLE.items():
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


def test_a_broken_configuration_is_one_line_that_names_it(multidrop, tmp_path):
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "multidrop.toml").write_text("[connections.press]\nur = 1\n")
    done = multidrop("send", "press", "PR P")
    assert done.returncode == 2 and "multidrop.toml:2: no key connections.press.ur" in done.stderr


def test_macros_are_listed_and_shown_as_their_files_have_them(multidrop, tmp_path):
    folder = tmp_path / "conf" / "macros"
    folder.mkdir(parents=True)
    (folder / "go.toml").write_text('name = "go"\nkey = "F3"\n[[step]]\nafter = 0.0\nline = "@a MR {STEPS}"\n')
    (folder / "bad.toml").write_text("name =\n")
    listed = multidrop("macro", "list")
    assert listed.returncode == 2 and "bad.toml" in listed.stderr
    assert listed.stdout.split() == ["go", "F3", "1", "line", "values:", "STEPS"]
    assert 'line = "@a MR {STEPS}"' in multidrop("macro", "show", "go").stdout
    played = multidrop("macro", "play", "go", "--on", "/dev/does-not-exist")
    assert played.returncode == 2 and "STEPS" in played.stderr
