"""The reference search of a simulated TMCL module: every mode, what it leaves behind, and how it ends."""

import pytest

from tests.support.tmcl_module import Module

LEFT, RIGHT, HOME = -20000.0, 10000.0, (-300.0, 300.0)


def searched(mode: int, begin: int = 0, **world: object) -> tuple[Module, float]:
    """A module after a search that began at a place, and the place of its shaft."""
    module = Module(settings={"4": 200_000, "5": 2_000_000, "193": mode, "194": 20_000, "195": 2_000}, **world)
    module.ask(f"MVP ABS, 0, {begin}")
    module.rest()
    module.ask("RFS START, 0")
    assert module.ask("RFS STATUS, 0") != 0
    module.rest()
    assert [module.ask(f"GAP {number}, 0") for number in (0, 1)] == [0, 0]
    return module, module.device.motors[0].shaft.position(module.now)


@pytest.mark.parametrize(
    ("mode", "edge"),
    [(1, LEFT), (2, LEFT), (3, LEFT), (4, LEFT), (65, RIGHT), (66, RIGHT), (67, RIGHT), (68, RIGHT)],
)
def test_a_search_for_an_end_switch_ends_at_its_edge(mode, edge):
    module, place = searched(mode, limit_minus=LEFT, limit_plus=RIGHT)
    assert abs(place - edge) < 2
    distance = module.ask("GAP 196, 0")
    assert abs(distance - 30000) < 3 if mode % 64 in (2, 3) else distance == 0
    assert module.ask("GAP 197, 0") == pytest.approx(edge, abs=2)
    assert module.ask(f"GAP {11 if edge == LEFT else 10}, 0") == (mode % 64 in (3, 4))


@pytest.mark.parametrize("begin", [-5000, -200, 5000])
@pytest.mark.parametrize(("mode", "edge"), [(5, 300), (6, -300)])
def test_a_search_for_home_turns_back_at_the_end_switch(mode, edge, begin):
    _, place = searched(mode, begin, limit_minus=LEFT, limit_plus=RIGHT, home=HOME)
    assert abs(place - edge) < 2


@pytest.mark.parametrize(("mode", "begin", "edge"), [(7, -25000, -300), (8, 15000, 300)])
def test_a_search_for_home_alone_passes_the_end_switches(mode, begin, edge):
    settings = {"4": 200_000, "5": 2_000_000, "12": 1, "13": 1, "193": mode, "194": 20_000}
    module = Module(settings=settings, limit_minus=LEFT, limit_plus=RIGHT, home=HOME)
    module.ask(f"MVP ABS, 0, {begin}")
    module.rest()
    module.ask("SAP 12, 0, 0")
    module.ask("SAP 13, 0, 0")
    module.ask("RFS START, 0")
    module.rest()
    assert abs(module.device.motors[0].shaft.position(module.now) - edge) < 2


def test_an_inverted_home_switch_is_found_where_it_opens():
    _, place = searched(8 + 128, 0, home=HOME)
    assert abs(place + 300) < 2


def test_the_status_of_a_search_is_the_number_of_its_step():
    module = Module(limit_minus=-2000.0, home=(1000.0, 2000.0), settings={"193": 5, "194": 20_000})
    module.ask("RFS START, 0")
    seen = []
    while status := module.ask("RFS STATUS, 0"):
        seen.append(status)
        module.wait(0.001)
    assert sorted(set(seen)) == [1, 2, 3] and seen == sorted(seen)


def test_a_refused_mode_leaves_the_old_one_and_the_search_goes_by_it():
    module = Module(limit_minus=LEFT, limit_plus=RIGHT, settings={"193": 65, "194": 20_000})
    assert module.refusal("SAP 193, 0, 129") == 4
    assert module.ask("GAP 193, 0") == 65
    module.ask("RFS START, 0")
    module.rest()
    assert abs(module.device.motors[0].shaft.position(module.now) - RIGHT) < 2


def test_without_its_switch_a_search_waits_at_the_other_end():
    module = Module(limit_plus=RIGHT, settings={"193": 5, "194": 20_000, "13": 0}, limit_minus=LEFT)
    module.ask("RFS START, 0")
    module.wait(30.0)
    assert module.ask("RFS STATUS, 0") != 0 and module.ask("GAP 3, 0") == 0
    assert abs(module.device.motors[0].shaft.position(module.now) - RIGHT) < 2
    module.ask("RFS STOP, 0")
    assert module.ask("RFS STATUS, 0") == 0


def test_each_motor_searches_alone():
    module = Module(product="TMCM-3110", limit_minus=-2000.0)
    module.ask("RFS START, 0")
    assert (module.ask("RFS STATUS, 0"), module.ask("RFS STATUS, 1")) == (1, 0)
