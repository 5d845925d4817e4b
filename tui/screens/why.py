"""The page that says why a drive is in trouble: its state, its error, its program, what was sent to it, its curves.

It shows what was read, and what the family reports; it guesses nothing. Three keys below help. The one that reads the
error's number clears it in the drive, so the line is shown first and Enter sends it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.drives.drive import Drive
from multidrop.shell.roles import Series
from multidrop.tui.panels.drive import LIMITS, drive_rows
from multidrop.tui.panels.drives import spark
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.panels.program import listing_rows, spot_of, state_words
from multidrop.tui.panels.view import NOT_REFERENCED, Glance, View, name_of
from multidrop.tui.readout import Readout
from multidrop.tui.screens.page import OVERTAKEN, SendingPage, note_painted
from multidrop.tui.screens.program_rows import news_rows, rule
from multidrop.tui.text import at_words
from multidrop.tui.widgets.lines import Row, beside, spread

WIDE_FROM = 110
"""Width from which the curves are beside the facts."""
LABEL = 11
SENT, MOST_SENT, LOOKED = 2, 6, 400
"""Lines of what was sent and came back: the fewest, the most above curves, and the records that are searched."""
LISTING_ROWS = 3
"""Lines of the program around the one that it executes."""
HELPS = 3
LEAST_ROWS, LOWEST_CHART, CHART = 6, 3, 9
"""Least rows of the drive and of the curves, and most rows of curves that are no charts."""
MARKS = frozenset({">", "»", "", "x"})
"""Marks of the lines of a drive, of their replies and of their failures."""


class WhyPage(SendingPage):
    """Why the selected drive is in trouble."""

    SHEET = "why"
    WANTS = frozenset({"motion", "conditions"})
    PARTS = {"heading": None, "why": "1fr", "helps": HELPS + 1}

    def show(self, view: View) -> None:
        """Paint the facts, the curves beside or below them, and the keys that help."""
        if self.begun is not None and self.begun.overtaken(self.host.session):
            self.begun = None
            self.say(OVERTAKEN)
        drive, glance, width = view.session.selected, view.chosen, self.size.width
        name = f"{view.session.selected_bus}:{name_of(glance)}" if glance is not None else "no drive: ^O chooses one"
        text, role = glance.sign(view.now) if glance is not None else ("", "dim")
        self.lines("heading").put(
            [spread([(" WHY   ", "strong"), (name, "accent")], [(f"{text.strip()} ", role)], width)]
        )
        if drive is not None and glance is not None:
            self.lines("why").put(self._rows(view, glance, drive))
            helps = helping(glance, drive)
            said: Row = ((f" {self.said[0]}", self.said[1]),) if self.said[0] else rule("what helps", width)
            self.lines("helps").put([said, *(((f" {key:<4}", "key"), (text, "text")) for key, text in helps)])
        note_painted(self)

    def _rows(self, view: View, glance: Glance, drive: Drive) -> list[Row]:
        width, height = self.lines("why").size
        wide = width >= WIDE_FROM
        room = width // 2 if wide else width
        one = replace(view, only=(Series(view.session.selected_bus, glance.address),))
        known = [*self._facts(view, glance, drive, room)]
        spare = height - len(known) - SENT - 1 - (0 if wide else LOWEST_CHART)
        rows = [*drive_rows(view, room, max(LEAST_ROWS, spare)), *known]
        sent = height - len(rows) if wide else min(MOST_SENT, height - len(rows) - LOWEST_CHART)
        rows += self._sent(view, glance, room, max(SENT, sent - 1))
        if not wide:
            return [
                *rows[: height - LOWEST_CHART],
                *self._curves(one, glance, width, height - min(len(rows), height - LOWEST_CHART)),
            ]
        curves = self._curves(one, glance, width - room - 1, height)
        curves += [()] * (len(rows) - len(curves))
        return beside(rows, [(("│", "rule"), *curve) for curve in curves], room)[:height]

    def _curves(self, view: View, glance: Glance, width: int, height: int) -> list[Row]:
        """The last seconds as charts, or as a row each where there is no room for a chart."""
        head = rule("last 20 s", width)
        if height > CHART:
            return [head, *plot_rows(view, width, height - 1)]
        rows: list[Row] = [head]
        for name in ("position", "velocity"):
            drawn = spark(glance.readout, view.now, width - LABEL - 1, name)
            rows.append(((f" {name:<{LABEL}}", "dim"), (drawn, "accent")))
        return rows

    def _facts(self, view: View, glance: Glance, drive: Drive, width: int) -> Iterator[Row]:
        """What is known beside the panel of the drive: the error's meaning, and the program with its lines."""
        for label, text, role in facts(view, glance, drive):
            for number, row in enumerate(at_words(text, width - LABEL - 1)):
                yield (f" {'' if number else label:<{LABEL}}", "dim"), (row, role)
        if glance.readout.program.lines and spot_of(glance.readout) is not None:
            yield from listing_rows(glance.readout, width, LISTING_ROWS)

    def _sent(self, view: View, glance: Glance, width: int, most: int) -> list[Row]:
        """The last lines that were sent to the drive, and what came back."""
        own = [
            record
            for record in self.host.last_records(LOOKED)
            if record.mark in MARKS and record.address == glance.address and not record.text.startswith("/")
        ]
        return [rule("sent to it last", width), *news_rows(own[-most:], view.session.wall, width)]

    # Keys

    def action_read_error(self) -> None:
        drive = self.host.session.selected
        lines = error_lines(drive, self.host.model.bus("").readout(drive.address).axes) if drive is not None else ()
        self.begun = None
        if lines:
            self.offer("error", lines)
        what = f"Enter sends {lines[0]}: {CLEARS}   Esc: nothing" if lines else "no error is set that a line reads"
        self.say(what)

    def action_go(self) -> None:
        if (begun := self.accepted()) is not None:
            self.send(begun.lines)

    def action_leave(self) -> None:
        """Drop the line that waits for Enter, else leave the page."""
        if self.begun is None:
            super().action_leave()
            return
        self.begun = None
        self.say("nothing was sent")


