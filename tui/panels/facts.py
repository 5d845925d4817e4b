"""What else is known of the selected drive, and what to press next.

All of it is known without a message: nothing here is a reason to read, and unknown facts are left out. Times are of
the day, so that a row that nothing happens to is not painted again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from multidrop.dialects.values import UNREAD
from multidrop.drives.bus import Bus
from multidrop.tui.panels.drive import LIMITS, drive_rows
from multidrop.tui.panels.drives import line_trouble
from multidrop.tui.panels.view import Glance, View
from multidrop.tui.readout import Readout
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.lines import Row

WORD = 10
"""Width of the word before a fact."""
KEY = 13
"""Width of a key, or of a line to type; few are longer."""
MOST_OFFERED = 3
"""Things that are offered as next."""
FAMILIAR = (
    ("page-controls", "jog, move, home"),
    ("page-program", "edit and run its program"),
    ("page-plot", "position and velocity"),
)
"""What is offered to a drive at rest without trouble, by the names of `tui.key_table`."""


def facts_of(view: View, bus: Bus, glance: Glance) -> Iterator[tuple[str, str]]:
    """Units, program, last error and last line of a drive, each as a word and a text; unknown ones are left out."""
    session, readout = view.session, glance.readout
    drive = bus.drives[glance.address]
    for axis in readout.axes:
        scaled = session.units.of(drive, axis.axis) if session.scaled else None
        if scaled is not None:
            fails = "" if scaled.holds else "does not hold now"
            text = ", ".join(filter(None, (str(scaled.scale), scaled.scale.shown_travel, fails)))
            yield f"units {axis.axis}".rstrip(), text
    program = readout.program
    if program.read_at is not None:
        held = f"{len(program.lines)} lines" if program.lines else "none"
        yield "program", f"{held}, read {session.wall(program.read_at):%H:%M:%S}"
    failure, read = readout.failure, (f"error {drive.state.last_error}", drive.state.errors.at)
    if drive.state.last_error and (failure is None or failure[1] + 1.0 < read[1] < math.inf):
        failure = read
    for word, last in (("last error", failure), ("last sent", readout.sent)):
        if last is not None:
            yield word, f"{session.wall(last[1]):%H:%M:%S} {visible(last[0])}"


def _failed(readout: Readout) -> Readout | None:
    """The first axis with an error."""
    return next((axis for axis in readout.axes if axis.conditions and axis.conditions.error), None)


def _to(verb: str, glance: Glance) -> str:
    return f"{verb} {glance.address}".rstrip()


def selected_rows(view: View, width: int, height: int) -> list[Row]:
    """The panel of the selected drive, and below it what else is known of the drive."""
    rows, chosen = drive_rows(view, width, height), view.chosen
    if chosen is not None and len(rows) < height:
        bus = view.session.buses[view.only[0].bus if view.only else view.session.selected_bus]
        rows += [_fact(fact, width) for fact in facts_of(view, bus, chosen)]
    return rows[:height]


def _fact(fact: tuple[str, str], width: int) -> Row:
    word = f" {fit(fact[0], WORD)} "
    return ((word, "dim"), (fit(fact[1], width - len(word)), "text"))


def next_rows(view: View, width: int, height: int) -> list[Row]:
    """The three things to press or to type that fit the state best, then the macros on keys."""
    offers = [*_asked_for(view)][:MOST_OFFERED]
    offers += [offer for offer in _familiar(view) if offer[0] not in dict(offers)][: MOST_OFFERED - len(offers)]
    offers += _macros(view) if view.works else ()
    shown = [(f" {key:<{KEY}} ", words) for key, words in offers[:height]]
    return [((key, "key"), (fit(words, width - len(key)), "dim")) for key, words in shown]


def _asked_for(view: View) -> Iterator[tuple[str, str]]:
    """What the state of the session, of the selected line and of the selected drive asks for, most urgent first."""
    session, chosen = view.session, view.chosen
    if view.works and session.latched and session.tally().sure:
        yield "/resume", "allow macros and scripts"
    if view.works and session.recording:
        yield "/record stop", f"end recording {session.recording}"
    if not session.buses:
        yield "/open URL", "connect to drives"
        yield "/open sim:", "try simulated drives"
    bus = session.buses.get(session.selected_bus)
    if bus is not None and not bus.drives:
        (_, role), _ = line_trouble(view, bus)
        if bus.silent and view.works:
            yield "Enter", "search for its drives"
        if role == "error":
            yield _page("traffic", view), "bytes sent and received"
    if chosen is not None:
        yield from _asked_by(chosen, view)


def _asked_by(chosen: Glance, view: View) -> Iterator[tuple[str, str]]:
    """What the selected drive asks for."""
    session, failed = view.session, _failed(chosen.readout)
    drive, why = session.buses[session.selected_bus].drives[chosen.address], _page("why", view)
    if chosen.lost or chosen.readout.silent_since is not None:
        yield why, "why, and what to check"
        yield _page("traffic", view), "bytes sent and received"
        return
    if failed is not None and failed.conditions is not None:
        conditions = failed.conditions
        actions = drive.family.values.actions
        if conditions.clears:
            yield conditions.clears, f"clears it: {conditions.error_text}"
        elif conditions.error == UNREAD and actions.error and view.works:
            yield drive.family.question(actions.error) or "", "read and clear the error"
        if conditions.error > 0:
            yield f"/help {conditions.error}", "what the error means"
        yield why, "why: error, program, lines"
        if any(lamp.on and lamp.function in LIMITS for lamp in conditions.lamps):
            yield _page("controls", view), "jog off the limit"
    if chosen.unreferenced and view.works:
        yield _to("/referenced", chosen), "if its position is right"
    if failed is None and chosen.readout.no_current:
        yield _page("controls", view), "switch the current on"


def _page(name: str, view: View) -> str:
    """The key of a page, or the line that shows it."""
    return view.keys.shown(f"page-{name}") or f"/page {name}"


def _familiar(view: View) -> Iterator[tuple[str, str]]:
    """What people do with a drive in good order."""
    if view.chosen is None or not view.works:
        return
    for name, words in FAMILIAR:
        if key := view.keys.shown(name):
            yield key, words


def _macros(view: View) -> Iterator[tuple[str, str]]:
    """The macros on keys."""
    notes = dict(view.macros.names)
    for key, name in view.macros.bound:
        yield key, f"{name}: {notes[name]}" if notes[name] else f"plays {name}"
