"""A simulated cell served in this process, for tests of other programs: TCP, own ports of drives, pseudo-terminals."""

from __future__ import annotations

import os
import sys
from contextlib import AsyncExitStack
from types import TracebackType

from multidrop.api.threads import LoopThread
from multidrop.base.errors import Diagnostic
from multidrop.shell import configuration
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import BusSpec, Cell, Endpoint
from multidrop.simulator.declared import own_ports
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import Served, serve_bus
from multidrop.simulator.serving.running import RunningFloor

HOST = "127.0.0.1"
PTY = "pty"


class SimulatedCell:
    """A cell that runs from now until `close`: `with simulate("cell.toml") as cell`. Any thread may use it.

    What its file says of `serve` is not used: every bus is served at a free port of this computer.
    """

    def __init__(self, file: str | os.PathLike[str] = "", *, text: str = "", speed: float = 1.0) -> None:
        """Serve a cell file, its `text`, or without both the demo cell. Raises Diagnostic for an error in it."""
        if not speed > 0:
            raise Diagnostic(f"no speed {speed:g}", "simulate", "valid: above 0; 10 is ten times as fast")
        self._cell = _read(file, text)
        self._thread = LoopThread()
        self._stack = AsyncExitStack()
        self._served: list[Served] = []
        try:
            self._floor = self._thread.begin(self._serve(speed)).result()
        except BaseException:
            self._thread.end()
            raise

    async def _serve(self, speed: float) -> RunningFloor:
        async with AsyncExitStack() as stack:
            floor = RunningFloor(Floor(self._cell), speed)
            stack.callback(floor.close)
            for bus in self._cell.buses:
                self._served += await serve_bus(floor, _everywhere(bus, bus.name in floor.floor.ethernet), stack)
            self._stack = stack.pop_all()
            return floor

    def __enter__(self) -> SimulatedCell:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End it, with the connections of its clients. May be called again."""
        if self._thread.alive:
            self._thread.begin(self._stack.aclose()).result()
            self._thread.end()

    @property
    def buses(self) -> list[str]:
        """The names of its buses."""
        return [bus.name for bus in self._cell.buses]

    def url(self, bus: str = "", scheme: str = "tcp") -> str:
        """The URL of a bus, by default of the first: `tcp`, `pty`, or the scheme of a port that only its drive has.

        Raises Diagnostic for a bus or a scheme that it does not have.
        """
        wanted = bus or self.buses[0]
        ways = {
            _scheme(served.endpoint): served.endpoint.removeprefix("pty:")
            for served in self._served
            if served.bus == wanted
        }
        if scheme not in ways:
            hint = f"valid: {', '.join(ways)}" if ways else f"its buses: {', '.join(self.buses)}"
            raise Diagnostic(f"no {scheme} to {wanted}", "simulated cell", hint)
        return ways[scheme]

    def world(self, command: str) -> str:
        """Move the world as `/sim` does: `input b 1 0`, `push b 100`, `power b off`, `unplug press`. Raises Diagnostic.

        Returns an empty text: no command has a remark.
        """

        async def move() -> str:
            self._floor.command(command)
            return ""

        if not self._thread.alive:
            raise Diagnostic("the simulated cell is closed", command)
        return self._thread.begin(move()).result()


def _read(file: str | os.PathLike[str], text: str) -> Cell:
    if text:
        return cells.read(text, os.fspath(file) or "cell")
    return cells.load(os.fspath(file), configuration.load().allowed) if os.fspath(file) else cells.demo()


def _everywhere(bus: BusSpec, ethernet: bool) -> BusSpec:
    """Serve a bus in all ways that it can have."""
    schemes = ["tcp", *(own_ports() if ethernet else []), *([PTY] if sys.platform != "win32" else [])]
    return bus._replace(
        serve=tuple(Endpoint(f"{scheme}:", scheme, HOST if scheme != PTY else "") for scheme in schemes)
    )


def _scheme(endpoint: str) -> str:
    scheme, chosen, _ = endpoint.partition("://")
    return scheme if chosen else PTY


def simulate(file: str | os.PathLike[str] = "", *, text: str = "", speed: float = 1.0) -> SimulatedCell:
    """Serve a simulated cell in this process: a file, a `text`, or the demo cell. `speed` 10: ten times as fast."""
    return SimulatedCell(file, text=text, speed=speed)
