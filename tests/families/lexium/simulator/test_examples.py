"""The figures of the manual's own examples (sections 3.4, 5 and 7.2), as a terminal shows them."""

import pytest

from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from tests.support.lexium import drive


def typed(device, *lines):
    """What a terminal gets for each line typed; half a minute passes after every one."""
    port, now = MCodePort(device, serial=not device.memory.model.ethernet), device.now
    heard = []
    for line in lines:
        port.receive(line.encode() + b"\r", now)
        heard.append(port.advance(now).decode("latin-1"))
        now += 30.0
        device.advance(now)
        port.advance(now)
    return heard


def values(device, *lines):
    """The same, and of each answer only what was printed; `?` for a refusal."""
    out = []
    for line, heard in zip(lines, typed(device, *lines), strict=True):
        body = heard.removeprefix(line + "\r\n")
        out += ["?"] if body.endswith("?") else [row for row in body.removesuffix(">").split("\r\n") if row]
    return out


TURN = "VA Q1=51200"

EXAMPLES = [
    (["P=0", "MA 20000", "PR P", "MA 3000", "PR P"], ["20000", "3000"]),
    (["P=0", "MR 20000", "PR P", "MR 3000", "PR P", "MR -3000", "PR P"], ["20000", "23000", "20000"]),
    (["MA -51200", "PR P", "F1=AB P", "PR F1"], ["-51200", "51200.000000"]),
    (["F2=SQ 900000000.5", "SL=F2", "PR V", "SL 0"], ["30000"]),
    (["F5=1234.9", "MA F5", "PR P", "MA -F5", "PR P"], ["1234", "-1234"]),
    (["VA Q1=25", "PR Q1", "PR UV"], ["25", "Q1 = G 25"]),
    (["VA Q1=25", "VA Q2=30", "VA Q3=40", "R1=Q1+Q2+Q3", "PR R1", "R1=Q2-Q1", "PR R1"], ["95", "5"]),
    (["VA Q1=25", "VA Q2=30", "R1=Q1*Q2", "PR R1", "F1=Q2/Q1", "PR F1", "R1=Q2/Q1", "PR R1"], ["750", "1.200000", "1"]),
    (["R1=25", "R2=30", "R3=R1&R2", "PR R3", "R3=R1|R2", "PR R3", "R3=R1^R2", "PR R3"], ["24", "31", "7"]),
    (["R1=25", "R3=!R1", "PR R3"], ["-26"]),
    ([TURN, "F1=CS Q1", "PR F1", "F2=C_ F1", "PR F2"], ["-0.106072", "1.677068"]),
    ([TURN, "F1=SI Q1", "PR F1", "F2=S_ F1", "PR F2"], ["-0.994358", "-1.464524"]),
    ([TURN, "F1=TG Q1", "PR F1", "F1=T_ Q1", "PR F1"], ["9.374376", "1.570777"]),
    ([TURN, "F1=L_ Q1", "PR F1", "F1=LO Q1", "PR F1", "F1=SQ Q1", "PR F1"], ["4.709270", "15.643856", "226.274170"]),
    ([TURN, "F1=Q1*PI", "PR F1"], ["160849.543885"]),
    (["RA=0", "F1=SI 90", "PR F1", "F1=C_ 0", "PR F1", "F1=TG 45", "PR F1"], ["1.000000", "90.000000", "1.000000"]),
    (["F2=3.256", "PR F2", "R1=F2", "PR R1"], ["3.256000", "3"]),
    (["PR PF", "PF=8,4,1,1", "PR F1", "PR PF"], ["10,6,0,0", "0.0000E+00", "8,4,1,1"]),
    (["IS=1, 2, 1", "IS=2,0,1", "IS=3, 13, 0", "IS=6,0,1", "PR IS"],
     ["IS = 1, 2, 1", "IS = 2, 0, 1", "IS = 3, 13, 0", "IS = 4, 13, 0", "IS = 6, 0, 1"]),
    (["OS=1, 17, 1", "OS=3, 29", "PR OS"], ["OS = 1, 17, 1", "OS = 2, 16, 0", "OS = 3, 29, 0"]),
    (["D2=50", "PR D2", "D5=50", "PR D5", "FC=2", "PR FC", "CW=100", "PR CW"], ["50", "50", "2", "100"]),
    (["TI 1,2"], ["?"]),
    (["MS=1", "PR VI VM A"], ["43000" + "3906"]),
    (["MS=2", "PR VI", "PR VM", "PR A"], ["8", "6000", "7813"]),
    (['PR "Position = ",P', 'PR P, " motor steps\\r"'], ["Position = 0", "0 motor steps\r"]),
    (['DN="a"', "PR DN", "DN=a"], ['"a"', "?"]),
    (["EE=1", "MR 4000", "PR P", "PR C1", "PR C2"], ["4000", "51200", "4000"]),
    (["HT=200", "MT=300", "PR HT MT", "WT=75", "PR WT"], ["200300", "75"]),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "printed"), EXAMPLES, ids=lambda each: each[0])
def test_an_example_of_the_manual_prints_what_it_says(lines, printed):
    assert values(drive(), *lines) == printed


def test_a_terminal_shows_echo_answer_and_prompt():
    assert typed(drive(), "VM 5000", "PR VM", "XX=1", "PR ER") == [
        "VM 5000\r\n>",
        "PR VM\r\n5000\r\n>",
        "XX=1\r\n?",
        "PR ER\r\n20\r\n>",
    ]


def test_a_program_is_typed_listed_and_run():
    device = drive()
    assert typed(device, "PG 100", "LB M1", "MR 20000", "H", "MR -20000", "H", "E", "PG") == [
        "PG 100\r\n100  ", "LB M1\r\n105  ", "MR 20000\r\n110  ", "H\r\n112  ", "MR -20000\r\n117  ", "H\r\n119  ",
        "E\r\n121  ", "PG\r\n>",
    ]  # fmt: skip
    assert typed(device, "L") == [
        "L\r\n100  LB M1\r\n105  MR 20000\r\n110  H\r\n112  MR -20000\r\n117  H\r\n119  E\r\n>"
    ]
    device.execute("EX M1", device.now)
    device.advance(device.now + 0.25)
    assert device.position(device.now) > 0
    device.advance(device.now + 5.0)
    assert device.position(device.now) == 0 and not device.running


def test_an_analog_input_chooses_between_two_places():
    """7.2.6: below 500 counts one way, above 524 the other."""
    device = drive(analog=((0.0, 400), (2.0, 510), (4.0, 600)))
    for line in (
        "IS=5,9,0", "PG 100", "LB A1", "CL A2, I5<500", "CL A3, I5>524", "BR A1",
        "LB A2", "MA 2000", "H", "RT", "LB A3", "MA -2000", "H", "RT", "E", "PG", "EX 100",
    ):  # fmt: skip
        assert not device.execute(line, 0.0).refused
    places = []
    for at in (1.9, 3.9, 5.9):
        device.advance(at)
        places.append(device.position(at))
    assert places == [2000, 2000, -2000]


def test_conditions_are_written_as_people_write_them():
    device = drive()
    for line in (
        "PG 1", "LB G1", "BR L5, IN=07", "CL K3, IN = 15", "BR L2, I5=<2048", "LB L5", 'PR "wrong"', "LB L2",
        'BR L3, R1 <>0', 'PR "right"', "LB L3", "E", "LB K3", 'PR "called"', "RT", "PG", "EX G1",
    ):  # fmt: skip
        assert not device.execute(line, 0.0).refused
    device.advance(1.0)
    assert [text for _, text in device.prints()] == ["called\r\n", "right\r\n"]