CLEARS = "clears it; a program that checks it acts otherwise"
SILENT = "no reply since {}; check its power, the wiring, its name and its baud rate"


def error_lines(drive: Drive, axes: Sequence[Readout]) -> tuple[str, ...]:
    """The line that reads the number of a drive's error, or clears the error; none where no error is set."""
    actions = drive.family.values.actions
    for axis in axes:
        if axis.conditions is not None and axis.conditions.error:
            if actions.error:
                return (drive.family.question(actions.error) or "",)
            return (actions.clear(axis.axis),) if actions.clear is not None else ()
    return ()


def facts(view: View, glance: Glance, drive: Drive) -> Iterator[tuple[str, str, str]]:
    """What is known besides the conditions: a label, a text and its role."""
    readout, state, wall = glance.readout, drive.state, view.session.wall
    bus = view.session.buses[view.session.selected_bus]
    if view.session.tabs.missing(bus):
        yield "lost", str(bus.lost), "error"
    elif readout.silent_since is not None:
        yield "silent", SILENT.format(f"{wall(readout.silent_since):%H:%M:%S}"), "error"
    if glance.stranger:
        yield "unknown", f"{glance.stranger}; only what you type is sent to it", "error"
    lines, actions = error_lines(drive, readout.axes), drive.family.values.actions
    if lines and actions.error:
        yield "EF=1", "an error is set; its number is not read, as that clears it", "strong"
    if state.last_error:
        yield "last error", f"{wall(state.errors.at):%H:%M:%S}: {meaning(drive, state.last_error)}", "text"
    elif actions.no_error and not lines:
        yield "error", actions.no_error.partition(";")[0], "dim"
    if glance.unreferenced:
        yield "position", NOT_REFERENCED, "strong"
    words = state_words(glance, view.now)
    if words and readout.program.runs and spot_of(readout) is None:
        words += "; its line is not reported"
    yield "program", words or "not known", "text" if words else "dim"


def meaning(drive: Drive, code: int) -> str:
    """The meaning of an error number and what to do, in one line."""
    try:
        lines = drive.family.language.describe_error(code, drive.product)
    except Diagnostic:
        return f"error {code}, which the manual does not explain"
    return "; ".join(" ".join(line.split()).removeprefix("do ") for line in lines)


def helping(glance: Glance, drive: Drive) -> list[tuple[str, str]]:
    """Three keys that help, each with what it does."""
    axes = glance.readout.axes
    lamps = [lamp for axis in axes if axis.conditions is not None for lamp in axis.conditions.lamps]
    offers = [("r", f"{line}, then Enter: {CLEARS}") for line in error_lines(drive, axes)]
    if any(lamp.on and lamp.function in LIMITS for lamp in lamps):
        offers.append(("^N", "controls: jog away from the limit"))
    elif any(axis.no_current for axis in axes):
        offers.append(("^N", "controls: current in the motor"))
    if glance.lost or glance.readout.silent_since is not None:
        offers.append(("t", "traffic: what is sent and received on the line"))
    offers += [("^E", "its program: list, trace, step"), ("^N", "controls: jog, stop, home"), ("^G", "its curves")]
    kept: dict[str, str] = {}
    for key, text in offers:
        kept.setdefault(key, text)
    return list(kept.items())[:HELPS]
