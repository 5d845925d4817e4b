"""Snapshots: a machine as a cell file, which the simulator opens as the same machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from shell import snapshots
from shell.connect.settings import Settings
from shell.events import Notified
from shell.session import Session
from simulator import cells
from tests.support.cell_session import CellSession, bus

pytestmark = pytest.mark.virtual

PROGRAM = """program_text = \"\"\"
PG 1
LB Ga
MR 51200
H
PR "at ",P
E
PG
PG 200
LB Gb
Q1=Q1+1
E
PG
\"\"\"
"""


def mcode(personality: str, lines: str = "", name: str = "!", party: bool = False) -> str:
    return f'personality = "{personality}"\nname = "{name}"\nparty = {str(party).lower()}\n{lines}'


LEXIUM = (
    PROGRAM + "variables = { Q1 = -5, Zz = 7 }\n"
    'set = { EM = 1, VM = 100000, VI = 1200, A = 5000, IS = ["1,1,1", "3,0,1"], OS = ["2,17,0"], R1 = 12, F1 = 0.5 }\n'
    '[bus.drive.identity]\npart = "LMX"\nserial = "040154321"\nposition = -77\n'
    "[bus.drive.world]\ninputs = [[0.0, 1, 1], [0.0, 2, 0]]\n"
)
OLDER = (
    PROGRAM + "variables = { Q1 = -5 }\n"
    'set = { EM = 1, VM = 100000, VI = 1200, S1 = "1,0,0", S3 = "16,1,0", R1 = 12 }\n'
    "[bus.drive.identity]\nposition = -77\n"
    "[bus.drive.world]\ninputs = [[0.0, 1, 0], [0.0, 2, 0]]\nanalog = [[0.0, 512]]\n"
)
MACHINES = {
    "LMDOM": [bus("a", mcode("LMDOM", LEXIUM))],
    "LMDCM": [bus("a", mcode("LMDCM", LEXIUM))],
    "LMDOE": [bus("a", mcode("LMDOE", LEXIUM), baud=0)],
    "LMDCE": [bus("a", mcode("LMDCE", LEXIUM), baud=0)],
    "LMM": [bus("a", mcode("LMM", LEXIUM))],
    "MDI": [bus("a", mcode("MDI", OLDER))],
    "MDIE": [bus("a", mcode("MDIE", OLDER.replace("VM = 100000", "EE = 1, VM = 40000")))],
    "MDIX": [bus("a", mcode("MDIX", OLDER))],
    "party": [
        bus(
            "line",
            mcode("LMDCM", LEXIUM.replace("EM = 1", "EM = 2, CK = 2"), "a", party=True),
            mcode("MDI", OLDER.replace("EM = 1", "EM = 0"), "b", party=True),
            mcode("LMM", "set = { EM = 3, CK = 1 }", "c", party=True),
        ),
        bus("eth", mcode("LMDCE"), baud=0),
    ],
}


async def taken(folder: Path, url: str, name: str) -> tuple[str, list[str]]:
    """The snapshot of a URL, and the narration."""
    session = Session(Settings({}, folder / "config", folder / "state"))
    told: list[str] = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    await session.open(url)
    try:
        await snapshots.save(session, str(folder / name))
    finally:
        await session.close()
    return (folder / name).read_text(), told


@pytest.mark.parametrize("machine", MACHINES)
async def test_a_snapshot_opened_and_taken_again_gives_the_same_file(tmp_path, machine):
    async with CellSession(tmp_path, *MACHINES[machine]) as cell:
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    first = (tmp_path / "one.toml").read_text()
    again, _ = await taken(tmp_path, f"sim:{tmp_path / 'one.toml'}", "two.toml")
    assert again == first
    wanted = [(each.name, each.personality) for bus in cells.load(tmp_path / "cell.toml").buses for each in bus.drives]
    assert [(each.name, each.personality) for bus in cells.read(first).buses for each in bus.drives] == wanted


async def prompted(url: str, folder: Path, *lines: str) -> list[str]:
    """What a machine prints, prompt for prompt."""
    session = Session(Settings({}, folder / "config", folder / "state"))
    await session.open(url)
    try:
        return [printed for line in lines for printed in await session.drive().send(line)]
    finally:
        await session.close()


async def test_the_simulator_replies_like_the_machine(tmp_path):
    async with CellSession(tmp_path, *MACHINES["LMDCM"]) as cell:
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    lines = ("PR VR", "PR PN", "PR SN", "PR P", "PR EM", "PR IS", "PR OS", "PR UV", "PR IN", "L", "PR AL")
    machine = await prompted(cell.url, tmp_path, *lines)
    assert machine[:4] == ["LMDCM 6.002, Hw: 3.2", "LMX", "040154321", "-77"]
    assert await prompted(f"sim:{tmp_path / 'one.toml'}", tmp_path, *lines) == machine
