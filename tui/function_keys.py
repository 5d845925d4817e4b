"""The macros on the function keys, read again when something changed."""

from __future__ import annotations

from dialects import Diagnostic
from dialects.visible import visible
from macros.model import KEYS, describe_clash
from tui.session_view import MacrosView


class FunctionKeys:
    """The macros by name and by key."""

    def __init__(self) -> None:
        self.names: list[tuple[str, str]] = []
        """Name and note of each macro."""
        self.keys: dict[str, str] = {}
        """Name by key, for keys with exactly one macro."""
        self.clashes: dict[str, list[str]] = {}
        """Names by key, for keys with several macros: such a key plays none."""
        self.trouble = ""
        """The last read error in one line."""

    def read(self, store: MacrosView) -> None:
        """Read the macros again; report a file that cannot be read, and leave it out."""
        self.names, self.keys, self.clashes, self.trouble = [], {}, {}, ""
        try:
            names = store.names()
        except Diagnostic as failure:
            self.trouble = str(failure)
            return
        for name in names:
            try:
                macro = store.load(name)
            except Diagnostic as failure:
                self.trouble = str(failure)
                continue
            self.names.append((macro.name, visible(macro.note)))
            if macro.key in self.clashes:
                self.clashes[macro.key].append(macro.name)
            elif macro.key in self.keys:
                self.clashes[macro.key] = [self.keys.pop(macro.key), macro.name]
            elif macro.key:
                self.keys[macro.key] = macro.name

    def clash(self, key: str) -> str:
        """Describe the clash on a key with several macros in one line; empty for any other key."""
        if key not in self.clashes:
            return ""
        return f"{describe_clash(key, self.clashes[key])}; /key {key} NAME leaves one on it"

    @property
    def bound(self) -> list[tuple[str, str]]:
        """(key, name) pairs in the order of the keys."""
        return [(key, self.keys[key]) for key in KEYS if key in self.keys]

    @property
    def shown(self) -> list[tuple[str, str]]:
        """(key, text) pairs for the key row; `2 macros!` for a key with several."""
        several = {key: f"{len(names)} macros!" for key, names in self.clashes.items()}
        on = self.keys | several
        return [(key, on[key]) for key in KEYS if key in on]
