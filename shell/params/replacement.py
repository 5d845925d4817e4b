"""A replacement drive gets the state of one drive of a cell file.

Theory of operation. Everything is read and shown before the question; after it, each step makes the drive more like the
one in the file, and each can be repeated: what is the same already is not sent. So an apply that was cut off goes on
when it is run again. It always saves: no drive reports what is saved already. The drive's communication is last, in
the drive's working memory only; what is saved answers to the new name already. Nothing here moves the motor: settings
that could are left alone until they are named.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, Refused
from multidrop.base.text import counted
from multidrop.dialects.program_files import LOCKED
from multidrop.dialects.values import Change, Parameters, Permission, Plan, Readings, differing
from multidrop.shell import snapshots
from multidrop.shell.channel import transferring
from multidrop.shell.operations.argument_types import Downloading, Restoring
from multidrop.shell.params.file import read, shown
from multidrop.shell.params.work import check_ready, send
from multidrop.shell.programs import transfers
from multidrop.simulator import cells
from multidrop.simulator.cell.writer import BusText, write
from multidrop.simulator.families import family_of

if TYPE_CHECKING:
    from multidrop.dialects.values import Snapshot
    from multidrop.drives.drive import Drive
    from multidrop.shell.origin import Origin
    from multidrop.shell.session import Session
    from multidrop.simulator.cell.spec import Cell, DriveSpec
    from multidrop.simulator.family import SimulatedFamily

UNNAMED = "!"
"""The name of a drive that has none of its own."""


def chosen(cell: Cell, file: str, drive: Drive, name: str, several: bool = False) -> DriveSpec:
    """Find a drive of a cell: `NAME`, `BUS:NAME`, or the one with the drive's own name. Raises Diagnostic.

    `several` drives are written to: each from its own name, even if there is only one in the file.
    """
    bus, _, own = name.rpartition(":")
    placed = [(each.name, spec) for each in cell.buses for spec in each.drives]
    own = own or drive.address or drive.state.name
    specs = [spec for place, spec in placed if spec.name == own and bus in ("", place)]
    if not name and len(placed) == 1 and not several:
        specs = [placed[0][1]]
    if len(specs) == 1:
        return specs[0]
    names = ", ".join(f"{place}:{spec.name}" for place, spec in placed)
    what = f'no drive "{name or own}"' if not specs else f'"{own}" is the name of several drives'
    hint = f"the file has {names}; --drive names one drive" if several else f"--from names one of {names}"
    raise Diagnostic(what, file, hint)


async def apply(session: Session, origin: Origin, drive: Drive, file: str, spec: DriveSpec, wanted: Restoring) -> None:
    """Put the state of a drive in a file onto a drive. Raises Diagnostic, DriveError or TransportLost."""
    await _Replacement(session, origin, drive, file, spec, wanted).run()


class _Replacement:
    """One apply: the drive, and what it is to become."""

    def __init__(
        self, session: Session, origin: Origin, drive: Drive, file: str, spec: DriveSpec, wanted: Restoring
    ) -> None:
        self._origin = origin
        self._session, self._drive, self._file = session, drive, file
        self._spec, self._wanted = spec, wanted
        self._settings = _tables(spec).wanted(spec)
        self._program = _tables(spec).program(spec)
        programs = drive.family.programs
        self._clearing = programs.clearing if programs is not None else ""
        """The line that erases all programs; empty where the family has none."""
        self._done: list[str] = []
        self._in_between = False
        """Its communication is being changed, and is not saved yet."""

    @property
    def _name(self) -> str:
        return self._session.display_name(self._drive)

    @property
    def _parameters(self) -> Parameters:
        return self._drive.family.values.parameters

    async def run(self) -> None:
        """Read, show, ask, write, verify."""
        spec = self._spec
        now = await snapshots.read(self._session, self._drive)
        here = _spec(now)
        self._check(now, here)
        changes = self._show(now, here)
        if self._wanted.dry_run:
            return
        await check_ready(self._drive)
        steps = ", ".join(changes) if changes else f"nothing differs, {self._parameters.saving} saves it"
        agreed = self._session.questions.agreed
        await self._session.questions.confirm(
            f"it gets the state of {spec.name!r} in {self._file}: {steps}", self._name
        )
        await check_ready(self._drive)  # a person may have thought about it for long
        if not agreed:
            again = await snapshots.read(self._session, self._drive)
            if self._steps(again) != self._steps(now):
                raise Refused(f"{self._name}: it changed since the question was asked; nothing was sent; try again")
        try:
            await self._write(here)
            now = await snapshots.read(self._session, self._drive)
        except BaseException:
            text = f"{self._name}: cut off; done: {'; '.join(self._done) or 'nothing'}; run it again to go on"
            if self._in_between and spec.party:
                url = f"URL?drives={spec.name}&party=1"
                text += f". It may be in party mode already ({url}); switched off and on it is as before"
            self._session.notify(text, warning=True)
            raise
        self._verify(_spec(now))

    # Before anything is sent

    def _check(self, now: Snapshot, here: DriveSpec) -> None:
        """Refuse another product, a name that another drive of the line bears, and a locked program."""
        spec = self._spec
        if unknown := sorted(self._wanted.named - {*self._settings}):
            raise Diagnostic(f"{spec.name!r} has no setting {unknown[0]}", self._file, "--with takes names of its set")
        what = f"product {now.product}, and {spec.name!r} in {self._file} is {spec.personality}; nothing was sent"
        if family_of(here.personality) is not family_of(spec.personality):
            raise Diagnostic(what, self._name, "a drive of its family is needed")
        if here.personality != spec.personality and not self._wanted.other_product:
            raise Diagnostic(what, self._name, "--other-product applies it all the same")
        bus = self._session.buses[self._drive.link.name]
        others = [drive for drive in bus.drives.values() if drive is not self._drive]
        if any(spec.name in (drive.address, drive.state.name) for drive in others):
            raise Diagnostic(f"another drive on {bus.name} is named {spec.name!r}; nothing was sent", self._name)
        if others and here.party and not spec.party:
            what = f"{spec.name!r} in {self._file} is not in party mode, and {bus.name} has other drives"
            raise Diagnostic(f"{what}; nothing was sent", self._name)
        if self._program.lines and self._drive.family.programs is None:
            raise Inexpressible(f"{self._name}: {self._drive.family.no_programs}")
        if now.readings.values.get("LK") and self._program.lines:
            raise Refused(f"{self._name}: {LOCKED} (nothing was sent)")
        if now.program and self._clearing and not self._program.lines:
            held = counted(len(now.program), "line")
            raise Refused(
                f"{self._name}: it holds a program of {held}, and {spec.name!r} in {self._file} has none: "
                f"{self._clearing} erases it (nothing was sent)"
            )

    def _show(self, now: Snapshot, here: DriveSpec) -> list[str]:
        """Publish everything that will happen; return it in short."""
        out, spec = self._session.output, self._spec
        for key in ("part", "version", "serial"):
            mine, theirs = getattr(here.identity, key), getattr(spec.identity, key)
            if theirs and mine != theirs:
                out(f"{self._name}: {key} {mine or 'not known'}; in {self._file} {theirs}")
        changes = []
        if self._differs(here):
            changes.append(f"a program of {counted(len(self._program.lines), 'line')}")
            out(f"{self._name}: program: {counted(len(self._program.lines), 'line')} in place of {len(now.program)}")
        elif now.program and not self._program.lines:
            out(f"{self._name}: its program of {counted(len(now.program), 'line')} stays: {self._file} has none")
        ordinary, whole = self._plans(now)
        final = {change.name: change for change in whole if not change.temporary}
        wire = [name for name in final if name not in {change.name for change in ordinary}]
        for name, change in final.items():
            before = "" if change.before is None else f" (was {shown(change.before)})"
            out(f"{self._name}: {change.text}{before}{', at the end' if name in wire else ''}")
        if count := len(final) - len(wire):
            changes.append(counted(count, "setting"))
        if wire:
            changes.append(f"then {', '.join(final[name].text for name in wire)}")
        if spec.name == UNNAMED != here.name:
            out(f"{self._name}: its name stays {here.name!r}: only FD gives back {UNNAMED!r}")
        for name, reason in whole.withheld:
            out(f"{self._name}: {name} is left alone: {reason} (--with {name} writes it)")
        known = {*now.readings.values, *spec.variables}
        strangers = [(name, "this drive does not print it") for name in self._settings if name not in known]
        for name, reason in (*whole.impossible, *strangers):
            out(f"{self._name}: {name} is left alone: {reason}")
        if unread := [name for name, _ in now.readings.unread]:
            text = f"{self._name}: no snapshot has what a drive does not print; check it: {', '.join(unread)}"
            self._session.notify(text, warning=True)
        out(f"{self._name}: saved at the end ({self._parameters.saving}); its position is not changed")
        for name in final:
            if name in self._parameters.later:
                out(f"{self._name}: after that, {name} waits until the drive is switched off and on")
        return changes

    def _plans(self, now: Snapshot) -> tuple[Plan, Plan]:
        """The steps to the settings of the file, without those of communication and with them."""
        readings = replace(now.readings, labels=(*now.readings.labels, *self._program.labels))
        return self._plan(readings), self._plan(readings, communication=True)

    def _steps(self, now: Snapshot) -> tuple[object, ...]:
        """What an apply changes in a drive: what the question is about."""
        return (now.program, *(tuple((change.text, change.before) for change in plan) for plan in self._plans(now)))

    def _differs(self, here: DriveSpec) -> bool:
        program = self._program.lines
        return bool(program) and _tables(here).program(here).lines != program

    def _plan(self, readings: Readings, communication: bool = False) -> Plan:
        allowed = Permission(self._wanted.named, communication)
        present = {*readings.values, *self._spec.variables}
        goal = {name: value for name, value in self._settings.items() if name in present}
        return self._parameters.plan(readings, goal, allowed)

    # After the question

    async def _write(self, here: DriveSpec) -> None:
        if self._differs(here):  # the user's variables too; what was in the drive goes to a backup first
            clear = self._clearing and _tables(here).program(here).lines  # else an old program stays beside the new one
            lines = (*((self._clearing,) if clear else ()), *self._program.file)
            text, saved = "".join(f"{line}\n" for line in lines), Downloading(save=True)
            file = f"{self._file}#{self._spec.name}"
            await transfers.download(self._session, self._origin, self._drive, file, saved, text)
            self._done.append("program")
        await self._change(communication=False)
        await self._save("settings and program")
        self._in_between = True
        if await self._change(communication=True):
            await self._save("communication")
        self._in_between = False

    async def _change(self, communication: bool) -> int:
        """Write the settings that differ now, those of communication in their order; return how many."""
        session, drive, written = self._session, self._drive, list[Change]()
        session.addressed.add((drive.link.name, drive.address))
        steps = self._plan(await read(session, drive, "apply"), communication)
        try:
            await send(session, self._origin, drive, steps, self._wanted, "apply", written)
        finally:
            self._done += [change.text for change in written]
        return len(steps)

    async def _save(self, what: str) -> None:
        await transferring(self._drive, self._parameters.save())
        self._done.append(f"{what} saved ({self._parameters.saving})")

    def _verify(self, here: DriveSpec) -> None:
        """Compare what was read last with the file. Raises DriveError where it is not the same."""
        values = _tables(here).wanted(here)
        differences = [
            difference for difference in differing(values, self._settings) if difference[0] in self._settings
        ]
        wrong = [f"{name} {shown(mine)}, in the file {shown(value)}" for name, mine, value in differences]
        if self._differs(here):
            wrong.append("its program")
        if wrong:
            raise DriveError(f"{self._name} is not as {self._spec.name!r} in {self._file}: {'; '.join(wrong)}")
        self._session.notify(f"{self._name}: verified: it is as {self._spec.name!r} in {self._file}", outcome=True)


def _tables(spec: DriveSpec) -> type[SimulatedFamily]:
    return family_of(spec.personality)


def _spec(snapshot: Snapshot) -> DriveSpec:
    """A drive that was read, as a cell file describes it."""
    text = write([BusText("line", [snapshots.described(snapshot)])])
    return cells.read(text, "snapshot").buses[0].drives[0]
