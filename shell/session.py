"""The session: a workspace and the one path of a command through it.

A front end holds one `Session`, passes it typed lines, and shows the events that it publishes. It adds nothing of its
own. Buses and drives belong to `drives`, macros to `macros`, verbs to `shell.verbs`.

A verb, a script, a macro or a wait runs as a task that the stop ends; its caller gets Stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator, Iterator, Sequence
from contextvars import ContextVar
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic, DriveError, Refused, Stopped
from multidrop.base.on_demand import imported
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Restarted
from multidrop.shell import motions
from multidrop.shell.automation import AGREED, ENDING, Automations, only_ends
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import Opener, open_buses
from multidrop.shell.events import FAILURES, By, Entered, Failed, OnBus, Printed, SessionEvent
from multidrop.shell.line_syntax import (
    EVERYONE,
    DriveLine,
    Place,
    TypedLine,
    VerbLine,
    join_target,
    parse,
    split_target,
)
from multidrop.shell.openings import Failed as OpeningFailed
from multidrop.shell.openings import Openings
from multidrop.shell.operations.table import find
from multidrop.shell.playing import played_by
from multidrop.shell.quitting import ENDING as QUITTING
from multidrop.shell.quitting import EVEN_NOW, Unanswered
from multidrop.shell.raw import RawLine, text_of
from multidrop.shell.sending import sending
from multidrop.shell.waits import in_motion
from multidrop.shell.workspace import LATCHED, Workspace

if TYPE_CHECKING:
    from multidrop.shell.units import Units

_MAYBE_QUANTITY = re.compile(r"[{}]|\d ?[A-Za-z]\w*(?:/\w+)?(?![\w/])")
"""Matches each line that may hold a number with a unit, and few others: most lines go without `units`."""
_published: ContextVar[list[BaseException] | None] = ContextVar("published", default=None)
"""The failures published in this task's outermost `run`."""
BARE_WORDS = {"exit": "/quit", "quit": "/quit", "help": "/help", "?": "/help"}
TRAVEL = "multidrop.shell.travel:ask"
SIGHT = "multidrop.shell.program_listing:Sight"


def bare(word: str) -> Diagnostic:
    """The refusal of a bare word where nobody types."""
    return Diagnostic(f"not a command of a drive: '{word}'; nothing was sent", hint=f"{BARE_WORDS[word]} is the verb")


CALL = "multidrop.shell.verbs.call:Call"
BEGIN = "multidrop.shell.hooks:begin"
"""One use of a verb; it knows this class, so this module has only its name."""


def _units(session: Session) -> Units:
    made: Units = imported("multidrop.shell.units:Units")(session)
    return made


def _forget_restarted(session: Session, event: SessionEvent) -> None:
    """Forget the program and the settings that were read of a drive that was restarted, or may have been."""
    if isinstance(event, OnBus) and isinstance(event.event, Restarted) and event.bus in session.buses:
        drive = session.buses[event.bus].drives.get(event.event.address)
        if drive is not None:
            imported("multidrop.shell.program_listing:forget")(session, drive)


