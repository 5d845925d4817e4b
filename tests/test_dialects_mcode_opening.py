"""Finding drives: nothing moves, nothing is refused or saved, and nobody else's answer is taken for a drive's."""

from random import Random

import pytest

from dialects import Hints, NoAnswer
from dialects.mcode import opening
from dialects.mcode.dialect import MCode
from simulator.cell import Faults


def opened(bench, *tables, hints=None, before=()):
    desk = bench(list(tables))
    device = next(iter(desk.devices.values()))
    for text in before:
        assert not device.execute(text, 0.0).refused, text
    found = desk.say(opening.identify(hints or Hints()))
    return desk, device, found


@pytest.mark.parametrize("line", ["PR 2", 'PR "1.5"', 'PR "EM=",R1', 'PR "?"', 'PR ">"', 'PR "0";', 'PR P," ",V'])
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_a_program_that_prints_all_the_time_is_not_mistaken_for_answers(bench, em, check, line):
    program = ("PG 1", "LB G1", line, "H 20", "BR G1", "E", "PG", "EX G1")
    _, device, [known] = opened(bench, {"set": {"EM": em, "CK": check, "ES": 3}}, before=program)
    assert known.dialect == MCode(em=em, checksum=check, escape=3)
    assert (known.product, known.name, known.error, device.error_flag) == ("LMDCM", "!", False, False)


def test_half_a_line_on_a_party_line_is_not_executed_by_opening(bench):
    desk = bench([{"name": "a", "party": True}])
    desk.wire.receive(b"\n\naMR 51200", 0.0)
    desk.wait(0.1)
    [known] = desk.say(opening.identify(Hints(drives=("a",), party=True)))
    assert known.product == "LMDCM"
    assert not desk.devices["a"].moving(desk.now) and desk.devices["a"].position(desk.now) == 0


def test_a_drive_named_p_is_taken_for_one_on_a_party_line(bench):
    desk, device, [known] = opened(bench, {"name": "P", "party": True}, hints=Hints(drives=("P",)))
    assert known.address == "P" and not device.error_flag


def test_a_lost_answer_does_not_lead_to_a_checksum_that_the_drive_would_refuse(bench):
    for seed in range(40):
        desk = bench([{"name": "a", "party": True, "set": {"EM": 1}}], baud=9600)
        desk.wire._faults, desk.wire._rng = Faults(drop=0.002), Random(seed)
        try:
            desk.say(opening.identify(Hints(drives=("a",))))
        except NoAnswer:
            continue
        assert [frame for frame in desk.written if frame[:1] == b"a" and max(frame) > 0x7F] == [], seed
