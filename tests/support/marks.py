"""Plugin of the test run: which tests run, and that the markers are true.

`process` marks a test that starts a process, `tui` one that runs the app: a test that does so without its marker fails.
`virtual` marks a test, or a file of tests, that runs on a loop whose clock does not wait. `tui` does so as well, unless
there is a process or a pseudo-terminal, or the marker `real`: a thread or a socket keeps the real time.
`needs` names programs of others, such as `mbpoll`: without them a test is skipped, or fails (`tests.support.tools`).
`wide` marks a product of parameters. An ordinary run takes its corners and its diagonal; `--nightly` takes all of it,
the tests with the marker `nightly`, and those that `nightly.txt` lists.
`pty`, `fork`, `AF_UNIX` and `tmux` mark what Windows has not (`tests.support.posix`): there such tests are left out.
A run fails where the tree has a new or changed file at its end: a test has left it there.
"""

from __future__ import annotations

import asyncio
import gc
import importlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import ROOT
from tests.support.posix import LEFT_OUT, left_out, only_posix
from tests.support.tools import tool
from tests.support.virtual import VirtualLoop

STARTS = frozenset({"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system"})
"""Audit events of the interpreter, each of which is the start of a process."""

NIGHTLY = frozenset(Path(__file__).with_name("nightly.txt").read_text(encoding="utf-8").splitlines())
"""Cases that take long and differ from others of their test, which every run takes, in a value only."""

SLOW = frozenset(Path(__file__).with_name("slow.txt").read_text(encoding="utf-8").splitlines())
"""Test functions that were measured to take long, and are marked slow without a word in their file."""

MOMENT = 0.02
"""How long a test of the screen waits behind a key for timers that are due, s: longer than a frame of Textual's."""

_running: list[pytest.Item] = []
"""The test that runs, its fixtures included."""

TREE = pytest.StashKey[set[str] | None]()
"""New and changed files when the run began, in the words of git; None: they are not compared."""

LEFT = pytest.StashKey[list[str]]()
"""Those that came during the run."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--nightly`."""
    parser.addoption("--nightly", action="store_true", help="run the whole of every product of parameters")


def pytest_configure(config: pytest.Config) -> None:
    """Watch for processes until the run ends: an audit hook cannot be removed. Note the files of the tree."""
    controls = not hasattr(config, "workerinput") and not config.getoption("update_snapshots", default=False)
    config.stash[TREE] = tree(ROOT) if controls else None
    sys.addaudithook(_watch)
    if sys.platform == "win32":
        os.kill = _no_signal  # type: ignore[assignment]
        subprocess.Popen.send_signal = _no_signal  # type: ignore[assignment,method-assign]


def _no_signal(to: object, number: int) -> None:
    """Leave out a test that would send a signal, which Windows takes for an order to end a process at once."""
    left_out("fork")


def tree(folder: Path) -> set[str] | None:
    """The new and changed files below a folder, as `git status` names them; None without git."""
    git = shutil.which("git")
    if git is None:
        return None
    asked = [git, "-C", str(folder), "status", "--porcelain", "-uall", "--", "."]
    done = subprocess.run(asked, capture_output=True, encoding="utf-8", errors="replace")
    return None if done.returncode else set(done.stdout.splitlines())


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run that left files in the tree."""
    before, after = session.config.stash[TREE], tree(ROOT)
    left = [] if before is None or after is None else sorted(after - before)
    session.config.stash[LEFT] = left
    if left and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Name what was left."""
    for each in config.stash.get(LEFT, []):
        terminalreporter.write_line(f"new or changed in the tree since the run began: {each}", red=True)


def _watch(event: str, _: Any) -> None:
    if _running and event in STARTS:  # at the interpreter's end both are None
        _demand("process", "starts a process")


def _demand(marker: str, act: str) -> None:
    item = _running[-1]
    if item.get_closest_marker(marker) is None:
        raise AssertionError(f"{item.nodeid} {act}: mark it with pytest.mark.{marker}")


