"""A sample of `make soak`: commands on noisy lines, with the simulated drives' own record as the judge."""

import pytest

from multidrop.base.errors import NoAnswer, Refused, TransportLost
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from soak.judge import Judge, Ledger, Witness, Word, word
from soak.noise import Job, jobs, judge
from soak.noisy_line import Setup
from tests.support.cell_session import bus

pytestmark = pytest.mark.slow


@pytest.mark.process
@pytest.mark.parametrize("place", ["pty", "tcp", "rfc2217"])
def test_nothing_twice_nothing_denied_nothing_lost_and_no_value_of_another(place):
    ledger = judge(Job(Setup(level=5e-4, baud=115200, latest=0.5), 24, place))
    assert ledger.misdeeds == [] and ledger.words["done"] > 4


@pytest.mark.process
@pytest.mark.parametrize("place", ["pmx pty", "tmcl pty", "mcode udp"])
def test_without_a_checksum_of_seven_bits_nothing_is_executed_twice_either(place):
    [job] = [each for each in jobs(12) if f"{each.setup.language} {each.place}" == place]
    ledger = judge(job)
    assert ledger.misdeeds == [] and ledger.commands == 12 and ledger.executed > 2


@pytest.mark.process
def test_nor_over_modbus_whose_replies_come_too_late():
    ledger = judge(Job(Setup(language="modbus", names=(), printing=False, latest=0.6), 12, "modbus"))
    assert ledger.misdeeds == ledger.undetected == [] and ledger.words["unknown"] and ledger.words["done"]


def test_the_jobs_send_as_many_commands_as_asked_over_each_kind_of_port():
    found = jobs(10)
    assert {job.commands for job in found} == {10}
    assert {job.place for job in found} == {"pty", "tcp", "rfc2217", "udp", "modbus"}
    assert {job.setup.em for job in found if job.place == "tcp"} == {0, 1, 2, 3}


def test_a_drive_that_noise_resets_has_begun_again():
    [placed] = Floor(read(bus("w", 'personality = "LMDCM"'), "cell")).drives
    witness = Witness(placed.device, str.isspace, bool)
    placed.device.reset(1.0)
    assert witness.boots == 1 and Witness(Device(), str.isspace, bool).boots == 0


# --- the judge itself


class Device:
    """A drive that executes what it is given, except for a line with a question mark."""

    def execute(self, text, now):
        return "?" if "?" in text else "OK"


def judged(said, *executed, asks=False, checked=True):
    device = Device()
    witness = Witness(device, lambda line: line.startswith("PR"), lambda answer: answer == "?")
    case = Judge(Ledger(), {"a": witness}, checked)
    command = case.begins("a", "MR 5", asks)
    for line in executed:
        device.execute(line, 0.0)
    case.ends(command, said, [])
    case.close()
    return case.ledger


@pytest.mark.parametrize(
    ("said", "executed", "kinds"),
    [
        ((), ["MR 5"], []),
        ((), ["MR 5", "MR 5"], ["twice"]),
        ((), [], ["lost"]),
        ((), ["PR 5"], ["lost"]),
        ((), ["MR 5?"], ["lost"]),
        ((), ["MR 7"], ["reported as done and executed as another", "undetected command"]),
        (Refused("a refused 'MR 5': error 23"), ["MR 5"], ["denied"]),
        (Refused("a refused 'MR 5': error 23"), [], []),
        (NoAnswer("'MR 5' was not sent"), ["MR 5"], ["denied"]),
        (NoAnswer("it is not known whether 'MR 5' was executed"), ["MR 5"], []),
        (NoAnswer("it is not known whether 'MR 5' was executed"), ["MR 5", "MR 5"], ["twice"]),
        (TransportLost("the line was lost"), ["MR 5"], ["denied"]),
        (TransportLost("the line was lost; it is not known whether 'MR 5' was executed"), ["MR 5"], []),
    ],
)
def test_the_judge_sees_each_misdeed(said, executed, kinds):
    assert sorted(judged(said, *executed).counts) == sorted(kinds)


def test_without_a_checksum_a_lost_command_may_have_been_damaged():
    assert list(judged((), checked=False).counts) == ["reported as done and executed as another"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a arrived damaged 4 times and was not executed", Word.NOT_EXECUTED),
        ("a: it may have been executed and was not sent again", Word.UNKNOWN),
        ("a does not reply: it is not known whether 'S' was executed; it was sent once", Word.UNKNOWN),
        ("a does not reply: 'S' was not sent", Word.NOT_EXECUTED),
        ("a: stopped before it was sent", Word.NOT_EXECUTED),
        ("the line was lost", Word.NOT_EXECUTED),
        ("a: 'S' was executed before the stop", Word.DONE),
        ("the line was lost; 'S' was executed before that", Word.DONE),
        ("the line was lost; 'EM=1' was executed before that", Word.NOT_EXECUTED),
        ("a stopped at 3 of 9: stalled; 'S' was executed", Word.DONE),
        ("a stopped at 3 of 9: stalled; 'S' was not sent", Word.NOT_EXECUTED),
    ],
)
def test_the_judge_reads_what_the_host_says(text, expected):
    assert word(NoAnswer(text), [], "S") is expected
    assert word((), ["a: 'S' was sent once and not refused; its execution is not confirmed"], "S") is Word.UNCONFIRMED
