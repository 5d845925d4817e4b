"""The TMCL lines that a person must agree to before they are sent.

A guarded line wears the EEPROM out, forgets what is stored, starts programs later, or changes how the module is
reached. A stop is never guarded.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from multidrop.dialects.guards import ADDRESSES, EVERYONE, Guard, to_all
from multidrop.dialects.tmcl.manual import grammar
from multidrop.dialects.tmcl.manual.commands import Call, Command
from multidrop.dialects.tmcl.manual.parameters import Global

BOOTLOADER = 242
"""The command that starts the bootloader."""
_EEPROM = "writes to the EEPROM, which wears out"
NAMES: Mapping[str, str] = MappingProxyType(
    {
        "STAP": _EEPROM,
        "STGP": _EEPROM,
        "FACTORY": "restores the factory settings, and gives no reply",
        "BOOTLOADER": "starts the bootloader; the module then obeys no command, a stop included",
        "DOWNLOAD": "erases the program from that line on; the module then stores every command until 133",
        "AUTOSTART": "has the module start its program at each power-up",
        "BAUD": "changes the baud rate from the next message on",
        "ADDRESS": "changes the address of the module from the next message on",
        EVERYONE: "can start every drive of the line",
    }
)
"""Every guard, and what its lines do."""
_COMMANDS: Mapping[int, str] = MappingProxyType(
    {
        Command.STAP: "STAP",
        Command.STGP: "STGP",
        Command.DOWNLOAD: "DOWNLOAD",
        Command.FACTORY: "FACTORY",
        BOOTLOADER: "BOOTLOADER",
    }
)
_PARAMETERS: Mapping[int, str] = MappingProxyType({Global.BAUD: "BAUD", Global.ADDRESS: "ADDRESS"})
"""Guards on setting a global parameter, or restoring it from EEPROM."""


def find(text: str, address: str) -> Guard | None:
    """Find the guard of a line for a module; None: the line needs no agreement, as an invalid one."""
    line = text.strip()
    try:
        call = grammar.parse(text)
    except grammar.LineError:
        return None
    if name := _name(call):
        return Guard(name, f"'{line}' {NAMES[name]}")
    return to_all(line) if address in ADDRESSES and call.moves and not _is_rest(call) else None


def only_ends(text: str) -> bool:
    """Whether a line is a command of motion that can only end it: a velocity of 0."""
    try:
        return _is_rest(grammar.parse(text))
    except grammar.LineError:
        return False


def _is_rest(call: Call) -> bool:
    return call.command in (Command.ROR, Command.ROL) and call.value == 0


def word_of(text: str) -> str:
    """The word at the head of a line, in capitals; the number of a command without a word."""
    return text.strip().partition(" ")[0].upper()


def _name(call: Call) -> str:
    if call.command == Command.SGP and call.type == Global.AUTOSTART and call.value:
        return "AUTOSTART"
    if call.command in (Command.SGP, Command.RSGP):
        return _PARAMETERS.get(call.type, "")
    return _COMMANDS.get(call.command, "")
