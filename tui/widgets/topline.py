"""The top line (name, a tab for each bus, recording, log, the clock) and the rule under it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from textual import events

from tui.screen_model import State
from tui.text import fit
from tui.widgets.lines import Lines, Row, Span, width_of

NAME = " multidrop  "


@dataclass(frozen=True)
class Tab:
    """A bus as its tab shows it."""

    number: int
    name: str
    state: State
    selected: bool
    old: bool = False
    """The state may be outdated."""


def tab_spans(tab: Tab) -> list[Span]:
    """Format ` 1 press ▶ moving `, in a width that does not change with the state."""
    body = f" {tab.number} {tab.name} "
    state = f"{tab.state.sign} {tab.state.word:<6} "
    if tab.selected:
        urgent = tab.state is State.LOST
        return [(body, "focus"), (state, "stop" if urgent else "focus")]
    return [(body, "text"), (state, "dim" if tab.old and tab.state is not State.LOST else tab.state.role)]


def top_row(tabs: Sequence[Tab], recording: str, clock: str, width: int, log: bool = False, playing: str = "") -> Row:
    """The whole line; if there are too many tabs, those left of the selected one give way first."""
    right: list[Span] = []
    if playing:
        right.append((f" ▶ {fit(playing, 20).rstrip()} ", "motion"))
    if recording:
        right.append((f" ● rec {recording[:16]} ", "error"))
    if log:
        right.append((" ● log ", "text"))
    right.append((f" {clock} ", "dim"))
    left: list[Span] = [
        (NAME if width >= 100 or (len(tabs) < 3 and bool(playing) + log + bool(recording) < 2) else " ", "strong")
    ]
    room = width - width_of(right) - width_of(left)
    shown = _that_fit(list(tabs), room)
    for tab in shown:
        left += tab_spans(tab)
    if len(shown) < len(tabs):
        left.append(("…", "dim"))
    gap = max(0, width - width_of(left) - width_of(right))
    return (*left, (" " * gap, "text"), *right)


def _that_fit(tabs: list[Tab], room: int) -> list[Tab]:
    """The longest run of tabs that fits and includes the selected one."""
    while tabs and sum(width_of(tab_spans(tab)) for tab in tabs) > room - (1 if len(tabs) > 1 else 0):
        tabs = tabs[:-1] if not tabs[-1].selected else tabs[1:]
    return tabs


def rule_row(width: int, junction: int | None, sign: str) -> Row:
    """A rule, with a junction (`┬`, `┴`) at a column if one is given."""
    if junction is None or not 0 <= junction < width:
        return (("─" * width, "rule"),)
    return (("─" * junction + sign + "─" * (width - junction - 1), "rule"),)


class TopLine(Lines):
    """The top line. A click on a tab shows its bus."""

    async def on_click(self, event: events.Click) -> None:
        """Show the bus of the tab under the pointer."""
        x = 0
        for text, _ in self.rows[0] if self.rows else ():
            x += len(text)
            if event.x < x:
                head = text.split()[:1]
                if head and head[0].isdigit():
                    await self.run_action(f"app.bus_number({int(head[0])})")
                return
