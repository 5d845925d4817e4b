"""The session: a workspace and the one path of a command through it.

A front end holds one `Session`, passes it typed lines, and shows the events that it publishes. It adds nothing of its
own. Buses and drives belong to `drives`, macros to `macros`, verbs to `shell.verbs`.

A verb, a script, a macro or a wait runs as a task that the stop ends; its caller gets Stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Coroutine, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.base import registry
from multidrop.base.errors import Diagnostic, DriveError, Refused, Stopped
from multidrop.base.foreign import being_called
from multidrop.base.isolation import at_once
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Restarted
from multidrop.shell import program_listing
from multidrop.shell.at_session import AtSession
from multidrop.shell.automation import END_TIMEOUT, Automations
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import Opener, open_buses
from multidrop.shell.events import FAILURES, By, Entered, Failed, OnBus, SessionEvent
from multidrop.shell.line_path import LinePath
from multidrop.shell.line_syntax import DriveLine, Place, TypedLine, VerbLine, parse, split_target
from multidrop.shell.openings import Failed as OpeningFailed
from multidrop.shell.openings import Openings
from multidrop.shell.operations.table import find, load_others
from multidrop.shell.operations.verb import Chosen, Verb
from multidrop.shell.origin import PERSON, Origin
from multidrop.shell.quitting import ENDING as QUITTING
from multidrop.shell.quitting import EVEN_NOW, Unanswered
from multidrop.shell.units import SessionUnits
from multidrop.shell.waits import in_motion
from multidrop.shell.workspace import Workspace

if TYPE_CHECKING:
    from multidrop.macros import Macro

BARE_WORDS = {"exit": "/quit", "quit": "/quit", "help": "/help", "?": "/help"}
WITHOUT_ORIGIN = "in a verb: call.run(line); elsewhere: session.run(line, session.origin)"


def bare(word: str) -> Diagnostic:
    """The refusal of a bare word where nobody types."""
    return Diagnostic(f"not a command of a drive: '{word}'; nothing was sent", hint=f"{BARE_WORDS[word]} is the verb")


def _forget_restarted(session: Session, event: SessionEvent) -> None:
    """Forget the program and the settings that were read of a drive that was restarted, or may have been."""
    if isinstance(event, OnBus) and isinstance(event.event, Restarted) and event.bus in session.buses:
        drive = session.buses[event.bus].drives.get(event.event.address)
        if drive is not None:
            program_listing.forget(session, drive)


class Session(Workspace):
    """Everything that is open, and the path of a command. Needs a running event loop, and belongs to its thread."""

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
        self.units = SessionUnits(self)
        """The scales of axes, and quantities in lines."""
        self.path = LinePath(self, self.automations, self.units)
        self.verbs = VerbPath(self)
        self.openings = Openings(self, opener or partial(open_buses, state=self.settings.state), lazy, raw, tried)
        self._background: dict[asyncio.Task[Any], None] = {}
        self.on_opened.append(self.units.opened)
        self.subscribe(partial(_forget_restarted, self), Restarted)
        for text in begin(self):
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

    async def run(self, line: str | TypedLine, origin: Origin | None = None, since: int | None = None) -> None:
        """Run one line, as typed or parsed before, and publish what it prints.

        `origin`: by default that of the session. `since` is the value of `stops` when the line was typed; a line older
        than the last stop is refused with Stopped.

        A feature by others must say the origin: it may be a script, whose end stops what the line starts.

        Raises DriveError, Diagnostic or TransportLost, after one Failed event.
        """
        if self.front.ready is not None:
            await self.front.ready()
        target, place = DriveLine(""), self.place
        typed = line if isinstance(line, str) else line.typed
        no_origin, origin = origin is None and self.origin.automation is None, origin or self.origin
        published = [] if origin.published is None else origin.published
        origin, by = replace(origin, published=published), origin.by
        with self.under_way(f"running {typed.strip()}"):
            try:
                if no_origin and being_called():
                    raise Diagnostic("a feature ran it without its origin; it was not sent", typed, WITHOUT_ORIGIN)
                if since is not None and since != self.stops:
                    raise Stopped(f"a stop came after '{typed.strip()}' was typed; it was not sent")
                if self.quitting and by is By.OPERATOR and typed.strip() != EVEN_NOW:
                    raise Diagnostic(f"{QUITTING}, so '{typed.strip()}' was not sent")
                parsed = _raw_line(self, line) or (parse(line) if isinstance(line, str) else line)
                if isinstance(parsed, DriveLine):
                    parsed = self.verbs.meant(parsed, by)
                if isinstance(parsed, DriveLine):
                    target = parsed
                    with self.unanswered.sending(typed):
                        await self.path.text(parsed, origin)
                elif parsed is not None:
                    await self.verbs.run(parsed, origin)
            except FAILURES as failure:
                bus, address = _place_of(origin, target, place)
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

    def start(
        self, line: str | TypedLine, origin: Origin | None = None, since: int | None = None
    ) -> asyncio.Task[bool]:
        """Run one line in the background; the task returns whether it succeeded. A failure is published only.

        `origin` and `since` as for `run`; by default the line counts as typed now.
        """
        typed = self.stops if since is None else since

        async def succeeds() -> bool:
            try:
                await self.run(line, origin, typed)
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
        await self.tasks.stopped(END_TIMEOUT)
        late: list[str] = []
        if not self.questions.open.busy:
            late = await self.unanswered.answered(max((bus.line.timeout for bus in self.buses.values()), default=0.0))
        return [*late, *await in_motion(self)]

    def quit(self) -> None:
        """Ask the front end to end; drives go on as they are. No line of a person is sent from here on."""
        self.quitting = True
        self.changed()


def begin(session: Session) -> list[str]:
    """Load the features by others, and let every feature begin in a session.

    Return a warning for each that cannot be loaded or cannot begin; the others and the session go on.
    """
    warnings = load_others()
    for feature in registry.features():
        for each in registry.records((feature,), AtSession):
            why: list[str] = []
            with registry.GuardedCall(why):
                at_once(each.begin)
                each.begin(session)
            warnings += [f"the feature {feature.name} cannot begin: {text}" for text in why]
    return warnings


@dataclass(frozen=True)
class Call:
    """One use of a verb: where it works, the text after its name, and its origin."""

    session: Session
    verb: Verb
    rest: str
    origin: Origin = PERSON
    shown: str | Macro | None = None
    """What a person was shown of the file that the line names; see `line_syntax.VerbLine`."""

    @property
    def by(self) -> By:
        """Who has entered the line."""
        return self.origin.by

    @cached_property
    def chosen(self) -> Chosen:
        """The form of the line, and its values. Raises Diagnostic for words that are no arguments of the verb."""
        return self.verb.parsed(self.rest)

    @property
    def changes(self) -> bool:
        """Whether the line changes a drive, or lets it run. Raises Diagnostic as `chosen` does."""
        return self.chosen.form.changes

    @property
    def immediate(self) -> bool:
        """Whether it is done at once."""
        return self.chosen.form.immediate

    def work(self) -> Coroutine[Any, Any, None]:
        """What the line does."""
        return self.chosen.form.work(self, self.chosen.values)

    def recorded(self) -> str | None:
        """The line that a macro records; None: none."""
        recorded = self.chosen.form.recorded
        return recorded(self) if recorded is not None else None

    def output_file(self, name: str) -> str:
        """Return the path of a file to write. Raises Diagnostic for a macro's that leaves the current folder.

        A macro may be another person's file: it must not overwrite files elsewhere.
        """
        if self.by is By.MACRO and not Path(name).resolve().is_relative_to(Path.cwd().resolve()):
            hint = "name a file inside it, or type the line"
            raise Diagnostic(f"{name} leaves the current folder, in which a macro writes", self.verb.name, hint)
        return name

    def warn_of_editor(self, file: str | Path) -> None:
        """Warn where a text of a file that the line reads is in the editor of the screen, and not saved."""
        unsaved = self.session.front.unsaved
        if not isinstance(self.shown, str) and unsaved is not None and str(Path(file).absolute()) in unsaved():
            text = f"{file}: its text in the editor is not saved; the file on the disk is used"
            self.session.notify(text, warning=True)

    def wrong(self, message: str = "") -> Diagnostic:
        return self.verb.wrong(message)

    def bus(self, name: str = "") -> Bus:
        """Find an open bus by name or role; the selected one for an empty name. Raises Diagnostic."""
        return self.session.bus(self.origin.bus_of_role(name))

    def drive(self, target: str = "") -> Drive:
        """Find the drive of `ADDR` or `BUS:ADDR`; the selected drive for an empty target."""
        bus, address = self.origin.target(target)
        return self.session.drive(bus, address or None)

    async def run(self, line: str) -> None:
        """Run a line as a part of this one: what it starts is stopped with that. Raises as `Session.run` does."""
        await self.session.run(line, self.origin)

    def output(self, text: str, *, columns: bool = False) -> None:
        """Publish a line of the result. `columns`: a screen breaks it between words."""
        self.session.output(text, columns=columns, origin=self.origin)


class VerbPath:
    """The way of one line of a session to its verb."""

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

    async def run(self, parsed: VerbLine, origin: Origin) -> None:
        """Run a verb, as a task that a stop ends."""
        session, by = self._session, origin.by
        session.publish(Entered(session.now(), parsed.typed.strip(), by), origin)
        verb = find(parsed.name)
        call = Call(session, verb, parsed.rest, origin, parsed.shown)
        session.path.check_latch(by)
        if call.changes:
            await session.path.ask_about_doubts([*session.buses.values()], by)
        if by is not By.MACRO and (line := call.recorded()) is not None:
            session.recorder.record(line, session.now())
        work = call.work()
        await (work if call.immediate else session.tasks.run(work))


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


def _place_of(origin: Origin, target: DriveLine, selected: Place) -> Place:
    """The bus and the address that a line was for; `selected`: those that were selected when it was typed."""
    bus = origin.bus_of_role(target.bus) or selected.bus
    plain = target.text and target.address is None and bus == selected.bus
    return Place(bus, selected.address if plain else target.address or "")
