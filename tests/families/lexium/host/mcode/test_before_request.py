"""Drives that are expected, by the user's hints or from last time, and found out with the first line for them."""

import contextlib
from dataclasses import replace

import pytest

from multidrop.base.errors import DriveError, NoAnswer
from multidrop.dialects import Hints, Owed
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.simulator.cell.spec import Faults
from tests.support.faults import disturb
from tests.support.mcode_drives import MODES, Witness

NAMED, STATED, ALONE = Hints(drives=("a",)), Hints(drives=("a",), party=True), Hints()
WAYS = [(True, NAMED), (True, STATED), (False, ALONE)]


class Again:
    """A line that was used before: what was remembered then, and a second session on it."""

    def __init__(self, bench, hints, table, before=(), **more):
        self.desk = bench([table], **more)
        [self.device] = self.desk.devices.values()
        for text in before:
            assert not self.device.execute(text, 0.0).refused
        [state] = self.desk.run(MCodeFamily.identify(hints))
        self.last = MCodeFamily(state).remember()
        self.hints = replace(hints, lazy=True, remembered=(self.last,), first_mark=40)

    def open(self):
        """Open the line again, as another process does; count from here."""
        self.desk.wait(1.0)
        self.desk.line.events(self.desk.now)
        self.desk.written.clear()
        self.witness = Witness(self.device)
        [self.state] = self.desk.run(MCodeFamily.identify(self.hints))
        return self.state

    def type(self, text):
        return self.desk.type(self.state, text)

    def executed(self, text):
        """The number of times that the drive has carried out this print, whatever the host appended."""
        return sum(line.startswith(text) and not refused and not stored for line, refused, stored in self.witness.lines)


def table(party, em=1, check=0, **more):
    return {"name": "a", "party": party, "set": {"EM": em, "CK": check, "ES": 3}, **more}


def at_home(party, **more):
    """The only drive of a line that is not in party mode has the name that it was made with."""
    return table(party, **more) if party else {**table(False, **more), "name": "!"}


@pytest.mark.parametrize(("party", "hints"), WAYS)
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_a_print_confirms_itself_and_is_sent_once(bench, em, check, party, hints):
    again = Again(bench, hints, at_home(party, em=em, check=check))
    state = again.open()
    assert state.codec.escape is None and state.settings_unknown
    assert again.type("PR VM") == ("768000",)
    assert again.executed("PR VM") == 1 and not again.device.memory.error_flag
    if state.unconfirmed:
        assert state.codec.escape is None and state.settings_unknown  # a stop still takes every form
        assert MCodeFamily(state).remember() == again.last


@pytest.mark.parametrize(("party", "hints"), WAYS)
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_before_any_other_line_the_drive_prints_what_it_is_and_how_it_is_set(bench, em, check, party, hints):
    again = Again(bench, hints, at_home(party, em=em, check=check))
    again.open()
    assert again.type("VM=300000") == ()
    assert again.state.codec == MCode(em=em, party=party, checksum=check, escape=3)
    assert (again.state.serial, again.state.unconfirmed) == (again.last.serial, None)
    assert again.executed("VM=300000") == 1 and not again.device.memory.error_flag
    frames = [frame for frame in again.desk.written if b"SN" in frame or b"VM" in frame]
    assert b"SN" in frames[0]
    assert MCodeFamily(again.state).remember() == again.last


@pytest.mark.parametrize("text", ["PR ER", "PR ST", "PR PN", 'PR "x"', "PR R1;", "PR NOWHERE", "PR P,2", "PR AL"])
def test_a_print_that_clears_or_may_be_refused_does_not_confirm_itself(bench, text):
    again = Again(bench, STATED, table(True))
    again.open()
    with_error = text in ("PR NOWHERE",)
    try:
        again.type(text)
    except DriveError:
        assert with_error
    assert again.state.unconfirmed is None
    assert again.executed(text.rstrip(";")) == 1 - with_error


def test_with_everything_given_nothing_but_the_ping_and_the_print_is_sent(bench):
    desk = bench([table(True)])
    [state] = desk.run(MCodeFamily.identify(replace(STATED, checksum=0, em=1, lazy=True)))
    assert desk.type(state, "PR P") == ("0",)
    assert desk.written == [b"~\n\n", b"a\n", b'aPR P,"~a1"\n']


