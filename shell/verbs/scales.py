"""What verbs say of the scales of axes, and the axis that a line means."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Call


def axes_of(call: Call, drive: Drive) -> list[str]:
    return sorted(call.session.units.axes(drive))


def meant(call: Call, target: str) -> tuple[Drive, str]:
    """The drive and the axis of `ADDR`, `ADDR.AXIS`, or of nothing: the selected drive. Raises Diagnostic."""
    session, (address, _, axis) = call.session, target.rpartition(".")
    known = {
        name for bus in session.buses.values() for each in bus.drives.values() for name in (each.address, each.label)
    }
    if not address or target.rpartition(":")[2] in known:
        address, axis = target, ""
    drive = call.drive(address)
    if drive not in session.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {target}", "/units", "/drives lists them")
    axes = drive.family.units.axes()
    if axis.lower() not in axes:
        names = ", ".join(f"{drive.address}.{each}" for each in axes if each)
        raise Diagnostic(f"no axis {target}", "/units", f"valid: {names or drive.address}")
    return drive, axis.lower()


def described(call: Call, drive: Drive, name: str) -> str:
    """A scale in one line: `a: 5 mm/turn, 51200 a turn (MS=256, EE=0), travel 0 mm to 300 mm`."""
    from multidrop.dialects.units import Takes

    session = call.session
    axis = session.units.of(drive, name)
    assert axis is not None  # it was listed
    shown = session.display_name(drive) or drive.shown
    parts = [f"{shown}.{name}" if name else shown, str(axis.scale)]
    if axis.measure is not None:
        basis = axis.measure.basis
        turn = f"{float(basis.turn):g} steps a turn" if basis.turn else ""
        parts += [turn, f"one step is {axis.measure.shown(1, Takes.DISTANCE)}", str(basis), basis.assumed]
    else:
        parts.append(axis.problem)
    if axis.scale.anchored:
        parts.append(f"zero {axis.scale.shown(axis.scale.zero)}")
    if axis.scale.travel is not None:
        parts.append("travel {} to {}".format(*map(axis.scale.shown, axis.scale.travel)))
    if not session.units.referenced(drive, name):
        parts.append("not referenced")
    if changes := drive.counting.changes(name):
        parts.append(
            f"not shown in units, as {', '.join(changes)}: /units {session.units.typed(drive, name)} accepts that"
        )
    elif not axis.holds:
        parts.append("not shown in units, as what it rests on may have changed and was not read since")
    elif axis.measure is not None and not axis.sure:
        parts.append("not confirmed since a program ran")
    return f"{parts[0]}: {', '.join(filter(None, parts[1:]))}"
