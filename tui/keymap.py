"""The keys by the names under which the configuration sets them, `[keys]` in the settings, and the macros on F2 to F12.

A key that can be set is a Textual binding with an id, from `tui.key_table`; Textual's own keymap puts the person's key
in its place. The stop is none of them: it is found below every binding, and no other function gets its key. The macros
on the function keys are in pages, read again when something changed.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from textual.binding import Binding, BindingType
from textual.keys import Keys

from multidrop.base.errors import Diagnostic
from multidrop.base.text import visible
from multidrop.macros import Macro, MacroStore
from multidrop.macros.model import FIRST_PAGE, KEYS, describe_clash, page_order
from multidrop.tui.key_table import NONE
from multidrop.tui.text import key_words

FIXED = {"escape", "enter", "tab", "space", "up", "down", "left", "right", "backspace", "delete"}
FIXED |= {"ctrl+h", "ctrl+i", "ctrl+j", "ctrl+m", "ctrl+z"}
"""Keys that no function can have, as every line and every list needs them, or as they are the same bytes."""
_MODIFIERS = ("ctrl", "alt", "shift")
_KNOWN = {key.value for key in Keys} | {"f" + str(number) for number in range(1, 25)}
_OTHER_WORDS = {"pgup": "pageup", "pgdn": "pagedown", "pgdown": "pagedown", "esc": "escape", "return": "enter"}


def read_key(text: str) -> str:
    """Read `^T`, `Ctrl+T`, `F3` or `Alt+1` as Textual spells it; empty for any other text."""
    spelled = re.sub(r"^\^", "ctrl+", text.strip().lower().replace(" ", "")).replace("^", "ctrl+")
    *modifiers, name = spelled.split("+")
    name = _OTHER_WORDS.get(name, name)
    known = name in _KNOWN or (bool(modifiers) and re.fullmatch(r"[a-z0-9]", name) is not None)
    if not known or len(set(modifiers)) < len(modifiers) or not set(modifiers) <= set(_MODIFIERS):
        return ""
    order = [modifier for modifier in _MODIFIERS if modifier in modifiers]
    return "+".join([*order, name])


@dataclass
class Keymap:
    """The keys in use, what a person set, and what was wrong with it."""

    keys: dict[str, str] = field(default_factory=dict)
    """The keys by name, as Textual spells them; several are separated by commas."""
    about: dict[str, str] = field(default_factory=dict)
    """The meaning of each."""
    changed: dict[str, str] = field(default_factory=dict)
    """Those that differ from the program's own."""
    troubles: list[str] = field(default_factory=list)
    """One line for each setting that does not count."""

    def shown(self, name: str) -> str:
        """The first key of a function as the screen writes it; empty if it has none."""
        first = self.keys.get(name, "").split(",")[0]
        return "" if first.startswith(NONE) or not first else key_words(first)


def keymap(bindings: Iterable[BindingType], wanted: Mapping[str, str]) -> Keymap:
    """Put the keys that a person set in the place of the program's own."""
    own = [binding for binding in bindings if isinstance(binding, Binding) and binding.id]
    keymap = Keymap(
        {binding.id or "": binding.key for binding in own}, {binding.id or "": binding.description for binding in own}
    )
    for name, text in wanted.items():
        spelled = [read_key(key) for key in text.split(",")]
        if trouble := _trouble(keymap, name, text, spelled):
            keymap.troubles.append(f"keys.{visible(name)}: {trouble}")
        else:
            keymap.keys[name] = keymap.changed[name] = ",".join(spelled)
    default = {binding.id or "": binding.key for binding in own}
    for name in list(keymap.changed):
        holders = {key: other for other, keys in keymap.keys.items() if other != name for key in keys.split(",")}
        taken = [key for key in keymap.keys[name].split(",") if key in holders]
        if taken:
            keymap.keys[name] = default[name]
            del keymap.changed[name]
            shown = key_words(taken[0])
            keymap.troubles.append(
                f"keys.{name}: {shown} is the key of {holders[taken[0]]}; set another for one of them"
            )
    return keymap


