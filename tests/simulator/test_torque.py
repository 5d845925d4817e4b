"""A motor with a torque-speed curve: what stalls it, and what each family reports of that."""

from __future__ import annotations

from itertools import pairwise
from math import asin, inf, pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import MotorSpec, WorldSpec
from multidrop.simulator.kinematics import LINEAR, SINUSOIDAL, TRIANGLE, MotionPace, Profile, Shape, move, slew
from multidrop.simulator.torque import MOTORS, Torque
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.lexium import at, closed_loop, drive, rotor, say
from tests.support.pmx_controller import Bench
from tests.support.tmcl_module import Module

NEMA17 = MOTORS["nema17"]
FLAT = MotorSpec(((0.0, 1.0), (100.0, 1.0)))
"""1 N m at any speed, and a rotor without inertia."""
TURN = 1000.0


def test_a_motor_gives_what_its_rows_say_and_straight_lines_between_them() -> None:
    torque = Torque(WorldSpec(motor=MotorSpec(((0.0, 1.0), (10.0, 0.5), (20.0, 0.3)))))
    found = [torque.available(speed) for speed in (0, 5, 10, 15, 20, 20.001)]
    assert found == pytest.approx([1.0, 0.75, 0.5, 0.4, 0.3, 0.0])


def test_acceleration_of_an_inertia_takes_two_pi_times_both() -> None:
    """0.01 kg m2 at 10 rev/s2 take 0.628 N m; at a current of 62 % there is less than that."""
    torque = Torque(WorldSpec(motor=FLAT, inertia=0.01))
    profile = move(0.0, 0.0, 0.0, 50_000.0, MotionPace(vi=0.0, vm=5000.0, a=10_000.0, d=10_000.0))
    assert torque.fails_at(profile, 0.0, 0.63, TURN) == inf
    assert torque.fails_at(profile, 0.0, 0.62, TURN) == 0.0
    assert torque.used(profile, 0.1, 0.63, TURN) == pytest.approx(0.2 * pi / 0.63)
    assert torque.used(profile, 1.0, 0.63, TURN) == 0.0, "at a steady speed"


def test_a_load_helps_to_brake_and_an_inertia_can_take_too_much_then() -> None:
    torque = Torque(WorldSpec(motor=FLAT, inertia=0.01, load=0.3))
    profile = move(0.0, 0.0, 0.0, 50_000.0, MotionPace(vi=0.0, vm=5000.0, a=1_000.0, d=20_000.0))
    braking = profile.segments[-1].start
    assert torque.fails_at(profile, 0.0, 0.5, TURN) == pytest.approx(braking), "1.257 - 0.3 N m"
    assert torque.fails_at(profile, 0.0, 0.96, TURN) == inf


def test_friction_that_grows_with_the_speed_is_met_in_the_middle_of_a_ramp() -> None:
    """0.1 N m for each rev/s: 0.5 N m are there up to 5 rev/s, after 0.5 s."""
    torque = Torque(WorldSpec(motor=FLAT, friction=0.1))
    profile = slew(0.0, 0.0, 0.0, 8000.0, MotionPace(vi=0.0, vm=inf, a=10_000.0, d=10_000.0))
    assert torque.fails_at(profile, 0.0, 0.5, TURN) == pytest.approx(0.5)
    assert torque.fails_at(profile, 0.0, 0.81, TURN) == inf


def brute_force(torque: Torque, profile: Profile, share: float) -> bool:
    """Whether any of many moments asks for too much; those of the joints are left out."""
    ends = [each.start for each in profile.segments] + [profile.end]
    parts = (0.001, *(n / 20 for n in range(1, 20)), 0.999)
    moments = (low + (high - low) * part for low, high in pairwise(ends) for part in parts)
    return any(abs(torque.used(profile, t, share, TURN)) >= 1 for t in moments)


