"""The drives of all lines as one machine: their order by urgency, and their states in a few words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from multidrop.drives.bus import Bus
from multidrop.tui.panels.drive import SIGN, alarm_words, program_words, trouble_of
from multidrop.tui.panels.drives import line_trouble
from multidrop.tui.panels.view import NOT_REFERENCED, Glance, View, glances_of
from multidrop.tui.readout import Readout, ReadoutState
from multidrop.tui.widgets.lines import Span

URGENCY = (
    ReadoutState.LOST,
    ReadoutState.SILENT,
    ReadoutState.MOVING,
    ReadoutState.DWELL,
    ReadoutState.STORING,
    ReadoutState.UNKNOWN,
    ReadoutState.NO_CURRENT,
    ReadoutState.AT_REST,
)
"""The states, worst first."""
AT_REST = (ReadoutState.NO_CURRENT, ReadoutState.AT_REST)
OUT_OF_REACH = (ReadoutState.LOST, ReadoutState.SILENT)


class DriveOnLine(NamedTuple):
    """A drive and its line; `axis` is one of its further axes, if this is about that alone."""

    bus: str
    glance: Glance
    axis: Readout | None = None

    @property
    def readout(self) -> Readout:
        return self.axis or self.glance.readout

    @property
    def name(self) -> str:
        """`press:a gantry`."""
        where = ":".join(filter(None, (self.bus, self.glance.address)))
        return f"{where} {self.glance.label}".strip()

    @property
    def trouble(self) -> str:
        """The errors and limits of its axes."""
        return "; ".join(filter(None, map(trouble_of, self.glance.readout.axes)))

    def alarm(self, room: int = 200) -> str:
        """Its trouble, and the differences of its axes from their twins."""
        return alarm_words(self.trouble, self.glance.readout.axes, room)

    def besides(self, room: int, now: float) -> Span:
        """The fact that matters most besides its state: trouble and its twin, its program, else its product."""
        if alarm := self.alarm(room):
            return alarm, "error"
        if self.glance.unreferenced:
            return NOT_REFERENCED, "strong"
        released = [readout.axis for readout in self.glance.readout.others.values() if readout.no_current]
        if released:
            return f"{', '.join(released)}: {ReadoutState.NO_CURRENT.word}", "strong"
        if program := program_words(self.glance.readout, now):
            return program, "dim" if self.glance.readout.program_aged(now) else "motion"
        return self.glance.product, "dim"

    @property
    def urgency(self) -> tuple[bool, int]:
        """Orders drives, worst first."""
        return not self.in_trouble, URGENCY.index(self.glance.state())

    @property
    def in_trouble(self) -> bool:
        """True if there is a reason to ask why: an error, a limit, a twin that differs, silence, a loss."""
        return self.glance.state() in OUT_OF_REACH or bool(self.alarm())


def all_drives(view: View) -> Iterator[DriveOnLine]:
    """The drives of all lines, those of the selected line first."""
    for bus in sorted(view.session.tabs.shown, key=lambda bus: bus.name != view.session.selected_bus):
        for glance in (
            view.glances if bus.name == view.session.selected_bus else glances_of(view.session, view.model, bus)
        ):
            yield DriveOnLine(bus.name, glance)


def worst_first(view: View, filtered: str) -> list[DriveOnLine]:
    """The drives of all lines whose row contains each word of the text.

    A single letter is looked for at the beginning of names only: nearly every row has one in its state or its product.
    """
    buses = view.session.tabs.shown
    places = [DriveOnLine(bus.name, glance) for bus in buses for glance in glances_of(view.session, view.model, bus)]
    places += [place for bus in buses if not bus.drives and (place := _line_alone(view, bus)) is not None]
    wanted = filtered.casefold().split()
    matching = [place for place in places if all(_has(place, word, view.now) for word in wanted)]
    return sorted(matching, key=lambda place: place.urgency)


def _line_alone(view: View, bus: Bus) -> DriveOnLine | None:
    """A line without drives that is lost or silent; None for any other."""
    (_, role), reason = line_trouble(view, bus)
    if role != "error":
        return None
    since = None if view.session.tabs.missing(bus) else math.inf
    readout = Readout(silent_since=since)
    return DriveOnLine(bus.name, Glance("", "", reason, "", readout, lost=since is None))


def _has(place: DriveOnLine, word: str, now: float) -> bool:
    if len(word) == 1 and word.isalnum():
        return any(name.startswith(word) for name in place.name.casefold().replace(":", " ").split())
    sign, _ = place.glance.sign(now)
    return word in f"{place.name} {sign} {place.alarm()} {place.glance.product}".casefold()


def summary(places: Sequence[DriveOnLine]) -> str:
    """`1 error · 2 moving · 1 silent`, worst first. A drive at rest with an error is counted as that alone."""
    errors = sum(bool(place.trouble) for place in places)
    states = [(place.glance.state(), bool(place.trouble)) for place in places]
    counts = Counter(state for state, troubled in states if not (troubled and state in AT_REST))
    differ = sum(place.glance.readout.differs for place in places)
    said = [f"{errors} error"] if errors else []
    said += [f"{differ} {SIGN} twin"] if differ else []
    return " · ".join([*said, *(f"{counts[state]} {state.word}" for state in URGENCY if counts[state])])
