"""The simulated drive's motion, and programs of the shapes that the manual's samples have (7.3.5, 9.1, 9.2, 9.3)."""

from __future__ import annotations

import pytest

from multidrop.simulator.cell.spec import WorldSpec
from tests.support.lexium import at, drive, output, prints_until, say, switched_on

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
    for when, flags in (
        (0.1, ["1", "1", "1"]),
        (end - 1e-6, ["1", "1", "1"]),
        (end, ["0", "1", "0"]),
        (end + 0.301, ["0", "0", "0"]),
    ):
        device.advance(when)
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
    for when in (0.5, 1.005, 1.06, 2.04, 2.06):
        device.advance(when)
        seen[when] = say(device, "PR I1", "PR IN")
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


# Velocities: slews, their limits, and their changes on the way.


def test_the_direction_is_not_turned_on_the_way():
    device = drive("MR 51200")
    assert say(device, "RD=1", "PR RD") == ["?95", "0"]
    device.advance(2)
    say(device, "RD=1", "SL 1000")
    assert say(device, "RD=0", "PR RD") == ["?95", "1"]


def test_a_slew_goes_beyond_vm_up_to_what_the_microsteps_allow():
    device = drive("VM=2000", "SL 20000")
    assert at(device, 1, "V", "VC", "MP") == ["20000", "0", "0"]
    refused = say(device, "SL 5000001", "SL -5000001", "SL 2560001", "SL", "SL 1,1", "SL Q1", "PR V")
    assert refused == ["?21", "?21", "?77", "?24", "?24", "?30", "20000"]
    assert say(device, "SL -2560000", "PR VC") == ["1"]
    assert at(device, 4, "V") == ["-2560000"]
    device = drive("EE=1")
    assert say(device, "SL 200001", "SL -200001", "SL 200000") == ["?21", "?21"]


def test_after_a_move_is_slowed_down_the_next_motion_waits():
    device = drive("MA 512000")
    device.advance(0.3)
    assert say(device, "SL 0", "MR 100", "MA 0", "SL 5") == ["?85"] * 3
    device.advance(2)
    assert say(device, "MR 100") == []


def test_a_new_top_speed_is_for_the_next_move():
    device = drive("MA 1000000")
    device.advance(0.5)
    say(device, "VM=100000")
    assert at(device, 0.9, "V") == ["768000"]
    device.advance(3)
    say(device, "MA 0")
    assert at(device, 4, "V") == ["-100000"]


def test_the_two_velocities_keep_apart_and_within_the_microsteps():
    device = drive()
    assert say(device, "VM=1000", "VM=999", "VI=768000", "VI=768001", "VI=0") == ["?23", "?23", "?22", "?22", "?21"]
    assert say(device, "VM=2560001", "PR VM", "PR VI") == ["?21", "768000", "1000"]
    say(device, "MS=16")
    refused = say(device, "VM=160001", "VI=160001", "TS=160001", "SL 160001", "VI=160000", "PR VI")
    assert refused == ["?77", "?77", "?77", "?77", "?22", "63"]
    assert say(drive("EE=1"), "PR VI", "PR VM", "VM=200001", "VI=60000", "VM=78") == [
        "78",
        "60000",
        "?21",
        "?22",
        "?23",
    ]


def test_velocity_and_its_changing_are_only_read_and_programs_branch_on_them():
    program = "PG 1\nLB G1\nSL 5000\nH 10\nBR K9,V=5000\nE\nLB K9\nSL 100000\nH 20\nCL Q1,VC=1\nE\nLB Q1\nPR V\nRT\nPG"
    device = drive("EX G1", program=program)
    assert prints_until(device, 1) == ["25400"]
    assert say(device, "V=1", "VC=1", "VR=1", "SN=1", "UV=1", "VT=1") == ["?25"] * 6


@pytest.mark.parametrize(
    ("lines", "line", "code"),
    [
        (["MS=4"], "VM=40001", "?77"),
        (["MS=4"], "VM=2560001", "?21"),
        ([], "VM=2560001", "?21"),
        (["MS=10"], "TS=100001", "?77"),
        (["MS=10"], "TS=46511", "?21"),
        ([], "TS=2560001", "?21"),
    ],
)
def test_a_velocity_that_the_microsteps_do_not_reach_is_error_77(lines, line, code):
    assert say(drive(*lines), line) == [code]


