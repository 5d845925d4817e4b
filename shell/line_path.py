"""The way of a line to its drive, or to a port in raw mode: what it must pass, and what is noted of it."""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncIterator, Sequence

from multidrop.base.errors import Diagnostic, Refused, Stopped
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Check, Drive
from multidrop.macros.recorder import Recorded
from multidrop.shell import motions, travel
from multidrop.shell.automation import AGREED, Automations, only_ends
from multidrop.shell.events import FAILURES, By, Entered, Printed
from multidrop.shell.line_syntax import EVERYONE, DriveLine, join_target
from multidrop.shell.origin import Origin
from multidrop.shell.program_listing import ListingSight
from multidrop.shell.raw import RawLine, text_of
from multidrop.shell.sending import sending
from multidrop.shell.units import SessionUnits
from multidrop.shell.workspace import LATCHED, Workspace

_MAYBE_QUANTITY = re.compile(r"[{}]|\d ?[A-Za-z]\w*(?:/\w+)?(?![\w/])")
"""Matches each line that may hold a number with a unit, and few others: most lines go without `units`."""


class LinePath:
    """The way of one line of a session to a drive, or to a port in raw mode."""

    def __init__(self, workspace: Workspace, automations: Automations, units: SessionUnits) -> None:
        self._workspace, self._automations, self._units = workspace, automations, units

    async def text(self, parsed: DriveLine, origin: Origin) -> None:
        """Send a text to its drive and publish what it prints; on a bus in raw mode send it with its terminator."""
        bus = self._workspace.bus(origin.bus_of_role(parsed.bus))
        if (raw := self._workspace.of(bus).raw) is not None:
            return await self._raw_text(raw, parsed, origin)
        drive = self._workspace.drive(bus.name, parsed.address)
        passage = LinePassage(self, self._workspace, self._automations, self._units, bus, drive, parsed, origin)
        await passage.run()

    async def _raw_text(self, raw: RawLine, parsed: DriveLine, origin: Origin) -> None:
        by = origin.by
        workspace, name, typed = self._workspace, raw.bus.name, parsed.typed.strip()
        if by is By.MACRO:
            raise Diagnostic(f"{name} is raw: a macro's lines are for drives", typed, "/raw off finds them")
        if parsed.address is not None:
            hint = f"@{name}: TEXT sends text; /raw off finds the drives"
            raise Diagnostic(f"{name} is raw: it has no address {parsed.address}", typed, hint)
        workspace.publish(Entered(workspace.now(), typed, by, name), origin)
        self.check_latch(by)
        await self.ask_about_doubts([raw.bus], by)
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
        self.check_latch(origin.by)
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

    async def ask_about_doubts(self, buses: Sequence[Bus], by: By) -> None:
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
        """Record what is sent to a drive in the body of this context, and that it may start motion or a program.

        `text`: the line that is sent; without it, what is sent may start anything. `parts`: it is sent as several
        requests, so after a refusal some may have been executed. Raises Unreferenced, Diagnostic or Stopped before
        anything is sent, where it must not start the drive, and what the body raises.
        """
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

    def check_latch(self, by: By) -> None:
        """Raise Stopped after a stop, but not for an operator's line."""
        if self._workspace.latched and by is not By.OPERATOR:
            raise Stopped(LATCHED)


