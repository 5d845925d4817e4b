"""A replacement drive gets the state of one drive of a cell file; cut off anywhere, a second run goes on."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Refused, Stopped, TransportLost
from multidrop.drives.events import Traffic
from multidrop.shell import snapshots
from multidrop.shell.operations.argument_types import Restoring
from multidrop.shell.origin import PERSON
from multidrop.shell.params import replacement
from multidrop.simulator import cells
from tests.support.cell_session import CellSession, bus

pytestmark = pytest.mark.virtual

MACHINE = """[[bus]]
name = "press"
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
set = { EM = 1, CK = 2, VM = 400000, A = 5000, IS = ["1,1,1", "2,0,0"], TP = "1000,Ga" }
variables = { Q1 = 12 }
program_text = \"\"\"
PG 1
LB Ga
IC Q1
MR 51200
H
E
PG
\"\"\"
[[bus.drive]]
personality = "LMDCM"
name = "c"
party = true
"""
CUT = re.compile("cut off; done: .*; run it again to go on")
FRESH = 'personality = "LMDCM"'
OTHER = 'personality = "LMDCM"\nprogram_text = "PG 1\\nLB Ob\\nE\\nPG"\nset = { VI = 300000, VM = 500000 }'


def unit(*drives: str) -> str:
    return bus("line", *drives, baud=0)


async def applied(cell: CellSession, folder: Path, source: str = "b", **wanted: object) -> None:
    """Apply a drive of the machine to the drive of a cell, without a question."""
    (folder / "machine.toml").write_text(MACHINE)
    machine = cells.load(folder / "machine.toml")
    cell.session.questions.agreed = True
    drive = cell.session.drive()
    spec = replacement.chosen(machine, "machine.toml", drive, source)
    asked = Restoring(**wanted)  # type: ignore[arg-type]
    await replacement.apply(cell.session, PERSON, drive, "machine.toml", spec, asked)


@pytest.mark.parametrize("present", [FRESH, OTHER, OTHER + '\nname = "x"\nparty = true'])
async def test_a_replacement_becomes_the_drive_and_keeps_it_over_power_off(tmp_path, present):
    async with CellSession(tmp_path, unit(present)) as cell:
        await applied(cell, tmp_path)
        device = next(each.device for each in cell.floor.floor.drives)
        for on in (False, True):
            device.power(on, device.now)
        printed = [device.execute(text, device.now).lines for text in ("PR DN,PY,EM,CK", "PR VM,A,Q1", "PR TP", "L")]
        assert printed == [
            ('"b"112',),
            ("400000500012",),
            ("1000, GA",),
            ("1  LB Ga", "6  IC Q1", "11  MR 51200", "18  H", "20  E"),
        ]
        assert not device.moving(device.now)


async def test_a_second_run_only_saves_as_no_drive_tells_what_is_saved(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        await applied(cell, tmp_path)
        before = cell.session.drive().commands
        cell.session.addressed.clear()
        await applied(cell, tmp_path)
        assert cell.session.addressed == {("line", "b")}, "a wait without an address is for it"
        assert cell.session.drive().commands == before + 1
        assert cell.told()[-1] == "b: verified: it is as 'b' in machine.toml"


async def test_a_dry_run_shows_it_and_sends_nothing(tmp_path):
    async with CellSession(tmp_path, unit(OTHER)) as cell:
        await applied(cell, tmp_path, dry_run=True)
        assert cell.session.drive().commands == 0
        assert "line: VM=400000 (was 500000)" in cell.printed()
        assert 'line: DN="b" (was "!"), at the end' in cell.printed()
        assert "line: program: 5 lines in place of 2" in cell.printed()
        assert any("does not print; check it: OE, " in text for text in cell.warned())


@pytest.mark.parametrize("change", ["", "VM=600000", "PG 300", "A=70000"])
async def test_a_drive_that_changed_during_the_question_gets_nothing(tmp_path, change):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        (tmp_path / "machine.toml").write_text(MACHINE)
        drive = cell.session.drive()
        spec = replacement.chosen(cells.load(tmp_path / "machine.toml"), "m", drive, "b")
        device = next(each.device for each in cell.floor.floor.drives)
        sent: list[int] = []

        async def ask(question: str) -> bool:
            for line in (change, "LB Zz", "E", "PG") if change.startswith("PG") else filter(None, [change]):
                device.execute(line, device.now)
            sent.append(drive.commands)
            return True

        cell.session.questions.agreed, cell.session.front.ask = False, ask
        if not change:
            await replacement.apply(cell.session, PERSON, drive, "m", spec, Restoring())
            assert drive.commands > sent[0]
            return
        with pytest.raises(Refused, match="it changed since the question was asked; nothing was sent; try again"):
            await replacement.apply(cell.session, PERSON, drive, "m", spec, Restoring())
        assert drive.commands == sent[0]


async def test_without_a_yes_nothing_is_sent(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        (tmp_path / "machine.toml").write_text(MACHINE)
        drive = cell.session.drive()
        spec = replacement.chosen(cells.load(tmp_path / "machine.toml"), "m", drive, "b")
        cell.session.questions.agreed = False
        with pytest.raises(Diagnostic, match="nothing was sent; --yes agrees to it"):
            await replacement.apply(cell.session, PERSON, drive, "m", spec, Restoring())
        assert drive.commands == 0


@pytest.mark.parametrize(
    ("present", "message"),
    [
        (
            'personality = "LMDOM"',
            "line: product LMDOM, and 'b' in machine.toml is LMDCM; nothing was sent; --other-product",
        ),
        ('personality = "PMX"\nname = "00"', "product PMX, and 'b' .* a drive of its family is needed"),
        ('personality = "LMDCM"\nset = { LK = 1 }', "its program is locked .LK=1.; LK=0 opens"),
    ],
)
async def test_what_is_refused_changes_nothing(tmp_path, present, message):
    async with CellSession(tmp_path, unit(present)) as cell:
        with pytest.raises((Diagnostic, Refused), match=message):
            await applied(cell, tmp_path)
        assert cell.session.drive().commands == 0


async def test_a_name_that_another_drive_bears_is_refused(tmp_path):
    drives = [f'personality = "LMDCM"\nname = "{name}"\nparty = true' for name in "ab"]
    async with CellSession(tmp_path, unit(*drives)) as cell:
        with pytest.raises(Diagnostic, match="another drive on line is named 'b'"):
            await applied(cell, tmp_path)
        assert cell.session.drive().commands == 0


async def test_what_could_move_the_motor_is_left_alone_and_said(tmp_path):
    text = MACHINE.replace("EM = 1,", "EM = 1, AS = 1, DE = 1,")
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        (tmp_path / "m.toml").write_text(text)
        cell.session.questions.agreed = True
        drive = cell.session.drive()
        spec = replacement.chosen(cells.load(tmp_path / "m.toml"), "m.toml", drive, "b")
        with pytest.raises(DriveError, match="is not as 'b' in m.toml: AS 0, in the file 1"):
            await replacement.apply(cell.session, PERSON, drive, "m.toml", spec, Restoring())
        assert any("AS is left alone: it can turn the motor" in line for line in cell.printed())
        await replacement.apply(cell.session, PERSON, drive, "m.toml", spec, Restoring(named=frozenset({"AS"})))


@pytest.mark.slow
@pytest.mark.parametrize(
    "request_number", [n if n % 10 == 6 else pytest.param(n, marks=pytest.mark.nightly) for n in range(26, 97)]
)
async def test_cut_off_anywhere_it_goes_on_when_it_is_run_again(tmp_path, request_number):
    """The cable is pulled as a request goes out; the drive keeps its power."""
    async with CellSession(tmp_path, unit(OTHER), reconnect=True) as cell:
        count = 0

        def cut(event: object) -> None:
            nonlocal count
            if isinstance(event, Traffic) and event.outgoing:
                count += 1
                if count == request_number:
                    cell.world("/sim unplug line")

        end = cell.session.buses["line"].watch(cut)
        try:
            await applied(cell, tmp_path)
        except (DriveError, TransportLost):
            assert any(map(CUT.search, cell.warned())) or cell.session.drive().commands == 0
        end()
        cell.world("/sim plug line")
        await asyncio.sleep(5)
        if cell.session.buses["line"].lost:
            assert any("switched off and on it is as before" in line for line in cell.warned())
            cell.world("/sim power ! off")
            cell.world("/sim power ! on")
            await asyncio.sleep(5)
        await applied(cell, tmp_path)
        assert cell.told()[-1].endswith("verified: it is as 'b' in machine.toml")


async def test_the_drive_of_the_file_is_chosen_by_its_name(tmp_path):
    (tmp_path / "machine.toml").write_text(MACHINE)
    machine = cells.load(tmp_path / "machine.toml")
    async with CellSession(tmp_path, unit('personality = "LMDCM"\nname = "c"\nparty = true')) as cell:
        drive = cell.session.drive()
        assert replacement.chosen(machine, "m", drive, "").name == "c"
        assert replacement.chosen(machine, "m", drive, "press:b").name == "b"
        for wrong in ("x", "line:b"):
            with pytest.raises(Diagnostic, match="no drive .*; --from names one of press:b, press:c"):
                replacement.chosen(machine, "m", drive, wrong)


async def test_a_snapshot_of_the_replacement_is_the_file_again(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        await applied(cell, tmp_path)
        await snapshots.save(cell.session, str(tmp_path / "after.toml"))
    (spec,) = cells.load(tmp_path / "after.toml").buses[0].drives
    assert (spec.name, spec.party, spec.set["VM"], dict(spec.variables)) == ("b", True, 400000, {"Q1": 12})


async def test_a_drive_stays_selected_under_its_new_name(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        for line in ('DN="b"', "PY=1", "PR DN"):
            await cell.session.run(line)
        assert cell.printed() == ['"b"']
        assert cell.session.place == ("line", "b")


async def becomes(folder: Path, machine: str, present: str, name: str, **named: object) -> CellSession:
    """Apply a drive of another family, and return its session."""
    (folder / "machine.toml").write_text(bus("stages", machine, baud=0))
    cell = CellSession(folder, unit(present))
    await cell.__aenter__()
    cell.session.questions.agreed = True
    drive = cell.session.drive()
    spec = replacement.chosen(cells.load(folder / "machine.toml"), "machine.toml", drive, name)
    asked = Restoring(**named)  # type: ignore[arg-type]
    await replacement.apply(cell.session, PERSON, drive, "machine.toml", spec, asked)
    return cell


@pytest.mark.slow
async def test_a_pmx_becomes_the_one_of_the_file(tmp_path):
    machine = (
        'personality = "PMX"\nname = "05"\nset = { HSPD = 5000, LSPD = 2000, SLRX = 2.5, DOBOOT = 3 }\n'
        'variables = { V40 = 7 }\nprogram_text = "PRG 0\\nV1=5\\nEND"'
    )
    present = 'personality = "PMX"\nvariables = { V41 = 9 }\nprogram_text = "PRG 0\\nX1000\\nWAITX\\nEND"'
    cell = await becomes(tmp_path, machine, present, "05")
    try:
        device = next(each.device for each in cell.floor.floor.drives)
        for on in (False, True):
            device.power(on, cell.floor.now())
        assert [device.execute(text, cell.floor.now()) for text in ("DN", "SLRX", "DOBOOT", "V40", "V41")] == [
            *("2ED05", "2.500", "3", "7", "0")
        ]
        assert "00: after that, DN waits until the drive is switched off and on" in cell.printed()
    finally:
        await cell.session.close()


@pytest.mark.slow
async def test_a_tmcl_module_becomes_the_one_of_the_file(tmp_path):
    machine = 'personality = "TMCM"\nname = "9"\nset = { 4 = 40000, 6 = 99, G75 = 2, G65 = 3 }'
    cell = await becomes(tmp_path, machine, 'personality = "TMCM"', "9")
    try:
        assert cell.session.place == ("line", "9")
        assert await cell.session.drive().send("GAP 6, 0") == ("99",)
        cell.world("/sim power 1 off")
        cell.world("/sim power 1 on")
        assert await cell.session.drive().send("GAP 4, 0") == ("40000",)
    finally:
        await cell.session.close()


@pytest.mark.parametrize("personality", ["LMDCE", "LMM", "MDIE", "MDIX"])
async def test_each_product_becomes_the_one_of_the_file(tmp_path, personality):
    points = 'S1 = "1,0,0"' if personality.startswith("MDI") else 'IS = ["1,1,0"]'
    machine = f'personality = "{personality}"\nset = {{ EM = 1, VM = 40000, VI = 900, RC = 30, {points} }}\n'
    program = 'variables = { Q1 = 3 }\nprogram_text = "PG 1\\nLB G1\\nQ1=Q1+1\\nE\\nPG"\n'
    cell = await becomes(tmp_path, machine + program, f'personality = "{personality}"', "")
    assert cell.told()[-1] == "line: verified: it is as '!' in machine.toml"
    await cell.session.close()


async def test_a_setting_that_the_file_lacks_cannot_be_named(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:
        with pytest.raises(Diagnostic, match="machine.toml: 'b' has no setting XX; --with takes names of its set"):
            await applied(cell, tmp_path, named=frozenset({"XX"}))
        assert cell.session.drive().commands == 0


async def test_a_stop_ends_it_and_says_what_was_done(tmp_path):
    async with CellSession(tmp_path, unit(FRESH)) as cell:

        def stop(event: object) -> None:
            if isinstance(event, Traffic) and event.outgoing and event.data.startswith(b"VM="):
                cell.session.stop()

        cell.session.buses["line"].watch(stop)
        with pytest.raises(Stopped):
            await applied(cell, tmp_path)
        await asyncio.sleep(5)
        assert "line: cut off; done: program; A=5000; run it again to go on" in cell.warned()
        cell.session.resume()
        await applied(cell, tmp_path)
        assert cell.told()[-1] == "b: verified: it is as 'b' in machine.toml"


async def test_a_new_baud_rate_acts_at_power_up(tmp_path):
    cell = await becomes(tmp_path, 'personality = "LMDCM"\nset = { BD = 19 }', 'personality = "LMDCM"', "!")
    assert "line: BD=19 (was 96), at the end" in cell.printed()
    assert "line: after that, BD waits until the drive is switched off and on" in cell.printed()
    await cell.session.close()


async def test_no_line_takes_a_name_away(tmp_path):
    present = 'personality = "LMDCM"\nname = "q"\nparty = true\nset = { EM = 2, CK = 1 }'
    cell = await becomes(tmp_path, 'personality = "LMDCM"\nset = { EM = 1 }', present, "!")
    assert "q: its name stays 'q': only FD gives back '!'" in cell.printed()
    device = cell.device("line:q")
    assert (device.memory.name, device.memory.party, device.memory.checksum, device.memory.echo_mode) == (
        "q",
        False,
        1,
        1,
    )
    await cell.session.close()


OWN = 'personality = "LMDCM"\nprogram_text = "PG 1\\nLB Ga\\nE\\nPG\\nPG 500\\nLB ZZ\\nR1=5\\nE\\nPG"'


async def test_no_program_of_the_replacement_stays_beside_that_of_the_file(tmp_path):
    async with CellSession(tmp_path, unit(OWN)) as cell:
        await applied(cell, tmp_path)
        assert next(each.device for each in cell.floor.floor.drives).execute("L", 1e3).lines[-1] == "20  E"
        assert "ZZ = 500" in next((tmp_path / "data" / "backups").glob("*.mxt")).read_text()


async def test_a_program_of_the_replacement_is_no_part_of_a_machine_without_one(tmp_path):
    async with CellSession(tmp_path, unit(OWN)) as cell:
        with pytest.raises(Refused, match="it holds a program of 5 lines, and 'c' in .* has none: CP erases it"):
            await applied(cell, tmp_path, "c")
        assert cell.session.drive().commands == 0
