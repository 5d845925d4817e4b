"""Fixtures for all tests: the host's line wired to simulated drives in memory, in virtual time."""

from __future__ import annotations

import itertools
import os
import signal
import sys
import zlib
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from multidrop.base.errors import Stopped
from multidrop.dialects import DriveState, End, Procedure, Reply
from multidrop.dialects.families import family_of
from multidrop.drives.events import Unsolicited
from multidrop.drives.line import Finished, Line, Write
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.tui import boundary
from tests.support.faults import disturb
from tests.support.procedure import ProcedureRunner

pytest_plugins = [
    "tests.support.marks",
    "tests.support.measuring",
    "tests.support.since",
    "tests.support.front_door",
    "tests.support.served_cell",
]

boundary.RAISES = True
# A defect of the screen fails the test that meets it.

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# A test run starts hundreds of processes: without kept bytecode each of them compiles every module.

signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
# A test run in the background ignores both signals, and would pass that on to programs that must obey them.

settings.register_profile(
    "steady", max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("quick", settings.get_profile("steady"), max_examples=15)
settings.register_profile("search", max_examples=300, deadline=None)
settings.load_profile("steady")
# A busy machine is not a defect. The same cases run every time; `--hypothesis-profile=search` looks for new ones.

FOLDERS = itertools.count()
WORDS = {True: "true", False: "false"}


class Bench:
    """A line connected to a simulated wire. `written` and `strays` record what passed."""

    def __init__(self, drives: list[dict[str, Any]], baud: int = 0, timeout: float = 1.0, **faults: Any) -> None:
        text = f'[[bus]]\nname = "bench"\nbaud = {baud}\n'
        for drive in drives:
            drive = {"personality": "LMDCM", **drive}
            text += "[[bus.drive]]\n" + "".join(f"{key} = {self._toml(value)}\n" for key, value in drive.items())
        self.floor = Floor(read(text, "bench.toml"))
        self.wire = self.floor.wires["bench"]
        if faults:
            disturb(self.wire, Faults(**faults))
        self.line = Line(MCode(), baud=baud, timeout=timeout)
        self.now = 0.0
        self.written: list[bytes] = []
        self.strays: list[str] = []
        self.notes: list[str] = []
        self.ended: list[Finished] = []

    @classmethod
    def _toml(cls, value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{k} = {cls._toml(v)}" for k, v in value.items()) + " }"
        return WORDS[value] if isinstance(value, bool) else f"'''{value}'''" if isinstance(value, str) else str(value)

    @property
    def devices(self) -> dict[str, Any]:
        """The simulated drives by name."""
        return {placed.spec.name: placed.device for placed in self.floor.drives}

    def events(self) -> list[Finished]:
        """Do what the line says; return the requests that ended."""
        ended = []
        for event in self.line.events(self.now):
            if isinstance(event, Write):
                self.written.append(event.data)
                self.wire.receive(event.data, self.now)
            elif isinstance(event, Unsolicited):
                self.strays.extend(event.lines)
            elif isinstance(event, Finished):
                ended.append(event)
        self.ended += ended
        return ended

    def step(self, until: float) -> list[Finished]:
        """Advance to the next event, at most to `until`."""
        times = [t for t in (self.line.deadline, self.wire.deadline) if t is not None]
        self.now = max(self.now, min([until, *times]))
        if data := self.wire.advance(self.now):
            self.line.receive(data, self.now)
        return self.events()

    def wait(self, seconds: float) -> None:
        """Advance the time."""
        until = self.now + seconds
        while self.now < until:
            self.step(until)

    def run(
        self, procedure: Procedure[Any], state: DriveState | None = None, at: Callable[[Bench], None] | None = None
    ) -> Any:
        """Run a conversation to its end; call `at` before every step."""
        runner = ProcedureRunner(procedure)
        while (request := runner.request) is not None:
            ticket, reply = self.line.ask(request), None
            ended = self.events()
            while reply is None:
                reply = next((e.reply for e in ended if e.ticket == ticket), None)
                if reply is None:
                    if at:
                        at(self)
                    ended = self.step(self.now + 100.0)
            self._answer(runner, reply)
            if state:
                self.notes += state.take_messages()[0]
        return runner.result

    @staticmethod
    def _answer(runner: ProcedureRunner[Any], reply: Reply) -> None:
        if reply.end is End.STOPPED:
            runner.fail(Stopped("stopped"))
        else:
            runner.answer(reply)

    def type(self, state: DriveState, text: str) -> tuple[str, ...]:
        """Type a line to a drive; return what it printed."""
        return tuple(self.run(family_of(state).perform(text), state))


@pytest.fixture(scope="session")
def _states(tmp_path_factory):
    """The folder of all state folders."""
    return tmp_path_factory.mktemp("states")


@pytest.fixture(autouse=True)
def _state_folder(_states, request):
    """A state folder and a data folder for each test, created on first use."""
    folder = f"{_states}/{zlib.crc32(request.node.nodeid.encode()):08x}"
    os.environ["MULTIDROP_STATE_DIR"], os.environ["MULTIDROP_DATA_DIR"] = folder, f"{folder}-data"


@pytest.fixture
def tmp_path(tmp_path_factory):
    """A new folder, with a number for a name. Pytest's own lists all folders and sets a link, 2 ms for each test."""
    return tmp_path_factory.mktemp(str(next(FOLDERS)), numbered=False)


if sys.platform == "win32":

    @pytest.fixture(autouse=True)
    def _own_configuration(tmp_path_factory, monkeypatch):
        """A folder of its own for what a person configures: Windows asks no HOME and no XDG_CONFIG_HOME."""
        for name in ("APPDATA", "LOCAL_APPDATA"):
            monkeypatch.setenv(f"WIN_PD_OVERRIDE_{name}", str(tmp_path_factory.mktemp(name.lower())))


@pytest.fixture
def bench() -> type[Bench]:
    """The class; its argument is drives as tables of a cell file."""
    return Bench
