"""The blocking session, in a thread of its own: any thread calls it, and every early end stops what it started."""

from __future__ import annotations

import asyncio
import inspect
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from multidrop import Diagnostic, Refused, Session, Stopped, connect, connect_async
from multidrop.api import threads
from tests.support import api_program, behind_api
from tests.support.behind_api import awaited, end_all, floor_of, thread_of
from tests.support.cell_session import bus, party
from tests.support.until import PATIENCE
from tests.support.virtual import VirtualLoop

RUN = "SL 1000"
"""A motion without an end: a move would be over, since the clock waits for nobody."""


@pytest.fixture(autouse=True)
def virtual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no thread wait for its clock."""
    monkeypatch.setattr(threads, "new_loop", VirtualLoop)


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A line with drives a and b."""
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    return f"sim:{tmp_path / 'cell.toml'}"


@pytest.fixture
def session(url: str) -> Iterator[Session]:
    """An open session."""
    with connect(url) as opened:
        yield opened


def floor(session: Session) -> Any:
    """The simulated cell, which outlives the session."""
    return floor_of(awaited(session))


def moving(cell: Any) -> set[str]:
    """The drives that move, in the simulator, once the last ramp is over."""
    return behind_api.moving(cell, later=1.0)


def soon(session: Session, seconds: float, function: Any) -> None:
    """Call a function in the session's thread, in a while."""
    thread_of(session).soon(lambda: asyncio.get_running_loop().call_later(seconds, function))


def test_lines_moves_and_words(session: Session) -> None:
    a = session.drive("a")
    assert (a.name, a.address, a.axis, a.product, repr(a)) == ("a", "a", "", "LMDCM", f"<drive a: {a.version}>")
    assert a.version and [each.name for each in session.drives] == ["a", "b"]
    a.move(51200)
    a.wait()
    assert (a.position, a.velocity, a.moving, a.motion.position) == (51200, 0, False, 51200)
    a.move_to(0)
    a.wait(idle=True)
    a.write("VM", 700000)
    assert a.read("VM") == 700000 and a.send("PR VM") == ["700000"] == session.send("@a PR VM")
    with pytest.raises(Refused, match="error 23"):
        a.send("VM=5")
    with pytest.raises(Diagnostic, match="no drive z"):
        session.drive("z")


def test_programs_and_parameters(session: Session, tmp_path: Path) -> None:
    a, file = session.drive("a"), str(tmp_path / "go.mxt")
    a.programs.download("go.mxt", "PG 1\nLB G1\n PR 7\n E\nPG\n", run="G1")
    a.wait(idle=True)
    assert [each.split(maxsplit=1)[1] for each in a.programs.list()] == ["LB G1", "PR 7", "E"]
    assert a.programs.upload(file) == Path(file).read_text().splitlines()
    with pytest.raises(Diagnostic, match="exists already"):
        a.programs.upload(file)
    kept = str(tmp_path / "kept.toml")
    assert a.parameters.backup(kept).values["VM"] == 768000
    a.write("VM", 700000)
    assert a.parameters.diff(kept) == [("VM", 700000, 768000)]
    assert a.parameters.restore(kept, dry_run=True) == ["a: VM=768000 (was 700000)"]
    with pytest.raises(Diagnostic, match=r"nothing was sent; connect\(URL, yes=True\) agrees"):
        a.parameters.restore(kept)
    assert a.parameters.read().values["VM"] == 700000 and ("VM", 700000, 768000) in a.parameters.diff()


def test_a_typed_program(url: str) -> None:
    assert api_program.main(url) == ["51200", "768000"]


def test_yes_agrees_beforehand(url: str, tmp_path: Path) -> None:
    with connect(url, yes=True) as session:
        a, kept = session.drive("a"), str(tmp_path / "kept.toml")
        a.parameters.backup(kept)
        a.write("VM", 700000)
        assert a.parameters.restore(kept) and a.read("VM") == 768000


def test_it_works_inside_a_running_loop(url: str) -> None:
    async def cell_of_a_notebook() -> int:
        with connect(url) as session:
            session.drive("a").move(100)
            session.drive("a").wait()
            return session.drive("a").position

    assert asyncio.run(cell_of_a_notebook()) == 100


def test_an_exception_stops_what_was_started(url: str) -> None:
    with pytest.raises(ZeroDivisionError), connect(url) as session:
        cell = floor(session)
        session.drive("b").send(RUN)
        raise ZeroDivisionError
    assert moving(cell) == set()
    session.close()
    with pytest.raises(Diagnostic, match="the session is closed"):
        session.drive("b")


