"""The page of the programs in a drive: where they are, and the lines that run, pause, continue and stop them."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.by_hand import ACTIONS, GO_ON, PAUSE, RUN, STOP, ByHand
from multidrop.dialects.values import Conditions
from multidrop.tui.screens.lines_page import LineRow, LinesPage

ABOUT = {
    RUN: "from its beginning",
    PAUSE: "it waits at its line",
    GO_ON: "from the line at which it waits",
    STOP: "end it",
}
NOT_READ = "not read yet"


class ProgramsPage(LinesPage):
    """The programs of the selected drive."""

    SHEET = "programs"
    TITLE = "PROGRAMS"

    def missing(self, by_hand: ByHand) -> str:
        return by_hand.no_programs

    def made(self, by_hand: ByHand, conditions: Conditions | None) -> Sequence[LineRow]:
        rows = []
        for slot in by_hand.programs():
            state, place, live = self._state(slot.name, conditions)
            group = f"{slot.name}   {state}{f', line {place}' if place else ''}{self._text(place)}"
            for action in ACTIONS:
                if action in slot.lines:
                    shown = state if action == RUN else ""
                    rows.append(
                        LineRow(
                            action, slot.lines[action], shown, ABOUT[action], group=group, live=live and bool(shown)
                        )
                    )
        return rows

    def _state(self, name: str, conditions: Conditions | None) -> tuple[str, str, bool]:
        """The state of a program in words, its line where the drive reports it, and whether it runs."""
        if conditions is None:
            return NOT_READ, "", False
        for slot in conditions.slots:
            if slot.name == name:
                return slot.state, slot.line, slot.runs
        if conditions.runs is None:
            return "not reported", "", False
        return ("running" if conditions.runs else "none runs"), conditions.line, conditions.runs

    def _text(self, place: str) -> str:
        """The text of a line, where the program was read."""
        glance = self._glance
        lines = dict(glance.readout.program.lines) if glance is not None and place.isdecimal() else {}
        text = lines.get(int(place)) if place.isdecimal() else None
        return f": {text}" if text else ""
