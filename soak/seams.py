"""Delete features in a copy of the tree, one at a time and all at once: everything else works. Run: `make seams`.

In each copy every module is imported, and the front ends run on a simulated cell: `send`, the prompt, a script, a
Python program, the screen. With `--tests` and all of them gone, the quick tests of the core run, too.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from multidrop.base.registry import IN_WHEEL
from soak.drawn.trial import LEFT_OUT

ROOT = Path(__file__).parents[1]
PATIENCE = 120.0
"""s; a step of a copy takes seconds."""
LEFT = [f"--ignore=tests/{each}" for each in ("docs", "packaging", "soak")]
"""Tests that are of the whole: pages, what is shipped, and the simulated life."""
QUICK = "not process and not tui and not wide and not slow"
IMPORTS = """
import importlib, pkgutil, sys
import multidrop
wrong = []
for each in pkgutil.walk_packages(multidrop.__path__, "multidrop."):
    if each.name in ("multidrop.__main__",):
        continue
    try:
        importlib.import_module(each.name)
    except ImportError as error:
        wrong.append(f"{each.name}: {error}")
print("\\n".join(wrong))
sys.exit(bool(wrong))
"""
PROGRAM = """
import multidrop
with multidrop.connect("sim:#press") as session:
    session.drive("a").move(400)
    session.drive("a").wait()
    print(session.drive("a").position)
"""
SCREEN = """
import asyncio
from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist

async def main():
    session = Session(Settings())
    app = MultidropApp(session, ["sim:#press"], Assist(session, session.settings))
    async with app.run_test(size=(120, 40)) as pilot:
        for _ in range(100):
            await pilot.pause(0.05)
            if session.buses:
                break
        assert session.buses, "nothing was opened"
        for page in ("drives", "program", "plot", "params", "macros", "traffic", "controls"):
            app.screen.refresh()
            await pilot.pause(0.02)
    await session.close()

asyncio.run(main())
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Try all copies, or those that are named; return the number of those that do not work."""
    parser = argparse.ArgumentParser(prog="make seams", description=__doc__)
    parser.add_argument("names", nargs="*", help="features, or `all` (default: each, and all)")
    parser.add_argument(
        "--tests", action="store_true", help="without all features, run the quick tests of the core, too"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args(arguments)
    names = chosen.names or [*IN_WHEEL, "all"]
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="seams-") as folder, ThreadPoolExecutor(chosen.jobs) as pool:
        wrong = sum(
            not fine for fine in pool.map(lambda name: _tried(name, Path(folder), chosen.tests), reversed(names))
        )
    print(f"{len(names) - wrong} of {len(names)} copies work, {time.monotonic() - began:.0f} s")
    return int(bool(wrong))


def _tried(name: str, folder: Path, tests: bool) -> bool:
    """Delete a feature, or all, in a copy; say what does not work there."""
    tree = folder / name
    shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
    gone = [*IN_WHEEL] if name == "all" else [name]
    for each in gone:
        for room in ("features", "tests/features"):
            shutil.rmtree(tree / room / each, ignore_errors=True)
            (tree / room / f"{each}.py").unlink(missing_ok=True)
    (tree / "program.py").write_text(PROGRAM)
    (tree / "script.txt").write_text("@a MR 400\n/wait stopped\n@a PR P\n")
    steps: list[tuple[str, Sequence[str], str]] = [
        ("every module", ("-c", IMPORTS), ""),
        ("send", ("-m", "multidrop", "send", "sim:#press", "@a MR 400", "/wait stopped", "@a PR P"), ""),
        ("the prompt", ("-m", "multidrop", "shell", "sim:#press"), "@a PR P\n/help\n/quit\n"),
        ("a script", ("-m", "multidrop", "run", "script.txt", "--on", "sim:#press"), ""),
        ("a program", ("-m", "multidrop", "run", "program.py", "--on", "sim:#press"), ""),
        ("help", ("-m", "multidrop", "--help"), ""),
        ("the features", ("-m", "multidrop", "features"), ""),
        ("the screen", ("-c", SCREEN), ""),
    ]
    if name == "all" and tests:
        options = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--tb=short", "-W", "default")
        steps.append(("the quick tests of the core", ("-m", "pytest", *options, "-m", QUICK, *LEFT), ""))
    wrong = [f"{what}: {said}" for what, command, typed in steps if (said := _run(command, tree, typed))]
    print(f"without {name}: {'works' if not wrong else 'DOES NOT WORK'}", *wrong, sep="\n    ", flush=True)
    shutil.rmtree(tree, ignore_errors=True)
    return not wrong


def _run(command: Sequence[str], tree: Path, typed: str) -> str:
    """Run Python in a copy; return the end of what it said if it failed."""
    home = tree / "home"
    places = {f"MULTIDROP_{each}_DIR": str(home / each.lower()) for each in ("CONFIG", "STATE", "DATA")}
    environment = {**os.environ, "PYTHONPATH": str(tree), **places}
    done = subprocess.run(
        [sys.executable, *command], cwd=tree, env=environment, input=typed, capture_output=True, text=True,
        timeout=PATIENCE * 5, errors="replace",
    )  # fmt: skip
    return "" if done.returncode == 0 else (done.stdout + done.stderr).strip()[-3000:].replace("\n", "\n        ")


if __name__ == "__main__":
    sys.exit(main())
