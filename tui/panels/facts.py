"""What a drive is and what was last known of it, and what to press next: the panels of a machine at rest.

All of it is known without a message: nothing here is a reason to read. Times are of the day, so that a row that nothing
happens to is not painted again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from multidrop.dialects.values import Conditions
from multidrop.drives.bus import Bus
from multidrop.shell.secrets import url_without_secrets
from multidrop.tui.panels.drive import drive_rows, error_span, unit_of
from multidrop.tui.panels.view import Glance, View, firmware_of, glances_of, name_of
from multidrop.tui.readout import Readout
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.lines import Row, spread

WORD = 10
"""Width of the word before a fact."""
COLUMN = 36
"""Least width of a column of facts on a card."""
KEY = 12
"""Width of a key, or of a line to type; few are longer."""
FUNCTIONS = ("palette", "drive", "find", "history", "pause", "save", "twin", "units", "macro-page")
"""What is offered besides the pages, by the names of `tui.key_table`."""
FACT_LINES = {
    "/tour": "a walk through all of this",
    "/open URL": "one more line of drives",
    "/log on": "keep sent and received bytes",
    "/help WORD": "the meaning of a word",
}


def facts_of(view: View, bus: Bus, glance: Glance) -> Iterator[tuple[str, str]]:
    """Units, program, last error, last line and abilities of a drive: a word and a text each."""
    session, readout = view.session, glance.readout
    drive = bus.drives[glance.address]
    for axis in readout.axes:
        scaled = session.units.of(drive, axis.axis) if session.scaled else None
        scale = scaled.scale if scaled is not None else None
        unit = unit_of(axis, glance.unit)
        fails = "does not hold now" if scaled is not None and not scaled.holds else ""
        text = (
            (axis.figures.unit or unit)
            if scale is None
            else ", ".join(filter(None, (str(scale), scale.shown_travel, fails)))
        )
        yield f"units {axis.axis}".rstrip(), text
    program, family = readout.program, drive.family
    if not family.offers("programs"):
        yield "program", family.no_programs
    elif program.read_at is None:
        yield "program", f"not read: {_to('/list', glance)}"
    else:
        held = f"{len(program.lines)} lines" if program.lines else "none"
        yield "program", f"{held}, read {session.wall(program.read_at):%H:%M:%S}"
    now = _failed(readout)
    failure, read = readout.failure, (f"error {drive.state.last_error}", drive.state.errors.at)
    if drive.state.last_error and (failure is None or failure[1] + 1.0 < read[1] < math.inf):
        failure = read
    for word, last, nothing in (
        ("last error", failure, "none seen" if now is None else error_span(now, old=False)[0]),
        ("last sent", readout.sent, "nothing yet"),
    ):
        yield word, f"{session.wall(last[1]):%H:%M:%S} {visible(last[0])}" if last else nothing
    can = {"programs": "programs", "tracing": "debugging", "registers": "registers"}
    yield "has", ", ".join(["settings", *(word for word, name in can.items() if family.offers(name))])


def _failed(readout: Readout) -> Conditions | None:
    """The conditions of the first axis with an error."""
    return next((axis.conditions for axis in readout.axes if axis.conditions and axis.conditions.error), None)


def _to(verb: str, glance: Glance) -> str:
    return f"{verb} {glance.address}".rstrip()


def selected_rows(view: View, width: int, height: int) -> list[Row]:
    """The panel of the selected drive, and below it what the drive is."""
    rows, chosen = drive_rows(view, width, height), view.chosen
    if chosen is not None and len(rows) < height:
        bus = view.session.buses[view.only[0].bus if view.only else view.session.selected_bus]
        facts = (*facts_of(view, bus, chosen), ("version", chosen.version))
        rows += [_fact(fact, width) for fact in facts if fact[1]]
    return rows[:height]


def cards_rows(view: View, width: int, height: int) -> list[Row]:
    """Every line with its URL, and a card for each of its drives but the selected one, which has a panel."""
    rows: list[Row] = []
    session = view.session
    buses = sorted(session.tabs.shown, key=lambda bus: bus.name != session.selected_bus)
    for number, bus in enumerate(buses):
        if len(rows) >= height:
            rows[height - 1 :] = [((f" {len(buses) - number} more lines; ^A shows all drives", "dim"),)]
            break
        drives = f"{len(bus.drives)} drives " if len(bus.drives) != 1 else "1 drive "
        url = url_without_secrets(session.openings.url_of(bus))
        left: Row = ((f" {bus.name} ", "accent"), (url, "text"))
        if session.tabs.missing(bus):
            drives = f"✗ lost: {bus.lost} "
        elif bus.lost is not None:
            drives = "being searched for drives "
        rows.append(spread(left, [(drives, "dim")], width))
        for glance in glances_of(session, view.model, bus):
            if not glance.selected:
                rows += card_rows(view, bus, glance, width)
    return rows[:height]


def card_rows(view: View, bus: Bus, glance: Glance, width: int) -> list[Row]:
    """Name, product and firmware of a drive, then its facts in as many columns as there is room for."""
    about = " ".join(filter(None, (glance.product, firmware_of(glance))))
    *facts, (_, has) = facts_of(view, bus, glance)
    columns = max(n for n in (1, 2, 4) if n == 1 or width >= n * COLUMN)
    column_width = width // columns
    head: Row = ((fit(f"   {name_of(glance)}", 3 + WORD), "strong"), (f" {about} ", "text"))
    rows: list[Row] = [spread(head, [(f"{has} ", "dim")], width)]
    for first in range(0, len(facts), columns):
        rows.append(tuple(span for fact in facts[first : first + columns] for span in _fact(fact, column_width, "   ")))
    return rows


def _fact(fact: tuple[str, str], width: int, indent: str = " ") -> Row:
    word = f"{indent}{fit(fact[0], WORD)} "
    return ((word, "dim"), (fit(fact[1], width - len(word)), "text"))


def next_rows(view: View, width: int, height: int) -> list[Row]:
    """What to press or to type: what the state asks for, macros on keys, pages, functions, lines."""
    offers = [*_asked_for(view), *_macros(view)] if view.works else []
    about = view.keys.about
    for name in (
        *(each for each in about if each.startswith("page-")),
        *(function for function in FUNCTIONS if function in about),
    ):
        key = view.keys.shown(name) or (f"/page {name.removeprefix('page-')}" if name.startswith("page-") else "")
        offers += [(key, about[name])] if key else []
    offers += FACT_LINES.items() if view.works else ()
    shown = [(f" {key:<{KEY}} ", words) for key, words in offers[:height]]
    return [((key, "key"), (fit(words, width - len(key)), "dim")) for key, words in shown]


def _asked_for(view: View) -> Iterator[tuple[str, str]]:
    """What the state of the session and of the selected drive asks for."""
    session, chosen = view.session, view.chosen
    if session.latched:
        yield "/resume", "lets macros and scripts run again"
    if session.recording:
        yield "/record stop", f"ends the recording of {session.recording}"
    if chosen is None:
        return
    conditions, program = _failed(chosen.readout), chosen.readout.program
    drive = session.buses[session.selected_bus].drives[chosen.address]
    if conditions is not None and conditions.clears:
        yield conditions.clears, f"clears it: {conditions.error_text}"
    elif conditions is not None and conditions.error > 0:
        yield f"/help {conditions.error}", "the meaning of its error, and what to do"
    elif conditions is not None and conditions.error:
        yield "an error is set", conditions.error_text
    if chosen.unreferenced:
        yield _to("/referenced", chosen), "once you know that its position is right"
    if program.read_at is None and drive.family.offers("programs") and not chosen.lost:
        yield _to("/list", chosen), "shows its program here"


def _macros(view: View) -> Iterator[tuple[str, str]]:
    """The macros on keys, then the others; how to make one, where there is none."""
    notes = dict(view.macros.names)
    for key, name in view.macros.bound:
        yield key, f"{name}: {notes[name]}" if notes[name] else f"plays {name}"
    keyed = {name for _, name in view.macros.bound}
    for name, note in view.macros.names:
        if name not in keyed:
            yield f"/play {name}", note or "a macro without a key"
    if not notes:
        yield "/record NAME", "makes a macro of the lines that you type from then on"
