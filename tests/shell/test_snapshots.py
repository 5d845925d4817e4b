"""Snapshots: a machine as a cell file, which the simulator opens as the same machine."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Stopped, TransportLost
from multidrop.shell import snapshots
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified
from multidrop.shell.programs import transfers
from multidrop.shell.session import Session
from multidrop.simulator import cells
from tests.support.cell_session import CellSession, bus, pmx

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


def tmcl(name: str, lines: str) -> str:
    return f'personality = "TMCM"\nname = "{name}"\n{lines}'


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
STAGES = """
variables = { V3 = 7, V40 = -9 }
set = { HSPD = 5000, LSPD = 200, SLRX = 2.5, POLX = 1056, SLOAD = 0 }
program_text = \"\"\"
PRG 0
V1=5
X1000
WAITX
END
\"\"\"
[bus.drive.identity]
part = "Performax-2ED-SA"
version = "V131"
position = [100, -200]
encoder = [5, 6]
[bus.drive.world.x]
inputs = [[0.0, 1, 0], [0.0, 2, 1]]
analog = [[0.0, 1500]]
"""
RAW = 'program_text = "SA0=PS0\\nSA1=&7$1\\nSA4=XX"\n'
MACHINES = {
    "LMDOM": [bus("a", mcode("LMDOM", LEXIUM), baud=0)],
    "LMDCM": [bus("a", mcode("LMDCM", LEXIUM))],
    "LMDOE": [bus("a", mcode("LMDOE", LEXIUM), baud=0)],
    "LMDCE": [bus("a", mcode("LMDCE", LEXIUM), baud=0)],
    "LMM": [bus("a", mcode("LMM", LEXIUM), baud=0)],
    "MDI": [bus("a", mcode("MDI", OLDER), baud=0)],
    "MDIE": [bus("a", mcode("MDIE", OLDER.replace("VM = 100000", "EE = 1, VM = 40000")), baud=0)],
    "MDIX": [bus("a", mcode("MDIX", OLDER), baud=0)],
    "PMX": [bus("stages", pmx("00") + STAGES, pmx("07") + "\n" + RAW)],
    "PMX on USB": [bus("first", pmx("00") + STAGES), bus("second", pmx("07") + "\n" + RAW)],
    "TMCM": [
        bus("t", tmcl("1", "set = { 4 = 40000, G75 = 5 }"), tmcl("7", "[bus.drive.identity]\nposition = -512"), baud=0)
    ],
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
    session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))
    told: list[str] = []
    session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified) else None)
    await session.open(url)
    try:
        await snapshots.save(session, str(folder / name))
    finally:
        await session.close()
    return (folder / name).read_text(), told


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES)
async def test_a_snapshot_opened_and_taken_again_gives_the_same_file(tmp_path, machine):
    async with CellSession(tmp_path, *MACHINES[machine], usb="USB" in machine) as cell:
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    first = (tmp_path / "one.toml").read_text()
    again, _ = await taken(tmp_path, f"sim:{tmp_path / 'one.toml'}", "two.toml")
    assert again == first
    wanted = [(each.name, each.personality) for bus in cells.load(tmp_path / "cell.toml").buses for each in bus.drives]
    assert [(each.name, each.personality) for bus in cells.read(first).buses for each in bus.drives] == wanted


async def prompted(url: str, folder: Path, *lines: str) -> list[str]:
    """What a machine prints, prompt for prompt."""
    session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))
    await session.open(url)
    try:
        return [printed for line in lines for printed in await session.drive().send(line)]
    finally:
        await session.close()


@pytest.mark.slow
async def test_the_simulator_replies_like_the_machine(tmp_path):
    async with CellSession(tmp_path, *MACHINES["LMDCM"]) as cell:
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    lines = ("PR VR", "PR PN", "PR SN", "PR P", "PR EM", "PR IS", "PR OS", "PR UV", "PR IN", "L", "PR AL")
    machine = await prompted(cell.url, tmp_path, *lines)
    assert machine[:4] == ["LMDCM 6.002, Hw: 3.2", "LMX", "040154321", "-77"]
    assert await prompted(f"sim:{tmp_path / 'one.toml'}", tmp_path, *lines) == machine


async def test_the_remarks_of_a_downloaded_file_are_kept(tmp_path):
    text = "' shuttle\nPG 1\nLB Ga   ' there\n\n  ' a step\n  MR 51200\n  H\nE\nPG\n"
    async with CellSession(tmp_path, bus("a", 'personality = "LMDCM"', baud=0)) as cell:
        await transfers.download(cell.session, cell.session.origin, cell.session.drive(), "shuttle.mxt", text=text)
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    first = (tmp_path / "one.toml").read_text()
    assert "PG 1\nLB Ga   ' there\n\n  ' a step\n  MR 51200\n  H\nE\nPG\n" in first
    assert (await taken(tmp_path, f"sim:{tmp_path / 'one.toml'}", "two.toml"))[0] == first


@pytest.mark.slow
async def test_a_locked_program_and_a_drive_that_moves_say_so(tmp_path):
    locked = 'personality = "LMDCM"\nname = "a"\nparty = true\nset = { EM = 1, LK = 1 }\nvariables = { Q1 = 1 }\n'
    locked += PROGRAM
    running = (
        'personality = "LMDCM"\nname = "b"\nparty = true\nset = { EM = 1 }\nprogram_text = "PG 1\\nLB G1\\nBR G1\\nPG"'
    )
    async with CellSession(tmp_path, bus("line", locked, running)) as cell:
        for line in ("@b EX G1", "@b SL 1000"):
            await cell.session.run(line)
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
        text = (tmp_path / "one.toml").read_text()
        assert "# not read: its program is locked (LK=1); LK=0 opens" in text
        assert "# moving at V=1000 while it was read" in text
        assert "# a program ran while it was read" in text
        assert any(told.startswith("line:a: not read: its program is locked (LK=1); LK=0") for told in cell.warned())
        assert cell.moving() == {"line:b"}


async def test_reading_sets_nothing_and_clears_no_error(tmp_path):
    async with CellSession(tmp_path, *MACHINES["LMDCM"]) as cell:
        device = cell.device("a:!")
        device.execute("VM=1", device.now)
        before = cell.session.drive().commands
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
        assert cell.session.drive().commands == before
        assert device.execute("PR EF,ER", device.now).lines == ("121",)


async def test_a_drive_that_does_not_reply_is_named_in_the_file_and_the_others_are_in_it(tmp_path):
    drives = [f'personality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = 1 }}' for name in "ab"]
    async with CellSession(tmp_path, bus("line", *drives)) as cell:
        cell.world("/sim power a off")
        with pytest.raises(DriveError, match="a does not reply"):
            await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    (line,) = cells.load(tmp_path / "one.toml").buses
    assert [drive.name for drive in line.drives] == ["b"]
    assert "# not in this file: a does not reply" in (tmp_path / "one.toml").read_text()


async def test_an_existing_file_and_a_full_disk_leave_no_part_of_a_file(tmp_path, monkeypatch):
    async with CellSession(tmp_path, bus("a", 'personality = "LMDCM"', baud=0)) as cell:
        with pytest.raises(Diagnostic, match="cell.toml: exists already; name a new file"):
            await snapshots.save(cell.session, str(tmp_path / "cell.toml"))
        with pytest.raises(Diagnostic, match="its folder does not exist; make the folder first"):
            await snapshots.save(cell.session, str(tmp_path / "none" / "one.toml"))

        def full(descriptor: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        with pytest.raises(Diagnostic, match="one.toml: cannot be written: No space left on device"):
            await snapshots.save(cell.session, str(tmp_path / "one.toml"))
        assert sorted(each.name for each in tmp_path.iterdir() if "toml" in each.name) == ["cell.toml"]


async def test_a_cable_that_is_pulled_leaves_no_file(tmp_path):
    async with CellSession(tmp_path, *MACHINES["LMDCM"]) as cell:
        loop = asyncio.get_running_loop()
        loop.call_later(0.5, cell.world, "/sim unplug a")
        with pytest.raises(TransportLost):
            await snapshots.save(cell.session, str(tmp_path / "one.toml"))
        assert not (tmp_path / "one.toml").exists()


async def test_a_stop_ends_it_and_leaves_no_file(tmp_path):
    async with CellSession(tmp_path, *MACHINES["LMDCM"]) as cell:
        asyncio.get_running_loop().call_later(0.5, cell.session.stop)
        with pytest.raises(Stopped):
            await cell.session.run(f"/snapshot {tmp_path / 'one.toml'}")
        assert not (tmp_path / "one.toml").exists()
