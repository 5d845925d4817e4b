"""Programs between files and drives, for verbs and the command line.

A download checks the file, ends a running program, reads what the drive holds and saves it to a backup. Then it sends
the file, saves, and compares what the drive holds then. Nothing is changed in the drive before the backup is on the
disk.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from pathlib import Path
from weakref import WeakSet

from multidrop.base.errors import Diagnostic, Differs, DriveError, Refused
from multidrop.base.files import SourceLine, check_program_text, program_text_of
from multidrop.base.text import counted
from multidrop.dialects.families import correct_in, program_languages
from multidrop.dialects.family import Programs
from multidrop.dialects.program_files import LOCKED, Difference, Held, errors, in_order, refuse
from multidrop.drives.drive import Drive, still
from multidrop.shell import motions
from multidrop.shell.channel import running, transferring
from multidrop.shell.events import By, Printed
from multidrop.shell.operations.argument_types import Downloading
from multidrop.shell.origin import Origin
from multidrop.shell.program_listing import ListingSight, check_one, read
from multidrop.shell.session import Session
from multidrop.shell.state.backups import Copy, Sources, write_backup
from multidrop.shell.state.crash_marks import marked
from multidrop.shell.workspace import Workspace

PLAIN = Downloading()
END_TIMEOUT = 10.0
"""The longest wait for a running program and its motion to end, s."""
END_PERIOD = 0.05
"""The time between two looks at it, s."""
_under_way: WeakSet[Drive] = WeakSet()
"""The drives to which a file is being downloaded."""
MOST_LISTED_LINES = 20
"""The largest number of differing lines that are shown."""


# Checking


async def checked(
    workspace: Workspace, drive: Drive, file: str, text: str | None = None
) -> tuple[str, Sequence[SourceLine]]:
    """Return a file's text and its lines; publish warnings. `text`: what a file of that name would hold.

    Raises Diagnostic for the first error, or for another language.
    """
    if text is None:
        text = await asyncio.to_thread(program_text_of, file)
    else:
        check_program_text(text, file)
    own = drive.program_files
    problems = await asyncio.to_thread(own.language.check, text, drive.product)
    if errors(problems) and (other := await asyncio.to_thread(correct_in, text, drive.family.name)):
        title = program_languages()[other].title
        raise Diagnostic(f"is {title}, and {workspace.display_name(drive)} runs {own.title}", file)
    refuse(problems, file)
    unit = await asyncio.to_thread(own.unsupported, text, drive.product, drive.version, drive.state.part)
    for problem in in_order([*problems, *unit]):
        if problem.warning:
            workspace.notify(f"{problem.where(file)}: warning: {problem.what}", warning=True)
    return text, await asyncio.to_thread(own.language.read, text, file)


async def differences(session: Session, drive: Drive, file: str, text: str | None = None) -> Sequence[Difference]:
    """Read the program lines of a drive, and return where a file differs; programs that it lacks do not count.

    `text`: what a file of that name would hold. Raises Diagnostic for the file, and Refused where the drive's program
    is locked.
    """
    _, lines = await checked(session, drive, file, text)
    held = await read(session, drive, "diff", lines)
    held.check_listed(session.display_name(drive))
    return drive.programs.differences(lines, held, None)


def in_words(file: str, found: Difference, drive: str) -> str:
    where = f"{file}:{found.number}" if found.number else file
    here = f"here '{found.here}'" if found.here else "here no line"
    there = f"'{found.there}' at {found.at}" if found.at is not None else "no line"
    return f"{where}: {here}, in {drive} {there}"


# Download


async def download(
    session: Session,
    origin: Origin,
    drive: Drive,
    file: str,
    wanted: Downloading = PLAIN,
    text: str | None = None,
    *,
    later: bool = False,
) -> None:
    """Send a program file to a drive. `text`: what a file of that name would hold.

    `later`: the program is executed by `start`, once all drives of the line have theirs: what one prints meets no
    download.

    Raises Diagnostic for the file, the backup and lines that were not agreed to, and the drive's failures.
    """
    text, lines = await checked(session, drive, file, text)
    check_one(drive)
    if drive in _under_way:
        raise Refused(f"{session.display_name(drive)}: a download to it is under way (nothing was sent)")
    _under_way.add(drive)
    try:
        made = _Download(session, drive, file, wanted, later)
        await made.agree(lines, origin.by)
        async with session.automations.run(origin, f"the download of {file}") as own:
            await made.run(own, text, lines)
    finally:
        _under_way.discard(drive)


async def start(
    session: Session, origin: Origin, drive: Drive, file: str, wanted: Downloading, text: str | None
) -> None:
    """Execute the program of a download whose start was left for `later`. `text`: what was downloaded.

    Raises the drive's failures.
    """
    _, lines = await checked(session, drive, file, text)
    async with session.automations.run(origin, f"the start of {file}") as own:
        await _Download(session, drive, file, wanted).start(own, drive.programs.start(lines, wanted.run))


class _Download:
    """One download: a drive, a file, and what is wanted of it."""

    def __init__(self, session: Session, drive: Drive, file: str, wanted: Downloading, later: bool = False) -> None:
        self._session, self._drive = session, drive
        self._file, self._wanted, self._later = file, wanted, later
        self._name = session.display_name(drive)

    @property
    def _programs(self) -> Programs:
        return self._drive.programs

    async def run(self, origin: Origin, text: str, lines: Sequence[SourceLine]) -> None:
        """Do all of it. Raises Diagnostic for an unknown label to run."""
        programs, wanted, start = self._programs, self._wanted, ""
        if wanted.run:
            try:
                start = programs.start(lines, wanted.run)
            except Diagnostic as problem:
                raise Diagnostic(f"{problem.message} (nothing was sent)", self._file, problem.hint) from None
        start = "" if self._later else start
        ends_program = programs.size(lines) > 0
        if ends_program and not wanted.only_changed:  # one that prints without a pause lets nothing be listed
            await self._end_program()
            ends_program = False
        held = await read(self._session, self._drive, "backup", lines)
        if wanted.only_changed:
            why = await transferring(self._drive, programs.to_send(lines, held))
            more = "the program is not sent again" if wanted.save or wanted.run else "nothing was sent"
            self._say(f"{self._file} is sent: {why}" if why else f"holds {self._file} already; {more}")
            if not why:
                if start:
                    await self._end_program()
                if wanted.save:
                    await self._save(())
                if start:
                    await self.start(origin, start)
                return
        backup = await self._back_up(lines, held)
        port = self._session.of(self._session.buses[self._drive.link.name]).port
        try:
            with marked(self._session.settings.state, port, self._drive.address, self._file, backup):
                if ends_program:
                    await self._end_program()
                sent = await self._send(origin, lines, held)
                await self._save(lines)
                if programs.size(lines) and not wanted.no_verify:
                    await self._verify(text, lines, sent, held)
        except BaseException:
            self._say(f"what was in it before is in {backup}", warning=True)
            raise
        if start:
            await self.start(origin, start)

    def _say(self, text: str, warning: bool = False) -> None:
        self._session.notify(f"{self._name}: {text}", bus=self._drive.link.name, warning=warning, outcome=True)

    async def agree(self, lines: Sequence[SourceLine], by: By) -> None:
        """Ask before lines outside of a program that act: the drive executes them at once. Raises Diagnostic."""
        guards, drive = self._session.settings.guards, self._drive
        problems = []
        for line in self._outside(lines):
            what = guards.what(drive.family, line.text)
            if what or self._programs.acts(line.text):
                problems.append(f"line {line.number}: " + (what or f"'{line.text}' starts motion or a program"))
        if not problems:
            return
        what = f"{self._file}, outside of its program, {'; '.join(problems)}"
        if self._session.questions.agreed:
            self._say(what, warning=True)
        await self._session.questions.confirm(what, self._name, by=by)

    def _outside(self, lines: Sequence[SourceLine]) -> list[SourceLine]:
        """The lines of a file that the drive executes as they come, without declarations."""
        return [line for line in self._programs.executed(lines) if not line.text.upper().startswith("VA ")]

    async def _back_up(self, lines: Sequence[SourceLine], held: Held) -> Path:
        """Save what the drive holds. Raises Refused for a locked program that the file would overwrite."""
        if held.locked and self._programs.size(lines):
            raise Refused(f"{self._name}: no backup is possible: {LOCKED} (nothing was sent)")
        drive, workspace = self._drive, self._session
        state, bus, at = drive.state, drive.link.name, workspace.wall(workspace.now())
        where = f"{bus}, drive {drive.address}" if drive.address else bus
        parts = (state.product, state.version, f"part {state.part}" * bool(state.part), f"serial {state.serial}")
        head = [
            f"multidrop backup of {where}, {at.isoformat(' ', 'seconds')}",
            "; ".join(part for part in parts[: 3 + bool(state.serial)] if part),
            *(["names in the drive:", *(f"  {name}" for name in held.names)] if held.names else ["no names"]),
        ]
        program = self._programs.file(held, True)
        head += [] if program else ["the drive holds no program and no variable"]
        text = "".join(f"{line}\n" for line in (*(f"{self._programs.remark} {line}" for line in head), *program))
        ending = drive.program_files.endings[0]
        path = await asyncio.to_thread(write_backup, workspace.settings.data, at, bus, drive.address, ending, text)
        workspace.notify(f"backup: {path}", bus=bus, outcome=True)
        return path

    async def _end_program(self) -> None:
        """End a running program, with the motion that it has begun. Raises DriveError where it goes on."""
        drive = self._drive
        if not await transferring(drive, self._programs.end()):
            return
        self._say("its program ran and was ended", warning=True)
        deadline = self._session.now() + END_TIMEOUT
        while await drive.busy() or not await still(drive):
            if self._session.now() >= deadline:
                raise DriveError(
                    f"{self._name}: its program goes on for {END_TIMEOUT:g} s; stop it (nothing was overwritten)"
                )
            await asyncio.sleep(END_PERIOD)

    async def _send(self, origin: Origin, lines: Sequence[SourceLine], held: Held) -> Sequence[SourceLine]:
        """Send the file; a refusal names its line."""
        drive, workspace = self._drive, self._session
        workspace.addressed.add((drive.link.name, drive.address))
        moves = any(drive.codec.starts_motion(line.text) for line in self._programs.executed(lines))
        begins = workspace.path.starting(origin, drive, parts=True) if moves else contextlib.nullcontext()
        if self._programs.size(lines) and drive.family.debugging is not None:
            ListingSight(workspace, drive).changes()
        try:
            async with begins:
                with running(workspace, f"{self._name}: download") as job:
                    sent = await drive.download(lines, held, job)
        except DriveError as error:
            text = str(error)
            error.args = (f"{self._file}:{text.removeprefix('line ') if text.startswith('line ') else f' {text}'}",)
            raise
        outside = [line.text for line in self._outside(lines)]
        more = f" and {len(outside) - MOST_LISTED_LINES} more" if len(outside) > MOST_LISTED_LINES else ""
        executed = f"; executed at once: {', '.join(outside[:MOST_LISTED_LINES])}{more}" if outside else ""
        self._say(f"{self._file} downloaded, {counted(len(lines), 'line')}{executed}")
        return sent

    async def _save(self, lines: Sequence[SourceLine]) -> None:
        """Send S where that is wanted, unless the file ends with it."""
        word = self._programs.save
        executed = [line.text.strip().upper() for line in self._programs.executed(lines)]
        if not word:
            if self._wanted.save:
                self._say("it keeps programs at once; --save sends nothing")
        elif word in executed[-1:]:
            self._say(f"saved ({word} in the file)")
        elif self._wanted.save:
            await self._drive.send(word)
            self._say(f"saved ({word})")
        elif word not in executed:
            self._say(f"not saved: what is not saved is lost at power-off; --save sends {word}")

    async def _verify(self, text: str, lines: Sequence[SourceLine], sent: Sequence[SourceLine], before: Held) -> None:
        """Compare what the drive holds with the lines that were sent. Raises Differs."""
        held = await read(self._session, self._drive, "verify", lines)
        if held.locked:
            self._say("not verified: the program is locked now (LK=1)", warning=True)
            return
        differences = self._programs.differences(sent, held, before)
        for difference in differences[:MOST_LISTED_LINES]:
            self._session.notify(in_words(self._file, difference, self._name), warning=True)
        if differences:
            count = counted(len(differences), "line differs", "lines differ")
            raise Differs(f"{self._name}: {count} from {self._file}; download it again")
        size = self._programs.size(lines)
        self._say(f"verified, {counted(size, 'line')}")
        plain = " ".join(self._programs.file(held, True))
        if size == len(held.lines) and text.split() != plain.split():
            workspace = self._session
            at = workspace.wall(workspace.now()).isoformat(" ", "seconds")
            Sources(workspace.settings.state).keep(held, Copy(self._file, text, at))

    async def start(self, origin: Origin, line: str) -> None:
        drive, workspace = self._drive, self._session
        async with workspace.path.starting(origin, drive, line):
            printed = await motions.send(workspace, origin, drive, line)
        for text in printed:
            workspace.publish(Printed(workspace.now(), drive.link.name, drive.address, text), origin)
        self._say(f"started ({line})")
