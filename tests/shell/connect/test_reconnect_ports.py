"""Lost ports of this machine that come back: pseudo-terminals by their links, and TCP, on a real clock."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.reconnect import Absent, SerialAgain
from multidrop.shell.events import Notified, Printed
from multidrop.shell.session import Session
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import Served, serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import serial_port
from tests.support.posix import fcntl
from tests.support.processes import Running
from tests.support.until import until

pytestmark = [pytest.mark.process, pytest.mark.pty]
CELL = """
[[bus]]
name = "press"
serve = ["{endpoint}"]
baud = 0
[[bus.drive]]
personality = "{personality}"
set = {{ EM = 1 }}
"""
SOON = 1.5
"""The time in which a port that is back is found with its drive, on a busy machine, s: a second and the search."""


class ServedCell:
    """A served cell that can be ended and served again at the same place."""

    def __init__(self, folder: Path, endpoint: str, personality: str = "LMDCM") -> None:
        self._path = folder / "cell.toml"
        self._endpoint, self._personality = endpoint, personality
        self._stack = AsyncExitStack()

    async def begin(self) -> str:
        self._path.write_text(CELL.format(endpoint=self._endpoint, personality=self._personality))
        cell = load(str(self._path))
        self.floor = RunningFloor(Floor(cell))
        self._stack.callback(self.floor.close)
        served: list[Served] = await serve_bus(self.floor, cell.buses[0], self._stack)
        found = served[0].endpoint
        self._endpoint = self._endpoint if found.startswith("pty:") else found
        return found.removeprefix("pty:") if found.startswith("pty:") else found

    async def end(self) -> None:
        await self._stack.aclose()
        self._stack = AsyncExitStack()


@asynccontextmanager
async def session(folder: Path, **more: Any) -> AsyncIterator[tuple[Session, list[str]]]:
    made = Session(
        Settings({}, folder / "config", folder / "state", data=folder / "data"), **{"reconnect": True, **more}
    )
    said: list[str] = []
    made.subscribe(lambda event: said.append(event.text) if isinstance(event, Notified | Printed) else None)
    try:
        yield made, said
    finally:
        await made.close()


@pytest.mark.parametrize(
    ("endpoint", "personality"),
    [("pty:press.tty", "LMDCM"), ("tcp://127.0.0.1:0", "LMDCE"), ("modbus://127.0.0.1:0", "LMDCE")],
)
async def test_a_served_line_comes_back_at_the_same_place(tmp_path: Path, endpoint: str, personality: str) -> None:
    cell = ServedCell(tmp_path, endpoint, personality)
    url = await cell.begin()
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(url)
        descriptors = len(os.listdir("/dev/fd"))
        for _ in range(3):
            await cell.end()
            await until(lambda: bus.lost)
            await asyncio.sleep(0.3)
            await cell.begin()
            await until(lambda: not bus.lost, SOON)
            await shop.run("PR V")
            assert said[-1] == "0"
        assert abs(len(os.listdir("/dev/fd")) - descriptors) <= 2
    await cell.end()


async def test_the_number_of_a_pseudo_terminal_is_no_name_to_open_again(tmp_path: Path) -> None:
    """A link that a killed server left may lead to another terminal by now: nothing is written to it."""
    cell = ServedCell(tmp_path, "pty:press.tty")
    url = await cell.begin()
    async with session(tmp_path) as (shop, _):
        (bus,) = await shop.open(url)
        link = tmp_path / "press.tty"
        await cell.end()
        await until(lambda: bus.lost)
        master, slave = os.openpty()
        os.set_blocking(master, False)
        link.symlink_to(os.ttyname(slave))
        stale = SerialAgain(str(link), lambda name: pytest.fail(f"{name} was opened"))
        with pytest.raises(Absent):
            await stale(bus.link.transport)
        link.unlink()
        os.close(master)
        os.close(slave)
        assert not SerialAgain("/dev/pts/0", lambda name: pytest.fail(name)).possible
        await cell.begin()
        await until(lambda: not bus.lost)
    await cell.end()


async def test_another_program_that_has_the_port_is_named_once(tmp_path: Path) -> None:
    cell = ServedCell(tmp_path, "pty:press.tty")
    url = await cell.begin()
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(url)
        cell.floor.command("/sim unplug press")
        await until(lambda: bus.lost)
        cell.floor.command("/sim plug press")
        holder = os.open(url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        fcntl.flock(holder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        await until(lambda: any("in use by" in text for text in said))
        await asyncio.sleep(1.6)
        assert sum("in use by" in text for text in said) == 1 and bus.lost
        os.close(holder)
        await until(lambda: not bus.lost)
    await cell.end()


async def test_another_program_beside_us_is_named_once_at_each_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service may take a port as it is plugged in, and without a lock: the port opens all the same."""
    cell = ServedCell(tmp_path, "pty:press.tty")
    url = await cell.begin()
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(url)
        for _ in range(2):
            cell.floor.command("/sim unplug press")
            await until(lambda: bus.lost)
            monkeypatch.setattr(serial_port, "beside", lambda port: "ModemManager (pid 9) has it open")
            cell.floor.command("/sim plug press")
            await until(lambda: not bus.lost)
        assert said.count(f"{bus.name}: ModemManager (pid 9) has it open") == 2
    await cell.end()


