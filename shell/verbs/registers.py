"""Verbs for drives whose family has registers: raw reads and writes, and the drive's identification."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Inexpressible, Procedure
from multidrop.dialects.families import FAMILIES, TABLE
from multidrop.dialects.family import Registers
from multidrop.drives.drive import Drive
from multidrop.shell.verbs.registry import Call, as_typed, verb

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


def _has_registers(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.registers is not None


def _registered(call: Call) -> tuple[Drive, Registers[Any]]:
    """The selected drive and its registers. Raises Inexpressible if its family has none."""
    drive = call.drive("")
    if (registers := drive.family.registers) is None:
        where = call.workspace.display_name(drive)
        raise Inexpressible(
            f"{where}: no registers; {call.verb.name} is valid on a bus opened with {_with_registers()}"
        )
    return drive, registers


def _with_registers() -> str:
    """How to open the families that have registers."""
    found = {name: TABLE[name].scheme for name, family in FAMILIES.items() if family.registers is not None}
    return " or ".join(f"{scheme}://HOST" if scheme else f"dialect={name}" for name, scheme in found.items())


async def _show(call: Call, drive: Drive, talk: Procedure[tuple[str, ...]], *, writes: bool = False) -> None:
    if writes:
        call.commands.starting(drive)
    for line in await drive.run(talk):
        call.workspace.output(line)


def _number(call: Call, text: str) -> int:
    """Parse a decimal or hexadecimal number."""
    if not re.fullmatch(r"[+-]?(0[xX][0-9A-Fa-f]{1,16}|\d{1,20})", text, re.ASCII):
        raise call.wrong(f"no number {text}; valid: as 87 or 0x57")
    return int(text, 16 if "x" in text.lower() else 10)


@verb("/register ADDRESS [COUNT|=VALUE]", recorded=as_typed, fits=_has_registers)
async def register(call: Call) -> None:
    """Read or write raw registers of the selected drive: /register 0x57, /register 0x57 =-500.

    Numbers are decimal or hexadecimal. Without COUNT it reads the whole value that begins at ADDRESS. A VALUE fills all
    registers of its value, low word first; =LOW,HIGH writes two words. It transfers at most two registers.
    """
    drive, registers = _registered(call)
    found = re.fullmatch(r"(\S+?)(?:\s*=\s*(.+)|\s+(\S+))?", call.rest.strip())
    if found is None:
        raise call.wrong()
    address = _number(call, found[1])
    if not 0 <= address <= 0xFFFF:
        raise call.wrong(f"no register {found[1]}; valid: 0 to 0xFFFF")
    if found[2] is None:
        count = _number(call, found[3]) if found[3] else None
        await _show(call, drive, registers.read(drive.state, address, count))
        return
    values = [_number(call, text.strip()) for text in found[2].split(",")]
    for line in registers.lines(address, values):
        await call.commands.guard(drive, line, call.by)
    await _show(call, drive, registers.write(drive.state, address, values), writes=True)


@verb("/coil N [0|1]", recorded=as_typed, fits=_has_registers)
async def coil(call: Call) -> None:
    """Read or switch output N of the selected drive; N is the number in O1, O2, O3."""
    drive, registers = _registered(call)
    words = call.words(1, 2)
    number = _number(call, words[0])
    if not 1 <= number <= 0x10000:
        raise call.wrong(f"no output {words[0]}; valid: from 1")
    if len(words) == 1:
        await _show(call, drive, registers.read_coil(drive.state, number))
    elif words[1] in ("0", "1"):
        await _show(call, drive, registers.write_coil(drive.state, number, words[1] == "1"), writes=True)
    else:
        raise call.wrong()


@verb("/device", fits=_has_registers)
async def device(call: Call) -> None:
    """Show vendor, part number, revision, serial number and version of the selected drive."""
    drive, registers = _registered(call)
    call.words(0, 0)
    await _show(call, drive, registers.device(drive.state))
