"""Outputs that follow motion, current and attention."""

from tests.support.lexium import at, drive, run, say


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
