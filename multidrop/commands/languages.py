"""Program languages and personalities for the command line, read from the tables of families."""

from __future__ import annotations

from dialects.families import DEFAULT, program_languages
from simulator.families import FAMILIES
from simulator.family import Family

_TESTED = [family for family in FAMILIES.values() if family.programs is not None]
_CHECKED = [family for family in _TESTED if family.programs is not None and family.programs.refusals is not None]


def names() -> list[str]:
    """The values of --language."""
    return list(program_languages())


def titles() -> str:
    """The languages of program files, with the endings of their names, for a help text."""
    return " or ".join(f"{each.title} ({', '.join(each.endings)})" for each in program_languages().values())


def endings() -> str:
    """The language that each ending of a file's name means, for a help text."""
    known = program_languages().items()
    named = (f"{name} for {', '.join(each.endings)}" for name, each in known if name != DEFAULT.name)
    return f"{'; '.join(named)}; else {DEFAULT.name}"


def tested_personalities() -> list[str]:
    """The personalities that run programs."""
    return _personalities(_TESTED)


def checked_personalities() -> list[str]:
    """The personalities on which a check of a program depends."""
    return _personalities(_CHECKED)


def _personalities(families: list[Family]) -> list[str]:
    return [personality for family in families for personality in family.personalities]


def _default() -> str:
    programs = FAMILIES[DEFAULT.name].programs
    assert programs is not None, "the default family has program files"
    return programs.drive.personality


DEFAULT_PERSONALITY = _default()
