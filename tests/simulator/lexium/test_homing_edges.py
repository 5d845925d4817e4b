"""Homing to a switch with two edges, which is closed between them: from either side, to either side."""

import pytest

from multidrop.dialects import Diagnostic
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.world import World
from tests.support.lexium import at, drive, say

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
        ('["a", 1]', 'home must be a number, not "a"'),
        ("[1, inf]", "home must be from -1.09951e+12 to 1.09951e+12, not inf"),
        ('"x"', 'home must be a number, not "x"'),
    ],
)
def test_what_is_wrong_with_the_edges_is_told(home, told):
    with pytest.raises(Diagnostic) as caught:
        cells.read(f"{CELL}home = {home}\n")
    assert caught.value.message == told and "[bus.drive.world]" in caught.value.where
