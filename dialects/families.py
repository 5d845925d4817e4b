"""The languages of drives, as the families declare them (`multidrop.families.NAME.FAMILY`).

A declaration holds what is known of a language without its code, which is imported at the first use of its record.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from multidrop.base import registry
from multidrop.base.files import split_lines
from multidrop.base.on_demand import OnDemand
from multidrop.base.text import visible
from multidrop.dialects.program_files import FileLanguage, ProgramFiles, errors

if TYPE_CHECKING:
    from multidrop.dialects.family import Family
    from multidrop.dialects.language import Language
    from multidrop.dialects.state import DriveState


class Dialect(NamedTuple):
    """A language that drives of a family speak: in the record of the family."""

    name: str
    """Its name in `dialect=`."""
    record: str
    """The place of its `Family`."""
    scheme: str = ""
    """The URL scheme that implies it; empty: the user chooses it by `dialect=`."""
    files: ProgramFiles | None = None
    """None: there are no program files."""

    def claims(self) -> tuple[str, ...]:
        """What only one family can add."""
        return (f"dialect={self.name}",)


def dialects() -> dict[str, Dialect]:
    """All languages by name, those of the wheel first."""
    return {record.name: record for record in registry.records(registry.families(), Dialect)}


FAMILIES: Mapping[str, type[Family]] = OnDemand(
    lambda: {dialect.name: dialect.record for dialect in dialects().values()}
)
"""By name. Nothing tries one family after another: a URL names the family, or the drives are `DEFAULT`."""
DEFAULT = registry.DEFAULT


def family_of(state: DriveState) -> Family:
    """What the family of a drive says of it."""
    return FAMILIES[state.codec.family](state)


def languages() -> list[Language]:
    return list({id(family.language): family.language for family in FAMILIES.values()}.values())


def program_languages() -> dict[str, ProgramFiles]:
    return {name: dialect.files for name, dialect in dialects().items() if dialect.files is not None}


def program_language_of(path: str | os.PathLike[str]) -> str:
    """The family of a program file, by the ending of its name; the default family's where none fits."""
    ending = os.path.splitext(path)[1].lower()
    if not any(ending in files.endings for files in program_languages().values()):
        registry.load_others()
    languages = (name for name, files in program_languages().items() if ending in files.endings)
    return next(languages, DEFAULT)


def correct_in(text: str, besides: str) -> str:
    """Find the family, another than `besides`, whose language a program text is; empty: there is none.

    The text is correct in it; or each of its lines has words of it, and not each has words of the language `besides`. A
    text without a statement, of remarks alone, is correct in many languages and shows none of them.
    """
    known = program_languages()
    stated = {name: _shares(text, files.language) for name, files in known.items()}
    others = [name for name in known if name != besides and stated[name][0]]
    correct = (name for name in others if not errors(known[name].language.check(text)))
    spoken_throughout = (name for name in others if stated[name][1] and not stated[besides][1])
    return next(correct, "") or next(spoken_throughout, "")


def _shares(text: str, language: FileLanguage) -> tuple[bool, bool]:
    """Whether a text has a word of a language, and whether each line begins with one and has nothing unknown."""
    kinds, throughout = set[str](), True
    for line in split_lines(text):
        parts = language.parts(line)
        own = [part for part in parts if part.kind != "remark"]
        kinds |= {part.kind for part in own}
        if own or (line.strip() and not parts):
            begins = bool(own) and own[0].start == len(line) - len(line.lstrip())
            throughout = throughout and begins and all(part.kind != "wrong" for part in own)
    return bool(kinds), throughout and bool(kinds & {"word", "starts"})


def spoken(data: bytes, besides: str) -> str:
    """Name the family, another than `besides`, whose replies these bytes hold, for a message; empty: none."""
    names = (name for name, family in FAMILIES.items() if name != besides and family.in_frames(data))
    language = next(names, "")
    return (
        f"frames came as {language.upper()} drives send them: dialect={language} opens such a line" if language else ""
    )


MOST_SHOWN_BYTES = 40
"""Most characters that are shown of what came from an unknown line."""


def seen(data: bytes, besides: str) -> str:
    """What came in place of a reply of the family `besides`, for a message; empty: nothing came.

    Whole messages with a number and a length are the family's own, and it says by itself what was wrong with them.
    """
    codec = FAMILIES[besides].codec
    if codec.numbered and codec.parse_unsolicited(data) == ((), len(data)):
        return ""
    readable = sum(0x20 <= byte < 0x7F or byte in b"\t\r\n\x06\x15" for byte in data)
    if not data or (frames := spoken(data, besides)):
        return frames if data else ""
    one = len(data) == 1
    if 2 * readable < len(data):
        how = (
            "1 byte came, and is not readable"
            if one
            else f"{len(data)} bytes came, {readable or 'none'} of them readable"
        )
        return f"{how}: another baud rate?"
    text = visible(data[:MOST_SHOWN_BYTES].decode("latin-1").strip())
    repeated = "or an adapter that repeats what it sends (echo=local)"
    came = "1 byte came that is no reply" if one else f"{len(data)} bytes came that are no reply"
    return f"{came} ('{text}'): another language, {repeated}?"
