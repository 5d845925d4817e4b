"""What is plotted: lines, each a quantity of a drive or of its twin, and which of them share a chart."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import NamedTuple

from multidrop.dialects.values import Conditions
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.tui.curves.chart import Extent
from multidrop.tui.curves.raster import TWINS
from multidrop.tui.curves.samples import PREDICTED, TraceQuantity
from multidrop.tui.figures import NATIVE, Figures, UnitConversion, fixed
from multidrop.tui.panels.view import View
from multidrop.tui.polling import moved_lately, plotted
from multidrop.tui.readout import Readout
from multidrop.tui.widgets.lines import SERIES

PLOTTED = ("velocity", "position")
"""The quantities of every drive."""
_MEASURED = {predicted: measured for measured, predicted in PREDICTED.items()}


class PlottedLine(NamedTuple):
    """A quantity that is plotted: its drive's name, its unit, and the number of its colour and dashes."""

    name: str
    quantity: TraceQuantity
    unit: str
    number: int
    twin: bool = False
    """A prediction of the drive's twin."""
    figures: Figures = NATIVE
    """The form in which its values are shown."""

    @property
    def stroke(self) -> int:
        return self.number + TWINS * self.twin

    @property
    def of_drive(self) -> PlottedLine:
        if not self.twin:
            return self
        return self._replace(twin=False, quantity=self.quantity._replace(word=_MEASURED[self.quantity.word]))

    @property
    def conversion(self) -> UnitConversion:
        """What is plotted in the unit that is shown."""
        word, figures = self.of_drive.quantity.word, self.figures
        if word == DIFFERENCE:
            return UnitConversion(figures.places.gain)
        return {"velocity": figures.speeds, "position": figures.places}.get(word, UnitConversion())

    def text(self, plotted: float) -> str:
        """A plotted value; in units with its unit, else a whole number has no decimals."""
        return self._written(self.conversion.value(plotted), "-")

    def apart(self, difference: float) -> str:
        """A difference of two plotted values."""
        return self._written(self.conversion.gain * difference, "+")

    def _written(self, value: float, sign: str) -> str:
        if self.figures.unit and self.unit:
            return f"{fixed(value, self.figures.decimals, sign)} {self.unit}"
        return f"{int(value):{sign}}" if value == int(value) else f"{value:{sign}.3f}"

    def extent(self, plotted: Extent) -> Extent:
        """A plotted extent in the unit that is shown."""
        return Extent(*sorted(map(self.conversion.value, plotted)))

    @property
    def shown(self) -> str:
        """`a gantry`, or `a gantry twin`."""
        return f"{self.name} twin" if self.twin else self.name

    @property
    def short(self) -> str:
        """The same without the name that a person gave."""
        where, axis = self.name.partition(" ")[0], self.quantity.axis
        return " ".join(filter(None, (where, axis if axis != where else "", "twin" if self.twin else "")))


class ChartGroup(NamedTuple):
    """The lines that share a chart: those of one quantity in one unit, as no axis has two."""

    word: str
    key: str
    """The drive, where each has charts of its own."""
    lines: tuple[PlottedLine, ...]

    @property
    def title(self) -> str:
        """Its quantity, and the drive if there is only one."""
        names = {line.name for line in self.lines}
        return f"{self.word} {names.pop()}" if len(names) == 1 else self.word


def shown_series(view: View) -> Sequence[Series]:
    """What is plotted: what was named; else the selected drive, and each one that moved in the time that is shown."""
    named = view.only or plotted(view.session)
    if view.only or view.session.plotted:
        return named
    look = view.model.look
    since = (view.now if look.paused_at is None else look.paused_at) - look.span
    return list(dict.fromkeys([*named, *moved_lately(view.session, view.model, since)]))


def plot_shows(view: View) -> bool:
    """True while there is a curve: something was named, or moved in the time that is shown, or the plot is paused."""
    look = view.model.look
    moved = moved_lately(view.session, view.model, view.now - look.span)
    return bool(view.session.plotted or moved) or look.paused_at is not None


def _numbers(view: View, drawn: Sequence[Series]) -> dict[tuple[str, str, str], int]:
    """The number of the colour of each axis: it stays while the axis is plotted, whatever else moves."""
    axes = [(*line[:2], axis) for line in drawn for axis in _axes(view, line)]
    held = view.model.look.numbers
    for gone in held.keys() - set(axes):
        del held[gone]
    for axis in axes:
        held.setdefault(axis, next(number for number in count() if number not in held.values()))
    return held


def _axes(view: View, series: Series) -> list[str]:
    return (view.model.traces.axes(*series[:2]) if series.of_motion else []) or [""]


def groups(view: View) -> list[ChartGroup]:
    """The plotted lines by chart: velocities, positions, then values by their words. A twin's follow their drive's."""
    by_unit: dict[tuple[str, str], list[PlottedLine]] = {}
    drawn = shown_series(view)
    numbers = _numbers(view, drawn)
    several = len({line.bus for line in drawn}) > 1
    for each_drawn in drawn:
        bus, address, word = each_drawn
        for axis in _axes(view, each_drawn):
            number = numbers[bus, address, axis] % TWINS
            drive = view.session.buses[bus].drives[address]
            where = ":".join(filter(None, (bus if several or not address else "", address)))
            name = " ".join(filter(None, (where, drive.label, axis)))
            for plotted_word in [word] if word else PLOTTED:
                unit, figures = (
                    _unit(view, bus, address, axis, plotted_word) if word in ("", DIFFERENCE) else ("", NATIVE)
                )
                key = " ".join(filter(None, (name if view.model.look.apart else "", unit)))
                lines = by_unit.setdefault((plotted_word, key), [])
                lines.append(
                    PlottedLine(name, TraceQuantity(bus, address, axis, plotted_word), unit, number, figures=figures)
                )
                if not word and _recent(view, predicted := TraceQuantity(bus, address, axis, PREDICTED[plotted_word])):
                    lines.append(PlottedLine(name, predicted, unit, number, twin=True, figures=figures))
    order = sorted(by_unit, key=lambda key: list(PLOTTED).index(key[0]) if key[0] in PLOTTED else 9)
    if view.model.look.apart:
        order = sorted(order, key=lambda key: min(line.number for line in by_unit[key]))
    return [ChartGroup(*key, tuple(by_unit[key])) for key in order if key[0] not in view.model.look.hidden]


def _recent(view: View, predicted: TraceQuantity) -> bool:
    """True if a twin has predicted in the time that is shown, also one that has ended since."""
    look, trace = view.model.look, view.model.traces.get(predicted)
    end = view.now if look.paused_at is None else look.paused_at
    return trace is not None and trace.at[-1] >= end - look.span


def _unit(view: View, bus: str, address: str, axis: str, quantity: str) -> tuple[str, Figures]:
    """`mm`, `steps`, or what the drive counts; of a velocity, that a second or a unit of its own; with the figures."""
    axis_there = next((each for each in view.model.bus(bus).readout(address).axes if each.axis == axis), Readout())
    figures, own = axis_there.figures, axis_there.conditions or Conditions()
    if quantity == "velocity":
        return (f"{figures.speed_unit}{figures.sign}" if figures.speed_unit else own.speed_unit), figures
    return (f"{figures.unit}{figures.sign}" if figures.unit else own.unit), figures


def role_of(number: int) -> str:
    return SERIES[number % len(SERIES)]
