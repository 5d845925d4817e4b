"""Programs of the kind that the manual's section 9 shows, with its figures: each does what that section says of it."""

from tests.support.sample_programs import REVOLUTION, begin, load, printed, say

ON_INPUT = """
Is=1,0,0
Ms=256
Vi=200000
Vm=2500000
A=1000000
D=A
Hc=2
Rc=75
P=0
PG 1
LB Ga      'start here
  P=0
LB G1
  CL Kb,I1=1
  H 10
  BR G1
E
' out and back
LB Kb
  MA 512000
  H
  MA 0
  H
  RT
PG
S
"""


def test_a_move_on_an_input_goes_there_and_back_while_it_is_active():
    device = load(ON_INPUT, inputs=((0.5, 1, 0), (1.5, 1, 1)))
    say(device, "EX Ga")
    device.advance(0.49)
    assert not device.moving(0.49)
    device.advance(0.6)
    there = device.motor.axis.profile
    assert there.target == 512000
    device.advance(there.end + 0.01)
    assert device.motor.axis.profile.target == 0
    device.advance(20.0)
    assert say(device, "PR P", "PR MV", "PR BY", "PR ER") == ["0", "0", "1", "0"]


def test_labels_and_addresses_start_the_same_program():
    assert say(load(ON_INPUT), "EX 1", "PR BY") == ["1"]


# 9.2: the velocity changes during a move, by position trips.

ON_THE_FLY = """
Hc=20
Rc=100
PG 1
LB Ga
Vi=20000
Vm=500000
A=500000
D={rate}
R1=0
R2=0
LB Gx
P=0
Tp=51200,Kb
Te=2
SL 101200
H
H 250
IC R1
R2=R2+P
BR Gx,R1<10
R2=R2/100
PR "On average it ends at ",R2
E
LB Kb
SL 202400
Tp=102290,Kc
Te=2
RT
LB Kc
SL 0
H
RT
PG
S
"""


def test_a_velocity_is_changed_during_a_move_ten_times_alike():
    device = load(ON_THE_FLY.format(rate=800000000))
    say(device, "EX Ga")
    device.advance(0.8)
    assert device.velocity(0.8) > 101200
    (line,) = printed(device, 60.0)
    assert abs(int(say(device, "PR P")[0]) - 102315) <= 10
    assert line.startswith("On average it ends at ") and abs(int(line.split()[-1]) - 10231) <= 2


def test_a_deceleration_out_of_range_is_an_error_when_its_line_runs():
    device = load(ON_THE_FLY.format(rate=8000000000))
    say(device, "EX Ga")
    device.advance(0.01)
    assert say(device, "PR D", "PR ER") == ["1000000", "21"]
    assert len(printed(device, 60.0)) == 1


# 9.3: what three inputs say together chooses a subroutine.

MASK = (
    """
Is=1,0,0
Is=2,0,0
Is=3,0,0
Is=4,0,0
Os=1,16,0
Vi=20000
Vm=1000000
A=500000
D=A
Hc=20
Rc=75
PG 1
LB Su
  P=0
LB G1
  R1=In
  R1=R1 & 7
  O1=0
"""
    + "".join(f"  CL K{n},R1 = {n}\n" for n in range(8))
    + """  H 10
  BR G1
  E
LB K0
  PR "All low"
  MR R1*51200
  H
  O1=1
  H 2000
  RT
"""
    + "".join(f'LB K{n}\n  PR "Bits {n:03b}"\n  MR R1*51200\n  H\n  H 200\n  RT\n' for n in range(1, 8))
    + "PG\nS\n"
)


def test_a_binary_mask_of_inputs_turns_as_often_as_it_weighs():
    levels = ((0.0, 1, 0), (0.0, 2, 0), (0.0, 3, 0), (0.0, 4, 1), (1.0, 1, 1), (1.0, 3, 1))
    device = load(MASK, inputs=levels)
    begin(device)
    assert printed(device, 0.5) == ["All low"]
    assert device.outputs(0.5)[1]
    assert printed(device, 2.5) == ["Bits 101"] and not device.outputs(2.5)[1]
    assert device.motor.axis.profile.target == 5 * REVOLUTION


