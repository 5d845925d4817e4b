"""Program languages and personalities for the command line, read from the tables of families."""

from __future__ import annotations

from dialects.sources import DEFAULT, NAMES, SOURCES
from simulator.families import FAMILIES
from simulator.family import Family

_TESTED = [family for family in FAMILIES.values() if family.programs is not None]
_CHECKED = [family for family in _TESTED if family.programs is not None and family.programs.refusals is not None]


def names() -> list[str]:
    """The values of --language."""
    return list(SOURCES)


def titles() -> str:
    """The languages of program files, with the endings of their names, for a help text."""
    return " or ".join(f"{NAMES[name]} ({', '.join(each.ENDINGS)})" for name, each in SOURCES.items())


def endings() -> str:
    """The language that each ending of a file's name means, for a help text."""
    named = (f"{name} for {', '.join(each.ENDINGS)}" for name, each in SOURCES.items() if name != DEFAULT)
    return f"{'; '.join(named)}; else {DEFAULT}"


def tested_personalities() -> list[str]:
    """The personalities that run programs."""
    return _personalities(_TESTED)


def checked_personalities() -> list[str]:
    """The personalities on which a check of a program depends."""
    return _personalities(_CHECKED)


def _personalities(families: list[Family]) -> list[str]:
    return [personality for family in families for personality in family.personalities]


def _default() -> str:
    programs = FAMILIES[DEFAULT].programs
    assert programs is not None, "the default family has program files"
    return programs.drive.personality


DEFAULT_PERSONALITY = _default()
