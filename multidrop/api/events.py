"""Events of drives and their lines, as a program takes them: `for event in session.events()`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from multidrop.api.streams import AsyncStream
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.drive import Drive
from multidrop.drives.events import Changed, Conditioned, Lost
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session
from multidrop.shell.workspace import address_of

Kind = Literal["limit", "error", "program ended", "lost", "back"]
LIMITS = {"lim+": "the plus limit is reached", "lim-": "the minus limit is reached"}


@dataclass(frozen=True)
class Fault:
    """The error of a drive. It reads as its text."""

    code: int | None
    """Its number; None: reading it would clear it, which `read_error` does."""
    text: str

    def __str__(self) -> str:
        return self.text


def fault_of(found: Conditions) -> Fault | None:
    """The error that conditions report; None: there is none."""
    if found.error == UNREAD:
        if found.cause and found.cause == found.error_text:
            return Fault(None, found.cause)  # of a family whose errors have no numbers
        return Fault(None, f"{found.cause or 'an error is set'}; read_error() reads and clears its number")
    return Fault(found.error, found.error_text or f"error {found.error}") if found.error else None


@dataclass(frozen=True)
class Event:
    """Something that happened. It reads as one line."""

    kind: Kind
    """`limit`, `error` and `program ended` are of a drive, `lost` and `back` of a line."""
    name: str
    """The drive, with the axis where it has several, or the line."""
    text: str
    time: float
    """Time of day, seconds since 1970."""

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


class AsyncEvents(AsyncStream[Event]):
    """Events from now until `close` or the end of the session. Limits and errors that are there already come first.

    The conditions of the drives are read while it is open, as they report nothing by themselves.
    """

    def __init__(self, shell: Session, drives: Sequence[Drive], every: float) -> None:
        self._drives = {(drive.link.name, drive.address): drive for drive in drives}
        self._state: dict[str, frozenset[tuple[Kind, str]]] = {}
        self._running: dict[str, str] = {}
        buses = dict.fromkeys(bus for bus, _ in self._drives)
        self._away = {bus for bus in buses if shell.buses[bus].link.away is not None}
        super().__init__(
            shell,
            [
                shell.buses[bus].telemetry.watch([own for name, own in self._drives if name == bus], every)
                for bus in buses
            ],
        )

    def _take(self, event: SessionEvent) -> None:
        bus = self._shell.buses.get(event.bus) if isinstance(event, OnBus) else None
        if bus is None or not isinstance(event, OnBus) or all(each != event.bus for each, _ in self._drives):
            return
        if isinstance(event.event, Conditioned):
            drive = self._drives.get((event.bus, event.event.address))
            if drive is not None:
                for condition in event.event.conditions:
                    self._compare(f"{address_of(self._shell, drive)} {condition.axis}".strip(), condition)
        elif isinstance(event.event, Lost):
            self._away.add(event.bus)
            self._publish("lost", event.bus, str(event.event.error))
            if not any(self._shell.reconnections.tries(each) or each not in self._away for each, _ in self._drives):
                self._end(StopAsyncIteration())
        elif isinstance(event.event, Changed) and event.bus in self._away and bus.link.away is None:
            self._away.discard(event.bus)
            self._publish("back", event.bus, "the line is back")

    def _compare(self, name: str, now: Conditions) -> None:
        """Publish what is new: a limit, an error, the end of a program."""
        limits = [LIMITS[lamp.function] for lamp in now.lamps if lamp.on and lamp.function in LIMITS]
        kinds: dict[tuple[Kind, str], str] = {("limit", limit): limit for limit in limits}
        if (fault := fault_of(now)) is not None:
            kinds["error", str(fault.code)] = fault.text  # the same error, whatever more is known of it later
        for (kind, which), text in sorted(kinds.items()):
            if (kind, which) not in self._state.get(name, frozenset()):
                self._publish(kind, name, text)
        if not now.program and (ended := self._running.get(name)):
            self._publish("program ended", name, f"its program has ended ({ended})")
        self._state[name], self._running[name] = frozenset(kinds), now.program

    def _publish(self, kind: Kind, name: str, text: str) -> None:
        self._add(Event(kind, name, text, self._shell.wall(self._shell.now()).timestamp()))
