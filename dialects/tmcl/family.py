"""The record of the TMCL family: Trinamic modules in direct mode, on RS-485, USB or through a TCP converter.

It has no URL scheme: its frames contain bytes that other drives obey, so nothing tries it on an unknown line before a
person has agreed. A guarded line wears the EEPROM out, forgets what is stored, starts programs later, or changes how
the module is reached. A stop is never guarded. Values have numbers; a word is the name of a parameter (`parameter`).
"""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects.family import ADDRESSES, EVERYONE, Family, Guard, Guards, to_all
from multidrop.dialects.tmcl.host import codec, operations
from multidrop.dialects.tmcl.host.codec import STOP_BYTES, Tmcl, TmclState
from multidrop.dialects.tmcl.host.operations import identify
from multidrop.dialects.tmcl.manual import commands, help
from multidrop.dialects.tmcl.manual.commands import Command, Global

FIRST = "0"
"""The first motor."""


def move(axis: str, steps: int | str) -> tuple[str, ...]:
    return (f"MVP REL, {axis or FIRST}, {steps}",)


def move_to(axis: str, position: int | str) -> tuple[str, ...]:
    return (f"MVP ABS, {axis or FIRST}, {position}",)


BOOTLOADER = 242
"""The command that starts the bootloader."""
_EEPROM = "writes to the EEPROM, which wears out"
GUARDS: Mapping[str, str] = {
    "STAP": _EEPROM,
    "STGP": _EEPROM,
    "FACTORY": "restores the factory settings, and gives no reply",
    "BOOTLOADER": "starts the bootloader; the module then obeys no command, a stop included",
    "DOWNLOAD": "erases the program from that line on; the module then stores every command until 133",
    "AUTOSTART": "has the module start its program at each power-up",
    "BAUD": "changes the baud rate from the next message on",
    "ADDRESS": "changes the address of the module from the next message on",
    "TEXTMODE": "may have the module reply in text mode, which multidrop does not read",
    "REPLIES": "may have the module send no more replies: nothing can be read, and no stop confirmed",
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its lines do."""
_COMMANDS: Mapping[int, str] = {
    Command.STAP: "STAP",
    Command.STGP: "STGP",
    Command.DOWNLOAD: "DOWNLOAD",
    Command.FACTORY: "FACTORY",
    BOOTLOADER: "BOOTLOADER",
}
_PARAMETERS: Mapping[int, str] = {
    Global.BAUD: "BAUD",
    Global.ADDRESS: "ADDRESS",
    Global.TEXT_MODE: "TEXTMODE",
    Global.AUTOSTART: "AUTOSTART",
    Global.SUPPRESS_REPLY: "REPLIES",
}
"""Guards on setting a global parameter of bank 0, or restoring it from EEPROM."""
_SWITCHES = frozenset({Global.TEXT_MODE, Global.AUTOSTART, Global.SUPPRESS_REPLY})
"""Those that a 0 switches off, which needs no agreement."""


def guarded(text: str, address: str) -> Guard | None:
    """Find the guard of a line for a module; None: the line needs no agreement, as an invalid one."""
    line = text.strip()
    try:
        call = commands.parse(text)
    except commands.LineError:
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
    try:
        call = commands.parse(text)
    except commands.LineError:
        return False
    return call.command in (Command.ROR, Command.ROL) and call.value == 0


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
    programs_at="multidrop.dialects.tmcl.host.programs:PROGRAM_FILES",
    debugging_at="multidrop.dialects.tmcl.host.programs:DEBUGGING",
    repairs=True,
    certifying_at="multidrop.dialects.tmcl.host.operations:CERTIFYING",
    values_at="multidrop.dialects.tmcl.host.values:VALUES",
    units_at="multidrop.dialects.tmcl.host.units:UNITS",
    stop_bytes=STOP_BYTES,
    message_moves=codec.moves,
    in_frames=codec.replies_in,
    scan_at="multidrop.dialects.tmcl.host.scan:SCAN",
)