class Session(Workspace):
    """Everything that is open, and the path of a command. Needs a running event loop, and belongs to its thread."""

    units = cached_property(_units)
    """The scales of axes, and quantities in lines. Few sessions need it."""

    def __init__(
        self,
        settings: Settings | None = None,
        opener: Opener | None = None,
        *,
        lazy: bool = False,
        reconnect: bool = False,
        raw: bool = False,
        tried: Sequence[str] = (),
    ) -> None:
        """Open nothing yet.

        `lazy`: each line will name one drive, which may be found out as the line comes. `reconnect`: a bus that is
        lost is tried again until it is back or closed. `raw`: `open_all` looks for no drives. `tried`: addresses
        (ADDR or BUS:ADDR) that the command line mentions, which are looked for where a URL states no drives.
        """
        super().__init__(settings or Settings(), reconnect)
        self.automations = Automations(self)
        self.unanswered = Unanswered()
        self.path = LinePath(self)
        self.openings = Openings(self, opener or partial(open_buses, state=self.settings.state), lazy, raw, tried)
        self._background: dict[asyncio.Task[Any], None] = {}
        self.on_opened.append(lambda bus: self.units.opened(bus))
        self.subscribe(partial(_forget_restarted, self), Restarted)
        for text in imported(BEGIN)(self):
            asyncio.get_running_loop().call_soon(partial(self.notify, text, warning=True))

    # Buses

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> list[Bus]:
        """Open a URL or saved connection and find its drives; `sim:` may open several buses. Moves nothing.

        `raw`: look for no drives.

        Raises Diagnostic for a wrong URL, Unreachable (a TransportLost) where there is no connection, DriveError
        where drives that the URL names do not reply.
        """
        return await self.openings.open(url, name, raw=raw)

    async def open_all(self, urls: Sequence[str], failed: OpeningFailed | None = None) -> None:
        """Open several URLs side by side; the buses keep their order, and the first of them is selected.

        A failure goes to `failed` with the number of its URL, and the others go on. Without `failed` it ends the
        others and is raised.
        """
        await self.openings.open_all(urls, failed)

    async def close(self) -> None:
        """Close everything: tasks, plots, log, buses. Moves nothing, stops no drive. May be called again."""
        if self.recording:
            from multidrop.shell.macro_arguments import keep_unended

            self.notify(keep_unended(self), warning=True)
        for task in [*self._background]:
            task.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        for plot in list(self.plots):
            with contextlib.suppress(Diagnostic):  # published when the plot failed
                await plot.end()
        if self.log is not None:
            self.log.close()
            self.log = None
        for bus in list(self.buses.values()):
            await self.forget(bus)

    # The path of a command

    async def run(self, line: str | TypedLine, by: By = By.OPERATOR, since: int | None = None) -> None:
        """Run one line, as typed or parsed before, and publish what it prints.

        `since` is the value of `stops` when the line was typed; a line older than the last stop is refused with
        Stopped. Raises DriveError, Diagnostic or TransportLost, after one Failed event.
        """
        if self.front.ready is not None:
            await self.front.ready()
        target, place = DriveLine(""), self.place
        typed = line if isinstance(line, str) else line.typed
        with self.under_way(f"running {typed.strip()}"), _published_failures() as published:
            try:
                if since is not None and since != self.stops:
                    raise Stopped(f"a stop came after '{typed.strip()}' was typed; it was not sent")
                if self.quitting and by is By.OPERATOR and typed.strip() != EVEN_NOW:
                    raise Diagnostic(f"{QUITTING}, so '{typed.strip()}' was not sent")
                parsed = _raw_line(self, line) or (parse(line) if isinstance(line, str) else line)
                if isinstance(parsed, DriveLine):
                    parsed = self.path.meant(parsed, by)
                if isinstance(parsed, DriveLine):
                    target = parsed
                    with self.unanswered.sending(typed):
                        await self.path.text(parsed, by)
                elif parsed is not None:
                    await self.path.verb(parsed, by)
            except FAILURES as failure:
                bus, address = _place_of(target, place)
                if (
                    failure not in published
                ):  # once, whatever lines (a macro's, the `/play` around it) it passes through
                    code = failure.code if isinstance(failure, Refused) else None
                    self.publish(Failed(self.now(), str(failure), bus, address, by, code))
                published.append(failure)
                if isinstance(failure, DriveError) and target.text and len(self.buses) > 1:
                    failure.add_note(bus)
                raise

    def enter_alone(self) -> str:
        """The line that Enter alone stands for: in raw mode the end of a line, which wakes many a device.

        On a line where no drive has replied, it is the search for drives.
        """
        raw, bus = self.raw.get(self.selected_bus), self.buses.get(self.selected_bus)
        if raw is None and bus is not None and bus.silent:
            return "/scan"
        return f"/bytes {raw.end.hex(' ').upper()}" if raw is not None and raw.end else ""

    def start(self, line: str | TypedLine, by: By = By.OPERATOR, since: int | None = None) -> asyncio.Task[bool]:
        """Run one line in the background; the task returns whether it succeeded. A failure is published only.

        `since` as for `run`; by default the line counts as typed now.
        """
        typed = self.stops if since is None else since

        async def succeeds() -> bool:
            try:
                await self.run(line, by, typed)
            except FAILURES:
                return False  # published as a Failed event
            return True

        task = asyncio.get_running_loop().create_task(succeeds())
        self._background[task] = None
        task.add_done_callback(self._background.pop)
        return task

    # The end

    def interrupt(self) -> None:
        """End everything that runs, and stop at once the drives that automation started. Does not latch."""
        self.automations.interrupt()
        self.tasks.cancel()
        self.questions.open.cancel()

    async def in_motion(self) -> list[str]:
        """A line for each drive that moves or may move, and for each line that was sent and is not answered in time.

        It waits until what was stopped has ended and what was sent is answered, for the time-outs of the lines at
        most, and then reads for two seconds at most. A line whose question is open is not sent yet.
        """
        await self.tasks.stopped(ENDING)
        late: list[str] = []
        if not self.questions.open.busy:
            late = await self.unanswered.answered(max((bus.line.timeout for bus in self.buses.values()), default=0.0))
        return [*late, *await in_motion(self)]

    def quit(self) -> None:
        """Ask the front end to end; drives go on as they are. No line of a person is sent from here on."""
        self.quitting = True
        self.changed()


