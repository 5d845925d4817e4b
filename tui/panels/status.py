"""The state of drives as rows of text: two lines for a narrow screen, a panel for a wide one.

Columns are fixed and numbers are right-aligned, so that nothing jumps while values change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tui.panels.plot import plot_rows
from tui.screen_model import Readout, State
from tui.text import fit, thousands
from tui.widgets.lines import Row, Span, spread

POSITION = 14
"""Width of the longest position, -2,147,483,648."""
VELOCITY = 10
OTHER = 17
STATE = 17
"""Width of a sign and its words: `■ stood 0.9 s ago`."""


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

    def state(self) -> State:
        """The state as last read; LOST on a lost bus, where nothing else is known."""
        return State.LOST if self.lost else self.readout.state(storing=self.storing)

    def sign(self, now: float, width: int = STATE) -> Span:
        """Sign and words of the state in a fixed width."""
        state = self.state()
        words = state.word if self.lost else self.readout.words(now, storing=self.storing)
        aged = state in (State.MOVING, State.STOPPED) and self.readout.old(now)
        return fit(f"{state.sign} {words}", width), "dim" if aged else state.role

    def values(self, now: float, axis: Readout | None = None) -> tuple[str, str, str]:
        """Position, velocity, and their role: dim unless they are known to be current."""
        last = (axis or self.readout).last
        dim = self.lost or self.readout.silent_since is not None or self.readout.old(now) or self.storing
        position = thousands(None if last is None else last.position)
        velocity = thousands(None if last is None else last.velocity)
        return position, velocity, "dim" if dim else "strong"


def name_of(glance: Glance) -> str:
    """`a gantry`, or the address alone; `drive` for a drive without an address."""
    return f"{glance.address or 'drive'} {glance.label}".strip()


def firmware_of(glance: Glance) -> str:
    """The firmware's number alone; drives report `LMDCM 6.002, Hw: 3.2`."""
    return glance.version.removeprefix(glance.product).partition(",")[0].strip()


def narrow_rows(glances: Sequence[Glance], now: float, width: int, polling: bool) -> list[Row]:
    """Two lines: the selected drive; the others, and the rate of polling."""
    chosen = next((glance for glance in glances if glance.selected), None)
    if chosen is None:
        return [((fit(" no drive selected   ^O chooses one", width), "dim"),), ()]
    position, velocity, role = chosen.values(now)
    first: Row = (
        (f" {fit(name_of(chosen), 12)} ", "accent"),
        chosen.sign(now),
        (f"{position:>{POSITION}} ", role),
        (fit(chosen.unit, 6), "dim"),
        (f"{velocity:>{VELOCITY}} ", role),
        (fit(f"{chosen.unit}/s", 8), "dim"),
    )
    others: list[Span] = [span for axis in chosen.readout.others.values() for span in _axis_spans(chosen, axis, now)]
    others += [(f" {each.axis} {each.trouble} ", "error") for each in chosen.readout.axes if each.trouble]
    for glance in glances:
        if not glance.selected:
            others.append((f" {glance.address} ", "text"))
            others.append(glance.sign(now, OTHER))
    return [first, spread(others, [(f"{poll_words(chosen, now, polling)} ", "dim")], width)]


def _axis_spans(glance: Glance, axis: Readout, now: float) -> list[Span]:
    """Position and velocity of a further axis, below those of the first."""
    position, velocity, role = glance.values(now, axis)
    return [
        (fit("", 14 + STATE - 2), "dim"),
        (f"{axis.axis} ", "dim"),
        (f"{position:>{POSITION}} ", role),
        (fit(glance.unit, 6), "dim"),
        (f"{velocity:>{VELOCITY}} ", role),
        (fit(f"{glance.unit}/s", 8), "dim"),
    ]


def poll_words(glance: Glance, now: float, polling: bool) -> str:
    """The rate of polling on the wire: `polls 41 Hz`."""
    if glance.lost:
        return "not polled"
    if not polling:
        return "polling off"
    rate = glance.readout.rate(now)
    return f"polls {rate:.0f} Hz" if rate >= 1 or not rate else f"polls {rate:.1f} Hz"


def wide_rows(glances: Sequence[Glance], now: float, size: tuple[int, int], polling: bool, plot: bool) -> list[Row]:
    """The side panel in (width, height): the selected drive, the others on its bus, and the plot below."""
    width, height = size
    inner = width - 1
    chosen = next((glance for glance in glances if glance.selected), None)
    rows: list[Row] = []
    if chosen is None:
        rows.append(((" no drive selected", "dim"),))
        rows.append(((" ^O chooses one", "dim"),))
    else:
        rows.extend(_selected_rows(chosen, now, inner, polling))
    if len(glances) > 1:
        rows.append(())
        rows.extend(_other_row(glance, now) for glance in glances[: max(3, height // 3)])
    rows = [(("│", "rule"), *row) for row in rows]
    room = height - len(rows) - 1
    if plot and chosen is not None and room >= 8:
        rows.append((("│", "rule"),))
        for row in plot_rows(chosen.readout, now, width if room else 0, room, chosen.unit, "├"):
            is_title = bool(row) and row[0][0] == "├"
            rows.append(row if is_title else (("│", "rule"), *_narrowed(row)))
    rows += [(("│", "rule"),)] * (height - len(rows))
    return rows


def _narrowed(row: Row) -> Row:
    """A plot's row without the first cell of its label, which the border takes."""
    if not row:
        return row
    return ((row[0][0][1:], row[0][1]), *row[1:])


def _selected_rows(glance: Glance, now: float, width: int, polling: bool) -> list[Row]:
    firmware = firmware_of(glance)
    about = f"{glance.product}  fw {firmware}" if firmware else glance.product
    return [
        spread([(f" {name_of(glance)}", "accent")], [(f"{about} ", "dim")], width),
        *(row for axis in glance.readout.axes for row in _axis_rows(glance, axis, now)),
        spread([(" ", "text"), glance.sign(now)], [(f"{poll_words(glance, now, polling)} ", "dim")], width),
    ]


def _axis_rows(glance: Glance, axis: Readout, now: float) -> list[Row]:
    """Position, velocity and trouble of an axis; its name if there are several."""
    position, velocity, role = glance.values(now, axis)
    name = f" {axis.axis}" if axis.axis else ""
    rows: list[Row] = [
        ((f"{name} position ", "dim"), (f"{position:>{POSITION}}", role), (f" {glance.unit}", "dim")),
        ((f"{name} velocity ", "dim"), (f"{velocity:>{POSITION}}", role), (f" {glance.unit}/s", "dim")),
    ]
    return [*rows, ((f"{name} {axis.trouble}", "error"),)] if axis.trouble else rows


def _other_row(glance: Glance, now: float) -> Row:
    position, _, role = glance.values(now)
    pointer = "▸" if glance.selected else " "
    return (
        (f"{pointer}{fit(glance.address, 2)} ", "accent" if glance.selected else "text"),
        glance.sign(now),
        (f"{position:>{POSITION}}", role if role == "dim" else "text"),
    )
