"""Plugin of the test run: where coverage is measured, with `--cov`.

Measuring makes Python two to three times slower, pytest too. It is on while modules are imported and while
a test runs that shows something new. It is off in the process that hands tests to others, and between tests. The share
that is measured is a lower bound.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from coverage import Coverage

REPEATING = ("wide", "nightly", "slow")
"""Markers of products of parameters and of floods, which go the same ways again."""

TRACED = "tests/soak/"
"""Tests that trace threads themselves."""
UNMEASURED = Path(__file__).with_name("unmeasured.txt")
"""Test functions that take long and go the ways of cheaper ones (`tests.support.choose_measured`)."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--measure-all` and `--measure-cases`."""
    parser.addoption("--measure-all", action="store_true", help="measure coverage in the first case of every test")
    parser.addoption(
        "--measure-cases", action="store_true", help="measure it in every case of every test but the seeds"
    )


class Measuring:
    """Switches the coverage of pytest-cov, which starts it."""

    def __init__(self, plugin: Any) -> None:
        self._controller = plugin.cov_controller
        self._on = True
        self._measured: set[str] = set()

    def _resume(self) -> None:
        self._controller.resume()
        self._on = True

    def _pause(self) -> None:
        self._controller.pause()
        self._on = False

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection(self) -> Iterator[Any]:
        """Switch it off for the rest of the run, but for what follows.

        A worker of xdist has two: pytest-cov starts one before it knows that it is in a worker, which measures whenever
        the other one pauses.
        """
        self._pause()
        while (other := Coverage.current()) is not None:
            other.stop()
        self._measure_imports()
        return (yield)

    def _measure_imports(self) -> None:
        """Measure every module that the main thread imports, whichever test needs it first."""
        execute = SourceFileLoader.exec_module

        def executed(loader: SourceFileLoader, module: ModuleType) -> None:
            ours = module.__name__.partition(".")[0] == "multidrop"
            if self._on or not ours or threading.current_thread() is not threading.main_thread():
                execute(loader, module)
                return
            self._on = True
            self._controller.cov.start()
            try:
                execute(loader, module)
            finally:
                self._controller.cov.stop()
                self._on = False

        SourceFileLoader.exec_module = executed  # type: ignore[method-assign]

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Choose the tests."""
        if config.getoption("measure_cases"):
            self._measured = {item.nodeid for item in items if not item.nodeid.startswith(TRACED)}
            return
        unmeasured = set() if config.getoption("measure_all") else set(UNMEASURED.read_text().split())
        self._measured = {item.nodeid for item in items} - {item.nodeid for item in _repeating(items, unmeasured)}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """Measure a test with its fixtures."""
        if item.nodeid in self._measured:
            self._resume()
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        """Measure its end."""
        try:
            return (yield)
        finally:
            if item.nodeid in self._measured:
                self._pause()


def _repeating(items: list[pytest.Item], unmeasured: set[str]) -> Iterator[pytest.Item]:
    """The tests that go ways of others again: those marked or listed so, and the cases of a test but its first one."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        function = item.nodeid.partition("[")[0]
        if function in unmeasured or any(item.get_closest_marker(name) for name in REPEATING):
            yield item
        else:
            cases.setdefault(function, []).append(item)
    for each in cases.values():
        yield from each[1:]


@pytest.hookimpl(trylast=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Take over from pytest-cov."""
    manager = session.config.pluginmanager
    plugin = manager.getplugin("_cov")
    if plugin is not None and plugin.cov_controller is not None:  # None: --no-cov
        manager.register(Measuring(plugin))
