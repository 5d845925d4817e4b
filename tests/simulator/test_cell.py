"""Cell files: all that DESIGN's sample says is read, and every wrong file is told apart in one line."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.simulator import cells as cell
from multidrop.simulator.cell.spec import BusSpec, Cell, DriveSpec, Faults, WorldSpec
from multidrop.simulator.families import BY_PERSONALITY
from tests.support.cases import for_each

SAMPLE = """
seed = 7                                  # makes faults repeatable
[[bus]]
name = "press"
serve = ["pty:press.tty", "tcp://127.0.0.1:0", "udp://127.0.0.1:0"]   # none: only as sim:CELL#press
baud = 9600
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 1, CK = 0, VM = 512000 }
program = "demo.mxt"
instruction_us = 200
[bus.drive.world]
home = 0
limit_plus = 200000
limit_minus = -200000
stall_at = 150000
load = 0.3
inputs = [[2.0, 1, 0], [2.5, 1, 1]]
analog = [[0.0, 2048]]
[[bus]]
name = "cell-eth"
serve = ["tcp://127.0.0.1:0", "modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
[bus.faults]
flip = 1e-4
drop = 1e-4
double = 1e-5
insert = 2e-5
late = 3e-5
late_by = [0.1, 0.2]
delay = [0.001, 0.02]
hangup_after = 30.0
hangup_for = 2
"""


def drive(lines: str, personality: str = "LMDCM") -> str:
    return f'[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "{personality}"\n{lines}'


def complaint(text: str, folder: Path | None = None) -> str:
    with pytest.raises(Diagnostic) as raised:
        cell.read(text, "cell.toml", folder)
    return str(raised.value)


def test_the_whole_of_a_cell_is_read(tmp_path: Path) -> None:
    (tmp_path / "demo.mxt").write_text("PG 1\nE\nPG\n")
    (tmp_path / "cell.toml").write_text(SAMPLE)
    press, ethernet = cell.load(tmp_path / "cell.toml").buses
    assert cell.load(tmp_path / "cell.toml").seed == 7
    assert [each.scheme for each in press.serve] == ["pty", "tcp", "udp"]
    assert press.serve[0].path == tmp_path / "press.tty"
    assert (press.serve[1].host, press.serve[1].port) == ("127.0.0.1", 0)
    assert press.baud == 9600 and ethernet.baud == 0
    assert press.drives == (
        DriveSpec(
            personality="LMDCM",
            name="a",
            party=True,
            set={"EM": 1, "CK": 0, "VM": 512000},
            program="PG 1\nE\nPG\n",
            program_name="demo.mxt",
            instruction_us=200.0,
            world=WorldSpec(
                home=0,
                limit_plus=200000,
                limit_minus=-200000,
                stall_at=150000,
                load=0.3,
                inputs=((2.0, 1, 0), (2.5, 1, 1)),
                analog=((0.0, 2048),),
            ),
        ),
    )
    assert ethernet.drives == (DriveSpec(personality="LMDCE", name="!"),)
    assert [drive.personality for drive in ethernet.drives] == ["LMDCE"]
    assert ethernet.faults == Faults(
        *(1e-4, 1e-4, 1e-5, 2e-5, 3e-5), late_by=(0.1, 0.2), delay=(0.001, 0.02), hangup_after=30.0, hangup_for=2.0
    )


def test_what_is_left_out_has_its_default() -> None:
    assert cell.read("") == Cell()
    assert cell.read('[[bus]]\nname = "b"') == Cell(buses=(BusSpec("b"),))
    assert cell.read(drive("")).buses[0].drives == (DriveSpec(),)
    assert cell.read(drive("", "PMX")).buses[0].drives == (DriveSpec("PMX", "00", further=(WorldSpec(),)),)


def test_the_demo_cell_has_its_drives_and_programs() -> None:
    press, ethernet, pmx = cell.demo().buses
    assert (press.name, ethernet.name, pmx.name) == ("press", "eth", "pmx")
    assert [(each.personality, each.name, each.party) for each in press.drives] == [
        ("LMDCM", "a", True),
        ("LMDCM", "b", True),
        ("LMDCM", "c", True),
    ]
    assert all(each.set["EM"] == 1 and each.set["CK"] == 1 for each in press.drives)
    assert press.baud == 9600 and ethernet.baud == 0
    assert [(each.personality, each.name) for each in ethernet.drives] == [("LMDCE", "!")]
    assert all("LB Ga" in each.program for each in (*press.drives, *ethernet.drives))
    assert [(each.personality, each.name) for each in pmx.drives] == [("PMX", "00")]
    assert press.serve and ethernet.serve and pmx.serve


def test_settings_are_lines_for_the_drive() -> None:
    lines = 'set = { is = ["1,1,0", [2, 2, 0]], ee = true, A = 78125 }'
    (spec,) = cell.read(drive(lines)).buses[0].drives
    assert list(spec.assignments()) == [("IS", "1,1,0"), ("IS", "2,2,0"), ("EE", "1"), ("A", "78125")]


def test_the_host_of_an_endpoint_is_this_machine_unless_it_says_another() -> None:
    text = '[[bus]]\nname = "b"\nserve = ["tcp://:5031", "udp://0.0.0.0:503", "tcp://[::1]:9", "pty:"]'
    endpoints = cell.read(text).buses[0].serve
    assert [(each.host, each.port) for each in endpoints] == [
        ("127.0.0.1", 5031),
        ("0.0.0.0", 503),
        ("::1", 9),
        ("", 0),
    ]
    assert endpoints[3].path is None


def test_the_world_of_a_pmx_has_two_axes() -> None:
    flat = "[bus.drive.world]\nhome = 5\n[bus.drive.world.y]\nlimit_plus = 7"
    (spec,) = cell.read(drive(flat, "PMX")).buses[0].drives
    assert (spec.world, spec.further[0]) == (WorldSpec(home=5), WorldSpec(limit_plus=7))
    (spec,) = cell.read(drive("[bus.drive.world.x]\nhome = 5", "PMX")).buses[0].drives
    assert (spec.world, spec.further[0]) == (WorldSpec(home=5), WorldSpec())
    (spec,) = cell.read(drive("[bus.drive.world.y]\nindex = -9\nencoder = 2.5\nslip = 0.1", "PMX")).buses[0].drives
    assert spec.further[0] == WorldSpec(index=-9, encoder=2.5, slip=0.1)
    with pytest.raises(Diagnostic, match='unknown key "index"'):
        cell.read(drive("[bus.drive.world]\nindex = 5"))


PARTY = '[[bus]]\nname = "b"\n' + '[[bus.drive]]\npersonality = "LMDCM"\nname = "a"\nparty = true\n' * 2
DRIVE = 'cell.toml: [[bus]] "b": [[bus.drive]] 1'
IS_HINT = 'several lines: IS = ["1,1,0", "2,2,0"]'


@for_each(
    ("text", "expected"),
    [
        ("sed = 1", 'cell.toml: unknown key "sed"; did you mean "seed"?'),
        ("zzz = 1", 'cell.toml: unknown key "zzz"; valid: seed, own_units, bus'),
        ("seed = 1.5", "cell.toml: seed must be a whole number, not 1.5"),
        ("seed = true", "cell.toml: seed must be a whole number, not true"),
        ("bus = 1", "cell.toml: bus must be tables that begin with [[bus]]"),
        ("[[bus]]", "cell.toml: [[bus]] 1: name is missing"),
        ("[[bus]]\nname = 3", "cell.toml: [[bus]] 1: name must be text, not 3"),
        (
            '[[bus]]\nname = "a#b"',
            'cell.toml: [[bus]] "a#b": name cannot be "a#b"; '
            "valid: a word without spaces, #, @, : or /, not -, =, + or @ first",
        ),
        (
            '[[bus]]\nname = "-b"',
            'cell.toml: [[bus]] "-b": name cannot be "-b"; '
            "valid: a word without spaces, #, @, : or /, not -, =, + or @ first",
        ),
        (
            '[[bus]]\nname = "b"\n[[bus]]\nname = "b"',
            'cell.toml: two buses have the name "b"; use different names',
        ),
        ('[[bus]]\nname = "b"\nbaut = 1', 'cell.toml: [[bus]] "b": unknown key "baut"; did you mean "baud"?'),
        (
            '[[bus]]\nname = "b"\nbaud = -1',
            'cell.toml: [[bus]] "b": baud must be from 0 to 4000000, not -1',
        ),
        (
            '[[bus]]\nname = "b"\nserve = "pty:"',
            'cell.toml: [[bus]] "b": serve must be a list, not "pty:"',
        ),
        (
            '[[bus]]\nname = "b"\nserve = ["tcp://127.0.0.1"]',
            'cell.toml: [[bus]] "b": serve "tcp://127.0.0.1" has no port; for any free port: tcp://127.0.0.1:0',
        ),
        (
            '[[bus]]\nname = "b"\nserve = ["tcp://h:65536"]',
            'cell.toml: [[bus]] "b": serve "tcp://h:65536" has no port; for any free port: tcp://127.0.0.1:0',
        ),
        (
            '[[bus]]\nname = "b"\nserve = ["modbus://:0"]',
            'cell.toml: [[bus]] "b": serve has modbus://, and no drive of the bus serves it; valid: LMDOE, LMDCE',
        ),
        (
            '[[bus]]\nname = "b"\nserve = ["tcp://:503", "tcp://127.0.0.1:503"]',
            'cell.toml: [[bus]] "b": serve "tcp://127.0.0.1:503" uses the place of "tcp://:503"',
        ),
        (
            PARTY,
            'cell.toml: [[bus]] "b": [[bus.drive]] 2: "a" is the name of [[bus.drive]] 1 too; use different names',
        ),
        (
            PARTY.replace("party = true\n", "", 1),
            f"{DRIVE}: without party mode it replies to every line of the bus; add party = true",
        ),
        (
            PARTY.replace("LMDCM", "LMDCE", 1),
            f"{DRIVE}: an LMDCE cannot share its bus; give it a bus of its own",
        ),
        (
            PARTY.replace("party", "prty"),
            f'{DRIVE}: unknown key "prty"; did you mean "party"?',
        ),
        ('[[bus]]\nname = "b"\n[[bus.drive]]', f"{DRIVE}: personality is missing"),
        (drive("", "lmdcm"), f'{DRIVE}: personality cannot be "lmdcm"; did you mean "LMDCM"?'),
        (
            drive("", "X"),
            f'{DRIVE}: personality cannot be "X"; valid: {", ".join(BY_PERSONALITY)}',
        ),
        (drive('name = "ab"'), f'{DRIVE}: name cannot be "ab"; valid: one of a-z, A-Z, 0-9 or !'),
        (drive('name = "*"'), f'{DRIVE}: name cannot be "*"; valid: one of a-z, A-Z, 0-9 or !'),
        (drive('name = "a"', "PMX"), f'{DRIVE}: name cannot be "a"; valid: two digits, 00 to 99'),
        (
            drive("party = true", "PMX"),
            f"{DRIVE}: party is for MCode drives; leave it out: a PMX always has an address",
        ),
        (drive("party = 1"), f"{DRIVE}: party must be true or false, not 1"),
        (drive("set = 1"), f"{DRIVE}: set must be a table, not 1"),
        (
            drive("set = { VMM = 1 }"),
            f'{DRIVE}: set: "VMM" is not an MCode mnemonic of an LMDCM; did you mean "VM"?',
        ),
        (drive("set = { MA = 1 }"), f"{DRIVE}: set: MA cannot be set (Move absolute)"),
        (drive("set = { VM = 2000, vm = 3000 }"), f'{DRIVE}: set: "vm" is given twice'),
        (drive('set = { DN = "a" }'), f'{DRIVE}: set: DN has a key of its own; use "name"'),
        (drive("set = { PY = 1 }"), f'{DRIVE}: set: PY has a key of its own; use "party"'),
        (drive("set = { EM = 4 }"), f"{DRIVE}: set: EM must be from 0 to 3, not 4"),
        (drive("set = { VM = nan }"), f'{DRIVE}: set: "VM" must be a number or text; {IS_HINT}'),
        (drive("set = { IS = [] }"), f'{DRIVE}: set: "IS" must be a number or text; {IS_HINT}'),
        (drive("set = { IS = 2020-01-01 }"), f'{DRIVE}: set: "IS" must be a number or text; {IS_HINT}'),
        (
            drive('program = "no.mxt"'),
            f'{DRIVE}: program "no.mxt" does not exist; paths are relative to the cell file',
        ),
        (drive('program = "."'), f'{DRIVE}: program "." does not exist; paths are relative to the cell file'),
        (drive("cse = true"), f"{DRIVE}: cse is for Ethernet drives; valid: LMDOE, LMDCE"),
        (drive("cse = 1", "LMDCE"), f"{DRIVE}: cse must be true or false, not 1"),
        (drive("instruction_us = -1"), f"{DRIVE}: instruction_us must be from 0 to 1e+06, not -1"),
        (
            drive("[bus.drive.world]\nhom = 1"),
            f'{DRIVE}: [bus.drive.world]: unknown key "hom"; did you mean "home"?',
        ),
        (
            drive("[bus.drive.world]\nhome = '0'"),
            f"{DRIVE.replace('.toml', '.toml:6')}: [bus.drive.world]: home: '0' is no number with a unit; "
            "valid: NUMBER SPACE UNIT, as in 12.5 mm",
        ),
        (
            drive("[bus.drive.world]\ninputs = [[0.0, 1]]"),
            f"{DRIVE}: [bus.drive.world]: inputs must be a list of [seconds, input, level]: row 1 is a list",
        ),
        (
            drive("[bus.drive.world]\ninputs = [[0.0, 1, 1], [1, 5, 0]]"),
            f"{DRIVE}: [bus.drive.world]: inputs row 2: input must be from 1 to 4, not 5",
        ),
        (
            drive("[bus.drive.world]\nanalog = [[0.0, 4096]]"),
            f"{DRIVE}: [bus.drive.world]: analog row 1: counts must be from 0 to 4095, not 4096",
        ),
        (
            drive("[bus.drive.world]\nanalog = [[0.0, 20.5]]"),
            f"{DRIVE}: [bus.drive.world]: analog row 1: counts must be a whole number, not 20.5",
        ),
        (
            drive("[bus.drive.world]\nlocked = [[0.5, 0.5]]"),
            f"{DRIVE}: [bus.drive.world]: locked rows must go up, not from 0.5 to 0.5",
        ),
        (
            drive("[bus.drive.world]\nhome = 1\n[bus.drive.world.x]\nhome = 2", "PMX"),
            f"{DRIVE}: [bus.drive.world]: [bus.drive.world.x]: home is given twice; keys without an axis belong to x",
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\nflip = 2',
            'cell.toml: [[bus]] "b": [bus.faults]: flip must be from 0 to 1, not 2',
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\ndelay = [0.2, 0.1]',
            'cell.toml: [[bus]] "b": [bus.faults]: delay goes down, from 0.2 to 0.1',
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\ndelay = 0.2',
            'cell.toml: [[bus]] "b": [bus.faults]: delay must be a list, not 0.2',
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\nhangup_after = inf',
            'cell.toml: [[bus]] "b": [bus.faults]: hangup_after must be 0 or more, not inf',
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\nhangup_for = 2',
            'cell.toml: [[bus]] "b": [bus.faults]: hangup_for needs hangup_after; as in hangup_after = 30.0',
        ),
        (
            '[[bus]]\nname = "b"\n[bus.faults]\nhangup_after = 0\nhangup_for = 0',
            'cell.toml: [[bus]] "b": [bus.faults]: hangup_for must be 0.001 or more, not 0',
        ),
    ],
)
def test_a_wrong_file_is_told_in_one_line(text: str, expected: str, tmp_path: Path) -> None:
    assert re.sub(r"^cell\.toml:\d+: ", "cell.toml: ", complaint(text, tmp_path)) == re.sub(r":\d+: ", ": ", expected)


def test_an_unknown_endpoint_is_told_with_those_that_are_known(tmp_path: Path) -> None:
    told = complaint('[[bus]]\nname = "b"\nserve = ["http://x:1"]', tmp_path)
    assert re.sub(r":\d+: ", ": ", told).startswith(
        'cell.toml: [[bus]] "b": serve cannot be "http://x:1"; valid: pty:, '
    )
    known = re.findall(r"\w+:(?://|(?=,))", told.partition("valid: ")[2])
    assert known[:4] == ["pty:", "tcp://", "udp://", "modbus://"] and told.endswith(f" or {known[-1]} at the beginning")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("sed = 1", 1),
        ('seed = 1\n\n[[bus]]\nnane = "b"', 4),
        ('[[bus]]\nname = "a"\n[[bus]]\n[bus.faults]\n', 3),  # without a name: its head
        ('[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "LMDCM"\n\n[bus.drive.world]\nhome = true', 7),
        ('[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "LMDCM"\nworld = { home = 1, hom = 2 }', 5),
        ('[[bus]]\nname = "b"\n[[bus.drive]]\n[[bus.drive]]\npersonality = "LMDCM"', 3),
    ],
)
def test_a_fault_names_its_line(text: str, line: int, tmp_path: Path) -> None:
    assert complaint(text, tmp_path).startswith(f"cell.toml:{line}: ")


def test_a_rotor_is_locked_for_fractions_of_a_second() -> None:
    found = cell.read(drive("[bus.drive.world]\nlocked = [[0.25, 1.5], [3, 3.125]]"), "cell.toml")
    assert found.buses[0].drives[0].world.locked == ((0.25, 1.5), (3.0, 3.125))


def test_what_is_not_toml_says_where() -> None:
    assert complaint("seed = ") == "cell.toml: not TOML: Invalid value (at end of document); correct the line"
    assert complaint("[[[[" * 100_000).startswith("cell.toml:1: not TOML: ")
    assert complaint("a = " + "[" * 100_000).startswith("cell.toml:1: not TOML: ")
    assert complaint("seed = 1" + "0" * 5000).startswith("cell.toml:1: not TOML: ")


def test_a_file_without_a_bus_is_no_cell(tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text("seed = 7\n")
    with pytest.raises(Diagnostic, match=r"empty.toml: has no bus; each begins with \[\[bus\]\]"):
        cell.load(tmp_path / "empty.toml")


def test_a_file_that_is_not_there_or_no_text_is_told(tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="cannot be read"):
        cell.load(tmp_path / "none.toml")
    with pytest.raises(Diagnostic, match="cannot be read"):
        cell.load(tmp_path)
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(Diagnostic, match="not UTF-8 text"):
        cell.load(tmp_path / "bad.toml")


KEYS = [
    "seed",
    "bus",
    "name",
    "serve",
    "baud",
    "drive",
    "faults",
    "personality",
    "party",
    "set",
    "program",
    "program_text",
    "variables",
    "identity",
    "part",
    "version",
    "position",
    "C1",
    "Q1",
    "instruction_us",
    "world",
    "home",
    "limit_plus",
    "inputs",
    "analog",
    "flip",
    "drop",
    "delay",
    "hangup_after",
    "x",
    "y",
    "VM",
    "IS",
    "DN",
    "EM",
    "zzz",
]
scalars = st.one_of(
    st.integers(-(10**30), 10**30).map(str),
    st.floats().map(str),
    st.sampled_from(["true", "false", "2020-01-01", "10:00:00", "'LMDCM'", "'PMX'", "'a'", "'00'", "'pty:a'"]),
    st.sampled_from(["'tcp://:1'", "'udp://[::1]:0'", "'modbus://h:1'", '"\\u0000"', "'x:y'", "''"]),
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda each: f"[{', '.join(each)}]")
        | st.dictionaries(st.sampled_from(KEYS), inner, max_size=3).map(
            lambda each: "{" + ", ".join(f"{key} = {value}" for key, value in each.items()) + "}"
        )
    ),
    max_leaves=8,
)
heads = st.sampled_from(
    [
        "[[bus]]\nname = 'b'",
        "[[bus.drive]]\npersonality = 'LMDCM'",
        "[[bus.drive]]\npersonality = 'PMX'",
        "[bus.drive.world]",
        "[bus.drive.world.y]",
        "[bus.drive.set]",
        "[bus.drive.variables]",
        "[bus.drive.identity]",
        "[bus.faults]",
    ]
)
lines = st.one_of(heads, st.builds(lambda key, value: f"{key} = {value}", st.sampled_from(KEYS), values))


@given(st.one_of(st.text(), st.lists(lines, max_size=12).map("\n".join)))
def test_any_text_is_a_cell_or_a_diagnostic_of_one_line(text: str) -> None:
    try:
        cell.read(text, "cell.toml")
    except Diagnostic as diagnostic:
        assert "\n" not in str(diagnostic)
        assert str(diagnostic).startswith("cell.toml:")


@pytest.mark.parametrize("path", ["../x", "/etc/passwd", "a/../../x", pytest.param("out/x", marks=pytest.mark.fork)])
def test_a_path_that_leaves_the_folder_of_the_cell_is_refused(tmp_path, path):
    (tmp_path / "cell" / "a").mkdir(parents=True)
    (tmp_path / "cell" / "out").symlink_to(tmp_path)
    (tmp_path / "x").write_text("")
    drive = '[[bus.drive]]\npersonality = "LMDCM"\n'
    for text in (f'[[bus]]\nname = "p"\nserve = ["pty:{path}"]\n', f'[[bus]]\nname = "p"\n{drive}program = "{path}"\n'):
        with pytest.raises(
            Diagnostic, match="leaves the folder of the cell file; use a path inside it.*sim CELL --allow"
        ):
            cell.read(text, "cell.toml", tmp_path / "cell")


@pytest.mark.parametrize("allowed", ["x", ".", pytest.param("link", marks=pytest.mark.fork)])
def test_a_path_that_the_person_allows_may_leave_the_folder_of_the_cell(tmp_path, allowed):
    (tmp_path / "cell").mkdir()
    (tmp_path / "x").write_text("PG 1\n")
    (tmp_path / "link").symlink_to(tmp_path)
    allow = [tmp_path / allowed]
    drive = f'[[bus.drive]]\npersonality = "LMDCM"\nprogram = "{tmp_path.as_posix()}/x"\n'
    found = cell.read(f'[[bus]]\nname = "p"\n{drive}', "cell.toml", tmp_path / "cell", allow)
    assert found.buses[0].drives[0].program == "PG 1\n"
    found = cell.read('[[bus]]\nname = "p"\nserve = ["pty:../x"]\n', "cell.toml", tmp_path / "cell", allow)
    assert found.buses[0].serve[0].path == tmp_path / "cell" / ".." / "x"
    with pytest.raises(Diagnostic, match=r"leaves the folder.*--allow '?/etc/"):
        cell.read('[[bus]]\nname = "p"\nserve = ["pty:/etc/x"]\n', "cell.toml", tmp_path / "cell", allow)


@pytest.mark.fork
def test_a_link_that_is_there_is_allowed_by_its_own_name(tmp_path):
    (tmp_path / "cell").mkdir()
    (tmp_path / "line.tty").symlink_to("/dev/pts/99")  # of a server that was killed
    text = f'[[bus]]\nname = "p"\nserve = ["pty:{tmp_path.as_posix()}/line.tty"]\n'
    found = cell.read(text, "cell.toml", tmp_path / "cell", [tmp_path / "line.tty"])
    assert found.buses[0].serve[0].path == tmp_path / "line.tty"
    (tmp_path / "cell" / "inside").symlink_to("/etc/passwd")
    with pytest.raises(Diagnostic, match="leaves the folder"):
        text = '[[bus]]\nname = "p"\n[[bus.drive]]\npersonality = "LMDCM"\nprogram = "inside"\n'
        cell.read(text, "cell.toml", tmp_path / "cell", [tmp_path / "line.tty"])


def test_a_path_inside_the_folder_of_the_cell_may_be_absolute(tmp_path):
    (tmp_path / "a").mkdir()
    found = cell.read(
        f'[[bus]]\nname = "p"\nserve = ["pty:{tmp_path.as_posix()}/a/x.tty", "pty:a/y.tty", "pty:"]\n', "c", tmp_path
    )
    assert [each.path and each.path.name for each in found.buses[0].serve] == ["x.tty", "y.tty", None]
