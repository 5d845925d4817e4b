"""What the MCode reference's chapters 3, 7, 8 and 10 say beside the commands themselves, tried on simulated drives."""

import pytest

from tests.support.moving import at, drive, rotor, say


def closed(*lines, **world):
    """A drive with hMT on, calibrated."""
    device = drive("AS=1", *lines, **world)
    device.advance(0.1)
    return device


# 8.3: make-up.

QUICK = ("VM=300000", "LG=2000000", "LT=60000")


def test_steps_lost_at_velocity_are_made_up_at_vm():
    device = closed(*QUICK, locked=((0.5, 0.7),))
    say(device, "MA 200000")
    assert at(device, 0.9, "AV", "V") == ["300000", "165670"]


def test_steps_lost_while_slowing_down_are_made_up_at_vi():
    device = closed(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    assert at(device, 1.0, "AV", "MV") == ["1000", "1"]
    assert at(device, 1.2, "AV", "P", "MV") == ["1000", "200000", "1"]
    assert at(device, 10.0, "LL") == ["4673"]
    assert at(device, 15.0, "LL", "MV", "ER") == ["0", "0", "0"] and rotor(device) == 200000


def test_the_next_motion_is_not_as_slow_as_the_make_up_that_it_takes_over():
    device = closed(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    device.advance(1.2)
    say(device, "MA 400000")
    assert at(device, 1.7, "AV") == ["300000"]


def test_a_slew_that_is_faster_than_vm_is_not_slowed_by_what_it_has_lost():
    device = closed(*QUICK, locked=((0.9, 1.0),))
    say(device, "SL 500000")
    assert at(device, 2.0, "AV", "LL") == ["500000", "57429"]
    say(device, "SL 0")
    assert at(device, 6.0, "LL", "MV") == ["0", "0"]


@pytest.mark.parametrize("world", [{}, {"stall_at": 100}])
def test_lag_behind_a_command_that_has_yet_to_turn_round_is_made_up_on_its_way(world):
    device = closed("D=5000", "LG=2000000", "LT=60000", locked=((0.2, 0.5),), **world)
    say(device, "SL -20000")
    device.advance(0.4)
    say(device, "MA 400")
    assert int(at(device, 0.49, "LL")[0]) > 5000
    assert int(at(device, 0.503, "AV")[0]) < -19000
    assert at(device, 0.6, "LL", "AV") == ["0", "-19000"]
    device.advance(60.0)
    assert rotor(device) == world.get("stall_at", 400)


def test_a_rotor_that_was_pushed_ahead_waits_where_the_move_ends():
    device = closed("LD=2000000", "VM=20000", "VI=19000")
    say(device, "MA 40000", "VM=768000")
    device.advance(1.5)
    device.world.push(5000, 1.5)
    device.advance(1.5)
    assert at(device, 1.6, "AV") == ["0"] and rotor(device) == 40000
    assert at(device, 2.0, "P", "LL") == ["38000", "-2000"] and rotor(device) == 40000
    assert at(device, 3.0, "P", "LL", "MV") == ["40000", "0", "0"]


@pytest.mark.parametrize(("lines", "speed"), [(("MU=2",), "2560000"), (("MS=16", "MU=2"), "160000")])
def test_system_speed_is_3000_turns_a_minute_whatever_a_step_is(lines, speed):
    device = closed(*lines, "LG=2000000000", "LT=60000", locked=((0.2, 4.0),))
    say(device, "VM=100000", "SL 90000")
    assert at(device, 4.16, "AV") == [speed]


def test_twice_the_speed_is_not_faster_than_a_motor_can_turn():
    device = closed("MU=1", "VM=2000000", "LG=2000000000", "LT=60000", locked=((0.2, 2.2),))
    say(device, "MA 4000000")
    assert at(device, 2.4, "AV") == ["2560000"]


# 8.2 and 8.4: modes, locked rotor.


@pytest.mark.parametrize("mode", [1, 2])
def test_a_locked_rotor_switches_the_bridges_off_until_cf(mode):
    device = drive(f"AS={mode}", "LT=500", stall_at=50000)
    device.advance(0.1)
    say(device, "MA 100000")
    assert at(device, 3.0, "ER", "LR", "MV") == ["104", "1", "0"]
    assert say(device, "MR -100", "DE=0", "DE=1", "MR -100") == ["?94", "?94"]
    assert say(device, "CF", "PR LR", "MR -100") == ["0"]
    assert rotor(device) == 50000 and at(device, 4.0, "LR") and rotor(device) == 49900


def test_in_torque_mode_a_locked_rotor_is_a_flag_and_it_turns_again():
    device = drive("TQ=50", "TS=100000", "LT=500", "AS=3", locked=((1.0, 4.0),))
    assert at(device, 2.0, "LR", "ER", "AV") == ["1", "104", "0"]
    assert abs(int(at(device, 5.0, "AV")[0])) == 100000


def test_hmt_takes_stalls_and_position_maintenance_out_of_force():
    device = closed("EE=1", "SF=10", "PM=1", "LG=2000000", "LT=60000", stall_at=50000)
    say(device, "MA 100000")
    assert at(device, 3.0, "ST", "ER") == ["0", "0"]


# 3: operation, variables, system instructions.


def test_cleared_programs_and_new_values_are_back_after_a_reset_unless_they_are_saved():
    device = drive("VA Q1=5", program='PG 1\nLB G1\nPR "here"\nE\nPG')
    say(device, "S", "CP", "Q1=9", "VA Q2=1")
    device.reset(1.0)
    assert say(device, "L G1", "PR UV") == ["1  LB G1", '6  PR "here"', "14  E", "G1 = 1", "Q1 = G 5", ""]
    say(device, "CP", "S")
    device.reset(2.0)
    assert say(device, "L", "PR Q1") == ["5"]
    assert say(device, "FD", "PR UV") == [""]


def test_a_local_variable_begins_anew_with_each_program_and_leaves_a_global_one_alone():
    device = drive(program="PG 1\nLB G1\nVA Q1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1", f"R1={t:.0f}")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["1", "1"]
    device = drive(program="VA Q1=3\nPG 1\nLB G1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["4", "5"]


def test_esc_stops_without_a_ramp_and_ends_the_program():
    device = drive(program='PG 1\nLB G1\nMR 100000\nH\nPR "there"\nE\nPG')
    say(device, "EX G1")
    device.escape(0.2)
    assert at(device, 0.2, "MV", "V", "BY") == ["0", "0", "0"]
    device.advance(2.0)
    assert not device.prints()


def test_a_slew_goes_faster_than_vm_and_changes_on_the_fly():
    device = drive("VM=100000", "SL 200000")
    assert at(device, 1.0, "V") == ["200000"]
    say(device, "SL -1000")
    assert at(device, 2.0, "V", "MV") == ["-1000", "1"]


# 7.2: inputs and outputs in use.


def test_a_switch_to_ground_runs_the_program_at_address_1_each_time():
    device = drive("IS=4,4,0", inputs=((1.0, 4, 0), (1.2, 4, 1), (3.0, 4, 0)))
    say(device, "PG1", "MR 20000", "H", "MR -20000", "H", "E", "PG")
    assert at(device, 0.9, "P", "BY") == ["0", "0"]
    assert int(at(device, 1.28, "P")[0]) > 19000
    assert at(device, 2.0, "P", "BY") == ["0", "0"]
    assert at(device, 3.1, "BY", "MV") == ["1", "1"]


def test_a_lamp_on_the_velocity_changing_output_is_dark_at_constant_velocity():
    device = drive("IS=1,5,0", "OS=1,20,0", "SL 2000000", inputs=((3.0, 1, 0),))
    lit = []
    for t in (1.0, 2.5, 4.0, 6.0):
        device.advance(t)
        lit.append(device.outputs(t)[1])
    assert lit == [True, False, True, False] and say(device, "PR ER", "PR V") == ["91", "0"]


def test_a_relay_is_set_when_a_range_of_motion_is_over():
    device = drive("OS=1,16,1", program="PG 100\nMR 2000000\nH\nMR -1000000\nH\nO1=1\nPG")
    say(device, "EX 100")
    device.advance(5.4)
    assert not device.outputs(5.4)[1] and device.output_lines.level(1, 5.4) == 0
    assert at(device, 5.6, "P", "BY") == ["1000000", "0"]
    assert device.outputs(5.6)[1] and device.output_lines.level(1, 5.6) == 1


def test_a_reset_input_that_is_high_already_resets_when_it_is_set_up_so():
    device = drive("R1=5", inputs=((0.0, 1, 1),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["0"] and device.boots == 1
    device = drive("R1=5", inputs=((0.0, 1, 0),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["5"] and device.boots == 0
