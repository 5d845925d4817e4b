"""Homing, limits, StepNLoop and the joystick of the simulated PMX (manual 7.10, 7.11, 7.15, 7.17).

A ramp of the default speeds goes 165 pulses in 0.3 s. The cell's home switch is closed at -1000 and below.
"""

from __future__ import annotations

import pytest

from tests.support.pmx_controller import Bench

WORLD = "[bus.drive.world]\nhome = -1000\nlimit_plus = 3000\nlimit_minus = -3000\nindex = 300\n"


def homed(*commands: str, world: str = WORLD) -> Bench:
    pmx = Bench(world)
    assert pmx(*commands) == "OK"
    return pmx.still()


def place(pmx: Bench) -> int:
    """Where the shaft is, motor steps."""
    return round(pmx.device.controller.axes[0].rotor.position(pmx.now))


def test_home_at_high_speed_marks_zero_and_ends_a_ramp_behind_it() -> None:
    pmx = homed("HX-")
    assert [pmx("PX"), pmx("EX"), pmx("MSTX")] == ["-165", "-165", "64"]
    assert place(pmx) == -1165
    # 165 up, 835 at high speed, 165 down.
    assert pmx.now == pytest.approx(0.3 + 0.835 + 0.3)


def test_return_to_zero_goes_back_to_the_mark() -> None:
    pmx = homed("RZ=1", "HX-")
    assert [pmx("PX"), place(pmx)] == ["0", -1000]


def test_the_polarity_of_home_is_obeyed() -> None:
    pmx = homed("POLX=32", "X-2000", world="[bus.drive.world]\nhome = -1000")
    assert pmx("MSTX") == "0"
    pmx("HX+")
    assert [pmx.still()("PX"), place(pmx)] == ["165", -835]


def test_limit_homing_goes_back_by_the_correction_and_that_is_zero() -> None:
    pmx = homed("LCA=700", "LX+")
    assert [pmx("PX"), pmx("EX"), place(pmx), pmx("MSTX")] == ["0", "0", 2300, "0"]
    pmx = homed("LCA=700", "LCAX=500", "LX-")
    assert [pmx("PX"), place(pmx)] == ["0", -2500]


def test_home_and_index_searches_the_index_once_it_is_slow() -> None:
    # Home at -1000, slow at -1165; index marks lie at 300 - 1600 n: the next is -1300.
    pmx = homed("ZHX-")
    assert [pmx("PX"), place(pmx), pmx("MSTX")] == ["0", -1300, str(64 + 512)]
    assert pmx.now == pytest.approx(0.3 + 0.835 + 0.3 + 135 / 100)


def test_index_only_is_looked_for_at_low_speed() -> None:
    pmx = homed("ZX+")
    assert [pmx("PX"), place(pmx)] == ["0", 300]
    assert pmx.now == pytest.approx(3.0)
    pmx("ZX+")
    assert place(pmx.still()) == 1900


def test_home_twice_comes_back_past_the_switch_and_touches_it_slowly() -> None:
    pmx = homed("HCA=400", "HLX-")
    assert [pmx("PX"), place(pmx), pmx("MSTX")] == ["0", -1000, "64"]
    # There and past it 1.435 s; back over 165 + 400 with ramps of 165: 0.835 s; and 400 at 100/s.
    assert pmx.now == pytest.approx(1.435 + 0.6 + (565 - 330) / 1000 + 4.0, abs=0.01)


@pytest.mark.parametrize("command", ["HX+", "ZHX+", "HLX+"])
def test_a_search_that_meets_a_limit_ends_there_with_an_error(command: str) -> None:
    pmx = Bench("[bus.drive.world]\nlimit_plus = 2000")
    pmx(command)
    pmx.still()
    assert [pmx("PX"), pmx("MSTX")] == ["2000", str(16 + 128)]


def test_a_search_is_stopped_like_any_motion() -> None:
    for stop, rest in (("STOPX", -335), ("ABORTX", -170)):
        pmx = Bench(WORLD)
        pmx("HLX-")
        pmx.later(0.305)
        pmx(stop)
        assert pmx.still().number("PX") == rest


def test_a_limit_stops_at_once_and_its_error_wants_clearing() -> None:
    pmx = Bench(WORLD)
    pmx("JX+")
    pmx.still()
    assert [pmx("PX"), pmx("MSTX")] == ["3000", str(16 + 128)]
    assert pmx("X0") == "?X0"
    assert pmx("JX-") == "?JX-"
    assert pmx("CLRX", "X0") == "OK"
    assert [pmx.still()("PX"), pmx("MSTX")] == ["0", "0"]
    pmx("X-9999")
    assert [pmx.still()("PX"), pmx("MSTX")] == ["-3000", str(32 + 64 + 256)]
    assert pmx("CLRX", "X-4000") == "OK"
    assert [pmx("PX"), pmx("MSTX")] == ["-3000", str(32 + 64 + 256)]


