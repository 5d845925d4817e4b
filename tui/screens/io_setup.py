"""The page of the set-up of inputs and outputs: a form whose values have words; each change is the drive's own line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from multidrop.base.errors import Diagnostic
from multidrop.dialects.by_hand import PointField, PointSetup
from multidrop.dialects.values import Readings, Value
from multidrop.drives.drive import Drive
from multidrop.tui.screens.form import Form, FormPage, FormRow
from multidrop.tui.screens.page import PageHost
from multidrop.tui.screens.parameters import SettingEdit, edit
from multidrop.tui.widgets.lines import Span

FEW = 3
"""The greatest number of choices through which Enter steps; of more, one is typed."""


class IoSetupForm(Form):
    """The set-ups of the points of the selected drive, as `/params read` has read them."""

    title = "I/O SET-UP"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._asked_for: object = None
        """The drive for which the settings were read."""

    @property
    def _drive(self) -> Drive | None:
        return self.host.session.selected

    def _present(self) -> Readings | None:
        session, drive = self.host.session, self._drive
        if drive is None:
            return None
        return self.host.model.bus(session.selected_bus).readout(drive.address).settings

    def _setups(self) -> Sequence[PointSetup]:
        return self._drive.family.values.by_hand.points() if self._drive is not None else ()

    def nothing(self) -> str:
        drive = self._drive
        if drive is None:
            return "^O chooses a drive"
        if not self._setups():
            return drive.family.values.by_hand.no_points
        if self._present() is None:
            if self._asked_for != self.host.session.place and self.host.outbox.idle:
                self._asked_for = self.host.session.place
                self.host.outbox.type("/params read")
            return "reading the settings; the footer shows how far, and the transcript what fails"
        return "" if any(self._fields()) else "the drive did not print the set-up of its inputs and outputs"

    def _fields(self) -> Iterator[tuple[str, PointSetup, int, PointField, int]]:
        """The key, the set-up, the place and the present value of each field that was read."""
        present = self._present()
        values: Mapping[str, Value] = present.values if present is not None else {}
        for setup in self._setups():
            if setup.setting in values:
                for number, field in enumerate(setup.fields):
                    value = field.of(values[setup.setting], number)
                    if value is not None:
                        yield f"{setup.setting}.{number}", setup, number, field, value

    def rows(self) -> Sequence[FormRow]:
        made = []
        for key, setup, _, field, value in self._fields():
            words = [field.shown(each) for each in field.choices]
            about = f"{field.label}: {', '.join(words)}"
            few = words if len(words) <= FEW else ()
            label = field.label if len(setup.fields) > 1 else setup.label
            made.append(FormRow(key, label, field.shown(value), about, few, group=f"{setup.setting}   {setup.label}"))
        return made

    def check(self, key: str, text: str) -> str:
        field = next(each[3] for each in self._fields() if each[0] == key)
        return field.shown(field.read(text))

    def _planned(self) -> Iterator[SettingEdit]:
        """The lines for each set-up that is edited. Raises Diagnostic for one that the drive refuses."""
        drive, present = self._drive, self._present()
        assert drive is not None and present is not None
        changed: dict[str, Value] = {}
        for key, setup, number, field, _ in self._fields():
            if key in self.edits:
                before = changed.get(setup.setting, present.values[setup.setting])
                changed[setup.setting] = field.put(before, number, field.read(self.edits[key]))
        for name, value in changed.items():
            yield edit(drive.family.values.parameters, present, name, value)

    def made(self) -> Sequence[str]:
        return [line for planned in self._planned() for line in planned.lines] if self.edits else ()

    def preview(self) -> Sequence[Span]:
        if not self.edits:
            return (("nothing is changed; ^S shows the lines of what you change", "dim"),)
        try:
            planned = list(self._planned())
        except Diagnostic as problem:
            return ((str(problem), "error"),)
        lines = ", ".join(line for each in planned for line in each.lines)
        warnings = "; ".join(dict.fromkeys(filter(None, (each.warning for each in planned))))
        return ((lines, "strong"), (f"‼ {warnings}" if warnings else "", "motion"))

    def sent(self) -> None:
        """Have the settings read again after the lines."""
        self.host.outbox.type("/params read")


class IoSetupPage(FormPage):
    """The form of inputs and outputs of the selected drive."""

    SHEET = "io"
    FORM = IoSetupForm
