"""The settings of one drive or several: backup, comparison and restore, for verbs, commands and the API.

A restore shows the steps from a drive's settings to those of a file, asks, sends, and verifies. Nothing is sent before
a person or `--yes` has agreed. A step that fails ends it; what was done until then is said. Settings that can move the
motor, and those of communication, are left alone unless they are named.
"""

from __future__ import annotations

import contextlib
import difflib
import json
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from multidrop.base import new_file
from multidrop.base.atomic import make_folder
from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused, Stopped, TransportLost
from multidrop.base.files import why
from multidrop.base.text import counted
from multidrop.dialects.values import (
    COMMUNICATION,
    IO,
    PARAMETERS,
    VARIABLES,
    Change,
    Permission,
    Plan,
    Readings,
    Value,
    same,
)
from multidrop.drives.drive import Drive
from multidrop.shell.channel import running, transferring
from multidrop.shell.line_syntax import split_target
from multidrop.shell.operations.argument_types import Restoring
from multidrop.shell.origin import Origin
from multidrop.shell.params import file as files
from multidrop.shell.session import Session
from multidrop.shell.workspace import Workspace

ALL = ("all", "*")
OTHERS = "?drives=a,b in the URL names others of its line"
Work = Callable[["Drive"], Awaitable[None]]
Difference = tuple[str, Value | None, Value | None]
"""A name, the value here, and the value there; None where one side has none."""
OWN_NAME = frozenset({"DN"})
"""The setting that two drives on one line never share."""


def targets(workspace: Workspace, origin: Origin, target: str, having: str = "parameters") -> list[Drive]:
    """The drives of a target: one, several (`a,b`), or `all` that are open and whose family has these.

    Raises Diagnostic for an unknown one.
    """
    chosen: dict[Drive, None] = {}
    for name in target.split(","):
        bus, address = origin.target(name)
        if address not in ALL:
            chosen[workspace.drive(bus, address or None)] = None
            continue
        buses = [workspace.bus(bus)] if bus else list(workspace.buses.values())
        drives = [drive for each in buses for drive in each.drives.values()]
        able = [drive for drive in drives if having != "programs" or drive.family.programs is not None]
        if not able:
            raise Diagnostic(f"no drive with {having} has replied", target)
        chosen |= dict.fromkeys(able)
        if len(drives) == 1 and drives[0].address:  # perhaps only the last session's choice
            workspace.notify(f"{target} is {drives[0].address} alone; {OTHERS}", bus=drives[0].link.name, outcome=True)
    return list(chosen)


def is_several(target: str) -> bool:
    """True for a target of several drives, for which a file's name is a folder's."""
    return "," in target or split_target(target)[1] in ALL


def file_of(workspace: Workspace, drive: Drive, name: str, target: str, ending: str = ".toml") -> str:
    """The file of a drive: for several drives `NAME.toml` in a folder."""
    if not is_several(target):
        return name
    own = (workspace.qualified_address(drive) or drive.link.name).rstrip(":").replace(":", "-")
    return str(Path(name) / f"{own}{ending}")


def make_place(file: str, target: str) -> None:
    """Make the folder of the files of several drives. Raises Diagnostic where it cannot be made."""
    folder = Path(file).parent
    try:
        if is_several(target):
            make_folder(folder)
    except OSError as problem:
        raise Diagnostic(f"the folder cannot be made: {why(problem)}", str(folder), "name another one") from None


def check_new(name: str, target: str) -> None:
    """Check where a backup goes, before anything is opened. Raises Diagnostic."""
    path = Path(name)
    if is_several(target):
        if name == new_file.STANDARD_OUTPUT or (path.exists() and not path.is_dir()):
            raise Diagnostic("is not a folder", name, "several drives need a folder: each gets a file in it")
    else:
        new_file.check(name, printed=True)


