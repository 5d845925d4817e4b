"""A whole floor under one virtual time, and the words of `/sim`."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor

CELL = """
[[bus]]
name = "press"
baud = 9600
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 1 }
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
set = { EM = 1 }
[[bus]]
name = "saw"
[[bus.drive]]
personality = "LMDCM"
name = "b"
set = { EM = 1 }
"""


def floor() -> Floor:
    return Floor(read(CELL))


def run(each: Floor, until: float) -> dict[str, bytes]:
    """Step from deadline to deadline; what each bus's endpoints hear."""
    heard: dict[str, bytes] = {}
    while (at := each.deadline) is not None and at <= until:
        for bus, data in each.advance(at).items():
            heard[bus] = heard.get(bus, b"") + data
    return heard


def ask(each: Floor, bus: str, data: bytes, now: float) -> bytes:
    each.wires[bus].receive(data, now)
    return run(each, now + 1.0).get(bus, b"")


def test_buses_live_under_one_time_and_do_not_hear_each_other() -> None:
    each = floor()
    each.wires["press"].receive(b"\nbPR P\n", 0.0)
    each.wires["saw"].receive(b"PR P\r", 0.0)
    assert each.advance(0.0) == {"saw": b"\r\n0\r\n"}
    assert run(each, 1.0) == {"press": b"\r\n0\r\n"}


def test_nobody_has_heard_the_power_up() -> None:
    assert run(floor(), 1.0) == {}


def test_a_move_takes_the_floors_time() -> None:
    each = floor()
    assert ask(each, "saw", b"MR 51200\r", 0.0) == b"\r\n"
    each.advance(10.0)
    assert ask(each, "saw", b"PR P\r", 10.0) == b"\r\n51200\r\n"


def test_inputs_can_be_held_high_and_low_and_let_go() -> None:
    each = floor()
    for text, level in (("/sim input press:b 1 0", 0), ("input press:b 1 1", 1), ("/sim input press:b 1 open", None)):
        each.command(text, 0.5)
        assert each.place("press:b", "")[0].world.level(1, 0.5) is level
    assert each.place("saw:b", "")[0].world.level(1, 0.5) is None


def test_an_input_moves_what_the_drive_reads() -> None:
    each = floor()
    ask(each, "saw", b"IS=1,0,1\r", 0.0)
    assert ask(each, "saw", b"PR I1\r", 0.2) == b"\r\n0\r\n"
    each.command("/sim input saw:b 1 1", 1.5)
    assert ask(each, "saw", b"PR I1\r", 1.5) == b"\r\n1\r\n"


def test_the_analog_input_and_a_push_reach_the_world() -> None:
    each = floor()
    each.command("/sim analog a 2048", 1.0)
    each.command("/sim push a -100", 1.0)
    world = each.place("a", "")[0].world
    assert (world.analog(1.0), world.pushed) == (2048, -100)


def test_a_drive_without_power_is_silent_and_comes_back_as_it_was_saved() -> None:
    each = floor()
    each.command("/sim power press:b off", 1.0)
    assert ask(each, "press", b"\nbPR P\n", 1.0) == b""
    assert ask(each, "press", b"\naPR P\n", 2.0) == b"\r\n0\r\n"
    each.command("/sim power press:b on", 3.5)
    run(each, 4.5)
    assert ask(each, "press", b"\nbPR P\n", 5.0) == b"\r\n0\r\n"


@pytest.mark.parametrize("hands", [("input press:b 1 0",), ("power press:b off", "power press:b on")])
def test_a_party_drive_that_began_anew_waits_for_a_lf_whatever_made_it(hands: tuple[str, ...]) -> None:
    each = floor()
    ask(each, "press", b"\nbIS=1,11,0\nbS\n", 0.0)
    assert ask(each, "press", b"bPR P\n", 2.0) == b"\r\n0\r\n"
    for hand in hands:
        each.command(f"/sim {hand}", 4.0)
    assert ask(each, "press", b"bPR P\n", 6.0) == b""
    assert ask(each, "press", b"bPR P\n", 8.0) == b"\r\n0\r\n"


