"""What a step is: microsteps, step angle, motor steps and counts of the encoder, and the figures of moves in them."""

import pytest

from tests.support.lexium import at, drive, rotor, run, say


def test_what_an_lmm_moves_by_in_steps_follows_ms_while_it_counts():
    device = drive("EE=1", "MS=128", "EE=0", personality="LMM")
    assert say(device, 'PR A," ",D," ",VI," ",VM') == ["500000 500000 500 384000"]
    device = drive("EE=1", "A=500", "MS=128", "PR A", personality="LMM")
    assert say(device, 'PR A," ",VM') == ["500 60000"]


def test_encoder_mode_puts_an_lmds_microsteps_to_256_and_back():
    device = drive("MS=16")
    assert say(device, "EE=1", "PR MS", "MS=16", "MS=256", "PR MS") == ["256", "?21", "256"]
    assert say(device, "MR 4000") == []
    device.advance(3.0)
    assert say(device, "PR P", "PR C1", "EE=0", "PR MS", "PR VM", "PR A") == [
        "4000", "51200", "16", "48000", "62500",
    ]  # fmt: skip


def test_microsteps_of_encoder_mode_are_kept_with_it():
    device = drive("MS=16", "EE=1", "S")
    assert say(device, "EE=0", "PR MS", "IP", "PR EE", "PR MS") == ["16", "1", "256"]
    device.power(False, 1.0)
    device.power(True, 2.0)
    assert say(device, "PR MS", "EE=0", "PR MS", "FD", "PR MS") == ["256", "16", "256"]


def test_microsteps_too_coarse_for_hmt_hinder_it_in_encoder_mode_too():
    device = drive("MS=8", "EE=1")
    assert say(device, "AS=1", "PR AS", "PR MS", "EE=0", "PR MS", "MS=10", "EE=1", "AS=1", "PR MS") == [
        "?21", "0", "256", "8", "10",
    ]  # fmt: skip


def test_with_hmt_motion_is_in_steps_even_with_ee():
    device = drive("EE=1", "VM=50000", "P=7")
    assert say(device, "AS=1", "PR EE", "PR VM", "PR A", "PR P", "VM=600000") == ["1", "768000", "1000000", "0"]
    device.advance(0.1)
    assert say(device, "MA 51200") == []
    device.advance(2.0)
    assert say(device, "PR P", "PR C2", "AS=0", "PR P", "PR VM", "AS=1", "PR VM") == [
        "51200", "4007", "4007", "50000", "600000",
    ]  # fmt: skip
    device.advance(3.0)
    assert say(device, "SL 200001", "SL 0") == []


def test_what_encoder_mode_and_hmt_make_of_the_units_is_kept_by_s():
    device = drive("EE=1", "AS=1", "S", "AS=0")
    assert say(device, "PR VM", "IP", "PR AS", "PR VM") == ["60000", "1", "768000"]
    device.power(False, 1.0)
    device.power(True, 2.0)
    assert say(device, "PR EE", "PR AS", "PR VM", "AS=0", "PR VM") == ["1", "1", "768000", "60000"]


def test_an_lmms_microsteps_are_free_in_encoder_mode():
    assert say(drive("MS=64", personality="LMM"), "EE=1", "PR MS", "MS=128", "EE=0", "PR MS") == ["64", "128"]


def test_the_step_angle_takes_the_angles_of_the_table_only():
    device = drive(personality="LMM")
    for angle in ("0.45", "0.72", "0.9", "1.8", "1.875", "2", "2.5", "3.6", "5"):
        assert say(device, f"SA={angle}", "PR SA") == [f"{float(angle):.6f}"]
    assert say(device, "SA=1", "SA=0.91", "PR SA", "FD", "PR SA") == ["?21", "?21", "5.000000", "1.800000"]


def test_a_finer_motor_turns_once_in_twice_the_steps():
    device = drive("SA=0.9", "MR 102400", personality="LMM")
    device.advance(2)
    assert device.motor.rotor.physical(2) == 51200


def test_microsteps_are_at_least_two_for_each_count_of_the_encoder():
    device = drive(personality="LMM")
    assert run(device, "EL=512", "EE=1", "MS=16", "MS=25", "PR MS") == ["?36", "25"]
    assert run(device, "EL=1000", "PR EL", "EL=500", "PR EL") == ["?36", "512", "500"]
    assert run(device, "EL=2001", "EL=0") == ["?21", "?21"]


def test_the_encoder_is_not_enabled_while_microsteps_are_too_coarse_for_it():
    device = drive(personality="LMM")
    assert run(device, "MS=32", "EE=1", "PR EE") == ["?36", "0"]
    assert run(device, "SA=0.9", "EE=1", "PR EE", "SA=1.8", "PR SA") == ["1", "?36", "0.900000"]


def test_the_step_angle_prints_as_the_manual_shows_it():
    device = drive(personality="LMM")
    assert say(device, "PR SA", "SA=0.9", "PR SA", "SA=2", "PR SA") == ["1.800000", "0.900000", "2.000000"]
    assert "SA = 2.000000" in device.execute("PR AL", 0.0).lines


def test_seven_and_a_half_inches_take_5_766_s():
    device = drive("MR 3840000")
    # Up to 768000 steps/s in 0.767 s and (768000 + 1000) / 2 * 0.767 = 294911.5 steps.
    assert at(device, 0.7669, "VC") == ["1"] and at(device, 0.7671, "VC", "V") == ["0", "768000"]
    assert at(device, 0.767, "P") == ["294988"]  # which is 0.1 ms later
    assert device.motor.axis.profile.end == pytest.approx(0.767 + (3840000 - 2 * 294911.5) / 768000 + 0.767)
    assert device.motor.axis.profile.end == pytest.approx(5.766, abs=1e-4)


def test_half_the_microsteps_make_the_same_number_of_steps_twice_as_far():
    device = drive("MS=128", "MR 51200")
    device.advance(5.0)
    assert device.motor.rotor.physical(5.0) == 2 * 51200


@pytest.mark.parametrize(("steps", "turns"), [(96000, 1.875), (41713, 0.8147)])
def test_rotary_moves_turn_as_far_as_is_worked_out(steps, turns):
    device = drive("VM=6827", f"MR {steps}")
    assert at(device, 2.0, "V") == ["6827"]  # 8 rpm
    device.advance(60.0)
    assert rotor(device) / 51200 == pytest.approx(turns, abs=1e-4)


def test_with_the_encoder_on_all_is_in_counts_of_4000_to_a_turn():
    device = drive("EE=1")
    assert say(device, "PR VM", "PR VI", "PR A", "PR D", "PR MS") == ["60000", "78", "78125", "78125", "256"]
    assert say(device, "MS=128", "MR 14000") == ["?21"]
    device.advance(5.0)
    assert rotor(device) == 3.5 * 51200
    device = drive("EE=1", "SL 14000")
    device.advance(3.0)
    here = rotor(device)
    device.advance(4.0)
    assert (rotor(device) - here) / 51200 * 60 == pytest.approx(210, abs=0.01)
