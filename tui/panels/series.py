"""Plotted lines with names, units and colours, and the charts that they share."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.shell.roles import DIFFERENCE
from multidrop.tui.curves.ink import TWINS
from multidrop.tui.curves.trace import PREDICTED, Quantity
from multidrop.tui.panels.view import View
from multidrop.tui.polling import plotted
from multidrop.tui.widgets.lines import SERIES

PLOTTED = {"velocity": "/s", "position": ""}
"""The quantities of every drive, and the end of their units."""
_MEASURED = {predicted: measured for measured, predicted in PREDICTED.items()}


class Line(NamedTuple):
    """A quantity that is plotted: its drive's name, its unit, and the number of its colour and dashes."""

    name: str
    quantity: Quantity
    unit: str
    number: int
    twin: bool = False
    """What the drive's twin predicts."""

    @property
    def stroke(self) -> int:
        """The number of its dashes or dots."""
        return self.number + TWINS * self.twin

    @property
    def of_drive(self) -> Line:
        """The line of what is measured."""
        if not self.twin:
            return self
        return self._replace(twin=False, quantity=self.quantity._replace(word=_MEASURED[self.quantity.word]))

    @property
    def shown(self) -> str:
        """`a gantry`, or `a gantry twin`."""
        return f"{self.name} twin" if self.twin else self.name

    @property
    def short(self) -> str:
        """The same without the name that a person gave."""
        where, axis = self.name.partition(" ")[0], self.quantity.axis
        return " ".join(filter(None, (where, axis if axis != where else "", "twin" if self.twin else "")))


class Group(NamedTuple):
    """The lines that share a chart."""

    word: str
    key: str
    """The drive, where each has charts of its own."""
    lines: tuple[Line, ...]

    @property
    def title(self) -> str:
        """Its quantity, and the drive if there is only one."""
        names = {line.name for line in self.lines}
        return f"{self.word} {names.pop()}" if len(names) == 1 else self.word


def groups(view: View) -> list[Group]:
    """The plotted lines by chart: velocities, positions, then values by their words. A twin's follow their drive's."""
    found: dict[tuple[str, str], list[Line]] = {}
    numbers: dict[tuple[str, str, str], int] = {}
    for bus, address, word in plotted(view.session):
        axes = view.model.traces.axes(bus, address) if word in ("", DIFFERENCE) else []
        for axis in axes or [""]:
            number = numbers.setdefault((bus, address, axis), len(numbers)) % len(SERIES)
            name = _name(view, bus, address, axis)
            for each in [word] if word else PLOTTED:
                unit = _unit(view, bus, address, axis) + PLOTTED.get(each, "") if word in ("", DIFFERENCE) else ""
                lines = found.setdefault((each, name if view.model.look.apart else ""), [])
                lines.append(Line(name, Quantity(bus, address, axis, each), unit, number))
                if not word and _recent(view, predicted := Quantity(bus, address, axis, PREDICTED[each])):
                    lines.append(Line(name, predicted, unit, number, twin=True))
    order = sorted(found, key=lambda key: list(PLOTTED).index(key[0]) if key[0] in PLOTTED else 9)
    if view.model.look.apart:
        order = sorted(order, key=lambda key: min(line.number for line in found[key]))
    return [Group(*key, tuple(found[key])) for key in order if key[0] not in view.model.look.hidden]


def _recent(view: View, predicted: Quantity) -> bool:
    """Whether a twin has predicted in the time that is shown, also one that has ended since."""
    look, trace = view.model.look, view.model.traces.get(predicted)
    end = view.now if look.paused_at is None else look.paused_at
    return trace is not None and trace.at[-1] >= end - look.span


def _name(view: View, bus: str, address: str, axis: str) -> str:
    """`a gantry`, with the bus if several are plotted."""
    drive = view.session.buses[bus].drives[address]
    several = len({each.bus for each in plotted(view.session)}) > 1
    where = ":".join(filter(None, (bus if several or not address else "", address)))
    return " ".join(filter(None, (where, drive.label, axis)))


def _unit(view: View, bus: str, address: str, axis: str) -> str:
    """`steps`, or what the drive counts."""
    axes = view.model.bus(bus).readout(address).axes
    return next((each.conditions.unit for each in axes if each.axis == axis and each.conditions is not None), "steps")


def role_of(number: int) -> str:
    """The role of a line by its number."""
    return SERIES[number]
