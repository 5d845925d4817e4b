"""Garbage on the wire, and programs that print all the time, through a whole session, in virtual time."""

from __future__ import annotations

import asyncio
import random

import pytest

from multidrop.base.errors import DriveError, NoAnswer, Refused
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Printed
from multidrop.shell.session import Session

pytestmark = pytest.mark.virtual

CHATTER = 'PG 1\nLB SU\nPR "Logic 000"\nH 200\nBR SU\nE\nPG\n'


def drive(name: str, em: int, ck: int, more: str = "") -> str:
    return (
        f'[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = {em}, CK = {ck} }}\n{more}'
    )


class Desk:
    """A session on a simulated line; what it printed as answers, and the drives behind the line."""

    def __init__(self, folder) -> None:
        self.folder = folder
        self.session = Session(Settings({}, folder / "conf", folder / "state", data=folder / "data"))
        self.answers: list[str] = []
        self.session.subscribe(self._heard)

    def _heard(self, event) -> None:
        if isinstance(event, Printed):
            self.answers.append(event.text)

    async def open(self, cell: str, names: str) -> None:
        """On a bad line it may take more than one try."""
        (self.folder / "cell.toml").write_text(cell)
        for _ in range(50):
            try:
                await self.session.open(f"sim:{self.folder / 'cell.toml'}?timeout=0.3&drives={names}")
            except DriveError:
                continue
            break
        [(_, floor)] = self.session.cells.items()
        self.devices = {placed.spec.name: placed.device for placed in floor.floor.drives}

    async def run(self, line: str) -> list[str] | None:
        """What it printed; None where it failed, as a person is told."""
        self.answers.clear()
        try:
            async with asyncio.timeout(60):
                await self.session.run(line)
        except DriveError:
            return None
        return list(self.answers)


@pytest.fixture
def desk(tmp_path):
    return lambda: Desk(tmp_path)


# Two flips of one bit, there and back, leave the sum as it was: at 1e-2 one line in 2,000 has them, at 4e-3 in 10,000.
@pytest.mark.wide
@pytest.mark.parametrize("faults", ["flip = 4e-3", "drop = 1e-2", "flip = 4e-3\ndrop = 5e-3"])
@pytest.mark.parametrize("em", [0, 1, 3])
@pytest.mark.parametrize("ck", [1, 2])
async def test_on_a_bad_line_a_checksum_keeps_every_number_right_and_every_success_true(desk, em, ck, faults, nightly):
    bad = desk()
    await bad.open(
        f'seed = 3\n[[bus]]\nname = "w"\n[bus.faults]\n{faults}\n' + drive("a", em, ck) + drive("b", em, ck), "a,b"
    )
    chance, numbers, taken = random.Random(5), 0, 0
    lines = 200 if nightly else 50
    for _ in range(lines):
        name, number = chance.choice("ab"), chance.randint(-(2**31), 2**31 - 1)
        held = bad.devices[name].memory.values
        if (printed := await bad.run(f"@{name} R1={number}")) is not None:
            assert (printed, held["R1"]) == ([], number)
            taken += 1
        if (printed := await bad.run(f"@{name} PR R1")) is not None:
            assert printed == [str(held["R1"])]
            numbers += 1
    assert min(taken, numbers) > 0.3 * lines
    await bad.session.close()
    assert asyncio.all_tasks() == {asyncio.current_task()}


@pytest.mark.wide
@pytest.mark.parametrize("em", [0, 1, 2, 3])
@pytest.mark.parametrize("ck", [0, 1, 2])
async def test_garbage_is_a_failure_that_is_told_and_nothing_else(desk, em, ck, nightly):
    bad = desk()
    faults = "[bus.faults]\nflip = 8e-3\ndrop = 4e-3\n"
    await bad.open(f'[[bus]]\nname = "w"\n{faults}' + drive("a", em, ck) + drive("b", em, ck), "a,b")
    for _ in range(60 if nightly else 12):
        for line in ("@a PR P", "@b VM=500000", "@a PR AL", "@b PR ZZ", "@b PR IS"):
            await bad.run(line)  # raises nothing but what a person is told
    await bad.session.close()


@pytest.mark.wide
@pytest.mark.parametrize(("em", "ck"), [(em, ck) for em in (0, 1, 2, 3) for ck in (0, 1, 2)])
@pytest.mark.parametrize("baud", [0, 9600])
async def test_a_drive_whose_program_prints_all_the_time_is_opened_and_obeys(desk, em, ck, baud):
    busy = desk()
    (busy.folder / "chatter.mxt").write_text(CHATTER)
    program = drive("a", em, ck, 'program = "chatter.mxt"\n')
    await busy.open(f'[[bus]]\nname = "w"\nbaud = {baud}\n{program}', "a")
    device, session = busy.devices["a"], busy.session
    assert device.running
    for line, printed in (("PR P", ["0"]), ("VM=500000", []), ("PR VM", ["500000"]), ("MR 5000", [])):
        assert await busy.run(line) == printed, line
    assert await busy.run("/wait stopped") == []
    with pytest.raises((Refused, NoAnswer)):
        await session.run("VM=5")
    assert await busy.run("PR P") == ["5000"]
    session.stop()
    await session.buses["w"].stopped()
    assert not device.running
    await session.close()
