"""The stop key of a real terminal while the event loop is held up, on several lines with several drives at once.

The gaps between the stops of a line are exact in virtual time (tests/drives/test_whole_stop.py).
"""

from __future__ import annotations

import asyncio
import os
import re
import threading
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from multidrop.drives.stop_forms import StopForms, stop_forms
from multidrop.shell.configuration import Settings
from multidrop.shell.prompt.keyboard import Keyboard
from multidrop.shell.session import Session
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cell_session import TCP, bus, drive, party, pmx
from tests.support.posix import pty
from tests.support.until import until

pytestmark = [pytest.mark.pty, pytest.mark.slow]

HELD_UP = 4.0
"""How long the loop is held up, s: longer than the whole stop of each line takes."""
SECOND = 1.0
REPEAT = 1 / 30
CELL = (
    bus("carousel", *(pmx(number) for number in ("01", "02", "03")), serve=TCP)
    + bus("slides", *(drive("TMCM", f"{number}") for number in range(1, 5)), serve=TCP)
    + bus("carets", *(party(name, ES=2) for name in "abc"), serve=TCP)
    + bus("escapes", *(party(name, ES=3) for name in "abc"), serve=TCP)
    + bus("axis", 'personality = "LMDCE"', baud=0, serve=["modbus://127.0.0.1:0"])
)
LINES = {
    "carousel": ("dialect=pmx&drives=01,02,03", "X50000000"),
    "slides": ("dialect=tmcl&drives=1,2,3,4", "ROR 0, 20000"),
    "carets": ("drives=a,b,c", "SL 200000"),
    "escapes": ("drives=a,b,c", "SL 200000"),
    "axis": ("", "SL 200000"),
}
"""The keys of each line's URL, and what moves a drive of it."""


class Plant:
    """A session with five lines, whose drives all move, and what leaves of it, with the times."""

    def __init__(self, folder: Path) -> None:
        self.cell = folder / "cell.toml"
        self.cell.write_text(CELL)
        self.session = Session(Settings({}, folder / "config", folder / "state"))
        self.left: dict[str, list[tuple[float, bytes]]] = {}
        self.forms: dict[str, StopForms] = {}

    async def begin(self, stack: AsyncExitStack) -> None:
        self.floor = RunningFloor(Floor(load(str(self.cell))))
        stack.callback(self.floor.close)
        stack.push_async_callback(self.session.close)
        served = {each.name: (await serve_bus(self.floor, each, stack))[0] for each in self.floor.floor.cell.buses}
        await asyncio.gather(
            *(self.session.open(f"{at.endpoint}?{LINES[name][0]}", name) for name, at in served.items())
        )
        for name, line in self.session.buses.items():
            for known in line.all_drives:
                await self.session.run(f"@{name}:{known.address} {LINES[name][1]}")
            self.forms[name] = stop_forms(line.roster)
            self._watch(name, line.link.transport)

    def _watch(self, name: str, transport: Any) -> None:
        endpoint = transport._endpoint
        left, write = self.left.setdefault(name, []), endpoint.write

        def noted(data: bytes | memoryview) -> int:
            at = time.monotonic()  # before the call, behind which this thread may wait for its turn
            taken = int(write(data))
            left.append((at, bytes(data[:taken])))
            return taken

        endpoint.write = noted

    def moving(self) -> list[str]:
        now, found = self.floor.now(), list[str]()
        for each in self.floor.floor.drives:
            assert each.unit.shadow is not None
            if any(axis.velocity for axis in each.unit.shadow.motion(now)):
                found.append(f"{each.bus}:{each.spec.name}")
        return found

    def written(self, name: str, until: float) -> bytes:
        return b"".join(data for at, data in self.left[name] if at <= until)


@pytest.fixture
async def plant(tmp_path: Path) -> AsyncIterator[Plant]:
    async with AsyncExitStack() as stack:
        made = Plant(tmp_path)
        await made.begin(stack)
        yield made


@pytest.mark.parametrize("keys", [1, 30])
async def test_every_drive_of_every_line_is_sent_its_stop_while_the_loop_does_nothing(plant: Plant, keys: int) -> None:
    master, terminal = pty.openpty()
    keyboard, session = Keyboard(terminal, signals=False), plant.session
    stops: list[str] = []
    keyboard.stop_ahead = session.stop_ahead

    def stop(dropped: str) -> None:
        stops.append(dropped)
        session.stop()

    keyboard.stop = stop

    def press() -> None:
        for _ in range(keys):
            os.write(master, b"\x18")
            time.sleep(REPEAT)

    assert len(plant.moving()) == 14
    with keyboard:
        for left in plant.left.values():
            left.clear()
        begin = time.monotonic()
        person = threading.Thread(target=press)
        person.start()
        time.sleep(HELD_UP)  # the loop does nothing else
        person.join()
        assert not stops, "the loop has taken nothing over"
        for name, line in session.buses.items():
            soon, whole = plant.written(name, begin + SECOND), plant.written(name, begin + HELD_UP)
            for each in line.all_drives:
                codec = each.state.codec
                own = codec.stop([each.address])
                reached = own in soon if codec.stop_replies else codec.hears_stop(soon, each.address)
                assert reached, f"{name}: nothing for {each.address} in the first second: {soon!r}"
            forms = plant.forms[name]
            assert all(piece.data in whole for piece in forms.repeats), f"{name}: {whole!r}"
            writes = [(at, data) for at, data in plant.left[name] if at <= begin + HELD_UP]
            if forms.gap and keys == 1:
                assert [data for _, data in writes] == [forms.immediate, *(each.data for each in forms.repeats)]
        await until(lambda: len(stops) == keys)
        for line in session.buses.values():
            await line.stopped()
    assert plant.moving() == []
    tally = str(session.tally())
    assert re.search(r"NOT (KNOWN|REACHED)|STILL", tally) is None, tally
    for descriptor in (master, terminal):
        os.close(descriptor)
