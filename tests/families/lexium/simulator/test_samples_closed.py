"""Programs of the kind of the samples 9.6 to 9.11: homing, trips, teaching, analog speed, stalls, ways out and back."""

import pytest

from tests.support.sample_programs import REVOLUTION, begin, load, printed, say

HOMING = """
Ee=1
Vm=4096
Vi=Vm/50
A=20480
D=A
Hc=50
Rc=50
Mt=50
Sf=20
Sm=0
Db=5
Is = 1, 1, 0 'home
Is = 2, 0, 1 'anything
Os = 1, 17, 1 'moving
Os = 2, 18, 1 'error
D1=100
PG 1
LB G1
  H 1000
  PR C1 ,C1
  PR C2 ,C2
  Pm=1
  PR "Steps: " C1
  PR "Counts: " C2
  H 5000
  HM 1
  H
  P=0
LB G2
  BR G2,I2=1
  MR 7186
  H
  PR "Position: " P
  BR G2
E
PG
S
"""


def test_homing_finds_the_switch_and_then_it_moves_step_by_step():
    device = load(HOMING, home=-100000, inputs=((60.0, 2, 1),))
    say(device, "EX G1")
    assert printed(device, 7.0)[:4] == ["00", "00", "Steps: 0", "Counts: 0"]
    assert device.outputs(7.0) == {1: True, 2: False, 3: False}
    lines = printed(device, 50.0)
    assert lines[:3] == ["Position: 7186", "Position: 14372", "Position: 21558"]
    zero = device.motor.axis.position(50.0) - int(say(device, "PR P")[0]) * 12.8
    assert abs(zero + 100000) < 3000  # it is where the switch is, but for the filter
    device.advance(63.0)
    device.prints()
    assert say(device, "PR ER") == ["0"]
    assert printed(device, 90.0) == [] and not device.moving(90.0)


# 9.7: an input trip runs a short profile four times.

TRIPPED = """
VA Q1
D1=255
PG 1
LB G1
  Ti = 1, X1
  Te = 1
  LB G2
  Q1 = 0
  BR G2
E
LB X1
  IC Q1
  MR 51200
  H
  MR -51200
  H
  BR X1, Q1 < 4
  Te = 1
  RT
  E
PG
S
"""


def test_an_input_trip_runs_its_profile_four_times_and_again():
    device = load(TRIPPED, inputs=((1.0, 1, 0), (1.1, 1, 1), (2.0, 1, 0), (3.0, 1, 1), (20.0, 1, 0)))
    say(device, "EX G1")
    device.advance(2.25)
    assert say(device, "PR MV", "PR TE") == ["0", "1"]  # the filter has swallowed the first touch
    starts = set()
    for tick in range(226, 1900):
        device.advance(tick / 100)
        if device.moving(tick / 100):
            starts.add(device.motor.axis.profile.start)
    assert len(starts) == 8
    assert say(device, "PR P", "PR TE", "PR BY") == ["0", "1", "1"]
    device.advance(20.5)
    assert say(device, "PR MV", "PR TE") == ["1", "0"]


# 9.8: two positions are taught by hand.

TEACH = """
VA Q1 = 0
VA Q2 = 0
D1 = 255
D2 = 255
As=0
Ee=1
PG 1
LB Su
  Er = 0
  C2=0
  Q1 = 0
  O2 = 0
  PR "Turn to the first place"
  PR "Then press 1"
LB X1
  BR X1, I1 = 0
  Q1 = C2
  PR Q1
LB X2
  BR X2, I1 = 1
  PR "Turn to the second place"
  PR "Then press 1"
LB X3
  BR X3, I1 = 0
  Q2 = C2
  PR Q2
LB X4
  BR X4, I1=1
  PR "Press 2 to begin"
LB X5
  BR X5, I2 = 0
  LB X6
  MA Q1
  H
  PR P
  H 250
  MA Q2
  H
  PR P
  H 250
  BR X5
E
PG
S
"""


def test_positions_are_taught_by_turning_the_shaft():
    presses = ((2.0, 1, 0), (3.0, 1, 1), (6.0, 1, 0), (7.0, 1, 1), (9.0, 2, 0))
    device = load(TEACH, inputs=presses)
    begin(device)
    assert printed(device, 1.0) == ["Turn to the first place", "Then press 1"]
    device.world.push(12800, 1.0)
    assert printed(device, 5.0) == ["1000", "Turn to the second place", "Then press 1"]
    device.world.push(-38400, 5.0)
    assert printed(device, 8.5) == ["-2000", "Press 2 to begin"]
    assert printed(device, 14.0)[:4] == ["1000", "-2000", "1000", "-2000"]


