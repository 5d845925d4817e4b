"""Engineering units at work: the scales of open drives, quantities in lines.

Theory of operation. A line with a quantity becomes a line in the drive's own language before anything else asks about
it: guards, recorders of motion and the drive never see a quantity. What the scale rests on was read before, at the
opening or by `/units`. It is read again in the same conversation right before the line, and where it differs nothing is
sent (`Drive.send`, `check`). The line is not converted with the new values: a person has to look first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

from multidrop.base.errors import Diagnostic, Differs, DriveError, Refused
from multidrop.dialects import Procedure
from multidrop.dialects.units import (
    PLACES,
    SHORT,
    Basis,
    Field,
    Measure,
    Scale,
    Takes,
    quantities,
    quantity,
    strange_brace,
)
from multidrop.drives.drive import confirmed_motion
from multidrop.drives.events import Unsolicited
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.scale_checks import ScaleChecks

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Check, Drive
    from multidrop.shell.workspace import Workspace

_BARE = re.compile(r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)) ?([A-Za-z]\w*?(?:/(?:s2|s|min))?)(?![a-z0-9_/])", re.ASCII)
_UNQUOTED = re.compile(r'"[^"]*(?:"|$)')


@dataclass(eq=False)
class ScaledAxis:
    """The scale of one axis, with what it rests on as last read and accepted."""

    scale: Scale
    basis: Basis | None = None
    measure: Measure | None = None
    """None: there is no basis yet, or the scale cannot be used (`problem`)."""
    problem: str = "what it rests on has not been read"
    sure: bool = False
    """No program that could change what it rests on has run since it was read."""
    holds: bool = True
    """What it rests on is what was accepted, as far as is known; else the drive's own numbers are shown."""
    told: bool = False
    """It was said that moves are not checked."""

    @property
    def current(self) -> Measure | None:
        """The measure to show numbers with; None: the drive's own are shown."""
        return self.measure if self.holds else None

    def accept(self, basis: Basis) -> None:
        """Take what was read as what the scale rests on."""
        self.basis, self.sure, self.measure, self.problem = basis, True, None, ""
        try:
            self.measure = Measure(self.scale, basis)
        except Diagnostic as problem:
            self.problem = str(problem)


@dataclass(frozen=True)
class PreparedLine:
    """A line as it is sent: its text, what runs right before it, and its quantities as shown."""

    text: str
    check: Check | None = None
    values: str = ""


class ComparedQuantity(NamedTuple):
    """A quantity in a condition: the drive's own number, not rounded, and what runs right before the question."""

    number: float
    check: Check
    shown: Callable[[float], str]
    """Shows a value of the drive with its unit."""


