"""Whether scales still hold: what they rest on is read again where something may have changed it."""

from __future__ import annotations

import asyncio
import re
from contextlib import suppress
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from multidrop.base.errors import DriveError, TransportLost
from multidrop.dialects import Priority
from multidrop.drives.events import Sample
from multidrop.drives.recount import recount
from multidrop.shell.events import OnBus, SessionEvent, SettingsRead
from multidrop.shell.line_syntax import EVERYONE

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.workspace import Workspace

LOOK_PERIOD = 2.0
"""Seconds between two attempts to read what a scale rests on that may not hold, while its drive is polled."""


class ScaleChecks:
    """The checks of one session. A drive whose conditions are watched is read by its telemetry, too."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._looks: WeakKeyDictionary[Drive, tuple[float, asyncio.Task[None]]] = WeakKeyDictionary()
        workspace.subscribe(self._settings_read, SettingsRead)
        workspace.subscribe(self._sampled, Sample)

    async def look(self, drive: Drive, text: str = "") -> None:
        """Read again what the scales of a drive rest on if a line named one of the settings, or may have changed one.

        An empty text: in any case. What cannot be read is not known, so the drive's own numbers are shown.
        """
        bus = self.workspace.buses.get(drive.link.name)
        meant = bus.all_drives if bus is not None and drive.address in EVERYONE else [drive]
        for other in meant if not drive.programming else ():
            named = not text or any(re.search(rf"\b{name}\b", text, re.I) for name in other.counting.names)
            if other.counting.axes and (named or not other.counting.read_since(other.state.recounts)):
                with suppress(DriveError, TransportLost):
                    await recount(other)
                self.workspace.changed()

    def _settings_read(self, event: SessionEvent) -> None:
        """Take no scale to hold that settings which were read contradict."""
        bus = self.workspace.buses.get(event.bus) if isinstance(event, SettingsRead) else None
        drive = bus.drives.get(event.address) if bus is not None and isinstance(event, SettingsRead) else None
        if drive is None or not isinstance(event, SettingsRead):
            return
        if drive.counting.contradicted(event.readings.values, drive.family.units):
            drive.state.counts_may_have_changed()

    def _sampled(self, event: SessionEvent) -> None:
        """Read again what scales rest on that may not hold, of a drive that is polled: noise or a loss came between."""
        if not isinstance(event, OnBus) or not isinstance(event.event, Sample):
            return
        bus = self.workspace.buses.get(event.bus)
        drive = bus.drives.get(event.event.address) if bus is not None else None
        if drive is None or drive.counting.read_since(drive.state.recounts) or drive.programming:
            return
        looked = self._looks.get(drive)
        if looked is None or (looked[1].done() and event.event.at - looked[0] >= LOOK_PERIOD):
            self._looks[drive] = event.event.at, asyncio.get_running_loop().create_task(self._recount(drive))

    async def _recount(self, drive: Drive) -> None:
        with suppress(DriveError, TransportLost):
            await recount(drive, Priority.POLL)
