"""The stop never passes through a feature: its bytes leave while a hook of one raises, holds the loop up, or waits.

A byte pipe by others is the exception: the stop of its own line passes through it, and that of no other line.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Stopped
from multidrop.base.feature import Feature
from multidrop.cli import parse
from multidrop.drives.events import Changed
from multidrop.shell.at_session import AtSession
from multidrop.shell.configuration import Settings
from multidrop.shell.hooks import Added, Options
from multidrop.shell.operations.operation import Operation
from multidrop.shell.session import Session
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Transport
from tests.support import foreign_features as foreign
from tests.support import own_features
from tests.support.cell_session import TCP, CellSession, bus, party
from tests.support.foreign_features import ASYNC, CALLS, NAMES, Slowness

PATIENCE = 10.0
"""s; far longer than a thread takes to write."""


class Held:
    """A hook that holds the event loop up, until the thread of the stop key has written."""

    def __init__(self) -> None:
        self.inside, self.written = threading.Event(), threading.Event()
        self.was_written = False

    def __call__(self, *_: Any) -> None:
        if not self.inside.is_set():
            self.inside.set()
            self.was_written = self.written.wait(PATIENCE)


def raising(*_: Any) -> None:
    raise RuntimeError("a defect of a feature")


@pytest.fixture
def add(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    def added(*adds: object) -> None:
        own_features.load(monkeypatch, Feature("x", "tries to be in the way", adds=adds))

    yield added


def key_thread(session: Any, held: Held) -> tuple[threading.Thread, list[bytes]]:
    """The thread of the stop key, which presses it once the hook has the loop; and what each line was told to write."""
    wrote: list[bytes] = []
    for each in session.buses.values():
        pipe = each.link.transport
        preempt, follow = pipe.preempt, pipe.follow

        def noted(make: Callable[[int], bytes]) -> Callable[[int], bytes]:
            def made(dropped: int) -> bytes:
                wrote.append(make(dropped))
                held.written.set()
                return wrote[-1]

            return made

        pipe.preempt = lambda whole, make, write=preempt, noted=noted: write(whole, noted(make))
        pipe.follow = lambda make, key=False, write=follow, noted=noted: write(noted(make), key)  # of a repeated press

    def press() -> None:
        assert held.inside.wait(PATIENCE)
        session.stop_ahead()

    thread = threading.Thread(target=press)
    thread.start()
    return thread, wrote


@asynccontextmanager
async def served(folder: Path) -> AsyncIterator[Any]:
    """A session with two lines over TCP, whose writes leave from any thread; a drive of the first one moves."""
    (folder / "cell.toml").write_text(bus("press", party("a"), serve=TCP) + bus("lift", party("b"), serve=TCP))
    session = Session(Settings({}, folder / "config", folder / "state"))
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(load(str(folder / "cell.toml"))))
        stack.callback(floor.close)
        for each, names in zip(floor.floor.cell.buses, "ab", strict=True):
            [one] = await serve_bus(floor, each, stack)
            await session.open(f"{one.endpoint}?drives={names}", each.name)
        stack.push_async_callback(session.close)
        await session.run("@press:a SL 1000")
        yield session


def at_session(place: str) -> Callable[[Any, Callable[..., None]], None]:
    def begin(session: Any, hook: Callable[..., None]) -> None:
        if place == "an event":
            session.subscribe(hook)
        else:
            getattr(session.hooks, place).append(hook)

    return begin


HOOKS = ["an event", "changed", "identified", "forgotten"]


@pytest.mark.parametrize("place", HOOKS)
async def test_a_hook_that_holds_the_loop_up_delays_the_report_and_not_the_stop(
    place: str, tmp_path: Path, add: Callable[..., None]
) -> None:
    held, armed = Held(), False

    def hook(*_: Any) -> None:
        if armed:
            held()

    add(AtSession(lambda session: at_session(place)(session, hook)))
    async with served(tmp_path) as session:
        thread, wrote = key_thread(session, held)
        armed = True
        match place:
            case "identified":
                session.identified(session.buses["press"])
            case "forgotten":
                await session.forget(session.buses["lift"])
            case "changed":
                link = session.buses["press"].link
                link.publish(Changed(link.now()))
            case _:
                session.notify("something happens")
        await asyncio.to_thread(thread.join, PATIENCE)
        assert held.was_written and wrote and any(b"\x1b" in each for each in wrote)


@pytest.mark.virtual
@pytest.mark.parametrize("place", HOOKS)
async def test_a_hook_that_raises_keeps_no_stop_from_any_line(
    place: str, tmp_path: Path, add: Callable[..., None]
) -> None:
    add(AtSession(lambda session: at_session(place)(session, raising)))
    async with CellSession(tmp_path, bus("press", party("a")), bus("lift", party("b"))) as cell:
        await cell.session.run("@press:a SL 1000")
        await cell.session.run("@lift:b SL 1000")
        cell.session.stop("Ctrl+X")
        await asyncio.sleep(5)
        assert cell.moving() == set()


@pytest.mark.virtual
async def test_a_feature_that_cannot_begin_is_a_warning_and_the_session_works(
    tmp_path: Path, add: Callable[..., None]
) -> None:
    add(AtSession(raising))
    cell = CellSession(tmp_path, bus("press", party("a")))
    await asyncio.sleep(0)
    assert cell.warned() == ["the feature x cannot begin: RuntimeError: a defect of a feature"]
    async with cell:
        await cell.session.run("@a PR P")
        assert cell.printed() == ["0"]


@pytest.mark.virtual
@pytest.mark.parametrize("place", ["begin", *HOOKS])
async def test_an_async_hook_is_a_warning_and_the_session_works(
    place: str, tmp_path: Path, add: Callable[..., None]
) -> None:
    async def hook(_: Any) -> None:
        """Take what it is called with."""

    add(AtSession(hook if place == "begin" else lambda session: at_session(place)(session, hook)))  # type: ignore[arg-type]
    cell = CellSession(tmp_path, bus("press", party("a")))
    await asyncio.sleep(0)
    why = "hook is async, and nothing awaits it; give a plain function, which may start a task"
    assert cell.warned() == [f"the feature x cannot begin: {why}"]
    async with cell:
        await cell.session.run("@a PR P")
        assert cell.printed() == ["0"]


@pytest.mark.virtual
async def test_a_verb_that_never_returns_ends_with_the_stop(tmp_path: Path, add: Callable[..., None]) -> None:
    async def forever(_: Any) -> None:
        await asyncio.Event().wait()

    add(Operation(forever, verb="/forever", help="Wait."))
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await cell.session.run("SL 1000")
        verb = asyncio.create_task(cell.session.run("/forever"))
        await asyncio.sleep(1)
        cell.session.stop("Ctrl+X")
        with pytest.raises(Stopped):
            await verb
        await asyncio.sleep(5)
        assert cell.moving() == set()


@pytest.mark.parametrize("kind", ["do", "fits"])
async def test_a_verb_that_holds_the_loop_up_delays_no_stop(
    kind: str, tmp_path: Path, add: Callable[..., None]
) -> None:
    held = Held()

    async def work(_: Any) -> None:
        if kind == "do":
            held()

    verb = Operation(work, verb="/slow", help="Be slow.", fits=held)
    add(verb)
    async with served(tmp_path) as session:
        thread, wrote = key_thread(session, held)
        match kind:
            case "do":
                await session.run("/slow")
            case _:
                assert verb.fits is not None
                verb.fits(session)
        await asyncio.to_thread(thread.join, PATIENCE)
        assert held.was_written and wrote


async def test_options_that_hold_the_loop_up_delay_no_stop(tmp_path: Path, add: Callable[..., None]) -> None:
    held = Held()

    async def opened(*_: Any) -> None:
        held()

    add(Options("shell", Slowness, opened=opened))
    async with served(tmp_path) as session:
        thread, wrote = key_thread(session, held)
        await Added("shell", parse(["shell", "--slow"])).opened(session)
        await asyncio.to_thread(thread.join, PATIENCE)
        assert held.was_written and wrote


async def test_no_function_of_any_record_delays_the_stop_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It holds the loop up until the key's thread has written, and then it raises."""
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))
    late = []
    async with served(tmp_path) as session:
        pipes = [each.link.transport for each in session.buses.values()]
        for (kind, name), text in zip(CALLS, NAMES, strict=True):
            held = Held()

            def hook(*_: Any, held: Held = held, **__: Any) -> None:
                held()
                raise KeyError("a defect of a feature")

            feature = foreign.add(monkeypatch, foreign.broken(kind, name, hook))
            thread, _ = key_thread(session, held)
            await foreign.outcome(session, kind, name, feature)
            await asyncio.to_thread(thread.join, PATIENCE)
            session.stop("Ctrl+X")
            late += [] if held.was_written else [text]
            for each in pipes:
                vars(each).pop("preempt", None), vars(each).pop("follow", None)
    assert not late


