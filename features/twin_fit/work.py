"""`multidrop twin fit`: the values of each axis that a log tells, said and put into the cell.

Theory of operation. The bytes that were sent go to the cell's drives once more, at their times; these have any torque,
so they command what the real ones commanded. A sample has position and velocity of one moment. In a ramp the commanded
velocity gives that moment, whatever the line delayed; the position that was commanded then, less the measured one, is
the lag. A counter begins anywhere, so it is compared at rest before. Where it has moved against the command by the next
rest, the move has lost steps: it is one that stalled.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic, DriveError
from multidrop.base.files import utf8_of, why
from multidrop.base.text import counted, whole
from multidrop.drives.drive import Drive
from multidrop.features.twin_fit.estimate import FEWEST, MARGIN, UNITS, AxisEvidence, Estimate, LagPoint, estimates
from multidrop.shell.line_syntax import EVERYONE, join_target
from multidrop.shell.log import files, steps
from multidrop.shell.log.decoding import Decoding, printed
from multidrop.shell.log.files import BEGIN
from multidrop.shell.log.steps import LoggedPoll, LoggedStep
from multidrop.shell.log.targets import Place, targets
from multidrop.shell.streams.stdout import write
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import Cell, DriveSpec, Faults
from multidrop.simulator.family import Effort, Shadow
from multidrop.simulator.floor import Floor
from multidrop.simulator.kinematics import Profile
from multidrop.simulator.torque import FULL_STEPS

if TYPE_CHECKING:
    from multidrop.shell.session import Session

NEAR = 0.1
"""Seconds between the time of a sample in the log and the moment of its velocity, at most."""
UNEVEN = 0.01
"""The part by which a velocity that was read may differ from the commanded one."""
SETTLED = 0.2
"""Seconds after which a drive is at rest whose velocity was not read."""
QUESTION_DELAY = 0.02
"""Seconds between the time of a typed question in the log and the reading, as far as the speed is concerned."""
LOST = 0.5
"""Full steps; more of them between two rests are lost."""
Axis = tuple[str, str, str]
"""Bus and name in the cell, and the axis."""


class AxisReading(NamedTuple):
    """What was read of an axis at a time, and what it commanded. `lag`: steps; None: not read."""

    at: float
    effort: Effort
    position: int | None = None
    velocity: int | None = None
    lag: int | None = None


def readings(
    path: Path, cell: Cell, drives: Mapping[Place, Drive], log: Iterable[LoggedPoll | LoggedStep]
) -> dict[Axis, list[AxisReading]]:
    """Play the bytes of a log into the cell; return the readings of each axis."""
    floor = Floor(_of_any_torque(cell))
    decodings = {place: Decoding(drive) for place, drive in drives.items()}
    events = sorted([*_sent(path), *log], key=lambda each: each.at)
    by_axis: dict[Axis, list[AxisReading]] = defaultdict(list)
    for event in events:
        now = (event.at - events[0].at).total_seconds()
        while (due := floor.deadline) is not None and due <= now:
            floor.advance(due)
        floor.advance(now)
        place = (event.bus, event.drive)
        if isinstance(event, SentBytes):
            wires = {drives[other].link.name for other in drives if other[0] == event.bus}
            for wire in wires & floor.wires.keys():
                floor.wires[wire].receive(event.data, now)
            continue
        if (drive := drives.get(place)) is None or (shadow := _shadow(floor, drive)) is None:
            continue
        bus, name = drive.link.name, shadow[0].name
        efforts = shadow[1].efforts()
        for axis, reading in _read(event, now, drive, decodings[place], efforts):
            by_axis[bus, name, axis].append(reading)
    return by_axis


def _read(
    each: LoggedPoll | LoggedStep, now: float, drive: Drive, decoding: Decoding, efforts: Mapping[str, Effort]
) -> Iterator[tuple[str, AxisReading]]:
    measured = decoding.take(each) if isinstance(each, LoggedPoll) else printed(each, drive)
    for one in measured:
        if (effort := efforts.get(one.axis)) is not None:
            yield one.axis, AxisReading(now, effort, one.position, one.velocity)
    if isinstance(each, LoggedStep) and len(each.printed) == 1:
        for axis, effort in efforts.items():
            asked = effort.lag and " ".join(each.text.upper().split()) == drive.family.question(effort.lag)
            lag = whole(each.printed[0].strip(), -(2**31), 2**31 - 1) if asked else None
            if lag is not None:
                yield axis, AxisReading(now, effort, lag=lag)


class SentBytes(NamedTuple):
    """Bytes that were sent to a bus."""

    at: datetime
    bus: str
    drive: str
    data: bytes


def _sent(path: Path) -> list[SentBytes]:
    """The bytes of the last session of a log."""
    writes: list[SentBytes] = []
    for line in files.whole(path):
        entry = line.entry
        if entry is not None and entry.kind == "log" and entry.text.startswith(BEGIN):
            writes = []
        elif entry is not None and entry.kind == "sent":
            writes.append(SentBytes(entry.time, entry.bus, entry.drive, entry.text.encode("latin-1")))
    return writes


def _of_any_torque(cell: Cell) -> Cell:
    """The cell without what holds a shaft up, and without faults."""

    def free(drive: DriveSpec) -> DriveSpec:
        plain = [
            replace(world, motor=None, load=0.0, stall_at=None, locked=()) for world in (drive.world, *drive.further)
        ]
        return replace(drive, world=plain[0], further=tuple(plain[1:]))

    buses = [bus._replace(drives=tuple(map(free, bus.drives)), faults=Faults()) for bus in cell.buses]
    return cell._replace(buses=tuple(buses))


def _shadow(floor: Floor, drive: Drive) -> tuple[DriveSpec, Shadow] | None:
    there = [each for each in floor.drives if each.bus == drive.link.name]
    named = [each for each in there if each.spec.name == drive.address] or (there if len(there) == 1 else [])
    shadow = named[0].unit.shadow if named else None
    return (named[0].spec, shadow) if shadow is not None else None


def evidence(read: Sequence[AxisReading]) -> AxisEvidence:
    """Sort the readings of an axis into rests and moves."""
    points: list[LagPoint] = []
    moves: dict[Profile, Effort] = {}
    stalled = strange = 0
    odd: list[bool] = []
    base: float | None = None
    moved: list[AxisReading] = []
    for reading in read:
        if reading.lag is not None:
            steady = _steady(reading)
            points += [steady] if steady is not None and abs(steady.lag) <= 1 else []
            moved += [reading] if reading.effort.profile.moving(reading.at) else []
        elif reading.position is not None and not _rests(reading):
            moved.append(reading)
        elif reading.position is not None:
            effort = reading.effort
            origin = effort.profile.position(reading.at) / effort.count - reading.position
            if base is not None and abs(origin - base) * effort.count > LOST * effort.turn / FULL_STEPS:
                stalled += 1
            elif base is not None:
                ramps = [point for one in moved if (point := _point(one, base)) is not None]
                points += [ramp for ramp in ramps if abs(ramp.lag) <= 1]
                strange += sum(abs(ramp.lag) > 1 for ramp in ramps)
                odd += [*map(_odd, moved)]
                moves |= {one.effort.profile: one.effort for one in moved}
            base, moved = origin, []
    if any(reading.lag is not None for reading in moved):
        moves |= {one.effort.profile: one.effort for one in moved}
    seen = any(reading.effort.measured or reading.effort.stalls for reading in read)
    moves = {profile: move for profile, move in moves.items() if move.measured or move.lag or move.stalls}
    return AxisEvidence(points, list(moves.values()), stalled, seen, strange, odd)


def _rests(reading: AxisReading) -> bool:
    """Whether an axis is at rest, and commanded to be."""
    wait = SETTLED if reading.velocity is None else 0.0
    return not reading.velocity and reading.effort.profile.end + wait <= reading.at


def _odd(reading: AxisReading) -> bool:
    """Whether the cell commands no such velocity near the time of the sample, so its settings are others."""
    profile, count, at = reading.effort.profile, reading.effort.count, reading.at
    if reading.velocity is None:
        return False
    joints = (end for segment in profile.segments for end in (segment.start, segment.end))
    speeds = [abs(profile.velocity(min(max(joint, at - NEAR), at + NEAR))) / count for joint in (-inf, *joints, inf)]
    speed = abs(reading.velocity)  # not every drive says the direction
    edge = 1 + UNEVEN * speed
    return not min(speeds) - edge <= speed <= max(speeds) + edge


def _point(reading: AxisReading, origin: float) -> LagPoint | None:
    """The lag in a ramp, at the moment of the velocity; None where no ramp near has it."""
    effort, profile = reading.effort, reading.effort.profile
    if not effort.measured or not reading.velocity or reading.position is None:
        return None
    moment = _moment(profile, reading.velocity * effort.count, reading.at, effort.count)
    if moment is None:
        return None
    direction, full = profile.direction(moment), effort.turn / FULL_STEPS
    behind = profile.position(moment) - (reading.position + origin) * effort.count
    return _made(effort, moment, behind * direction / full, effort.count / full, direction)


def _steady(reading: AxisReading) -> LagPoint | None:
    """The lag as it was read, where the torque does not change near."""
    effort, profile, at = reading.effort, reading.effort.profile, reading.at
    joints = [profile.end, *(segment.start for segment in profile.segments)]
    if reading.lag is None or not profile.moving(at) or any(abs(joint - at) < SETTLED / 4 for joint in joints):
        return None
    full, changing = effort.turn / FULL_STEPS, abs(profile.acceleration(at) / (profile.velocity(at) or 1.0))
    doubt = abs(reading.lag) * changing * QUESTION_DELAY  # the speed of then is not known
    return _made(effort, at, reading.lag / full, (1 + doubt) / full, 1.0)


def _made(effort: Effort, at: float, lag: float, grain: float, direction: float) -> LagPoint:
    profile, along = effort.profile, effort.profile.direction(at)
    speed, rate = profile.velocity(at) * along, profile.acceleration(at) * along
    return LagPoint(lag, speed / effort.turn, rate / effort.turn, effort.current, grain, direction)


def _moment(profile: Profile, velocity: float, near: float, edge: float) -> float | None:
    """The time in a ramp at which it has a velocity, the nearest to a time; none within `edge` of the ends."""
    moments = []
    for segment in profile.segments:
        if not segment.changing or segment.end == inf:
            continue
        low, high = segment.start, segment.end
        first, last = segment.velocity_at(low), segment.velocity_at(high)
        if not min(first, last) + edge < velocity < max(first, last) - edge:
            continue
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if (segment.velocity_at(middle) < velocity) == (first < last) else (low, middle)
        moments.append(high)
    nearest = min(moments, key=lambda at: abs(at - near), default=None)
    return nearest if nearest is not None and abs(nearest - near) <= NEAR else None


async def fit(session: Session, log: Path, cell: Path, as_json: bool) -> Callable[[], None]:
    """Fit the drives of an open cell to a log, and print what was found; return what puts it into the cell's file.

    Raises Diagnostic for a log or a cell that is not one, DriveError where nothing can be told.
    """
    logged, text = steps.read(log), utf8_of(cell)
    shop = cells.read(text, str(cell), cell.absolute().parent, session.settings.allowed)
    everything: list[LoggedStep | LoggedPoll] = [*logged.steps, *logged.polls]
    drives = {place: drive for place, drive in targets(session, everything).items() if place[1] not in EVERYONE}
    specs = {(bus.name, drive.name): drive for bus in shop.buses for drive in bus.drives}
    motors = {place: motor for place, spec in specs.items() if (motor := spec.world.motor) is not None}
    told: dict[Axis, dict[str, float]] = {}
    read = readings(log, shop, drives, everything)
    if not read:  # the reply to another name is none
        theirs, ours = (", ".join(join_target(*place) for place in places) or "none" for places in (drives, specs))
        why = (
            f"drives of the log: {theirs}; of the cell: {ours}"
            if theirs != ours
            else "it has no position that was read"
        )
        raise DriveError(f"{log} tells no value; {cell} is unchanged; {why}")
    for axis, of_axis in read.items():
        seen = evidence(of_axis)
        known = estimates(seen, motors[axis[:2]]) if axis[:2] in motors else {}
        for name in UNITS:
            write(sys.stdout, _line(axis, name, known.get(name), seen, as_json))
        told[axis] = {
            name: float(f"{estimate.value:.4g}") for name, estimate in known.items() if estimate.told and name != MARGIN
        }
    told = {axis: values for axis, values in told.items() if values}
    if not told:
        raise DriveError(f"{log} tells no value; {cell} is unchanged")
    return partial(_keep, cell, text, shop, told)


def _line(axis: Axis, name: str, known: Estimate | None, seen: AxisEvidence, as_json: bool) -> str:
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


def _why(known: Estimate | None, seen: AxisEvidence) -> str:
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


def _keep(path: Path, before: str, shop: Cell, told: Mapping[Axis, Mapping[str, float]]) -> None:
    """Put values into a cell's file, with its remarks and its layout; it is replaced as a whole.

    `before`: the text that was fitted. Raises Diagnostic, also for a file that has another text now.
    """
    import tomlkit

    if utf8_of(path) != before:
        raise Diagnostic("has changed since it was read", str(path), "fit it again; the file is as it is now")
    document: Any = tomlkit.parse(before)
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
