"""People at the drives of a noisy party line, and a NAK that noise makes: what is told is true.

A sample of what was run at length (`tests/drives/noisy_wire.py`): no value is told as another drive's, as an older one
or as a program's, and nothing is executed twice. Without a checksum a digit may be damaged, which nothing can tell.
"""

import pytest

from multidrop.base.errors import DriveError, NoAnswer
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.simulator.cell.spec import Faults
from tests.drives.noisy_wire import Crowd
from tests.support.faults import disturb
from tests.support.mcode_drives import Desk
from tests.support.procedure import ProcedureRunner

NOISE = {
    "clean": Faults(),
    "noise": Faults(flip=5e-4, drop=5e-4, delay=(0.0, 0.01)),
    "late": Faults(delay=(0.0, 1.6)),
    "flips": Faults(flip=2e-3),
    "all": Faults(flip=5e-4, drop=5e-4, delay=(0.0, 1.4)),
}


@pytest.mark.wide
@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in (0, 1, 2)])
def test_no_value_is_told_as_anothers_and_nothing_is_executed_twice(bench, em, check, noise):
    told = Crowd(bench, em, check, seed=1, faults=NOISE[noise]).run(12)
    assert told.misdeeds == []
    assert told.ends["done"] > 10
    if check:
        assert not told.wrong["damaged"]


def test_a_flipped_bit_in_a_drives_name_has_no_other_drive_answer_for_it(bench):
    told = Crowd(bench, 1, 0, 2, Faults(flip=2e-3), program=False).run(150)
    assert told.misdeeds == [] and told.ends["done"] > 350


# A NAK that noise makes


SLOW = (0.0, 0.05, 0.3, 0.6, 0.9)
"""Delays of a reply, s, up to the time that the host waits."""


def with_false_nak(desk, text):
    """Let a NAK come as soon as a line with that text has been written, once."""
    receive, frames = desk.bench.wire.receive, []

    def noisy(data, now):
        receive(data, now)
        if text.encode() in data and not frames:
            frames.append(data)
            desk.bench.line.receive(b"\x15", now)

    desk.bench.wire.receive = noisy


@pytest.mark.parametrize("delay", SLOW)
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in (0, 1, 3) for check in (1, 2)])
def test_a_command_is_not_executed_twice(bench, em, check, delay):
    desk = Desk(bench, (em, check), party=True, faults=Faults(delay=(delay, delay)))
    with_false_nak(desk, "MR 100")
    try:
        desk.type("MR 100")
    except DriveError as error:
        assert isinstance(error, NoAnswer) and ("not known whether" in str(error) or "may have been" in str(error))
    assert len(desk.witness.executed("MR 100")) == 1


@pytest.mark.parametrize("delay", SLOW)
@pytest.mark.parametrize("em", [0, 1])
def test_a_program_line_is_not_stored_twice(bench, em, delay):
    desk = Desk(bench, (em, 1), party=True)
    desk.type("PG 1")
    disturb(desk.bench.wire, Faults(delay=(delay, delay)))
    with_false_nak(desk, "MR 100")
    try:
        desk.type("MR 100")
    except DriveError as error:
        assert "not known whether" in str(error) or "may have been" in str(error)
    assert [stored for text, _, stored in desk.witness.lines if text == "MR 100"] == [True]


def run_all(desk, runners):
    """Run conversations side by side; return the failures."""
    failures = {}
    tickets = {desk.bench.line.ask(runner.request): runner for runner in runners}
    while tickets:
        for ended in [*desk.bench.events(), *desk.bench.step(desk.bench.now + 1.0)]:
            runner = tickets.pop(ended.ticket)
            try:
                runner.answer(ended.reply)
            except DriveError as error:
                failures[runner] = str(error)
            else:
                if runner.request is not None:
                    tickets[desk.bench.line.ask(runner.request)] = runner
    return failures


@pytest.mark.parametrize("other", ["MR 200", "PR R1"])
def test_an_ack_after_a_false_nak_is_not_taken_for_that_of_another_drive(bench, other):
    desk = Desk(bench, (1, 1), (1, 1), party=True, faults=Faults(delay=(0.3, 0.3)))
    with_false_nak(desk, "MR 100")
    receive = desk.bench.wire.receive
    desk.bench.wire.receive = lambda data, now: None if b"MR 200" in data else receive(data, now)
    a, b = desk.knowns
    first, second = ProcedureRunner(MCodeFamily(a).perform("MR 100")), ProcedureRunner(MCodeFamily(b).perform(other))
    failures = run_all(desk, [first, second])
    assert "an ACK came later: it is not known whether 'MR 100' was executed" in failures[first]
    assert len(desk.witnesses[0].executed("MR 100")) == 1 and not desk.witnesses[1].executed(other)
    assert other == "PR R1" or "it is not known whether 'MR 200' was executed" in failures[second]


def test_a_drive_that_refuses_is_asked_why_before_another_one_acts(bench):
    """The other one's ACK might be its own, late: both lines would be reported as not known."""
    desk = Desk(bench, (1, 1), (1, 1), party=True)
    a, b = desk.knowns
    first, second = ProcedureRunner(MCodeFamily(a).perform("VM=-1")), ProcedureRunner(MCodeFamily(b).perform("MR 200"))
    failures = run_all(desk, [first, second])
    assert "refused 'VM=-1': error 21" in failures[first] and second not in failures
    assert not b.notes and desk.witnesses[1].executed("MR 200")
