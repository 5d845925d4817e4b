"""The one table of keys: what each page and box is for, its keys, and what they do there.

Bindings, footers, the keys named in boxes, F1 and the table in docs/screen.md are made from it, so none of them can
name a key that does nothing. A key does one kind of thing wherever it works; each page has its own word for that
(docs/decisions/0099).

To add a key, add a row to `keys.csv`, and its action to the page. A sheet is a row of `sheets.csv`. Features add
`shell.hooks.Switch`es.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from textual.binding import Binding, BindingType

from multidrop.base.files import rows
from multidrop.shell.hooks import switches
from multidrop.shell.operations.table import join_others
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
        parts = [shown_key(key.split(",")[0]) for key in self.keys.split(" / ")]
        return ("" if all(len(part) == 1 for part in parts) else " ").join(parts)

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


class KeySheet(NamedTuple):
    """A page, a box or a part of the screen: what it is for, and its keys in groups."""

    title: str
    about: str
    """What it is for and how it is used, in five sentences at most."""
    groups: Mapping[str, Sequence[Key]]
    below: Sequence[str]
    """The sheets whose keys work here, too."""
    foot: Sequence[str]
    """The words of the footer in order, the most important first; `*` stands for those of its other keys."""

    @property
    def keys(self) -> list[Key]:
        """Its own keys."""
        return [key for keys in self.groups.values() for key in keys]


STOP = Key("ctrl+x", "", "STOP ALL: drives, macros, scripts; from anywhere", "STOP ALL")
"""The stop: it is found below every binding."""


def _sheets() -> dict[str, KeySheet]:
    groups: dict[str, dict[str, list[Key]]] = {}
    for row in rows(__file__, "keys.csv"):
        key = Key(row["keys"], row["action"], row["about"], row["word"], row["name"], bool(row["first"]))
        groups.setdefault(row["sheet"], {}).setdefault(row["group"], []).append(key)
    join_others()  # their keys are bound as the classes of the screen are made
    for switch in switches():
        groups["main"]["Lines of drives"].append(
            Key("", f"act.switch('{switch.name}')", switch.keyed, name=switch.name)
        )
    return {
        row["sheet"]: KeySheet(
            row["title"], row["about"], groups[row["sheet"]], row["below"].split(), row["foot"].split(" | ")
        )
        for row in rows(__file__, "sheets.csv")
    }


SHEETS = _sheets()
"""By name, in the order of F1 and of the palette."""


def bound(name: str) -> list[BindingType]:
    """The bindings of a sheet's own keys. One with a name comes before any widget, as does one with Ctrl.

    So text typed right after a key that opens a dialog is for that dialog.
    """
    made: list[BindingType] = []
    for key in SHEETS[name].keys:
        for keys, action, function in key.single:
            if action and (keys or function):
                first = key.first or bool(function) or keys.startswith("ctrl+")
                spelled = keys or f"{NONE}{function}"
                about = key.about.replace("{}", function.rpartition("-")[2])
                made.append(Binding(spelled, action, about, show=False, priority=first, id=function or None))
    return made


class Keyed:
    """A screen or a part of one, whose keys are those of its sheet, before any that it adds."""

    SHEET: ClassVar[str]
    BINDINGS: ClassVar[list[BindingType]]

    def __init_subclass__(cls, **named: Any) -> None:
        if "SHEET" in cls.__dict__:
            cls.BINDINGS = [*bound(cls.SHEET), *cls.__dict__.get("BINDINGS", ())]
        super().__init_subclass__(**named)


def all_groups(name: str) -> dict[str, list[Key]]:
    """The keys that work with a sheet, in groups: its own, then those of the sheets below it."""
    groups: dict[str, list[Key]] = {}
    for sheet in [name, *below(name)]:
        for group, keys in SHEETS[sheet].groups.items():
            taken = {each for keys_ in groups.values() for key in keys_ for each in key.keys.split(" / ") if each}
            rest = [key for key in keys if not key.keys or key.keys not in taken]
            groups.setdefault(group, []).extend(rest)
    return groups


def below(name: str) -> list[str]:
    """The sheets below a sheet, the nearest first."""
    return [sheet for under in SHEETS[name].below for sheet in (under, *below(under))]


def footer(name: str) -> list[Key]:
    """Return the keys in the footer of a sheet, the most important first."""
    sheet = SHEETS[name]
    own = [key for key in sheet.keys if key.word and key.keys]
    every = [*own, *(key for each in below(name) for key in SHEETS[each].keys)]
    keys: list[Key] = []
    for word in sheet.foot:
        rest = [key for key in own if key.word not in sheet.foot]
        keys += rest if word == "*" else [key for key in every if key.word == word and key.keys][:1]
    return keys


def hint(name: str, **words: str) -> str:
    """The keys of a box in one line; `words` replace those of a key: `enter="open"`."""
    keys = [*SHEETS[name].keys, *(key for sheet in below(name) for key in SHEETS[sheet].keys if key.action == "leave")]
    return "   ".join(f"{key.shown} {words.get(key.keys, key.word)}" for key in keys if key.word)
