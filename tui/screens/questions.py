"""What the dialogs ask, from what is known at the time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tui.panels.status import Glance
from tui.session_view import BusView, SessionView

Answers = list[tuple[str, str]]
"""(key, text) of each answer."""
PREVIEW = 6
"""Lines of what is asked about that are shown."""


def drive_choices(session: SessionView, glances: Callable[[BusView], list[Glance]]) -> tuple[Answers, str]:
    """Every drive of every bus, and the key of the selected one. A key is the bus, a line feed, the address."""
    now = session.now()
    options: Answers = []
    current = ""
    for bus in session.buses.values():
        for glance in glances(bus):
            key = f"{bus.name}\n{glance.address}"
            current = key if glance.selected else current
            sign = glance.sign(now)[0]
            options.append((key, f" {bus.name:<8} {glance.address:<3} {glance.label:<12} {sign} {glance.product}"))
    return options, current


def leaving(session: SessionView, moving: Sequence[str], waiting: int) -> tuple[list[str], Answers]:
    """What quitting would leave unfinished (nothing: no need to ask), and what may be done about it.

    `moving` are the drives that move, or may, a line each; `waiting` is the number of lines that were typed and wait
    to be sent.
    """
    lines = list(moving[:PREVIEW])
    if len(moving) > PREVIEW:
        lines.append(f"… and {len(moving) - PREVIEW} more")
    if waiting:
        lines.insert(
            0, f"{waiting} lines wait and would not be sent" if waiting > 1 else "a line waits and would not be sent"
        )
    answers = [("stop", "Stop all and quit"), ("stay", "Stay")]
    if session.busy:
        lines.insert(0, "a macro, a script or a transfer runs")
    else:
        answers.insert(1, ("leave", "Quit, drives go on"))
    return lines, answers


def sending(session: SessionView, lines: Sequence[str]) -> tuple[str, list[str], Answers]:
    """Title, preview and answers for several pasted lines."""
    drive = session.selected
    to = f" to {drive.address or session.selected_bus}" if drive is not None else ""
    shown = [f"  {line[:60]}" for line in lines[:PREVIEW]]
    if len(lines) > PREVIEW:
        shown.append(f"  … and {len(lines) - PREVIEW} more")
    answers = [("send", f"Send {len(lines)} lines"), ("no", "Do not send")]
    return f"Send {len(lines)} pasted lines{to}?", shown, answers
