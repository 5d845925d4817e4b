"""Every error code of the manual's section 10: how the simulated drive comes to it, or why it never does."""

import pytest

from multidrop.families.lexium.manual.errors import TEXTS
from multidrop.families.lexium.manual.table import MNEMONICS
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.support.cases import for_each
from tests.support.lexium import drive, say

NESTED = "PG 1;LB G1;CL G1;E;PG"
LOOP = "PG 1;LB G1;IC R1;BR G1;PG"
TRIPS = "PG 1;LB K1;RT;PG"
NAMES = ";".join(f"VA {name}" for name in [f"{letter}{n:02}" for letter in "QW" for n in range(100)][:193])

CODES = {
    0: ("PR P", {}),
    6: ("IS=1,2,0;IS=2,2,0", {}),
    8: ("OS=2,28,0", {}),
    9: ("OS=1,17,0;O1=1", {}),
    10: ("IS=8,0,0", {}),
    11: ("FL=1", {}),
    12: (f"{TRIPS};TC=K1;TE=4", {}),
    20: ("XX=5", {}),
    21: ("EM=4", {}),
    22: ("VI=768000", {}),
    23: ("VM=1000", {}),
    24: ("VA FT", {}),
    25: ("MV=1", {}),
    26: ("IC MS", {}),
    27: ("TE=1", {}),
    28: ("VA Q1;VA Q1", {}),
    29: ("VA MV", {}),
    30: ("R1=ZZ", {}),
    31: (NAMES, {}),
    32: (f"{LOOP};G1=4", {}),
    33: ("S=1", {}),
    34: ("EX P", {}),
    35: ("PR MA", {}),
    36: ("EE=1;EL=2000;MS=1", {"personality": "LMM"}),
    37: ("PR EL", {}),
    38: ("IS=1 0 0", {}),
    39: (f"{TRIPS};TP=5,K1;TR=5,K1;TE=18", {}),
    40: ("PS", {}),
    41: (f"{LOOP};EX G1;PG 1", {}),
    42: ("EX 77", {}),
    43: (f"{NESTED};EX G1;@1", {}),
    44: ("LK=1;L", {}),
    45: ('PG 6380;PR "too long";PG', {}),
    46: ("RT", {}),
    48: (f"{LOOP};IS=1,5,0;EX G1;@1", {"inputs": ((0.5, 1, 0),)}),
    60: ("FOO", {}),
    61: ("BD=57", {}),
    62: ("PG 1;IV R1;IV R2;E;PG;EX 1;@1", {}),
    73: ("MR 512000;S", {}),
    74: ("MR 512000;IP", {}),
    76: ("MF=91", {}),
    77: ("MS=1;SL 10001", {}),
    80: ("HM 1", {}),
    83: ("IS=1,2,0;MR 512000;@5", {"limit_plus": 1000}),
    84: ("IS=1,3,0;MR -512000;@5", {"limit_minus": -1000}),
    85: ("MR 512000;IS=1,1,0;HM 1", {}),
    86: ("EE=1;MR 40000;@9", {"stall_at": 100000}),
    87: ("MR 512000;AS=1", {}),
    91: ("IS=1,5,0;MR 512000;@1", {"inputs": ((0.1, 1, 0),)}),
    94: ("DE=0;MR 5", {}),
    95: ("MR 512000;RD=1", {}),
}
ELSEWHERE = {79, 81, 82, 88, 89, 92, 93, 96, 98, 99, 100, 103, 104, *range(106, 111)}
"""Codes of motion and hMT, which have tests of their own where they are made."""
NEVER = {
    1: "overcurrent: nothing loads an output",
    2: "overcurrent: nothing loads an output",
    7: "no setting of a Lexium drive writes to an input",
    13: "the motor's phases are never overloaded",
    14: "nothing is on the module's enable input",
    47: "program addresses out of memory are 42",
    63: "the receiver is as fast as the wire",
    64: "only an MDrive Hybrid calibrates at power-up",
    65: "there is no SPI bus",
    70: "flash memory does not decay",
    71: "see the temperature",
    72: "see the temperature",
    75: "there is no power stage to fail",
    78: "the auxiliary supply is never wrong",
    90: "every VI and VM that is taken can be made; an MDrivePlus: test_simulator_mdi",
    97: "a slew below VI is taken, as clients use it",
    101: "the encoder is never put in the wrong way round",
    102: "the encoder is never put in the wrong way round",
    105: "lead and lag do not come to 31 bits in a simulated life",
    111: "nothing calibrates at the factory",
}


