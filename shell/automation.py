"""Lines that run unattended, and the stop of what they started when they end early.

A script, a macro, piped lines and a `send` are one automation each; an automation inside another belongs to it. It
records what it sent to each drive that can start motion or a program, and that the drive has not refused (`sending`).
If it ends before its last line, for any reason, that and nothing else is stopped, on every bus that is still open; a
drive that was read at rest since is read once more instead (`excuses`). Nothing is latched. While it runs, no other
automation starts those drives, or others that it claimed at its beginning.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Collection, Iterator, Mapping
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.base.isolation import isolated
from multidrop.dialects import Started
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.link import Link
from multidrop.drives.port_journal import GLOBAL
from multidrop.drives.stopping import Halt
from multidrop.shell import stop_report
from multidrop.shell.at_rest import excused
from multidrop.shell.automation_record import Automation, Claim, SentMotion
from multidrop.shell.origin import Origin
from multidrop.shell.workspace import Workspace

LINGER = 3.0
"""The longest wait for a stop to be sent and confirmed, s."""
END_TIMEOUT = 10.0
"""The longest wait of a front end for automations that end, with their `on_early_end` lines, s."""
SOON = 0.5
"""The time after which a front end says that it waits for them, s."""
POLL = 0.02
"""The time between two looks for the end of automations, s."""
TRIAL = 10.0
"""The time for the trial of the stop key, s."""
AGREED = "/resume agrees to that (send, run: --yes)"
UNKNOWN = " and any other drive on this line"
"""What the stop of a line without an address stops as well."""


class Automations:
    """The running automations of one session."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._running: list[Automation] = []
        self.interrupted: list[Halt] = []
        """The stops that interruptions caused."""
        self.was_interrupted = False
        """An interruption came; another one would end the lines after a macro's early end, too."""

    @contextlib.asynccontextmanager
    async def run(self, origin: Origin, name: str = "", claims: Collection[Claim] = ()) -> AsyncIterator[Origin]:
        """Run the body as an automation, or as a part of that of the origin. Its early end stops what it started.

        The lines of the body have the origin that it is given. Raises Diagnostic where another automation has one of
        the claimed drives.
        """
        part_of = origin.automation
        for claim in claims:
            self._check_free(claim, part_of)
        if part_of is not None:
            with _claiming(part_of, name, claims):
                yield origin
            return
        automation = Automation(self._workspace.stops, name, frozenset(claims))
        self._running.append(automation)
        try:
            yield replace(origin, automation=automation)
        except (asyncio.CancelledError, GeneratorExit):
            self._stop(automation)  # the canceller goes on, and sees the outcome of the stop
            raise
        except BaseException:
            await self._end(automation)
            await settled(self._workspace)
            for text in outcome(self._workspace, automation.halts):
                self._workspace.notify(text, warning=True)
            raise
        finally:
            self._running.remove(automation)

    def _check_free(self, claim: Claim, own: Automation | None) -> None:
        """Raise Diagnostic where another automation has a drive."""
        for other in self._running:
            if other is not own and other.has(claim):
                who = other.name or "another script"
                where = claim[1] if claim[1] and claim[1] not in GLOBAL else claim[0].name
                hint = "wait for its end, or stop it (/play stop)"
                raise Diagnostic(f"{who} moves it, so nothing was sent", where, hint)

    def starts(self, origin: Origin, drive: Drive, what: Started | None = None, *, only_ends: bool = False) -> None:
        """Record that the automation of a line can start a drive now; by default anything in it.

        Raises Diagnostic where it may not: another automation has the drive. `only_ends`: with a line that can only
        end motion, which is refused to no `still` one, and starts nothing.
        """
        if self._workspace.doubted and not only_ends:
            raise Diagnostic(self._workspace.doubted, drive.shown, f"press Ctrl+X once; {AGREED}")
        automation = origin.automation
        if automation is None:
            return
        if automation.still and not only_ends:
            raise Diagnostic(automation.still, drive.shown)
        self._check_free((drive.link, drive.address), automation)
        if automation.stops != self._workspace.stops:  # its drives were stopped, and `/resume` let it go on
            automation.stops = self._workspace.stops
            automation.started.clear()
            automation.stopped.clear()
            automation.halts.clear()
        if not only_ends:
            self.records(automation, drive, what or Started())

    def records(self, automation: Automation, drive: Drive, what: Started, why: str = "") -> None:
        before = automation.started.get(drive)
        automation.started[drive] = SentMotion(
            drive.link.stamp(), before.what | what if before is not None else what, why
        )
        automation.stopped.pop(drive, None)

    def restores(self, automation: Automation, drive: Drive, before: SentMotion | None) -> None:
        """Take the record of a line back: it has started nothing in the drive."""
        if before is None:
            automation.started.pop(drive, None)
        elif drive in automation.started:
            automation.started[drive] = before

    async def end(self, origin: Origin) -> list[Halt]:
        """Stop at once what the automation started; what it starts after that is new. Return the stops."""
        automation = origin.automation
        if automation is None:
            return []
        try:
            await self._end(automation)
        finally:
            halts = [halt for halt in automation.halts if halt not in self.interrupted]
            automation.started.clear()
            automation.stopped.clear()
            automation.halts.clear()
        return halts

    def leave(self, origin: Origin) -> None:
        """Let what the automation started go on, whatever becomes of it."""
        if (automation := origin.automation) is not None:
            automation.started.clear()

    @contextlib.contextmanager
    def still(self, origin: Origin, why: str) -> Iterator[None]:
        """Refuse to let the automation start any drive while the body runs. An empty reason refuses nothing."""
        automation = origin.automation
        if automation is None:
            yield
            return
        before, automation.still = automation.still, why
        try:
            yield
        finally:
            automation.still = before

    async def over(self, say: Callable[[str], None] = lambda text: None) -> None:
        """Wait until every automation has ended; END_TIMEOUT at most. `say` takes a line where that takes a while."""
        if not await self._over(SOON):
            names = ", ".join(automation.name or "a script" for automation in self._running)
            say(f"waiting {END_TIMEOUT:g} s at most for the end of {names}")
            await self._over(END_TIMEOUT)

    async def _over(self, limit: float) -> bool:
        """Wait until no automation runs; whether that was within the limit."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(limit):
                while self._running:
                    await asyncio.sleep(POLL)
        return not self._running

    def interrupt(self) -> None:
        """Stop at once the drives that all automations started, and keep those stops."""
        self.was_interrupted = True
        for automation in self._running:
            self._stop(automation)
            self.interrupted += [halt for halt in automation.halts if halt not in self.interrupted]

    async def _end(self, automation: Automation) -> None:
        """Stop what an automation started; read what was at rest since once more first, and stop it if it is not."""
        excuses = {
            drive for drive, sent in automation.started.items() if _rested(drive, sent) and not drive.state.stranger
        }
        self._stop(automation, excuses)
        try:
            if excuses and automation.stops == self._workspace.stops:
                drives = [*excuses]
                at_rest = await asyncio.gather(*(excused(drive) for drive in drives))
                for drive, rests in zip(drives, at_rest, strict=True):
                    if rests:
                        automation.started.pop(drive, None)
        finally:
            self._stop(automation)

    def _stop(self, automation: Automation, but: Collection[Drive] = ()) -> None:
        """Write the stops onto every wire first, each wire by itself; once for each drive.

        A device that did not identify itself gets no stop that nobody asked for, and is named.
        """
        if automation.stops != self._workspace.stops:
            return  # a stop of everything came meanwhile
        due = {
            drive: sent
            for drive, sent in automation.started.items()
            if drive not in but and drive not in automation.stopped
        }
        strangers = [drive for drive in due if drive.state.stranger]
        for drive in strangers:
            del due[drive], automation.started[drive]
        automation.stopped |= due
        written: list[Halt] = []
        exits: list[SystemExit] = []
        for link, only in _by_link(due).items():
            with isolated(f"the stop of {link.name}", exits=exits):
                written.append(self._halt(link, only))
        automation.halts += written
        for halt in written:
            with isolated(f"the stop of {halt.link.name}", exits=exits):
                if bus := self._open_bus(halt.link):
                    bus.halted(halt)
        for drive in strangers:
            name = self._workspace.display_name(drive)
            self._workspace.notify(f"{name}: no stop was sent, as {drive.state.stranger}", warning=True)
        for drive, sent in due.items():
            if sent.why:
                self._workspace.notify(f"{self._workspace.display_name(drive)}: {sent.why}", warning=True)
        for drive in (each for bus in self._workspace.buses.values() for each in bus.all_drives):
            drive.motions.close(automation)
        if exits:
            raise exits[0]

    def _halt(self, link: Link, only: dict[Drive, SentMotion]) -> Halt:
        started = {drive: sent.what for drive, sent in only.items()}
        bus = self._open_bus(link)
        if bus is None:
            return Halt(link, self._workspace.now(), 0, False, tuple(only), started=started, trouble=["closed"])
        whole = any(drive.address in GLOBAL for drive in only)
        return bus.halt() if whole else bus.halt(started, started=started)

    def _open_bus(self, link: Link) -> Bus | None:
        """The bus of a link; None once it is closed."""
        bus = self._workspace.buses.get(link.name)
        return bus if bus is not None and bus.link is link else None


@contextlib.contextmanager
def _claiming(automation: Automation, name: str, claims: Collection[Claim]) -> Iterator[None]:
    """Add the claims of a part of an automation while the body runs."""
    before = automation.name, automation.claims
    automation.name, automation.claims = automation.name or name, automation.claims | set(claims)
    try:
        yield
    finally:
        automation.name, automation.claims = before


def _by_link(started: Mapping[Drive, SentMotion]) -> dict[Link, dict[Drive, SentMotion]]:
    by_link: dict[Link, dict[Drive, SentMotion]] = {}
    for drive, sent in started.items():
        by_link.setdefault(drive.link, {})[drive] = sent
    return by_link


def _rested(drive: Drive, sent: SentMotion) -> bool:
    """Whether a drive was read at rest after the last thing that was sent, and nothing of that moves it again."""
    seen, running = drive.seen, drive.running
    runs = running is not None and running.at > sent.at and running.runs
    at_rest = drive.rested_at > sent.at or (seen is not None and seen.at > sent.at and seen.at_rest(sent.at))
    return at_rest and not (runs or sent.what.lasts or sent.why or drive.address in GLOBAL)


def only_ends(drive: Drive, text: str) -> bool:
    """True if a line that counts as a start can only end motion, as a velocity of 0."""
    return drive.family.only_ends(text)


async def settled(workspace: Workspace) -> None:
    """Wait until stops are sent and confirmed, and clean-ups are over; LINGER at most."""
    waits = [asyncio.create_task(bus.settled()) for bus in workspace.buses.values()]
    if waits:
        await asyncio.wait(waits, timeout=LINGER)
        for wait in waits:
            wait.cancel()


def outcome(workspace: Workspace, halts: list[Halt]) -> list[str]:
    """The result of stopping an automation's drives, in lines for a person."""
    sent = [halt for halt in halts if halt.data]
    lines = []
    if sent:
        tally = stop_report.of_halts(sent, workspace.wall(sent[0].at), len(workspace.buses) > 1)
        named = [
            ", ".join(workspace.display_name(drive) + halt.part_of(drive) for drive in halt.drives) for halt in sent
        ]
        names = ", ".join(name or halt.link.name for name, halt in zip(named, sent, strict=True))
        every = UNKNOWN if any(halt.reaches_unknown for halt in sent) else ""
        lines.append(f"{'stopped' if tally.stand else 'stop sent to'} {names}{every}: {stop_report.words(tally)}")
    if others := _names(workspace, [drive for halt in sent for drive in halt.others]):
        lines.append(f"their line has only one stop, so these stopped too: {others}")
    programs = {drive: ran for halt in sent for drive, ran in halt.programs.items()}
    for ran, said in ((True, "program ended"), (None, "program ended, if one was running")):
        if ended := _names(workspace, [drive for drive, program in programs.items() if program is ran]):
            lines.append(f"{said}: {ended}")
    return lines + stop_report.unreached(halts, workspace.now())


def _names(workspace: Workspace, drives: Collection[Drive]) -> str:
    return ", ".join(map(workspace.display_name, drives))


def stop_key_trial(workspace: Workspace) -> str:
    """Ask for Ctrl+X where the console may swallow it. Return why drives are read only until then."""
    why = "this console may swallow Ctrl+X, so drives are read only"
    workspace.notify(f"press Ctrl+X once, as a trial: {why} until it comes", warning=True)

    def still() -> None:
        if workspace.doubted:
            workspace.notify(f"Ctrl+X did not come. `/stop` Enter stops. {AGREED}", warning=True)

    asyncio.get_running_loop().call_later(TRIAL, still)
    return why