async def each(workspace: Workspace, drives: Sequence[Drive], work: Work) -> None:
    """Do the work for each drive; one that fails is said, and the others are done. Raises a summary at the end."""
    if len(drives) == 1:
        await work(drives[0])
        return
    failed: dict[str, DriveError | Diagnostic | TransportLost] = {}
    for drive in drives:
        try:
            await work(drive)
        except Stopped:
            raise
        except (DriveError, Diagnostic, TransportLost) as failure:
            failed[workspace.display_name(drive)] = failure
            workspace.notify(str(failure), bus=drive.link.name, warning=True)
    if failed:
        rest = "; the others are done" if len(failed) < len(drives) else ""
        text = f"{len(failed)} of {len(drives)} drives failed: {', '.join(failed)}{rest}"
        for kind in (TransportLost, DriveError):  # of the gravest kind: no connection, then a drive, then a file
            if any(isinstance(loss, kind) for loss in failed.values()):
                raise kind(text)
        raise Diagnostic(text)


def backup_text(drive: Drive, found: Readings) -> str:
    """The file of settings that were read of a drive."""
    return files.formatted(files.identity(drive.state, drive.family.values.parameters.language), found)


async def backup(workspace: Workspace, origin: Origin, name: str, target: str) -> None:
    """Write the settings of drives to new files, or to standard output."""

    async def keep(drive: Drive) -> None:
        own = file_of(workspace, drive, name, target)
        make_place(own, target)
        new_file.check(own, printed=True)
        readings, who = await files.read(workspace, drive, "backup"), workspace.display_name(drive)
        new_file.write(own, backup_text(drive, readings), partial(workspace.output, origin=origin))
        workspace.notify(f"{who}: {counted(len(readings.readings), 'setting')}{new_file.place(own)}")
        if readings.unread:
            names = files.listed([name for name, _ in readings.unread])
            workspace.notify(f"{who}: not read: {names}; [unread] in the file has the reasons", warning=True)

    await each(workspace, targets(workspace, origin, target), keep)


async def read(workspace: Workspace, origin: Origin, target: str) -> None:
    """Read the settings of drives, and say how many there are; screens show them."""

    async def count(drive: Drive) -> None:
        readings = await files.read(workspace, drive, "reading")
        workspace.notify(f"{workspace.display_name(drive)}: {counted(len(readings.readings), 'setting')} read")

    await each(workspace, targets(workspace, origin, target), count)


async def save(workspace: Workspace, origin: Origin, target: str) -> None:
    """Have drives keep their present settings, after a question. Raises Diagnostic where it is not agreed to."""

    async def keep(drive: Drive) -> None:
        saving, who = drive.family.values.parameters.saving, workspace.display_name(drive)
        await workspace.questions.confirm(f"'{saving}' keeps all present settings over power-off", who)
        await transferring(drive, drive.family.values.parameters.save())
        workspace.notify(f"{who}: its settings are saved")

    await each(workspace, targets(workspace, origin, target), keep)