def test_the_normal_end_leaves_a_move_alone(url: str) -> None:
    with connect(url) as other:
        with connect(url) as session:
            cell = floor(session)
            session.drive("b").send(RUN)
        assert moving(cell) == {"b"}
        assert other.drives


@pytest.mark.parametrize("ends", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("after", [0.0, 0.5])
def test_an_interruption_of_a_call_stops_at_once(
    session: Session, ends: type[BaseException], after: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def handler(number: int, frame: object) -> None:
        raise ends

    def begin(work: Any) -> Any:
        future = ordinary(work)
        monkeypatch.setattr(thread_of(session), "begin", ordinary)
        soon(session, after, lambda: os.kill(os.getpid(), signal.SIGINT))
        return future

    ordinary, a, before = thread_of(session).begin, session.drive("a"), signal.signal(signal.SIGINT, handler)
    try:
        for _ in range(2):
            a.send(RUN)
            assert moving(floor(session)) == {"a"}
            monkeypatch.setattr(thread_of(session), "begin", begin)
            with pytest.raises(ends):
                a.wait(timeout=80000)
            assert moving(floor(session)) == set()
        assert a.velocity == 0
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_stop_from_another_thread_ends_a_wait(session: Session) -> None:
    a, ended = session.drive("a"), threading.Event()
    a.send(RUN)

    def wait() -> None:
        try:
            a.wait(timeout=80000)
        except Stopped:
            ended.set()

    thread = threading.Thread(target=wait)
    thread.start()
    report = session.stop()
    thread.join(PATIENCE)
    assert report.at_rest and moving(floor(session)) == set()
    with pytest.raises(Stopped):
        a.move(1)
    session.resume()
    a.send(RUN)
    assert a.stop().at_rest
    assert ended.is_set() or not thread.is_alive()


def test_the_end_of_the_process_stops_what_is_open(url: str) -> None:
    session = connect(url)
    cell = floor(session)
    session.drive("a").send(RUN)
    end_all()
    assert moving(cell) == set() and not thread_of(session).alive


@pytest.mark.parametrize("name", ["TERM", "HUP", "QUIT", "ALRM", "USR1", "USR2", "XCPU"])
def test_signals_that_would_end_the_process_become_an_exit(url: str, name: str) -> None:
    number = signal.Signals[f"SIG{name}"]
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as ended, connect(url) as session:
            cell = floor(session)
            session.drive("a").send(RUN)
            os.kill(os.getpid(), number)
        assert ended.value.code == 128 + number and moving(cell) == set()
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)


def test_a_blocking_call_in_its_own_thread_is_refused(session: Session) -> None:
    failures: list[BaseException] = []

    def call() -> None:
        try:
            session.drive("a")
        except RuntimeError as failure:
            failures.append(failure)

    soon(session, 0.0, call)
    assert session.drive("a").position == 0 and len(failures) == 1


def test_a_stop_whose_report_is_interrupted_is_a_stop_all_the_same(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted:
        """The end of a call for which a person does not wait."""

        def done(self) -> bool:
            return False

        def result(self) -> None:
            raise KeyboardInterrupt

    begin = thread_of(session).begin

    def first(work: Any) -> Interrupted:
        monkeypatch.setattr(thread_of(session), "begin", begin)
        work.close()
        return Interrupted()

    session.drive("a").run_at(1000)
    monkeypatch.setattr(thread_of(session), "begin", first)
    with pytest.raises(KeyboardInterrupt):
        session.stop()
    with pytest.raises(Stopped):
        session.drive("b").move(5)
    assert moving(floor(session)) == set()
    session.resume()
    session.drive("b").move(5)


def test_a_session_agrees_to_nothing_unless_it_is_told(url: str, tmp_path: Path) -> None:
    (tmp_path / "kept.toml").write_text("[parameters]\nRC = 33\n")
    for opened, agreed in ((Session(url), False), (connect(url), False), (Session(url, yes=True), True)):
        with opened:
            if agreed:
                assert opened.drive("a").parameters.restore(str(tmp_path / "kept.toml")) == ["a: RC=33 (was 25)"]
                continue
            with pytest.raises(Diagnostic, match="nothing was sent"):
                opened.drive("a").parameters.restore(str(tmp_path / "kept.toml"))


@pytest.mark.parametrize("opens", [connect, Session, connect_async])
def test_nothing_is_agreed_to_and_no_connection_comes_back_unless_that_is_asked_for(opens: Any) -> None:
    given = inspect.signature(opens).parameters
    assert [given[name].default for name in ("yes", "beyond", "reconnect")] == [False, False, False]
