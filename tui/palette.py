"""The palette: each function of the app by name, with its meaning and the action that runs it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from rich.text import Text
from textual.fuzzy import Matcher

from tui.function_keys import FunctionKeys
from tui.panels.table import PANELS
from tui.screens.dialogs import Match
from tui.screens.table import PAGES
from tui.session_view import SessionView
from tui.text import key_words


class Command(NamedTuple):
    """A title, one line about it with its key, and the Textual action (of the app, else of the main screen)."""

    title: str
    about: str
    action: str


def all_commands(
    session: SessionView, macros: FunctionKeys, verbs: Iterable[tuple[str, str, str]], *, polling: bool, mouse: bool
) -> Iterator[Command]:
    """Each function, the most urgent first. `polling` and `mouse` are the states that their commands switch."""
    yield Command("Stop all", "every drive, macro and script, now   ^X", "app.stop_all")
    if session.latched:
        yield Command("Resume", "let macros and scripts run again   /resume", _line("/resume"))
    if session.recording:
        yield Command("End recording", f"keep {session.recording}   /record stop", "app.record")
    else:
        yield Command("Record a macro", "what is typed from now on   /record NAME", "app.record")
    yield Command("Search history", "the lines typed before   ^R", "app.search_history")
    yield from _choices(session, macros)
    for page in PAGES:
        yield Command(page.title, f"page: {page.about}   {key_words(page.key)}".rstrip(), _call("page", page.name))
    for panel in PANELS:
        about = f"panel: {panel.about}   {key_words(panel.key)}".rstrip()
        yield Command(f"{panel.name.capitalize()} on or off", about, _call("panel", panel.name))
    yield Command(f"Polling {_other(polling)}", "reading of position and velocity from the drives", "app.polling")
    yield Command("Open a connection", "saved ones, serial ports, the demo cell, a URL", "app.open")
    yield Command("Newest line", "follow the transcript again   ^End", "look_end(True)")
    yield Command("Oldest line", "the beginning of the transcript   ^Home", "look_end(False)")
    yield Command("Clear the transcript", "of the bus that is shown", "app.clear")
    yield Command("Copy the view", "the transcript in view, to the terminal's clipboard", "app.copy_view")
    yield Command(f"Mouse {_other(mouse)}", "off: the terminal's own selection works", "app.mouse")
    yield Command("Theme", "colours; multidrop-ansi uses the terminal's own", "app.choose_theme")
    yield Command("Help", "keys and signs   F1", "app.help")
    yield Command("Quit", "drives go on as they are   ^Q", "app.quit")
    for name, usage, meaning in verbs:
        yield Command(usage, meaning, _call("begin_line", f"{name} "))


def _choices(session: SessionView, macros: FunctionKeys) -> Iterator[Command]:
    """Macros, drives and buses, each by its own name."""
    keys = {name: key for key, name in macros.bound}
    for name, note in macros.names:
        about = f"{note or 'macro'}   {keys.get(name, '')}".rstrip()
        yield Command(f"Play {name}", about, _line(f"/play {name}"))
    yield Command("Choose a drive", "the one that plain text goes to   ^O", "app.choose_drive")
    for bus in session.buses.values():
        if len(session.buses) > 1:
            yield Command(f"Show bus {bus.name}", "its transcript and drives", _call("select", "", bus.name))
        for drive in bus.drives.values():
            title = f"Drive {bus.name} {drive.address} {drive.label}".rstrip()
            yield Command(title, f"select it   {drive.product}", _call("select", drive.address, bus.name))
        yield Command(f"Close bus {bus.name}", "moves nothing, stops nothing", _line(f"/close {bus.name}"))


def _other(on: bool) -> str:
    return "off" if on else "on"


def _line(line: str) -> str:
    """The action that runs a line."""
    return _call("run_line", line)


def _call(name: str, *arguments: str) -> str:
    return f"app.{name}({', '.join(map(repr, arguments))})"


def commands_like(commands: Sequence[Command], typed: str) -> list[Match]:
    """The commands whose titles contain the typed letters in order, best match first; all for an empty text."""
    matcher = Matcher(typed)
    scores = [matcher.match(command.title) if typed else 1.0 for command in commands]
    order = sorted((n for n, score in enumerate(scores) if score > 0), key=lambda n: -scores[n])
    return [Match(str(n), Text.assemble(f"{commands[n].title:<22}  ", (commands[n].about, "dim"))) for n in order]
