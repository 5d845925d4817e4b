"""How a drive is set is followed, however that is written, and no refusal goes unseen.

The simulated drives are the witnesses: what was executed or refused is read from them, not from the wire.
"""

import pytest

from multidrop.base.errors import DriveError, NoAnswer, Refused
from multidrop.dialects import End, Reply
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.simulator.cell.spec import Faults
from tests.support.faults import disturb
from tests.support.mcode_drives import MODES, Desk

pytestmark = pytest.mark.slow


@pytest.mark.wide
@pytest.mark.parametrize("text", ["EM=R1", "em r1", "EM=01", "EM = 2-1", "EM 1", "eM1", "EM=1  "])
@pytest.mark.parametrize(("em", "party", "check"), [m for m in MODES if m[2] != 1])
def test_an_echo_mode_is_followed_however_it_is_written(bench, text, em, party, check):
    desk = Desk(bench, (em, check), party=party)
    desk.device.execute("R1=1", desk.bench.now)
    desk.type(text)
    assert desk.agrees() and desk.state.codec.em == 1
    assert desk.type("PR P") == ("0",)


def test_what_a_line_sets_is_told_from_its_words():
    expected = {
        "EM=1": ("EM", "1"),
        "em 1": ("EM", "1"),
        "EM=R1": ("EM", None),
        "IC ES": ("ES", None),
        'dn "q"': ("DN", "q"),
        "DN q": ("DN", "q"),
        "dn=Q": ("DN", "Q"),
        "DN 7": ("DN", "7"),
        "DN=65": ("DN", "A"),
        'DN="65"': ("DN", "A"),
        "PY=+1": ("PY", "1"),
        "ip": ("IP", None),
        "FD": ("FD", None),
        "EM 1 2": ("EM", None),
    }
    for text, (name, value) in expected.items():
        setting = classify.setting_of(text)
        assert setting is not None and (setting.name, setting.value) == (name, value), text
    for text in ("EM=9", "PR EM", "EMX=1", "VM=5", 'DN="ab"', "DN=7000", "EM"):
        assert classify.setting_of(text) is None, text


def test_a_setting_that_a_drive_refuses_changes_nothing_that_is_known(bench):
    desk = Desk(bench, (1, 0))
    for line in ("ES=7", 'DN="ab"', "CK=5", "EM=4"):
        with pytest.raises(Refused):
            desk.type(line)
        assert desk.agrees(), line


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_saved_settings_that_ip_puts_back_are_followed(bench, em, party, check):
    desk = Desk(bench, (em, check), party=party)
    desk.type(f"EM={(em + 1) % 4}")
    desk.type(f"CK={(check + 1) % 3}")
    desk.type("IP")
    assert desk.agrees() and desk.state.codec.em == em
    assert desk.type("PR P") == ("0",)


@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_another_drive_by_the_new_name_is_not_taken_for_one_whose_renaming_was_lost(bench, em, check):
    desk = Desk(bench, (em, check), (em, check), party=True)

    def lose_the_first(bench):
        disturb(bench.wire, Faults(drop=1.0 if b"DN" in bench.written[-1] else 0.0))

    with pytest.raises(DriveError):
        desk.bench.run(MCodeFamily(desk.state).perform('DN="b"'), desk.state, at=lose_the_first)
    disturb(desk.bench.wire)
    desk.device.execute("R1=11", desk.bench.now)
    assert desk.type("PR R1") == ("11",)
    assert desk.state.address == "a" and desk.witnesses[1].executed("R1=11") == []


def test_factory_defaults_bring_the_name_back_too(bench):
    desk = Desk(bench, (1, 1), party=True)
    desk.type("FD")
    desk.state.notes.clear()
    assert desk.agrees() and desk.state.name == "!"
    desk.type("PY=1")
    assert desk.agrees() and desk.state.address == "!"


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_drive_that_was_restarted_is_found_as_it_is_set_then(bench, em, party, check):
    desk = Desk(bench, (em, check), party=party)
    desk.type(f"EM={(em + 2) % 4}")
    desk.restart()
    for line in ("R1=5", "R1=6", "R1=7"):
        try:
            desk.type(line)
        except NoAnswer as error:
            unsure = "not known whether" in str(error) or "may have been executed" in str(error)
            assert unsure or desk.witness.executed(line) == [], str(error)
        else:
            assert len(desk.witness.executed(line)) == 1
    assert desk.type("PR EM") == (str(em),)