async def diff(
    workspace: Workspace,
    origin: Origin,
    target: str,
    *,
    name: str = "",
    other: Drive | None = None,
    as_json: bool = False,
    loaded: files.SettingsFile | None = None,
) -> bool:
    """Print what differs from a file, another drive, or (without both) the defaults; whether anything does.

    `loaded`: the file of one drive, if it was read already.
    """
    differs = False
    reference = await files.read(workspace, other, "reading") if other is not None else None
    several = is_several(target)

    async def compare(drive: Drive) -> None:
        nonlocal differs
        file = loaded or (files.load(file_of(workspace, drive, name, target)) if name else None)
        # No setting has the same meaning in a file or a drive of another family.
        language = drive.family.values.parameters.language
        has = f"{workspace.display_name(drive)} has {language}; their settings cannot be compared"
        if file is not None and file.language and file.language != language:
            raise Diagnostic(f"has settings of {file.product or 'a drive'} in {file.language}, and {has}", file.path)
        if other is not None and (theirs := other.family.values.parameters.language) != language:
            raise Diagnostic(f"{workspace.display_name(other)} has {theirs}, and {has}")
        readings, who = await files.read(workspace, drive, "reading"), workspace.display_name(drive)
        if file is not None and (aside := [name for name, _ in readings.unread if name in file.named]):
            workspace.notify(f"{who}: not read, so not compared: {files.listed(aside)}", warning=True)
        rows = differences(readings, file if reference is None else reference, who)
        differs = differs or bool(rows)
        units = {reading.name: reading.unit for reading in readings.readings}
        for setting, here, there in rows:
            if as_json:
                own = {"drive": who} if several else {}
                workspace.output(json.dumps({**own, "name": setting, "here": here, "there": there}), origin=origin)
            else:
                unit = f" {units[setting]}" if units.get(setting) else ""
                values = f"here {files.shown(here)}, there {files.shown(there)}{unit}"
                workspace.output(f"{f'{who}: ' if several else ''}{setting}: {values}", origin=origin)
        if not rows and not as_json:
            workspace.notify(f"{who}: nothing differs")

    await each(workspace, targets(workspace, origin, target), compare)
    return differs


def differences(found: Readings, other: files.SettingsFile | Readings | None, who: str) -> list[Difference]:
    """Compare with a file, and all variables where it has their table; with another drive; or with the defaults.

    Raises Diagnostic where the defaults are not known.
    """
    there: Mapping[str, Value]
    if other is None:
        there, names = found.defaults, [*found.defaults]
        if not any(reading.default is not None for reading in found.readings if reading.section != VARIABLES):
            raise Diagnostic(f"{who}: the defaults of its settings are not known", hint="compare with a file")
    elif isinstance(other, Readings):
        there = other.values
        names = [name for name in (found.values | there) if name not in OWN_NAME]
    else:
        there, unread = other.named, {name for name, _ in found.unread}
        names = [name for name in there if name not in unread]
        if other.has_variables:
            names += [
                reading.name for reading in found.readings if reading.section == VARIABLES and reading.name not in there
            ]
    rows = [(name, found.values.get(name), there.get(name)) for name in names]
    return [row for row in rows if not same(row[1], row[2])]


# Restore

CLOSE = 0.5
"""The likeness from which a name is suggested: names have two letters."""


class Unlike(DriveError):
    """The drive has other values than were sent."""


@dataclass
class Wanted:
    """The values of a file for one drive, and the names that are left alone."""

    values: dict[str, Value]
    withheld: dict[str, str] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    """Those of `withheld` that the drive should have, and that could not be read."""


async def restore(session: Session, origin: Origin, drive: Drive, file: files.SettingsFile, options: Restoring) -> None:
    """Send what differs from a file. Raises Diagnostic or DriveError."""
    who, family = session.display_name(drive), drive.family.values.parameters
    if file.language and file.language != family.language:
        what = f"has settings of {file.product or 'a drive'} in {file.language}, and {who} has {family.language}"
        raise Diagnostic(f"{what}; nothing was sent", file.path)
    if file.product and drive.product and file.product != drive.product and not options.other_product:
        what = f"has the settings of an {file.product}, and {who} is an {drive.product}; nothing was sent"
        raise Diagnostic(what, file.path, "--other-product restores what both have")
    present = await files.read(session, drive, "reading")
    wanted, family = _values(present, file, options, who), drive.family.values.parameters
    try:
        permission = Permission(options.named, options.communication)
        plan = family.plan(present, wanted.values, permission)
    except Diagnostic as problem:
        raise Diagnostic(f"{problem.message} (nothing was sent)", problem.where or file.path, problem.hint) from None
    others = {each.address for each in session.buses[drive.link.name].all_drives if each is not drive}
    if reason := family.conflict(plan, others - {""}):
        raise Diagnostic(f"{who}: {reason}; nothing was sent", file.path)
    _show(session, origin, who, plan, wanted)
    if not plan.changes:
        left = wanted.withheld or plan.withheld or plan.impossible
        session.notify(f"{who}: nothing {'else ' if left else ''}differs from {file.path}", outcome=True)
        _check_complete(wanted, who)
        return
    await check_ready(drive)
    if options.dry_run:
        session.notify(f"{who}: {counted(len(plan), 'step')}; nothing was sent (--dry-run)", outcome=True)
        return
    await _agree(session, drive, present, plan, file)
    aside = {*wanted.withheld, *dict(plan.withheld), *dict(plan.impossible)}
    goal = {name: value for name, value in wanted.values.items() if name not in aside}
    with _accounted(session, who, plan) as written:
        await send(session, origin, drive, plan, options, "restore", written)
        await _finish(session, drive, plan, goal, options)
    _check_complete(wanted, who)


