"""The simulated drive's motion, and programs of the shapes that the manual's samples have (7.3.5, 9.1, 9.2, 9.3)."""

import pytest

from multidrop.simulator.cell.spec import WorldSpec
from tests.support.lexium import output, say, switched_on

# Programs after the manual's samples.

ON_INPUT = """IS=1,0,0
VI=200000
VM=2500000
A=1000000
D=A
PG 1
LB Ga
P=0
LB G1
CL Kb,I1=1
H 10
BR G1
E
LB Kb
MA 512000
H
MA 0
H
RT
PG
S"""


def test_ten_turns_out_and_back_while_an_input_is_active():
    device = switched_on(ON_INPUT, world=WorldSpec(inputs=((1.0, 1, 0), (1.5, 1, 1))))
    say(device, "EX Ga")
    device.advance(1.0)
    assert device.position(1.0) == 0 and not device.moving(1.0)
    moves = set()
    while device.now < 10.0:
        device.advance(device.deadline)
        if device.moving(device.now):
            moves.add(device.motor.axis.profile)
    out, back = sorted(moves, key=lambda profile: profile.start)
    for profile in (out, back):
        peak = max(abs(segment.velocity) for segment in profile.segments)
        assert peak == pytest.approx(742967, abs=1)
        assert profile.end - profile.start == pytest.approx(1.0859, abs=1e-4)
    assert out.target == 512000 and device.position(10.0) == 0


def test_the_linear_move_of_the_application_notes():
    device = switched_on()
    say(device, "MA 3840000")
    assert device.motor.axis.profile.end == pytest.approx(5.766, abs=1e-3)
    device.advance(3.0)
    assert say(device, "PR V", "PR VC", "PR MV") == ["768000", "0", "1"]


def test_a_velocity_changed_by_position_trips():
    device = switched_on(
        """PG 1
        LB Ga
        VI=20000
        VM=500000
        A=500000
        D=800000000
        R1=0
        R2=0
        LB Gx
        P=0
        TP=51200,Kb
        TE=2
        SL 101200
        H
        H 250
        PR P
        IC R1
        R2=R2+P
        BR Gx,R1<10
        R2=R2/100
        PR "mean ",R2
        E
        LB Kb
        SL 202400
        TP=102290,Kc
        TE=2
        RT
        LB Kc
        SL 0
        H
        RT
        PG"""
    )
    say(device, "EX Ga")
    ends = output(device, 60.0).split("|")
    assert ends[10] == "mean 10231" and not device.running
    assert all(abs(int(end) - 102315) <= 1 for end in ends[:10])


def test_the_inputs_choose_a_subroutine():
    turns = "".join(f'LB K{n}\nPR "logic {n}"\nMR R1*51200\nH\nH 200\nRT\n' for n in range(8))
    calls = "".join(f"CL K{n},R1 = {n}\n" for n in range(8))
    world = WorldSpec(inputs=((0.0, 1, 1), (0.0, 2, 0), (0.0, 3, 0), (2.0, 1, 0)))
    device = switched_on(
        f"VM=1000000\nPG 1\nLB Su\nP=0\nLB G1\nR1=IN\nR1=R1 & 7\n{calls}H 10\nBR G1\nE\n{turns}PG", world=world
    )
    logic = output(device, 4.0).split("|")[:-1]
    assert logic[0] == "logic 1" and logic[-1] == "logic 0" and set(logic) == {"logic 0", "logic 1"}
    assert device.position(4.0) == logic.count("logic 1") * 51200


# Moves.


def test_moves_are_absolute_and_relative():
    device = switched_on()
    for line, end in (("MA 20000", 20000), ("MA 3000", 3000), ("MR 20000", 23000), ("P=100", 100), ("MA -50", -50)):
        assert say(device, line) == []
        device.advance(device.now + 5.0)
        assert say(device, "PR P", "PR MV") == [str(end), "0"]


def test_flags_of_a_move():
    device = switched_on(set={"HT": 200, "MT": 100})
    say(device, "MA 512000")
    end = device.motor.axis.profile.end
    for at, flags in (
        (0.1, ["1", "1", "1"]),
        (end - 1e-6, ["1", "1", "1"]),
        (end, ["0", "1", "0"]),
        (end + 0.301, ["0", "0", "0"]),
    ):
        device.advance(at)
        assert say(device, "PR MV", "PR MP", "PR VC") == flags


