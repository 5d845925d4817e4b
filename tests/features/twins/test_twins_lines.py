"""What reaches a twin, and what goes on the wire for it."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused
from multidrop.drives.events import Sent
from multidrop.features.twins.twins import Twins
from multidrop.shell.events import Diverged, Notified, OnBus, Predicted, TwinEnded
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.twin_cell import of, run

pytestmark = pytest.mark.virtual
POLLS = re.compile(r"PR (?:P,DN,V|IN,DN)")

MARK = re.compile(r'"~\d+"')


async def test_after_the_snapshot_only_position_velocity_and_inputs_are_read(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        await run(cell, "/twin on")
        cell.events.clear()
        await asyncio.sleep(1)
        asked = {event.request.text for event in of(cell, Sent)}
        assert asked and all(POLLS.fullmatch(each) for each in asked), asked
        await run(cell, "/twin off")
        cell.events.clear()
        await asyncio.sleep(2)
        assert cell.written("press") == b""


async def test_the_start_reads_what_a_snapshot_reads(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, f"/snapshot {tmp_path / 'kept.toml'}")
        kept = [MARK.sub("", event.request.text) for event in of(cell, Sent)]
        cell.events.clear()
        await run(cell, "/twin on")
        assert [MARK.sub("", event.request.text) for event in of(cell, Sent)] == kept


async def test_a_line_that_the_drive_refused_does_not_reach_its_twin(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=200000), baud=0)) as cell:
        await run(cell, "/twin on")
        cell.device("press:a").execute("VI=90000", cell.floor.now())
        with pytest.raises(Refused):
            await cell.session.run("VM=50000")
        cell.device("press:a").execute("VI=1000", cell.floor.now())
        await run(cell, "MR 200000", "/sleep 3")
        assert {each.difference for each in of(cell, Predicted)} <= {-1, 0, 1}


async def test_a_line_that_may_be_lost_does_not_count_and_is_the_first_cause(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, "/twin on")

        def lose(event: object) -> None:
            if isinstance(event, OnBus) and isinstance(event.event, Sent) and event.event.request.text == "MR 51200":
                cell.world("power a off")

        leave = cell.session.subscribe(lose)
        with pytest.raises(NoAnswer):
            await cell.session.run("MR 51200")
        leave()
        cell.world("power a on")
        await asyncio.sleep(4)
        assert of(cell, Predicted)[-1].position == 0
        cell.device("press:a").execute("MR 51200", cell.floor.now())
        await asyncio.sleep(3)
        (diverged,) = of(cell, Diverged)
        assert diverged.causes[0] == "it is not known whether 'MR 51200' was executed"


async def test_a_command_from_elsewhere_is_named_first(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, "/twin on")
        cell.device("press:a").execute("SL 20000", cell.floor.now())
        await asyncio.sleep(1)
        (diverged,) = of(cell, Diverged)
        assert diverged.causes[0] == "a command not seen here"
        (warning,) = cell.warned()
        assert re.fullmatch(
            r"a: \d+ steps from its twin since \d\d:\d\d:\d\d\.\d \(limit \d+\): a command not seen here, "
            r"settings changed; /twin on a sets it again",
            warning,
        )
        await run(cell, "SL 0", "/wait stopped", "/twin on a", "/sleep 1")
        assert of(cell, Predicted)[-1].difference == 0


async def test_a_stop_reaches_the_twins(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=200000), party("b"))) as cell:
        await run(cell, "/twin on", "@a MR 2000000", "@b MR 2000000", "/sleep 1")
        cell.session.stop()
        await asyncio.sleep(2)
        assert of(cell, Diverged) == []
        last = {each.address: each for each in of(cell, Predicted)}
        assert [(each.velocity, each.difference) for each in last.values()] == [(0, 0), (0, 0)]
        assert 0 < last["a"].position < 2000000


async def test_inputs_start_a_program_in_both(tmp_path: Path) -> None:
    drive = (
        party("a", VM=200000) + '\nprogram_text = """\nPG 1\nLB G1\nBR G1,I1=0\nMR 51200\nH\nPR P\nBR G1\nE\nPG\n"""'
    )
    async with CellSession(tmp_path, bus("press", drive)) as cell:
        await run(cell, "IS=1,0,0", "/twin on", "EX G1", "/sleep 1")
        for level in (1, 0):
            cell.world(f"input a 1 {level}")
            await asyncio.sleep(2.02)
        assert of(cell, Diverged) == []
        assert of(cell, Predicted)[-1].position >= 51200


async def test_a_line_that_comes_back_is_read_again(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a")), reconnect=True) as cell:
        await run(cell, "/twin on", "MR 5000", "/wait stopped")
        cell.world("unplug press")
        await asyncio.sleep(1)
        assert len(of(cell, TwinEnded)) == 1
        (said,) = [each for each in cell.events if isinstance(each, Notified) and "its twins end" in each.text]
        assert said.outcome and said.text.endswith("they begin again once it is back"), "the piped shell shows outcomes"
        assert not cell.session.predicted
        cell.device("press:a").execute("MR 400", cell.floor.now())
        cell.world("plug press")
        cell.events.clear()
        await asyncio.sleep(7)
        assert of(cell, Predicted)[-1][2:5] == (5400, 0, 0)


async def test_a_line_that_is_not_tried_again_begins_no_twin(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, "/twin on")
        cell.world("unplug press")
        await asyncio.sleep(1)
        (said,) = [each for each in cell.events if isinstance(each, Notified) and "its twins end" in each.text]
        assert said.outcome and said.text == "press: its twins end with the line"


async def test_a_drive_that_moves_gets_no_twin(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, "SL 500")
        with pytest.raises(DriveError, match="a twin begins at rest"):
            await cell.session.run("/twin on")
        assert list(cell.session.hooks.part(Twins).rows()) == []
        cell.events.clear()
        await asyncio.sleep(1)
        assert cell.written("press") == b""


@pytest.mark.parametrize("usb", [False, True])
async def test_both_axes_of_a_controller_have_a_twin(tmp_path: Path, usb: bool) -> None:
    async with CellSession(tmp_path, bus("line", pmx("00")), usb=usb) as cell:
        await run(cell, "HSPD=20000", "LSPD=1000", "ACC=300", "EO=3", "/twin on")
        await run(cell, "X10000", "/sleep 1.5", "Y-2000", "/sleep 1.5")
        assert of(cell, Diverged) == []
        last = {each.axis: each for each in of(cell, Predicted)}
        assert [(each.position, each.difference) for each in last.values()] == [(10000, 0), (-2000, 0)]


async def test_a_module_has_a_twin(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("mods", 'personality = "TMCM"\nname = "1"')) as cell:
        await run(cell, "/twin on", "MVP REL, 0, 20000", "/sleep 3")
        assert of(cell, Diverged) == []
        last = of(cell, Predicted)[-1]
        assert last.position == 20000 and last.difference == 0


async def test_a_drive_over_modbus_has_a_twin(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("eth", ETHERNET, baud=0)) as cell:
        await run(cell, "/twin on", "MR 51200", "/sleep 3")
        assert of(cell, Diverged) == []
        assert of(cell, Predicted)[-1].difference == 0


async def test_a_wrong_use_is_one_line(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        for line in ("/twin off", "/twin on z", "/twin limit 0", "/twin limit", "/twin up"):
            with pytest.raises(Diagnostic):
                await cell.session.run(line)
        assert cell.written("press") == b""
        await run(cell, "/twin", "/twin limit 200", "/twin on", "/sleep 1", "/twin")
        assert cell.printed()[0] == "no twin runs; /twin on begins one"
        assert re.fullmatch(r"a: a twin since \d\d:\d\d:\d\d, apart by 0 steps", cell.printed()[1])
        assert cell.printed()[2] == "limit at rest: 200 steps"


async def test_the_list_of_twins_names_the_causes_of_a_difference_until_it_is_over(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        await run(cell, "/twin on")
        cell.device("press:a").execute("SL 20000", cell.floor.now())
        await asyncio.sleep(1)
        await run(cell, "/twin")
        apart, agrees, _ = cell.printed()
        assert re.fullmatch(r"a: .*, apart by \d+ steps: a command not seen here, settings changed", apart)
        assert agrees.endswith(", apart by 0 steps")
        await run(cell, "@a SL 0", "/wait stopped", "/twin on a", "/sleep 1", "/twin")
        assert cell.printed()[3].endswith(", apart by 0 steps")


async def test_an_equal_gap_of_twins_is_reported_once_for_all_drives(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        await run(cell, "/twin on", "/twin on b")
        assert [each for each in cell.told() if each.startswith("twin of")] == [
            "twin of a, b: not read, so as in a new drive: OE, IS5, A, D, MS, VI and VM for encoder counts"
        ]


async def test_a_drive_keeps_its_twin_under_another_name(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        await run(cell, "/twin on", '@a DN="k"', "@k MR 5000", "/sleep 2")
        last = {each.address: (each.position, each.difference) for each in of(cell, Predicted)[-4:]}
        assert last == {"k": (5000, 0), "b": (0, 0)}


async def test_a_stop_while_a_drive_is_read_leaves_nothing_behind(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        task = cell.session.start("/twin on")
        await asyncio.sleep(0.5)
        cell.session.stop()
        assert not await task
        await asyncio.sleep(2)
        cell.events.clear()
        await asyncio.sleep(2)
        assert cell.written("press") == b"" and not cell.session.buses["press"].witnesses.all


async def test_a_closed_bus_has_no_twins(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        await run(cell, "/twin on", "/close press")
        assert len(of(cell, TwinEnded)) == 1 and list(cell.session.hooks.part(Twins).rows()) == []