class SessionUnits:
    """The units of one session."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.shown = True
        """Positions are shown in units where an axis has a scale."""
        self._axes: WeakKeyDictionary[Drive, dict[str, ScaledAxis]] = WeakKeyDictionary()
        self._bases: WeakKeyDictionary[Drive, dict[tuple[str, int | None], Basis]] = WeakKeyDictionary()
        workspace.subscribe(self._overhear, Unsolicited)
        self._checks = ScaleChecks(workspace)

    def _overhear(self, event: SessionEvent) -> None:
        """Note the commands of others that show: an echo of another master's, or a program's print for a drive."""
        bus = self.workspace.buses.get(event.bus) if isinstance(event, OnBus) else None
        if bus is None or not isinstance(event, OnBus) or not isinstance(event.event, Unsolicited):
            return
        for drive in bus.drives.values() if any(each.anchored for each in bus.drives.values()) else ():
            for line in event.event.lines:
                text = line.strip().removeprefix("@").removeprefix(drive.address)
                homing = drive.family.referencing(text) if text != line.strip() or not drive.address else None
                lost = drive.anchored & {homing.axis} if homing is not None else None
                if lost:
                    drive.state.reference_lost(lost)
                    why = f"'{text}' of another sender: its places are not referenced"
                    self.workspace.notify(f"{self.name(drive, '')}: {why}", bus=bus.name, warning=True)

    # Scales

    async def look(self, drive: Drive, text: str = "") -> None:
        """Read again what the scales of a drive rest on, after a line; see `ScaleChecks.look`."""
        await self._checks.look(drive, text)

    @property
    def own(self) -> tuple[str, ...]:
        """The own units of the configuration, and those in which a simulated cell has scales."""
        scales = (axis.scale for axes in self._axes.values() for axis in axes.values())
        return (*self.workspace.settings.own_units, *(scale.kind for scale in scales if scale.kind == scale.unit.name))

    def axes(self, drive: Drive) -> dict[str, ScaledAxis]:
        """The scales of a drive by axis, as in `Motion.axis`."""
        scales = self._axes.get(drive)
        if scales is None:
            scales = self._axes[drive] = {}
            for key, scale in self._configured(drive).items():
                if drive.address in EVERYONE:
                    break
                address, _, axis = key.partition(".")
                if address in _names(drive):
                    axes = [axis.lower()] if axis else drive.family.units.axes()
                    scales |= {each: ScaledAxis(scale) for each in axes}
            _anchor(drive, scales)
        return scales

    def _configured(self, drive: Drive) -> dict[str, Scale]:
        """The scales of a line's drives: those of its simulated cell, and before them those of its saved connection."""
        bus = self.workspace.buses.get(drive.link.name)
        if bus is None or bus.link is not drive.link:
            return {}
        record = self.workspace.of(bus)
        saved = self.workspace.settings.connections.get(record.connection.name) if record.connection else None
        return {**record.opened.units, **(saved.units if saved is not None else {})}

    def of(self, drive: Drive, axis: str = "") -> ScaledAxis | None:
        """The scale of an axis; None: it has none."""
        scaled = self.axes(drive).get(axis)
        if scaled is not None:
            scaled.sure = scaled.sure and not _runs(drive)
            scaled.holds = drive.scale_holds(axis)
        return scaled

    def scales(self, drive: Drive) -> dict[str, Scale]:
        """The scales of a drive by axis, for a cell file."""
        return {name: axis.scale for name, axis in self.axes(drive).items()}

    def given(self, drive: Drive, axis: str, number: float, takes: Takes = Takes.PLACE) -> tuple[float, str] | None:
        """A number of an axis in its unit, and the unit with `?` while that is not sure.

        None: it has no scale, or none that holds.
        """
        scaled = self.of(drive, axis)
        measure = scaled.current if scaled is not None else None
        if scaled is None or measure is None or not measure.counts(takes):
            return None
        unit = measure.unit_for(takes)
        return round(measure.value(number, takes), 9), unit if scaled.sure else f"{unit}?"

    def words(self, drive: Drive, axis: str, number: float, takes: Takes = Takes.PLACE) -> str:
        """` (12.5 mm)`, to follow a number of an axis.

        Empty where it has no scale, or none that holds, or a person wants no units.
        """
        scaled = self.of(drive, axis) if self.shown else None
        measure = scaled.current if scaled is not None else None
        if scaled is None or measure is None or not measure.counts(takes):
            return ""
        return f" ({measure.shown(number, takes)}{'' if scaled.sure else '?'})"

    def referenced(self, drive: Drive, axis: str) -> bool:
        """Whether places of the machine count."""
        return not drive.state.unreferenced & {axis, ""}

    def set(self, drive: Drive, axis: str, scale: Scale) -> ScaledAxis:
        """Give an axis a scale."""
        axes = self.axes(drive)
        axes[axis] = ScaledAxis(scale)
        _anchor(drive, axes)
        self.workspace.scaled = True
        return axes[axis]

    def remove(self, drive: Drive, axis: str) -> None:
        """Take the scale of an axis away: its numbers are the drive's own again."""
        axes = self.axes(drive)
        axes.pop(axis, None)
        drive.counting.forget(axis)
        _anchor(drive, axes)

    async def confirm(self, drive: Drive) -> None:
        """Read what the scales of a drive rest on, and take it as it is. Raises DriveError or TransportLost."""
        for name, axis in self.axes(drive).items():
            recounts, basis = drive.state.recounts, await self.read(drive, name, axis.scale.full_steps)
            axis.accept(basis)
            drive.counting.accept(name, basis.settings, recounts)
            if _runs(drive):
                axis.sure = False
        self.workspace.changed()

    async def opened(self, bus: Bus) -> None:
        """Read what the scales of a bus rest on; say which of them are for no drive, or cannot be read."""
        workspace = self.workspace
        for drive in bus.drives.values():
            try:
                await self.confirm(drive)
            except DriveError as failure:
                workspace.notify(f"{bus.name}: the scale of {drive.shown} is not confirmed: {failure}", warning=True)
            for axis in self.axes(drive).values():
                if axis.problem:
                    workspace.notify(f"{bus.name}: {drive.shown}: {axis.problem}", bus=bus.name, warning=True)
        known = {name for drive in bus.drives.values() for name in _names(drive)}
        axes = {axis for drive in bus.drives.values() for axis in (*drive.family.units.axes(), "")}
        for drive in list(bus.drives.values())[:1]:
            for key in self._configured(drive):
                address, _, name = key.partition(".")
                if address not in known or name.lower() not in axes:
                    workspace.notify(f"{bus.name}: units has {key}, which no drive there is", warning=True)

    async def read(self, drive: Drive, axis: str, full_steps: int | None) -> Basis:
        """Read what the counting of an axis rests on. Raises DriveError or TransportLost."""
        basis = await drive.run(drive.family.units.basis(axis, full_steps))
        self._bases.setdefault(drive, {})[axis, full_steps] = basis
        return basis

    def last_read(self, drive: Drive, axis: str, full_steps: int | None) -> Basis | None:
        """What the counting of an axis rests on, as it was last read; None: it was not."""
        return self._bases.get(drive, {}).get((axis, full_steps))

    async def measure(self, drive: Drive, axis: str) -> Measure:
        """The measure of an axis; what it rests on is read where it was not. Raises Diagnostic where there is none."""
        scaled, name = self.of(drive, axis), self.name(drive, axis)
        if scaled is None:
            raise Diagnostic(f"{name} has no scale", "", f"/units {self.typed(drive, axis)} 5 mm/turn gives it one")
        if scaled.basis is None:
            await self.confirm(drive)
        if scaled.measure is None:
            raise Diagnostic(f"{name}: {scaled.problem}")
        return scaled.measure

    def name(self, drive: Drive, axis: str) -> str:
        shown = self.workspace.display_name(drive) or drive.shown
        return f"{shown}.{axis}" if axis else shown

    def typed(self, drive: Drive, axis: str) -> str:
        """The same as `/units` takes it: a drive without an address is named by its line and a colon."""
        name = self.name(drive, axis)
        return name if drive.label or drive.address else name.replace(drive.link.name, f"{drive.link.name}:", 1)

    # Quantities in lines

    async def line(self, drive: Drive, text: str) -> PreparedLine:
        """Convert the quantities of a line for a drive.

        Raises Diagnostic for a quantity that the line or the axis cannot take, Refused in program mode.
        """
        # A quantity that is written wrongly is refused before anything is converted.
        bare = _UNQUOTED.sub(lambda match: " " * len(match[0]), text)
        matches = list(quantities(text))
        if brace := strange_brace(text):
            if re.search(r"\d,\d", brace):
                quantity(brace.strip("{}"), self.own)
            valid = "valid: {NUMBER SPACE UNIT}, as in {12.5 mm}; a script fills in {NAME}"
            raise Diagnostic(f"{brace} is not a quantity; nothing was sent", text.strip(), valid)
        for unit in _BARE.finditer(bare):
            if unit[2].partition("/")[0] in (*PLACES, *SHORT, *self.own):
                written = f"{{{unit[1].replace(',', '.')} {unit[2]}}}"
                meant = text[: unit.start()] + written + text[unit.end() :]
                if any(field.start == unit.start() for field in drive.family.units.fields(meant)):
                    raise Diagnostic(f"{unit[0]} has a unit; nothing was sent", text.strip(), f"write {meant.strip()}")
        return await self._converted(drive, text, matches) if matches else PreparedLine(text)

    async def _converted(self, drive: Drive, text: str, found: Sequence[re.Match[str]]) -> PreparedLine:
        name = self.workspace.display_name(drive) or drive.shown
        if drive.stores:
            raise Refused(f"{name} is in program mode, which takes no quantity; nothing was sent")
        drives = self.meant(drive)
        fields = {field.start: field for field in drives[0].family.units.fields(text)}
        for match in found:
            if match.start() not in fields:
                valid = f"valid: {drive.family.units.words}, each with one"
                raise Diagnostic(f"{match[0]}: no quantity is taken here; nothing was sent", text.strip(), valid)
        target = await self.target(drives, fields.values())
        pieces, values, at, used, placed = [], [], 0, dict[str, Measure](), set[str]()
        for match in found:
            field = fields[match.start()]
            takes = target if field.takes is Takes.TARGET and target is not None else field.takes
            given, measure = quantity(match[0][1:-1], self.own), await self._common(drives, field.axis)
            if takes is Takes.PLACE:
                self._check_referenced(drives, field.axis)
                placed.add(field.axis)
            try:
                number = measure.native(given, takes)
            except Diagnostic as problem:
                raise Diagnostic(f"{problem.message}; nothing was sent", text.strip(), problem.hint) from None
            pieces += [text[at : match.start()], str(number)]
            values.append(measure.shown(number, takes))
            at = match.end()
            used[field.axis] = measure
        sent = "".join(pieces) + text[at:]
        return PreparedLine(sent, await self._check(drive, used, target, sent, placed), ", ".join(values))

    def meant(self, drive: Drive) -> list[Drive]:
        """The drives that a line goes to."""
        if drive.address not in EVERYONE:
            return [drive]
        drives = self.workspace.bus(drive.link.name).all_drives
        if not drives:
            raise Diagnostic(f"{drive.link.name}: no drive has replied, so no scale is known; nothing was sent")
        return drives

    async def target(self, drives: Sequence[Drive], fields: Iterable[Field]) -> Takes | None:
        """Read what a target means to each of these drives. Raises Diagnostic where they differ."""
        if not any(field.takes is Takes.TARGET for field in fields):
            return None
        targets = {
            await drive.run(drive.family.units.target()) for drive in drives if drive.family.units.offers("target")
        }
        if len(targets) != 1:
            raise Diagnostic("targets are positions for some drives and distances for others; nothing was sent")
        return targets.pop()

    async def _common(self, drives: Sequence[Drive], axis: str) -> Measure:
        """The measure that these drives have in common. Raises Diagnostic where they have several."""
        measures = [await self.measure(drive, axis) for drive in drives]
        for drive, other in zip(drives, measures, strict=True):
            if (other.count, other.scale.zero, other.basis) != (
                measures[0].count,
                measures[0].scale.zero,
                measures[0].basis,
            ):
                names = f"{self.name(drives[0], axis)} and {self.name(drive, axis)}"
                raise Diagnostic(f"{names} have different scales; nothing was sent", "", "name one drive")
        return measures[0]

    def _check_referenced(self, drives: Sequence[Drive], axis: str) -> None:
        for drive in drives:
            if not self.referenced(drive, axis):
                name, scaled = self.name(drive, axis), self.of(drive, axis)
                unit = scaled.scale.unit.name if scaled is not None else "mm"
                hint = f"home it, or /units here {self.typed(drive, axis)} 0 {unit} where it is"
                raise Diagnostic(f"the position of {name} is not referenced; nothing was sent", "", hint)

    async def _check(
        self, drive: Drive, used: Mapping[str, Measure], target: Takes | None, text: str, placed: Collection[str] = ()
    ) -> Check:
        """What runs right before a line: what its quantities rest on is read again, of every drive that takes it.

        `used`: the measures by axis that made its numbers, whatever is accepted meanwhile. `placed`: the axes of its
        places.
        """
        drives = self.meant(drive)

        def check(each: Drive) -> Procedure[None]:
            for name, measure in used.items():
                yield from self._same(each, name, measure, text)
                if name in placed and not self.referenced(each, name):
                    raise Differs(f"{self.name(each, name)}: its reference was lost meanwhile; '{text}' was not sent")
            units = each.family.units
            if target is not None and units.offers("target") and (yield from units.target()) is not target:
                raise Differs(f"{each.shown}: ABS or INC was set meanwhile; '{text}' was not sent")

        if drive.address not in EVERYONE or not drive.codec.broadcasts:
            return check
        for each in drives:  # no drive replies to a line for all, so each is asked in a conversation of its own
            await each.run(check(each))
        before = [each.commands for each in drives]

        def still(_: Drive) -> Procedure[None]:
            yield from ()
            if [each.commands for each in drives] != before:
                raise Differs(f"{drive.shown}: another line was sent meanwhile; '{text}' was not sent")

        return still

    def _same(self, drive: Drive, name: str, measure: Measure, text: str) -> Procedure[None]:
        """Read what a scale rests on. Raises Differs where it is not what a measure was made with."""
        recounts = drive.state.recounts
        basis = yield from drive.family.units.basis(name, measure.scale.full_steps)
        axis = self.axes(drive)[name]
        drive.counting.saw(name, basis.settings, recounts)
        if axis.scale != measure.scale:
            raise Differs(f"{drive.shown}: its scale was changed meanwhile; '{text}' was not sent")
        if basis.settings != measure.basis.settings:
            self.lost(drive, name, axis)
            before = dict(measure.basis.settings)
            was = [
                f"{key} was {before.get(key)} and is {now} now" for key, now in basis.settings if before.get(key) != now
            ]
            hint = f"/units {self.typed(drive, name)} takes it as it is now"
            raise Differs(f"{drive.shown}: {', '.join(was)}: its scale rests on that, so '{text}' was not sent; {hint}")
        axis.sure = not _runs(drive)

    def lost(self, drive: Drive, name: str, axis: ScaledAxis) -> None:
        axis.sure = False
        if axis.scale.anchored:
            drive.state.reference_lost([name])

    # Quantities in conditions

    async def condition(self, drive: Drive, question: str, text: str, within: bool = False) -> ComparedQuantity:
        """Convert a quantity that is compared with the value of a question; `within`: it is a tolerance."""
        question_takes = drive.family.units.reads(question)
        if question_takes is None:
            raise Diagnostic(
                f"{text}: '{question}' prints no quantity", self.name(drive, ""), "compare it with a number"
            )
        axis, takes = question_takes
        if drive.stores:
            raise Refused(f"{self.name(drive, '')} is in program mode, which takes no quantity")
        measure, given = await self.measure(drive, axis), quantity(text.strip("{}"), self.own)
        if within:
            takes = {Takes.PLACE: Takes.DISTANCE, Takes.VELOCITY: Takes.SPEED}.get(takes, takes)
        elif takes is Takes.PLACE:
            self._check_referenced([drive], axis)
        number = measure.number(given, takes)
        check = await self._check(drive, {axis: measure}, None, question)
        shown = partial(measure.shown, takes=question_takes[1])
        return ComparedQuantity(abs(number) if within else number, check, shown)

    async def reading(self, drive: Drive, axis: str, what: str, unit: str) -> float:
        """Read the position or the velocity of an axis in a unit; what its scale rests on comes first.

        An empty axis is the first one. Raises Diagnostic, Differs where the scale must be confirmed again.
        """
        axis = axis or drive.family.units.axes()[0]
        measure, takes = await self.measure(drive, axis), Takes.PLACE if what == "position" else Takes.VELOCITY
        wanted = quantity(f"1 {unit}", self.own)
        measure.number(wanted, takes)  # of the same kind
        if takes is Takes.PLACE:
            self._check_referenced([drive], axis)
        await drive.run(self._same(drive, axis, measure, f"{what} in {unit}"))
        motion = next(of_axis for of_axis in await drive.motion() if of_axis.axis == axis)
        number = motion.position if takes is Takes.PLACE else motion.velocity
        return float(measure.base(number, takes, wanted))

    # Here

    async def here(self, drive: Drive, axis: str, text: str) -> ScaledAxis:
        """Have the position at rest be a place from now on. Raises Diagnostic while it moves."""
        measure, given = await self.measure(drive, axis), quantity(text, self.own)
        await self.confirm(drive)
        motion = next((of_axis for of_axis in await confirmed_motion(drive) if of_axis.axis == axis), None)
        if motion is None or motion.velocity:
            raise Diagnostic(f"{self.name(drive, axis)} moves", "/units here", "wait until it is at rest")
        scaled = self.axes(drive)[axis]
        if given.unit.kind != measure.scale.kind or given.unit.per:
            raise Diagnostic(f"{given}: the scale is {measure.scale}", "/units here", f"use {measure.unit}")
        scale = scaled.scale.with_zero(Fraction(0))
        zero = given.base - Measure(scale, scaled.basis or Basis()).exact(motion.position)
        basis = scaled.basis
        scaled = self.set(drive, axis, replace(scale, zero=zero))
        if basis is not None:
            scaled.accept(basis)
        drive.state.referenced(axis)
        self.workspace.changed()
        return scaled


def _names(drive: Drive) -> set[str]:
    """What a configuration may call a drive; one without an address also `!`."""
    return {drive.address or "!", *filter(None, (drive.label, drive.state.name if not drive.address else ""))}


def _anchor(drive: Drive, axes: dict[str, ScaledAxis]) -> None:
    drive.anchored = frozenset(name for name, axis in axes.items() if axis.scale.anchored)


def _runs(drive: Drive) -> bool:
    return drive.state.running or (drive.running is not None and drive.running.runs)
