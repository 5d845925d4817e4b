"""Delete features and families in a copy of the tree, one at a time and together: all else works. Run: `make seams`.

In each copy every module is imported, and the front ends run on a simulated cell: `send`, the prompt, a script, a
Python program, the screen. Where all features are gone, the quick tests of the core run, too. The quick tests of each
feature run in one more copy, which has no other feature. `--cheap` leaves these tests out. The family of the language
of drives of which nothing is said stays.
"""

from __future__ import annotations

import argparse
import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from multidrop.base.registry import DEFAULT, FAMILIES, IN_WHEEL
from tests.support.paths import ROOMS

ROOT = Path(__file__).parents[1]
PATIENCE = 1800.0
"""s; far longer than any step of a copy takes."""
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", ".coverage*", ".hypothesis", ".fuzz", ".site", ".*_cache", "dist")
"""What no copy needs. The bytecode is kept: without it each process would compile every module."""
OF_THE_WHOLE = [f"--ignore=tests/{each}" for each in ("docs", "packaging", "soak")]
"""Tests that are of the whole: pages, what is shipped, and the simulated life."""
QUICK = "not process and not tui and not wide and not slow"
PYTEST = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--no-header", "--tb=short", "--hypothesis-profile=quick",
          "--dist", "worksteal", "-m", QUICK)  # fmt: skip
OPTIONAL = [name for name, words in FAMILIES.items() if f"dialect={DEFAULT}" not in words]
TOGETHER = {"families": OPTIONAL, "all": [*IN_WHEEL]}
NAMES = (*IN_WHEEL, *OPTIONAL, *TOGETHER)
WHOLE = "whole"
"""The copy that all others are made of, by hard links: nothing writes into a copy."""
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
    parser.add_argument("names", nargs="*", choices=(*NAMES, []), help="default: each of them")
    parser.add_argument("--cheap", action="store_true", help="run no tests")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args(arguments)
    names = chosen.names or NAMES
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="seams-") as made:
        folder, tests = Path(made), not chosen.cheap
        shutil.copytree(ROOT, folder / WHOLE, symlinks=True, ignore=LEFT_OUT)
        for room in ROOMS:
            compileall.compile_dir(folder / WHOLE / room, quiet=1, workers=0)
        tried = [partial(_without, name, folder, tests) for name in reversed(names)]
        tried += [partial(_alone, name, folder) for name in names if name in IN_WHEEL and tests]
        with ThreadPoolExecutor(chosen.jobs) as pool:
            wrong = sum(not fine for fine in pool.map(lambda work: work(), tried))
    print(f"{len(tried) - wrong} of {len(tried)} copies work, {time.monotonic() - began:.0f} s")
    return int(bool(wrong))


@contextmanager
def _copy(folder: Path, name: str, gone: Iterable[str]) -> Iterator[Path]:
    """A copy of the tree without features or families, and without the tests that need one of them."""
    tree = folder / name.replace(" ", "-")
    shutil.copytree(folder / WHOLE, tree, symlinks=True, copy_function=os.link)
    for each in gone:
        for found in (tree / "features" / each, *(tree / "tests/features").glob(f"*/with_{each}")):
            shutil.rmtree(found, ignore_errors=True)
        for room in ("families", "tests/features", "tests/families"):
            shutil.rmtree(tree / room / each, ignore_errors=True)
    yield tree
    shutil.rmtree(tree, ignore_errors=True)


def _told(name: str, wrong: Sequence[str]) -> bool:
    print(f"{name}: {'works' if not wrong else 'DOES NOT WORK'}", *wrong, sep="\n    ", flush=True)
    return not wrong


def _without(name: str, folder: Path, tests: bool) -> bool:
    """Delete a feature or a family, or several, in a copy; say what does not work there."""
    gone = TOGETHER.get(name, [name])
    with _copy(folder, f"without {name}", gone) as tree:
        wrong = [f"{what}: {said}" for what, command, typed in _steps(tree) if (said := _run(command, tree, typed))]
        if tests and name == "all" and (said := _run([*PYTEST, "-n", str(os.cpu_count() or 1), *OF_THE_WHOLE], tree)):
            wrong.append(f"the quick tests of the core: {said}")
    return _told(f"without {name}", wrong)


def _alone(name: str, folder: Path) -> bool:
    """Delete all other features in a copy; say which of the feature's quick tests fail there."""
    with _copy(folder, f"{name} alone", [each for each in IN_WHEEL if each != name]) as tree:
        said = _run([*PYTEST, f"tests/features/{name}"], tree)
    return _told(f"{name} alone", [f"its quick tests: {said}"] if said else [])


def _steps(tree: Path) -> list[tuple[str, Sequence[str], str]]:
    """What is done in every copy: what it is, the arguments of Python, what is typed."""
    place = _beside(tree)
    (place / "program.py").write_text(PROGRAM)
    (place / "script.txt").write_text("@a MR 400\n/wait stopped\n@a PR P\n")
    return [
        ("every module", ("-c", IMPORTS), ""),
        ("send", ("-m", "multidrop", "send", "sim:#press", "@a MR 400", "/wait stopped", "@a PR P"), ""),
        ("the prompt", ("-m", "multidrop", "shell", "sim:#press"), "@a PR P\n/help\n/quit\n"),
        ("a script", ("-m", "multidrop", "run", "script.txt", "--on", "sim:#press"), ""),
        ("a program", ("-m", "multidrop", "run", "program.py", "--on", "sim:#press"), ""),
        ("help", ("-m", "multidrop", "--help"), ""),
        ("the features", ("-m", "multidrop", "features"), ""),
        ("the screen", ("-c", SCREEN), ""),
    ]


def _beside(tree: Path) -> Path:
    """The folder where a copy's front ends work, beside it: a test of the core looks at the files in its root."""
    place = tree.with_name(f"{tree.name}.work")
    place.mkdir(exist_ok=True)
    return place


def _run(command: Sequence[str], tree: Path, typed: str = "") -> str:
    """Run Python on a copy; return the end of what it said if it failed."""
    place = _beside(tree)
    homes = {f"MULTIDROP_{each}_DIR": str(place / each.lower()) for each in ("CONFIG", "STATE", "DATA")}
    done = subprocess.run(
        [sys.executable, *command], cwd=tree if "pytest" in command else place, input=typed, capture_output=True,
        env={**os.environ, "PYTHONPATH": str(tree), **homes}, text=True, timeout=PATIENCE, errors="replace",
    )  # fmt: skip
    return "" if done.returncode == 0 else (done.stdout + done.stderr).strip()[-3000:].replace("\n", "\n        ")


if __name__ == "__main__":
    sys.exit(main())
