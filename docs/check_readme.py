"""Runs the `console` blocks of README and docs and compares what they print; `...` there stands for anything.

A block that begins with a remark of just a file's name (`# line.toml`, `' turn.mxt`) is put into that file first.
"""

from __future__ import annotations

import doctest
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```console\n(.*?)^```", re.S | re.M)
FILE = re.compile(r"^```\w*\n([#';] ([\w-]+\.\w+)\n.*?)^```", re.S | re.M)


def commands(text: str) -> list[tuple[str, str]]:
    """(command, expected output) of every `$` line in the console blocks."""
    found: list[tuple[str, str]] = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, expected = part.partition("\n")
            found.append((command, expected))
    return found


def main() -> int:
    """Exit code 1 where a command prints something else than the README says."""
    wrong = 0
    checker = doctest.OutputChecker()
    with tempfile.TemporaryDirectory() as folder:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        env = os.environ | {"PATH": path, "MULTIDROP_CONFIG_DIR": folder, "MULTIDROP_STATE_DIR": folder}
        for name in ("README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))):
            text = (ROOT / name).read_text(encoding="utf-8")
            for content, file in FILE.findall(text):
                Path(folder, file).write_text(content, encoding="utf-8")
            for command, expected in commands(text):
                shell = ["bash", "-c", f"exec 2>&1; {command}"]
                done = subprocess.run(shell, cwd=folder, env=env, capture_output=True, text=True, timeout=60)
                if checker.check_output(expected, done.stdout, doctest.ELLIPSIS):
                    print(f"ok    {name}: {command}")
                else:
                    wrong += 1
                    print(f"WRONG {name}: {command}\nexpected:\n{expected}got:\n{done.stdout}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
