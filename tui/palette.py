"""Everything by name: what the palette offers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rich.text import Text
from textual.app import SystemCommand
from textual.fuzzy import Matcher

from tui.screens.dialogs import Match
from tui.text import visible

if TYPE_CHECKING:
    from tui.app import MultidropApp


def all_commands(app: MultidropApp) -> Iterator[SystemCommand]:
    """Every function of the app, with what it does and its key; first what is needed first."""
    session = app.session
    yield SystemCommand("Stop all", "every drive, macro and script, now   ^X", app.stop_all)
    if session.latched:
        yield SystemCommand("Resume", "let macros and scripts run again   /resume", partial(app.start, "/resume"))
    if session.recording:
        yield SystemCommand("End recording", f"keep {session.recording}   /record stop", app.action_record)
    else:
        yield SystemCommand("Record a macro", "what is typed from now on   /record NAME", app.action_record)
    yield SystemCommand("Search history", "the lines typed before   ^R", app.action_search_history)
    yield from _choices(app)
    yield SystemCommand("Plot on or off", "velocity and position of the selected drive   ^T", app.action_plot)
    polling = "off" if app.polling.on else "on"
    yield SystemCommand(f"Polling {polling}", "whether drives are asked for position and velocity", app.action_polling)
    yield SystemCommand("Open a connection", "saved ones, serial ports, the demo cell, a URL", app.action_open)
    yield SystemCommand("Newest line", "follow the transcript again   ^End", partial(app.main.action_look_end, True))
    yield SystemCommand(
        "Oldest line", "the beginning of the transcript   ^Home", partial(app.main.action_look_end, False)
    )
    yield SystemCommand("Clear the transcript", "of the bus that is shown", app.action_clear)
    yield SystemCommand("Copy the view", "the transcript in view, to the terminal's clipboard", app.action_copy_view)
    mouse = "off" if app.mouse_on else "on"
    yield SystemCommand(f"Mouse {mouse}", "off: the terminal's own selection works", app.action_mouse)
    yield SystemCommand("Theme", "colours; multidrop-ansi uses the terminal's own", app.action_choose_theme)
    yield SystemCommand("Help", "keys and signs   F1", app.action_help)
    yield SystemCommand("Quit", "drives go on as they are   ^Q", app.action_quit)
    for name, usage, meaning in app.assist.verbs():
        yield SystemCommand(usage, meaning, partial(app.begin_line, f"{name} "))


def _choices(app: MultidropApp) -> Iterator[SystemCommand]:
    """Macros, drives and buses, each by its own name."""
    keys = {name: key for key, name in app.macros.bound}
    for name, note in app.macros.names:
        about = f"{note or 'macro'}   {keys.get(name, '')}".rstrip()
        yield SystemCommand(f"Play {name}", about, partial(app.start, f"/play {name}"))
    yield SystemCommand("Choose a drive", "the one that plain text goes to   ^O", app.action_choose_drive)
    for bus in app.session.buses.values():
        if len(app.session.buses) > 1:
            yield SystemCommand(f"Show bus {bus.name}", "its transcript and drives", partial(app.select, "", bus.name))
        for drive in bus.drives.values():
            title = f"Drive {bus.name} {drive.address} {drive.label}".rstrip()
            yield SystemCommand(title, f"select it   {drive.product}", partial(app.select, drive.address, bus.name))
        yield SystemCommand(
            f"Close bus {bus.name}", "moves nothing, stops nothing", partial(app.start, f"/close {bus.name}")
        )


FOUND = 100
"""Lines of history that are listed; who wants older ones types more."""


def commands_like(commands: Sequence[SystemCommand], typed: str) -> list[Match]:
    """The commands whose titles hold the typed letters in their order, the likest first; all where nothing is typed."""
    matcher = Matcher(typed)
    scores = [matcher.match(command.title) if typed else 1.0 for command in commands]
    order = sorted((n for n, score in enumerate(scores) if score > 0), key=lambda n: -scores[n])
    return [Match(str(n), Text.assemble(f"{commands[n].title:<22}  ", (commands[n].help, "dim"))) for n in order]


def lines_like(lines: Sequence[str], typed: str) -> list[Match]:
    """The lines with the typed text in them, in the order in which they are given."""
    wanted = typed.casefold()
    found = (line for line in lines if wanted in line.casefold())
    return [Match(line, Text(visible(line))) for line, _ in zip(found, range(FOUND), strict=False)]
