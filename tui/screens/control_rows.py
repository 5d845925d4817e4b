"""The rows of the page of controls: the keys, and the lines that they send now."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.text import counted
from multidrop.dialects.controls import (
    BY,
    DISABLE,
    ENABLE,
    SET,
    SPEED,
    STOP,
    TARGET,
    TO,
    Control,
    Controls,
    Homing,
)
from multidrop.dialects.units import Takes
from multidrop.shell.amounts import Amount, AmountReader
from multidrop.tui.readout import Readout
from multidrop.tui.screens.chosen_axis import CLEAR
from multidrop.tui.screens.control_entries import ENTRIES, ON_THE_FLY, filled
from multidrop.tui.screens.jogging import Jog
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, Span, in_view, width_of

SPACE = "space"
KEYED = {SPACE: STOP, "r": CLEAR, "e": ENABLE, "d": DISABLE}
"""Keys of controls. Enter sends them, apart from the stop."""
WORDS = {
    TO: "move to",
    BY: "move by",
    SET: "position",
    SPEED: "speed",
    TARGET: "target",
    STOP: "stop",
    CLEAR: "error",
    ENABLE: "enable",
    DISABLE: "disable",
}
NO_CONTROLS = "this family has no controls"
KEY = 9
WORD = 10
LINE = 22
MODE = 16


def jog_rows(
    control: Control, axis: Readout, reader: AmountReader, step: Amount, several: bool, why: Span, width: int
) -> list[Row]:
    """The step and its lines. `why`: whether the next press moves."""
    other = reader.other(step, Takes.DISTANCE)
    more = "   Tab chooses the axis" if several else ""
    head: list[Span] = [
        ("─ ", "rule"),
        (f"jog {axis.axis}".rstrip() + "  ", "dim"),
        (step.typed if step.given is not None else f"{step.typed} {reader.counts(Takes.DISTANCE)}", "strong"),
        (f" = {other}" if other else "", "text"),
        (f"   ↑↓ choose the step, l types it{more} ", "dim"),
    ]
    minus, plus = (", ".join(filled(control, axis, step.times(sign))) for sign in (-1, 1))
    return [
        (*head, ("─" * max(0, width - width_of(head)), "rule")),
        ((f" {fit('←', KEY)}", "key"), (fit(minus, WORD + LINE), "text"), (f"→  {plus}", "text")),
        ((f" {fit('', KEY)}", "text"), why),
    ]


def readiness(jog: Jog, why: str) -> Span:
    """Whether the next press moves, or why not; with the presses that were dropped."""
    count = jog.dropped
    presses = counted(count, "press", "presses")
    dropped = f"; {presses} dropped ({'last: ' * (count > 1)}{jog.why})" if count else ""
    if not why:
        return f"ready{dropped}", "text" if dropped else "dim"
    return f"a press is dropped now: {why}{dropped}", "motion" if why == "it moves" else "strong"


def rule(words: str, width: int) -> Row:
    """A heading of some rows."""
    return ("─ ", "rule"), (f"{words} ", "dim"), ("─" * max(0, width - len(words) - 3), "rule")


def control_rows(controls: Controls, homings: Sequence[Homing], width: int) -> list[Row]:
    """The controls that have a key each."""
    rows: list[Row] = [rule("move", width)]
    for key, entry in ENTRIES.items():
        if entry.control and key != ON_THE_FLY:
            rows.append(control_row(key, entry.control, controls[entry.control], "…", width))
    home = ", ".join(homings[0].lines) if homings else "not here: such drives have no line for it"
    more = f"and {len(homings) - 1} more: h lists them" if len(homings) > 1 else ""
    rows.append(
        ((f" {fit('h', KEY)}", "key"), (f"{fit('home', WORD)} ", "text"), (fit(home, LINE), "strong"), (more, "dim"))
    )
    for key, name in KEYED.items():
        rows.append(control_row(key, name, controls[name], "", width))
    return rows


def homing_rows(homings: Sequence[Homing], at: int, width: int, height: int) -> list[Row]:
    """The homings of the axis around the one that is chosen; below 0: none is."""
    rows: list[Row] = [rule("home: ↑↓ or - + choose, Enter sends the line that is shown, Esc: nothing", width)]
    for number, homing in in_view(homings, max(at, 0), height - 1):
        role = "focus" if number == at else "text"
        sign = {"-": "−"}.get(homing.sign, homing.sign)
        mode = fit(f"{homing.mode} {sign}", MODE)
        line = fit(", ".join(homing.lines), LINE + 8)
        rows.append(((" ▌ " if number == at else "   ", "focus"), (f"{mode} {line}", role), (homing.about, "dim")))
    return rows


def control_row(key: str, name: str, control: Control, number: str, width: int) -> Row:
    """Key, word, lines and meaning of a control; an absent one has its reason."""
    shown = "Space" if key == SPACE else key if number else f"{key} Enter"
    if control.absent:
        text = fit(f"not here: {control.absent}", max(0, width - KEY - WORD - 3))
        return ((f" {fit('', KEY)}", "dim"), (f"{fit(WORDS[name], WORD)} ", "dim"), (text, "dim"))
    row: list[Span] = [
        (f" {fit(shown, KEY)}", "key"),
        (f"{fit(WORDS[name], WORD)} ", "text"),
        (fit(control.shown(by=number, to=number), LINE), "strong"),
    ]
    return (*row, (fit(control.about, max(0, width - KEY - WORD - LINE - 3)), "dim"))