@pytest.mark.parametrize("line", ["PR VM", "VM=300000"])
@pytest.mark.parametrize("lazy", [False, True])
@pytest.mark.parametrize(("stated", "check"), [(1, 0), (0, 1), (0, 2), (2, 0)])
@pytest.mark.parametrize("em", [0, 1])
def test_a_checksum_that_the_user_states_wrongly_is_no_error_in_the_drive(bench, em, stated, check, lazy, line):
    desk = bench([table(True, em=em, check=check)])
    [state] = desk.run(MCodeFamily.identify(replace(STATED, checksum=stated, lazy=lazy)))
    desk.type(state, line)
    assert not desk.devices["a"].memory.error_flag and state.codec.checksum == (
        check if state.unconfirmed is None else 0
    )


# --- what is not as it was


@pytest.mark.wide
@pytest.mark.parametrize("line", ["PR VM", "VM=300000"])
@pytest.mark.parametrize(("party", "hints"), WAYS)
@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (1, 1), (3, 2), (2, 0)])
@pytest.mark.parametrize(("now_em", "now_check"), [(0, 0), (1, 0), (1, 1), (0, 2), (2, 0)])
def test_other_settings_than_last_time_are_read_and_no_line_is_carried_out_twice(
    bench, em, check, now_em, now_check, party, hints, line
):
    again = Again(bench, hints, at_home(party, em=em, check=check))
    for text in (f"EM={now_em}", f"CK={now_check}"):
        assert not again.device.execute(text, again.desk.now).refused
    again.open()
    try:
        again.type(line)
        assert again.executed(line) == 1
    except NoAnswer as error:
        assert "not known" in str(error) or "not sent" in str(error)
        assert again.executed(line) == (0 if "not sent" in str(error) else 1)
    assert not again.device.memory.error_flag
    if again.state.unconfirmed is None and (em, check) != (now_em, now_check):
        assert any("not those of last time" in note for note in again.desk.notes)


@pytest.mark.parametrize("line", ["PR VM", "VM=300000"])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
def test_a_drive_that_left_party_mode_is_found_and_none_of_the_lines_before_was_an_error(bench, em, line):
    again = Again(bench, NAMED, table(True, em=em))
    assert not again.device.execute("PY=0", again.desk.now).refused
    again.open()
    again.type(line)
    assert again.state.codec == MCode(em=em, party=False, escape=3) and again.state.address == ""
    assert again.executed(line) == 1 and not again.device.memory.error_flag
    assert any("not those of last time" in note for note in again.desk.notes)


@pytest.mark.parametrize("em", [0, 1])
def test_a_drive_that_is_in_party_mode_now_is_found(bench, em):
    again = Again(bench, ALONE, {**table(False, em=em), "name": "!"})
    assert not again.device.execute("PY=1", again.desk.now).refused
    again.open()
    again.type("VM=300000")
    assert again.state.codec == MCode(em=em, party=True, escape=3)
    assert again.executed("VM=300000") == 1 and not again.device.memory.error_flag


def test_another_drive_at_the_same_name_is_reported(bench):
    again = Again(bench, NAMED, table(True))
    again.hints = replace(again.hints, remembered=(replace(again.last, serial="1"),))
    again.open()
    assert again.type("VM=300000") == ()
    assert any("another drive replies than last time (serial number 1 then" in note for note in again.desk.notes)


@pytest.mark.parametrize("line", ["PR VM", "VM=300000"])
@pytest.mark.parametrize(("party", "hints"), WAYS)
def test_a_drive_that_is_gone_or_renamed_is_sent_nothing_and_forgotten(bench, party, hints, line):
    again = Again(bench, hints, at_home(party))
    if party:
        assert not again.device.execute('DN="b"', again.desk.now).refused
    else:
        again.device.power(False, again.desk.now)
    again.open()
    with pytest.raises(NoAnswer, match="does not reply"):
        again.type(line)
    assert again.executed(line) == 0 and MCodeFamily(again.state).remember() is None
    assert not party or not again.device.memory.error_flag


@pytest.mark.parametrize("line", ["PR VM", "VM=300000"])
@pytest.mark.parametrize("em", [0, 1, 3])
def test_a_drive_in_program_mode_is_taken_out_before_the_line(bench, em, line):
    again = Again(bench, STATED, table(True, em=em))
    assert not again.device.execute("PG 1", again.desk.now).refused
    again.open()
    try:
        again.type(line)
        assert again.executed(line) == 1
    except NoAnswer:
        assert again.executed(line) == 0 and line == "PR VM"
    assert again.device.programming is None
    assert any("was in program mode" in note for note in again.desk.notes)


# --- what else is on the line