@examples(25, nightly=2000)
@given(
    rates=st.tuples(st.floats(1e3, 1e6), st.floats(1e3, 1e6)),
    top=st.floats(500, 60_000),
    kind=st.sampled_from([LINEAR, TRIANGLE, SINUSOIDAL]),
    share=st.floats(0.05, 1.0),
    world=st.tuples(st.floats(0, 0.9), st.floats(0, 0.01), st.floats(0, 1e-4)),
)
def test_the_time_of_a_stall_is_found_where_looking_often_finds_one(
    rates: tuple[float, float], top: float, kind: int, share: float, world: tuple[float, float, float]
) -> None:
    load, friction, inertia = world
    torque = Torque(WorldSpec(motor=NEMA17, load=load, friction=friction, inertia=inertia))
    shape = Shape(kind)
    profile = move(0.0, 0.0, 0.0, 40_000.0, MotionPace(vi=100.0, vm=top, a=rates[0], d=rates[1], up=shape, down=shape))
    found, more, less = (torque.fails_at(profile, 0.0, share * part, TURN) for part in (1, 1.02, 0.98))
    assert less <= found <= more
    seen = brute_force(torque, profile, share)
    assert seen if more < inf else not seen or less < inf


def test_an_open_loop_without_an_encoder_loses_steps_and_does_not_know_it() -> None:
    device = drive("MR 51200", motor=NEMA17, load=0.3)
    assert at(device, 5, "P", "ER", "ST") == ["51200", "0", "0"] and rotor(device) == 0


def test_with_an_encoder_a_move_that_takes_too_much_current_is_a_stall() -> None:
    """RC is 25 % from the factory: a load of 0.2 leaves 0.05 of 0.45 N m, at rest."""
    seen: dict[int, list[str | int]] = {}
    for current in (15, 25, 60, 100):
        device = drive("EE=1", f"RC={current}", "VM=40000", "MR 8000", motor=NEMA17, load=0.2)
        device.advance(5)
        seen[current] = [*say(device, "PR P", "PR ST", "PR ER"), rotor(device)]
    assert seen[100] == ["8000", "0", "0", 102_400]
    assert seen[60] == ["8000", "0", "0", 102_400], "at 10 rev/s there are 0.27 N m at full current"
    assert seen[25][1:3] == ["1", "86"] and 0 < int(seen[25][3]) < 102_400, "in the ramp"
    assert seen[15] == ["0", "1", "86", 0], "at once"


def test_a_shaft_that_has_stalled_turns_again_with_the_next_motion() -> None:
    device = drive("EE=1", "A=2000000", "VM=40000", "MR 4000", motor=NEMA17, inertia=1e-3)
    assert at(device, 3, "C2", "ER") == ["0", "86"]
    say(device, "A=10000", "D=10000", "VM=2000", "MA 1000")
    assert at(device, 6, "P", "ER") == ["1000", "0"]


def test_a_current_that_is_set_in_the_middle_of_a_move_counts_at_once() -> None:
    device = drive("EE=1", "RC=80", "SL 4000", motor=NEMA17, load=0.3)
    assert at(device, 2, "ST", "V") == ["0", "4000"]
    say(device, "RC=20")
    assert at(device, 2.1, "ST", "V", "ER") == ["1", "0", "86"]


def test_with_hmt_a_move_that_takes_too_much_for_a_moment_lags_and_is_made_up() -> None:
    device = closed_loop("RC=10", "A=20000000", "LG=2000000", "LT=5000", "VM=400000", motor=NEMA17, inertia=2e-5)
    say(device, "MR 200000")
    assert at(device, 0.2, "LL", "MV") != ["0", "1"]
    assert at(device, 3, "LL", "MV", "ER", "P") == ["0", "0", "0", "200000"] and rotor(device) == 200_000


def test_with_hmt_a_load_that_the_current_cannot_turn_locks_the_rotor() -> None:
    device = closed_loop("LT=300", "LG=2000000", motor=NEMA17, load=0.4)
    say(device, "MR 512000")
    assert at(device, 5, "LR", "ER", "AV") == ["1", "104", "0"] and rotor(device) == 0


