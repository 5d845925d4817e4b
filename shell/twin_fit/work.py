"""`multidrop twin fit`: the values of each axis that a log tells, said and put into the cell."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic, DriveError
from multidrop.dialects.files import utf8_of, why
from multidrop.dialects.text import counted
from multidrop.macros.atomic import write_atomically
from multidrop.shell.batch.replay import targets
from multidrop.shell.line_syntax import EVERYONE, join_target
from multidrop.shell.log import steps
from multidrop.shell.log.steps import Exchange, Step
from multidrop.shell.streams.stdout import write
from multidrop.shell.twin_fit.estimate import FEWEST, MARGIN, UNITS, Estimate, Evidence, estimates
from multidrop.shell.twin_fit.evidence import Axis, evidence, readings
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import Cell

if TYPE_CHECKING:
    from multidrop.shell.session import Session


async def fit(session: Session, log: Path, cell: Path, as_json: bool) -> Callable[[], None]:
    """Fit the drives of an open cell to a log, and print what was found; return what puts it into the cell's file.

    Raises Diagnostic for a log or a cell that is not one, DriveError where nothing can be told.
    """
    logged, shop = steps.read(log), cells.load(cell, session.settings.allowed)
    everything: list[Step | Exchange] = [*logged.steps, *logged.polls]
    drives = {place: each for place, each in targets(session, everything).items() if place[1] not in EVERYONE}
    specs = {(bus.name, each.name): each for bus in shop.buses for each in bus.drives}
    motors = {place: motor for place, each in specs.items() if (motor := each.world.motor) is not None}
    told: dict[Axis, dict[str, float]] = {}
    read = readings(log, shop, drives, everything)
    if not read:  # the reply to another name is none
        theirs, ours = (", ".join(join_target(*each) for each in places) or "none" for places in (drives, specs))
        why = (
            f"drives of the log: {theirs}; of the cell: {ours}"
            if theirs != ours
            else "it has no position that was read"
        )
        raise DriveError(f"{log} tells no value; {cell} is unchanged; {why}")
    for axis, each in read.items():
        seen = evidence(each)
        known = estimates(seen, motors[axis[:2]]) if axis[:2] in motors else {}
        for name in UNITS:
            write(sys.stdout, _line(axis, name, known.get(name), seen, as_json))
        told[axis] = {name: float(f"{each.value:.4g}") for name, each in known.items() if each.told and name != MARGIN}
    told = {axis: values for axis, values in told.items() if values}
    if not told:
        raise DriveError(f"{log} tells no value; {cell} is unchanged")
    return partial(_keep, cell, shop, told)


def _line(axis: Axis, name: str, known: Estimate | None, seen: Evidence, as_json: bool) -> str:
    told = known is not None and known.told
    why = "" if told else _why(known, seen)
    if as_json:
        fact: dict[str, object] = {"drive": _name(axis), "value": name, "unit": UNITS[name], "found": None}
        if known is not None and told:
            fact |= {"found": float(f"{known.value:.4g}"), "within": float(f"{known.within:.2g}")}
        return json.dumps(fact if told else fact | {"why": why})
    if known is None or not told:
        return f"{_name(axis)} {name} unknown: {why}"
    return f"{_name(axis)} {name} {known.value:.4g} +- {known.within:.2g} {UNITS[name]}"


def _why(known: Estimate | None, seen: Evidence) -> str:
    if known is None:
        return "the drive has no motor in the cell"
    most = f"; at most {known.most:.3g}" if known.most < inf else ""
    if not seen.fits:
        return "the moves are not those that the cell commands; snapshot the drive, and log again"
    number = len(seen.different)
    if number >= FEWEST:
        return f"the moves do not tell it from the others{most}"
    if not (seen.seen or seen.points):
        return "the drive reports the steps that it commands"
    stalled = f", {counted(seen.stalled, 'move')} stalled" if seen.stalled else ""
    return f"{counted(number, 'lag')} in ramps, {FEWEST} are needed{stalled}{most}"


def _name(axis: Axis) -> str:
    bus, drive, own = axis
    return join_target(bus, drive) + (f".{own}" if own else "")


def _keep(path: Path, shop: Cell, told: Mapping[Axis, Mapping[str, float]]) -> None:
    """Put values into a cell's file, with its remarks and its layout; it is replaced as a whole. Raises Diagnostic."""
    import tomlkit

    document: Any = tomlkit.parse(utf8_of(path))
    for (bus, drive, axis), values in told.items():
        (at,) = (n for n, each in enumerate(shop.buses) if each.name == bus)
        (own,) = (n for n, each in enumerate(shop.buses[at].drives) if each.name == drive)
        table = document["bus"][at]["drive"][own]
        for key in ("world", axis):
            if key:
                if key not in table:
                    inline = isinstance(table, tomlkit.items.InlineTable)
                    table[key] = tomlkit.inline_table() if inline else tomlkit.table()
                table = table[key]
        table.update(values)
    text = tomlkit.dumps(document)
    cells.read(text, str(path), path.absolute().parent)
    try:
        write_atomically(path, text.encode())
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    for place, values in told.items():
        write(sys.stderr, f"{path}: {', '.join(values)} of {_name(place)} written")
