"""The facts and the time, of which a panel makes rows, and those of one drive: names, state with a sign, values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from multidrop.drives.bus import Bus
from multidrop.shell.roles import Series
from multidrop.shell.session import Session
from multidrop.tui.boundary import Boundary
from multidrop.tui.figures import NATIVE, Figures, figures_of
from multidrop.tui.keymap import FunctionKeys, Keymap
from multidrop.tui.readout import READ, Readout, ReadoutState
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Span

STATE = 20
"""Width of a sign and its words: `■ at rest 12 min ago`."""


UNREFERENCED = "~"
"""The sign of a position that has lost its reference."""
NOT_REFERENCED = "not referenced"


@dataclass(frozen=True)
class Glance:
    """The facts that are shown of one drive."""

    address: str
    label: str
    product: str
    version: str
    readout: Readout
    selected: bool = False
    storing: bool = False
    lost: bool = False
    unit: str = "steps"
    unreferenced: frozenset[str] = frozenset()
    """The axes whose position does not count since a restart."""
    stranger: str = ""
    """Why it may be no drive; empty: it is one."""

    def counts(self, axis: Readout) -> bool:
        """True if the position of an axis is not known to have lost its reference."""
        return not self.unreferenced & {axis.axis, ""}

    def state(self) -> ReadoutState:
        """The state as last read; LOST on a lost bus, where nothing else is known."""
        return ReadoutState.LOST if self.lost else self.readout.state(storing=self.storing)

    def sign(self, now: float) -> Span:
        state = self.state()
        words = state.word if self.lost else self.readout.words(now, storing=self.storing)
        aged = state in READ and self.readout.old(now)
        if state is ReadoutState.NO_CURRENT and self.readout.touched > self.readout.conditioned_at:
            aged = True  # a line was sent since, which may have switched it on
        aged = aged or (state is ReadoutState.DWELL and self.readout.program_aged(now))
        return fit(f"{state.sign} {words}", STATE), "dim" if aged else state.role

    def values(self, now: float, axis: Readout | None = None) -> tuple[str, str, str]:
        """Position and velocity, each with its unit if they have one, and their role: dim unless they are current."""
        axis = axis or self.readout
        last = axis.last
        dim = self.lost or self.readout.silent_since is not None or self.readout.old(now) or self.storing
        sign = "" if last is None or self.counts(axis) else UNREFERENCED
        position = sign + axis.figures.place(None if last is None else last.position)
        velocity = axis.figures.speed(None if last is None else last.velocity)
        return position, velocity, "dim" if dim else "strong"


def name_of(glance: Glance) -> str:
    """`a gantry`, or the address alone; `drive` for a drive without an address."""
    return f"{glance.address or 'drive'} {glance.label}".strip()


def firmware_of(glance: Glance) -> str:
    """The firmware's number alone; drives report `LMDCM 6.002, Hw: 3.2`."""
    return glance.version.removeprefix(glance.product).partition(",")[0].strip()


def glances_of(session: Session, model: ScreenModel, bus: Bus) -> list[Glance]:
    """The drives of a bus, as they are shown."""
    facts = model.bus(bus.name)
    for address in bus.drives:
        facts.readout(address).show_in(partial(model.figures, bus.name, address))
    chosen = session.selected if bus.name == session.selected_bus else None
    return [
        Glance(
            address=drive.address,
            label=drive.label,
            product=drive.product,
            version=drive.version,
            readout=facts.readout(address),
            selected=chosen is not None and drive.address == chosen.address,
            storing=drive.programming,
            lost=session.tabs.missing(bus),
            unreferenced=drive.state.unreferenced,
            stranger=drive.state.stranger,
        )
        for address, drive in bus.drives.items()
    ]


def figures_at(session: Session, bus: str, address: str, axis: str) -> Figures:
    """The figures of an axis, as a person has chosen: in units, or as the drive counts."""
    drive = session.buses[bus].drives.get(address) if session.scaled and bus in session.buses else None
    if drive is None or not session.units.shown:
        return NATIVE
    return figures_of(session.units.of(drive, axis), session.units.referenced(drive, axis))


def names_on(session: Session, bus: str) -> dict[str, str]:
    """The names that a person gave to drives of a bus, by address."""
    drives = session.buses[bus].drives if bus in session.buses else {}
    return {address: drive.label for address, drive in drives.items() if drive.label}


def name_at(session: Session, bus: str, address: str) -> str:
    """The name that a person gave to a drive; empty without one."""
    drive = session.buses[bus].drives.get(address) if bus in session.buses else None
    return drive.label if drive is not None else ""


def between_at(session: Session, before: float, after: float) -> str:
    """Two times in words, to follow what happened between them."""
    return f" (between {session.wall(before):%H:%M:%S} and {session.wall(after):%H:%M:%S})"


@dataclass(frozen=True)
class View:
    """The facts at one time."""

    session: Session
    model: ScreenModel
    glances: Sequence[Glance]
    """The drives of the selected bus."""
    now: float
    polling: bool
    """False while the person has switched polling off."""
    works: bool = True
    """Lines that are typed go somewhere (`tui.purpose.Purpose`)."""
    only: tuple[Series, ...] = ()
    """The series that are plotted in place of those that the person chose."""
    keys: Keymap = field(default_factory=Keymap)
    macros: FunctionKeys = field(default_factory=FunctionKeys)
    boundary: Boundary = field(default_factory=lambda: Boundary(Path()))

    @property
    def chosen(self) -> Glance | None:
        return next((glance for glance in self.glances if glance.selected), None)
