"""Inputs that do something by themselves, outputs that follow the drive, filters, the analog input."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, drive, run, say


def printed(device, until):
    device.advance(until)
    return "".join(text for _, text in device.prints()).replace("\r\n", "|")


LOOP = """PG 1
LB G1
IC R1
BR G1
PG"""


# Inputs of a type of their own.


def test_go_runs_what_stands_at_address_1_and_only_while_nothing_runs():
    program = 'PG 1\nPR "go"\nH 100\nE\nPG'
    device = drive(
        "IS=2,4,0", program=program, inputs=((0.5, 2, 0), (0.52, 2, 1), (0.55, 2, 0), (0.56, 2, 1), (1, 2, 0))
    )
    assert printed(device, 0.9) == "go|"
    assert printed(device, 2.0) == "go|"
    assert say(device, "PR EF") == ["0"]


def test_go_without_a_program_is_an_error():
    device = drive("IS=1,4,1", inputs=((0.5, 1, 1),))
    device.advance(1.0)
    assert say(device, "PR ER") == ["42"]


@pytest.mark.parametrize(
    ("lines", "code"), [(["VM=400000", "MR 5120000"], "91"), (["EX G1"], "48"), (["EX G1", "SL 100000"], "48")]
)
def test_a_soft_stop_slows_down_and_ends_the_program(lines, code):
    device = drive("IS=1,5,0", "VA Q1", *lines, program=LOOP, inputs=((0.5, 1, 0),))
    device.advance(0.499)
    fast = device.velocity(0.499)
    device.advance(0.5001)
    assert 0 <= device.velocity(0.5001) <= fast
    if fast:
        assert device.velocity(0.5001) > 0
    device.advance(3.0)
    assert not device.running and not device.moving(3.0)
    assert say(device, "PR ER") == [code]


def test_a_soft_stop_leaves_a_paused_program_alone():
    device = drive("IS=1,5,0", "EX G1", "PS", program=LOOP, inputs=((0.5, 1, 0),))
    device.advance(1.0)
    assert say(device, "PR BY", "PR EF", "RS", "PR BY") == ["1", "0", "1"]


def test_pause_lasts_as_long_as_its_input_is_active_and_the_move_is_taken_up():
    program = "PG 1\nMA 512000\nH\nPR P\nE\nPG"
    device = drive("IS=3,6,0", "EX 1", program=program, inputs=((0.3, 3, 0), (5.0, 3, 1)))
    device.advance(4.9)
    assert not device.moving(4.9) and 0 < device.position(4.9) < 512000 and device.running
    assert printed(device, 9.0) == "512000|"


def test_jog_turns_at_vm_while_its_input_is_active_and_je_is_set():
    device = drive("IS=1,7,0", "IS=2,8,0", "VM=100000", inputs=((0.5, 1, 0), (2.0, 1, 1), (3.0, 2, 0), (4.0, 1, 0)))
    device.advance(1.0)
    assert device.velocity(1.0) == 0
    assert say(device, "JE=1") == []
    device.advance(1.9)
    assert device.velocity(1.9) == 100000
    device.advance(2.9)
    assert device.velocity(2.9) == 0
    device.advance(3.9)
    assert device.velocity(3.9) == -100000
    device.advance(4.9)
    assert device.velocity(4.9) == 0  # both at once are neither


def test_jog_leaves_a_move_alone():
    device = drive("IS=1,7,0", "JE=1", "MR -100000", inputs=((0.1, 1, 0), (0.11, 1, 1)))
    device.advance(5.0)
    assert say(device, "PR P") == ["-100000"]


def test_letting_go_of_a_jog_input_leaves_alone_what_was_begun_after_a_stop():
    device = drive("IS=1,7,0", "JE=1", inputs=((0.1, 1, 0), (2.0, 1, 1)))
    device.advance(0.5)
    device.escape(0.5)
    assert say(device, "PR V", "SL 20000") == ["0"]
    device.advance(3.0)
    assert device.velocity(3.0) == 20000


def test_a_reset_input_is_ctrl_c():
    device = drive("IS=1,11,0", "VM=500000", "SL 100000", inputs=((0.5, 1, 0),))
    assert "Copyright" in printed(device, 1.0)
    assert device.velocity(1.0) == 0 and say(device, "PR VM", "PR IS")[:2] == ["768000", "IS = 1, 0, 0"]


def test_a_reset_input_that_is_set_up_active_resets_at_once():
    device = drive(inputs=((0.0, 1, 1),))
    assert say(device, "IS=1,11,1") == []
    assert "Copyright" in printed(device, 0.1)


def test_capture_takes_the_position_and_d1_does_not_delay_it():
    program = "PG 1\nLB K1\nPR PC\nRT\nPG"
    device = drive("IS=1,12,0", "D1=255", "TC=K1", "TE=4", "SL 10000", program=program, inputs=((0.5, 1, 0),))
    expected = device.motor.axis.profile.position(0.5)
    assert printed(device, 1.0) == f"{round(expected)}|"
    assert say(device, "PR TE", "PR TC") == ["0", "K1"]


def test_a_filter_wants_a_level_that_stands():
    device = drive("IS=1,0,0", "D1=50", inputs=((0.1, 1, 0), (0.13, 1, 1), (0.2, 1, 0)))
    device.advance(0.22)
    assert say(device, "PR I1", "PR IN") == ["0", "14"]
    device.advance(0.2501)
    assert say(device, "PR I1") == ["1"]


@pytest.mark.parametrize(("lines", "code"), [
    (["IS=1,1,0", "IS=2,1,0"], 6),
    (["OS=1,17,0", "OS=2,17,1"], 6),
    (["IS=2,12,0"], 8),
    (["IS=1,13,0"], 8),
    (["OS=1,28"], 8),
    (["OS=2,26,0"], 8),
    (["OS=1,17,0", "O1=1"], 9),
    (["IS=7,0,0"], 10),
    (["OS=4,16,0"], 10),
    (["IS=5,0,0"], 8),
    (["OS=1,22,0"], 8),
    (["IS=1,0,2"], 21),
    (["IS=1"], 38),
])  # fmt: skip
def test_wrong_setups_have_their_codes(lines, code):
    assert say(drive(), *lines) == [f"?{code}"]


def test_a_setup_that_is_sent_again_is_taken():
    assert say(drive(), "IS=1,1,0", "IS=1,1,1", "IS=1,0,0", "IS=2,1,0", "OS=3,28,1", "OS=3,28", "PR OS") == [
        "OS = 1, 16, 0", "OS = 2, 16, 0", "OS = 3, 28, 0",
    ]  # fmt: skip


def test_what_a_product_has_no_hmt_for_is_no_output_type_of_it():
    assert say(drive(personality="LMDOM"), "OS=1,21,0", "OS=1,24,0", "OS=1,20,0") == ["?8", "?8"]
    assert say(drive(personality="LMM"), "IS=5,9,0") == ["?24"]


# Outputs.


def test_general_outputs_do_as_they_are_told():
    device = drive("OS=1,16,1", "O1=1", "O2=0")
    assert device.outputs(0.0) == {1: True, 2: False, 3: False}
    assert [device.output_lines.level(n, 0.0) for n in (1, 2, 3)] == [1, 1, 1]
    say(device, "OT=6")
    assert device.outputs(0.0) == {1: False, 2: True, 3: True}
    assert [device.output_lines.level(n, 0.0) for n in (1, 2, 3)] == [0, 0, 0]


def over(device, output, *times):
    """Whether an output is active at each of the times."""
    found = []
    for when in times:
        device.advance(when)
        found.append(device.outputs(when)[output])
    return found


def test_moving_includes_the_delays_and_velocity_changing_does_not():
    device = drive("HT=300", "MT=200", "OS=1,17,1", "OS=2,20,1", "OS=3,23,1", "VM=100000", "MA 100000")
    end = device.motor.axis.profile.end
    assert over(device, 2, 0.01, 0.5, end - 0.01, end + 0.01) == [True, False, True, False]
    assert over(device, 1, end + 0.49, end + 0.51) == [True, False]
    device = drive("OS=3,23,1", "SL 1000")
    assert over(device, 3, 0.5) == [False]


def test_the_error_output_follows_ef():
    device = drive("OS=2,18,1")
    device.execute("XX=5", 0.0)
    assert over(device, 2, 0.1) == [True]
    say(device, "PR ER")
    assert over(device, 2, 0.2) == [False]


@pytest.mark.parametrize(("mask", "states"), [
    (1, [False, False, False, True]),
    (512, [True, False, True, True]),
    (16384, [False, True, False, False]),
    (16385, [False, True, False, True]),
    (4096, [False, False, False, False]),
    (2**31, [False, False, False, False]),
])  # fmt: skip
def test_attention_is_a_sum_of_events(mask, states):
    device = drive("OS=1,29,0", f"AO={mask}", "HT=1")
    found = over(device, 1, 0.01)
    say(device, "SL 1000")
    found += over(device, 1, 0.1)
    say(device, "SL 0")
    found += over(device, 1, 0.2)
    device.execute("FOO", 0.2)
    assert found + over(device, 1, 0.3) == states


def test_a_trip_gives_a_pulse_as_long_as_cw_says():
    device = drive("OS=3,28", "CW=100", "TR=1000,0,2", "TE=16", "SL 1000")
    assert over(device, 3, 0.999, 1.0, 1.000004, 1.00001) == [False, True, True, False]
    device.advance(3.0)
    assert say(device, "PR TE") == ["0"]


def test_encoder_outputs_are_in_quadrature():
    device = drive("OS=1,26,1", "OS=2,27,1")
    seen = []
    for count in range(8):
        device.motor.axis.set_counter("C2", count, 0.0)
        seen.append((device.outputs(0.0)[1], device.outputs(0.0)[2]))
    assert len(set(seen[:4])) == 4 and seen[4:] == seen[:4]
    assert all((a != c) + (b != d) == 1 for (a, b), (c, d) in zip(seen, seen[1:], strict=False))


def test_set_ups_last_when_they_are_saved():
    device = drive("OS=1,17,1", "IS=2,2,1", "S", "OS=1,16,0", "IS=2,0,0")
    device.reset(0.0)
    assert say(device, "PR OS", "PR IS")[:5] == [
        "OS = 1, 17, 1", "OS = 2, 16, 0", "OS = 3, 16, 0", "IS = 1, 0, 0", "IS = 2, 2, 1",
    ]  # fmt: skip


# The analog input.


def test_the_analog_input_reads_what_is_on_it():
    device = drive(analog=((0.0, 1000), (1.0, 4095)))
    assert say(device, "PR I5") == ["1000"]
    device.advance(1.0)
    assert say(device, "PR I5", "IS=5,10,1", "PR I5", "IS=5,10,0", "PR I5") == ["4095", "3200", "4095"]


def test_d5_is_a_running_average():
    device = drive("D5=100", analog=((0.0, 0), (1.0, 4000)))
    device.advance(1.0)
    assert say(device, "PR I5") == ["0"]
    device.advance(1.1)
    assert 2400 < int(say(device, "PR I5")[0]) < 2600
    device.advance(3.0)
    assert say(device, "PR I5") == ["4000"]


# An MDrivePlus.


def test_the_points_of_an_mdrive_are_inputs_or_outputs():
    device = drive(personality="MDI")
    assert say(device, "PR S1", "S3=1,1,0", "PR S3", "S1=17,1,0", "PR S1", "O1=1", "S2=16,1", "O2=1", "PR S5") == [
        "0, 0, 0", "1, 1, 0", "17, 1, 0", "?9", "9, 0",
    ]  # fmt: skip
    say(device, "SL 1000")
    assert device.outputs(device.now)[1] and device.outputs(device.now)[2]
    assert say(device, "O3=1") == ["?9"]


# Outputs that follow motion, current and attention.


def test_the_moving_output_waits_for_the_delays_after_any_motion():
    device = drive("OS=1,17", "HT=200", "MT=100")
    assert device.outputs(0.0)[1] is False
    say(device, "SL 1000")
    device.advance(0.5)
    say(device, "SL 0")
    assert [device.moving(0.51), device.outputs(0.51)[1], device.outputs(0.79)[1]] == [False, True, True]
    assert device.outputs(0.81)[1] is False


def test_the_attention_output_tells_the_holding_current_from_the_running_one():
    device = drive()
    run(device, "HT=200", "MT=100", "AO=512", "OS=1,29,0", "MR 51200", 0.1)
    assert not device.outputs(device.now)[1]
    device.advance(device.motor.axis.profile.end + 0.29)
    assert not device.outputs(device.now)[1]
    device.advance(device.now + 0.02)
    assert device.outputs(device.now)[1]
    run(device, "SL 1000", 1.0, "SL 0", 0.1)
    assert not device.outputs(device.now)[1]
    run(device, 1.0)
    assert device.outputs(device.now)[1]
    run(device, "DE=0")
    assert not device.outputs(device.now)[1]


def test_without_any_delay_the_current_stays_what_it_was_in_motion():
    device = drive()
    run(device, "HT=0", "MT=0", "AO=512", "OS=1,29,0", "MR 100", 5.0)
    assert not device.outputs(device.now)[1]


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


# Inputs with a function: set up, active at once, resets and stops.


@pytest.mark.parametrize("before", ["IS=1,0,1", "IS=1,0,0"])
def test_a_reset_input_that_is_active_when_it_is_set_up_resets_the_drive(before: str) -> None:
    device = drive(before, "VM=5000", inputs=[[0.1, 1, 1]])
    device.advance(1)
    say(device, "IS=1,11,1")
    assert at(device, 1.1, "VM") == ["768000"]


def test_a_stop_input_that_is_active_when_it_is_set_up_stops_the_motor() -> None:
    device = drive("SL 50000", inputs=[[0.5, 1, 0]])
    device.advance(1)
    say(device, "IS=1,5,0")
    assert at(device, 2, "MV", "ER") == ["0", "91"]


@pytest.mark.parametrize("level", [0, 1])
def test_a_program_that_resets_its_drive_by_an_active_input_does_so_until_that_is_let_go(level: int) -> None:
    program = f"PG 1\nLB SU\nIS=1,11,{level}\nPR I1\nPG"
    device = drive(program=program, inputs=[[0.5, 1, level], [1.0, 1, 1 - level]])
    device.advance(0.75)
    assert device.power_unit.boots > 10
    device.advance(2)
    before = device.power_unit.boots
    device.advance(3)
    assert (device.power_unit.boots, device.running) == (before, False)
    assert say(device, "PR IS")[0] == f"IS = 1, 11, {level}"


@pytest.mark.parametrize("line", ["OS=1,22,0", "OS=1,5,0", "OS=1,-1", "IS=1,16,0", "IS=1,9,0", "IS=5,0,0", "IS=6,1,0"])
def test_a_type_that_an_input_or_output_cannot_have_is_error_8(line):
    device = drive()
    before = say(device, "PR OS", "PR IS")
    assert say(device, line) == ["?8"]
    assert say(device, "PR OS", "PR IS") == before


def test_ip_takes_setups_back_and_leaves_outputs_alone():
    device = drive("OS=3,17,1", "S")
    assert say(device, "O2=1", "OS=3,16", "IP", "PR OS")[2:] == ["OS = 3, 17, 1"]
    assert device.outputs(0.0) == {1: False, 2: True, 3: False}
    device.reset(1.0)
    assert device.outputs(1.0)[2] is False


def test_a_switch_to_ground_runs_the_program_at_address_1_each_time():
    device = drive("IS=4,4,0", inputs=((1.0, 4, 0), (1.2, 4, 1), (3.0, 4, 0)))
    say(device, "PG1", "MR 20000", "H", "MR -20000", "H", "E", "PG")
    assert at(device, 0.9, "P", "BY") == ["0", "0"]
    assert int(at(device, 1.28, "P")[0]) > 19000
    assert at(device, 2.0, "P", "BY") == ["0", "0"]
    assert at(device, 3.1, "BY", "MV") == ["1", "1"]


def test_a_reset_input_that_is_high_already_resets_when_it_is_set_up_so():
    device = drive("R1=5", inputs=((0.0, 1, 1),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["0"] and device.power_unit.boots == 1
    device = drive("R1=5", inputs=((0.0, 1, 0),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["5"] and device.power_unit.boots == 0