async def send(
    session: Session,
    origin: Origin,
    drive: Drive,
    plan: Plan,
    options: Restoring,
    what: str,
    written: list[Change],
) -> None:
    """Send the steps, and note each that is done.

    Only a step that a person has named can start motion: an early end then stops the drive, and with it its line.
    """
    session.addressed.add((drive.link.name, drive.address))
    with running(session, f"{session.display_name(drive)}: {what}") as progress:
        for number, change in enumerate(plan, 1):
            named = change.name in options.named
            async with session.path.starting(origin, drive, change.text) if named else contextlib.nullcontext():
                await transferring(drive, drive.family.perform(change.text))
            written.append(change)
            progress(number, len(plan))


def _check_complete(wanted: Wanted, who: str) -> None:
    """Raise NoAnswer where settings of the file could not be read, so that they are not restored."""
    if wanted.unread:
        names = ", ".join(wanted.unread)
        raise NoAnswer(f"{who}: {names} could not be read and is left alone; restore the file again")


def _values(present: Readings, file: files.SettingsFile, options: Restoring, who: str) -> Wanted:
    """The values to restore. Raises Diagnostic for a name that the drive lacks."""
    wanted, unread = Wanted({}), dict(present.unread)
    if unknown := sorted(options.named - {*file.named}):
        raise Diagnostic(f"has no setting {unknown[0]}", file.path, "--with takes names of the file")
    for name, value in file.named.items():
        if name in present.values or name in options.named or file.section[name] not in (PARAMETERS, IO):
            wanted.values[name] = value
        elif options.other_product or name in unread:
            wanted.withheld[name] = unread.get(name, f"{who} lacks it")
            if name in unread:
                wanted.unread.append(name)
        else:
            near = difflib.get_close_matches(name, present.values, 1, CLOSE)
            hint = f"did you mean {near[0]}?" if near else "--other-product leaves it out"
            raise Diagnostic(f"{who} has no such setting", f"{file.path}: [{file.section[name]}] {name}", hint)
    return wanted


def _show(workspace: Workspace, origin: Origin, who: str, plan: Plan, wanted: Wanted) -> None:
    """Print the steps, and say which settings are left alone."""
    for change in plan:
        before = "" if change.before is None else f" (was {files.shown(change.before)})"
        workspace.output(f"{who}: {change.text}{before}{', for a while' if change.temporary else ''}", origin=origin)
    for remark in plan.remarks:
        workspace.notify(f"{who}: {remark}", warning=True)
    for name, reason in plan.withheld:
        way = "--communication" if reason == COMMUNICATION else f"--with {name}"
        workspace.notify(f"{who}: {name} is left alone: {reason} ({way} restores it)", warning=True)
    for name, reason in {**wanted.withheld, **dict(plan.impossible)}.items():
        workspace.notify(f"{who}: {name} is left alone: {reason}", warning=True)


async def check_ready(drive: Drive) -> None:
    """Raise Refused where the drive is at work."""
    if reason := await transferring(drive, drive.family.values.parameters.ready()):
        raise Refused(f"{reason} (nothing was sent)")


