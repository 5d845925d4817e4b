"""Conditions of drives in a session: what is read, with which bytes, when not, and what is made of it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Traffic, Unsolicited
from multidrop.families.lexium.host.motions import cause
from multidrop.families.lexium.manual.points import CAUSE
from multidrop.shell.events import OnBus
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual
STATE = b'PR EF,BY,MV,VC,MP,DE,ST,":",P,":",IN,":",I5,'


def read(cell: CellSession) -> list[tuple[Conditions, ...]]:
    """The conditions that were published."""
    return [e.event.conditions for e in cell.events if isinstance(e, OnBus) and isinstance(e.event, Conditioned)]


async def last(cell: CellSession, *lines: str, wait: float = 4.2) -> tuple[Conditions, ...]:
    """The conditions a while after these lines."""
    for line in lines:
        await cell.session.run(line)
    await asyncio.sleep(wait)
    return read(cell)[-1]


def lamps(conditions: Conditions, *, output: bool = False) -> dict[str, Any]:
    return {f"{lamp.name} {lamp.function}".strip(): lamp.on for lamp in conditions.lamps if lamp.output is output}


class Watched(CellSession):
    """A cell with one bus and one drive, whose conditions are watched."""

    def __init__(self, folder: Path, drive: str, address: str = "", endpoint: str = "") -> None:
        super().__init__(folder, bus("line", drive))
        self.url += endpoint
        self.address = address

    async def __aenter__(self) -> Watched:
        await super().__aenter__()
        self.watch = self.session.buses["line"].telemetry.watch([self.address], 1.0)
        return self


async def test_conditions_that_nobody_wants_any_more_as_their_reading_begins_are_not_read(tmp_path):
    async with Watched(tmp_path, party("a"), "a") as cell:
        await asyncio.sleep(2)

        def begun(event: Any) -> None:
            if isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing:
                cell.watch.close()

        cell.session.subscribe(begun)
        before = len(read(cell))
        await asyncio.sleep(5)
        assert len(read(cell)) <= before + 1
        assert cell.told() == []


async def test_a_serial_drive_is_one_print_a_second_and_its_settings_once(tmp_path):
    async with Watched(tmp_path, party("a"), "a") as cell:
        await asyncio.sleep(10)
        sent = cell.written("line")
        assert 8 <= sent.count(b"a" + STATE) <= 11
        assert [sent.count(word) for word in (b"PR EE,AS,", b"PR IS", b"PR OS", b"PR LS")] == [1, 1, 1, 1]
        assert not any(word in sent for word in (b"ER", b"PR O1", b"PR ST"))
        assert cell.told() == []


async def test_lamps_limits_currents_and_profile_are_those_of_the_drive(tmp_path):
    async with Watched(tmp_path, party("a") + "\nworld = { home = 0 }", "a") as cell:
        lines = ["@a IS=1,1,0", "@a OS=2,17,1", "@a OS=3,18,1", "@a LS=0,-100000,1", "@a LS=1,600000,1", "@a RC=60"]
        (found,) = await last(cell, *lines)
        assert lamps(found) == {"1 home": True, "2": False, "3": False, "4": False, "ai 0": None}
        assert lamps(found, output=True) == {"1": None, "2 moving": False, "3 error": False}
        assert (found.limits, found.run_current, found.hold_current) == ((-100000, 600000), 60, 5)
        assert found.pace is not None and found.pace.maximum == 768000


async def test_a_target_is_known_while_a_move_goes_there_and_not_after(tmp_path):
    async with Watched(tmp_path, party("a", VM=20000), "a") as cell:
        (moving,) = await last(cell, "@a MA 100000", wait=2.5)
        assert moving.target == 100000
        (resting,) = await last(cell, wait=8)
        assert resting.target is None
        (relative,) = await last(cell, "@a MR -50000", wait=1.5)
        assert relative.target == 50000
        (turned,) = await last(cell, "@a SL 1000", wait=1.5)
        assert turned.target is None


async def test_a_stop_leaves_no_target(tmp_path):
    async with Watched(tmp_path, party("a", VM=20000), "a") as cell:
        assert (await last(cell, "@a MA 100000", wait=2.5))[0].target == 100000
        cell.session.stop()
        assert (await last(cell))[0].target is None


async def test_an_error_is_shown_and_not_cleared(tmp_path):
    async with Watched(tmp_path, party("a"), "a") as cell:
        cell.device("line:a").errors.set(84)
        (found,) = await last(cell)
        assert (found.error, "PR ER" in found.error_text) == (UNREAD, True)
        assert cell.device("line:a").errors.code == 84


PROGRAM = 'program_text = """PG 1\nLB G1\nPR \\"tick\\"\nH 40\nBR G1\nE\nPG\n"""'


async def test_the_prints_of_a_program_are_not_lost_in_a_list(tmp_path):
    async with Watched(tmp_path, f"{party('a')}\n{PROGRAM}", "a") as cell:
        await last(cell)
        cell.events.clear()
        await cell.session.run("@a EX G1")
        (found,) = await last(cell, wait=20)
        assert found.program == "running"
        seen = sum(len(e.event.lines) for e in cell.events if isinstance(e, OnBus) and isinstance(e.event, Unsolicited))
        assert seen > 400
        assert cell.written("line").count(b"PR IS") <= 1


async def test_nothing_is_read_with_em_3_in_program_mode_or_after_the_watch(tmp_path):
    async with Watched(tmp_path, party("a"), "a") as cell:
        await last(cell)
        await cell.session.run("@a PG 100")
        cell.events.clear()
        await asyncio.sleep(5)
        assert cell.written("line") == b""
        await cell.session.run("@a PG")
        await cell.session.run("@a EM=3")
        cell.events.clear()
        await asyncio.sleep(5)
        assert cell.written("line") == b""
        await cell.session.run("@a EM=1")
        assert (await last(cell))[0].run_current == 25
        cell.watch.close()
        await asyncio.sleep(1)
        cell.events.clear()
        await asyncio.sleep(5)
        assert cell.written("line") == b""


async def test_a_refused_part_is_never_asked_again(tmp_path, monkeypatch):
    async with Watched(tmp_path, 'personality = "LMDOM"\nset = { EM = 0 }') as cell:
        cell.session.buses["line"].drives[""].state.identified("LMDCM", "LMDCM 6.002")  # so it asks what this one lacks
        await asyncio.sleep(8)
        assert cell.written("line").count(b",AF,") == 1
        assert cell.written("line").count(b"PR EE,AS,") == 1


async def test_an_mdrive_plus_has_points_that_are_inputs_or_outputs(tmp_path):
    async with Watched(tmp_path, 'personality = "MDIX"') as cell:
        (found,) = await last(cell, "S2=17,1,0", "S1=1,0,0")
        assert lamps(found) == {"1 home": False, "3": False, "4": False, "ai 0": None}
        assert lamps(found, output=True) == {"2 moving": False}


@pytest.mark.parametrize(
    ("drive", "line", "why"),
    [
        (party("a"), "@a DE=0", "DE=0"),
        (party("a"), "@a HC=0", "HC=0"),
        (ETHERNET, "DE=0", "DE=0"),
        (pmx("00"), "@00 EO=2", "EO1=0"),
        ('personality = "TMCM"', "@1 SAP 7, 0, 0", "parameter 7 is 0"),
        ('personality = "TMCM"', "@1 SAP 204, 0, 500", "freewheels: parameter 204"),
    ],
)
async def test_an_axis_without_current_says_why(tmp_path, drive, line, why):
    address = line[1:].split()[0] if line.startswith("@") else ""
    async with Watched(tmp_path, drive, address) as cell:
        assert (await last(cell))[0].no_current == ""
        assert (await last(cell, line))[0].no_current == why


async def test_both_axes_of_a_controller_with_its_loop(tmp_path):
    async with Watched(tmp_path, pmx("00"), "00") as cell:
        x, y = await last(cell, "@00 SLX=1", "@00 DO2=1", "@00 X50000")
        assert dict(x.more) == {
            "status": "at constant speed",
            "StepNLoop": "moving",
            "delta": dict(x.more)["delta"],
        }
        assert (dict(y.more), x.unit, y.unit) == ({"status": "at rest"}, "counts", "pulses")
        assert lamps(x, output=True)["2"] is True
        before, _, polled = cell.written("line").decode().partition("X50000")
        assert "SPC" not in polled and "SLSY" not in polled  # the signs before the move were read of both axes


async def test_a_module_has_its_target_its_switches_and_currents(tmp_path):
    async with Watched(tmp_path, 'personality = "TMCM"', "1") as cell:
        (found,) = await last(cell, "@1 MVP ABS, 0, 900000")
        assert (found.target, found.run_current, found.hold_current, found.unit) == (900000, 50, 3, "microsteps")
        assert lamps(found) == {"home": False, "lim+": False, "lim-": False}


async def test_an_ethernet_drive_has_its_outputs_too(tmp_path):
    async with Watched(tmp_path, ETHERNET) as cell:
        (found,) = await last(cell)
        assert lamps(found, output=True) == {"1": None, "2": None, "3": None}


def test_every_family_has_a_reader():
    assert all(family.offers("values") for family in FAMILIES.values())


async def test_conditions_come_beside_polls_as_fast_as_the_wire_allows(tmp_path):
    async with Watched(tmp_path, pmx("00"), "00") as cell:
        cell.session.buses["line"].telemetry.subscribe(["00"], 0.0)
        await asyncio.sleep(4)
        assert len(read(cell)) >= 3


async def test_a_drive_that_is_selected_is_read_at_once(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        telemetry = cell.session.buses["line"].telemetry
        slow = telemetry.watch(["a"], 10.0)
        await asyncio.sleep(2)
        cell.events.clear()
        telemetry.watch(["a"], 1.0)
        slow.close()
        await asyncio.sleep(1.5)
        assert len(read(cell)) == 2


@pytest.mark.parametrize(
    ("personality", "unit", "paced"), [("TMCM-1241", "microsteps/s", True), ("TMCM-3110", "of 2047", False)]
)
async def test_a_module_that_counts_in_units_of_its_chip_says_so(tmp_path, personality, unit, paced):
    async with Watched(tmp_path, f'personality = "{personality}"', "1") as cell:
        first = (await last(cell))[0]
        assert (first.unit, first.speed_unit, first.pace is not None) == ("microsteps", unit, paced)


STALL = "\n[bus.drive.world]\nstall_at = 20000"
LIMIT = "\n[bus.drive.world]\nlimit_plus = 20000"


async def test_a_motion_that_nobody_waits_for_and_that_stalls_is_called_stalled(tmp_path):
    async with Watched(tmp_path, party("a", EE=1) + STALL, "a") as cell:
        (before,) = await last(cell)
        assert (before.error, before.cause) == (0, "")
        (found,) = await last(cell, "@a MA 4000", wait=5)
        assert (found.error, found.cause) == (UNREAD, "stalled")
        assert found.error_text == "stalled; PR ER shows and clears it"
        (after,) = await last(cell, "@a PR ER")
        assert (after.error, after.cause) == (0, "")


async def test_an_error_after_an_old_stall_is_not_called_stalled(tmp_path):
    async with Watched(tmp_path, party("a", EE=1) + STALL, "a") as cell:
        await last(cell, "@a MA 4000", "@a PR ER", wait=5)  # ST stays set
        (found,) = await last(cell, "@a PR ER")
        assert not found.error
        cell.device("line:a").errors.set(84)
        (found,) = await last(cell)
        assert (found.error, found.cause, found.error_text) == (UNREAD, "", "PR ER shows and clears it")


async def test_an_error_that_was_there_at_the_first_reading_has_no_cause(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a", EE=1) + STALL)) as cell:
        await cell.session.run("@a MA 4000")
        await asyncio.sleep(5)
        watch = cell.session.buses["line"].telemetry.watch(["a"], 1.0)
        (found,) = await last(cell)
        assert (found.error, found.cause) == (UNREAD, "")
        watch.close()


async def test_a_limit_switch_that_is_active_is_named_as_the_cause(tmp_path):
    async with Watched(tmp_path, party("a") + LIMIT, "a") as cell:
        await last(cell, "@a IS=2,2,0")
        (found,) = await last(cell, "@a MR 51200", wait=6)
        assert (found.error, found.cause) == (UNREAD, "limit+ is active")


def test_faults_of_the_driver_of_a_module_are_an_error_with_its_cause():
    family = FAMILIES["tmcl"]
    state = family.new_state(family.codec, "1")
    state.motors_counted(2)
    for flags, why in ((0, ""), (1 << 1, "the driver is shut down: overtemperature"), (1, ""), ("absent", "")):
        fine, found = family(state).values.fold({"DRIVER_FLAGS 0": 0, "DRIVER_FLAGS 1": flags})
        assert (fine.error, found.error, found.error_text) == (0, UNREAD if why else 0, why)


async def test_a_limit_that_was_active_before_the_error_is_not_its_cause(tmp_path):
    async with Watched(tmp_path, party("a") + LIMIT, "a") as cell:
        await last(cell, "@a IS=2,2,0", "@a MR 51200", "@a PR ER", wait=6)
        (found,) = await last(cell, "@a PR ER")
        assert (found.error, found.cause, lamps(found)["2 lim+"]) == (0, "", True)
        cell.device("line:a").errors.set(86)
        (found,) = await last(cell)
        assert (found.error, found.cause) == (UNREAD, "")


def test_a_cause_stays_while_its_error_is_set_and_no_longer():
    plus = {"IS2": (2, 1, 0)}
    rest, met, off = {"EF": 0, "ST": 0, "IN": 0}, {"EF": 1, "ST": 0, "IN": 2}, {"EF": 1, "ST": 0, "IN": 0}
    found = cause("LMDCM", met, {**plus, **rest})
    assert found == "limit+ is active"
    assert cause("LMDCM", off, {**plus, **met, CAUSE: found}) == "limit+ is active"
    assert cause("LMDCM", {**off, "ST": 1}, {**plus, **met, CAUSE: found}) == "stalled"
    assert cause("LMDCM", rest, {**plus, **off, CAUSE: found}) == ""
    assert cause("LMDCM", off, {**plus, **rest, CAUSE: found}) == ""
