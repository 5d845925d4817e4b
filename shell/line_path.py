"""The way of a line to its drive, or to a port in raw mode: what it must pass, and what is noted of it."""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncIterator, Sequence

from multidrop.base.errors import Diagnostic, Refused, Stopped
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.shell import motions, travel
from multidrop.shell.automation import AGREED, Automations, only_ends
from multidrop.shell.events import FAILURES, By, Entered, Printed
from multidrop.shell.line_syntax import EVERYONE, DriveLine, join_target
from multidrop.shell.origin import Origin
from multidrop.shell.program_listing import Sight
from multidrop.shell.raw import RawLine, text_of
from multidrop.shell.sending import sending
from multidrop.shell.units import Units
from multidrop.shell.workspace import LATCHED, Workspace

_MAYBE_QUANTITY = re.compile(r"[{}]|\d ?[A-Za-z]\w*(?:/\w+)?(?![\w/])")
"""Matches each line that may hold a number with a unit, and few others: most lines go without `units`."""


class LinePath:
    """The way of one line of a session to a drive, or to a port in raw mode."""

    def __init__(self, workspace: Workspace, automations: Automations, units: Units) -> None:
        self._workspace, self._automations, self._units = workspace, automations, units

    async def text(self, parsed: DriveLine, origin: Origin) -> None:
        """Send a text to its drive and publish what it prints; on a bus in raw mode send it with its terminator."""
        workspace, by = self._workspace, origin.by
        bus = workspace.bus(origin.played(parsed.bus))
        if (raw := workspace.of(bus).raw) is not None:
            return await self._raw_text(raw, parsed, origin)
        drive = workspace.drive(bus.name, parsed.address)
        workspace.publish(Entered(workspace.now(), parsed.typed.strip(), by, bus.name, drive.address), origin)
        self.allow(by)
        text, check, values, stops = parsed.text, None, "", drive.stops
        if (workspace.doubted or workspace.of(bus).doubt) and not _only_reads(drive, text):
            await self.undoubted([bus], by)
        if workspace.scaled or _MAYBE_QUANTITY.search(text):
            line = await self._units.line(drive, text)
            text, check, values = line.text, line.check, line.values
            drive.check_line(text)
            await travel.ask(self._units, drive, text, origin)
        drive.check_line(text)
        await self.guard(drive, text, by)
        if drive.stops != stops:
            raise Stopped(f"a stop came before '{text.strip()}' was sent")
        recorded, starts = None, drive.starts(text)
        if by is not By.MACRO:
            target = workspace.qualified_address(drive)
            typed = f"@{target} {parsed.text}" if target else parsed.text
            recorded = workspace.recorder.record(typed, workspace.now(), join_target(bus.name, drive.address), starts)
        if workspace.recording:
            workspace.changed()
        workspace.addressed.add((bus.name, drive.address))
        workspace.lately.begin(origin)
        before = drive.commands
        if _changes_program(drive, text):
            Sight(workspace, drive).changes()
        try:
            ends = only_ends(drive, text)
            async with sending(self._automations, origin, drive, text, starts=starts, only_ends=ends):
                printed = await motions.send(workspace, origin, drive, text, check)
        except FAILURES as failure:
            if recorded is not None:
                recorded.came_back([f"failed: {failure}"])
            raise
        finally:
            if values and drive.commands != before:
                workspace.notify(f"{text.strip()}   {values}", bus=bus.name)
        if recorded is not None:
            recorded.came_back(printed)
        if drive.address not in (*EVERYONE, *bus.drives):
            bus.drives[drive.address] = drive  # it replied, so it exists: a stop and a wait must know it
            workspace.changed()
        for each in printed:
            workspace.publish(Printed(workspace.now(), bus.name, drive.address, each, by), origin)
        if workspace.scaled:
            await self._units.look(drive, text)

    async def _raw_text(self, raw: RawLine, parsed: DriveLine, origin: Origin) -> None:
        by = origin.by
        workspace, name, typed = self._workspace, raw.bus.name, parsed.typed.strip()
        if by is By.MACRO:
            raise Diagnostic(f"{name} is raw: a macro's lines are for drives", typed, "/raw off finds them")
        if parsed.address is not None:
            hint = f"@{name}: TEXT sends text; /raw off finds the drives"
            raise Diagnostic(f"{name} is raw: it has no address {parsed.address}", typed, hint)
        workspace.publish(Entered(workspace.now(), typed, by, name), origin)
        self.allow(by)
        await self.undoubted([raw.bus], by)
        await self.guard(raw.bus.at(""), parsed.text, by)
        starts = raw.bus.roster.family.codec.starts_motion(parsed.text)
        await self.send_bytes(raw.bus, raw.encoded(parsed.text), origin, starts)
        if workspace.recording and by is By.OPERATOR:
            workspace.notify("text in raw mode is not recorded", warning=True)

    async def send_bytes(self, bus: Bus, data: bytes, origin: Origin, starts: bool = True) -> None:
        """Write bytes on a bus in raw mode: once, unchanged. Raises Diagnostic where it is not in raw mode.

        `starts`: they can start motion or a program.
        """
        raw = self._workspace.of(bus).raw
        if raw is None:
            raise Diagnostic(f"{bus.name} is not in raw mode; nothing was sent", "", "/raw on begins it")
        self.allow(origin.by)
        await self.agreed_to_write(bus.at(""), text_of(data), origin.by)
        if starts:
            self._automations.starts(origin, raw.everyone)
        raw.send(data)

    async def guard(self, drive: Drive, text: str, by: By = By.OPERATOR) -> None:
        """Ask before a guarded line. Raises Diagnostic where it is not agreed to, and by a script or a macro."""
        if drive.stores:
            return
        if drive.state.stranger and not _only_asks(drive, text):
            await self.agreed_to_write(drive, text.strip(), by)
        what = self._workspace.settings.guards.what(drive.family, text)
        if what:
            await self._workspace.questions.confirm(what, self._workspace.display_name(drive), by=by)

    async def agreed_to_write(self, drive: Drive, what: str, by: By) -> None:
        """Let only a person, or who agreed beforehand, write to a device that did not identify itself.

        Raises Diagnostic for a script, a macro, and lines of a front end that cannot ask.
        """
        if drive.state.stranger and not (by is By.OPERATOR and self._workspace.front.ask is not None):
            name = self._workspace.display_name(drive)
            writes = f"'{what}' writes" if what else "it writes"
            await self._workspace.questions.confirm(f"{writes}, and {drive.state.stranger}", name, by=by)

    async def undoubted(self, buses: Sequence[Bus], by: By) -> None:
        """Ask once for each line that lacks names, units or guards. Raises Diagnostic where that is not agreed to.

        Also raises it while the stop key is doubted.
        """
        if self._workspace.doubted:
            raise Diagnostic(self._workspace.doubted, hint=f"press Ctrl+X once; {AGREED}")
        stops = self._workspace.stops
        for record in map(self._workspace.of, buses):
            if record.doubt:
                what = f"it is read only, as names, units or guards are not in force: {record.doubt}; go on anyway"
                await self._workspace.questions.confirm(what, record.bus.name, by=by)
                record.doubt = ""
        if stops != self._workspace.stops:
            raise Stopped("a stop came before the answer counted; nothing was sent")

    @contextlib.asynccontextmanager
    async def starting(
        self, origin: Origin, drive: Drive, text: str = "", *, parts: bool = False
    ) -> AsyncIterator[None]:
        """Send in the body a line, or what can start anything in a drive. `parts`: it is several requests."""
        if text and not drive.starts(text):
            async with sending(self._automations, origin, drive, text, starts=False, parts=parts):
                yield
            return
        drive.check_start(text)
        if self._workspace.scaled:
            travel.unchecked(self._units, drive, text)
        self._workspace.addressed.add((drive.link.name, drive.address))
        if not text:  # a program may be among it
            drive.motions.runs()
        before = drive.commanded_at
        async with sending(self._automations, origin, drive, text, starts=True, parts=parts):
            drive.starts_now()
            noted = drive.commanded_at
            try:
                yield
            except Refused as refusal:
                if refusal.certain and not parts and drive.commanded_at == noted:
                    drive.commanded_at = before
                raise

    def allow(self, by: By) -> None:
        """Raise Stopped after a stop, but not for an operator's line."""
        if self._workspace.latched and by is not By.OPERATOR:
            raise Stopped(LATCHED)


def _only_asks(drive: Drive, text: str) -> bool:
    return drive.family.only_reads(text)


def _only_reads(drive: Drive, text: str) -> bool:
    return not drive.stores and (drive.family.only_reads(text) or drive.family.only_ends(text))


def _changes_program(drive: Drive, text: str) -> bool:
    """Whether a line is stored in a program, begins or ends one, or erases all of them."""
    programs = drive.family.programs
    word = (text.split() or [""])[0].upper()
    return programs is not None and bool(word) and (drive.programming or word in (programs.clearing, *programs.begins))
