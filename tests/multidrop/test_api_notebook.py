"""In a notebook an interrupted cell stops what the session moved; calls that meet the end of their session."""

from __future__ import annotations

import asyncio
import concurrent.futures
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from multidrop import Diagnostic, Session, TransportLost, connect, read_rrd
from multidrop.api import threads
from multidrop.api.threads import LoopEnded, LoopThread
from tests.support import behind_api
from tests.support.behind_api import awaited, floor_of
from tests.support.cell_session import bus, party
from tests.support.foreign_features import delete_features
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


def moving(session: Session) -> set[str]:
    """The drives that move, in the simulator, once the last ramp is over."""
    return behind_api.moving(floor_of(awaited(session)), later=1.0)


def test_an_interrupted_cell_stops_what_the_session_moves(session: Session, kernel: Kernel) -> None:
    session.drive("a").run_at(1000)
    for harmless in (None, ValueError()):
        kernel.cell_ends(harmless)
        assert moving(session) == {"a"}
    kernel.cell_ends(KeyboardInterrupt())
    assert moving(session) == set()
    session.drive("b").run_at(1000)  # it goes on
    assert moving(session) == {"b"}
    session.close()
    assert kernel.called == []


def test_without_its_feature_an_object_is_its_text(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    delete_features(monkeypatch)
    assert session._repr_html_() is None and session.drive("a")._repr_html_() is None and repr(session)
    with pytest.raises(Diagnostic, match="the feature notebook is not there; install multidrop again, whole"):
        session.live()
    with pytest.raises(Diagnostic, match="the feature plot_files is not there; install multidrop again, whole"):
        read_rrd("run.rrd")


def test_a_call_of_another_thread_at_the_end_of_its_session_says_that_it_is_closed(url: str) -> None:
    """However the two meet: each call has its value, or is refused in one line; none waits for ever."""
    ends: list[object] = []

    def ask(session: Session) -> None:
        try:
            while True:
                session.drive("a").send("PR P")
        except Exception as problem:  # noqa: BLE001
            ends.append(problem)

    for _ in range(20):
        session = connect(url)
        thread = threading.Thread(target=ask, args=(session,), daemon=True)
        thread.start()
        session.close()
        thread.join(10)
        assert not thread.is_alive()
    assert len(ends) == 20 and {type(each) for each in ends} <= {Diagnostic, TransportLost}, ends


def test_work_that_begins_with_the_end_of_its_loop_is_refused_or_cancelled() -> None:
    async def endless() -> None:
        await asyncio.Event().wait()

    loop = LoopThread()
    begun = loop.begin(endless())
    loop.end()
    with pytest.raises(concurrent.futures.CancelledError):
        begun.result(10)
    with pytest.raises(LoopEnded):
        loop.begin(endless())
