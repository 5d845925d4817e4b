"""Raw registers and outputs of a drive, read and written for a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from multidrop.base.errors import Inexpressible
from multidrop.dialects import Procedure
from multidrop.dialects.families import FAMILIES, dialects
from multidrop.dialects.family import Registers
from multidrop.drives.drive import Drive
from multidrop.shell import motions, travel
from multidrop.shell.operations.arguments import Accessed

if TYPE_CHECKING:
    from multidrop.shell.session import Call


def _registered(call: Call) -> tuple[Drive, Registers]:
    """The selected drive and its registers. Raises Inexpressible if its family has none."""
    drive = call.drive()
    if (registers := drive.family.registers) is None:
        having = {name: dialects()[name].scheme for name, family in FAMILIES.items() if family.offers("registers")}
        opened = " or ".join(f"{scheme}://HOST" if scheme else f"dialect={name}" for name, scheme in having.items())
        where = call.session.display_name(drive)
        raise Inexpressible(f"{where}: no registers; {call.verb.name} is valid on a bus opened with {opened}")
    return drive, registers


async def _show(call: Call, drive: Drive, talk: Procedure[tuple[str, ...]]) -> None:
    for line in await drive.run(talk, typed=True):
        call.output(line)


async def _write(
    call: Call, drive: Drive, talk: Procedure[tuple[str, ...]], writes: str, lines: Sequence[str] = ()
) -> None:
    """Run a conversation that writes. `writes`: the line that does the same as far as it starts something; empty: it
    may do anything. `lines` do the same, as far as words have its registers.
    """
    session = call.session
    await session.path.agreed_to_write(drive, f"{call.verb.name} {call.rest.strip()}", call.by)
    async with session.path.starting(call.origin, drive, writes):
        printed = await motions.perform(session, call.origin, drive, lines, talk)
    for line in printed:
        call.output(line)


async def register(call: Call, wanted: Accessed) -> None:
    """Read or write registers of the selected drive."""
    drive, registers = _registered(call)
    address, values = wanted.address, wanted.values
    if values is None:
        await _show(call, drive, registers.read(address, wanted.length))
        return
    lines = registers.lines(address, values)
    for line in lines:
        if call.session.scaled:
            await travel.ask(call.session.units, drive, line, call.origin)
        await call.session.path.guard(drive, line, call.by)
    known = len(lines) == len(values) and len([line for line in lines if drive.starts(line)]) < 2
    writes = next(filter(drive.starts, lines), lines[0]) if known else ""
    await _write(call, drive, registers.write(address, values), writes, lines)


async def coil(call: Call, number: int, level: str) -> None:
    """Read an output of the selected drive, or switch it. `level`: 0, 1 or empty."""
    drive, registers = _registered(call)
    if not level:
        await _show(call, drive, registers.read_coil(number))
        return
    line = f"O{number}={level}"
    writes = "" if drive.starts(line) else line
    await _write(call, drive, registers.write_coil(number, level == "1"), writes)


async def device(call: Call) -> None:
    """Show what the selected drive says of itself."""
    drive, registers = _registered(call)
    await _show(call, drive, registers.device())
