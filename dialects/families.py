"""The one table of the families of drives. A new family adds one row here.

A row holds what is known of a family without its code, which is imported at the first use of its record.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from dialects.on_demand import OnDemand
from dialects.program_files import ProgramFiles

if TYPE_CHECKING:
    from dialects.codec import Codec
    from dialects.family import Family, Language


class Row(NamedTuple):
    """A family: the place of its record, and what a URL or the name of a file says of it."""

    record: str
    scheme: str = ""
    """The URL scheme that implies this family; empty: the user chooses it by `dialect=`."""
    files: ProgramFiles | None = None
    """None: there are no program files."""


TABLE: Mapping[str, Row] = {
    "mcode": Row(
        "dialects.mcode.family:MCODE",
        files=ProgramFiles(
            "MCode",
            (".mxt", ".txt"),
            "dialects.mcode.manual.program_checker",
            "dialects.mcode.manual.editing",
            ("mcode", "mxt"),
        ),
    ),
    "modbus": Row("dialects.modbus.family:MODBUS", scheme="modbus"),
    "pmx": Row(
        "dialects.pmx.family:PMX",
        files=ProgramFiles(
            "A-SCRIPT",
            (".prg", ".asc"),
            "dialects.pmx.manual.program_file",
            "dialects.pmx.manual.editing",
            ("ascript", "a-script", "pmx"),
        ),
    ),
    "tmcl": Row("dialects.tmcl.family:TMCL"),
}
FAMILIES: Mapping[str, Family[Any]] = OnDemand({name: row.record for name, row in TABLE.items()})
"""By name. Nothing tries one family after another: a URL names the family, or the drives are `DEFAULT`."""
DEFAULT = next(iter(TABLE))


def family_of(codec: Codec) -> Family[Any]:
    """The family whose drives this codec speaks to."""
    return FAMILIES[codec.family]


def languages() -> list[Language]:
    """The languages that people type, each once."""
    return list({id(family.language): family.language for family in FAMILIES.values()}.values())


def program_languages() -> dict[str, ProgramFiles]:
    """Program files by the name of their family."""
    return {name: row.files for name, row in TABLE.items() if row.files is not None}


def program_language_of(path: str | os.PathLike[str]) -> str:
    """The family of a program file, by the ending of its name; the default family's where none fits."""
    ending = os.path.splitext(path)[1].lower()
    found = (name for name, files in program_languages().items() if ending in files.endings)
    return next(found, DEFAULT)
