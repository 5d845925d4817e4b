"""Which macro is on which function key, read again when something changed."""

from __future__ import annotations

from dialects import Diagnostic
from tui.desk import MacrosView

KEYS = tuple(f"F{number}" for number in range(2, 13))


class MacroKeys:
    """The macros by name and by key."""

    def __init__(self) -> None:
        self.names: list[tuple[str, str]] = []
        """Name and note of each macro."""
        self.keys: dict[str, str] = {}
        """Name by key."""
        self.trouble = ""
        """What could not be read, in one line."""

    def read(self, store: MacrosView) -> None:
        """Look again; a file that cannot be read is said and left out."""
        self.names, self.keys, self.trouble = [], {}, ""
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
            self.names.append((macro.name, macro.note))
            if macro.key:
                self.keys.setdefault(macro.key, macro.name)

    @property
    def bound(self) -> list[tuple[str, str]]:
        """(key, name), in the order of the keys."""
        return [(key, self.keys[key]) for key in KEYS if key in self.keys]
