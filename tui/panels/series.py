"""Plotted lines with names, units and colours, and the charts that they share."""

from __future__ import annotations

from typing import NamedTuple

from tui.curves.trace import Quantity
from tui.panels.view import View
from tui.polling import plotted
from tui.widgets.lines import SERIES

PLOTTED = {"velocity": "/s", "position": ""}
"""The quantities of every drive, and the end of their units."""


class Line(NamedTuple):
    """A quantity that is plotted: its drive's name, its unit, and the number of its colour and dashes."""

    name: str
    quantity: Quantity
    unit: str
    number: int


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
    """The plotted lines by chart: velocities, positions, then values by their words."""
    found: dict[tuple[str, str], list[Line]] = {}
    numbers: dict[tuple[str, str, str], int] = {}
    for bus, address, word in plotted(view.session):
        for axis in view.model.traces.axes(bus, address) or [""] if not word else [""]:
            number = numbers.setdefault((bus, address, axis), len(numbers)) % len(SERIES)
            name = _name(view, bus, address, axis)
            for each in [word] if word else PLOTTED:
                unit = "" if word else _unit(view, bus, address, axis) + PLOTTED[each]
                line = Line(name, Quantity(bus, address, axis, each), unit, number)
                found.setdefault((each, name if view.model.look.apart else ""), []).append(line)
    order = sorted(found, key=lambda key: list(PLOTTED).index(key[0]) if key[0] in PLOTTED else 9)
    if view.model.look.apart:
        order = sorted(order, key=lambda key: min(line.number for line in found[key]))
    return [Group(*key, tuple(found[key])) for key in order if key[0] not in view.model.look.hidden]


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
