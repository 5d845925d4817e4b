"""The twins of a session: they begin, end, and begin again after a loss; and the messages about them."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.shell.comparing.differences import DIFFERENCE_LIMIT
from multidrop.shell.events import FAILURES, Agreed, Diverged, OnBus, TwinEvent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive
    from multidrop.features.twins.pair import BusTwins
    from multidrop.shell.session import Session
    from multidrop.shell.workspace import Workspace


def begin(session: Session) -> None:
    """Let a session have twins: they begin where they are wanted, and end with their bus."""
    twins = Twins(session, partial(_apart, session))
    session.hooks.keep(twins)
    session.hooks.changed.append(twins.changed)
    session.hooks.identified.append(twins.identified)
    session.hooks.forgotten.append(twins.stop)


def _apart(session: Session, drive: Drive, axis: str, steps: int) -> str:
    """A distance of an axis in its unit, ` (0.5 mm)`; empty where it has no scale."""
    from multidrop.shell.setting_units import distance

    length = distance(session, drive, axis, steps) if session.scaled else ""
    return f" ({length})" if length else ""


class Twins:
    """The twins of all buses. Their code is imported, and a drive read, only once the first one begins."""

    def __init__(self, workspace: Workspace, in_units: Callable[[Drive, str, int], str]) -> None:
        """`in_units`: a distance of an axis of a drive in its unit, ` (0.5 mm)`; empty: it has none."""
        self._in_units = in_units
        self.wanted = False
        """Each bus whose drives are found gets twins."""
        self._workspace = workspace
        self._rest = DIFFERENCE_LIMIT
        self._buses: dict[Bus, BusTwins] = {}
        self._paused: dict[Bus, list[str]] = {}
        """The addresses of the twins that a loss has ended, by bus."""
        self._said: set[tuple[str, str]] = set()
        """The gaps of twins that were reported, with the name of the drive."""
        self._tasks: dict[Bus, asyncio.Task[None]] = {}

    @property
    def limit(self) -> int:
        return self._rest

    @limit.setter
    def limit(self, steps: int) -> None:
        self._rest = steps
        for bus in self._buses.values():
            bus.set_limit(steps)

    async def start(self, bus: Bus, addresses: Sequence[str] | None = None) -> None:
        """Read drives of a bus (None: all), and begin a twin beside each, in place of one that runs.

        Raises DriveError, Diagnostic or TransportLost for the first that fails, once all have been tried; the others
        are warnings. A stop, or the end of the twins, ends the reading.
        """
        drives = [bus.drives[address] for address in (list(bus.drives) if addresses is None else addresses)]
        from multidrop.features.twins.pair import BusTwins

        if bus not in self._buses:
            publish, lost = partial(self._publish, bus), partial(self._lost, bus)
            self._buses[bus] = BusTwins(bus, self._rest, publish, lost)
        twins = self._buses[bus]
        failures: list[Exception] = []
        gaps: dict[str, list[str]] = {}
        try:
            for drive in drives:
                try:
                    for gap in await self._start(twins, drive):
                        gaps.setdefault(gap, []).append(self._workspace.display_name(drive))
                except (DriveError, Diagnostic) as failure:
                    failures.append(failure)
                    if isinstance(failure, Stopped):
                        break
        finally:
            if self._buses.get(bus) is twins and not twins.drives:
                self._end(bus)
            # Each gap is reported once; drives with an equal gap share a line.
            for gap, names in gaps.items():
                if fresh := [name for name in names if (name, gap) not in self._said]:
                    self._said |= {(address, gap) for address in fresh}
                    self._workspace.notify(f"twin of {', '.join(fresh)}: {gap}", bus=bus.name, outcome=True)
        for other in failures[1:]:
            self._workspace.notify(f"{bus.name}: no twin: {other}", bus=bus.name, warning=True)
        if failures:
            raise failures[0]

    def off(self) -> bool:
        """End all twins: those that run, are read, or wait for their line. Return whether there were any."""
        buses = list(dict.fromkeys((*self._buses, *self._paused, *self._tasks)))
        for bus in buses:
            self.stop(bus)
        self.wanted = False
        return bool(buses)

    def stop(self, bus: Bus) -> None:
        if task := self._tasks.pop(bus, None):
            task.cancel()
        self._paused.pop(bus, None)
        self._end(bus)

    def _end(self, bus: Bus) -> None:
        if (twins := self._buses.pop(bus, None)) is not None:
            self._workspace.predicted.discard(bus)
            twins.close()

    async def _start(self, twins: BusTwins, drive: Drive) -> tuple[str, ...]:
        """Read a drive, and run a twin beside it; return the gaps of the twin."""
        from multidrop.features.twins.pair import TwinPair
        from multidrop.features.twins.twin import make
        from multidrop.shell import snapshots

        name, bus = self._workspace.display_name(drive), twins.bus
        twins.expect(drive)
        try:
            snapshot = await snapshots.read(self._workspace, drive)
            if self._buses.get(bus) is not twins:
                raise Stopped(f"{name}: the twins were ended while it was read")
            if snapshot.active:
                raise DriveError(
                    f"{name}: it moves or a program runs, and a twin begins at rest; /twin on once it is at rest"
                )
            begun = bus.now()
            twin, gaps = make(snapshot, begun, drive.family.offers("registers"), len(bus.drives) == 1)
            twins.begin(TwinPair(drive, twin, begun))
            self._workspace.predicted.add(bus)
        finally:
            twins.forgo(drive)
        self._workspace.notify(f"{name}: a twin runs beside it", bus=bus.name, outcome=True)
        return gaps

    # Losses

    def identified(self, bus: Bus) -> None:
        """Note that the drives of a bus are found: begin their twins where they are wanted."""
        if self.wanted:
            self._begin(bus, None)

    def changed(self, bus: Bus) -> None:
        if bus.lost is None and bus in self._paused:
            paused = [address for address in self._paused.pop(bus) if address in bus.drives]
            self._begin(bus, paused)

    def _begin(self, bus: Bus, addresses: Sequence[str] | None) -> None:
        task = asyncio.get_running_loop().create_task(self._try(bus, addresses))
        self._tasks[bus] = task
        task.add_done_callback(lambda done: self._tasks.pop(bus) if self._tasks.get(bus) is done else None)

    async def _try(self, bus: Bus, addresses: Sequence[str] | None) -> None:
        try:
            await self.start(bus, addresses)
        except FAILURES as failure:
            self._workspace.notify(f"{bus.name}: no twin: {failure}", bus=bus.name, warning=True)

    def _lost(self, bus: Bus) -> None:
        addresses = [drive.address for drive in self._buses[bus].drives]
        self.stop(bus)
        self._paused[bus] = addresses
        back = "; they begin again once it is back" if self._workspace.reconnections.tries(bus.name) else ""
        self._workspace.notify(f"{bus.name}: its twins end with the line{back}", bus=bus.name, outcome=True)

    # Messages

    def rows(self) -> Iterator[str]:
        for twins in self._buses.values():
            for drive, beside in twins.besides.items():
                compared = beside.differences.items()
                apart = [f"{axis} {steps}".strip() for axis, steps in compared]
                units = [text.strip(" ()") for axis, steps in compared if (text := self._in_units(drive, axis, steps))]
                began = f"{self._workspace.wall(beside.begun):%H:%M:%S}"
                said = f"apart by {', '.join(apart)} steps" if apart else "not compared yet"
                said += f" ({', '.join(units)})" if units else ""
                why = f": {', '.join(beside.causes)}" if beside.causes else ""
                yield f"{self._workspace.display_name(drive)}: a twin since {began}, {said}{why}"

    def _publish(self, bus: Bus, event: TwinEvent) -> None:
        self._workspace.publish(OnBus(bus.name, event))
        if not isinstance(event, Diverged | Agreed):
            return
        name = self._workspace.display_name(bus.at(event.address))
        name = f"{name}.{event.axis}" if event.axis else name
        when = f"{self._workspace.wall(event.at):%H:%M:%S.%f}"[:-5]
        if isinstance(event, Agreed):
            what = f"its twin takes its position after {event.after}" if event.after else "agrees with its twin again"
            self._workspace.notify(f"{name}: {what}, {when}", bus=bus.name, outcome=True)
            return
        drive, steps = bus.at(event.address), abs(event.difference)
        units = self._in_units(drive, event.axis, steps)
        text = f"{name}: {steps} steps{units} from its twin since {when} (limit {event.limit})"
        place = self._workspace.qualified_address(bus.at(event.address))
        hint = f"/twin on {place} sets it again".replace("  ", " ")
        self._workspace.notify(f"{text}: {', '.join(event.causes)}; {hint}", bus=bus.name, warning=True)