def test_an_unplugged_bus_hangs_up_and_a_plugged_one_is_back() -> None:
    each = floor()
    each.command("/sim unplug saw", 0.0)
    assert each.wires["saw"].hung_up and ask(each, "saw", b"PR P\r", 0.0) == b""
    each.command("/sim plug saw", 0.5)
    assert not each.wires["saw"].hung_up and ask(each, "saw", b"PR P\r", 2.0) == b"\r\n0\r\n"


@pytest.mark.parametrize(
    "text,says",
    [
        ("/sim", "no command; valid: input DRIVE N 0|1|open"),
        ("/sim shake b", 'no command "shake"'),
        ("/sim input b 1", "wrong number of words"),
        ("/sim input b 1 0", '"b" is on several buses; valid: press:b, saw:b'),
        ("/sim input z 1 0", 'no drive "z"; valid: press:a, press:b, saw:b'),
        ("/sim input saw:a 1 0", 'no drive "saw:a"'),
        ("/sim input a 5 0", 'no input "5"; valid: 1 to 4'),
        ("/sim input a ² 0", 'no input "²"'),
        ("/sim input a 1 2", 'no level "2"'),
        ("/sim push a.y 1", '"a" has no axis "y"; it has one axis: write "a"'),
        ("/sim analog a 4096", 'no analog value "4096"; valid: 0 to 4095'),
        ("/sim push a 1.5", 'no push "1.5"'),
        ("/sim power a maybe", 'no state "maybe"; valid: on, off'),
        ("/sim unplug mill", 'no bus "mill"; valid: press, saw'),
        ("/sim plug a", 'no bus "a"'),
    ],
)
def test_wrong_words_are_one_line_that_says_what_to_say(text: str, says: str) -> None:
    each = floor()
    with pytest.raises(Diagnostic) as error:
        each.command(text, 1.0)
    assert says in str(error.value) and "\n" not in str(error.value)
    assert not any(wire.hung_up for wire in each.wires.values())
    assert all(drive.world.level(1, 1.0) is None and drive.device.powered for drive in each.drives)


def test_a_setting_that_a_pmx_refuses_is_named() -> None:
    with pytest.raises(Diagnostic, match="set HSPD = -1 is refused: .Invalid Answer"):
        Floor(read('[[bus]]\nname = "mill"\n[[bus.drive]]\npersonality = "PMX"\nset = { HSPD = -1 }\n'))


def test_the_axes_of_a_pmx_have_worlds_of_their_own() -> None:
    each = Floor(read('[[bus]]\nname = "mill"\n[[bus.drive]]\npersonality = "PMX"\n'))
    each.command("/sim push 00 10", 0.0)
    each.command("/sim push mill:00.y -20", 0.0)
    each.command("/sim analog 00.y 5000", 0.0)
    each.command("/sim lock 00.y on", 0.0)
    each.command("/sim input 00 8 0", 0.0)
    assert ask(each, "mill", b"EX\rEY\rAI1\rAI2\rDI\rX5\rY5\r", 0.0) == b"10\r-20\r0\r5000\r128\rOK\rOK\r"
    assert ask(each, "mill", b"EX\rEY\rPY\r", 1.0) == b"15\r-20\r5\r"
    each.command("/sim supply 00 off", 2.0)
    assert ask(each, "mill", b"X0\r", 2.0) == b"OK\r"
    assert ask(each, "mill", b"PX\rEX\r", 3.0) == b"0\r15\r"
    with pytest.raises(Diagnostic, match='"00" has no axis "z"; valid: 00.x, 00.y'):
        each.command("/sim push 00.z 1", 3.0)
    with pytest.raises(Diagnostic, match="1 to 8"):
        each.command("/sim input 00 9 0", 3.0)


def test_a_module_of_several_motors_has_surroundings_for_each() -> None:
    each = Floor(read('[[bus]]\nname = "axis"\n[[bus.drive]]\npersonality = "TMCM-3110"\nname = "1"\n'))
    each.command("/sim push 1.2 100", 0.0)
    each.command("/sim input 1 8 1", 0.0)
    with pytest.raises(Diagnostic, match='"1" has no axis "3"; valid: 1.0, 1.1, 1.2'):
        each.command("/sim push 1.3 100", 0.0)
    with pytest.raises(Diagnostic, match="valid: 1 to 8"):
        each.command("/sim input 1 9 1", 0.0)
