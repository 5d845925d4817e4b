"""All that an apply says and writes, line by line: a person decides by these lines whether a drive gets the state."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Refused, Stopped
from multidrop.drives.events import Traffic
from multidrop.shell.events import Notified, Output
from multidrop.shell.operations.argument_types import Restoring
from multidrop.shell.origin import PERSON
from multidrop.shell.params import replacement
from multidrop.simulator import cells
from tests.support.cell_session import CellSession, bus, drive, party

pytestmark = pytest.mark.virtual

PROGRAM = 'program_text = "PG 1\\nLB Ga\\nMR 51200\\nE\\nPG"'
OTHER_PROGRAM = 'program_text = "PG 1\\nLB Gb\\nMR 7\\nE\\nPG"'
FRESH = drive("LMDCM")
UNSEEN = "no snapshot has what a drive does not print; check it: OE, IS5, A, D, MS, VI and VM for encoder counts"
PMX_HOLDS = drive("PMX", "00", 'program_text = "PRG 0\\nX1000\\nEND"')


async def applied(cell: CellSession, folder: Path, text: str, source: str = "", **wanted: Any) -> None:
    """Apply a drive of a cell file to the first drive of a session."""
    (folder / "m.toml").write_text(bus("m", text, baud=0))
    cell.session.questions.agreed = True
    here = cell.session.drive()
    spec = replacement.chosen(cells.load(folder / "m.toml"), "m.toml", here, source)
    await replacement.apply(cell.session, PERSON, here, "m.toml", spec, Restoring(**wanted))


def told(cell: CellSession) -> list[str]:
    """Every line: `!` before a warning, `=` before an outcome."""
    lines = []
    for event in cell.events:
        if isinstance(event, Output | Notified):
            mark = "" if isinstance(event, Output) else "! " if event.warning else "= " if event.outcome else "- "
            lines.append(re.sub(r"/\S*/backups/[\d-]*", "BACKUP-", f"{mark}{event.text}"))
    return lines


SHOWN = {
    "a drive in party mode with a program": (
        (FRESH,),
        party("b", PROGRAM, VM=400000, A=5000, AS=1),
        {},
        [
            "line: program: 3 lines in place of 0",
            "line: A=5000 (was 1000000)",
            "line: VM=400000 (was 768000)",
            "line: EM=1 (was 0), at the end",
            'line: DN="b" (was "!"), at the end',
            "line: CK=1 (was 0), at the end",
            "line: PY=1 (was 0), at the end",
            "line: AS is left alone: it can turn the motor (--with AS writes it)",
            f"! line: {UNSEEN}",
            "line: saved at the end (S); its position is not changed",
        ],
    ),
    "what moves the motor, named": (
        (FRESH,),
        drive("LMDCM", AS=1),
        {"named": frozenset({"AS"})},
        ["line: AS=1 (was 0)", f"! line: {UNSEEN}", "line: saved at the end (S); its position is not changed"],
    ),
    "nothing differs": (
        (FRESH,),
        FRESH,
        {},
        [f"! line: {UNSEEN}", "line: saved at the end (S); its position is not changed"],
    ),
    "the same program": (
        (drive("LMDCM", "", PROGRAM),),
        drive("LMDCM", "", PROGRAM),
        {},
        [f"! line: {UNSEEN}", "line: saved at the end (S); its position is not changed"],
    ),
    "another program": (
        (drive("LMDCM", "", PROGRAM),),
        drive("LMDCM", "", OTHER_PROGRAM),
        {},
        [
            "line: program: 3 lines in place of 3",
            f"! line: {UNSEEN}",
            "line: saved at the end (S); its position is not changed",
        ],
    ),
    "a name that stays": (
        (party("q"),),
        FRESH,
        {},
        [
            "q: PY=0 (was 1), at the end",
            "q: its name stays 'q': only FD gives back '!'",
            f"! q: {UNSEEN}",
            "q: saved at the end (S); its position is not changed",
        ],
    ),
    "a controller keeps its program": (
        (PMX_HOLDS,),
        drive("PMX", "05", "variables = { V40 = 7 }", HSPD=5000),
        {},
        [
            "00: its program of 4 lines stays: m.toml has none",
            "00: HSPD=5000 (was 1000)",
            "00: V40=7 (was 0)",
            '00: DN=2ED05 (was "2ED00"), at the end',
            "! 00: no snapshot has what a drive does not print; check it: JO",
            "00: saved at the end (STORE); its position is not changed",
            "00: after that, DN waits until the drive is switched off and on",
        ],
    ),
    "another product": (
        (drive("LMDOM"),),
        drive("LMDCM", VM=40000, EE=1),
        {"other_product": True},
        [
            "line: VM=40000 (was 768000)",
            "line: EE is left alone: this drive does not print it",
            "! line: no snapshot has what a drive does not print; check it: OE, IS5",
            "line: saved at the end (S); its position is not changed",
        ],
    ),
}


@pytest.mark.parametrize(("present", "text", "options", "lines"), SHOWN.values(), ids=SHOWN)
async def test_everything_that_will_happen_is_shown_and_a_dry_run_writes_nothing(
    tmp_path, present, text, options, lines
):
    async with CellSession(tmp_path, bus("line", *present, baud=0)) as cell:
        await applied(cell, tmp_path, text, dry_run=True, **options)
        assert told(cell) == lines
        assert cell.session.drive().commands == 0


async def test_another_part_version_and_serial_number_are_named(tmp_path):
    identity = '[bus.drive.identity]\nserial = "123"\nversion = "9.9"\npart = "X1"'
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        await applied(cell, tmp_path, f"{FRESH}\n{identity}", dry_run=True)
        first = [each for each in told(cell) if "in m.toml" in each]
        assert [re.sub(r"(line: \w+) .*;", r"\1 X;", each) for each in first] == [
            "line: part X; in m.toml X1",
            "line: version X; in m.toml 9.9",
            "line: serial X; in m.toml 123",
        ]


async def test_a_whole_apply_says_each_part_and_writes_it_in_its_order(tmp_path):
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        await applied(cell, tmp_path, party("b", PROGRAM, VM=400000, A=5000))
        assert told(cell)[-6:] == [
            "line: saved at the end (S); its position is not changed",
            "= backup: BACKUP-line.mxt",
            "= line: m.toml#b downloaded, 5 lines",
            "= line: saved (S)",
            "= line: verified, 3 lines",
            "= b: verified: it is as 'b' in m.toml",
        ]
        assert cell.session.place == ("line", "b")
        assert {("line", ""), ("line", "b")} >= cell.session.addressed
        device = next(each.device for each in cell.floor.floor.drives)
        for on in (False, True):
            device.power(on, device.now)
        assert device.execute("PR DN,PY,EM,CK", device.now).lines == ('"b"111',)
        assert device.execute("PR VM,A", device.now).lines == ("4000005000",)


async def test_a_module_says_each_setting_and_its_new_address(tmp_path):
    async with CellSession(tmp_path, bus("line", drive("TMCM"), baud=0)) as cell:
        await applied(cell, tmp_path, 'personality = "TMCM"\nname = "9"\nset = { 4 = 40000, 6 = 99, G75 = 2 }')
        assert told(cell) == [
            "1: SAP 4, 0, 40000 (was 51200)",
            "1: SAP 6, 0, 99 (was 128)",
            "1: SGP 75, 0, 2 (was 0), at the end",
            "1: SGP 66, 0, 9 (was 1), at the end",
            "1: saved at the end (STAP); its position is not changed",
            "- line: module 1: its address is 9 from now on: type @9",
            "= 9: verified: it is as '9' in m.toml",
        ]


ASKED = {
    "everything": (
        party("b", PROGRAM, VM=400000, A=5000),
        "line: it gets the state of 'b' in m.toml: a program of 3 lines, 2 settings, then EM=1, DN=\"b\", CK=1, PY=1",
    ),
    "one setting": (drive("LMDCM", VM=400000), "line: it gets the state of '!' in m.toml: 1 setting"),
    "nothing": (FRESH, "line: it gets the state of '!' in m.toml: nothing differs, S saves it"),
}


@pytest.mark.parametrize(("text", "asked"), ASKED.values(), ids=ASKED)
async def test_the_question_says_in_short_what_it_gets_and_a_no_writes_nothing(tmp_path, text, asked):
    (tmp_path / "m.toml").write_text(bus("m", text, baud=0))
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        questions: list[str] = []

        async def ask(question: str) -> bool:
            questions.append(question)
            return False

        cell.session.questions.agreed, cell.session.front.ask = False, ask
        spec = replacement.chosen(cells.load(tmp_path / "m.toml"), "m.toml", cell.session.drive(), "")
        with pytest.raises(Diagnostic, match="the answer was no, so it was not done"):
            await replacement.apply(cell.session, PERSON, cell.session.drive(), "m.toml", spec, Restoring())
        assert len(questions) == 1 and questions[0].startswith(f"{asked}")
        assert cell.session.drive().commands == 0


REFUSED = {
    "product": ((drive("LMDOM"),), FRESH, {}, "line: product LMDOM, and '!' in m.toml is LMDCM; nothing was sent; "
        "--other-product applies it all the same"),
    "family": ((drive("PMX", "00"),), FRESH, {"other_product": True}, "00: product PMX, and '!' in m.toml is LMDCM; "
        "nothing was sent; a drive of its family is needed"),
    "not in party mode": ((party("q"), party("r")), FRESH, {}, "q: '!' in m.toml is not in party mode, and line has "
        "other drives; nothing was sent"),
    "name": ((party("q"), party("r")), party("r"), {}, "q: another drive on line is named 'r'; nothing was sent"),
    "no such setting": ((FRESH,), FRESH, {"named": frozenset({"ZZ", "YY"})}, "m.toml: '!' has no setting YY; --with "
        "takes names of its set"),
    "held program": ((drive("LMDCM", "", PROGRAM),), FRESH, {}, "line: it holds a program of 3 lines, and "
        "'!' in m.toml has none: CP erases it (nothing was sent)"),
    "locked": ((drive("LMDCM", LK=1),), drive("LMDCM", "", PROGRAM), {}, "line: its program is locked (LK=1); LK=0 "
        "opens a lock that was not saved; CP opens any, and erases the program (nothing was sent)"),
}  # fmt: skip


@pytest.mark.parametrize(("present", "text", "options", "says"), REFUSED.values(), ids=REFUSED)
async def test_what_is_refused_shows_nothing_and_writes_nothing(tmp_path, present, text, options, says):
    async with CellSession(tmp_path, bus("line", *present, baud=0)) as cell:
        with pytest.raises((Diagnostic, Refused)) as caught:
            await applied(cell, tmp_path, text, **options)
        assert str(caught.value) == says
        assert told(cell) == [] and cell.session.drive().commands == 0


async def test_drives_of_a_line_that_are_not_in_the_way_hinder_nothing(tmp_path):
    async with CellSession(tmp_path, bus("line", party("q"), party("r"), baud=0)) as cell:
        await applied(cell, tmp_path, party("b"), dry_run=True)
        assert 'q: DN="b" (was "q"), at the end' in told(cell)


async def test_what_a_lock_does_not_touch_is_applied_to_a_locked_drive(tmp_path):
    async with CellSession(tmp_path, bus("line", drive("LMDCM", LK=1), baud=0)) as cell:
        await applied(cell, tmp_path, drive("LMDCM", LK=1, VM=40000))
        assert told(cell)[-1] == "= line: verified: it is as '!' in m.toml"


TWO = bus("m", party("b"), party("c"), baud=0) + bus("n", party("b"), baud=0)
CHOSEN = {
    ("c", ""): "c",
    ("x", "c"): "c",
    ("x", "n:b"): "b",
    ("x", ""): 'no drive "x"; --from names one of m:b, m:c, n:b',
    ("x", "n:c"): 'no drive "n:c"',
    ("x", "o:b"): 'no drive "o:b"',
    ("b", ""): '"b" is the name of several drives; --from names one of m:b, m:c, n:b',
    ("x", "b"): '"b" is the name of several drives',
}


@pytest.mark.parametrize(("given", "found"), CHOSEN.items())
async def test_a_drive_of_a_file_is_found_by_its_name_or_its_place(tmp_path, given, found):
    own, named = given
    (tmp_path / "m.toml").write_text(TWO)
    machine = cells.load(tmp_path / "m.toml")
    async with CellSession(tmp_path, bus("line", party(own), baud=0)) as cell:
        here = cell.session.drive()
        if len(found) == 1:
            assert replacement.chosen(machine, "m.toml", here, named).name == found
            return
        with pytest.raises(Diagnostic) as caught:
            replacement.chosen(machine, "m.toml", here, named)
        assert str(caught.value).startswith(f"m.toml: {found}")


async def test_the_only_drive_of_a_file_is_for_any_drive_but_not_for_several(tmp_path):
    (tmp_path / "m.toml").write_text(bus("m", party("b"), baud=0))
    machine = cells.load(tmp_path / "m.toml")
    async with CellSession(tmp_path, bus("line", party("x"), baud=0)) as cell:
        here = cell.session.drive()
        assert replacement.chosen(machine, "m.toml", here, "").name == "b"
        with pytest.raises(Diagnostic) as caught:
            replacement.chosen(machine, "m.toml", here, "", several=True)
        assert str(caught.value) == 'm.toml: no drive "x"; the file has m:b; --drive names one drive'
        with pytest.raises(Diagnostic, match='no drive "x"; --from names one of m:b'):
            replacement.chosen(machine, "m.toml", here, "x")


async def test_a_drive_that_is_at_work_gets_nothing(tmp_path):
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        await cell.session.run("SL 1000")
        before = cell.session.drive().commands
        with pytest.raises(Refused, match=r"moves.*\(nothing was sent\)"):
            await applied(cell, tmp_path, drive("LMDCM", VM=40000))
        assert cell.session.drive().commands == before


async def test_a_drive_that_is_not_as_the_file_is_said_with_both_values(tmp_path):
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        with pytest.raises(DriveError) as caught:
            await applied(cell, tmp_path, drive("LMDCM", AS=1, DE=1, VM=40000))
        assert str(caught.value).startswith("line is not as '!' in m.toml: ")
        assert "AS 0, in the file 1" in str(caught.value) and "VM" not in str(caught.value)


BEFORE_CK = 'program; A=5000; VM=400000; settings and program saved (S); EM=1; DN="b"'
CUTS = {
    "at its program": (party("b", PROGRAM, VM=400000, A=5000), b"LB Ga", "nothing", ""),
    "at a setting": (party("b", PROGRAM, VM=400000, A=5000), b"VM=", "program; A=5000", ""),
    "at its communication": (
        party("b", PROGRAM, VM=400000, A=5000),
        b"CK=1",
        BEFORE_CK,
        ". It may be in party mode already (URL?drives=b&party=1); switched off and on it is as before",
    ),
    "outside of party mode": (drive("LMDCM", EM=1), b"EM=1", "settings and program saved (S)", ""),
}


@pytest.mark.parametrize(("text", "at", "done", "mode"), CUTS.values(), ids=CUTS)
async def test_a_stop_cuts_it_off_and_what_was_done_until_then_is_said(tmp_path, text, at, done, mode):
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:

        def stop(event: object) -> None:
            if isinstance(event, Traffic) and event.outgoing and event.data.startswith(at):
                cell.session.stop()

        cell.session.buses["line"].watch(stop)
        with pytest.raises(Stopped):
            await applied(cell, tmp_path, text)
        assert f"! line: cut off; done: {done}; run it again to go on{mode}" in told(cell)


MEANWHILE = {
    "": "",
    "VM=600000": "line: it changed since the question was asked; nothing was sent; try again",
    "SL 1000": "the drive moves",
}


@pytest.mark.parametrize(("meanwhile", "refused"), MEANWHILE.items())
async def test_after_a_yes_it_is_applied_unless_the_drive_changed_or_began_to_move_meanwhile(
    tmp_path, meanwhile, refused
):
    (tmp_path / "m.toml").write_text(bus("m", drive("LMDCM", VM=400000), baud=0))
    async with CellSession(tmp_path, bus("line", FRESH, baud=0)) as cell:
        device = next(each.device for each in cell.floor.floor.drives)

        async def ask(question: str) -> bool:
            if meanwhile:
                device.execute(meanwhile, cell.floor.now())
            return True

        cell.session.questions.agreed, cell.session.front.ask = False, ask
        here = cell.session.drive()
        spec = replacement.chosen(cells.load(tmp_path / "m.toml"), "m.toml", here, "")
        if not refused:
            await replacement.apply(cell.session, PERSON, here, "m.toml", spec, Restoring())
            assert told(cell)[-1] == "= line: verified: it is as '!' in m.toml"
            return
        with pytest.raises(Refused) as caught:
            await replacement.apply(cell.session, PERSON, here, "m.toml", spec, Restoring())
        assert refused in str(caught.value) and here.commands == 0