async def test_a_port_that_is_waited_for_is_not_opened_twice(tmp_path: Path) -> None:
    cell = ServedCell(tmp_path, "tcp://127.0.0.1:0", "LMDCE")
    url = await cell.begin()
    async with session(tmp_path) as (shop, _):
        (bus,) = await shop.open(url)
        await cell.end()
        await until(lambda: bus.lost)
        with pytest.raises(Diagnostic, match=r"belongs to 127.0.0.1, which is lost.*/close 127.0.0.1 gives it up"):
            await shop.open(url)
        await shop.run("/close 127.0.0.1")
        await cell.begin()
        await shop.open(url)
    await cell.end()


async def test_udp_comes_back_from_a_refusal(tmp_path: Path) -> None:
    cell = ServedCell(tmp_path, "udp://127.0.0.1:0", "LMDCE")
    url = await cell.begin()
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(url)
        await cell.end()
        with pytest.raises(Exception, match="nothing listens|does not reply|no reply"):
            await shop.run("PR V")
        await asyncio.sleep(1.0)
        await cell.begin()
        await until(lambda: not bus.lost)
        await shop.run("PR V")
        assert said[-1] == "0" and sum("trying again" in text for text in said) <= 1
    await cell.end()


async def test_a_simulator_that_is_killed_and_started_again_is_found(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(CELL.format(endpoint="pty:press.tty", personality="LMDCM"))

    def started() -> Running:
        running = Running("sim", "cell.toml", "--json", folder=tmp_path)
        running.until('{"ready": true}')
        return running

    sim = await asyncio.to_thread(started)
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(str(tmp_path / "press.tty"))
        os.kill(sim.process.pid, signal.SIGKILL)
        await until(lambda: bus.lost)
        await asyncio.to_thread(sim.end)
        assert (tmp_path / "press.tty").is_symlink()
        sim = await asyncio.to_thread(started)
        await until(lambda: not bus.lost)
        await shop.run("PR V")
        assert said[-1] == "0"
    await asyncio.to_thread(sim.kill)


@pytest.mark.slow
async def test_a_server_that_accepts_and_says_nothing_is_waited_for(tmp_path: Path) -> None:
    """Half open: the host accepts the connection, the drive is not found, and the bus comes back when it replies."""
    cell = ServedCell(tmp_path, "tcp://127.0.0.1:0", "LMDCE")
    url = await cell.begin()
    port = int(url.rpartition(":")[2])
    async with session(tmp_path) as (shop, said):
        (bus,) = await shop.open(f"{url}?party=0&checksum=0")
        await cell.end()
        await until(lambda: bus.lost)
        with socket.create_server(("127.0.0.1", port)):
            await until(lambda: any("still lost: no drive replies" in text for text in said))
        await cell.begin()
        await until(lambda: not bus.lost)
    await cell.end()


@pytest.mark.parametrize("option", [[], ["--no-reconnect"]], ids=["goes on", "ends"])
async def test_a_plot_goes_on_after_a_loss_unless_told_otherwise(tmp_path: Path, option: list[str]) -> None:
    pytest.importorskip("rerun")
    cell = ServedCell(tmp_path, "tcp://127.0.0.1:0", "LMDCE")
    url = await cell.begin()
    plot = await asyncio.to_thread(Running, "plot", url, "--to", "run.rrd", *option, folder=tmp_path)
    try:
        await until(lambda: any("plotting to run.rrd" in line for line in plot.errors))
        cell.floor.command("/sim unplug press")
        if option:
            assert await asyncio.to_thread(plot.end) == 3
            assert any("was lost" in line and "trying again" not in line for line in plot.errors)
            return
        await until(lambda: any("trying again" in line for line in plot.errors))
        cell.floor.command("/sim plug press")
        await until(lambda: any("is back after" in line for line in plot.errors))
        plot.process.send_signal(signal.SIGINT)
        assert await asyncio.to_thread(plot.end) == 0
        assert (tmp_path / "run.rrd").stat().st_size
    finally:
        await asyncio.to_thread(plot.kill)
        await cell.end()


async def test_lines_that_are_piped_or_sent_end_with_the_loss(tmp_path: Path) -> None:
    cell = ServedCell(tmp_path, "tcp://127.0.0.1:0", "LMDCE")
    url = await cell.begin()
    lines = ["PR V", "/sleep 2", "PR V"]
    sending = await asyncio.to_thread(Running, "send", url, *lines, folder=tmp_path)
    piped = await asyncio.to_thread(Running, "shell", url, folder=tmp_path)
    piped.say(*lines)
    try:
        for each in (sending, piped):
            await asyncio.to_thread(each.until, "0")
        cell.floor.command("/sim unplug press")
        await asyncio.sleep(0.3)
        cell.floor.command("/sim plug press")
        for each in (sending, piped):
            assert await asyncio.to_thread(each.end) == 3
            assert not any("trying again" in line or "is back" in line for line in each.errors)
    finally:
        for each in (sending, piped):
            await asyncio.to_thread(each.kill)
        await cell.end()