def run(script, personality="LMDCM", **world):
    """Carry out lines, or with @ wait until a time; the drive."""
    spec = WorldSpec(**world)
    device = MCodeDevice(DriveSpec(personality=personality), World(spec))
    for line in script.split(";"):
        if line.startswith("@"):
            device.advance(float(line[1:]))
        else:
            device.execute(line, device.now)
    return device


@for_each("code", CODES)
def test_an_error_comes_with_its_code(code):
    script, more = CODES[code]
    device = run(script, **more)
    assert device.memory.error_flag == bool(code)
    assert device.execute("PR ER", device.now).lines == (str(code),)
    assert device.execute("PR EF", device.now).lines == ("0",)


@for_each("code", [code for code in CODES if code])
def test_it_is_the_last_line_that_is_wrong(code):
    """Otherwise a case above would test some other line than it seems to."""
    script, more = CODES[code]
    lines = script.split(";")
    while lines[-1] in ("PG",) or lines[-1].startswith("@"):
        lines.pop()
    assert not run(";".join(lines[:-1]), **more).memory.error_flag


def test_no_code_has_been_forgotten():
    state = {code for texts in TEXTS.values() for code in texts}
    assert state == set(CODES) | {66} | ELSEWHERE | set(NEVER)


def test_a_line_that_is_too_long_is_error_20_and_is_not_carried_out():
    device = run("")
    port = MCodePort(device)
    port.receive(b"R1=" + b"0" * 60 + b"7\r", 0.0)
    assert device.execute("PR R1", 0.0).lines == ("7",)
    port.receive(b"R1=" + b"0" * 61 + b"8\rPR R1\r", 0.0)
    assert device.execute("PR R1", 0.0).lines == ("7",) and device.execute("PR ER", 0.0).lines == ("20",)
    assert b"?" in port.advance(0.0)


def test_sixty_four_characters_hold_name_and_checksum_too():
    device = run("R1=1")
    device.memory.values["PY"], device.memory.values["CK"] = 1, 1
    port = MCodePort(device)
    port.receive(b"\n", 0.0)

    def send(digits):
        text = b"!R1=" + b"0" * (digits - 1) + b"9"
        port.receive(text + bytes([-sum(text) & 0x7F | 0x80]) + b"\n", 0.0)
        return device.execute("PR R1", 0.0).lines[0]

    assert send(60) == "1"
    assert send(59) == "9"


@pytest.mark.parametrize(("baud", "code"), [(9600, "66"), (0, "0")])
def test_a_program_that_prints_faster_than_the_wire_loses_lines(baud, code):
    device = run('PG 1;LB G1;IC R1;PR "0123456789",R1;BR G1,R1<100;E;PG;EX 1')
    port = MCodePort(device, baud=baud)
    heard = port.advance(2.0).split(b"\r\n")
    lines = [line for line in heard if line.startswith(b"0123456789")]
    assert (len(lines) == 100) == (code == "0") and len(lines) >= 20
    assert device.execute("PR ER", 2.0).lines == (code,)


PROGRAM = "PG 1\nLB G1\nIC R1\nBR G1\nLB K1\nRT\nE\nPG"


STATES = {"rest": (), "moving": ("MR 1000000",), "running": ("EX G1",), "disabled": ("DE=0",), "counting": ("EE=1",)}


@pytest.mark.wide
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("personality", ["LMM", "LMDOM", "LMDCM"])
def test_a_product_has_no_errors_but_those_of_its_list(personality, state):
    known = TEXTS["LMM" if personality == "LMM" else "LMD"]
    for word in MNEMONICS:
        if word == "FD":
            continue
        device = drive(personality=personality, program=PROGRAM)
        say(device, *STATES[state])
        for arguments in ("", "=1", "=2", "=99999999999", " K1", " 1,2,3", " 5,K1", ' "a"'):
            device.execute(word + arguments, 0.01)
            device.core.mode.address = None
            assert device.memory.values["ER"] in known, word + arguments
