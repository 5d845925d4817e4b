"""Cell files: what a snapshot keeps of one unit, as its drive reports it from the start."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.simulator import cells
from multidrop.simulator import cells as cell
from multidrop.simulator.cell.writer import BusText, CellEntry, DriveText, plain, write
from multidrop.simulator.floor import Floor
from tests.support.cases import for_each

MCODE = """
variables = { Q1 = -5 }
set = { VI = 900000, MS = 128, VM = 1000000, EE = 0, IS = ["1,1,0"] }
program_text = \"\"\"
PG 100
LB Ga
  PR "at \\\\t",Q1   ' a remark
E
PG\"\"\"
[bus.drive.identity]
part = "LMDCM573C"
version = "LMDCM 5.014, Hw: 2.1"
serial = "040114512"
position = 51200
C2 = -7
"""


def drive(lines: str, personality: str = "LMDCM") -> str:
    return f'[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "{personality}"\n{lines}'


def asked(lines: str, personality: str, *texts: str) -> list[str]:
    """What an MCode drive of this cell prints."""
    device = Floor(cell.read(drive(lines, personality), "cell.toml")).drives[0].device
    return [line for text in texts for line in device.execute(text, 0.0).lines]  # type: ignore[attr-defined]


def test_an_mcode_drive_is_the_unit_of_its_cell_from_the_start():
    texts = ("PR VR", "PR PN", "PR SN", "PR P", "PR C1", "PR C2", "PR Q1", "PR VI", "PR VM", "PR MS", "L")
    assert asked(MCODE, "LMDCM", *texts) == [
        "LMDCM 5.014, Hw: 2.1",
        "LMDCM573C",
        "040114512",
        "51200",
        "51200",
        "-7",
        "-5",
        "900000",
        "1000000",
        "128",
        "100  LB Ga",
        '105  PR "at \\t",Q1',
        "118  E",
    ]


def test_p_is_the_counter_that_ee_chooses():
    lines = "set = { EE = 1 }\n[bus.drive.identity]\nposition = 300\nC1 = 12"
    assert asked(lines, "MDIE", "PR P", "PR C2", "PR C1") == ["300", "300", "12"]


def test_a_power_cycle_begins_at_position_0_with_the_same_unit():
    device = Floor(cell.read(drive(MCODE))).drives[0].device
    device.power(False, 1.0)
    device.power(True, 2.0)
    assert device.execute("PR SN,P,Q1", 2.0).lines == ("0401145120-5",)  # type: ignore[attr-defined]


@for_each("personality", ["LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX"])
def test_without_an_identity_a_drive_is_one_of_its_personality(personality):
    assert asked("", personality, "PR SN", "PR P") == ["040100033", "0"]


@for_each("lines", ["set = { VM = 5000, EE = 1, MS = 256 }", "set = { EE = 1, VM = 5000 }"])
def test_the_order_of_settings_does_not_matter(lines):
    assert asked(lines, "LMDCM", "PR VM") == ["5000"]


def test_speeds_in_steps_stay_in_steps_with_hmt():
    assert asked("set = { EE = 1, AS = 1, VM = 5000 }", "LMDCM", "PR VM", "PR EE") == ["5000", "1"]


def test_a_pmx_is_the_unit_of_its_cell():
    lines = "variables = { V3 = 7, V40 = -1 }\n[bus.drive.identity]\npart = 'Performax-2ED-SA'\nversion = 'V131'\n"
    device = Floor(cell.read(drive(lines + "position = [1000, -20]\nencoder = [5, 6]", "PMX"))).drives[0].device
    said = [device.execute(text, 0.0) for text in ("ID", "VER", "PX", "PY", "EX", "EY", "V3", "V40")]  # type: ignore[attr-defined]
    assert said == ["Performax-2ED-SA", "V131", "1000", "-20", "5", "6", "7", "-1"]


def test_a_tmcl_module_is_the_unit_of_its_cell():
    lines = "[bus.drive.identity]\nversion = '1140V204'\nposition = -512"
    port = Floor(cell.read(drive(lines, "TMCM"))).drives[0].unit.port
    replies = []
    for body in (bytes([1, 136, 1, 0, 0, 0, 0, 0]), bytes([1, 6, 1, 0, 0, 0, 0, 0])):
        port.receive(body + bytes([sum(body) % 256]), 0.0)
        replies += [each.data[4:8].hex() for each in port.sent(1.0)]
    assert replies == ["04740204", "fffffe00"]


WHERE = 'cell.toml: [[bus]] "b": [[bus.drive]] 1'
VARIABLES, IDENTITY = f"{WHERE}: [bus.drive.variables]", f"{WHERE}: [bus.drive.identity]"


@for_each(
    ("lines", "personality", "expected"),
    [
        ("program_text = 5", "LMDCM", f"{WHERE}: program_text must be text, not 5"),
        (
            'program = "a.mxt"\nprogram_text = "E"',
            "LMDCM",
            f"{WHERE}: program_text is given, and program too; use one of them",
        ),
        ("variables = { Q1 = 1.5 }", "LMDCM", f"{VARIABLES}: Q1 must be a whole number, not 1.5"),
        ("variables = { Q1 = 2147483648 }", "LMDCM", None),
        ("variables = { VM = 5 }", "LMDCM", f'{VARIABLES}: "VM" is not the name of a variable; as in Q1'),
        ("variables = { Q11 = 5 }", "MDI", f'{VARIABLES}: "Q11" is not the name of a variable; as in Q1'),
        ("variables = { q1 = 5, Q1 = 6 }", "LMDCM", f'{VARIABLES}: "Q1" is given twice'),
        ("variables = { V64 = 5 }", "PMX", None),
        (
            "variables = { V1 = 5 }",
            "TMCM",
            f'{WHERE}: [bus.drive.variables]: "V1" is not the name of a variable; '
            "valid: user variables by number, 0 to 255",
        ),
        ("identity = 5", "LMDCM", f"{WHERE}: identity must be a table, not 5"),
        ("identity = { serail = '1' }", "LMDCM", f'{IDENTITY}: unknown key "serail"; did you mean "serial"?'),
        ("identity = { C2 = 5 }", "MDI", None),
        ("identity = { position = 0.5 }", "LMDCM", f"{IDENTITY}: position must be a whole number, not 0.5"),
        (
            "identity = { position = 5 }",
            "PMX",
            f"{IDENTITY}: position must be a list of 2 whole numbers, one for each axis",
        ),
        ("identity = { position = [1, 'a'] }", "PMX", None),
        ('identity = { part = "a\\u0007" }', "LMDCM", None),
        (
            "identity = { version = 'x' }",
            "TMCM",
            f'{IDENTITY}: version cannot be "x"; valid: module and firmware, as in 1241V115',
        ),
    ],
)
def test_a_wrong_key_is_one_line(lines, personality, expected):
    with pytest.raises(Diagnostic) as raised:
        cell.read(drive(lines, personality), "cell.toml")
    assert "\n" not in str(raised.value)
    text = re.sub(r"^cell\.toml:\d+: ", "cell.toml: ", str(raised.value))
    assert text.startswith(WHERE)
    assert expected in (None, text)


@for_each(
    ("lines", "expected"),
    [
        ('program_text = "PG 1\\nMA ,\\nPG"', "program_text:2: MA ,: refused by an LMDCM: error"),
        ("set = { VI = 900000 }", "drive !: set: VI=900000: refused by an LMDCM: error"),
    ],
)
def test_what_the_drive_refuses_is_named(lines, expected):
    with pytest.raises(Diagnostic, match=expected):
        Floor(cell.read(drive(lines)))


# Cell files that are written are read again as what was written, whatever a drive holds.


texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\n\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"))


@given(st.lists(texts, min_size=1), texts)
def test_any_program_and_any_identity_are_read_as_they_were_written(lines, part):
    drive = DriveText("LMDCM", "a", program=lines, identity=[CellEntry("part", plain(part)), CellEntry("position", -5)])
    (bus,) = cells.read(write([BusText("b", [drive], missing=["c does not reply"])])).buses
    (spec,) = bus.drives
    assert spec.program.removesuffix("\n").split("\n") == lines
    assert spec.identity.part == plain(part)
    assert spec.identity.counters == {"position": (-5,)}


@given(st.lists(st.tuples(st.sampled_from(["OE", "IS5", "TS"]), st.text(max_size=9)), max_size=5), st.lists(st.text()))
def test_any_remark_is_a_remark(unread, remarks):
    text = write([BusText("b", [DriveText("LMDCM", "a", remarks=remarks, unread=unread)])])
    assert cells.read(text).buses[0].drives[0].name == "a"