@pytest.mark.parametrize("running", [False, True])
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
def test_a_command_that_a_drive_missed_after_power_up_is_not_told_as_done(bench, em, check, running):
    desk = Desk(bench, (em, check), party=True)
    for text in ("PG 1", "LB SU", "LB G1", "H 50", "BR G1", "E", "PG", "S") if running else ():
        assert not desk.device.execute(text, desk.bench.now).refused
    for on in (False, True):
        desk.device.power(on, desk.bench.now)
        desk.bench.wait(0.5)
    assert desk.device.running is running
    try:
        desk.type("R1=5")
    except NoAnswer as error:
        assert "not known whether 'R1=5' was executed" in str(error)
    else:
        assert len(desk.witness.executed("R1=5")) == 1
    desk.type("R1=6")
    assert len(desk.witness.executed("R1=6")) == 1


# --- refusals


@pytest.mark.parametrize(("em", "party"), [(em, party) for em in (0, 1, 2, 3) for party in (False, True)])
def test_an_error_that_came_by_itself_is_not_told_as_a_refusal(bench, em, party):
    desk = Desk(bench, (em, 0), party=party)
    desk.device.fail(84, desk.bench.now)
    if em == 2:  # read first
        desk.type("R1=5")
    else:
        with pytest.raises(Refused, match="error 84: .* or that came by itself and it was executed"):
            desk.type("R1=5")
    assert len(desk.witness.executed("R1=5")) == 1


def _moves_without_a_refusal(desk, em, number):
    """MA 100 is not blamed for an error that it cannot cause; a drive that replies to no command is asked before it."""
    if em == 2:
        desk.type("MA 100")
        return
    why = "which 'MA 100' cannot cause.*not known whether 'MA 100' was executed"
    with pytest.raises(NoAnswer, match=f"error {number}: .*{why}"):
        desk.type("MA 100")


@pytest.mark.parametrize("em", range(4))
def test_an_error_of_a_name_is_no_refusal_of_a_line_that_uses_none(bench, em):
    """An input calls a label that CP has erased."""
    desk = Desk(bench, (em, 0))
    desk.device.execute("EX G1", desk.bench.now)
    _moves_without_a_refusal(desk, em, 30)
    assert len(desk.witness.executed("MA 100")) == 1
    with pytest.raises(Refused, match="refused 'EX G1': error 30"):
        desk.type("EX G1")


@pytest.mark.parametrize("em", range(4))
def test_an_unknown_word_is_no_refusal_of_a_line_whose_words_are_all_known(bench, em):
    """A port that is lent makes a half-sent line harmless at the stop of another program, which gives this error."""
    desk = Desk(bench, (em, 0))
    desk.device.fail(20, desk.bench.now)
    _moves_without_a_refusal(desk, em, 20)
    assert len(desk.witness.executed("MA 100")) == 1
    with pytest.raises(Refused, match="refused 'NOSUCH=1': error 20"):
        desk.type("NOSUCH=1")


@pytest.mark.wide
@pytest.mark.parametrize(("em", "check"), [(em, check) for em in range(4) for check in range(3)])
@pytest.mark.parametrize("line", ["PR 1", "PR 0", "PR I1", 'PR "0 1"', 'PR "?"', 'PR ">ok"', "PR R1"])
def test_a_program_that_prints_numbers_hides_no_refusal(bench, em, check, line):
    desk = Desk(bench, (em, check))
    for text in ("PG 1", "LB G1", line, "H 9", "BR G1", "E", "PG", "EX G1"):
        assert not desk.device.execute(text, desk.bench.now).refused
    for n in range(5):
        desk.bench.wait(0.0037)
        with pytest.raises(DriveError) as error:
            desk.type("VM=1")
        assert isinstance(error.value, Refused) or "not known" in str(error.value), (n, str(error.value))