def test_a_limit_is_no_error_with_ierr() -> None:
    pmx = Bench(WORLD)
    pmx("IERR=1", "JX+")
    assert [pmx.still()("PX"), pmx("MSTX")] == ["3000", "16"]
    assert pmx("IERR=0", "JX+") == "OK"
    assert [pmx("MSTX"), pmx("JX-")] == [str(16 + 128), "?JX-"]
    assert pmx("IERR=1", "JX-") == "OK"


def test_a_limit_of_one_axis_ends_a_line_for_both() -> None:
    pmx = Bench(WORLD)
    pmx("I6000:8000")
    pmx.still().still("Y")
    assert [pmx("PX"), pmx("PY"), pmx.number("MSTY") & ~512] == ["3000", "4000", 0]


# StepNLoop.

FINE = "[bus.drive.world]\nencoder = 2.5\n"


def test_moves_and_speeds_are_in_counts_with_stepnloop() -> None:
    pmx = Bench(FINE)
    assert pmx("SLSX") == "12"
    assert pmx("SLRX=0.4", "SLX=1", "SLSX") == "0"
    pmx("X1000")
    pmx.later(0.5)
    assert [pmx("SLSX"), pmx("PSX"), pmx("PX"), pmx("EX"), pmx("DX")] == ["1", "1000", "365", "365", "0"]
    pmx.still()
    assert [pmx("PX"), pmx("EX"), pmx("SLSX"), place(pmx)] == ["1000", "1000", "0", 400]
    assert pmx("SLX=0", "PX") == "400"


def test_a_slipping_motor_is_corrected_until_it_is_within_tolerance() -> None:
    pmx = Bench("[bus.drive.world]\nslip = 0.1")
    pmx("SLX=1", "X1000")
    pmx.later(0.9)
    assert pmx("SLSX") == "1"
    pmx.later(0.4)
    assert pmx("SLSX") == "2"
    # 100 counts are missing, then 10, which is within the tolerance of 10.
    pmx.still()
    assert [pmx("PX"), pmx("EX"), pmx("DX"), pmx("SLSX")] == ["1000", "990", "10", "0"]


def test_corrections_that_do_not_help_are_given_up() -> None:
    pmx = Bench("[bus.drive.world]\nlocked = [[1, 1000]]")
    pmx("SLAX=3", "SLX=1", "X1000")
    pmx.still()
    assert pmx("SLSX") == "9"
    assert pmx("X0") == "?Clear SNL Error"
    assert pmx("CLRX", "SLSX") == "0"
    assert pmx("DX") == "0"


def test_a_delta_beyond_the_error_range_stops_a_motion() -> None:
    pmx = Bench("[bus.drive.world]\nstall_at = 500")
    pmx("SLEX=200", "SLX=1", "JX+")
    pmx.later(0.4)
    assert pmx("SLSX") == "5"
    pmx.still()
    assert [pmx("SLSX"), pmx("EX")] == ["10", "500"]
    assert pmx.number("DX") == 201 == pmx.number("PX") - 500
    for move in ("X0", "JX-", "HX+", "I0:0"):
        assert pmx(move) == "?Clear SNL Error"
    assert pmx("CLRSX", "SLSX") == "0"
    assert [pmx("PX"), pmx("EX")] == ["500", "500"]


def test_a_push_is_corrected_or_an_error_while_it_stands() -> None:
    pmx = Bench()
    pmx("SLEX=200", "SLX=1", "SLX")
    pmx.floor.command("/sim push 00 5", pmx.now)
    assert [pmx("DX"), pmx("SLSX")] == ["-5", "0"]
    pmx.floor.command("/sim push 00.x 50", pmx.now)
    assert [pmx("DX"), pmx("SLSX")] == ["-55", "2"]
    assert [pmx.still()("EX"), pmx("SLSX")] == ["0", "0"]
    pmx.floor.command("/sim push 00 300", pmx.now)
    assert [pmx("EX"), pmx("SLSX")] == ["300", "8"]
    pmx.floor.command("/sim push 00.y 300", pmx.now)
    assert [pmx("EY"), pmx("SLSY")] == ["300", "12"]


