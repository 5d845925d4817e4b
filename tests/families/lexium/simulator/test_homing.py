"""Homing to a switch, to the index and beside it; limits of both kinds and what LM makes of them."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.world import World
from tests.support.lexium import at, codes, drive, run, say

SWITCHES = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0")
AROUND = {"home": 10000, "limit_plus": 200000, "limit_minus": -200000}


def test_homing_slows_down_in_the_switch_and_creeps_off_it():
    device = drive(*SWITCHES, "P=50000", **{**AROUND, "home": -40000})
    say(device, "HM 1")
    assert at(device, 0.1, "MV", "MD", "MP") == ["1", "MA", "0"]
    # It gains 282841 steps/s in 0.2818 s on the 40000 steps to the switch, and loses it on as many behind it.
    assert at(device, 0.2818, "I1") == ["0"] and at(device, 0.2819, "I1") == ["1"]
    assert at(device, 0.564, "V", "P") == ["1000", "-30000"]
    assert at(device, 40.56, "MV") == ["1"]
    assert at(device, 40.57, "P", "MV", "ER", "I1") == ["10001", "0", "0", "0"]


@pytest.mark.parametrize("kind", [1, 4])
def test_a_switch_that_is_closed_to_begin_with_is_crept_off(kind):
    device = drive("IS=1,1,0", home=500)
    say(device, f"HM {kind}")
    assert at(device, 0.4, "V") == ["1000"]
    assert at(device, 0.6, "P", "MV") == ["501", "0"]


def test_the_first_limit_turns_a_homing_round_and_the_other_one_ends_it():
    device = drive(*SWITCHES, "P=0", limit_plus=100000, limit_minus=-100000, home=-300000)
    say(device, "HM 3")
    device.advance(60)
    assert say(device, "PR ER", "PR MV") == ["82", "0"]
    assert device.position(60) < -100000, "LM=1 has a ramp"


def test_a_homing_that_was_turned_round_finds_the_switch_on_its_way_back():
    device = drive(*SWITCHES, "LM=4", "VM=100000", limit_plus=100000, limit_minus=-100000, home=-50000)
    say(device, "HM 3")
    furthest = 0
    while device.now < 5:
        device.advance(min(device.deadline or 5.0, 5.0))
        furthest = max(furthest, device.position(device.now))
    assert furthest == 100000, "LM=4 has no ramp"
    assert device.motor.homing.phase == "approach" and say(device, "PR I1", "PR ER") == ["1", "0"]


@pytest.mark.parametrize(("mode", "runs"), [(2, True), (5, True), (3, False), (6, False)])
def test_other_modes_end_a_homing_at_the_first_limit(mode, runs):
    device = drive(*SWITCHES, f"LM={mode}", program="PG 1\nLB G1\nH 10\nBR G1\nE\nPG", limit_plus=100000)
    say(device, "EX G1", "HM 3")
    assert at(device, 5, "ER", "MV", "BY") == ["83", "0", str(int(runs))]
    assert (device.position(5) > 101000) is (mode < 4)


def test_what_homing_refuses():
    assert say(drive(), "HM 1") == ["?80"]
    device = drive("IS=1,1,0", home=-1000000)
    assert say(device, "HM 5", "HM", "HI 0") == ["?81"] * 3
    assert say(device, "HM 1", "MA 5", "MR 5", "SL 5", "HM 1", "PR MV") == ["?85"] * 4 + ["1"]
    device.advance(0.1)
    assert say(device, "SL 0", "PR MV") == ["1"], "it can be stopped"
    assert at(device, 5, "MV", "ER") == ["0", "0"] and device.motor.homing.phase == ""
    say(device, "SL 1000")
    assert say(device, "HM 1") == ["?85"]
    assert say(drive("IS=1,1,0", "DE=0"), "HM 1") == ["?94"]
    assert say(drive(personality="LMDOM"), "HI 1", "HF 1") == ["?37", "?37"]


def test_a_program_holds_until_homing_is_over():
    device = drive("IS=1,1,0", home=500, program="PG 1\nLB G1\nHM 1\nH\nPR P\nE\nPG")
    say(device, "EX G1")
    device.advance(5)
    assert [text for _, text in device.prints()] == ["501\r\n"]


@pytest.mark.parametrize(("kind", "place"), [(1, 51200), (2, 0), (3, 102400), (4, 153600)])
def test_homing_to_the_index_ends_on_it(kind, place):
    device = drive("MR 70000")
    device.advance(5)
    say(device, f"HI {kind}")
    assert at(device, 200, "C1", "I6", "MV") == [str(place), "1", "0"]


def test_homing_to_the_offset_ends_beside_the_index():
    device = drive("MR 70000", "FS=12800")
    device.advance(5)
    say(device, "HF 1")
    assert at(device, 200, "C1", "I6", "C2") == ["64000", "0", "5000"]


def test_the_index_is_where_it_was_whatever_the_resolution():
    device = drive("MS=128", "MR 1000")
    device.advance(5)
    say(device, "HI 3")
    assert at(device, 300, "C1", "C2", "I6") == ["25600", "4000", "1"]


@pytest.mark.parametrize(("mode", "end"), [(1, 145000), (4, 100000)])
def test_a_software_limit_ends_the_motion_as_lm_says(mode, end):
    device = drive("LS=1,100000,1", f"LM={mode}", "SL 300000")
    assert at(device, 5, "P", "ER", "MV") == [str(end), "83", "0"]
    assert say(device, "MR 10", "SL 5") == ["?83", "?83"]
    say(device, "MR -100000")
    assert at(device, 10, "P", "ER") == [str(end - 100000), "0"]


def test_a_software_limit_is_a_position_that_p_may_redefine():
    device = drive("LS=0,-100000,1", "LM=4", "P=50000", "SL -100000")
    assert at(device, 5, "P", "ER") == ["-100000", "84"]
    say(device, "P=0")
    assert say(device, "MR -50000") == []
    assert at(device, 9, "P") == ["-50000"]


def test_software_limits_count_what_p_counts():
    device = drive("EE=1", "LS=1,1000,1", "LM=4", "SL 4000")
    assert at(device, 5, "P", "C1") == ["1000", "12800"]


def test_a_limit_that_is_turned_off_limits_nothing():
    device = drive("LS=1,1000,0", "MA 5000")
    assert at(device, 5, "P", "ER") == ["5000", "0"]


def test_software_limits_leave_room_between_them():
    device = drive("LS=0,-100,1")
    assert say(device, "LS=1,-100,1", "LS=1,-200,1", "LS=1,-200,0", "LS=1,-99,1") == ["?21", "?21"]


def test_a_software_limit_set_on_the_way_is_heeded():
    device = drive("LM=4", "SL 100000")
    device.advance(0.1)
    say(device, "LS=1,50000,1")
    assert at(device, 2, "P", "ER") == ["50000", "83"]


SWITCHED = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0", "VI=20000", "VM=200000")


@pytest.mark.parametrize("mode", ["LM=1", "LM=4"])
def test_a_limit_that_is_met_while_a_pause_slows_homing_down_turns_it_round(mode: str) -> None:
    program = "PG 1\nLB G1\nHM 4\nH\nPR P\nPG"
    device = drive(*SWITCHED, mode, program=program, home=-7924, limit_plus=100000, limit_minus=-300000)
    say(device, "EX G1")
    device.advance(0.58)
    say(device, "PS")
    assert at(device, 1, "MV", "I2", "BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [0]
    device.advance(20)
    assert [text for _, text in device.prints()] == ["-7923\r\n"]


def test_homing_that_was_turned_round_and_is_paused_on_the_other_limit_has_failed() -> None:
    program = "PG 1\nLB G1\nHM 3\nH\nPG"
    device = drive(*SWITCHED, program=program, home=-900000, limit_plus=50000, limit_minus=-50000)
    say(device, "EX G1")
    device.advance(0.5)
    while device.position(device.now) > -45000:
        device.advance(device.now + 0.01)
    say(device, "PS")
    device.advance(device.now + 1)
    assert say(device, "PR MV", "PR I3", "PR BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [82]


@pytest.mark.parametrize("mode", [1, 4])
def test_homing_that_begins_on_a_limit_turns_round(mode):
    device = drive(f"LM={mode}", "IS=1,1,0", "IS=3,3,0", "VM=100000", "VI=50000", home=-50000, inputs=[[0.0, 3, 0]])
    assert say(device, "MR -10", "HM 1") == ["?84"]
    device.advance(1.0)
    assert say(device, "PR V", "PR EF") == ["100000", "0"]


@pytest.mark.parametrize("mode", [2, 3, 5, 6])
def test_homing_that_begins_on_a_limit_is_refused_where_limits_end_homing(mode):
    device = drive(f"LM={mode}", "IS=1,1,0", "IS=3,3,0", home=-50000, inputs=[[0.0, 3, 0]])
    assert say(device, "HM 1", "PR MV", "DE=0", "HM 3", "PR MV") == ["?84", "0", "?94", "0"]


def test_the_type_of_homing_may_stand_behind_an_equals_sign():
    device = drive()
    assert run(device, "IS=1,1,0", "HM=3", "PR MV") == ["1"]
    assert run(drive(), "HI=1", "PR MV") == run(drive(), "HF=1", "PR MV") == ["1"]
    assert run(drive(), "HM=5", "HI=0", "HF=") == ["?81"] * 3


# Homing to a switch with two edges, which is closed between them: from either side, to either side.


HOME = "IS=1,1,0"
EDGES = [-60000, -20000]
CELL = '[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "LMDCM"\n[bus.drive.world]\n'


def homed(kind, *lines, home=EDGES, **world):
    """A drive that has homed, and everything that its home switch did meanwhile."""
    device = drive(HOME, "VM=100000", *lines, home=tuple(home), **world)
    assert say(device, f"HM {kind}") == []
    device.advance(120.0)
    assert say(device, "PR MV", "PR I1") == ["0", "0"]
    return device


@pytest.mark.parametrize(
    ("kind", "start", "edge"),
    [(1, 0, -19999), (2, 0, -60001), (3, -100000, -60001), (4, -100000, -19999)],
)
def test_each_type_leaves_the_switch_by_its_own_edge(kind, start, edge):
    """The rotor begins at 0, so what lies on its other side is moved there instead."""
    home = [each - start for each in EDGES]
    device = homed(kind, home=home)
    assert device.position(device.now) == edge - start
    assert say(device, "PR ER", "PR V") == ["0", "0"]


@pytest.mark.parametrize(("kind", "edge"), [(1, 3001), (2, -4001), (3, -4001), (4, 3001)])
def test_a_homing_that_begins_in_the_switch_creeps_off_by_the_same_edge(kind, edge):
    device = homed(kind, home=[-4000, 3000])
    assert device.position(device.now) == edge


@pytest.mark.parametrize(("kind", "home", "edge"), [(1, [-999, -900], -899), (3, [900, 999], 899)])
def test_a_narrow_switch_that_was_passed_is_crept_back_over(kind, home, edge):
    """The ramp from 100000 steps/s is 5000 steps long, and the switch 99."""
    device = homed(kind, home=home)
    assert device.position(device.now) == edge


@pytest.mark.parametrize(("kind", "home", "way"), [(2, [-1999, -1900], -1), (4, [1900, 1999], 1)])
def test_a_narrow_switch_that_was_passed_in_the_direction_of_the_creep_has_been_left(kind, home, way):
    device = homed(kind, home=home)
    assert 1999 < way * device.position(device.now) < 8000


@pytest.mark.parametrize(("kind", "start", "edge"), [(1, -100000, -19999), (3, 0, -60001)])
def test_from_the_far_side_the_limit_turns_it_round_to_the_same_edge(kind, start, edge):
    home = [each - start for each in EDGES]
    device = homed(
        kind, "IS=2,2,0", "IS=3,3,0", "LM=1", home=home, limit_plus=150000 - start, limit_minus=-250000 - start
    )
    assert device.position(device.now) == edge - start


def test_a_pause_on_the_way_does_not_lose_the_switch():
    device = drive(HOME, "VM=100000", home=(-1999, -1900), program="PG 1\nLB G1\nHM 2\nH\nPR P\nE\nPG")
    assert say(device, "EX G1") == []
    while device.motor.homing.phase != "brake":
        device.advance(device.deadline)
    assert say(device, "PS") == []
    device.advance(2.0)
    assert say(device, "RS", "PR MV") == ["0"], "it has been passed"
    device.advance(5.0)
    assert say(device, "PR BY") == ["0"]


def test_the_switch_is_seen_at_both_edges():
    device = drive(HOME, home=(1000, 2000))
    assert at(device, 0.0, "I1") == ["0"]
    seen = []
    say(device, "MR 3000")
    while device.deadline is not None and device.now < 1.0:
        device.advance(device.deadline)
        seen.append(say(device, "PR I1")[0])
    assert "".join(seen).strip("0").replace("1", "") == "" and "1" in seen and seen[-1] == "0"


def test_a_single_number_is_closed_up_to_there():
    world = World(WorldSpec(home=-5))
    assert [world.switches(place)[0] for place in (-1e12, -6, -5, -4)] == [True, True, True, False]
    both = World(WorldSpec(home=(-10, -5)))
    assert [both.switches(place)[0] for place in (-11, -10, -5, -4)] == [False, True, True, False]


def test_a_cell_takes_one_edge_or_two():
    read = [cells.read(f"{CELL}home = {home}\n").buses[0].drives[0].world.home for home in ("-5", "[-20, 7.5]")]
    assert read == [-5, (-20, 7.5)]
    pmx = cells.read('[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "PMX"\n[bus.drive.world.y]\nhome = [1, 2]\n')
    assert pmx.buses[0].drives[0].further[0].home == (1, 2)


@pytest.mark.parametrize(
    ("home", "told"),
    [
        ("[1]", "home must be one position or two, as in [-2000, 0]"),
        ("[1, 2, 3]", "home must be one position or two, as in [-2000, 0]"),
        ("[]", "home must be one position or two, as in [-2000, 0]"),
        ("[2, 1]", "home must go up, not from 2 to 1"),
        ("[2, 2]", "home must go up, not from 2 to 2"),
        ('["a", 1]', "home: 'a' is no number with a unit"),
        ("[1, inf]", "home must be from -1.09951e+12 to 1.09951e+12, not inf"),
        ('"x"', "home: 'x' is no number with a unit"),
    ],
)
def test_what_is_wrong_with_the_edges_is_told(home, told):
    with pytest.raises(Diagnostic) as caught:
        cells.read(f"{CELL}home = {home}\n")
    assert caught.value.message == told and "[bus.drive.world]" in caught.value.where


# Homing to the mark of the encoder.


@pytest.mark.parametrize("mode", ["AS=0", "AS=1"])
@pytest.mark.parametrize("kind, mark", [(1, -1), (3, 1), (4, 2)])
@pytest.mark.parametrize("held", [(1.1, 1.3), (1.62, 1.8), (11.0, 11.5)])
def test_homing_ends_at_a_mark_whatever_has_held_the_rotor(
    mode: str, kind: int, mark: int, held: tuple[float, float]
) -> None:
    device = drive("VM=100000", "VI=5000", mode, "LT=60000", "LG=2000000", locked=[list(held)])
    device.advance(1)
    say(device, f"HI {kind}")
    assert at(device, 60, "MV", "I6", "ER") == ["0", "1", "0"]
    if mode == "AS=1":
        assert say(device, "PR P") == [str(51200 * mark)]


def test_homing_that_is_pushed_over_its_mark_ends_at_another_one() -> None:
    device = drive("VM=20000", "VI=5000", "FS=100")
    say(device, "HF 4")
    device.advance(1)
    device.world.push(51200, 1)
    assert at(device, 60, "MV", "C2", "ER") == ["0", str(8 + 2 * 4000), "0"]


def test_homing_finds_its_mark_after_a_change_of_resolution() -> None:
    device = drive("VM=20000", "VI=5000", "HI 4")
    device.advance(3.5)
    say(device, "MS=64")
    assert at(device, 60, "MV", "I6", "ER") == ["0", "1", "0"]