@pytest.mark.virtual
@pytest.mark.parametrize(("kind", "name"), sorted(ASYNC, key=str), ids=lambda each: getattr(each, "__name__", each))
async def test_a_function_that_never_returns_keeps_no_drive_from_the_stop(
    kind: type, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = asyncio.Event()

    async def forever(*_: Any, **__: Any) -> None:
        begun.set()
        await asyncio.Event().wait()

    feature = foreign.add(monkeypatch, foreign.broken(kind, name, forever))
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await cell.session.run("SL 1000")
        call = asyncio.create_task(foreign.outcome(cell.session, kind, name, feature))
        await begun.wait()
        cell.session.stop("Ctrl+X")
        await asyncio.sleep(5)
        assert cell.moving() == set()
        call.cancel()
        await asyncio.wait([call])


class Pipe(Transport):
    """A byte pipe by others that goes wrong at a stop."""

    name = "slow://h:1"
    preemptible = True

    def start(self, *_: Any) -> None:
        """Deliver nothing."""

    def write(self, data: bytes) -> bool:
        return True

    def discard(self, whole: bool = False) -> int:
        raise SystemExit(3)

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        raise SystemExit(3)

    follow = preempt  # type: ignore[assignment]

    async def close(self) -> None:
        """Close nothing."""


async def test_a_byte_pipe_that_goes_wrong_at_a_stop_keeps_it_from_no_other_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def opened(*_: Any) -> Transport:
        return Pipe()

    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path))
    foreign.add(monkeypatch, type("Broken", (foreign.Slow,), {"open": opened})())
    async with served(tmp_path) as session:
        await session.open("slow://h:1", "first", raw=True)
        for _ in range(2):
            session.move_bus(session.buses["first"], -1)
        assert [*session.buses][0] == "first"
        held = Held()
        thread, wrote = key_thread(session, held)
        held.inside.set()
        await asyncio.to_thread(thread.join, PATIENCE)
        assert len(wrote) == 2, "the lines behind it got theirs from the thread of the key"
        with pytest.raises(SystemExit):
            session.stop("Ctrl+X")
        assert session.latched