class LinePath:
    """The way of one line of a session to its verb, to a drive, or to a port in raw mode."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def meant(self, parsed: DriveLine, by: By) -> TypedLine:
        """The verb that a bare word of a person means (`exit`, `help`): a drive would take it for a wrong command.

        Program mode and raw mode take the word as it is. Raises Diagnostic where nobody types: in a script, a pipe.
        """
        session, word = self._session, parsed.typed.strip().lower()
        bus = session.buses.get(session.selected_bus)
        storing = session.selected is not None and session.selected.programming
        if word not in BARE_WORDS or storing or (bus is not None and session.of(bus).raw is not None):
            return parsed
        if by is By.OPERATOR and session.front.before_quit is not None:
            return VerbLine(BARE_WORDS[word], "", parsed.typed)
        raise bare(word)

    async def verb(self, parsed: VerbLine, by: By) -> None:
        """Run a verb, as a task that a stop ends."""
        session = self._session
        session.publish(Entered(session.now(), parsed.typed.strip(), by))
        verb = find(parsed.name)
        call = imported(CALL)(session, verb, parsed.rest, by, parsed.shown)
        self._allow(by)
        if call.changes:
            await self._undoubted([*session.buses.values()], by)
        if by is not By.MACRO and (line := call.recorded()) is not None:
            session.recorder.record(line, session.now())
        work = call.work()
        await (work if call.immediate else session.tasks.run(work))

    async def text(self, parsed: DriveLine, by: By) -> None:
        """Send a text to its drive and publish what it prints; on a bus in raw mode send it with its terminator."""
        session = self._session
        bus = session.bus(parsed.bus)
        if (raw := session.of(bus).raw) is not None:
            return await self._raw_text(raw, parsed, by)
        drive = session.drive(bus.name, parsed.address)
        session.publish(Entered(session.now(), parsed.typed.strip(), by, bus.name, drive.address))
        self._allow(by)
        text, check, values, stops = parsed.text, None, "", drive.stops
        if (session.doubted or session.of(bus).doubt) and not _only_reads(drive, text):
            await self._undoubted([bus], by)
        if session.scaled or _MAYBE_QUANTITY.search(text):
            line = await session.units.line(drive, text)
            text, check, values = line.text, line.check, line.values
            drive.check_line(text)
            await imported(TRAVEL)(session.units, drive, text, by)
        drive.check_line(text)
        await self.guard(drive, text, by)
        if drive.stops != stops:
            raise Stopped(f"a stop came before '{text.strip()}' was sent")
        recorded, starts = None, drive.starts(text)
        if by is not By.MACRO:
            target = session.qualified_address(drive)
            typed = f"@{target} {parsed.text}" if target else parsed.text
            recorded = session.recorder.record(typed, session.now(), join_target(bus.name, drive.address), starts)
        if session.recording:
            session.changed()
        session.addressed.add((bus.name, drive.address))
        session.lately.begin()
        before = drive.commands
        if _changes_program(drive, text):
            imported(SIGHT)(session, drive).changes()
        try:
            ends = only_ends(drive, text)
            async with sending(session.automations, drive, text, starts=starts, only_ends=ends):
                printed = await motions.send(session, drive, text, check)
        except FAILURES as failure:
            if recorded is not None:
                recorded.came_back([f"failed: {failure}"])
            raise
        finally:
            if values and drive.commands != before:
                session.notify(f"{text.strip()}   {values}", bus=bus.name)
        if recorded is not None:
            recorded.came_back(printed)
        if drive.address not in (*EVERYONE, *bus.drives):
            bus.drives[drive.address] = drive  # it replied, so it exists: a stop and a wait must know it
            session.changed()
        for each in printed:
            session.publish(Printed(session.now(), bus.name, drive.address, each, by))
        if session.scaled:
            await session.units.look(drive, text)

    async def _raw_text(self, raw: RawLine, parsed: DriveLine, by: By) -> None:
        session, name, typed = self._session, raw.bus.name, parsed.typed.strip()
        if by is By.MACRO:
            raise Diagnostic(f"{name} is raw: a macro's lines are for drives", typed, "/raw off finds them")
        if parsed.address is not None:
            hint = f"@{name}: TEXT sends text; /raw off finds the drives"
            raise Diagnostic(f"{name} is raw: it has no address {parsed.address}", typed, hint)
        session.publish(Entered(session.now(), typed, by, name))
        self._allow(by)
        await self._undoubted([raw.bus], by)
        await self.guard(raw.bus.at(""), parsed.text, by)
        starts = raw.bus.roster.family.codec.starts_motion(parsed.text)
        await self.send_bytes(raw.bus, raw.encoded(parsed.text), by, starts)
        if session.recording and by is By.OPERATOR:
            session.notify("text in raw mode is not recorded", warning=True)

    async def send_bytes(self, bus: Bus, data: bytes, by: By, starts: bool = True) -> None:
        """Write bytes on a bus in raw mode: once, unchanged. Raises Diagnostic where it is not in raw mode.

        `starts`: they can start motion or a program.
        """
        raw = self._session.of(bus).raw
        if raw is None:
            raise Diagnostic(f"{bus.name} is not in raw mode; nothing was sent", "", "/raw on begins it")
        self._allow(by)
        await self.agreed_to_write(bus.at(""), text_of(data), by)
        if starts:
            self._session.automations.starts(raw.everyone)
        raw.send(data)

    async def guard(self, drive: Drive, text: str, by: By = By.OPERATOR) -> None:
        """Ask before a guarded line. Raises Diagnostic where it is not agreed to, and by a script or a macro."""
        if drive.stores:
            return
        if drive.state.stranger and not _only_asks(drive, text):
            await self.agreed_to_write(drive, text.strip(), by)
        what = self._session.settings.guards.what(drive.family, text)
        if what:
            await self._session.questions.confirm(what, self._session.display_name(drive), by=by)

    async def agreed_to_write(self, drive: Drive, what: str, by: By) -> None:
        """Let only a person, or who agreed beforehand, write to a device that did not identify itself.

        Raises Diagnostic for a script, a macro, and lines of a front end that cannot ask.
        """
        if drive.state.stranger and not (by is By.OPERATOR and self._session.front.ask is not None):
            name = self._session.display_name(drive)
            writes = f"'{what}' writes" if what else "it writes"
            await self._session.questions.confirm(f"{writes}, and {drive.state.stranger}", name, by=by)

    async def _undoubted(self, buses: Sequence[Bus], by: By) -> None:
        """Ask once for each line that lacks names, units or guards. Raises Diagnostic where that is not agreed to.

        Also raises it while the stop key is doubted.
        """
        if self._session.doubted:
            raise Diagnostic(self._session.doubted, hint=f"press Ctrl+X once; {AGREED}")
        stops = self._session.stops
        for record in map(self._session.of, buses):
            if record.doubt:
                what = f"it is read only, as names, units or guards are not in force: {record.doubt}; go on anyway"
                await self._session.questions.confirm(what, record.bus.name, by=by)
                record.doubt = ""
        if stops != self._session.stops:
            raise Stopped("a stop came before the answer counted; nothing was sent")

    @contextlib.asynccontextmanager
    async def starting(self, drive: Drive, text: str = "", *, parts: bool = False) -> AsyncIterator[None]:
        """Send in the body a line, or what can start anything in a drive. `parts`: it is several requests."""
        if text and not drive.starts(text):
            async with sending(self._session.automations, drive, text, starts=False, parts=parts):
                yield
            return
        drive.check_start(text)
        if self._session.scaled:
            imported("multidrop.shell.travel:unchecked")(self._session.units, drive, text)
        self._session.addressed.add((drive.link.name, drive.address))
        if not text:  # a program may be among it
            drive.motions.runs()
        before = drive.commanded_at
        async with sending(self._session.automations, drive, text, starts=True, parts=parts):
            drive.starts_now()
            noted = drive.commanded_at
            try:
                yield
            except Refused as refusal:
                if refusal.certain and not parts and drive.commanded_at == noted:
                    drive.commanded_at = before
                raise

    def _allow(self, by: By) -> None:
        if self._session.latched and by is not By.OPERATOR:
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


def _raw_line(workspace: Workspace, line: str | TypedLine) -> DriveLine | None:
    """A line for the selected bus in raw mode; None for a verb, and for `@BUS:` of another bus.

    An `@` begins a command of some drives, so it is part of the text.
    """
    if workspace.selected_bus not in workspace.raw:
        return None
    typed = line if isinstance(line, str) else line.typed
    if typed.lstrip().startswith("/"):
        return None
    if typed.lstrip().startswith("@") and split_target(typed.split()[0][1:])[0] in workspace.buses:
        return None
    return DriveLine(typed.rstrip("\r\n"), typed=typed)


def _place_of(target: DriveLine, selected: Place) -> Place:
    """The bus and the address that a line was for; `selected`: those that were selected when it was typed."""
    bus = played_by(target.bus) or selected.bus
    plain = target.text and target.address is None and bus == selected.bus
    return Place(bus, selected.address if plain else target.address or "")


@contextlib.contextmanager
def _published_failures() -> Iterator[list[BaseException]]:
    """The failures published so far in the outermost `run` of this task."""
    found = _published.get()
    if found is not None:
        yield found
        return
    token = _published.set(found := [])
    try:
        yield found
    finally:
        _published.reset(token)
