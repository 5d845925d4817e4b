"""Backup, comparison and restore for one drive or several, for verbs and the command line."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, DriveError, Stopped
from multidrop.dialects.values import VARIABLES, Readings, Value, same
from multidrop.shell import new_file
from multidrop.shell.channel import transferring
from multidrop.shell.lines import split_target
from multidrop.shell.params import file as files
from multidrop.shell.params.restore import Options, restore
from multidrop.transports import TransportLost

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session
    from multidrop.shell.workspace import Workspace

ALL = ("all", "*")
Work = Callable[["Drive"], Awaitable[None]]
Difference = tuple[str, Value | None, Value | None]
"""A name, the value here, and the value there; None where one side has none."""
OWN_NAME = frozenset({"DN"})
"""What two drives on one line never share."""


def targets(workspace: Workspace, target: str, having: str = "parameters") -> list[Drive]:
    """The drives of a target: one, several (`a,b`), or `all` that are open and whose family has these.

    Raises Diagnostic for an unknown one.
    """
    found: dict[Drive, None] = {}
    for name in target.split(","):
        bus, address = split_target(name)
        if address not in ALL:
            found[workspace.drive(bus, address or None)] = None
            continue
        buses = [workspace.bus(bus)] if bus else list(workspace.buses.values())
        drives = [drive for each in buses for drive in each.drives.values()]
        able = [drive for drive in drives if having != "programs" or drive.family.programs is not None]
        if not able:
            raise Diagnostic(f"no drive with {having} has replied", target)
        found |= dict.fromkeys(able)
    return list(found)


def is_several(target: str) -> bool:
    """Whether a target is several drives, so that a file's name is a folder's."""
    return "," in target or split_target(target)[1] in ALL


def file_of(workspace: Workspace, drive: Drive, name: str, target: str, ending: str = ".toml") -> str:
    """The file of a drive: for several drives `NAME.toml` in a folder."""
    if not is_several(target):
        return name
    own = (workspace.qualified_address(drive) or drive.link.name).rstrip(":").replace(":", "-")
    return str(Path(name) / f"{own}{ending}")


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
            if any(isinstance(each, kind) for each in failed.values()):
                raise kind(text)
        raise Diagnostic(text)


async def backup(workspace: Workspace, name: str, target: str) -> None:
    """Write the settings of drives to new files, or to standard output."""

    async def keep(drive: Drive) -> None:
        own = file_of(workspace, drive, name, target)
        if is_several(target):
            Path(own).parent.mkdir(parents=True, exist_ok=True)
        new_file.check(own, printed=True)
        found, who = await files.read(workspace, drive, "backup"), workspace.display_name(drive)
        text = files.formatted(files.identity(drive.state, drive.family.values.parameters.language), found)
        new_file.write(own, text, workspace.output)
        workspace.notify(f"{who}: {len(found.readings)} settings{new_file.place(own)}")
        if found.unread:
            names = files.listed([name for name, _ in found.unread])
            workspace.notify(f"{who}: not read: {names}; [unread] in the file has the reasons", warning=True)

    await each(workspace, targets(workspace, target), keep)


async def read(workspace: Workspace, target: str) -> None:
    """Read the settings of drives, and say how many there are; screens show them."""

    async def count(drive: Drive) -> None:
        found = await files.read(workspace, drive, "reading")
        workspace.notify(f"{workspace.display_name(drive)}: {len(found.readings)} settings read")

    await each(workspace, targets(workspace, target), count)


async def save(workspace: Workspace, target: str) -> None:
    """Have drives keep their present settings, after a question. Raises Diagnostic where it is not agreed to."""

    async def keep(drive: Drive) -> None:
        family, who = drive.family.values.parameters, workspace.display_name(drive)
        await workspace.confirm(f"'{family.saving}' keeps all present settings over power-off", who)
        await transferring(drive, family.save(drive.state))
        workspace.notify(f"{who}: its settings are saved")

    await each(workspace, targets(workspace, target), keep)


async def diff(
    workspace: Workspace, target: str, *, name: str = "", other: Drive | None = None, as_json: bool = False
) -> bool:
    """Print what differs from a file, another drive, or (without both) the defaults; whether anything does."""
    differs = False
    reference = await files.read(workspace, other, "reading") if other is not None else None
    several = is_several(target)

    async def compare(drive: Drive) -> None:
        nonlocal differs
        file = files.load(file_of(workspace, drive, name, target)) if name else None
        _check_language(workspace, drive, file, other)
        found, who = await files.read(workspace, drive, "reading"), workspace.display_name(drive)
        if file is not None and (aside := [name for name, _ in found.unread if name in file.named]):
            workspace.notify(f"{who}: not read, so not compared: {files.listed(aside)}", warning=True)
        rows = differences(found, file if reference is None else reference, who)
        differs = differs or bool(rows)
        units = {each.name: each.unit for each in found.readings}
        for setting, here, there in rows:
            if as_json:
                own = {"drive": who} if several else {}
                workspace.output(json.dumps({**own, "name": setting, "here": here, "there": there}))
            else:
                unit = f" {units[setting]}" if units.get(setting) else ""
                values = f"here {files.shown(here)}, there {files.shown(there)}{unit}"
                workspace.output(f"{f'{who}: ' if several else ''}{setting}: {values}")
        if not rows and not as_json:
            workspace.notify(f"{who}: nothing differs")

    await each(workspace, targets(workspace, target), compare)
    return differs


def _check_language(workspace: Workspace, drive: Drive, file: files.SettingsFile | None, other: Drive | None) -> None:
    """Raise Diagnostic for a file or a drive of another family: no setting has the same meaning there."""
    own = drive.family.values.parameters.language
    who = f"{workspace.display_name(drive)} has {own}; their settings cannot be compared"
    if file is not None and file.language and file.language != own:
        raise Diagnostic(f"has settings of {file.product or 'a drive'} in {file.language}, and {who}", file.path)
    if other is not None and (theirs := other.family.values.parameters.language) != own:
        raise Diagnostic(f"{workspace.display_name(other)} has {theirs}, and {who}")


def differences(found: Readings, other: files.SettingsFile | Readings | None, who: str) -> list[Difference]:
    """Compare with a file, and all variables where it has their table; with another drive; or with the defaults.

    Raises Diagnostic where the defaults are not known.
    """
    there: Mapping[str, Value]
    if other is None:
        there, names = found.defaults, [*found.defaults]
        if not any(each.default is not None for each in found.readings if each.section != VARIABLES):
            raise Diagnostic(f"{who}: the defaults of its settings are not known", hint="compare with a file")
    elif isinstance(other, Readings):
        there = other.values
        names = [name for name in (found.values | there) if name not in OWN_NAME]
    else:
        there, unread = other.named, {name for name, _ in found.unread}
        names = [name for name in there if name not in unread]
        if other.has_variables:
            names += [each.name for each in found.readings if each.section == VARIABLES and each.name not in there]
    rows = [(name, found.values.get(name), there.get(name)) for name in names]
    return [each for each in rows if not same(each[1], each[2])]


async def restore_each(session: Session, name: str, target: str, options: Options) -> None:
    """Restore drives from their files; every file is read before the first step.

    Raises Diagnostic where the file for one of several drives names another drive, or none.
    """
    drives = targets(session, target)
    loaded = {drive: files.load(file_of(session, drive, name, target)) for drive in drives}
    for drive, file in loaded.items() if is_several(target) else ():
        if file.name != (drive.state.name or drive.address):
            who, whose = session.display_name(drive), f"drive {file.name}" if file.name else "no drive"
            hint = "for several drives each file names its own; --drive ADDR restores one drive from any file"
            raise Diagnostic(f"names {whose}, and is to be restored to {who}; nothing was sent", file.path, hint)

    async def put(drive: Drive) -> None:
        await restore(session, drive, loaded[drive], options)

    await each(session, drives, put)
