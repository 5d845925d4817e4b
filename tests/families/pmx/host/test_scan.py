"""The search for PMX controllers at one baud rate."""

from multidrop.dialects.scanning import Reach
from multidrop.families.pmx.host import scan


def searched(bench, *numbers, baud=9600, before=b"", **faults):
    desk = bench([{"personality": "PMX", "name": number} for number in numbers], baud=baud, **faults)
    desk.wire.receive(before, 0.0)
    desk.wait(0.2)
    begun, found, steps = desk.now, [], []
    outcome = desk.run(scan.SCAN.search(Reach(), found.append, lambda: steps.append(1)))
    assert len(steps) == scan.SCAN.places(Reach())
    return [(each.address, each.product) for each in found], outcome, desk.now - begun


def test_every_number_is_found(bench):
    found, outcome, _ = searched(bench, "00", "42", "99")
    assert found == [(number, "PMX-2ED-SA") for number in ("00", "42", "99")] and outcome.remarks == ()


def test_half_a_line_before_costs_no_controller(bench):
    found, _, _ = searched(bench, "00", before=b"@00X10")
    assert found == [("00", "PMX-2ED-SA")]


def test_a_search_takes_no_longer_than_the_silence_of_the_absent_numbers(bench):
    found, _, took = searched(bench)
    assert found == [] and took < 1.1 * 100 * (6 * 10 / 9600 + 0.02)


def test_replies_that_come_while_the_next_numbers_are_tried_are_not_lost(bench):
    found, outcome, _ = searched(bench, "00", "42", "99", delay=(0.05, 0.05))
    assert [number for number, _ in found] == ["00", "42", "99"] and outcome.remarks == ()
