"""The one table of the families of drives. A new family adds one line here."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dialects.codec import Codec
from dialects.family import Family, Language, Programs
from dialects.mcode.family import MCODE
from dialects.modbus.family import MODBUS
from dialects.pmx.family import PMX
from dialects.tmcl.family import TMCL

_ALL: tuple[Family[Any], ...] = (
    MCODE,
    MODBUS,
    PMX,
    TMCL,
)

FAMILIES: Mapping[str, Family[Any]] = {family.name: family for family in _ALL}
"""By name. Nothing tries one family after another: a URL names the family, or the drives are `DEFAULT`."""
DEFAULT = MCODE


def family_of(codec: Codec) -> Family[Any]:
    """The family whose drives this codec speaks to."""
    return FAMILIES[codec.family]


def languages() -> list[Language]:
    """The languages that people type, each once."""
    return list({id(family.language): family.language for family in _ALL}.values())


def program_languages() -> dict[str, Programs[Any]]:
    """Program files by the name of their family."""
    return {family.name: family.programs for family in _ALL if family.programs is not None}


def program_language_of(path: str | Path) -> str:
    """The family of a program file, by the ending of its name; the default family's where none fits."""
    ending = Path(path).suffix.lower()
    found = (name for name, programs in program_languages().items() if ending in programs.endings)
    return next(found, DEFAULT.name)
