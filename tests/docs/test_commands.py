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
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

from multidrop.__main__ import main
from tests.support.paths import ROOT
from tests.support.processes import environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

BLOCK = re.compile(r"^```console\n(.*?)^```", re.S | re.M)
FILE = re.compile(r"^```\w*\n((?:[#';]|//) ([\w-]+\.\w+)\n.*?)^```", re.S | re.M)


PLAIN = re.compile(r"multidrop (send|program) (?:[^|&;<>$`\"']|'[^']*')*$")
"""A command that needs nothing of a shell: it runs in the process of the test."""


def everything(folder: Path, env: dict[str, str], *arguments: str) -> str:
    """What a command prints, errors among the rest."""
    printed = io.StringIO()
    with (
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, env),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(printed),
    ):
        main(arguments)
    return printed.getvalue()


def commands(text: str) -> list[tuple[str, str]]:
    """(command, expected output) of every `$` line in the console blocks."""
    found: list[tuple[str, str]] = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, expected = part.partition("\n")
            found.append((command, expected))
    return found


PAGES = {
    str(path.relative_to(ROOT)): text
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if commands(text := path.read_text(encoding="utf-8"))
}


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_a_page_print_what_it_says(page: str, tmp_path: Path) -> None:
    for content, file in FILE.findall(PAGES[page]):
        (tmp_path / file).write_text(content, encoding="utf-8")
    env = environment(tmp_path) | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "MULTIDROP_CONFIG_DIR": str(tmp_path),
        "MULTIDROP_STATE_DIR": str(tmp_path),
    }
    for command, expected in commands(PAGES[page]):
        if page != "README.md" and PLAIN.match(command):
            printed = everything(tmp_path, env, *shlex.split(command)[1:])
        else:
            shell = ["bash", "-c", f"exec 2>&1; {command}"]
            printed = subprocess.run(
                shell, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=PATIENCE
            ).stdout
        assert doctest.OutputChecker().check_output(expected, printed, doctest.ELLIPSIS), (
            f"{page}: {command}\nexpected:\n{expected}got:\n{printed}"
        )
