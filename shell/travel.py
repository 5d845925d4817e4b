"""The travel of axes: a move whose end is known, and leaves it, is asked about. A help for people, and no limit switch.

The position is read before the line. Where the end is not known (a velocity, a program, a move in motion) that is said
once. A move back towards the travel is never asked about.
"""

from __future__ import annotations

from fractions import Fraction

from multidrop.dialects.units import Field, Takes
from multidrop.drives.drive import Drive, confirmed_motion
from multidrop.shell.configuration import TRAVEL
from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.origin import Origin
from multidrop.shell.units import ScaledAxis, SessionUnits


async def ask(units: SessionUnits, drive: Drive, text: str, origin: Origin) -> None:
    """Ask before a move that leaves the travel of its axis; say once where the end is not known."""
    if drive.stores or (drive.address in EVERYONE and not units.workspace.bus(drive.link.name).all_drives):
        return
    for other in units.meant(drive):
        limited = {name: axis for name, axis in units.axes(other).items() if axis.scale.travel is not None}
        if not limited or not other.starts(text):
            continue
        fields = [field for field in other.family.units.fields(text) if field.moves]
        ends = other.family.only_ends(text)
        if not fields and not ends and other.family.referencing(text) is None:
            for name, axis in limited.items():
                _unchecked(units, other, name, axis, f"the end of '{text}' is not known")
        for field in fields:
            if field.axis in limited:
                await _check(units, other, field, limited[field.axis], text, origin)


def unchecked(units: SessionUnits, drive: Drive, text: str) -> None:
    """Say that the travel is not checked of what a verb starts: a program, or a line that begins one."""
    family = drive.family
    if text and any(field.moves for field in family.units.fields(text)):
        return
    ends = bool(text) and family.only_ends(text)
    for name, axis in units.axes(drive).items():
        if axis.scale.travel is not None and not ends:
            what = f"the end of '{text}'" if text else "what a program does"
            _unchecked(units, drive, name, axis, f"{what} is not known")


def _unchecked(units: SessionUnits, drive: Drive, name: str, axis: ScaledAxis, why: str) -> None:
    if not axis.told:
        axis.told = True
        told = f"{units.name(drive, name)}: travel not checked: {why}"
        units.workspace.notify(told, bus=drive.link.name, warning=True)


async def _check(units: SessionUnits, drive: Drive, field: Field, axis: ScaledAxis, text: str, origin: Origin) -> None:
    name, travel = units.name(drive, field.axis), axis.scale.travel
    assert travel is not None
    takes = await units.target([drive], [field]) or field.takes
    measure = await units.measure(drive, field.axis)
    now = await units.read(drive, field.axis, axis.scale.full_steps)
    if axis.basis is None or now.settings != axis.basis.settings:
        units.lost(drive, field.axis, axis)
    if not units.referenced(drive, field.axis):
        why = "its position is not referenced"
        if takes is Takes.PLACE:
            return await _confirm(units, f"'{text}' may leave the travel: {why}", name, origin)
        return _unchecked(units, drive, field.axis, axis, why)
    motion = next((of_axis for of_axis in await confirmed_motion(drive) if of_axis.axis == field.axis), None)
    at_rest = motion is not None and not motion.velocity
    if motion is None or not (at_rest or takes is Takes.PLACE):
        return _unchecked(units, drive, field.axis, axis, "it moves")
    number = int(text[field.start : field.stop])
    end = number if takes is Takes.PLACE else motion.position + number
    begin = motion.position if at_rest else end
    axis.told = False
    if _leaves(measure.exact(begin), measure.exact(end), travel):
        low, high = (axis.scale.shown(each) for each in travel)
        await _confirm(units, f"'{text}' ends at {measure.shown(end)}, and the travel is {low} to {high}", name, origin)


async def _confirm(units: SessionUnits, what: str, name: str, origin: Origin) -> None:
    if not (origin.may_leave_travel or TRAVEL in units.workspace.settings.guards.off):
        await units.workspace.questions.confirm(what, name, by=origin.by, beyond=True)


def _leaves(begin: Fraction, end: Fraction, travel: tuple[Fraction, Fraction]) -> bool:
    """Whether a move ends outside; not where it only comes back towards the travel."""
    low, high = travel
    if low <= end <= high:
        return False
    return not (end < begin and end > high) and not (begin < end < low)
