"""A sample of `make soak`: commands on noisy lines, with the simulated drives' own record as the judge."""

import pytest

from multidrop.dialects import NoAnswer, Refused
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.transports import TransportLost
from soak.judge import Judge, Ledger, Witness, Word, word
from soak.noise import Job, jobs, judge
from soak.noisy_line import Setup
from tests.support.cell_session import bus

pytestmark = pytest.mark.slow


@pytest.mark.wide
@pytest.mark.parametrize("em", range(4))
@pytest.mark.parametrize("names", [("a", "b", "c"), ()])
def test_nothing_twice_nothing_denied_nothing_lost_and_no_value_of_another(em, names):
    commands = 24 if em else 9
    ledger = judge(Job(Setup(em=em, names=names, level=1e-3 if names else 2e-3, seed=5), commands))
    assert ledger.misdeeds == []
    assert ledger.commands == commands and ledger.executed > 1


def test_nor_where_the_line_hangs_up_and_is_opened_again():
    ledger = judge(Job(Setup(level=1e-4, hangups=True, seed=3, names=(), printing=False), 150))
    assert ledger.misdeeds == [] and ledger.hangups > 0


@pytest.mark.process
@pytest.mark.parametrize("place", ["pty", "tcp", "rfc2217"])
def test_nor_on_a_real_port(place):
    ledger = judge(Job(Setup(level=5e-4, baud=115200, latest=0.5), 24, place))
    assert ledger.misdeeds == [] and ledger.words["done"] > 4


@pytest.mark.parametrize("setup", [Setup(checksum=0, level=1e-3), Setup(language="pmx", names=("01",), level=1e-3)])
def test_without_a_checksum_nothing_is_executed_twice_and_the_damage_is_counted(setup):
    ledger = judge(Job(setup, 30))
    assert ledger.misdeeds == [] and ledger.commands == 30


def test_nor_by_a_tmcl_module_whose_frames_have_a_checksum():
    ledger = judge(Job(Setup(language="tmcl", names=("1", "3"), printing=False, level=1e-3), 60))
    assert ledger.misdeeds == ledger.undetected == [] and ledger.executed > 20


@pytest.mark.parametrize("commands", [300, pytest.param(10_000, marks=pytest.mark.nightly)])
def test_nor_over_usb_with_stale_and_late_replies_flushes_and_unplugging(commands):
    ledger = Ledger()
    for seed in range(max(2, commands // 500)):
        setup = Setup(language="pmx", names=(), printing=False, level=0.05, hangups=seed % 2 == 0, seed=seed)
        ledger.add(judge(Job(setup, min(commands // 2, 500), "usb")))
    assert ledger.misdeeds == ledger.undetected == []
    assert ledger.commands == commands and ledger.hangups > commands / 100
    assert ledger.words["unknown"] > commands / 100 and ledger.words["done"] > commands / 2


@pytest.mark.process
def test_nor_over_modbus_whose_replies_come_too_late():
    ledger = judge(Job(Setup(language="modbus", names=(), printing=False, latest=0.6), 12, "modbus"))
    assert ledger.misdeeds == ledger.undetected == [] and ledger.words["unknown"] and ledger.words["done"]


def test_a_quiet_line_loses_nothing():
    ledger = judge(Job(Setup(em=2, printing=False), 30))
    assert ledger.misdeeds == ledger.undetected == []
    assert set(ledger.words) <= {"done", "unconfirmed", "refused"} and ledger.words["unconfirmed"] < 20


def test_the_jobs_send_as_many_commands_as_asked():
    found = jobs(1000, 10)
    assert sum(job.commands for job in found if not job.place and job.group == "checksum") == 1000
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
    ],
)
def test_the_judge_reads_what_the_host_says(text, expected):
    assert word(NoAnswer(text), [], "S") is expected
    assert word((), ["a: 'S' was sent once and not refused; its execution is not confirmed"], "S") is Word.UNCONFIRMED
