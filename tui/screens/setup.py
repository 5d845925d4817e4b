"""The page that sets up a drive in the configuration: name, scale, travel, zero, and what asks first.

It types `/setup`, which checks everything again, writes the file and has the session use it.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from multidrop.base.errors import Diagnostic
from multidrop.dialects.units import Basis, Scale
from multidrop.dialects.written_scales import preview, written
from multidrop.drives.drive import Drive
from multidrop.shell.configuration import TRAVEL, check_label, check_new
from multidrop.shell.drive_setup import SetupChange, connection_of, scale_of
from multidrop.tui.panels.drive import unit_of
from multidrop.tui.screens.form import Form, FormPage, FormRow
from multidrop.tui.screens.page import PageHost
from multidrop.tui.widgets.lines import Span

NAME, SCALE, TRAVELS, ZERO, FULL_STEPS = "name", "scale", "travel", "zero", "full_steps"
GUARD, ASK_BEFORE, SAVE_AS = "guard", "ask_before", "save_as"
OF_AXIS = (SCALE, TRAVELS, ZERO, FULL_STEPS)
ABOUT = {
    NAME: "letters and digits, such as gantry; shown instead of the address. Empty: no name",
    SCALE: "how far one turn of the motor goes, as in 5 mm/turn, or one step, as in 0.4 um/step; a minus turns the "
    "direction. Units: m, cm, mm, um, in, deg, rad, turn. Empty: no scale",
    TRAVELS: "where the axis may move, as in 0..300 mm; a move that leaves it asks first. Empty: no travel",
    ZERO: "where position 0 is, as in 120 mm. Empty: at 0",
    FULL_STEPS: "full steps of the motor's turn, where they are not 200 (1.8 degrees). Empty: 200",
    GUARD: "on: a move that leaves its travel asks first; off: it does not. For every drive",
    ASK_BEFORE: "further commands that ask first, with commas, such as S,EX. For every drive",
    SAVE_AS: "the name of the connection: the line is saved with it, and multidrop tui NAME opens it",
}


class SetupForm(Form):
    """The set-up of the selected drive and of one of its axes."""

    title = "SET-UP"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._axis = 0
        self._asked_for: object = None
        """The drive and the axis for which the set-up was read."""

    def anew(self) -> None:
        super().anew()
        self._axis = 0

    # The drive

    @property
    def _drive(self) -> Drive | None:
        return self.host.session.selected

    @property
    def _axes(self) -> Sequence[str]:
        return self._drive.family.units.axes() if self._drive is not None else ("",)

    @property
    def axis(self) -> str:
        """The axis that is set up, as in `Motion.axis`."""
        return self._axes[min(self._axis, len(self._axes) - 1)]

    def nothing(self) -> str:
        return "^O chooses a drive" if self._drive is None else ""

    def _present(self) -> Scale | None:
        drive = self._drive
        scaled = self.host.session.units.of(drive, self.axis) if drive is not None else None
        return scaled.scale if scaled is not None else None

    def heading(self) -> str:
        drive = self._drive
        saved = connection_of(self.host.session, drive) if drive is not None else None
        return f"connection {saved.name}" if saved is not None else "not saved yet"

    def rows(self) -> Sequence[FormRow]:
        session, drive = self.host.session, self._drive
        assert drive is not None
        table = written(scale) if (scale := self._present()) is not None else {}
        group = f"axis {self.axis}" + (" (Tab: the next one)" if len(self._axes) > 1 else "") if self.axis else "axis"
        made = [FormRow(NAME, "name", drive.label, ABOUT[NAME])]
        for key, label in zip(OF_AXIS, ("one turn or step", "travel", "zero", "full steps"), strict=True):
            made.append(FormRow(key, label, str(table.get(key, "")), ABOUT[key], group=group))
        guards, every = session.settings.guards, "every drive"
        on = "off" if TRAVEL in guards.off else "on"
        made.append(FormRow(GUARD, "guard of travel", on, ABOUT[GUARD], ("on", "off"), every))
        made.append(FormRow(ASK_BEFORE, "also ask before", ",".join(sorted(guards.also)), ABOUT[ASK_BEFORE], (), every))
        if connection_of(session, drive) is None:
            made.append(FormRow(SAVE_AS, "save the line as", "", ABOUT[SAVE_AS], group="connection"))
        return made

    # What is shown

    def preview(self) -> Sequence[Span]:
        """What one turn is, as the drive counts now; the reading is asked for where it is missing."""
        session, drive = self.host.session, self._drive
        if drive is None:
            return ()
        key = (session.place, self.axis)
        if self._asked_for != key and self.host.outbox.idle:
            self._asked_for = key
            self.host.outbox.type(f"/setup {self._target()}")
        try:
            after = self._after()
        except Diagnostic as problem:
            return ((str(problem), "error"),)
        basis = self._basis(after)
        if after is None:
            turn = f"; one turn = {float(basis.turn):.9g} {self._count()}s" if basis is not None and basis.turn else ""
            return ((f"no scale: positions are shown in {self._count()}s{turn}", "text"),)
        try:
            told = preview(after, basis, self._count())
        except Diagnostic as problem:
            return ((str(problem), "error"),)
        rests = f"read of the drive: {basis}" if basis is not None and basis.settings else ""
        return ((told, "strong"), (rests, "dim"))

    def _after(self) -> Scale | None:
        """The scale as it is edited. Raises Diagnostic."""
        return scale_of(self._present(), self._change(), self.host.session.settings.own_units)

    def _change(self) -> SetupChange:
        """The edited values of the axis."""
        return SetupChange(**{key: value for key, value in self.edits.items() if key in OF_AXIS})

    def _basis(self, scale: Scale | None) -> Basis | None:
        units, drive = self.host.session.units, self._drive
        steps = scale.full_steps if scale is not None else None
        return units.last_read(drive, self.axis, steps) if drive is not None else None

    def _count(self) -> str:
        drive = self._drive
        axes = self.host.model.bus(self.host.session.selected_bus).readout(drive.address).axes if drive else ()
        unit = next((unit_of(each, "steps") for each in axes if each.axis == self.axis), "steps")
        return unit.removesuffix("s")

    def next_axis(self) -> None:
        """Show the next axis. Raises Diagnostic while this one is edited."""
        if self.edits.keys() & {*OF_AXIS}:
            raise Diagnostic("save this axis first: ^S")
        self._axis = (self._axis + 1) % len(self._axes)

    # Values

    def check(self, key: str, text: str) -> str:
        if key == NAME and text:
            check_label(text)
        elif key == SAVE_AS and text:
            check_new(text)
        elif key == ASK_BEFORE:
            return ",".join(sorted({word.strip().upper() for word in text.split(",") if word.strip()}))
        elif key in OF_AXIS:
            changed = {**{each: self.edits[each] for each in OF_AXIS if each in self.edits}, key: text}
            after = scale_of(self._present(), SetupChange(**changed), self.host.session.settings.own_units)
            if after is not None and (basis := self._basis(after)) is not None:
                preview(after, basis)
            return str(written(after).get(key, "")) if after is not None else ""
        return text

    def _target(self) -> str:
        drive = self._drive
        assert drive is not None
        address = self.host.session.qualified_address(drive)
        return f"{address}.{self.axis}" if self.axis else address

    def made(self) -> Sequence[str]:
        if not self.edits:
            return ()
        drive = self._drive
        assert drive is not None
        saved = connection_of(self.host.session, drive)
        if saved is None and not self.edits.get(SAVE_AS) and self.edits.keys() - {GUARD, ASK_BEFORE}:
            raise Diagnostic("the line is not a saved connection", "", "fill in the last row first: save the line as")
        options = [f"--{key.replace('_', '-')}={value}" for key, value in self.edits.items()]
        return (" ".join(("/setup", self._target(), *map(shlex.quote, options))),)


class SetupPage(FormPage):
    """The form for the selected drive; Tab shows the next axis of a controller."""

    SHEET = "setup"
    FORM = SetupForm
    form: SetupForm

    def action_axis(self) -> None:
        if self.asked is None and self.begun is None:
            try:
                self.form.next_axis()
            except Diagnostic as problem:
                self.say(str(problem))
