"""Plugin of the test run: `--since REF` runs what the changes since a commit can break, and says what it leaves out.

A file of tests runs if it, or a module that it imports, has changed. The core imports no feature and no family, so a
change in one of them runs its own tests, and those of others that import it; `SEAMS` run for each. A change in the core
runs all that starts the command line. A module that nobody imports is found by its name, so it counts as its whole
room. Other files than Python's count as the modules of their folder. A change of what all tests rest on runs all.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import Counter
from collections.abc import Collection, Iterable
from pathlib import Path, PurePosixPath

import grimp
import pytest

from tests.support.paths import ROOMS, ROOT

EVERYTHING = ("pyproject.toml", "Makefile", "requirements-dev.txt", "constraints.txt", "tests/conftest.py")
"""Files that all tests rest on."""
SEAMS = ("tests/house", "tests/docs", "tests/packaging")
"""Tests of the whole tree: texts, contracts, what is shipped."""
OF_PARTS = {"features": "tests/features", "families": "tests/families"}
"""By room: the folder of its tests, in which the files that are no part's are tests of all parts."""
DOOR = "tests.support.processes"
"""What starts the command line; its imports show nothing of that."""
PARTS = ("multidrop.features.", "multidrop.families.")
PACKAGES = ("multidrop", "tests", "soak")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--since`."""
    parser.addoption("--since", metavar="REF", help="run what the changes since a commit can break")


def pytest_configure(config: pytest.Config) -> None:
    """Find the changes once: the processes of a run get the list."""
    reference = config.getoption("since")
    if reference and not hasattr(config, "workerinput"):
        os.environ["MULTIDROP_CHANGED"] = "\n".join(changed(reference, ROOT))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the files that no change reaches."""
    if not config.getoption("since"):
        return
    files = {_name(item.path) for item in items}
    chosen = choice(os.environ["MULTIDROP_CHANGED"].splitlines(), files)
    left = [item for item in items if _name(item.path) not in chosen]
    items[:] = [item for item in items if _name(item.path) in chosen]
    config.hook.pytest_deselected(items=left)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out."""
    if reference := config.getoption("since"):
        files = {_name(path) for path in (ROOT / "tests").rglob("test_*.py")}
        names = os.environ["MULTIDROP_CHANGED"].splitlines()
        for line in words(reference, names, files, choice(names, files)):
            terminalreporter.write_line(line)


def changed(reference: str, root: Path) -> list[str]:
    """The files that differ from a commit, new ones included. Raises UsageError for an unknown commit."""
    git = shutil.which("git")
    if git is None:
        raise pytest.UsageError("--since needs git")
    found: list[str] = []
    for asked in (["diff", "--name-only", reference, "--"], ["ls-files", "--others", "--exclude-standard"]):
        done = subprocess.run([git, "-C", str(root), *asked], capture_output=True, encoding="utf-8")
        if done.returncode:
            raise pytest.UsageError(f"--since {reference}: {done.stderr.strip().splitlines()[0]}")
        found += done.stdout.splitlines()
    return sorted(set(found))


def words(reference: str, names: Collection[str], files: Collection[str], chosen: Collection[str]) -> list[str]:
    """What was left out, and why."""
    count = "1 file has" if len(names) == 1 else f"{len(names)} files have"
    lines = [f"{count} changed since {reference}: {len(chosen)} of {len(files)} files of tests run"]
    left = Counter("/".join(name.split("/")[:-1]) for name in files if name not in chosen)
    lines += [
        f"left out, as no change reaches what they import: {number} in {at}" for at, number in sorted(left.items())
    ]
    return lines


def choice(names: Iterable[str], files: Collection[str]) -> set[str]:
    """The files of tests that changes of some files can break."""
    names = list(names)
    if any(name in EVERYTHING for name in names):
        return set(files)
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    changes = {module for name in names for module in _modules(name, graph)}
    core = {module for module in changes if module.startswith("multidrop.") and not module.startswith(PARTS)}
    for module in core & graph.modules:
        if not any(each.startswith("multidrop.") for each in graph.find_modules_that_directly_import(module)):
            changes |= graph.find_descendants(".".join(module.split(".")[:2]))
    changes |= {DOOR} if core else set()
    reached = set(changes)
    for module in changes & graph.modules:
        reached |= graph.find_downstream_modules(module)
    chosen = {name for name in files if _module(name) in reached or name.startswith(SEAMS)}
    return chosen | {name for name in files if any(_part(change, name) for change in names)}


def _part(change: str, test: str) -> bool:
    """Whether a file of tests is that of a changed feature or family, or one for all of them."""
    room, *inner = change.split("/")
    folder = OF_PARTS.get(room)
    if folder is None or not test.startswith(f"{folder}/"):
        return False
    return test.startswith(f"{folder}/{inner[0]}/") or PurePosixPath(test).parent == PurePosixPath(folder)


def _modules(name: str, graph: grimp.ImportGraph) -> set[str]:
    """The modules that a changed file is: its own, or, if it is none of Python's, those of its folder."""
    if name.endswith(".py"):
        return {_module(name)}
    folder = _module(f"{PurePosixPath(name).parent}/x.py").rpartition(".")[0]
    return {module for module in graph.modules if module.rpartition(".")[0] == folder}


def _module(name: str) -> str:
    path = PurePosixPath(name).with_suffix("")
    parts = path.parts[:-1] if path.name == "__init__" else path.parts
    return ".".join(("multidrop", *parts) if parts and parts[0] in ROOMS and parts[0] != "multidrop" else parts)


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()
