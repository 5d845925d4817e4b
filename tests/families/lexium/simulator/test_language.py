"""The simulated drive's language in immediate mode: variables, ranges, error codes, arithmetic, printing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.support.cases import for_each
from tests.support.examples import examples


def drive(personality="LMDCM", **spec):
    spec.setdefault("world", WorldSpec())
    return MCodeDevice(DriveSpec(personality=personality, **spec), World(spec["world"]))


def say(device, *lines):
    """Carry lines out; what they printed, and the code of each refusal as `?code`."""
    out = []
    for line in lines:
        answer = device.execute(line, device.now)
        out += answer.lines
        if answer.tail:
            out.append(answer.tail + "...")
        if answer.refused:
            out.append("?" + device.execute("PR ER", device.now).lines[0])
    return out


@for_each(
    ("line", "code"),
    [
        ("XX=5", 20),
        ("XX 5", 60),
        ("XX", 60),
        ("?", 60),
        ("VM=5000001", 21),
        ("VM=2560001", 21),
        ("VM=1000", 23),
        ("VI=768000", 22),
        ("VI=0", 21),
        ("A=65", 21),
        ("D=8000000000", 21),
        ("MS=3", 21),
        ("HT=65536", 21),
        ("SL 5000001", 21),
        ("SL 2560001", 77),
        ("BD=57", 61),
        ("MF=91", 76),
        ("MF=768001", 76),
        ("DN=65", 21),
        ('DN="ab"', 21),
        ("MV=1", 25),
        ("IN=3", 25),
        ("EF=0", 25),
        ("IC MV", 25),
        ("IC MS", 26),
        ("DC ZZ", 25),
        ("PR MA", 35),
        ("PR O1", 35),
        ("PR ZZ", 35),
        ("R1=ZZ", 30),
        ("EX ZZ", 30),
        ("EX P", 34),
        ("EX 1", 42),
        ("VM", 34),
        ("LB G1", 46),
        ("H", 46),
        ("CL G1", 46),
        ("BR 1", 40),
        ("PS", 40),
        ("RS", 40),
        ("PG", 46),
        ("PG 0", 42),
        ("TE=2", 27),
        ("TP=5", 38),
        ("IS=1 0 0", 38),
        ("IS=7,0,0", 10),
        ("IS=2,12,0", 8),
        ("IS=1,9,0", 8),
        ("OS=1,28,0", 8),
        ("VA MV", 29),
        ("VA FT", 24),
        ("VA I7", 24),
        ("VA Q1A", 24),
        ("VA A", 29),
        ("E=1", 33),
        ("S 1", 24),
        ("IF=1", 21),
        ("5", 60),
        ("R1=5/0", 24),
        ("PW=1,2,3,4", 20),
        ("EL=500", 37),
        ("S1=1,0,0", 20),
        ("OE ZZ", 30),
    ],
)
def test_a_refusal_has_its_code(line, code):
    assert say(drive(), line) == [f"?{code}"]


@pytest.mark.parametrize(
    ("personality", "line", "code"),
    [
        ("LMDCE", "PR BD", 37),
        ("LMDOE", "PY=1", 37),
        ("LMDCE", 'DN="a"', 37),
        ("LMDCE", "CK=1", 37),
        ("LMDCE", "DG=0", 37),
        ("LMDCE", "QD=1", 37),
        ("LMDOM", "AS=1", 37),
        ("LMDOM", "PR LL", 37),
        ("LMDOM", "SA=0.9", 37),
        ("MDI", "IS=1,0,0", 20),
    ],
)
def test_a_product_refuses_what_it_lacks(personality, line, code):
    assert say(drive(personality), line) == [f"?{code}"]


def test_a_word_that_a_product_leaves_free_is_a_name():
    assert say(drive("LMDCM"), "VA PW=7", "PR PW") == ["7"]
    assert say(drive("LMM"), "VA PW=7") == ["?29"]


@for_each(
    ("lines", "printed"),
    [
        (["VM 5000", "pr vm"], ["5000"]),
        (["VM=5000", "PR VM;"], ["5000..."]),
        (["D=A", "PR D"], ["1000000"]),
        (["VA Q1=25", "VA Q2=30", "VA Q3=40", "R1=Q1+Q2+Q3", "PR R1"], ["95"]),
        (["R1=25", "R2=30", "R3=R1&R2", "R4=R1^R2", "R1=R1|R2", "PR R3 R1 R4"], ["24317"]),
        (["R1=25", "R3=!R1", "PR R3"], ["-26"]),
        (["R1=-7", "R2=R1/2", "PR R2"], ["-3"]),
        (["R1=2147483647", "R1=R1+1", "PR R1"], ["-2147483648"]),
        (["R1=2147483648"], ["?21"]),
        (["R1=25", "R2=30", "F1=R2/R1", "PR F1"], ["1.200000"]),
        (["F1=2.9", "R1=F1", "F1=-2.9", "R2=F1", 'PR R1," ",R2'], ["2 -2"]),
        (["F1=LO 51200", "PR F1", "F2=L_ 1000", "PR F2"], ["15.643856", "3.000000"]),
        (["RA=0", "F1=SI 30", "PR F1", "F1=PI", "PR F1"], ["0.500000", "3.141593"]),
        (["F1=SQ -1"], ["?24"]),
        (["F1=1.5", "PF=8,4,1,1", "PR F1", "PF=10,2", "PR F1"], ["1.5000E+00", "      1.50"]),
        (["F1=1.5", "PF=10,6,0,0", "PR F1", "PF=8,2", "PF=10", "PR F1", "PR PF"], ["1.500000", "1.500000", "10,6,0,0"]),
        (["IC R1", "IC R1", "DC R1", "PR R1"], ["1"]),
        (['PR "Position = ",P', 'PR "V3="V'], ["Position = 0", "V3=0"]),
        (["PR MV ST I1"], ["000"]),
        (["PR 8"], ["8"]),
        (['PR "a\\tb"'], ["a\tb"]),
        (["PR VR"], ["LMDCM 6.002, Hw: 3.2"]),
        (["PR IS"], ["IS = 1, 0, 0", "IS = 2, 0, 0", "IS = 3, 0, 0", "IS = 4, 0, 0", "IS = 6, 0, 0"]),
        (["IS=3,13,0", "PR IS"], ["IS = 1, 0, 0", "IS = 2, 0, 0", "IS = 3, 13, 0", "IS = 4, 13, 0", "IS = 6, 0, 0"]),
        (["IS=6,1", "OS=1,17,1", "OS=3,29", "PR OS"], ["OS = 1, 17, 1", "OS = 2, 16, 0", "OS = 3, 29, 0"]),
        (["VA C0 = 51200", "VA a=-1", "PR UV"], ["A...", "C0 = G 51200", ""]),
        (["HT=65535", "MT=1"], ["?21"]),
        (["OT=5", "OS=1,17,0", "O1=1"], ["?9"]),
    ],
)
def test_transcripts(lines, printed):
    if "VA a=-1" in lines:
        printed = ["?29", *printed[1:]]
    assert say(drive(), *lines) == printed


def test_reading_er_clears_it_and_ef():
    device = drive()
    device.execute("XX=5", 0.0)
    assert say(device, "PR EF", "PR ER", "PR EF", "PR ER") == ["1", "20", "0", "0"]
    device.execute("XX=5", 0.0)
    assert say(device, "ER=0", "PR EF") == ["0"]


def test_parameters_are_listed_in_alphabetical_order_and_clear_nothing():
    device = drive()
    device.execute("XX=5", 0.0)
    lines = say(device, "PR AL")
    assert lines[-1] == "" and {"BD = 96", 'DN = "!"', "ER = 20", "VM = 768000", "IS = 1, 0, 0"} <= set(lines)
    names = [line.split(" = ")[0] for line in lines[:-1]]
    assert names == sorted(names)
    assert say(device, "PR EF") == ["1"]


@pytest.mark.parametrize(("ms", "vi", "vm", "a"), [(2, 8, 6000, 7813), (1, 4, 3000, 3906), (128, 500, 384000, 500000)])
def test_changing_ms_keeps_the_ratio_of_velocities(ms, vi, vm, a):
    device = drive()
    assert say(device, f"MS={ms}", "PR VI", "PR VM", "PR A", "PR D") == [str(vi), str(vm), str(a), str(a)]


def test_the_encoder_has_values_of_its_own():
    device = drive(set={"VM": 512000})
    assert say(device, "EE=1", "PR VI", "PR VM", "PR A", "MS=128", "VM=200001") == [
        "78",
        "60000",
        "78125",
        "?21",
        "?21",
    ]
    assert say(device, "EE=0", "PR VM") == ["512000"]


def test_names_run_out_at_192():
    device = drive()
    names = [f"{letter}{n}" for letter in "QW" for n in range(100)]
    names = [name for name in names if len(name) <= 3][:193]
    replies = say(device, *(f"VA {name}" for name in names))
    assert replies == ["?31"]


def test_a_bare_number_repeats_the_last_kind_of_move():
    device = drive()
    say(device, "MR 100", "NE=1")
    device.advance(5.0)
    assert say(device, "PR MD", "250") == ["MR"]
    device.advance(10.0)
    assert say(device, "PR P") == ["350"]


def test_settings_of_a_cell_are_those_at_power_up():
    device = drive(name="b", party=True, set={"EM": 1, "VI": 800000, "VM": 900000, "IS": ("1,1,0", "2,2,1")})
    assert (device.memory.name, device.memory.party, device.memory.echo_mode) == ("b", True, 1)
    assert say(device, "PR VI", "PR IS")[:3] == ["800000", "IS = 1, 1, 0", "IS = 2, 2, 1"]


def test_settings_that_the_drive_does_not_take_are_named():
    with pytest.raises(Diagnostic, match="EM=9: refused by an LMDCM: error 21"):
        drive(set={"EM": 9})


def test_a_program_that_the_drive_does_not_take_is_named_with_its_line():
    with pytest.raises(Diagnostic, match=r"^a\.mxt:2: XX=5"):
        drive(program="PG 1\nXX=5\nPG\n", program_name="a.mxt")


WORDS = (
    "A D VM VI MA MR SL EX E PG LB BR CL RT H PR S FD IP CP L IS OS TP TE TI VA IC DC OE R1 F1 P C1 C2 EE MS "
    'Q1 K1 G1 SU = , + - * / & ^ < > <> " \' ; ! 1 0 -5 51200 1.5 99999999999 DN "a" TR TT TC NE IV PS RS'
)
LINES = st.lists(st.sampled_from(tuple(WORDS.split())), max_size=7).map(" ".join)


@examples(100, nightly=1000)
@given(st.lists(LINES | st.text(max_size=20), max_size=12))
def test_no_text_makes_a_drive_raise(lines):
    device = drive(instruction_us=100000.0)
    for number, line in enumerate(lines):
        device.execute(line, number * 0.3)
    device.advance(10.0)
    device.prints()
