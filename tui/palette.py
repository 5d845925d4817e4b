"""The palette, each function of the app by name with its action and its key, and help for where you are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from rich.text import Text
from textual.fuzzy import Matcher

from multidrop.base.files import rows
from multidrop.shell.hooks import switches as added
from multidrop.shell.session import Session
from multidrop.tui.key_table import SHEETS, STOP, all_groups, footer
from multidrop.tui.keymap import FunctionKeys, Keymap
from multidrop.tui.panels.table import PANELS
from multidrop.tui.screens.dialogs import Match
from multidrop.tui.screens.page import PAGES
from multidrop.tui.text import at_words, fit, visible

PALETTE, PADDING = 90, 7
"""Greatest width of the palette in cells, and what border, padding and scroll bar take of it."""
TITLE = 24
"""Width of a title."""
LATELY = 5
"""Number of commands that count as used lately."""


class PaletteCommand(NamedTuple):
    """A title, one line about it, and the Textual action (of the app, else of the main screen)."""

    title: str
    about: str
    action: str
    key: str = ""
    """Its key as shown, or the line to type instead."""
    urgent: bool = False
    """It comes before what was used lately."""
    here: bool = False
    """It is a function of the page in front."""
    words: str = ""
    """Everyday words for it that its title lacks, by which it is found."""


SYNONYMS = {row["command"]: row["words"] for row in rows(__file__, "synonyms.csv")}
"""Everyday words by the beginning of a title."""


def ordered(commands: Sequence[PaletteCommand], recent: Sequence[str]) -> list[PaletteCommand]:
    """The urgent commands, those of the page, those used lately (by their actions, the last one first), all others."""
    urgent = [command for command in commands if command.urgent] + [command for command in commands if command.here]
    lately = [
        command for action in recent for command in commands if command.action == action and command not in urgent
    ]
    return [*urgent, *lately, *(command for command in commands if command not in urgent and command not in lately)]


def all_commands(
    session: Session,
    macros: FunctionKeys,
    verbs: Iterable[tuple[str, str, str]],
    keys: Keymap,
    switches: Mapping[str, bool],
    sheet: str = "",
) -> Iterator[PaletteCommand]:
    """Yield each function with its everyday words: the most urgent first, then those of the page in front.

    `switches`: what is on.
    """
    for command in _titled(session, macros, verbs, keys, switches, sheet):
        words = next((words for head, words in SYNONYMS.items() if command.title.startswith(head)), "")
        yield command._replace(words=words)


def _titled(
    session: Session,
    macros: FunctionKeys,
    verbs: Iterable[tuple[str, str, str]],
    keys: Keymap,
    switches: Mapping[str, bool],
    sheet: str,
) -> Iterator[PaletteCommand]:
    yield PaletteCommand("Stop all", "every drive, macro and script, now", "app.stop_all", "^X", urgent=True)
    if session.latched:
        yield PaletteCommand("Resume", "let macros and scripts run again", _line("/resume"), "/resume", urgent=True)
    if session.recording:
        yield PaletteCommand("End recording", f"keep {session.recording}", "act.record", "/record stop", urgent=True)
    for key in SHEETS[sheet].keys if sheet else ():
        if key.word and key.action and " / " not in key.action and ".." not in key.keys:
            yield PaletteCommand(key.word.capitalize(), key.about, key.action, key.shown, here=True)
    if not session.recording:
        yield PaletteCommand("Record a macro", "what is typed from now on", "act.record", "/record NAME")
    log = "End the log" if session.log is not None else "Begin a log"
    about = (
        f"of this session: {session.log.path}" if session.log is not None else "of this session, in the state folder"
    )
    yield PaletteCommand(log, about, "act.log", keys.shown("log") or "/log")
    for page in PAGES:
        yield PaletteCommand(page.title, page.about, _call("act.page", page.name), keys.shown(f"page-{page.name}"))
    for panel in PANELS:
        title = f"Panel {panel.name} on or off"
        yield PaletteCommand(title, panel.about, _call("act.panel", panel.name), keys.shown(f"panel-{panel.name}"))
    yield from _choices(session, macros, keys)
    for switch in added():
        if title := switch.title(session):
            yield PaletteCommand(title, switch.meaning, _call("act.switch", switch.name), keys.shown(switch.name))
    switched = {name: "off" if on else "on" for name, on in switches.items()}
    for row in rows(__file__, "commands.csv"):
        shown = row["key"] if row["key"].startswith("/") else keys.shown(row["key"])
        yield PaletteCommand(row["title"].format(**switched), row["about"], row["action"], shown)
    for name, _, meaning in verbs:
        yield PaletteCommand(name, meaning, _call("act.begin_line", f"{name} "))


def _choices(session: Session, macros: FunctionKeys, keymap: Keymap) -> Iterator[PaletteCommand]:
    """Macros, drives and buses, each by its own name."""
    keys = {name: key for key, name in macros.bound}
    for name, note in macros.names:
        key = keymap.shown(f"play-{keys[name].lower()}") if name in keys else ""
        yield PaletteCommand(f"Play {name}", note or "macro", _line(f"/play {name}"), key or f"/play {name}")
    if macros.place:
        yield PaletteCommand(
            "Next page of keys", f"F2 to F12; now page {macros.page}", "act.macro_page", keymap.shown("macro-page")
        )
    yield PaletteCommand("Choose a drive", "the one that plain text goes to", "act.choose_drive", keymap.shown("drive"))
    for number, bus in enumerate(session.tabs.shown, 1):
        if len(session.tabs.shown) > 1:
            key = keymap.shown(f"tab-{number}")
            yield PaletteCommand(
                f"Show bus {bus.name}", "its transcript and drives", _call("act.select", "", bus.name), key
            )
        for drive in bus.drives.values():
            title = f"Drive {bus.name} {drive.address} {drive.label}".rstrip()
            yield PaletteCommand(title, f"select it   {drive.product}", _call("act.select", drive.address, bus.name))
        if bus.name == session.selected_bus:
            yield PaletteCommand(
                f"Rename {bus.name}", "another name in its tab", _call("act.begin_line", "/rename "), "/rename NAME"
            )
            yield PaletteCommand(
                f"Keep {bus.name}", "save it as a connection", _call("act.begin_line", "/keep "), "/keep NAME"
            )
            yield PaletteCommand("Tab to the left", "one place", _line("/tab left"), keymap.shown("tab-left"))
            yield PaletteCommand("Tab to the right", "one place", _line("/tab right"), keymap.shown("tab-right"))
        yield PaletteCommand(f"Close bus {bus.name}", "moves nothing, stops nothing", _line(f"/close {bus.name}"))


def _line(line: str) -> str:
    return _call("act.run_line", line)


def _call(name: str, *arguments: str) -> str:
    return f"{name}({', '.join(map(repr, arguments))})"


def commands_like(commands: Sequence[PaletteCommand], typed: str, width: int) -> list[Match]:
    """Return the commands that match a typed text, the best first; all for an empty text.

    The order: the title begins with it, everyday words for the function, the title has it, the title or the meaning has
    it, the title has its letters.
    """
    words, matcher = typed.casefold().split(), Matcher(typed)
    ranked: list[tuple[int, float, int]] = []
    for number, command in enumerate(commands):
        title, all_of_it = command.title.casefold(), f"{command.title} {command.about} {command.words}".casefold()
        everyday = {*command.words.split(), *title.split()}
        score = matcher.match(command.title) if words else 1.0
        if title.startswith(" ".join(words)):
            ranked.append((0, -score, number))
        elif everyday.issuperset(words):
            ranked.append((1, 0.0, number))
        elif all(word in title for word in words):
            ranked.append((2, -score, number))
        elif all(word in all_of_it for word in words):
            ranked.append((3, -score, number))
        elif score:
            ranked.append((4, -score, number))
    return [Match(str(number), _shown(commands[number], width)) for _, _, number in sorted(ranked)]


def _shown(command: PaletteCommand, width: int) -> Text:
    """Title, meaning, and the key at the right."""
    title = fit(visible(command.title), max(TITLE, len(command.title)))
    room = width - len(title) - len(command.key) - (4 if command.key else 2)
    key = f"  {command.key}" if command.key else ""
    return Text.assemble(f"{title}  ", (fit(visible(command.about), room), "dim"), key)


Entry = tuple[str, str]
"""A key, a line or a sign, and its meaning; a heading has an empty meaning."""
MOST_USED = 6
"""The number of keys at the beginning of the help, with the stop."""
KEY = 15
"""Width of keys, lines and signs."""


def entries(sheet: str, keys: Keymap, macros: Iterable[Entry]) -> list[Entry]:
    """Return all help for a page or a box.

    It begins with what it is for in a few sentences, and the keys that are used most. All its keys in groups follow,
    then the pages that are near, and the rest.
    """
    listed: list[Entry] = [(SHEETS[sheet].title.capitalize(), ""), ("", SHEETS[sheet].about)]
    most = [key for key in footer(sheet) if key.name != "help"][: MOST_USED - 1]
    listed += [("Used most", ""), (STOP.shown, STOP.about)]
    listed += [(keys.shown(key.name) if key.name else key.shown, key.about) for key in most]
    groups = all_groups(sheet)
    near = groups.pop("Pages", [])
    for group, of_group in groups.items():
        listed.append((group, ""))
        for key in of_group:
            if key.keys:
                listed.append((keys.shown(key.name) if key.name else key.shown, key.about))
            elif not key.name:
                listed.append(("^P", f"{key.word}: {key.about}"))
    if near:
        here = f"page-{sheet}"
        listed.append(("Near", ""))
        listed += [
            (keys.shown(command.name) or f"/page {command.name[5:]}", command.about)
            for command in near
            if command.name != here
        ]
    everywhere: dict[str, list[Entry]] = {}
    for row in rows(__file__, "help.csv"):
        everywhere.setdefault(row["group"], [(row["group"], "")]).append((row["key"], row["about"]))
    played = [("Macros on keys", ""), *((key, f"plays {name}") for key, name in macros)]
    stop, *others = everywhere.values()
    return [*listed, *stop, *(played if len(played) > 1 else ()), *chain.from_iterable(others)]


def found(entries: Sequence[Entry], typed: str, width: int) -> list[Match]:
    """Return the entries that contain every typed word, each once, wrapped between words; all for an empty text."""
    wanted = typed.casefold().split()
    matches = []
    for number, (key, what) in enumerate(entries):
        if wanted and (not what or (key, what) in entries[:number]):
            continue
        if all(word in f"{key} {what}".casefold() for word in wanted):
            matches.append(Match(str(number), _wrapped(visible(key), visible(what), width)))
    return matches


def _wrapped(key: str, what: str, width: int) -> Text:
    """A heading, a key with its meaning, or sentences without a key."""
    if not what:
        return Text(key, "bold underline")
    if not key:
        return Text("\n".join(at_words(what, width)))
    first, *more = at_words(what, max(20, width - KEY))
    text = Text.assemble((f"{key:<{KEY - 1}} ", "bold"), first)
    for row in more:
        text.append(f"\n{'':<{KEY}}{row}")
    return text