def test_a_limit_is_a_stepnloop_error_too() -> None:
    pmx = Bench(WORLD)
    pmx("SLX=1", "X9000")
    assert [pmx.still()("SLSX"), pmx("X0")] == ["11", "?Clear SNL Error"]
    assert pmx("CLRX", "SLSX") == "0"


def test_the_position_counter_cannot_be_set_with_stepnloop_and_the_encoder_takes_it_along() -> None:
    pmx = Bench()
    assert pmx("SLX=1", "PX=5") == "?PX=5"
    assert pmx("EX=70", "PX") == "70"
    assert pmx("DX") == "0"


@pytest.mark.parametrize(
    ("command", "state"), [("HX-", "6"), ("LX-", "13"), ("ZX+", "7"), ("ZHX-", "7"), ("HLX-", "6")]
)
def test_homing_shows_in_stepnloops_status_and_ends_in_step(command: str, state: str) -> None:
    pmx = Bench(WORLD)
    pmx("SLX=1", command)
    pmx.later(0.2)
    assert pmx("SLSX") == state
    assert [pmx.still()("SLSX"), pmx("DX")] == ["0", "0"]


@pytest.mark.parametrize("stop", ["STOPX", "ABORTX"])
def test_what_was_stopped_is_not_corrected_afterwards(stop: str) -> None:
    pmx = Bench("[bus.drive.world]\nslip = 0.2")
    pmx("SLX=1", "X1000")
    pmx.later(1.0)
    assert pmx(stop) == "OK"
    pmx.later(0.4)
    assert [pmx("SLSX"), pmx("PSX"), pmx("DXX")] == ["0", "0", "0"]
    pmx.floor.command("/sim push 00 -300", pmx.now)
    pmx.later(0.2)
    assert [pmx("SLSX"), pmx(stop)] == ["2", "OK"]
    rested = pmx.later(0.4)("EX")
    assert [pmx("SLSX"), pmx.later(1.0)("EX")] == ["0", rested]


def test_speed_and_target_on_the_fly_are_in_counts_too() -> None:
    pmx = Bench(FINE)
    pmx("SLRX=0.4", "SLX=1", "SSPDMX=1", "X9000")
    pmx.later(1.0)
    pmx("SSPDX=2000", "TX5000")
    pmx.later(1.0)
    assert pmx("PSX") == "2000"
    assert [pmx.still()("PX"), pmx("EX")] == ["5000", "5000"]


# The joystick.


def test_the_stick_commands_speed_from_the_edge_of_its_zone() -> None:
    pmx = Bench("[bus.drive.world]\nanalog = [[0.0, 2500], [1.0, 3700], [5.0, 1300], [9.0, 2599]]")
    pmx("JV1=1000", "JV3=50", "JV5=100", "JL1=-100000", "JL2=-90000", "JL3=90000", "JL4=100000", "SLX=1", "JO=1")
    assert [pmx("SLX"), pmx("MST")] == ["0", "1024:0"]
    pmx.later(0.9)
    assert [pmx("PX"), pmx("AI1")] == ["0", "2500"]
    pmx.later(0.15)
    assert pmx.number("PSX") == 250  # Five looks, 50 pulses/s each.
    pmx.later(2.0)
    assert [pmx("PSX"), pmx("MSTX")] == ["458", str(1024 + 4)]  # (1200 - 100) / 2400
    pmx.later(4.0)
    assert [pmx("PSX"), pmx("AI1")] == ["458", "1300"]
    pmx.later(4.0)
    assert [pmx("PSX"), pmx("MSTX"), pmx("JF")] == ["0", "1024", "OK"]
    assert pmx("MSTX") == "0"


def test_the_sticks_soft_limits_slow_down_and_stop() -> None:
    pmx = Bench("[bus.drive.world]\nanalog = [[0.0, 5000], [12.0, 0]]")
    pmx("JV1=1000", "JV3=1000", "JL1=-2000", "JL2=-1000", "JL3=1000", "JL4=2000", "JO=1")
    pmx.later(1.5)
    assert 1350 < pmx.number("PX") < 1500
    assert pmx.number("PSX") < 700
    pmx.later(10.0)
    assert 1990 <= pmx.number("PX") <= 2000
    assert pmx("PSX") == "0"
    pmx.later(13.0)
    assert -2000 <= pmx.number("PX") <= -1990


def test_a_stop_takes_the_stick_away() -> None:
    for stop in ("ABORT", "STOPX"):
        pmx = Bench("[bus.drive.world]\nanalog = [[0.0, 5000]]")
        pmx("JO")
        pmx.later(0.5)
        assert pmx.number("PSX") > 0
        pmx(stop)
        pmx.later(2.0)
        assert pmx("MSTX") == "0"
