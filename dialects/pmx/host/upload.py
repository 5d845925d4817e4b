"""The programs of a controller as a file: A-SCRIPT, or compiled lines."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.held import Held
from multidrop.dialects.pmx.host.exchange import who
from multidrop.dialects.pmx.host.holding import read
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import program_file
from multidrop.dialects.pmx.manual.script_decompiler import Undecodable


def readable(held: Held) -> tuple[str, ...]:
    """Return the program as A-SCRIPT, or as compiled lines with a remark where a unit's own compiler made them."""
    listed = _compiled(held)
    try:
        return tuple(program_file.readable(listed))
    except Undecodable as problem:
        return (f"; compiled lines, as they are stored: {problem}", *listed)


def upload(state: PmxState, raw: bool) -> Procedure[tuple[str, ...]]:
    """Return a file that can be downloaded: A-SCRIPT, or compiled lines (`raw`, or without A-SCRIPT)."""
    held = yield from read(state, (), lambda done, total: None)
    held.check_program(who(state))
    return file_of(state, held, raw)


def file_of(_: PmxState, held: Held, raw: bool) -> tuple[str, ...]:
    """Return the lines of a file that reproduces what a controller holds."""
    return _compiled(held) if raw else readable(held)


def _compiled(held: Held) -> tuple[str, ...]:
    """Return compiled lines, as they are stored."""
    return tuple(f"SA{line.at}={line.text}" for line in held.lines)