# 9.9: the analog input sets the velocity.

ANALOG = """
Os = 1, 20, 1
A=2000000
D=2000000
R4=80
PG 1
LB G1
  R1 = I5
  CL Z1
  SL R3
  H 10
  BR G1
E
LB Z1
  R1 = R1-2032
  R2 = 1
  BR Z2, R1>=0
  R2 = -1
  R1 = R1 * R2
LB Z2
  BR Z3, R1<R4
  R1 = R1 * 625
  R3 = R1 * R2
RT
LB Z3
  R3=0
RT
E
PG
S
"""


def test_the_analog_input_sets_a_velocity_either_way_with_a_dead_zone():
    device = load(ANALOG, analog=((0.0, 4095), (3.0, 2032 + 79), (6.0, 2032 - 80), (9.0, 0)))
    say(device, "EX G1")
    found = []
    for at in (2.9, 5.9, 8.9, 12.0):
        device.advance(at)
        found.append(device.velocity(at))
    assert found == [2063 * 625, 0, -80 * 625, -2032 * 625]
    assert not device.memory.error_flag


# 9.10: the analog input drives the motor until it stalls.

STALLING = """
As=0
Ee=1
Sf=30
PG 1
LB Su
  OE X1
  Er=0
  R1=I5
  R1=R1*50
  SL R1
  PR V
  H 250
  BR Su
E
LB X1
  PR "Code " Er
LB Y1
  BR Y2,Er <> 86
  PR "It stands"
LB Y2
  Er=0
E
PG
S
"""


def test_a_stall_ends_the_slew_by_its_error_handler():
    device = load(STALLING, analog=((0.0, 1000),), stall_at=300000)
    begin(device)
    lines = printed(device, 5.0)
    assert "50000" in lines and lines[-2:] == ["Code 86", "It stands"]
    assert not device.running and not device.moving(5.0)
    assert say(device, "PR ST", "PR EF") == ["1", "0"]


# 9.11: ten steps of velocity out and back, without a stop. The manual's text has lost the beginning: this one is made
# to fit what is left, a velocity SP of 33 turns a minute, a distance DS of a turn, and R1 which says that it is over.


def _step(n, speed, target, trip):
    return f"""LB X{n}
  PR "Step {n + 1} P=",P," V=",V
  Vm= {speed}
  MA {target},0,1
  Tp {trip},X{n + 1}
  Te=2
  RT
"""


STEPS = (
    """
VA SP=28160
VA DS=51200
PG 1
LB G1
  P=0
  R1=0
  Vm= SP
  PR "Step 1 P=",P," V=",V
  Tp Ds,X1
  Te=2
  MA Ds*9,0,1
LB G2
  H 10
  BR G2,R1=0
  PR "Over"
E
"""
    + _step(1, "Sp*2", "Ds*9", "Ds*3")
    + _step(2, "Sp*3", "Ds*9", "Ds*6")
    + _step(3, "Sp*2", "Ds*9", "Ds*8")
    + _step(4, "Sp", "Ds*9 ", "Ds*9")
    + _step(5, "Sp", "0", "Ds*8")
    + _step(6, "Sp*2", "0", "Ds*6")
    + _step(7, "Sp*3", "0", "Ds*3")
    + _step(8, "Sp*2", "0", "Ds")
    + """LB X9
  PR "Step 10 P=",P," V=",V
  Vm= Sp
  MA 0
  H
  PR "Back P=",P," V=",V
  R1=1
  RT
PG
S
"""
)


def test_velocities_change_on_the_way_out_and_back_without_a_stop():
    device = load(STEPS)
    say(device, "EX G1")
    lines = printed(device, 60.0)
    assert len(lines) == 12, lines
    turns = [0, 1, 3, 6, 8, 9, 8, 6, 3, 1]
    speeds = [0, 1, 2, 3, 2, 1, -1, -2, -3, -2]
    for n, (line, turn, speed) in enumerate(zip(lines, turns, speeds, strict=False), 1):
        step, _, rest = line.partition(" P=")
        place, _, velocity = rest.partition(" V=")
        assert step == f"Step {n}"
        assert int(place) == pytest.approx(turn * REVOLUTION, abs=100), line
        assert int(velocity) == pytest.approx(speed * 28160, abs=600), line
    assert lines[-2:] == ["Back P=0 V=0", "Over"]
    assert not device.running
