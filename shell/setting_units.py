"""Settings, words and distances of drives in engineering units: for parameters, help, and twins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.dialects.units import Takes

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session
    from multidrop.shell.units import SessionUnits


def taken(drive: Drive, name: str) -> tuple[str, Takes] | None:
    """What a setting or a word of a drive takes: its axis, and how that counts; None: no quantity."""
    units = drive.family.units
    if units.offers("setting"):
        return units.setting(name)
    line = drive.family.assign(name, "1")
    fields = units.fields(line) if line is not None else ()
    return (fields[0].axis, fields[0].takes) if fields else None


def shown(units: SessionUnits, drive: Drive, name: str, value: object) -> str:
    """` (50 mm/s)`, to follow the value of a setting; empty where it has none in units."""
    quantity = taken(drive, name) if isinstance(value, int | float) else None
    return "" if quantity is None else units.words(drive, quantity[0], float(str(value)), quantity[1])


def example(units: SessionUnits, drive: Drive, name: str) -> str:
    """What a word takes, for a person: `a velocity without sign, as in {12.5 mm/s}; 1 mm/s is 10240`; else empty."""
    quantity = taken(drive, name)
    axis = units.of(drive, quantity[0]) if quantity is not None else None
    measure = axis.current if axis is not None else None
    if quantity is None or axis is None or measure is None or not measure.counts(quantity[1]):
        return ""
    takes = Takes.DISTANCE if quantity[1] is Takes.PLACE else quantity[1]
    unit, one = measure.unit_for(takes), f"{abs(1 / measure.value(1, takes)):.6g}"
    return f"{quantity[1].value}, as in {{12.5 {unit}}}; 1 {unit} is {one} ({axis.scale}){'' if axis.sure else '?'}"


def distance(session: Session, drive: Drive, axis: str, steps: int) -> str:
    """A distance of an axis of a drive in its unit, as in `0.5 mm`; empty where the axis has no scale."""
    return session.units.words(drive, axis, steps, Takes.DISTANCE).strip(" ()") if session.scaled else ""
