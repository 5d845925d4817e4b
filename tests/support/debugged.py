"""A session on a simulated MCode drive whose program is debugged: what lines put out, which keys were written."""

from __future__ import annotations

from pathlib import Path

from multidrop.shell.events import Notified, OnBus
from tests.support.cell_session import CellSession, bus

PROGRAM = '''program_text = """
PG 1
LB G1
 VA Q1=0
LB K1
 MR 51200
 H
 IC Q1
 BR K1,Q1<3
 PR Q1
 E
LB K2
 SL 20000
 H 5000
 SL 0
 E
LB K3
 IC R1
 BR K3
PG
"""
'''
LINES = {6: "VA Q1=0", 19: "MR 51200", 26: "H", 28: "IC Q1", 33: "BR K1,Q1<3", 45: "PR Q1", 50: "E"}
ROUND = [19, 26, 28, 33]


def shown(*addresses: int) -> list[str]:
    return [f"{at}  {LINES[at]}" for at in addresses]


def ethernet(**settings: int) -> str:
    values = ", ".join(f"{key} = {value}" for key, value in settings.items())
    return f'personality = "LMDCE"\nset = {{ {values} }}\n{PROGRAM}'


def serial(name: str, *, party: bool = True, product: str = "LMDCM", **settings: int) -> str:
    values = ", ".join(f"{key} = {value}" for key, value in settings.items())
    head = f'personality = "{product}"\nname = "{name}"\nparty = {str(party).lower()}\n'
    return f"{head}set = {{ {values} }}\n{PROGRAM}"


def cell(folder: Path, *drives: str, baud: int = 0) -> CellSession:
    """A session on one line, unpaced unless told."""
    return CellSession(folder, bus("line", *drives, baud=baud))


async def run(cell: CellSession, *lines: str) -> list[str]:
    """What lines put out, unsolicited lines among it."""
    cell.events.clear()
    for line in lines:
        await cell.session.run(line)
    return out(cell)


def out(cell: CellSession) -> list[str]:
    found: list[str] = []
    for event in cell.events:
        if isinstance(event, OnBus) and hasattr(event.event, "lines"):
            found += event.event.lines
        elif not isinstance(event, (OnBus, Notified)) and hasattr(event, "text"):
            found.append(event.text)
    return found


def keys(cell: CellSession, key: bytes = b" ") -> int:
    """How often a key was written as such."""
    return sum(
        event.event.data == key
        for event in cell.events
        if isinstance(event, OnBus) and getattr(event.event, "outgoing", False)
    )