def test_a_move_may_end_with_the_drives_name():
    device = switched_on(name="b")
    say(device, "MA 51200,1")
    device.advance(10.0)
    (sign_on, (at, text)) = device.prints()
    assert text == "b\r\n" and sign_on[1].startswith("Copyright")
    assert at == pytest.approx(0.4515, abs=1e-3) and device.position(at) == 51200


def test_a_move_may_run_on():
    device = switched_on(name="b")
    say(device, "MR -51200,1,1")
    device.advance(10.0)
    at = device.prints()[-1][0]
    assert device.velocity(10.0) == -768000 and device.motor.axis.profile.position(at) == pytest.approx(-51200)


def test_a_slew_changes_on_the_fly_and_ends_with_zero():
    device = switched_on()
    say(device, "SL 20000")
    device.advance(1.0)
    assert say(device, "PR V", "SL -20000", "PR MD") == ["20000", "SL"]
    device.advance(2.0)
    assert say(device, "PR V", "SL 0", "PR MV") == ["-20000", "1"]
    device.advance(3.0)
    assert say(device, "PR MV", "PR V") == ["0", "0"]
    before = say(device, "PR P")
    device.advance(9.0)
    assert say(device, "PR P") == before


def test_a_move_that_is_slowed_down_must_stop_first():
    device = switched_on()
    say(device, "MA 512000")
    device.advance(0.5)
    assert say(device, "SL 0", "MA 0", "SL 5000", "PR MV") == ["?85", "?85", "1"]
    device.advance(5.0)
    assert 0 < device.position(5.0) < 512000
    assert say(device, "MA 0") == []


def test_a_new_target_on_the_way_is_taken_at_once():
    device = switched_on()
    say(device, "MA 512000")
    device.advance(0.5)
    say(device, "MA -1000")
    device.advance(10.0)
    assert device.position(10.0) == -1000


@pytest.mark.parametrize("line", ["MA 100", "MR 100", "SL 100"])
def test_nothing_moves_a_disabled_drive_or_one_without_power(line):
    device = switched_on()
    assert say(device, "DE=0", line, "DE=1", "PR MV") == ["?94", "0"]
    device.supply(False, 1.0)
    assert say(device, line, "PR VT") == ["?96", "2, 12, 0"]


def test_with_the_encoder_moves_are_in_counts():
    device = switched_on()
    say(device, "EE=1", "MR 4000")
    device.advance(10.0)
    assert say(device, "PR P", "PR C1", "PR C2") == ["4000", "51200", "4000"]
    say(device, "SL 14000")
    device.advance(12.0)
    assert say(device, "PR V") == ["14000"]


def test_a_counter_rolls_over():
    device = switched_on()
    say(device, "P=2147483647", "MR 1")
    device.advance(1.0)
    assert say(device, "PR P") == ["-2147483648"]


@pytest.mark.parametrize(
    ("mode", "beyond", "runs"), [(1, True, True), (3, True, False), (4, False, True), (6, False, False)]
)
def test_a_limit_switch_ends_the_motion_as_lm_says(mode, beyond, runs):
    device = switched_on(
        "PG 1\nLB G1\nH 10\nBR G1\nPG", set={"LM": mode, "IS": ("2,2,0", "3,3,0")}, world=WorldSpec(limit_plus=100000)
    )
    say(device, "EX G1", "SL 300000")
    device.advance(5.0)
    assert device.velocity(5.0) == 0 and device.running is runs
    assert (device.position(5.0) > 101000) is beyond
    assert say(device, "PR ER", "SL 100", "PR I2") == ["83", "?83", "1"]
    assert say(device, "SL -100000") == []
    device.advance(9.0)
    assert say(device, "PR I2", "PR ER", "PR V") == ["0", "0", "-100000"]


def test_an_input_is_filtered_and_its_level_is_not():
    device = switched_on(set={"D1": 50}, world=WorldSpec(inputs=((1.0, 1, 0), (1.01, 1, 1), (2.0, 1, 0))))
    seen = {}
    for at in (0.5, 1.005, 1.06, 2.04, 2.06):
        device.advance(at)
        seen[at] = say(device, "PR I1", "PR IN")
    assert seen == {
        0.5: ["0", "15"],
        1.005: ["0", "14"],
        1.06: ["0", "15"],
        2.04: ["0", "14"],
        2.06: ["1", "14"],
    }


def test_an_input_held_by_hand_is_seen():
    device = switched_on()
    device.advance(1.0)
    device.world.set_input(3, 0, 1.0)
    device.advance(1.0)
    assert say(device, "PR I3", "PR IN", "IS=3,0,1", "PR I3") == ["1", "11", "0"]