def test_the_rotor_lags_its_field_by_the_sine_of_the_torque_that_it_needs() -> None:
    """Half of the torque: a third of a full step of 256. A count is 12.8 steps."""
    device = drive("RC=60", "SL 51200", motor=FLAT, load=0.3)
    device.advance(2)
    command, counts = (int(each) for each in say(device, "PR C1", "PR C2"))
    assert command - counts * 12.8 == pytest.approx(asin(0.5) * 2 / pi * 256, abs=12.8)
    closed = closed_loop("RC=60", motor=FLAT, load=0.3)
    say(closed, "SL 51200")
    assert at(closed, 2, "LL") == ["85"]
    say(closed, "SL 0")
    assert at(closed, 4, "LL") == ["0"]


def test_a_pmx_with_a_loop_reports_a_stall_and_one_without_loses_the_pulses() -> None:
    cell = 'motor = "nema17"\n[bus.drive.world]\nload = 0.5\ninertia = {}\nfriction = {}'
    for inertia, friction, stalls in ((0, 0, False), (0.1, 0, True), (0, 0.6, True)):
        pmx = Bench(cell.format(inertia, friction))
        pmx("X2000")
        pmx.still()
        assert (pmx.number("EX") < 2000) is stalls
        pmx("EX=0", "PX=0", "SLX=1", "X2000")
        pmx.still()
        assert pmx("SLSX") == ("10" if stalls else "0")


def test_a_tmcl_module_shows_the_reserve_of_its_torque_and_stops_on_a_stall() -> None:
    """Parameter 6 is the current of 255."""
    module = Module(motor=FLAT, load=0.3, settings={"6": 153})
    module.ask("SAP 181, 0, 1000")
    module.ask("ROR 0, 51200")
    module.wait(3.0)
    assert (module.ask("GAP 206, 0"), module.ask("GAP 3, 0")) == (round(1023 * 0.5), 51200)
    module.ask("SAP 6, 0, 75")
    module.wait(0.1)
    assert (module.ask("GAP 206, 0"), module.ask("GAP 3, 0")) == (0, 0)
    module.ask("SAP 6, 0, 80")
    module.ask("ROR 0, 51200")
    module.wait(3.0)
    assert module.ask("GAP 3, 0") == 51200, "the next motion turns it again"


def test_a_stalled_shaft_turns_again_where_the_command_turns_back() -> None:
    """0.1 N m for each rev/s: 0.6 N m are there up to 6 rev/s, of 51200 microsteps."""
    module = Module(motor=FLAT, friction=0.1, settings={"6": 153, "5": 500_000, "4": 1_000_000})
    module.ask("ROR 0, 409600")
    module.wait(2.0)
    assert (module.ask("GAP 3, 0"), module.ask("GAP 206, 0")) == (409_600, 0)
    stalled = module.device.motors[0].shaft.position(module.now)
    module.ask("ROL 0, 102400")
    module.wait(0.5)
    assert module.device.motors[0].shaft.position(module.now) == stalled, "it slows down"
    module.wait(2.0)
    assert module.ask("GAP 206, 0") == round(1023 * (1 - 0.2 / 0.6))
    assert module.device.motors[0].shaft.position(module.now) < stalled - 51_200


def cell(lines: str, personality: str = "LMDCM") -> str:
    return f'[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "{personality}"\n{lines}\n'


