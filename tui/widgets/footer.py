"""The last line: the keys and their functions. The stop always comes first; the rest gives way from the right."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events

from multidrop.tui.keymap import read_key
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Lines, Row, Span, width_of

STOP = "^X STOP ALL"


def footer_row(keys: Sequence[tuple[str, str]], recording: bool, latched: bool, width: int, progress: str = "") -> Row:
    """The stop and the keys that work here, (key, word), in `width` cells; a function without a key is left out.

    `progress`: the words on the job that runs, after the stop.
    """
    keys = [(key, word[:14]) for key, word in keys if key]
    if recording:
        keys.insert(0, ("/record stop", "ends it"))
    if latched:
        keys.insert(0, ("/resume", "run again"))
    row: list[Span] = [*STOP_ROW]
    if progress:
        row.append((f" {fit(progress, max(0, width - width_of(row) - 2)).rstrip()} ", "strong"))
    for key, what in keys:
        span: list[Span] = [("  ", "text"), (key, "key"), (f" {what}", "dim")]
        if width_of(row) + width_of(span) > width - 1:
            break
        row += span
    return tuple(row)


STOP_ROW: Row = ((" ", "text"), (f" {STOP} ", "stop"), (" ", "text"))


class StopSign(Lines):
    """The stop alone, for screens that lie over a footer and dim it."""

    def on_mount(self) -> None:
        """Show it."""
        self.put([STOP_ROW])


def key_at(row: Row, x: int) -> str:
    """The key at a column of the footer, or the one whose word is there; empty beside them."""
    shown, end = "", 0
    for text, role in row:
        end += width_of([(text, role)])
        shown = text.strip() if role == "key" else shown if role == "dim" else ""
        if x < end:
            return shown
    return ""


MOVING = frozenset({"app.play", "play", "jog", "step", "enter"})
"""Actions that may move a drive, or send what is pending: they need their key. A click may only focus the terminal."""


class Footer(Lines):
    """The footer. A click on a key does what the key does, unless that moves; the app handles the one on the stop."""

    @staticmethod
    def is_stop(x: int) -> bool:
        """True if a column belongs to the stop."""
        return 0 < x <= len(STOP) + 2

    async def on_click(self, event: events.Click) -> None:
        """Do what the key under the pointer does, or begin the line that stands there."""
        shown = key_at(self.rows[0], event.x) if self.rows else ""
        if shown.startswith("/") and len(shown) > 1:
            await self.run_action(f"app.begin_line({shown!r})")
        elif found := self.screen.active_bindings.get(read_key(shown)):
            if found.binding.action.partition("(")[0] in MOVING:
                self.notify(f"Nothing was sent: a click moves nothing; press {shown}", timeout=4)
                return
            await self.app.run_action(found.binding.action, found.node)
