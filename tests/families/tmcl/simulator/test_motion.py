"""Motion of a simulated TMCL module: rotations, moves, limits, walls, searches, in virtual time."""

import pytest

from multidrop.families.tmcl.host import codec
from tests.support.tmcl_module import Module


def test_it_rotates_until_it_is_stopped():
    module = Module()
    module.ask("ROR 0, 51200")
    module.wait(2.0)
    assert module.ask("GAP 3, 0") == 51200
    module.ask("MST 0")
    module.wait(2.0)
    assert module.ask("GAP 3, 0") == 0
    there = module.ask("GAP 1, 0")
    module.wait(5.0)
    assert module.ask("GAP 1, 0") == there > 0


def test_left_is_the_other_way_round():
    module = Module()
    module.ask("ROL 0, 1000")
    module.wait(1.0)
    assert (module.ask("GAP 3, 0"), module.ask("GAP 2, 0")) == (-1000, -1000)


@pytest.mark.parametrize("target", [512000, -7, 1, 2**31 - 1])
def test_a_move_ends_on_its_target(target):
    module = Module(settings={"4": 8_000_000, "5": 16_000_000})
    assert module.ask(f"MVP ABS, 0, {target}") == target
    assert module.ask("GAP 8, 0") == 0
    module.rest()
    assert (module.ask("GAP 1, 0"), module.ask("GAP 8, 0")) == (target, 1)


def test_a_relative_move_counts_from_the_last_target():
    module = Module()
    module.ask("MVP ABS, 0, 1000")
    assert module.ask("MVP REL, 0, 500") == 1500
    module.rest()
    assert module.ask("GAP 1, 0") == 1500


def test_setting_the_target_moves_and_setting_the_position_does_not_while_it_rotates():
    module = Module()
    module.ask("SAP 0, 0, 2000")
    module.rest()
    assert module.ask("GAP 1, 0") == 2000
    module.ask("MST 0")
    module.ask("SAP 1, 0, 0")
    module.wait(1.0)
    assert module.ask("GAP 1, 0") == 0


def test_setting_the_position_alone_makes_it_move_to_its_old_target():
    module = Module()
    module.ask("SAP 1, 0, 500")
    module.rest()
    assert module.ask("GAP 1, 0") == 0


def test_a_position_wraps_around_after_32_bits():
    module = Module(settings={"4": 8_000_000, "5": 16_000_000})
    module.ask("MVP ABS, 0, 2147483647")
    module.rest()
    module.ask("ROR 0, 1000")
    module.wait(1.0)
    assert module.ask("GAP 1, 0") < -(2**31) + 2000


@pytest.mark.parametrize(("way", "switch", "world"), [("ROR", 10, "limit_plus"), ("ROL", 11, "limit_minus")])
def test_a_limit_switch_stops_at_once_and_lets_it_away(way, switch, world):
    place = 5000 if way == "ROR" else -5000
    module = Module(**{world: float(place)})
    module.ask(f"{way} 0, 20000")
    module.wait(5.0)
    assert module.ask("GAP 3, 0") == 0 and module.ask(f"GAP {switch}, 0") == 1
    assert abs(module.ask("GAP 1, 0") - place) <= 1
    module.ask(f"{way} 0, 20000")
    module.wait(0.5)
    assert module.ask("GAP 3, 0") == 0
    module.ask("MVP ABS, 0, 0")
    module.rest()
    assert module.ask("GAP 1, 0") == 0 and module.ask(f"GAP {switch}, 0") == 0


def test_a_limit_switch_that_is_off_stops_nothing():
    module = Module(limit_plus=5000.0, settings={"12": 1})
    module.ask("MVP ABS, 0, 9000")
    module.rest()
    assert module.ask("GAP 1, 0") == 9000


def test_a_wall_loses_steps_that_the_module_does_not_see():
    module = Module(stall_at=3000.0, limit_plus=2999.0, settings={"12": 1})
    module.ask("MVP ABS, 0, 9000")
    module.rest()
    assert module.ask("GAP 1, 0") == 9000 and module.ask("GAP 10, 0") == 1
    module.ask("MVP ABS, 0, 8000")
    module.rest()
    assert module.ask("GAP 10, 0") == 0


@pytest.mark.parametrize("end", ["RFS STOP, 0", "MST 0", "MVP ABS, 0, 0"])
def test_a_search_is_ended_by_the_host(end):
    module = Module(limit_minus=-200000.0)
    module.ask("RFS START, 0")
    module.wait(1.0)
    module.ask(end)
    assert module.ask("RFS STATUS, 0") == 0
    module.rest()


def test_it_says_when_the_target_is_reached():
    module = Module()
    module.ask("MVP ABS, 0, 5000")
    assert module.ask("138 0, 0, 1") == 1
    notice = codec.parse_reply(module.wait(5.0))
    assert notice is not None and (notice.status, notice.command, notice.value) == (128, 138, 1)


@pytest.mark.parametrize(
    ("text", "status"),
    [
        ("GAP 250, 0", 3),
        ("SAP 193, 0, 9", 4),
        ("SAP 193, 0, 69", 4),
        ("SAP 193, 0, 129", 4),
        ("SAP 3, 0, 1", 3),
        ("SAP 140, 0, 9", 4),
        ("ROR 1, 100", 3),
        ("ROR 0, 9000000", 4),
        ("MVP COORD, 0, 21", 4),
        ("MVP COORD, 71, 1", 3),
        ("30 21, 0, 5", 3),
        ("30 1, 1, 5", 3),
        ("32 0, 255, 0", 3),
        ("GGP 1, 0", 3),
        ("GGP 66, 1", 3),
        ("GGP 66, 4", 4),
        ("SGP 66, 0, 0", 4),
        ("200 0, 0, 0", 2),
        ("137 0, 0, 1", 4),
        ("RFS 3, 0", 3),
        ("STAP 1, 0", 3),
    ],
)
def test_refusals_change_nothing(text, status):
    module = Module()
    module.ask("MVP ABS, 0, 5000")
    assert module.refusal(text) == status
    module.rest()
    assert module.ask("GAP 1, 0") == 5000


