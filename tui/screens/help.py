"""Help for where you are: the keys of the screen that is shown, how lines are written, what the signs mean."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.text import Text

from multidrop.tui.keymap import Keymap
from multidrop.tui.screens.dialogs import Match
from multidrop.tui.screens.framed import Framed
from multidrop.tui.screens.page import Page
from multidrop.tui.text import at_words, visible

Entry = tuple[str, str]
"""A key, a line or a sign, and its meaning; a heading has an empty meaning."""
KEY = 15
"""Width of keys, lines and signs."""
STOP: Sequence[Entry] = (
    ("^X", "STOP ALL: drives, macros, scripts; from anywhere"),
    ("/resume", "after a stop: macros and scripts may run again"),
)
TYPING: Sequence[Entry] = (
    ("Lines", ""),
    ("MR 51200", "goes to the selected drive, in its own language"),
    ("@b PR P", "to drive b; @* to all; @press:b on another bus"),
    ("/help MR", "the meaning of a word; /help alone lists the verbs"),
    ("Tab", "completions of what is typed"),
    ("Up Down", "lines typed before that begin with what is typed"),
)
SIGNS: Sequence[Entry] = (
    ("Signs", ""),
    ("› »", "typed by a person; sent by a macro or a script"),
    ("«", "printed by a drive without a request"),
    ("↑ ↓", "bytes sent, bytes received (/hex)"),
    ("✗", "refused, no reply, lost"),
    ("· !", "progress; warning"),
    ("▶ ■", "velocity last read: not 0; 0"),
    ("□", "at rest without current: nothing holds the load"),
    ("~", "the position does not count since a restart: home it, set it, or /referenced"),
    ("? ·", "does not reply; not read lately"),
    ("≠", "the position differs from that of the drive's twin by more than the limit"),
    ("◆", "program mode: lines are stored, not executed"),
)


def entries(screen: Framed, keys: Keymap, macros: Iterable[Entry]) -> list[Entry]:
    """All help for a screen: its own keys first."""
    page = [("This page", ""), ("Esc", "go back"), *screen.KEYS] if isinstance(screen, Page) else []
    named = [(keys.shown(name), keys.about[name]) for name in keys.keys if not name.startswith(("play-", "tab-"))]
    jumps = [(f"{keys.shown('tab-before')} {keys.shown('tab-after')}", "the other lines; also Alt+1 .. Alt+9")]
    played = [(key, f"plays {name}") for key, name in macros] or [("F2 .. F12", "play the macro that is on the key")]
    everywhere = [("Keys", ""), *STOP, *((key, what) for key, what in named if key), *jumps, *played]
    return [*page, *everywhere, *TYPING, *SIGNS]


def found(entries: Sequence[Entry], typed: str, width: int) -> list[Match]:
    """The entries that contain every typed word, each wrapped between words."""
    wanted = typed.casefold().split()
    matches = []
    for number, (key, what) in enumerate(entries):
        if (what or not wanted) and all(word in f"{key} {what}".casefold() for word in wanted):
            matches.append(Match(str(number), _shown(visible(key), visible(what), width)))
    return matches


def _shown(key: str, what: str, width: int) -> Text:
    if not what:
        return Text(key, "bold underline")
    first, *more = at_words(what, max(20, width - KEY))
    text = Text.assemble((f"{key:<{KEY - 1}} ", "bold"), first)
    for row in more:
        text.append(f"\n{'':<{KEY}}{row}")
    return text
