"""What is plotted: a drive's position and velocity, or a value that the drive prints."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.drives.conversations import refuse_stranger
from multidrop.drives.drive import Drive
from multidrop.shell.hooks import Predicting
from multidrop.shell.line_syntax import EVERYONE, split_target
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.shell.session import Session

FORMS = "valid: ADDR, ADDR.VALUE or VALUE, with BUS: before ADDR if it is on another bus; as b, b.I1, VM"


def parse_series(workspace: Session, texts: Sequence[str]) -> tuple[Series, ...]:
    """Return the series of these texts; without a text, all drives of all buses. Sends nothing. Raises Diagnostic."""
    series: dict[Series, None] = {}
    for text in texts:
        series |= dict.fromkeys(_parse(workspace, text))
    if not texts:
        series = {Series(bus.name, drive): None for bus in workspace.buses.values() for drive in bus.drives}
    return tuple(series)


def _parse(workspace: Session, text: str) -> list[Series]:
    if drives := _drives(workspace, text):
        return [Series(bus, address) for bus, address in drives]
    target, dot, word = text.rpartition(".")
    if not dot and ":" in text:
        raise Diagnostic(f"no drive {text}", hint=_valid(workspace, text))
    if not dot or not target:
        selected = workspace.selected
        if selected is None:
            raise Diagnostic(f"no drive {text}", hint="/open URL opens a line of drives")
        drives = [(selected.link.name, selected.address)]
    else:
        drives = _drives(workspace, target)
        if not drives:
            raise Diagnostic(f"no drive {target}", hint=_valid(workspace, target))
    values = [_value(workspace, bus, address, word, text) for bus, address in drives]
    if not dot and values[0].word != DIFFERENCE:
        drive = workspace.buses[values[0].bus].drives[values[0].address]
        if not drive.family.values.own(values[0].word):  # a name that a person gave
            hint = f"{_valid(workspace, text)}; .{text} is a user's variable"
            raise Diagnostic(f"no drive and no value {text}", hint=hint)
    return values


def _drives(workspace: Session, target: str) -> list[tuple[str, str]]:
    """The drives that `ADDR`, `BUS:ADDR` or `BUS:*` names; none if there is no such drive."""
    name, address = split_target(target)
    bus = workspace.buses.get(name or workspace.selected_bus)
    if bus is None:
        return []
    if address in EVERYONE:
        return [(bus.name, drive) for drive in bus.drives]
    named = (drive.address for drive in bus.drives.values() if address and drive.label == address)
    known_address = address if address in bus.drives else next(named, None)
    return [] if known_address is None else [(bus.name, known_address)]


def _valid(workspace: Session, target: str) -> str:
    bus, _ = split_target(target)
    name = bus or workspace.selected_bus
    if name not in workspace.buses:
        return f"open: {', '.join(workspace.buses) or 'none'}"
    return f"valid on {name}: {', '.join(workspace.buses[name].drives) or 'none'}"


def _value(workspace: Session, bus: str, address: str, word: str, text: str) -> Series:
    drive: Drive = workspace.buses[bus].drives[address]
    if not word:
        raise Diagnostic(f"no value in {text!r}", hint=FORMS)
    if word.lower() == DIFFERENCE:
        if workspace.buses[bus] in workspace.predicted:
            return Series(bus, address, DIFFERENCE)
        for predicting in registry.added(Predicting):
            raise Diagnostic(f"{drive.shown}: {predicting.missing}", hint=predicting.begin)
    return Series(bus, address, drive.family.values.check(word))


async def read_first(workspace: Session, series: Sequence[Series]) -> None:
    """Read each value once, as a person would, before it is polled. Raises the refusal of a drive that lacks it.

    Of a device that did not identify itself only values that a person named are read: Inexpressible for its motion.
    """
    for bus, address, word in series:
        drive = workspace.buses[bus].drives[address]
        if not word:
            refuse_stranger(drive.state, workspace.display_name(drive))
        elif word != DIFFERENCE:
            await drive.run(drive.family.values.first(word), typed=True)
