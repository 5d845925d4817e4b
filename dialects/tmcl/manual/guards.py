"""The lines that need a confirmation before they are sent, each with its reason.

A guarded line wears the EEPROM out, forgets what is stored, or changes how the module is reached.
"""

from __future__ import annotations

from collections.abc import Mapping

from dialects.tmcl.manual import grammar
from dialects.tmcl.manual.commands import Call, Command
from dialects.tmcl.manual.parameters import Global

BOOTLOADER = 242
"""The command that starts the bootloader."""
_EEPROM = "it writes to the EEPROM, which wears out"
_COMMANDS: Mapping[int, str] = {
    Command.STAP: _EEPROM,
    Command.STGP: _EEPROM,
    Command.FACTORY: "it restores the factory settings, and gives no reply",
    BOOTLOADER: "it starts the bootloader; the module then obeys no command, a stop included",
}
_PARAMETERS: Mapping[int, str] = {
    Global.BAUD: "it changes the baud rate from the next message on",
    Global.ADDRESS: "it changes the address of the module from the next message on",
}
"""Reasons for setting a global parameter, or restoring it from EEPROM."""


def reason(text: str) -> str:
    """The reason for which a line is guarded; empty for any other line, also for an invalid one."""
    try:
        call = grammar.parse(text)
    except grammar.LineError:
        return ""
    return _reason(call)


def _reason(call: Call) -> str:
    if call.command in (Command.SGP, Command.RSGP):
        return _PARAMETERS.get(call.type, "")
    return _COMMANDS.get(call.command, "")