class LinePassage:
    """One line on its way to its drive, in the stages of `run`. Each may refuse it by what it raises."""

    def __init__(
        self,
        path: LinePath,
        workspace: Workspace,
        automations: Automations,
        units: SessionUnits,
        bus: Bus,
        drive: Drive,
        parsed: DriveLine,
        origin: Origin,
    ) -> None:
        self._path, self._workspace, self._automations, self._units = path, workspace, automations, units
        self._bus, self._drive, self._parsed, self._origin = bus, drive, parsed, origin
        self._text = parsed.text
        """What is sent: the line, with the drive's own numbers once it is converted."""
        self._check: Check | None = None
        """What is read right before it is sent: whether the scale of its numbers still holds."""
        self._quantities = ""
        """Its quantities and the numbers that they became, for a person."""

    async def run(self) -> None:
        self._enter()
        stops = self._drive.stops
        await self._resolve_doubt()
        await self._convert()
        await self._agree()
        if self._drive.stops != stops:
            raise Stopped(f"a stop came before '{self._text.strip()}' was sent")
        starts = self._drive.starts(self._text)
        recorded = self._note(starts)
        try:
            printed = await self._send(starts)
        except FAILURES as failure:
            if recorded is not None:
                recorded.came_back([f"failed: {failure}"])
            raise
        if recorded is not None:
            recorded.came_back(printed)
        await self._show(printed)

    def _enter(self) -> None:
        """Publish the line. Raises Stopped after a stop."""
        workspace, typed = self._workspace, self._parsed.typed.strip()
        entered = Entered(workspace.now(), typed, self._origin.by, self._bus.name, self._drive.address)
        workspace.publish(entered, self._origin)
        self._path.check_latch(self._origin.by)

    async def _resolve_doubt(self) -> None:
        """Ask once where names, units or guards may not be in force, but for a line that only reads."""
        doubt = self._workspace.doubted or self._workspace.of(self._bus).doubt
        if doubt and not _only_reads(self._drive, self._text):
            await self._path.ask_about_doubts([self._bus], self._origin.by)

    async def _convert(self) -> None:
        """Make the drive's own numbers of quantities, and ask about a move that leaves its travel."""
        if self._workspace.scaled or _MAYBE_QUANTITY.search(self._text):
            line = await self._units.line(self._drive, self._text)
            self._text, self._check, self._quantities = line.text, line.check, line.values
            self._drive.check_line(self._text)
            await travel.ask(self._units, self._drive, self._text, self._origin)

    async def _agree(self) -> None:
        """Check what the drive takes, and ask before a guarded line."""
        self._drive.check_line(self._text)
        await self._path.guard(self._drive, self._text, self._origin.by)

    def _note(self, starts: bool) -> Recorded | None:
        """Record the line, and note that its drive was addressed and whether its program changes."""
        workspace, drive, parsed = self._workspace, self._drive, self._parsed
        recorded = None
        if self._origin.by is not By.MACRO:
            target = workspace.qualified_address(drive)
            typed = f"@{target} {parsed.text}" if target else parsed.text
            place = join_target(self._bus.name, drive.address)
            recorded = workspace.recorder.record(typed, workspace.now(), place, starts)
        if workspace.recording:
            workspace.changed()
        workspace.addressed.add((self._bus.name, drive.address))
        workspace.lately.begin(self._origin)
        if _changes_program(drive, self._text):
            ListingSight(workspace, drive).changes()
        return recorded

    async def _send(self, starts: bool) -> Sequence[str]:
        """Send it; return what the drive prints. A quantity is shown with its number once anything was sent."""
        drive, text, workspace = self._drive, self._text, self._workspace
        before = drive.commands
        try:
            ends = only_ends(drive, text)
            async with sending(self._automations, self._origin, drive, text, starts=starts, only_ends=ends):
                return await motions.send(workspace, self._origin, drive, text, self._check)
        finally:
            if self._quantities and drive.commands != before:
                workspace.notify(f"{text.strip()}   {self._quantities}", bus=self._bus.name)

    async def _show(self, printed: Sequence[str]) -> None:
        """Publish what the drive printed, and look at what the line may have changed."""
        workspace, bus, drive = self._workspace, self._bus, self._drive
        if drive.address not in (*EVERYONE, *bus.drives):
            bus.drives[drive.address] = drive  # it replied, so it exists: a stop and a wait must know it
            workspace.changed()
        for each in printed:
            workspace.publish(Printed(workspace.now(), bus.name, drive.address, each, self._origin.by), self._origin)
        if workspace.scaled:
            await self._units.look(drive, self._text)


def _only_asks(drive: Drive, text: str) -> bool:
    return drive.family.only_reads(text)


def _only_reads(drive: Drive, text: str) -> bool:
    return not drive.stores and (drive.family.only_reads(text) or drive.family.only_ends(text))


def _changes_program(drive: Drive, text: str) -> bool:
    """Whether a line is stored in a program, begins or ends one, or erases all of them."""
    programs = drive.family.programs
    word = (text.split() or [""])[0].upper()
    return programs is not None and bool(word) and (drive.programming or word in (programs.clearing, *programs.begins))
