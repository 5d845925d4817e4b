"""Program mode: it is known whether a drive stores what it is sent, whatever happens in between."""

import pytest

from multidrop.base.errors import DriveError, Inexpressible, Refused, Stopped
from multidrop.dialects import Priority, StopPiece
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.cases import for_each
from tests.support.mcode_drives import MODES, Desk

pytestmark = pytest.mark.slow


@pytest.mark.wide
@pytest.mark.parametrize("text", ["PG 1", "PG1", "pg 1", "PG=1", "Pg  1", "PG 1 "])
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_program_mode_is_known_however_it_is_entered(bench, text, em, party, check):
    desk = Desk(bench, (em, check), party=party)
    desk.type(text)
    assert desk.agrees() and desk.state.programming
    desk.type("R1=7")
    desk.type("pg ")
    assert desk.agrees() and desk.state.codec.em == em
    assert desk.witness.executed("R1=7") == []


@pytest.mark.parametrize(("party", "check"), [(False, 0), (True, 0), (True, 1)])
def test_a_drive_that_was_silent_at_the_opening_is_identified_before_its_echo_mode_is_borrowed(bench, party, check):
    desk = Desk(bench, (1, check), party=party)
    desk.state.product = ""
    desk.type("PG 1")
    owed = desk.state.restore
    assert owed is not None
    assert (owed.em, owed.product) == (1, "LMDCM")
    desk.type("PG")
    assert desk.agrees() and desk.state.codec.em == 1


def test_in_program_mode_nothing_is_asked(bench):
    desk = Desk(bench, (1, 0))
    desk.type("PG 1")
    sent = len(desk.bench.written)
    for question in (
        MCodeFamily(desk.state).motion(Priority.POLL),
        MCodeFamily(desk.state).busy(),
        MCodeFamily(desk.state).moving(),
        MCodeFamily(desk.state).programs.listing(""),
    ):
        with pytest.raises(Refused, match="in program mode"):
            desk.bench.run(question)
    assert len(desk.bench.written) == sent


@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (0, 1), (1, 2)])
def test_a_restart_in_program_mode_executes_no_move_that_was_typed_to_be_stored(bench, em, check):
    desk = Desk(bench, (em, check), party=True)
    desk.type("S")
    desk.type("PG 1")
    desk.type("LB G1")
    desk.restart()
    with pytest.raises(DriveError, match="was not sent"):
        desk.type("MR 5000")
    assert desk.witness.executed("MR 5000") == []


@pytest.mark.parametrize("saved", range(4))
@pytest.mark.parametrize(("em", "party"), [(0, False), (0, True), (1, False), (3, True)])
def test_a_restart_in_program_mode_is_noticed_and_no_move_is_told_as_stored(bench, em, party, saved):
    desk = Desk(bench, (em, 0), party=party)
    desk.type(f"EM={saved}")
    desk.type("S")
    desk.type(f"EM={em}")
    desk.type("PG 1")
    desk.restart()
    with pytest.raises(DriveError, match="may|not known|not in program mode|executed"):
        desk.type("R1=7")
    for line in ("R1=1", "R1=2", "R1=3"):
        try:
            desk.type(line)
        except DriveError as error:
            assert "stored" in str(error) or "not known" in str(error) or "not sent" in str(error), str(error)
        else:
            assert not desk.state.programming
            assert len(desk.witness.executed(line)) == 1
    assert not desk.state.programming and desk.agrees()
    assert desk.type("PR P") == ("0",)


@for_each("at", range(1, 14))
@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (1, 1), (2, 2), (3, 1)])
def test_a_stop_at_any_step_of_entering_program_mode_leaves_it_known(bench, em, check, at):
    desk = Desk(bench, (em, check), party=True, baud=9600)
    start, stopped = len(desk.bench.written), []

    def stop(bench):
        if not stopped and len(bench.written) == start + at:
            stopped.append(at)
            bench.line.stop(bench.now, StopPiece(b"\x1b"))
            bench.wire.receive(b"\x1b", bench.now)

    talk = MCodeFamily(desk.state).perform("PG 1")
    try:
        desk.bench.run(talk, desk.state, at=stop)
    except Stopped:
        assert not desk.state.programming and desk.device.programming is None
    else:
        assert desk.state.programming
    desk.state.reply_pending = True  # as a bus has it after a stop
    if desk.state.programming:
        desk.type("PG")
    assert desk.type("PR P") == ("0",)
    assert desk.agrees() and desk.state.codec.em == em


def test_a_refusal_to_store_is_told_though_the_echo_mode_could_not_be_put_back(bench):
    desk = Desk(bench, (1, 0), party=True)

    for text in ("PG 1", "LB G1", "H 50", "BR G1", "E", "PG", "EX G1"):
        assert not desk.device.execute(text, desk.bench.now).refused

    def goes(bench):
        if b"EM=1" in bench.written[-1]:
            desk.device.power(False, bench.now)

    with pytest.raises(Refused, match="refused 'PG 1': error 41"):
        desk.bench.run(MCodeFamily(desk.state).perform("PG 1"), desk.state, at=goes)
    assert not desk.state.programming and desk.state.settings_unknown
    assert any("may be EM=0 now" in note for note in desk.state.notes)


def test_a_group_is_not_taken_into_program_mode(bench):
    desk = Desk(bench, (1, 0), (1, 0), party=True)
    everyone = MCodeState(MCode(em=1, party=True), "*")
    for text in ("PG 1", "pg1", "PG"):
        with pytest.raises(Refused, match="name one"):
            desk.bench.type(everyone, text)
    desk.bench.type(everyone, "EM=2")
    assert everyone.settings_unknown


def test_a_name_of_two_characters_is_not_sent_as_another_drives_command():
    with pytest.raises(Inexpressible, match="no drive name"):
        MCode(party=True).request("ab", "MR 1")
    with pytest.raises(Inexpressible, match="no drive name"):
        MCode(party=True).request("\u0436", "MR 1")