def test_inputs_that_nobody_drives_are_high():
    device = load(MASK)
    begin(device)
    assert printed(device, 0.1) == ["Bits 111"]


# 9.4: the encoder's counts, a loop, and an error handler that compares the counters.

CLOSED = """
Rc=80
Mt=50
As = 0
Ee=1
Sf=15
Sm=0
A=20000
D=A
Vi=2048
Vm=15000
VA Q1
PG 1
LB Ga
    OE K1
    P=0
LB Gb
    MR 51200
    H
    H 500
    MR -51200
    H
    H 500
    IC Q1
    BR Gb,Q1<100
    CL K1
E
LB k1
    R3=C1/25
    R1=R3 - C2
    PR "Off by ",R1
    PR "Code ",Er
    Er=0
    H 20
    RT
PG
S
"""


def test_a_closed_loop_program_comes_back_a_hundred_times():
    device = load(CLOSED)
    say(device, "EX Ga")
    device.advance(4.1)
    assert say(device, "PR P") == ["51200"]
    assert printed(device, 2000.0) == ["Off by 0", "Code 0"]
    assert say(device, "PR Q1", "PR BY", "PR P") == ["100", "0", "0"]


# 9.5: numbers from a person.

ASKING = """
Ms=256
Vi=200000
Vm=2500000
A=1000000
D=A
Hc=10
Rc=75
VA K1=0
VA K2=0
VA K3=51200
VA K4=0
PG 1
  LB Su
  P=-0
  PR "Here is home"
  H 2000
  LB Z1
    PR "How many turns?"
    IV K1
    LB X1
    BR X1, If=1
    H 50
  LB X4
    PR "Which way, 0 minus or 1 plus?"
    IV K2
    LB X2
    BR X2, If=1
    H 50
    BR Y1,K2=0
    BR Y2, K2=1
    PR "No such way"
    BR X4
LB X6
  VA K5
  K5=P/K3
  PR "The axis stands at ", K5, " from home"
  H 3000
LB X5
  PR "Again (1) or not (0)?"
  IV K4
  LB X3
  BR X3, If=1
  BR Z1, K4=1
  BR Z2, K4=0
  PR "No such choice"
  BR X5
LB Y1
  MR -K3*K1
  H
  BR X6
LB Y2
  MR K3*K1
  H
  BR X6
LB Z2
PR "Over"
E
PG
S
"""


def test_a_program_asks_a_person_and_does_what_it_is_told():
    device = load(ASKING)
    begin(device)
    assert printed(device, 3.0) == ["Here is home", "How many turns?"]
    assert say(device, "PR IF", "5", "PR IF") == ["1", "0"]
    assert printed(device, 4.0) == ["Which way, 0 minus or 1 plus?"]
    say(device, "7")
    assert printed(device, 5.0) == ["No such way", "Which way, 0 minus or 1 plus?"]
    say(device, "0")
    assert printed(device, 20.0) == ["The axis stands at -5 from home", "Again (1) or not (0)?"]
    say(device, "1")
    assert printed(device, 21.0) == ["How many turns?"]
    say(device, "2")
    device.advance(21.1)
    say(device, "1")
    assert printed(device, 40.0)[1:] == ["The axis stands at -3 from home", "Again (1) or not (0)?"]
    say(device, "3")
    assert printed(device, 41.0) == ["No such choice", "Again (1) or not (0)?"]
    say(device, "0")
    assert printed(device, 42.0) == ["Over"] and not device.running
    assert say(device, "PR UV")[:5] == ["K1 = G 2", "K2 = G 1", "K3 = G 51200", "K4 = G 0", "K5 = L -3"]


# 9.6: home to a switch, with the encoder, then moves that an input holds back.