def _trouble(found: Keymap, name: str, text: str, spelled: list[str]) -> str:
    if name not in found.keys:
        near = difflib.get_close_matches(name, found.keys, 2)
        meant = f"meant: {' or '.join(near)}; " if near else ""
        return f"no such function; {meant}multidrop config show lists them"
    if not all(spelled):
        return f"{visible(text)} is not a key; write ^T, F3, Alt+1 or Ctrl+PageUp"
    for key in spelled:
        if "ctrl" in key.split("+") and key.endswith("+x"):
            return f"{key_words(key)} stops all drives, and does nothing else"
        if key in FIXED:
            return f"{key_words(key)} cannot be given away"
    return ""


def _alike(before: Macro, now: Macro) -> bool:
    """Whether two macros play the same: key and note do not matter."""
    return replace(before, key=now.key, page=now.page, note=now.note) == now


REPEATED_WITHIN = 0.2
"""Seconds between two presses below which the second is the repetition of a held key."""


class FunctionKeys:
    """The macros by name and by key. One page of keys is in use."""

    def __init__(self) -> None:
        self.names: list[tuple[str, str]] = []
        """Name and note of each macro."""
        self.page = FIRST_PAGE
        """The page in use."""
        self.pages: list[str] = [FIRST_PAGE]
        """All pages, the first one always."""
        self.trouble = ""
        """The last read error in one line."""
        self.shown_macros: dict[str, Macro] = {}
        """The macros by name, as they were last read: what a key plays, and nothing else."""
        self._on: dict[str, dict[str, list[str]]] = {}
        """Names by page and key: a key with several plays none."""
        self._pressed = ("", -math.inf)

    def read(self, store: MacroStore) -> list[str]:
        """Read the macros again; report a file that cannot be read, and leave it out.

        Returns the names of those that play other lines than when they were read before.
        """
        before = self.shown_macros
        self.names, self._on, self.trouble, self.shown_macros = [], {}, "", {}
        try:
            names = store.names()
        except Diagnostic as failure:
            self.trouble = str(failure)
            return []
        for name in names:
            try:
                self._take(store.load(name))
            except Diagnostic as failure:
                self.trouble = str(failure)
        self.pages = sorted({FIRST_PAGE, *self._on}, key=page_order)
        if self.page not in self.pages:
            self.page = FIRST_PAGE
        return [name for name, now in self.shown_macros.items() if name in before and not _alike(before[name], now)]

    def _take(self, macro: Macro) -> None:
        self.names.append((macro.name, visible(macro.note)))
        self.shown_macros[macro.name] = macro
        if macro.key:
            self._on.setdefault(macro.page, {}).setdefault(macro.key, []).append(macro.name)

    def held(self, key: str, now: float) -> bool:
        """True if a press is the repetition of a held key, which plays nothing: else a macro would begin anew."""
        before, self._pressed = self._pressed, (key, now)
        return before[0] == key and now - before[1] < REPEATED_WITHIN

    def turn(self) -> None:
        self.page = self.pages[(self.pages.index(self.page) + 1) % len(self.pages)]

    @property
    def place(self) -> str:
        """The page in use, in words; empty where there is only one."""
        return f"keys {self.page}" if len(self.pages) > 1 else ""

    @property
    def keys(self) -> dict[str, str]:
        """Name by key, for the keys of this page with exactly one macro."""
        return {key: names[0] for key, names in self._here.items() if len(names) == 1}

    @property
    def _here(self) -> dict[str, list[str]]:
        return self._on.get(self.page, {})

    def clash(self, key: str) -> str:
        """Describe the clash on a key with several macros in one line; empty for any other key."""
        names = self._here.get(key, [])
        if len(names) < 2:
            return ""
        page = "" if self.page == FIRST_PAGE else f" --page {self.page}"
        return f"{describe_clash(key, names)}; /key {key} NAME{page} leaves one on it"

    @property
    def bound(self) -> list[tuple[str, str]]:
        """(key, name) pairs in the order of the keys."""
        keys = self.keys
        return [(key, keys[key]) for key in KEYS if key in keys]

    @property
    def shown(self) -> list[tuple[str, str]]:
        """(key, text) pairs for the key row; `2 macros!` for a key with several."""
        here = self._here
        return [
            (key, here[key][0] if len(here[key]) == 1 else f"{len(here[key])} macros!") for key in KEYS if key in here
        ]