async def _agree(workspace: Workspace, drive: Drive, present: Readings, plan: Plan, file: files.SettingsFile) -> None:
    """Ask, and make sure that the drive has not changed while a person thought about it."""
    names = list(dict.fromkeys(change.name for change in plan if not change.temporary))
    who, agreed = workspace.display_name(drive), workspace.questions.agreed
    await workspace.questions.confirm(
        f"{counted(len(names), 'setting')} of {file.path} will be written: {files.listed(names)}", who
    )
    if agreed:
        return
    await check_ready(drive)
    again = await files.read(workspace, drive, "reading again")
    if any(not same(value, again.values.get(name)) for name, value in present.values.items()):
        raise Refused(f"{who}: its settings changed meanwhile; nothing was sent; try again")


@contextmanager
def _accounted(workspace: Workspace, who: str, plan: Plan) -> Iterator[list[Change]]:
    """Say what was written where the block ends early; it notes the steps that are done."""
    written: list[Change] = []
    try:
        yield written
    except BaseException as ending:
        if isinstance(ending, Unlike):
            raise
        done, last = len(written), {change.name: change for change in written}
        if done == len(plan):
            account = "all steps are done; reading back or saving was cut off; restore again to make sure"
        else:
            temporary = [f"{change.name}={files.shown(change.after)}" for change in last.values() if change.temporary]
            held_for_now = f"; for a while it has {', '.join(temporary)}" if temporary else ""
            names = f": {', '.join(last)}" if last else ""
            more = f"; {plan.changes[done].text} may be done{held_for_now}; nothing was saved; restore again"
            account = f"{done} of {len(plan)} steps are done{names}{more}"
        workspace.notify(f"{who}: {account}", warning=True)
        raise


async def _finish(
    workspace: Workspace, drive: Drive, plan: Plan, goal: Mapping[str, Value], options: Restoring
) -> None:
    """Read back all settings of the file, and save them. Raises DriveError where the drive has others."""
    who = workspace.display_name(drive)
    after = (await files.read(workspace, drive, "verifying")).values
    wrong = [name for name, value in goal.items() if name in after and not same(value, after[name])]
    if wrong:
        values = ", ".join(f"{name} is {files.shown(after[name])}, not {files.shown(goal[name])}" for name in wrong)
        raise Unlike(f"{who}: read back after the restore: {values}; nothing was saved")
    written = {change.name for change in plan}
    unseen = sorted(name for name in written if name not in after)
    aside = f", without {', '.join(unseen)}, which cannot be read" if unseen else ""
    result = f"{who}: {counted(len(written), 'setting')} restored and read back{aside}"
    saving = drive.family.values.parameters.saving
    if options.save:
        await transferring(drive, drive.family.values.parameters.save())
        workspace.notify(f"{result}; saved ({saving})", outcome=True)
    else:
        workspace.notify(f"{result}; not saved, so lost at power-off: --save keeps it ({saving})", warning=True)


async def restore_each(
    session: Session,
    origin: Origin,
    name: str,
    target: str,
    options: Restoring,
    ready: files.SettingsFile | None = None,
) -> None:
    """Restore drives from their files; every file is read before the first step.

    `ready`: the file of one drive, if it was read already.

    Raises Diagnostic where the file for one of several drives names another drive, or none.
    """
    drives = targets(session, origin, target)
    loaded = {drive: ready or files.load(file_of(session, drive, name, target)) for drive in drives}
    for drive, file in loaded.items() if is_several(target) else ():
        if file.name != (drive.state.name or drive.address):
            who, whose = session.display_name(drive), f"drive {file.name}" if file.name else "no drive"
            hint = "for several drives each file names its own; --drive ADDR restores one drive from any file"
            raise Diagnostic(f"names {whose}, and is to be restored to {who}; nothing was sent", file.path, hint)

    async def put(drive: Drive) -> None:
        await restore(session, origin, drive, loaded[drive], options)

    await each(session, drives, put)
