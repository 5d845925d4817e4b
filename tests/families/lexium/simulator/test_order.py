"""Whatever the inputs do and the program is: it does not matter in how many steps time passes, and nothing raises."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.support.examples import examples

pytestmark = pytest.mark.slow

STORY = """PG 1
LB G1
PR "go ",P
TI=4,K1
TE=1
OE K3
LB G2
MR 3000
H
H 20
IC R1
BR G2,R1<4
R1=0
VM=5
E
LB K1
PR "trip ",PC
TE=1
RT
LB K3
PR "error ",ER
RT
PG"""
KINDS = st.sampled_from([0, 2, 4, 5, 6, 7, 11])
SETUPS = st.lists(KINDS, min_size=3, max_size=3)
CHANGES = st.lists(st.tuples(st.integers(0, 300), st.integers(1, 4), st.integers(0, 1)), max_size=12)
TIMES = st.lists(st.floats(0.0, 3.0), max_size=30)


def drive(kinds, changes, d5):
    world = WorldSpec(
        inputs=tuple((at / 100 + 0.003, n, level) for at, n, level in sorted(changes)),
        analog=((0.0, 100), (0.5, 4000), (1.7, 0)),
    )
    device = MCodeDevice(DriveSpec(program=STORY, world=world), World(world))
    for n, kind in enumerate(kinds, 1):
        device.execute(f"IS={n},{kind},0", 0.0)
    for line in ("D1=7", f"D5={d5}", "JE=1", "OS=1,17,1", "OS=2,29,1", "AO=49665", "EX G1"):
        device.execute(line, 0.0)
    return device


@examples(30, nightly=300)
@given(SETUPS, CHANGES, TIMES, st.sampled_from([0, 50]))
def test_steps_of_time_do_not_matter(kinds, changes, times, d5):
    whole, stepped = (drive(kinds, changes, d5) for _ in range(2))
    for now in sorted(times):
        stepped.advance(now)
    whole.advance(3.0)
    stepped.advance(3.0)
    assert stepped.prints() == whole.prints()
    assert stepped.outputs(3.0) == whole.outputs(3.0)
    assert stepped.position(3.0) == whole.position(3.0)
    assert stepped.memory.values == whole.memory.values
    assert abs(stepped.motor.inputs.analog(3.0) - whole.motor.inputs.analog(3.0)) <= 1


WORDS = tuple(
    [
        "IS=1,5,0",
        "IS=2,6,0",
        "IS=3,7,0",
        "IS=4,8,0",
        "IS=1,4,0",
        "IS=1,11,0",
        "JE=1",
        "OS=1,29,1",
        "OS=3,28,1",
        "AO=49665",
        "O1=1",
        "OT=7",
        "D1=20",
        "D5=100",
        "PR I5",
        "PR OS",
        "PG 1",
        "PG",
        "LB G1",
        "LB G2",
        "EX G1",
        "EX G1,1",
        "EX G1,2",
        "BP G2,2",
        "BP",
        "BP=0",
        "BR G1",
        "CL G2",
        "RT",
        "E",
        "H 10",
        "H",
        "SL 5000",
        "MR 900",
        "MA 0,1,1",
        "PS",
        "RS",
        "IV R1",
        "12",
        "OE G2",
        "TE=1",
        "TI=1,G2",
        "S",
        "FD",
        "IP",
        "CP",
        "VM=5",
        "XX=1",
        "PR ER",
        "EE=1",
        "EE=0",
        "AS=1",
        "HM 1",
        "LM=3",
        "ES=2",
        "PR AL",
    ]
)
HANDS = st.tuples(st.integers(1, 4), st.integers(0, 1))


@examples(40, nightly=600)
@given(st.lists(st.sampled_from(WORDS) | HANDS | st.sampled_from(["esc", "^c", " ", "\r", "off", "on"]), max_size=30))
def test_no_story_makes_a_drive_raise(story):
    device = drive([0, 0, 0], [], 0)
    for number, each in enumerate(story):
        now = number * 0.05
        if isinstance(each, tuple):
            device.advance(now)
            device.world.set_input(each[0], each[1], now)
        elif each in WORDS:
            device.execute(each, now)
        elif each in ("esc", "^c"):
            (device.escape if each == "esc" else device.reset)(now)
        elif each in ("off", "on"):
            device.power(each == "on", now)
        else:
            device.step(each, now)
        device.outputs(device.now)
    device.advance(10.0)
    device.prints()
