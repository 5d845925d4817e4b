"""Programs under observation: trace, single step, break point, watched variables, the listing around a line.

A `Debugger` belongs to one drive. It keeps the listing of the program, the last executed line, and the watched names.
The drive's state holds the proof that the drive waits for a key. A debugger adds the times of holds, and forgets them
at a stop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, Refused, TransportLost
from multidrop.dialects import Procedure
from multidrop.dialects.debugging import Debugging, Look, Neighbours
from multidrop.dialects.program_files import Stored
from multidrop.drives.drive import Drive
from multidrop.drives.events import Lost, Restarted
from multidrop.shell.events import OnBus, Phase, SessionEvent
from multidrop.shell.origin import Origin
from multidrop.shell.program_listing import ListingSight, ProgramListing
from multidrop.shell.session import Session

READ_PERIOD = 0.1
"""The time between two looks at a running program, s."""
LONG_QUIET = 5.0
"""The time without a traced line after which a message says so, s."""
BREAK_QUIET = 0.5
"""The time without a traced line after which a break point may be the reason, s."""
LONGEST_HOLD = 65.0
"""The longest time of an H, which counts where its time is not known, s."""
MAYBE_HELD = Stored(0, "H")
"""The last line of a program that was broken somewhere: it may be an H."""
WAYS = "/step executes one line, /continue all the rest"
LEFT = "the break point at {} stays in the drive until /break off or power-off"


Start = Callable[[str], Procedure[None]]
"""Starts a program of a drive at a place."""


class Debugger:
    """Observation of one drive's program. Its methods raise what the conversations of `Debugging` raise."""

    def __init__(self, session: Session, drive: Drive) -> None:
        self._session, self._drive = session, drive
        self._listing = ProgramListing(session.settings.state, drive.programs)
        self._commands = -1
        """The commands to the drive when the listing was read, ours included: after another one it is read again."""
        self._stops = drive.link.stops
        self._place = ""
        self._waits = False
        """The program was seen to wait, and nothing was sent that lets it go on."""
        self._last: Stored | None = None
        self._last_at = float("-inf")
        """The time of the last executed line, s of the session's clock."""
        self._free_at = float("-inf")
        """Until then a timed H holds the program."""
        self.break_point = ""
        """The place of the break point that this session has set; empty: none."""
        self._watched: tuple[str, ...] = ()
        self._values: Mapping[str, str] = {}
        """The last values of the watched names; a name without one is not there."""
        self._sight = ListingSight(session, drive)
        self._checks: set[asyncio.Task[None]] = set()
        self._unsubscribe = session.subscribe(self._notice)

    @property
    def _debugging(self) -> Debugging:
        debugging = self._drive.family.debugging
        assert debugging is not None
        return debugging

    # Starting

    async def trace(self, origin: Origin, place: str) -> None:
        """Run a program, and show its lines until it ends or comes to its break point."""
        others = [drive.address for drive in self._session.bus(self._drive.link.name).all_drives]
        annotators = self._session.of(self._session.buses[self._drive.link.name]).annotators
        annotators.append(self._annotated)
        try:
            await self._start(origin, place, others, self._debugging.trace)
            await self._follow(origin)
        finally:
            annotators.remove(self._annotated)

    async def begin(self, origin: Origin, place: str) -> None:
        """Start a program that waits before each line."""
        await self._start(origin, place, None, self._debugging.begin)
        self.break_point, self._waits = "", True
        self._sight.breaks("")
        first = self._debugging.address(self._listing.rows, self._place)
        for row in self._listing.around(first):
            self._session.output(row, origin=origin)
        self._sight.seen(first, Phase.BEFORE)
        self.say(f"waits before the first line of {self._place}: {WAYS}")

    async def _start(self, origin: Origin, place: str, neighbours: Neighbours | None, start: Start) -> None:
        """Start a program, once it is known that it can be started."""
        await self._read_listing()
        place = place.upper() or self._debugging.entry(self._listing.rows)
        await self._run(self._debugging.idle(place, neighbours))
        self._place, self._last = place, None
        self._last_at = self._free_at = self._session.now()
        async with self._session.path.starting(origin, self._drive, parts=True):
            await self._run(start(place))

    async def step(self, origin: Origin) -> None:
        """Execute one line; show it, and the watched values that it changed."""
        if self._debugging.no_step:
            name = self._session.display_name(self._drive)
            raise Inexpressible(f"{name}: {self._debugging.no_step}; nothing was sent")
        await self._check_waits()
        await self._read_listing()
        async with self._session.path.starting(origin, self._drive, parts=True):
            self._waits = True
            stepped = await self._run(self._debugging.step(self._listing.rows))
        self._executed(stepped.row, stepped.hold)
        changed = ""
        try:
            changed = await self._changed()
        finally:  # the line was executed, whatever becomes of the values
            self._session.output(self._listing.shown(stepped.row) + changed, origin=origin)
            self._sight.seen(stepped.row.at, Phase.AFTER)
        if not (await self._look()).runs:
            self.say("the program has ended")

    async def _check_waits(self) -> None:
        """Raise Refused unless it is known that the program waits."""
        left = self._free_at - self._session.now()
        if left > 0 and self._last is not None:
            name = self._session.display_name(self._drive)
            raise Refused(f"{name}: '{self._last.text}' holds for another {left:.1f} s; no key was sent")
        await self._run(self._debugging.waits(self._place, self._last))

    async def go_on(self, origin: Origin) -> None:
        """Let the program run on at normal speed."""
        await self._check_waits()
        async with self._session.path.starting(origin, self._drive, parts=True):
            await self._run(self._debugging.go_on(self._place))
        self._waits = False
        self._sight.seen(None)
        note = ", and shows no lines: /break now breaks it where it is" if self.break_point else ""
        self.say(f"its program runs on at normal speed{note}")

    # Following

    async def _follow(self, origin: Origin) -> None:
        while True:
            await asyncio.sleep(READ_PERIOD)
            look = await self._look()
            if look.address is not None and (row := self._listing.row(look.address)) != self._last:
                self._session.output(self._listing.shown(row), origin=origin)
                self._last = row
                self._sight.seen(row.at)
            if not look.runs:
                return self.say(f"the program has ended{await self._changed()}")
            if look.paused:
                return await self._show_waiting(origin, look.address)
            quiet = self._session.now() - max(self._last_at, self._free_at)
            if not self.break_point or self._last is None or quiet < BREAK_QUIET:
                continue  # a quiet trace without a hold may wait at its break point
            procedure = self._debugging.broken(self._listing.rows, self._last, self.break_point)
            address: int | None = await self._run(procedure)
            if address is not None:
                return await self._show_waiting(origin, address)
            if LONG_QUIET <= quiet < LONG_QUIET + 2 * READ_PERIOD:
                where = f"it holds, or waits at {self.break_point}"
                self.say(f"no line since '{self._last.text}': {where}; /break now makes sure")

    async def _look(self) -> Look:
        look: Look = await self._run(self._debugging.look(self._place))
        if not look.runs:
            await asyncio.sleep(READ_PERIOD)  # its last lines may still be on the wire
            self._place, self._waits = "", False
            self._sight.seen(None)
        return look

    async def _show_waiting(self, origin: Origin, address: int | None) -> None:
        """Show the place of a program that waits: the listing around its next line, and the watched values."""
        self._waits = True
        for row in self._listing.around(address):
            self._session.output(row, origin=origin)
        self._sight.seen(address, Phase.BEFORE)
        where = f" at the break point {self.break_point}" if self.break_point and address is not None else ""
        self.say(f"the program waits{where}: {WAYS}{await self._changed()}")

    def _annotated(self, line: str) -> str:
        """Take note of a traced line; return it with its remark."""
        row = self._debugging.traced(line)
        if row is None or row not in self._listing.rows:
            return line
        self._executed(row, self._debugging.hold(row.text))
        self._sight.seen(row.at)
        return self._listing.shown(row)

    def _executed(self, row: Stored, hold: float | None) -> None:
        self._last, self._last_at = row, self._session.now()
        self._free_at = self._last_at + (LONGEST_HOLD if hold is None else hold)

    # Break points

    async def break_at(self, place: str, passes: int) -> None:
        await self._run(self._debugging.break_at(place, passes))
        self.break_point = place.upper()
        self._sight.breaks(self.break_point)
        count = f", at pass {passes}" if passes > 1 else ""
        self.say(
            f"break point at {self.break_point}{count}, for /trace; it stays in the drive until /break off or power-off"
        )

    async def break_off(self) -> None:
        await self._run(self._debugging.break_off())
        self.break_point = ""
        self._sight.breaks("")
        self.say("no break point")

    async def break_now(self, origin: Origin) -> None:
        """Break the running program where it is."""
        await self._read_listing()
        await self._run(self._debugging.break_now(self._place))
        self._last, self._free_at = MAYBE_HELD, float("-inf")
        await self._show_waiting(origin, (await self._look()).address)

    # Watched variables

    async def watch(self, origin: Origin, names: Sequence[str]) -> None:
        """Watch variables from now on, and show their values."""
        upper = tuple(dict.fromkeys(name.upper() for name in names))
        self._debugging.names(upper)
        self._watched, self._values = upper, {}
        if upper:
            shown = await self._changed()
            missing = [name for name in upper if name not in self._values]
            absent = f"   not there now: {', '.join(missing)}" if missing else ""
            self._session.output((shown + absent).strip(), origin=origin)

    async def _changed(self) -> str:
        """Read what is watched; return the values that changed, as a person reads them, with blanks before."""
        if not self._watched:
            return ""
        values: Mapping[str, str] = await self._run(self._debugging.values(self._watched))
        changed = {name: text for name, text in values.items() if self._values.get(name) != text}
        self._values = values
        return "".join(f"   {name}={text}" for name, text in changed.items())

    # The listing

    async def _read_listing(self) -> None:
        """Read the program of the drive, unless only we have commanded it since."""
        if self._commands != self._drive.commands:
            rows = await self._drive.run(self._debugging.listing())
            self._listing = ProgramListing(self._session.settings.state, self._drive.programs, rows)
            self._commands = self._drive.commands
            self._sight.read(self._listing)

    # Stops

    def _notice(self, event: SessionEvent) -> None:
        """Say at a stop, or at a loss, what is left in the drive."""
        link = self._drive.link
        if isinstance(event, OnBus) and event.bus == link.name and isinstance(event.event, Lost):
            self._commands = -1
            self._sight.seen(None)
            self._say_left()
        if isinstance(event, OnBus) and event.bus == link.name and isinstance(event.event, Restarted):
            self._restarted(event.event)
        if self._stops == link.stops:
            return
        self._stops = link.stops
        self._debugging.forget()
        self._last, self._free_at, self._waits = None, float("-inf"), False
        self._sight.seen(None)
        if self._place and link.away is None:
            task = asyncio.get_running_loop().create_task(self._check_stopped())
            self._checks.add(task)
            task.add_done_callback(self._checks.discard)

    def _restarted(self, event: Restarted) -> None:
        """Forget what was set in the drive: it has no break point, and no program of it waits."""
        if event.address != self._drive.address:
            return
        self._commands, self._place, self.break_point = -1, "", ""
        self._last, self._free_at, self._waits = None, float("-inf"), False
        self._debugging.forget()
        self._sight.breaks("")
        self._sight.seen(None)

    async def _check_stopped(self) -> None:
        """Read whether a program still runs after a stop, and say so."""
        place, self._place = self._place, ""
        left = f"; {LEFT.format(self.break_point)}" if self.break_point else ""
        try:
            look: Look = await self._run(self._debugging.look(place))
        except (DriveError, TransportLost):
            return self.say(f"stopped; it is not known whether its program waits for a key{left}", warning=True)
        if look.runs:
            self.say(f"a program still runs after the stop{left}", warning=True)
        else:
            self.say(f"stopped: no program runs, and single step is over{left}")

    def close(self) -> None:
        """See `session.Observer`."""
        self._unsubscribe()
        self._say_left()

    def _say_left(self) -> None:
        """Say what is left in the drive when its bus is closed or lost."""
        if self._waits:
            self.say("its program may go on waiting for /step or /continue; a stop ends it", warning=True)
        if self.break_point:
            self.say(LEFT.format(self.break_point), warning=True)

    # Conversations

    async def _run(self, procedure: Any) -> Any:
        """Run a conversation of ours: it does not make the listing old."""
        before = self._drive.commands
        ours = self._commands == before
        try:
            return await self._drive.run(procedure)
        finally:
            if ours:
                self._commands = self._drive.commands

    def say(self, text: str, *, warning: bool = False) -> None:
        self._session.notify(
            f"{self._session.display_name(self._drive)}: {text}", bus=self._drive.link.name, warning=warning
        )


def of(session: Session, drive: Drive) -> Debugger:
    """Find the debugger of a drive, or make it. Raises Inexpressible where its family has none."""
    debuggers = session.of(session.buses[drive.link.name]).debuggers
    debugger = debuggers.get(drive)
    if isinstance(debugger, Debugger):
        return debugger
    if drive.family.debugging is None:
        raise Inexpressible(f"{session.display_name(drive)}: programs of its family cannot be observed")
    made = debuggers[drive] = Debugger(session, drive)
    return made


def passes_of(text: str) -> int:
    """Parse a number of passes. Raises Diagnostic."""
    if not (text.isascii() and text.isdecimal() and 1 <= int(text) <= 65535):
        raise Diagnostic(f"no number of passes {text}", "", "valid: 1 to 65535")
    return int(text)
