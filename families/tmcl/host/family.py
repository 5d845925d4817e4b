"""The record of the TMCL family: Trinamic modules in direct mode, on RS-485, USB or through a TCP converter.

It has no URL scheme: its frames contain bytes that other drives obey, so nothing tries it on an unknown line before a
person has agreed. A guarded line wears the EEPROM out, forgets what is stored, starts programs later, or changes how
the module is reached. A stop is never guarded. Values have numbers; a word is the name of a parameter (`parameter`).
"""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.base.files import rows
from multidrop.dialects.family import ADDRESSES, EVERYONE, Family, Guard, Guards, to_all
from multidrop.families.tmcl.host import codec, operations
from multidrop.families.tmcl.host.codec import STOP_BYTES, Tmcl, TmclState
from multidrop.families.tmcl.host.operations import identify
from multidrop.families.tmcl.manual import commands, help
from multidrop.families.tmcl.manual.commands import Command, Global

FIRST = "0"
"""The first motor."""


def move(axis: str, steps: int | str) -> tuple[str, ...]:
    return (f"MVP REL, {axis or FIRST}, {steps}",)


def move_to(axis: str, position: int | str) -> tuple[str, ...]:
    return (f"MVP ABS, {axis or FIRST}, {position}",)


_ROWS = list(rows(__file__, "guards.csv"))
"""The guards on commands, by their word or number, and on setting a global parameter of bank 0, or restoring it from
EEPROM. `switch`: a 0 switches it off, which needs no agreement.
"""
GUARDS: Mapping[str, str] = {
    **{row["name"]: row["what"] for row in _ROWS},
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its lines do."""
_COMMANDS: Mapping[int, str] = {
    int(word) if word.isdigit() else Command[word]: row["name"] for row in _ROWS if (word := row["command"])
}
_PARAMETERS: Mapping[int, str] = {Global[row["parameter"]]: row["name"] for row in _ROWS if row["parameter"]}
_SWITCHES = frozenset(Global[row["parameter"]] for row in _ROWS if row["switch"])


def guarded(text: str, address: str) -> Guard | None:
    """Find the guard of a line for a module; None: the line needs no agreement, as an invalid one."""
    line = text.strip()
    if (call := commands.parsed(text)) is None:
        return None
    name = _COMMANDS.get(call.command, "")
    off = call.command == Command.SGP and call.type in _SWITCHES and not call.value
    if call.command in (Command.SGP, Command.RSGP) and call.motor == 0 and not off:
        name = _PARAMETERS.get(call.type, "")
    if name:
        return Guard(name, f"'{line}' {GUARDS[name]}")
    return to_all(line) if address in ADDRESSES and call.moves and not only_ends(text) else None


def only_ends(text: str) -> bool:
    """Whether a line is a command of motion that can only end it: a velocity of 0."""
    call = commands.parsed(text)
    return call is not None and call.command in (Command.ROR, Command.ROL) and call.value == 0


def word_of(text: str) -> str:
    """The word at the head of a line, in capitals; the number of a command without a word."""
    return text.strip().partition(" ")[0].upper()


def only_reads(text: str) -> bool:
    return word_of(text) in (Command.GAP.name, Command.GGP.name, Command.GIO.name)


TMCL = Family(
    name=Tmcl.family,
    codec=Tmcl(),
    new_state=TmclState,
    identify=identify,
    perform=operations.perform,
    check=operations.parsed,
    motion=operations.motion,
    moving=operations.moving,
    busy=operations.busy,
    status=operations.status,
    referencing=operations.referencing,
    homed=operations.homed,
    language=help,
    rests_in_place=True,
    question=commands.asked,
    move=move,
    move_to=move_to,
    assign=commands.assigned,
    guards=Guards(GUARDS, lambda state, text: guarded(text, state.address), word_of, only_ends, only_reads),
    programs_at="multidrop.families.tmcl.host.programs:PROGRAM_FILES",
    debugging_at="multidrop.families.tmcl.host.programs:DEBUGGING",
    repairs=True,
    certifying_at="multidrop.families.tmcl.host.operations:CERTIFYING",
    motions_at="multidrop.families.tmcl.host.motions:MOTIONS",
    values_at="multidrop.families.tmcl.host.values:VALUES",
    units_at="multidrop.families.tmcl.host.units:UNITS",
    stop_bytes=STOP_BYTES,
    message_moves=codec.moves,
    in_frames=codec.replies_in,
    scan_at="multidrop.families.tmcl.host.scan:SCAN",
)