@pytest.mark.wide
@pytest.mark.parametrize(("party", "hints"), WAYS)
@pytest.mark.parametrize(
    "half", ["MR 51200", "MA", "SL 100", "S", "E", "EX ", "P=5", "R1=", "EM=", "PY", "PR", "'", 'PR "']
)
@pytest.mark.parametrize("em", [0, 1])
def test_half_a_line_from_before_becomes_no_command(bench, half, em, party, hints):
    again = Again(bench, hints, at_home(party, em=em))
    again.desk.wait(0.5)
    again.desk.wire.receive((("a" if party else "") + half).encode(), again.desk.now)
    again.open()
    with contextlib.suppress(DriveError):
        again.type("PR VM")
    ran = {text[:3] for text, refused, _ in again.witness.lines if not refused}
    assert ran <= {"PR ", "'"} or half == "'" and all(text[:1] in ("'", "P") for text in ran)
    assert again.device.position(again.desk.now) == 0 and not again.device.moving(again.desk.now)


@pytest.mark.wide
@pytest.mark.parametrize("line", ["PR 2", 'PR "0";', 'PR P," ",V', 'PR "768000~a40"'])
@pytest.mark.parametrize(("em", "check"), [(0, 0), (1, 0), (1, 1), (2, 0)])
@pytest.mark.parametrize(("party", "hints"), WAYS)
def test_a_program_that_prints_all_the_time_is_not_taken_for_the_reply(bench, em, check, party, hints, line):
    program = ("PG 1", "LB G1", line, "H 20", "BR G1", "E", "PG", "EX G1")
    again = Again(bench, hints, at_home(party, em=em, check=check), before=program)
    again.open()
    assert again.type("PR VM") == ("768000",)
    assert again.executed("PR VM") == 1 and not again.device.memory.error_flag


def test_a_late_reply_to_the_last_session_is_not_credited(bench):
    again = Again(bench, STATED, table(True))
    again.open()
    again.desk.line.receive(b'\r\n111~a1\r\n"a"\r\n222~a39\r\n', again.desk.now)
    assert again.type("PR VM") == ("768000",)


@pytest.mark.slow
def test_on_a_bad_wire_nothing_is_carried_out_twice_and_no_value_is_wrong(bench, nightly):
    values, rounds = 0, 4 if nightly else 2  # nothing of the host's own begins with "PR P,"
    for number, (em, party, check) in enumerate(rounds * MODES):
        again = Again(bench, NAMED if party else ALONE, at_home(party, em=em, check=check), baud=9600)
        wire = again.desk.wire
        disturb(wire, Faults(flip=2e-3, drop=1e-3, delay=(0.0, 0.01)), number)
        try:
            again.open()
            said = again.type("PR P")
            again.type("VM=300000")
        except DriveError:
            said = ()
        assert again.executed("PR P,") <= 1 + (check > 0) and again.executed("VM=300000") <= 1, number
        if said and check:  # without a checksum nothing tells a damaged digit
            assert said == ("0",), number
        values += bool(said)
        assert not any(stored for _, _, stored in again.witness.lines)
    assert values > 15 * rounds


def test_only_the_drive_that_a_line_names_is_found_out(bench):
    desk = bench([{"name": name, "party": True, "set": {"EM": 1}} for name in "abc"])
    a, b, c = desk.run(MCodeFamily.identify(Hints(drives=("a", "b", "c"), lazy=True)))
    assert desk.type(b, "PR P") == ("0",) and desk.type(c, "VM=300000") == ()
    assert desk.written[:2] == [b"~\n\n", b"b\n"] and not any(frame.startswith(b"a") for frame in desk.written)
    assert [state.settings_unknown for state in (a, b, c)] == [True, True, False]
    desk.written.clear()
    assert desk.type(b, "PR V") == ("0",)
    assert desk.written == [b'bPR V,"~b2"\n']  # it has replied: no ping any more


@pytest.mark.parametrize("more", [{"cut": "aMR 512"}, {"owed": (Owed(1, "x", "LMDCM", "", ""),)}])
def test_a_line_with_a_debt_is_found_out_in_full(bench, more):
    again = Again(bench, NAMED, table(True))
    again.hints = replace(again.hints, **more)
    state = again.open()
    assert state.unconfirmed is None and state.codec.escape == 3


def test_a_line_that_is_unplugged_meanwhile_sends_nothing_and_goes_on_afterwards(bench):
    again = Again(bench, NAMED, table(True))
    again.open()
    disturb(again.desk.wire, Faults(drop=1.0), 0)
    for line in ("PR P", "VM=1000", "VM=1000"):
        with pytest.raises(NoAnswer, match="was not sent"):
            again.type(line)
    disturb(again.desk.wire)
    assert again.type("VM=300000") == () and again.executed("VM=") == 1