@pytest.mark.parametrize("em", range(4))
def test_a_setting_that_was_made_while_an_error_came_by_itself_is_not_taken_for_refused(bench, em):
    desk = Desk(bench, (em, 0))
    desk.state.codec = MCode(em=em, escape=desk.device.memory.escape_mode)
    desk.device.fail(84, desk.bench.now)
    if em == 2:  # read first
        desk.type("ES=0")
    else:
        with pytest.raises(Refused, match="error 84"):
            desk.type("ES=0")
    assert desk.device.memory.escape_mode == 0
    assert desk.state.settings_unknown or desk.agrees()  # stale: a stop takes every form
    desk.type("R1=1")
    assert desk.agrees()


@pytest.mark.parametrize("em", [1, 3])
def test_a_drive_that_was_set_silent_by_somebody_else_is_looked_at_again(bench, em):
    desk = Desk(bench, (em, 0))
    desk.device.execute("EM=2", desk.bench.now)
    with pytest.raises(NoAnswer, match="not known whether 'R1=5' was executed"):
        desk.type("R1=5")
    desk.type("R1=6")
    assert desk.agrees()
    assert [len(desk.witness.executed(text)) for text in ("R1=5", "R1=6")] == [1, 1]


def test_an_error_that_cannot_be_read_is_not_blamed_on_the_next_line():
    state = MCodeState(MCode(em=1, escape=1), error=True)
    talk = MCodeFamily(state).perform("MR 1")
    assert next(talk).text.startswith("PR ER")
    with pytest.raises(NoAnswer, match="'MR 1' was not sent"):
        talk.send(Reply(end=End.DAMAGED))


def test_a_nak_that_may_be_another_drives_is_no_reason_to_repeat():
    state = MCodeState(MCode(em=1, checksum=1, party=True, escape=1), "a")
    talk = MCodeFamily(state).perform("MR 1")
    next(talk)
    with pytest.raises(NoAnswer, match="not known whether 'MR 1' was executed"):
        talk.send(Reply(end=End.NAK, doubtful=True))


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_factory_defaults_are_followed_from_every_mode(bench, em, party, check):
    desk = Desk(bench, (em, check), party=party, baud=9600)  # in EM=0 the sign-on comes behind a prompt
    desk.type("FD")
    assert desk.agrees() and desk.state.codec == MCode(em=0, party=False, checksum=0, escape=1)


BARE = [("DN b", "b"), ("DN=Q", "Q"), ("dn 7", "7"), ("DN=66", "B"), ('DN="66"', "B"), ("DN = 112", "p")]


@pytest.mark.parametrize(("line", "name"), BARE)
@pytest.mark.parametrize("em", range(4))
def test_an_mdriveplus_takes_a_name_without_quotation_marks_and_the_host_follows(bench, line, name, em):
    desk = Desk(bench, (em, 0), party=True, personality="MDI")
    desk.type(line)
    assert desk.device.memory.name == desk.state.address == name
    assert desk.type("PR P") == ("0",)


@pytest.mark.parametrize("line", [line for line, _ in BARE])
@pytest.mark.parametrize("em", range(4))
def test_a_lexium_refuses_it_and_keeps_its_name(bench, line, em):
    desk = Desk(bench, (em, 0), party=True)
    with pytest.raises(Refused) as refused:
        desk.type(line)
    assert refused.value.code == 21 and desk.device.memory.name == desk.state.address == "a"
    assert desk.type("PR P") == ("0",)


@pytest.mark.parametrize("line", ["DN ab", "DN=300", 'DN=""', "DN=-5", "DN *", "DN=1.5", "DN=R1+1", "DN a,b"])
def test_what_names_no_letter_or_digit_is_refused_by_an_mdriveplus_too(bench, line):
    desk = Desk(bench, (0, 0), party=True, personality="MDI")
    with pytest.raises(Refused):
        desk.type(line)
    assert desk.device.memory.name == desk.state.address == "a"
