"""The program of the selected drive: the lines around the one that it executes, as far as the host has read them."""

from __future__ import annotations

import math
from typing import NamedTuple

from multidrop.base.text import counted
from multidrop.shell.events import Phase
from multidrop.tui.panels.view import Glance, View
from multidrop.tui.readout import Readout
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import Row, in_view

SIGNS = {Phase.EXECUTES: "▶", Phase.BEFORE: "║", Phase.AFTER: "✓"}
"""The sign of the current line: it is executed; the program waits before it; it was executed, and the program waits."""
OLD = 2.0
"""Seconds after which the place of a running program may be outdated, and shows its age."""


OLD_CONDITIONS = 5.0
"""Seconds after which it may have changed whether a program runs."""


class Spot(NamedTuple):
    """The place of a program: the address of a line, its action there, and the time of that reading."""

    address: int
    phase: Phase
    at: float


def spot_of(readout: Readout) -> Spot | None:
    """The last known place of a drive's program; None while none runs, as far as that is known."""
    program, conditions = readout.program, readout.conditions
    if program.line is not None:
        return Spot(program.line, program.phase, program.seen_at)
    if conditions is not None and conditions.line.isdecimal() and program.name and not program.past:
        return Spot(int(conditions.line), Phase.EXECUTES, readout.conditioned_at)
    return None


def state_words(glance: Glance, now: float) -> str:
    """The action of a drive's program, in words; empty if it is not known."""
    readout = glance.readout
    spot = spot_of(readout)
    if glance.lost or readout.silent_since is not None:
        return ""
    if glance.storing:
        return "stores lines"
    if spot is not None:
        old = spot.phase is Phase.EXECUTES and now - spot.at > OLD
        return f"{spot.phase.value} {spot.address}" + (f", seen {age(now - spot.at)} ago" if old else "")
    program = readout.program
    if program.known_at == -math.inf:
        return ""
    ago = now - program.known_at
    if program.name:
        name = "" if program.name == "running" else f" {program.name}"
        return f"ran{name} {age(ago)} ago" if program.past or ago > OLD_CONDITIONS else f"runs{name}"
    return f"not running {age(ago)} ago" if ago > OLD_CONDITIONS else "not running"


def program_title(view: View) -> Row:
    """The title: the drive, and what its program does."""
    chosen = view.chosen
    if chosen is None:
        return ((" program ", "strong"),)
    words = state_words(chosen, view.now)
    runs = bool(words) and not words.startswith("not running")
    return (
        (f" program {chosen.address} ".replace("  ", " "), "strong"),
        (f"{words} " if words else "", "motion" if runs else "dim"),
    )


def program_shows(view: View) -> bool:
    """True if the program of the selected drive was read, or runs."""
    if (chosen := view.chosen) is None:
        return False
    program = chosen.readout.program
    return bool(program.lines or program.name) or program.line is not None or chosen.storing


def program_rows(view: View, width: int, height: int) -> list[Row]:
    """The lines around the current one; a hint where the host has not read them."""
    chosen = view.chosen
    if chosen is None:
        return [((" no drive selected", "dim"),)]
    facts, spot = chosen.readout.program, spot_of(chosen.readout)
    if facts.read_at is None:
        return [((fit(" not read yet: /list reads it", width), "dim"),)]
    if not facts.lines:
        return [((fit(" the drive holds no program", width), "dim"),)]
    read = f"read {view.session.wall(facts.read_at):%H:%M:%S}"
    if spot is None:
        return [
            ((fit(f" {counted(len(facts.lines), 'line')}, {read}", width), "dim"),),
            *listing_rows(chosen.readout, width, height - 1),
        ]
    return listing_rows(chosen.readout, width, height)


def listing_rows(readout: Readout, width: int, height: int) -> list[Row]:
    """The lines of a program around the current one, which has a sign; from the first one where none is current."""
    lines, spot = readout.program.lines, spot_of(readout)
    current = index_of(lines, spot.address) if spot is not None else None
    digits = len(str(lines[-1][0])) if lines else 0
    rows: list[Row] = []
    for number, (address, text) in in_view(lines, current or 0, height):
        here = spot is not None and number == current
        sign = SIGNS[spot.phase] if spot is not None and here else " "
        role = "motion" if here else "text"
        rows.append(
            (
                (f" {sign} ", role),
                (f"{address:>{digits}}  ", role if here else "dim"),
                (fit(text, width - digits - 5), role),
            )
        )
    return rows


def index_of(lines: tuple[tuple[int, str], ...], address: int) -> int | None:
    """The number of the line at an address, or of the one whose compiled lines hold it; None before the first."""
    return next((number for number in range(len(lines) - 1, -1, -1) if lines[number][0] <= address), None)
