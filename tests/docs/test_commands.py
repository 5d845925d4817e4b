"""Every `$` line of the console blocks in README and docs prints what the page says; `...` stands for anything.

A block that begins with a remark of just a file's name (`# line.toml`, `' turn.mxt`) is put into that file first.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

from multidrop.__main__ import main
from tests.support.front_door import virtual_runner
from tests.support.pages import EXAMPLES, PAGES, blocks
from tests.support.paths import ROOT
from tests.support.processes import environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

WORDS = r"(?:[^|&;<>$`\"'*?~{}]|'[^']*'|\"[^\"$`]*\")*?"
PLAIN = re.compile(
    rf"""multidrop (?!sim |relay |tui|shell|demo){WORDS}(?: 2>&1)?(?P<code>; echo "exit code \$\?")?\Z"""
)
"""A command that needs nothing of a shell: it runs in the process of the test, on a clock that does not wait."""


def everything(folder: Path, env: dict[str, str], command: str) -> str:
    """What a command prints, errors among the rest."""
    printed = io.StringIO()
    echo = PLAIN.match(command)["code"]
    words = shlex.split(command.removesuffix(echo or "").removesuffix(" 2>&1"))
    with (
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, env),
        virtual_runner(),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(printed),
    ):
        code = main(words[1:])
    return printed.getvalue() + (f"exit code {code}\n" if echo else "")


def commands(page: str) -> list[tuple[str, str]]:
    """(command, expected output) of every `$` line in the console blocks."""
    found: list[tuple[str, str]] = []
    for block in blocks(page, "console"):
        for part in re.split(r"^\$ ", block.text, flags=re.M)[1:] if not block.mark else ():
            command, _, expected = part.partition("\n")
            found.append((command, expected))
    return found


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)])
def test_the_commands_of_a_page_print_what_it_says(page: str, tmp_path: Path) -> None:
    if (ROOT / page).is_relative_to(EXAMPLES):
        shutil.copytree((ROOT / page).parent, tmp_path, dirs_exist_ok=True)
    for block in blocks(page):
        if block.file:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    env = environment(tmp_path) | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "MULTIDROP_CONFIG_DIR": str(tmp_path),
        "MULTIDROP_STATE_DIR": str(tmp_path),
    }
    for command, expected in commands(page):
        if page != "README.md" and PLAIN.match(command):
            printed = everything(tmp_path, env, command)
        else:
            shell = ["bash", "-c", f"exec 2>&1; {command}"]
            printed = subprocess.run(
                shell, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=PATIENCE
            ).stdout
        assert doctest.OutputChecker().check_output(expected, printed, doctest.ELLIPSIS), (
            f"{page}: {command}\nexpected:\n{expected}got:\n{printed}"
        )
