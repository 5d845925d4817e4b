"""Reading the programs of a controller, as A-SCRIPT or as compiled lines."""

from __future__ import annotations

from dialects.codec import Procedure
from dialects.errors import Refused
from dialects.pmx.host import download
from dialects.pmx.host.exchange import who
from dialects.pmx.host.state import PmxState
from dialects.pmx.manual import program_file
from dialects.pmx.manual.script_decompiler import Undecodable


def readable(state: PmxState) -> Procedure[tuple[str, ...]]:
    """Return the program as A-SCRIPT, or as compiled lines with a remark where a unit's own compiler made them."""
    listed = yield from download.listing(state)
    try:
        return tuple(program_file.readable(listed))
    except Undecodable as problem:
        return (f"; compiled lines, as they are stored: {problem}", *listed)


def upload(state: PmxState, raw: bool) -> Procedure[tuple[str, ...]]:
    """Return a file that can be downloaded: A-SCRIPT, or compiled lines (`raw`, or without A-SCRIPT)."""
    lines = yield from download.listing(state) if raw else readable(state)
    if not lines:
        raise Refused(f"{who(state)} holds no program")
    return lines
