"""A restore: the steps from a drive's settings to those of a file, shown, agreed to, sent, and verified.

Nothing is sent before a person or `--yes` has agreed. A step that fails ends the restore; what was done until then is
said. Settings that can move the motor, and those of communication, are left alone unless they are named.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, DriveError, NoAnswer, Refused
from multidrop.dialects.values import COMMUNICATION, IO, PARAMETERS, Change, Permission, Plan, Readings, Value, same
from multidrop.shell.channel import running, transferring
from multidrop.shell.params.file import SettingsFile, listed, read, shown

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session
    from multidrop.shell.workspace import Workspace


CLOSE = 0.5
"""The likeness from which a name is suggested: names have two letters."""


@dataclass(frozen=True)
class Options:
    """What a restore may do."""

    named: frozenset[str] = frozenset()
    """Settings that are only written when they are named."""
    communication: bool = False
    save: bool = False
    dry_run: bool = False
    other_product: bool = False


class Unlike(DriveError):
    """The drive has other values than were sent."""


@dataclass
class Wanted:
    """The values of a file for one drive, and the names that are left alone."""

    values: dict[str, Value]
    withheld: dict[str, str] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    """Those of `withheld` that the drive should have, and that could not be read."""


async def restore(session: Session, drive: Drive, file: SettingsFile, options: Options) -> None:
    """Send what differs from a file. Raises Diagnostic or DriveError."""
    who, family = session.display_name(drive), drive.family.values.parameters
    if file.language and file.language != family.language:
        what = f"has settings of {file.product or 'a drive'} in {file.language}, and {who} has {family.language}"
        raise Diagnostic(f"{what}; nothing was sent", file.path)
    if file.product and drive.product and file.product != drive.product and not options.other_product:
        what = f"has the settings of an {file.product}, and {who} is an {drive.product}; nothing was sent"
        raise Diagnostic(what, file.path, "--other-product restores what both have")
    present = await read(session, drive, "reading")
    wanted = _wanted(present, file, options, who)
    try:
        permission = Permission(options.named, options.communication)
        plan = family.plan(drive.state, present, wanted.values, permission)
    except Diagnostic as problem:
        raise Diagnostic(f"{problem.message} (nothing was sent)", problem.where or file.path, problem.hint) from None
    others = {each.address for each in session.buses[drive.link.name].all_drives if each is not drive}
    if reason := family.conflict(plan, others - {""}):
        raise Diagnostic(f"{who}: {reason}; nothing was sent", file.path)
    _show(session, who, plan, wanted)
    if not plan.changes:
        left = wanted.withheld or plan.withheld or plan.impossible
        session.notify(f"{who}: nothing {'else ' if left else ''}differs from {file.path}")
        _check_complete(wanted, who)
        return
    await check_ready(drive)
    if options.dry_run:
        session.notify(f"{who}: {len(plan)} steps; nothing was sent (--dry-run)")
        return
    await _agree(session, drive, present, plan, file)
    aside = {*wanted.withheld, *dict(plan.withheld), *dict(plan.impossible)}
    goal = {name: value for name, value in wanted.values.items() if name not in aside}
    session.addressed.add((drive.link.name, drive.address))
    with _accounted(session, who, plan) as written:
        with running(session, f"{who}: restore") as progress:
            for change in plan:  # a step that was named can start motion: an early end then stops the drive's line
                if change.name in options.named and drive.starts(change.text):
                    session.starting(drive)
                await transferring(drive, family.write(drive.state, change))
                written.append(change)
                progress(len(written), len(plan))
        await _finish(session, drive, plan, goal, options)
    _check_complete(wanted, who)


def _check_complete(wanted: Wanted, who: str) -> None:
    """Raise NoAnswer where settings of the file could not be read, so that they are not restored."""
    if wanted.unread:
        names = ", ".join(wanted.unread)
        raise NoAnswer(f"{who}: {names} could not be read and is left alone; restore the file again")


def _wanted(present: Readings, file: SettingsFile, options: Options, who: str) -> Wanted:
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


def _show(workspace: Workspace, who: str, plan: Plan, wanted: Wanted) -> None:
    """Print the steps, and say which settings are left alone."""
    for change in plan:
        before = "" if change.before is None else f" (was {shown(change.before)})"
        workspace.output(f"{who}: {change.text}{before}{', for a while' if change.temporary else ''}")
    for remark in plan.remarks:
        workspace.notify(f"{who}: {remark}", warning=True)
    for name, reason in plan.withheld:
        way = "--communication" if reason == COMMUNICATION else f"--with {name}"
        workspace.notify(f"{who}: {name} is left alone: {reason} ({way} restores it)", warning=True)
    for name, reason in {**wanted.withheld, **dict(plan.impossible)}.items():
        workspace.notify(f"{who}: {name} is left alone: {reason}", warning=True)


async def check_ready(drive: Drive) -> None:
    """Raise Refused where the drive is at work."""
    if reason := await transferring(drive, drive.family.values.parameters.ready(drive.state)):
        raise Refused(f"{reason} (nothing was sent)")


async def _agree(workspace: Workspace, drive: Drive, present: Readings, plan: Plan, file: SettingsFile) -> None:
    """Ask, and make sure that the drive has not changed while a person thought about it."""
    names = list(dict.fromkeys(change.name for change in plan if not change.temporary))
    who, agreed = workspace.display_name(drive), workspace.agreed
    await workspace.confirm(
        f"{len(names)} setting{'s' * (len(names) != 1)} of {file.path} will be written: {listed(names)}", who
    )
    if agreed:
        return
    await check_ready(drive)
    again = await read(workspace, drive, "reading again")
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
            temporary = [f"{each.name}={shown(each.after)}" for each in last.values() if each.temporary]
            held_for_now = f"; for a while it has {', '.join(temporary)}" if temporary else ""
            names = f": {', '.join(last)}" if last else ""
            more = f"; {plan.changes[done].text} may be done{held_for_now}; nothing was saved; restore again"
            account = f"{done} of {len(plan)} steps are done{names}{more}"
        workspace.notify(f"{who}: {account}", warning=True)
        raise


async def _finish(workspace: Workspace, drive: Drive, plan: Plan, goal: Mapping[str, Value], options: Options) -> None:
    """Read back all settings of the file, and save them. Raises DriveError where the drive has others."""
    who = workspace.display_name(drive)
    after = (await read(workspace, drive, "verifying")).values
    wrong = [name for name, value in goal.items() if name in after and not same(value, after[name])]
    if wrong:
        values = ", ".join(f"{name} is {shown(after[name])}, not {shown(goal[name])}" for name in wrong)
        raise Unlike(f"{who}: read back after the restore: {values}; nothing was saved")
    written = {change.name for change in plan}
    unseen = sorted(name for name in written if name not in after)
    aside = f", without {', '.join(unseen)}, which cannot be read" if unseen else ""
    result = f"{who}: {len(written)} setting{'s' * (len(written) != 1)} restored and read back{aside}"
    saving = drive.family.values.parameters.saving
    if options.save:
        await transferring(drive, drive.family.values.parameters.save(drive.state))
        workspace.notify(f"{result}; saved ({saving})", outcome=True)
    else:
        workspace.notify(f"{result}; not saved, so lost at power-off: --save keeps it ({saving})", warning=True)