def test_velocities_up_to_ten_thousand_a_microstep_are_taken():
    assert say(drive("MS=10"), "VM=100000", "TS=100000", "PR VM", "PR TS") == ["100000", "100000"]


def test_vm_stays_above_vi_however_coarse_the_microsteps_become():
    assert say(drive("VI=1000", "VM=1001"), "MS=1", "PR VI", "PR VM") == ["4", "5"]


def test_a_slew_goes_faster_than_vm_and_changes_on_the_fly():
    device = drive("VM=100000", "SL 200000")
    assert at(device, 1.0, "V") == ["200000"]
    say(device, "SL -1000")
    assert at(device, 2.0, "V", "MV") == ["-1000", "1"]


# Jog inputs: when a jog begins, ends and is taken up.


def test_a_jog_ends_when_its_input_is_no_jog_input_any_more() -> None:
    device = drive("IS=1,7,0", "JE=1", inputs=[[1.0, 1, 0]])
    assert at(device, 2.5, "V") == ["768000"]
    say(device, "IS=1,0,0")
    assert at(device, 4, "V", "MV") == ["0", "0"]


def test_a_jog_ends_when_its_input_becomes_a_clock_by_the_other_one() -> None:
    device = drive("IS=3,8,0", "JE=1", inputs=[[1.0, 3, 0]])
    assert at(device, 2.5, "V") == ["-768000"]
    say(device, "IS=4,13,0")
    assert at(device, 4, "V", "MV") == ["0", "0"]


def test_a_jog_of_an_mdriveplus_ends_with_its_point() -> None:
    device = drive("S1=7,0", "JE=1", personality="MDI", inputs=[[1.0, 1, 0]])
    assert at(device, 2.5, "MV") == ["1"]
    say(device, "S1=16,0")
    assert at(device, 4, "MV") == ["0"]


def test_an_active_input_turns_as_soon_as_it_is_a_jog_input() -> None:
    device = drive("JE=1", inputs=[[0.5, 2, 0]])
    device.advance(1)
    say(device, "IS=2,8,0")
    assert at(device, 2.5, "V") == ["-768000"]


def test_setting_up_another_input_does_not_begin_a_jog_that_was_passed_over() -> None:
    device = drive("IS=1,7,0", "JE=1", "MR 100000", inputs=[[0.1, 1, 0]])
    device.advance(5)
    say(device, "IS=2,1,0")
    assert at(device, 6, "P", "MV") == ["100000", "0"]


def test_jog_is_enabled_though_the_drive_is_disabled() -> None:
    device = drive("IS=1,7,0", "DE=0", inputs=[[0.5, 1, 0]])
    device.advance(1)
    assert not device.execute("JE=1", 1.0).refused
    assert say(device, "PR JE", "PR ER", "PR MV") == ["1", "94", "0"]


@pytest.mark.parametrize("release", ["input", "JE=0"])
def test_a_jog_that_ends_in_a_pause_is_not_taken_up(release: str) -> None:
    ends = [[3.0, 1, 1]] if release == "input" else []
    device = drive("IS=1,7,0", "JE=1", program="PG 1\nLB G1\nH 60000\nPG", inputs=[[0.5, 1, 0], *ends])
    say(device, "EX G1")
    device.advance(2)
    say(device, "PS")
    device.advance(3.5)
    if release != "input":
        say(device, release)
    say(device, "RS")
    assert at(device, 5, "V", "BY", "ER") == ["0", "1", "0"]


def test_a_jog_that_lasts_through_a_pause_is_taken_up() -> None:
    device = drive("IS=1,7,0", "JE=1", program="PG 1\nLB G1\nH 60000\nPG", inputs=[[0.5, 1, 0], [6.0, 1, 1]])
    say(device, "EX G1")
    device.advance(2)
    say(device, "PS")
    device.advance(3.5)
    say(device, "RS")
    assert at(device, 5, "V") == ["768000"]
    assert at(device, 8, "V") == ["0"]
