"""Program languages and personalities for the command line, read from the tables of families."""

from __future__ import annotations

from collections.abc import Iterator

from multidrop.dialects.families import DEFAULT, program_languages
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.families import PROGRAMS, TABLE

DEFAULT_PERSONALITY = DriveSpec().personality


TESTED = tuple(personality for name in PROGRAMS for personality in TABLE[name].personalities)
"""The personalities that run programs."""


class Checked:
    """The personalities on which a check of a program depends; a family is imported only to look for one of them."""

    def __contains__(self, personality: object) -> bool:
        return personality in TESTED and any(personality in TABLE[name].personalities for name in self._families())

    def __iter__(self) -> Iterator[str]:
        return (personality for name in self._families() for personality in TABLE[name].personalities)

    def _families(self) -> Iterator[str]:
        return (name for name, programs in PROGRAMS.items() if programs.refusals is not None)


def names() -> list[str]:
    """The values of --language."""
    return list(program_languages())


def titles() -> str:
    """The languages of program files, with the endings of their names, for a help text."""
    return " or ".join(f"{each.title} ({', '.join(each.endings)})" for each in program_languages().values())


def endings() -> str:
    """The language that each ending of a file's name means, for a help text."""
    known = program_languages().items()
    named = (f"{name} for {', '.join(each.endings)}" for name, each in known if name != DEFAULT)
    return f"{'; '.join(named)}; else {DEFAULT}"
