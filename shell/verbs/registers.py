"""Verbs for drives that have registers and outputs of their own: raw reads and writes, and what the drive is."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from dialects import Inexpressible, Procedure
from dialects.family import Registers
from drives.drive import Drive
from shell.verbs.registry import Call, as_typed, verb

if TYPE_CHECKING:
    from shell.workspace import Workspace


def _has_registers(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.registers is not None


def _registered(call: Call) -> tuple[Drive, Registers[Any]]:
    """The selected drive and what its language offers. Raises Inexpressible where that is nothing of the kind."""
    drive = call.drive("")
    if (registers := drive.family.registers) is None:
        where = call.workspace.display_name(drive)
        raise Inexpressible(f"{where}: {call.verb.name} is for drives that are open over Modbus (modbus://HOST)")
    return drive, registers


async def _show(call: Call, drive: Drive, talk: Procedure[tuple[str, ...]], *, writes: bool = False) -> None:
    if writes:
        call.commands.starting(drive)
    for line in await drive.run(talk):
        call.workspace.output(line)


def _number(call: Call, text: str) -> int:
    """A number as typed, decimal or hexadecimal."""
    if not re.fullmatch(r"[+-]?(0[xX][0-9A-Fa-f]{1,16}|\d{1,20})", text, re.ASCII):
        raise call.wrong(f"{text} is no number, as in 87 or 0x57")
    return int(text, 16 if "x" in text.lower() else 10)


@verb("/register ADDRESS [COUNT|=VALUE]", recorded=as_typed, fits=_has_registers)
async def register(call: Call) -> None:
    """Read or write raw registers of the selected drive: /register 0x57, /register 0x57 =-500.

    Numbers are decimal or hexadecimal. Without COUNT the whole value that begins there is read. A VALUE fills as many
    registers as it has there, its low word first; =LOW,HIGH writes two words. At most two registers at a time.
    """
    drive, registers = _registered(call)
    found = re.fullmatch(r"(\S+?)(?:\s*=\s*(.+)|\s+(\S+))?", call.rest.strip())
    if found is None:
        raise call.wrong()
    address = _number(call, found[1])
    if not 0 <= address <= 0xFFFF:
        raise call.wrong(f"{found[1]} is no register: they are 0 to 0xFFFF")
    if found[2] is None:
        count = _number(call, found[3]) if found[3] else None
        await _show(call, drive, registers.read(drive.state, address, count))
        return
    values = [_number(call, text.strip()) for text in found[2].split(",")]
    await _show(call, drive, registers.write(drive.state, address, values), writes=True)


@verb("/coil N [0|1]", recorded=as_typed, fits=_has_registers)
async def coil(call: Call) -> None:
    """Read or switch output N of the selected drive; N is that of O1, O2, O3."""
    drive, registers = _registered(call)
    words = call.words(1, 2)
    number = _number(call, words[0])
    if not 1 <= number <= 0x10000:
        raise call.wrong(f"{words[0]} is no output: they are numbered from 1")
    if len(words) == 1:
        await _show(call, drive, registers.read_coil(drive.state, number))
    elif words[1] in ("0", "1"):
        await _show(call, drive, registers.write_coil(drive.state, number, words[1] == "1"), writes=True)
    else:
        raise call.wrong()


@verb("/device", fits=_has_registers)
async def device(call: Call) -> None:
    """Show what the selected drive says of itself: vendor, part number, revision, serial number, version."""
    drive, registers = _registered(call)
    call.words(0, 0)
    await _show(call, drive, registers.device(drive.state))
