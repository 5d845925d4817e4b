"""What a sheet of keys is: the keys of a page, a box or a part of the screen, with what it is for.

The sheets themselves are `tui.key_table`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from multidrop.tui.text import key_words

NONE = "no-key-"
"""The head of the placeholder for a function without a key."""
SIGNS = {
    "up": "↑",
    "down": "↓",
    "left": "←",
    "right": "→",
    "plus": "+",
    "minus": "-",
    "slash": "/",
    "equals_sign": "=",
    "escape": "Esc",
    "delete": "Del",
    "insert": "Ins",
}
"""Keys that the screen writes in another way than by their name."""
_NUMBERS = re.compile(r"(\d+)\.\.(\d+)")


class Key(NamedTuple):
    """A key, or several that belong together, and what it does on a page."""

    keys: str
    """As Textual spells them; alternatives have commas between them: `ctrl+b,insert`.

    ` / ` divides keys with actions of their own, `1..9` stands for nine of them. Empty: a function without a key, which
    a person can give one.
    """
    action: str
    """As Textual spells it, divided like the keys; `{}` is the number. Empty: the part with the focus does it."""
    about: str
    """What it does here, in one line."""
    word: str = ""
    """One or two words for the footer; empty: it is not in the footer."""
    name: str = ""
    """The function in `[keys]` of the settings; empty: its key is fixed."""
    first: bool = False
    """It comes before the keys of the part with the focus. Keys with Ctrl, and those with a name, always do."""

    @property
    def shown(self) -> str:
        """The first key of each part as the screen writes it: `^B`, `←→`, `1-9`, `Home`."""
        parts = [shown_key(each.split(",")[0]) for each in self.keys.split(" / ")]
        return ("" if all(len(each) == 1 for each in parts) else " ").join(parts)

    @property
    def single(self) -> Iterator[tuple[str, str, str]]:
        """(keys, action, name) of each key that it stands for."""
        actions = self.action.split(" / ")
        for keys, action in zip(self.keys.split(" / "), actions, strict=True):
            numbers = _NUMBERS.search(keys)
            for n in range(int(numbers[1]), int(numbers[2]) + 1) if numbers else (0,):
                yield _NUMBERS.sub(str(n), keys), action.replace("{}", str(n)), self.name.replace("{}", str(n))


def shown_key(key: str) -> str:
    """A key as the screen writes it."""
    *modifiers, name = key.split("+")
    if name in SIGNS and not modifiers:
        return SIGNS[name]
    if numbers := _NUMBERS.search(key):
        return f"{key_words(_NUMBERS.sub(numbers[1], key))}-{numbers[2]}"
    return key if len(key) == 1 else key_words(key)


class Sheet(NamedTuple):
    """A page, a box or a part of the screen: what it is for, and its keys in groups."""

    title: str
    about: str
    """What it is for and how it is used, in six sentences at most."""
    groups: Mapping[str, Sequence[Key]]
    below: Sequence[str] = ()
    """The sheets whose keys work here, too."""
    foot: Sequence[str] = ("back", "*", "everything")
    """The words of the footer in order; `*` stands for those of its own keys."""

    @property
    def keys(self) -> list[Key]:
        """Its own keys."""
        return [key for keys in self.groups.values() for key in keys]