def test_every_axis_gets_the_motor_of_its_drive_and_a_file_has_its_rows(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_bytes(
        b"\xef\xbb\xbf# of a motor\r\nrev/s, N m\r\n# measured by hand\r\n0, 2.5\r\n10,1.25 # at 24 V\r\n\r\n"
    )
    own = MotorSpec(((0.0, 2.5), (10.0, 1.25)))
    for lines, motor in (
        ('motor = "own.csv"', own),
        ('motor = "nema34"', MOTORS["nema34"]),
        ("motor = [[0, 2.5], [10, 1.25]]", own),
    ):
        (tmp_path / "c.toml").write_text(cell(lines, "PMX"))
        (found,) = cells.load(tmp_path / "c.toml").buses[0].drives
        assert [each.motor for each in (found.world, *found.further)] == [motor, motor]
        placed = cells.placed(str(tmp_path / "c.toml"))
        again = cells.read_drive(placed.table, "")
        assert again.world.motor == motor, "a worker reads no file"


CLASSES = "valid: nema17, nema23, nema34, FILE.csv"
RANGE = "valid: 0 to 1000 rev/s, 0 to 10000 N m"
CURVES = "motor: m.csv"


@for_each(
    "lines, rows, complaint",
    [
        ('motor = "nema18"', "", f'motor cannot be "nema18"; {CLASSES}'),
        ("motor = 17", "", "motor must be text, not 17"),
        ('motor = "no.csv"', "", 'motor "no.csv" does not exist; paths are relative to the cell file'),
        ('motor = "m.csv"', "0, 1|5; 0.5", f'{CURVES}:2 cannot be "5; 0.5"; valid: rev/s, N m, as in 5, 0.38'),
        ('motor = "m.csv"', "0, 1|5, nan", f'{CURVES}:2 cannot be "5, nan"; valid: rev/s, N m, as in 5, 0.38'),
        ('motor = "m.csv"', "0, 1|1_0, 1", f'{CURVES}:2 cannot be "1_0, 1"; valid: rev/s, N m, as in 5, 0.38'),
        ('motor = "m.csv"', "0, 1|5, 1e9", f'{CURVES}:2 is out of range: "5, 1e9"; {RANGE}'),
        ('motor = "m.csv"', "0, 1", f"{CURVES} has 1 rows; valid: 2 to 1000, each a speed and a torque"),
        ('motor = "m.csv"', "1, 1|2, 1", f"{CURVES} begins at 1, 1; the first row is 0 and the holding torque"),
        ('motor = "m.csv"', "0, 1|2, 1|2, 0.5", f"{CURVES} must go up in speed, not from 2 to 2 rev/s"),
        ("world = { friction = 0.1 }", "", f"motor is missing, and the world has friction or inertia; {CLASSES}"),
        ('motor = "nema17"\nworld = { inertia = -1 }', "", "inertia must be from 0 to 1000, not -1"),
    ],
)  # fmt: skip
def test_a_wrong_motor_is_one_line_that_says_what_where_and_what_to_do(
    tmp_path: Path, lines: str, rows: str, complaint: str
) -> None:
    (tmp_path / "m.csv").write_text(rows.replace("|", "\n"))
    (tmp_path / "c.toml").write_text(cell(lines))
    with pytest.raises(Diagnostic) as raised:
        cells.load(tmp_path / "c.toml")
    problem = raised.value
    assert "; ".join(filter(None, (problem.message, problem.hint))) == complaint
    assert str(problem).count("\n") == 0 and str(tmp_path / "c.toml") in str(problem)


def test_a_motor_of_another_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("0, 1\n5, 0.5\n")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "c.toml").write_text(cell('motor = "../m.csv"'))
    with pytest.raises(Diagnostic, match="leaves the folder of the cell file"):
        cells.load(tmp_path / "in" / "c.toml")


@examples(25, nightly=1000)
@given(looks=st.lists(st.floats(0.001, 0.7), max_size=8), load=st.floats(0, 0.6), inertia=st.floats(0, 2e-3))
def test_being_looked_at_changes_no_stall(looks: list[float], load: float, inertia: float) -> None:
    """Whatever moment a drive is asked at, its shaft stalls where and when it does without being asked."""

    def ends(asked: list[float]) -> list[object]:
        device = drive(
            "EE=1", "SM=1", "RC=70", "PM=0", "DB=65000", "A=200000", motor=NEMA17, load=load, inertia=inertia
        )
        module = Module(motor=NEMA17, load=load, inertia=inertia, settings={"6": 180, "5": 500_000})
        say(device, "MR 8000")
        module.ask("MVP ABS, 0, 200000")
        for seconds in asked:
            device.advance(device.now + seconds)
            module.wait(seconds)
            module.ask("GAP 206, 0")
        device.advance(20.0)
        module.wait(20.0 - module.now)
        return [
            *say(device, "PR C1", "PR ER"),
            round(rotor(device), -1),
            round(module.device.motors[0].shaft.position(20.0), 3),
        ]

    assert ends(looks) == ends([])
