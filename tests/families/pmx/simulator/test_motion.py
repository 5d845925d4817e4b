"""Motion of the simulated PMX: figures worked out by hand from the manual's 7.1 to 7.9 and appendix A.

With LSPD 100, HSPD 1000 and ACC 300 ms a ramp is 3000 pulses/s2, lasts 0.3 s and goes (1000^2 - 100^2) / 6000 = 165.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.examples import examples
from tests.support.pmx_controller import Bench


def test_a_long_move_is_a_trapezoid() -> None:
    pmx = Bench()
    assert pmx("X1000") == "OK"
    pmx.later(0.1)
    assert [pmx(word) for word in ("PSX", "PX", "MSTX")] == ["400", "25", "1"]
    pmx.later(0.3)
    assert [pmx(word) for word in ("PSX", "PX", "MSTX")] == ["1000", "265", "4"]
    pmx.later(0.3 + 0.67 - 0.4 + 0.2)
    assert [pmx(word) for word in ("PSX", "MSTX")] == ["400", "2"]
    pmx.still()
    assert pmx.now == pytest.approx(0.3 + 0.67 + 0.3)
    assert [pmx(word) for word in ("PX", "EX", "PSX", "MSTX", "PS", "MST")] == ["1000", "1000", "0", "0", "0:0", "0:0"]


def test_a_short_move_is_a_triangle() -> None:
    pmx = Bench()
    pmx("X200")
    pmx.later(0.1)
    assert pmx("MSTX") == "1"
    # The peak is sqrt(100^2 + 2 * 3000 * 100) = 781 at 100 pulses.
    pmx.still()
    assert pmx.now == pytest.approx(2 * (610000**0.5 - 100) / 3000)


def test_deceleration_is_the_accelerations_unless_edec_is_on() -> None:
    for edec, seconds in (("0", 0.3), ("1", 0.6)):
        pmx = Bench()
        pmx(f"EDEC={edec}", "DEC=600", "X5000")
        pmx.later(1.0)
        pmx("STOPX")
        begun = pmx.now
        assert pmx.still().now - begun == pytest.approx(seconds)


def test_a_slow_ramp_that_does_not_fit_its_half_is_replaced_by_the_first_one() -> None:
    # DEC 600 ms would go 330 of 500 pulses, more than half: both ramps are of 300 ms, 165 pulses each (A.2).
    pmx = Bench()
    pmx("EDEC=1", "DEC=600", "X500")
    assert pmx.still().now == pytest.approx(0.6 + 170 / 1000)
    pmx = Bench()
    pmx("EDEC=1", "DEC=600", "X1000")
    assert pmx.still().now == pytest.approx(0.3 + 0.6 + (1000 - 165 - 330) / 1000)


def test_an_individual_speed_counts_unless_it_is_zero() -> None:
    pmx = Bench()
    pmx("HSPD=10000", "HSPDX=2000", "LSPD=300", "ACCX=500", "ACC=300", "JX+", "JY+")
    pmx.later(1.0)
    assert [pmx("PSX"), pmx("PSY")] == ["2000", "10000"]
    assert pmx("HSPDX=0", "ABORT", "JX+") == "OK"
    pmx.later(2.0)
    assert pmx("PSX") == "10000"


@pytest.mark.parametrize(
    ("high", "low", "longest"),
    [(20_000, 10_000, 12.903), (900_000, 9_000, 23.203), (16_000, 1_000, 50.0)],
)
def test_an_acceleration_time_is_held_to_what_appendix_a_allows(high: int, low: int, longest: float) -> None:
    pmx = Bench()
    pmx(f"HSPD={high}", f"LSPD={low}", "ACC=1000000", "JX+")
    pmx.later(longest - 0.01)
    assert pmx.number("MSTX") & 7 == 1
    pmx.later(0.02)
    assert pmx.number("MSTX") & 7 == 4
    assert pmx("ACC") == "1000000"


def test_a_low_speed_must_suit_the_window_of_the_high_one() -> None:
    pmx = Bench()
    assert pmx("HSPD=1000000", "LSPD=99", "X10") == "?Low speed out of range"
    assert pmx("LSPD=100", "X10") == "OK"
    assert Bench()("HSPD=500", "LSPD=501", "JX+") == "?Low speed out of range"
    assert Bench()("LSPD=0") == "?Low speed out of range"


def test_an_s_curve_lasts_as_long_and_ends_on_the_target() -> None:
    pmx = Bench()
    pmx("SCVX=1", "X1000")
    pmx.later(0.05)
    assert pmx.number("PSX") < 250  # A straight ramp has 250 there.
    assert pmx.still().now == pytest.approx(1.27)
    assert pmx("PX") == "1000"


def test_incremental_moves_go_on_from_the_counter() -> None:
    pmx = Bench()
    assert pmx("MM") == "0"
    pmx("INC", "PX=500", "X-200")
    assert pmx("MM") == "1"
    pmx.still()
    assert [pmx("PX"), pmx("EX")] == ["300", "-200"]
    pmx("X-200")
    pmx.still()
    assert pmx("PX") == "100"


def test_a_jog_goes_on_until_it_is_stopped_with_a_ramp_or_aborted_at_once() -> None:
    pmx = Bench()
    pmx("J-")
    pmx.later(1.3)
    assert [pmx("PX"), pmx("PY"), pmx("MST")] == ["-1165", "-1165", "4:4"]
    pmx("STOPX", "ABORTY")
    assert [pmx("MSTX"), pmx("MSTY"), pmx("PY")] == ["2", "0", "-1165"]
    pmx.still()
    assert [pmx("PX"), pmx("PSX")] == ["-1330", "0"]


def test_what_moves_takes_no_other_motion_and_no_position() -> None:
    pmx = Bench()
    pmx("X1000")
    pmx.later(0.1)
    for text in ("X5", "JX+", "I1:1", "X1Y1", "HX+", "LX-", "ZX+", "ZHX-", "HLX+", "PX=0", "EX=0", "SLX=1", "SSPDMX=1"):
        assert pmx(text) == "?Moving", text
    assert pmx("Y1000") == "OK"
    pmx.still().still("Y")
    assert [pmx("PX"), pmx("PY")] == ["1000", "1000"]


def test_a_target_is_changed_on_the_fly_ahead_and_behind() -> None:
    pmx = Bench()
    assert pmx("TX500") == "?ABS/INC is not in operation"
    pmx("X1000")
    pmx.later(0.5)
    assert pmx("TX2000") == "OK"
    pmx.later(0.5)
    assert [pmx("PX"), pmx("MSTX")] == ["865", "4"]
    assert pmx("TX100") == "OK"
    pmx.later(0.4)
    assert pmx.number("PX") > 865
    pmx.still()
    assert pmx("PX") == "100"
    pmx("JX+")
    assert pmx("TX1") == "?ABS/INC is not in operation"


def test_a_speed_is_changed_on_the_fly_within_its_window() -> None:
    pmx = Bench()
    pmx("SSPDMX=1", "JX+")
    pmx.later(1.0)
    assert pmx("SSPDX=4000") == "OK"
    pmx.later(0.5)
    assert [pmx("PSX"), pmx("MSTX")] == ["2500", "1"]
    pmx.later(0.5)
    assert [pmx("PSX"), pmx("MSTX")] == ["4000", "4"]
    assert pmx("SSPDX=16001") == "?Speed out of range"
    assert pmx("SSPDX=500") == "OK"
    pmx.later(2.0)
    assert pmx("PSX") == "500"


def test_a_move_with_another_speed_still_ends_on_its_target() -> None:
    pmx = Bench()
    pmx("SSPDMX=1", "X5000")
    pmx.later(1.0)
    pmx("SSPDX=3000")
    pmx.still()
    assert pmx("PX") == "5000"
    assert pmx.now < 4.0


def test_speed_changes_that_cannot_be_say_why() -> None:
    pmx = Bench()
    pmx("JX+")
    assert pmx("SSPDX=500") == "?SSPD Mode not Initialized"
    pmx("ABORT", "SSPDMX=2", "SCVX=1", "JX+")
    assert pmx("SSPDX=20000") == "?S-curve on"
    pmx("ABORT", "SCVX=0", "I1000:1000")
    assert pmx("SSPDX=20000") == "?ICommandOn"
    pmx("ABORT", "JX+")
    assert pmx("SSPDX=16000") == "OK"
    assert pmx("SSPDX=15999") == "?Speed out of range"
    assert pmx("ABORT", "SSPDMX=9", "SSPDX=6000001") == "?Speed out of range"


def test_a_line_is_straight_and_has_the_global_speed_along_its_way() -> None:
    pmx = Bench()
    assert pmx("HSPDX=50", "I3000:-4000") == "OK"
    pmx.later(1.0)
    assert [pmx("PSX"), pmx("PSY"), pmx("PS")] == ["600", "800", "600:800"]
    assert pmx.number("PX") * 4 == pytest.approx(-3 * pmx.number("PY"), abs=4)
    assert pmx("TX100") == "?ABS/INC is not in operation"
    pmx.still().still("Y")
    assert pmx.now == pytest.approx(0.6 + (5000 - 330) / 1000)
    assert [pmx("PX"), pmx("PY")] == ["3000", "-4000"]


@pytest.mark.parametrize("stop", ["STOP", "STOPX", "STOPY", "ABORT", "ABORTX", "ABORTY"])
def test_a_stop_of_one_axis_stops_the_whole_line(stop: str) -> None:
    pmx = Bench()
    pmx("X3000Y4000")
    pmx.later(1.0)
    assert pmx(stop) == "OK"
    pmx.later(0.3)
    assert pmx("MST") == "0:0"
    assert pmx.number("PX") * 4 == pytest.approx(3 * pmx.number("PY"), abs=4)


def test_a_line_along_one_axis_leaves_the_other_alone() -> None:
    pmx = Bench()
    pmx("I500:0")
    assert pmx("MSTY") == "0"
    pmx.still()
    assert [pmx("PX"), pmx("PY"), pmx("MST")] == ["500", "0", "0:0"]


def test_counters_are_32_bits_wide() -> None:
    pmx = Bench()
    assert pmx("PX=2147483648") == "?Invalid Answer"
    pmx("PX=2147483647", "INC", "X1")
    pmx.still()
    assert pmx("PX") == "-2147483648"
    pmx("EX=-5", "X10")
    pmx.still()
    assert pmx("EX") == "5"


def test_a_motor_without_current_stands_while_the_pulses_are_counted() -> None:
    pmx = Bench()
    pmx("EO1=0", "X1000")
    pmx.still()
    assert [pmx("PX"), pmx("EX"), pmx("EO")] == ["1000", "0", "2"]


def test_the_polarity_of_the_direction_turns_the_motor_and_the_decoding_multiplies_the_counts() -> None:
    pmx = Bench()
    pmx("POLX=514", "X1000")
    pmx.still()
    assert [pmx("PX"), pmx("EX")] == ["1000", "-4000"]
    pmx("POLX=258")
    assert pmx("EX") == "-4000"


def test_what_the_rotor_cannot_pass_loses_steps_and_lets_it_go_the_other_way() -> None:
    pmx = Bench("[bus.drive.world]\nstall_at = 600")
    pmx("X1000")
    pmx.still()
    assert [pmx("PX"), pmx("EX")] == ["1000", "600"]
    pmx("X900")
    pmx.still()
    assert pmx("EX") == "500"
    pmx("X2000")
    pmx.still()
    assert pmx("EX") == "600"


SCRIPTS = [
    ("HSPD=3000", "X4000", "JY+"),
    ("RZ=1", "HLX-", "I0:0"),
    ("SLRX=0.5", "SLX=1", "X700"),
    ("SCVX=1", "SCVY=1", "I900:-900"),
    ("JV1=800", "JL4=400", "JL3=100", "JO=1", "ZY+"),
    ("EDEC=1", "DEC=900", "SSPDMX=1", "X3000", "SSPDX=200", "TX-100"),
]


@pytest.mark.slow
@examples(20, nightly=300)
@given(st.sampled_from(SCRIPTS), st.lists(st.floats(0.001, 1.5), min_size=1, max_size=8))
def test_being_looked_at_changes_nothing(script: tuple[str, ...], looks: list[float]) -> None:
    world = "[bus.drive.world]\nhome = -250\nslip = 0.05\nstall_at = 900\nencoder = 2\nanalog = [[0.0, 4000]]"
    watched, left = Bench(world), Bench(world)
    for pmx in (watched, left):
        for command in script:
            pmx.send(f"@00{command}\r".encode())
    for seconds in looks:
        watched.now += seconds
        watched.send(b"@00MSTX\r@00PX\r")
        left.now += seconds
    words = ["MST", "PX", "PY", "EX", "EY", "PS", "SLSX", "DXX"]
    assert [watched(word) for word in words] == [left(word) for word in words]