def pytest_asyncio_loop_factories(item: pytest.Item) -> dict[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Choose the clock of an async test, and of its async fixtures."""
    return {"virtual": VirtualLoop} if is_virtual(item) else {"real": asyncio.new_event_loop}


def is_virtual(item: pytest.Item) -> bool:
    """Whether a test runs in virtual time: one of the app does, unless something outside keeps the real time."""
    names = {mark.name for mark in item.iter_markers()}
    return "virtual" in names or ("tui" in names and not names & {"real", "pty", "process"})


def left_out_whole(file: Path) -> str | None:
    """Return the marker by which every test of a file needs POSIX, read without an import of the file."""
    marks = re.search(r"^pytestmark = (?:\[[^\]]*\]|.*)", file.read_text(encoding="utf-8"), re.MULTILINE)
    return next((name for name in LEFT_OUT if marks and f"pytest.mark.{name}" in marks[0]), None)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Pass over a file that only POSIX can import."""
    windows = sys.platform == "win32" and collection_path.name.startswith("test_")
    return True if windows and left_out_whole(collection_path) else None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[pytest.TestReport]:
    """Under Windows, take a test for left out that asks Python for what only POSIX has."""
    report = yield
    marker = sys.platform == "win32" and call.excinfo and only_posix(call.excinfo)
    if marker:
        report.outcome = "skipped"
        report.longrepr = (str(item.path), item.location[1] or 0, f"{marker}: {LEFT_OUT[marker]}")
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Leave out what the platform has not; look for the programs of others that a test needs."""
    if sys.platform == "win32":
        for name in LEFT_OUT:
            if item.get_closest_marker(name):
                left_out(name)
        if (mark := item.get_closest_marker("wine")) and "MULTIDROP_WINE" in os.environ:
            pytest.skip(f"wine: {mark.args[0]}")
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            tool(name)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Keep the test that runs."""
    _running.append(item)
    try:
        return (yield)
    finally:
        _running.pop()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[Any]:
    """Keep the garbage collector from the modules and tests, which a run has until its end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 20, 20)  # what a test makes is small, and its end frees it
        gc.enable()


def pytest_collection_finish() -> None:
    """Watch for Textual apps, and parse their style sheets once; do so once, not for each test."""
    if "textual.app" in sys.modules:
        _watch_apps(sys.modules["textual.app"].App)
        _keep_parsed(sys.modules["textual.css.stylesheet"].Stylesheet)
        for name in ("textual.app", "textual.pilot"):
            vars(importlib.import_module(name))["wait_for_idle"] = until_idle
        vars(importlib.import_module("textual._time"))["get_time"] = clock


def _watch_apps(app: Any) -> None:
    """Refuse to run a Textual app in a test without the marker `tui`."""
    for name in ("run_async", "run_test"):
        setattr(app, name, _demanding(getattr(app, name)))


def _demanding(run: Callable[..., Any]) -> Callable[..., Any]:
    def watched(*arguments: Any, **named: Any) -> Any:
        _demand("tui", "runs the app")
        return run(*arguments, **named)

    return watched


def _keep_parsed(sheet: Any) -> None:
    """Keep parsed rules for all apps of a test process, which parse the same at every start."""
    parse, kept = sheet._parse_rules, {}

    def parsed(self: Any, *arguments: Any, **named: Any) -> Any:
        key = (arguments, tuple(named.items()), tuple(self._variables.items()))
        if key not in kept:
            kept[key] = parse(self, *arguments, **named)
        return kept[key]

    sheet._parse_rules = parsed


async def until_idle(min_sleep: float = 0.0, max_sleep: float = 1.0) -> None:
    """Wait until the loop has nothing to do but wait, before and after a moment for its timers.

    Textual's own asks for the processor time, and waits for a second where a screen that polls is never idle.
    """
    loop: Any = asyncio.get_running_loop()
    for moment in (0.0, MOMENT):
        await asyncio.sleep(moment)
        while loop._ready:
            await asyncio.sleep(0)


def clock() -> float:
    """Return the time of the running loop, so that Textual's timers go by a virtual clock, too."""
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:
        return time.monotonic()


@pytest.fixture
def nightly(pytestconfig: pytest.Config) -> bool:
    """Whether all of everything is to be run."""
    return bool(pytestconfig.getoption("nightly"))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what was measured to be slow, leave out what only the nightly run takes, and spread what waits."""
    for item in items:
        if re.split(r"[\[|]", item.nodeid, maxsplit=1)[0] in SLOW:
            item.add_marker("slow")
    _leave_out(config, items)
    items[:] = _spread(items)


def _spread(items: list[pytest.Item]) -> list[pytest.Item]:
    """Spread the files that start processes among the others: they wait, and should do so beside tests that compute."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    waiting = [each for each in files.values() if any(item.get_closest_marker("process") for item in each)]
    places = {id(each): number / len(waiting) for number, each in enumerate(waiting)}
    others = [each for each in files.values() if id(each) not in places]
    places |= {id(each): number / len(others) for number, each in enumerate(others)}
    return [item for each in sorted(files.values(), key=lambda each: places[id(each)]) for item in each]


def _leave_out(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("nightly"):
        return
    left_out = [item for item in items if _only_nightly(item)]
    if left_out:
        gone = set(left_out)
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in gone]


def _only_nightly(item: pytest.Item) -> bool:
    if item.nodeid in NIGHTLY or item.get_closest_marker("nightly"):
        return True
    return item.get_closest_marker("wide") is not None and not is_taken(places(item))


def is_taken(places: list[tuple[int, int]]) -> bool:
    """Whether a place in a product is a corner, or on the diagonal, which meets every value of each parameter."""
    corner = all(place in (0, size - 1) for place, size in places)
    return corner or any(
        all(n % size == place for place, size in places) for n in range(max(size for _, size in places))
    )


def places(item: pytest.Item) -> list[tuple[int, int]]:
    """For each `parametrize` of a test, the index of its value and how many there are."""
    params = item.callspec.params  # type: ignore[attr-defined]
    found = []
    for mark in item.iter_markers("parametrize"):
        names = mark.args[0].split(",") if isinstance(mark.args[0], str) else mark.args[0]
        value = tuple(params[name.strip()] for name in names)
        cases = [tuple(case) if len(names) > 1 else (case,) for case in mark.args[1]]
        found.append((cases.index(value), len(cases)))
    return found