def test_parameters_are_kept_by_stap_only():
    module = Module()
    module.ask("SAP 4, 0, 1234")
    module.ask("SAP 5, 0, 4321")
    module.ask("STAP 5, 0")
    module.device.power(False, 0.0)
    module.device.power(True, 0.0)
    assert (module.ask("GAP 4, 0"), module.ask("GAP 5, 0")) == (51200, 4321)
    module.ask("SAP 5, 0, 99")
    module.ask("RSAP 5, 0")
    assert module.ask("GAP 5, 0") == 4321


def test_power_off_ends_motion_and_the_shaft_stays():
    module = Module(limit_plus=1.0, settings={"12": 1})
    module.ask("ROR 0, 51200")
    module.wait(1.0)
    module.device.power(False, module.now)
    module.wait(1.0)
    module.device.power(True, module.now)
    assert (module.ask("GAP 1, 0"), module.ask("GAP 3, 0"), module.ask("GAP 10, 0")) == (0, 0, 1)
    module.wait(1.0)
    assert module.ask("GAP 1, 0") == 0


def test_a_maximum_velocity_starts_a_move_that_waits_for_one():
    module = Module(settings={"4": 0})
    module.ask("MVP ABS, 0, 1000")
    module.wait(1.0)
    assert module.ask("GAP 1, 0") == 0
    module.ask("SAP 4, 0, 5000")
    module.rest()
    assert module.ask("GAP 1, 0") == 1000


@pytest.mark.parametrize(("option", "target"), [(0, 101_000), (1, 13_800), (2, 13_800)])
def test_after_a_stop_parameter_127_says_from_where_a_relative_move_counts(option, target):
    module = Module(settings={"127": option, "5": 51_200})
    module.ask("MVP ABS, 0, 100000")
    module.wait(0.5)
    module.ask("MST 0")
    module.rest()
    assert (module.ask("GAP 1, 0"), module.ask("GAP 0, 0")) == (12_800, 100_000)
    assert module.ask("MVP REL, 0, 1000") == target


@pytest.mark.parametrize(("product", "speed"), [("TMCM", 10_000), ("TMCM-1140", 1000)])
def test_a_stall_at_the_velocity_of_181_stops_the_motor_and_a_slower_one_does_not(product, speed):
    module = Module(product=product, stall_at=20_000, load=0.25)
    assert module.ask("GAP 206, 0") == 0
    module.ask(f"SAP 181, 0, {speed + 1}")
    module.ask(f"ROR 0, {speed}")
    module.wait(0.01)
    assert module.ask("GAP 206, 0") == round(1023 * 0.75)
    module.wait(60.0)
    assert (module.ask("GAP 3, 0"), module.ask("GAP 206, 0")) == (speed, 0)
    module.ask(f"SAP 181, 0, {speed}")
    assert module.ask("GAP 3, 0") == 0


def test_a_stalled_motor_stops_when_it_becomes_that_fast_whenever_it_is_asked():
    places = set()
    for asked in (0.01, 0.3, 5.0):
        module = Module(stall_at=1, settings={"5": 10_000, "181": 4_000})
        module.ask("ROR 0, 10000")
        for _ in range(int(5.0 / asked)):
            module.wait(asked)
            module.ask("GAP 3, 0")
        places.add(module.ask("GAP 1, 0"))
    assert places == {800}  # v^2 / 2a


def test_the_heartbeat_stops_a_motor_where_no_command_comes_and_any_command_keeps_it_awake():
    module = Module(settings={"G68": 500})
    module.ask("ROR 0, 1000")
    for _ in range(5):
        module.wait(0.4)
        assert module.ask("GAP 3, 0") == 1000
    module.wait(2.0)
    assert module.device.motors[0].read(3, module.now) == 0
    there = module.ask("GAP 1, 0")
    module.ask("ROR 0, 1000")
    module.wait(0.4)
    assert module.ask("GAP 1, 0") > there


@pytest.mark.parametrize("settings", [{}, {"G68": 0}])
def test_without_a_heartbeat_a_motor_runs_on(settings):
    module = Module(settings=settings)
    module.ask("ROR 0, 1000")
    module.wait(100.0)
    assert module.ask("GAP 3, 0") == 1000


def test_the_heartbeat_ends_a_search_and_leaves_a_motor_at_rest_alone():
    module = Module(settings={"G68": 500, "193": 1}, limit_minus=-(10**9))
    module.ask("MVP ABS, 0, 10")
    module.rest()
    module.wait(2.0)
    assert (module.ask("GAP 8, 0"), module.ask("GGP 68, 0")) == (1, 500)
    module.ask("RFS START, 0")
    module.wait(2.0)
    assert (module.ask("RFS STATUS, 0"), module.ask("GAP 3, 0")) == (0, 0)


def test_a_twin_hears_no_reads_and_is_not_stopped_by_a_heartbeat():
    module = Module(settings={"G68": 500})
    module.device.unwatch()
    module.ask("ROR 0, 1000")
    module.wait(5.0)
    assert module.ask("GAP 3, 0") == 1000
