"""The completions and the man page are up to date, and work in the shells that this machine has."""

import importlib.util
import os
import re
import subprocess
import sys

import pytest

from multidrop.shell.operations.table import COMMANDS
from tests.support.paths import ROOT
from tests.support.until import PATIENCE

SHIPPED = ROOT / "multidrop" / "shipped"


@pytest.fixture(scope="module")
def generate():
    spec = importlib.util.spec_from_file_location("generate", ROOT / "packaging" / "generate.py")
    module = importlib.util.module_from_spec(spec)
    path = list(sys.path)
    spec.loader.exec_module(module)
    sys.path[:] = path
    return module


def test_the_files_are_what_the_parser_gives(generate):
    made = generate.files()
    assert {each.name for each in SHIPPED.iterdir()} == set(made)
    stale = [name for name, text in made.items() if (SHIPPED / name).read_text() != text]
    assert not stale, "run make shipped"


def test_the_man_page_has_every_command():
    page = (SHIPPED / "multidrop.1").read_text()
    assert [name for name in COMMANDS.parts("") if f"multidrop {name}" not in page] == []
    assert ".SH EXIT STATUS" in page and r"\-\-serve" in page


@pytest.fixture
def home(tmp_path):
    (tmp_path / ".config" / "multidrop").mkdir(parents=True)
    (tmp_path / ".config" / "multidrop" / "multidrop.toml").write_text(
        '[connections.gantry]\nurl = "sim:#press?drives=a,b"\n[connections.-g]\nurl = "sim:#press?drives=-c,=d,a"\n'
    )
    (tmp_path / ".config" / "multidrop" / "macros").mkdir()
    (tmp_path / ".config" / "multidrop" / "macros" / "shuttle.toml").touch()
    (tmp_path / ".config" / "multidrop" / "macros" / "-s.toml").touch()
    (tmp_path / "cell.toml").touch()
    return tmp_path


BASH = """
source "$1"
COMP_LINE="$2"; COMP_POINT=${#COMP_LINE}
_multidrop
printf '%s\\n' "${COMPREPLY[@]}"
"""
FISH = "source $argv[1]; complete -C $argv[2] | string split -f1 \\t"
CASES = {
    "multidrop pro": ["program"],
    "multidrop program dow": ["download"],
    "multidrop send gan": ["gantry"],
    "multidrop send sim:#p": ["sim:#press", "sim:#pmx"],
    "multidrop send tc": ["tcp://"],
    "multidrop run go.txt --on modb": ["modbus://"],
    "multidrop plot sim: --ser": ["--serve"],
    "multidrop completion f": ["fish"],
    "multidrop macro play shu": ["shuttle"],
    "multidrop params backup gantry --drive a": ["all", "a"],
    "multidrop params backup gantry --drive ": ["all", "a", "b"],
    "multidrop macro play ": ["shuttle"],
}


def completed(home, *command):
    env = {"HOME": str(home), "PATH": os.environ["PATH"]}
    done = subprocess.run(command, cwd=home, env=env, capture_output=True, text=True, timeout=PATIENCE)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.process
def test_bash_completes(home):
    wordbreak = {line: [each.removeprefix("sim:") for each in found] for line, found in CASES.items()}
    file = str(SHIPPED / "multidrop.bash")
    assert {line: completed(home, "bash", "-c", BASH, "bash", file, line) for line in CASES} == wordbreak
    assert completed(home, "bash", "-c", BASH, "bash", file, "multidrop send sim:c") == ["cell.toml"]


@pytest.mark.process
@pytest.mark.needs("fish")
def test_fish_completes(home):
    command = ("fish", "--no-config", "-c", FISH, str(SHIPPED / "multidrop.fish"))
    found = {line: completed(home, *command, line) for line in CASES}
    assert {line: sorted(each) for line, each in found.items()} == {line: sorted(each) for line, each in CASES.items()}


@pytest.mark.process
@pytest.mark.needs("zsh")
def test_zsh_takes_the_file(home):
    load = "fpath=($1 $fpath); autoload -Uz compinit; compinit -u; print $_comps[multidrop]"
    assert completed(home, "zsh", "-f", "-c", load, "zsh", str(SHIPPED)) == ["_multidrop"]


def test_powershell_has_every_command_and_what_is_listed():
    """No PowerShell runs here: the text is compared with the tree of commands."""
    text = (SHIPPED / "multidrop.ps1").read_text()
    assert [name for name in COMMANDS.parts("") if f"'{name}'" not in text] == []
    assert re.search(r"'_shtab_multidrop_send_pos_0' = '_multidrop_url'", text)
    assert re.search(r"'_shtab_multidrop_macro_play_pos_0' = '_multidrop_macro'", text)
    assert re.search(r"'_shtab_multidrop_params_backup___drive' = '_multidrop_drive'", text)
    assert len(re.findall(r"^function _multidrop_(url|drive|macro|folder) \{", text, re.M)) == 4
    assert text.count("{") == text.count("}")


@pytest.mark.process
def test_the_command_prints_the_file_of_a_shell(home):
    done = completed(home, sys.executable, "-m", "multidrop", "completion", "zsh")
    assert " ".join(done) == " ".join((SHIPPED / "_multidrop").read_text().split())
