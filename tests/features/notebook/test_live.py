"""A picture below a cell that stays up to date."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from multidrop import Diagnostic, Session, connect
from multidrop.api import threads
from multidrop.features.notebook import live as live_pictures
from tests.support.cell_session import bus, party
from tests.support.virtual import VirtualLoop


class Kernel:
    """An IPython in a kernel, as far as sessions use it."""

    def __init__(self) -> None:
        self.called: list[Callable[[Any], object]] = []
        self.shown: list[str] = []
        self.events, self.kernel = self, object()

    def register(self, event: str, call: Callable[[Any], object]) -> None:
        assert event == "post_run_cell"
        self.called.append(call)

    def unregister(self, event: str, call: Callable[[Any], object]) -> None:
        self.called.remove(call)

    def display(self, html: str, display_id: bool) -> Kernel:
        assert display_id
        self.shown.append(html)
        return self

    def update(self, html: str) -> None:
        self.shown.append(html)

    def cell_ends(self, error: BaseException | None) -> None:
        for each in list(self.called):
            each(SimpleNamespace(error_in_exec=error))


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    """The kernel that this process runs in."""
    made, display = Kernel(), ModuleType("IPython.display")
    display.__dict__.update(display=made.display, HTML=str)
    ipython = ModuleType("IPython")
    ipython.__dict__.update(get_ipython=lambda: made, display=display)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    return made


@pytest.fixture
def url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A line with the drives a and b, which never waits for its clock."""
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    return f"sim:{tmp_path / 'cell.toml'}"


@pytest.fixture
def session(url: str, kernel: Kernel) -> Iterator[Session]:
    """A session of a notebook."""
    with connect(url) as opened:
        yield opened


def test_a_picture_is_replaced_until_it_is_closed(
    session: Session, kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_pictures, "EVERY", 0.01)
    session.drive("a").move(25600)
    session.drive("a").wait()
    live = session.live("a")
    live.close()
    live.close()
    assert kernel.shown[0] == "<p>multidrop: reading</p>" and len(kernel.shown) > 1
    assert "<td" in kernel.shown[-1] and ">25600<" in kernel.shown[-1] and "<svg" in kernel.shown[-1]


def test_a_picture_ends_with_its_session(session: Session, kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_pictures, "EVERY", 0.01)
    live = session.live()
    session.close()
    threads = [each for each in threading.enumerate() if each.name == "multidrop live"]
    for each in threads:
        each.join(10)
    assert live is not None and not any(each.is_alive() for each in threads)


def test_outside_a_notebook_it_is_refused_in_one_line(url: str) -> None:
    with connect(url) as session, pytest.raises(Diagnostic, match=r"this is none; telemetry\(\) works everywhere"):
        session.live()
