"""Which entries of a session log are shown."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

from multidrop.shell.operations import arguments
from multidrop.shell.operations.parameter import Argument, Listed

LogFile = Annotated[str, Argument("a session log (default: the newest)", metavar="FILE", listed=(Listed.FILE,))]
LogDrives = Annotated[
    str,
    Argument(
        "entries of this drive only, ADDR or BUS:ADDR; may be repeated",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]
Polls = Annotated[bool, Argument("show the bytes of polls, too")]
JsonEntries = Annotated[bool, Argument("print the entries as they are in the file")]


@dataclass(frozen=True)
class Entries:
    """Which entries of a session log are shown, and how."""

    file: LogFile = ""
    _: KW_ONLY
    drive: LogDrives = ""
    all: Polls = False
    json: JsonEntries = False
