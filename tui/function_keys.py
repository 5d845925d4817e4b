"""The macros on the function keys, in pages, read again when something changed."""

from __future__ import annotations

import math

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import visible
from multidrop.macros.model import FIRST_PAGE, KEYS, describe_clash, page_order
from multidrop.tui.session_view import MacrosView, MacroView

HELD = 0.2
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
        self._on: dict[str, dict[str, list[str]]] = {}
        """Names by page and key: a key with several plays none."""
        self._pressed = ("", -math.inf)

    def read(self, store: MacrosView) -> None:
        """Read the macros again; report a file that cannot be read, and leave it out."""
        self.names, self._on, self.trouble = [], {}, ""
        try:
            names = store.names()
        except Diagnostic as failure:
            self.trouble = str(failure)
            return
        for name in names:
            try:
                self._take(store.load(name))
            except Diagnostic as failure:
                self.trouble = str(failure)
        self.pages = sorted({FIRST_PAGE, *self._on}, key=page_order)
        if self.page not in self.pages:
            self.page = FIRST_PAGE

    def _take(self, macro: MacroView) -> None:
        self.names.append((macro.name, visible(macro.note)))
        if macro.key:
            self._on.setdefault(macro.page, {}).setdefault(macro.key, []).append(macro.name)

    def held(self, key: str, now: float) -> bool:
        """Whether a press is the repetition of a held key, which plays nothing: else a macro would begin anew."""
        before, self._pressed = self._pressed, (key, now)
        return before[0] == key and now - before[1] < HELD

    def turn(self) -> None:
        """Use the next page."""
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
