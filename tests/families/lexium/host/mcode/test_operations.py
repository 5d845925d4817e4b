"""Conversations with simulated drives in memory: refusals seen in every mode, nothing sent twice, program mode."""

import re

import pytest

from multidrop.base.errors import NoAnswer, Refused, Stopped
from multidrop.dialects import DriveState, End, Kind, Owed, Priority, Reply
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.exchange import send_until_answered, take_out
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.settings import listed
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.mcode_drives import one_drive
from tests.support.procedure import ProcedureRunner

MODES = [(em, party, check) for em in range(4) for party in (False, True) for check in range(3)]


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_print_gives_its_line_in_every_mode(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    assert desk.type(state, "PR P") == ("0",)
    assert desk.type(state, 'PR "P is ",P') == ("P is 0",)
    assert desk.strays == []


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_command_that_is_taken_prints_nothing_and_is_sent_once(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    assert desk.type(state, "R1=5") == ()
    assert desk.type(state, "PR R1") == ("5",)
    assert len([frame for frame in desk.written if b"R1=5" in frame]) == 1


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_refusal_is_seen_in_every_mode_with_number_and_text(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    for line, code in (("VM=500", 23), ("ZZ=5", 20), ("PR ZZ", 35), ("XYZZY", 60)):
        with pytest.raises(Refused, match=f"refused '{line}': error {code}: "):
            desk.type(state, line)
    assert desk.type(state, "PR EF") == ("0",)
    assert not state.error


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_list_is_whole_in_every_mode(bench, em, party, check):
    program = "PG 1\nLB G1\nMR 51200\nH\nE\nPG\n"
    desk, state = one_drive(bench, em, party, check)
    for device in desk.devices.values():
        for line in program.splitlines():
            device.execute(line, desk.now)
    listed = desk.type(state, "L")
    assert [line.split(None, 1)[1].upper() for line in listed] == ["LB G1", "MR 51200", "H", "E"]


@pytest.mark.parametrize(("em", "party", "check"), [m for m in MODES if m[0] and not m[2]])
def test_without_a_prompt_or_a_checksum_the_error_flag_is_asked_behind_a_command(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    desk.type(state, "R1=5")
    name = b"a" if party else b""
    frames = [frame.rstrip(b"\r\n").removeprefix(b"~\n") for frame in desk.written]
    read_back = [name + b'PR R1," ",BY,"~%b"' % name] if em == 2 else []
    first = [name + b'PR EF," ",BY,"~%b"' % name] if em == 2 else []  # a reply to another master would not be heard
    assert frames == [*first, name + b"R1=5", name + b'PR EF,"~%b"' % name, *read_back]


def test_an_old_error_is_told_and_not_blamed_on_the_next_command(bench):
    desk, state = one_drive(bench, em=1)
    desk.devices["!"].fail(86, desk.now)
    state.error = True
    desk.type(state, "R1=5")
    assert any("error 86" in note and "an old error" in note for note in desk.notes)
    assert desk.written[0] == b'PR ER,"~"\r'


def test_the_prompt_of_a_print_tells_that_an_error_stands(bench):
    desk, state = one_drive(bench)
    desk.devices["!"].fail(86, desk.now)
    assert desk.type(state, "PR P") == ("0",)
    assert state.error


def test_silence_is_told_as_not_known_and_nothing_is_sent_twice(bench):
    for em, check in ((0, 0), (1, 0), (2, 0), (3, 0), (1, 1)):
        desk, _ = one_drive(bench, em, True, check)
        nobody = MCodeState(MCode(em=em, party=True, checksum=check), "x")
        with pytest.raises(NoAnswer, match="was not sent" if em == 2 else "not known whether"):
            desk.type(nobody, "MR 51200")
        assert len([frame for frame in desk.written if b"MR 51200" in frame]) == (em != 2)
        assert nobody.reply_pending


def test_after_silence_a_command_is_not_sent_to_a_drive_that_prints_no_mark(bench):
    desk, state = one_drive(bench, em=1)
    desk.devices["!"].power(False, desk.now)
    with pytest.raises(NoAnswer):
        desk.type(state, "MR 51200")
    with pytest.raises(NoAnswer, match="'MR 100' was not sent"):
        desk.type(state, "MR 100")
    desk.devices["!"].power(True, desk.now)
    assert desk.type(state, "R1=7") == ()
    assert not any(b"MR 100" in frame for frame in desk.written)


class Script:
    """Answers a conversation's requests one after the other."""

    def __init__(self, talk, *replies):
        self.procedure, self.asked = ProcedureRunner(talk), []
        for reply in replies:
            self.asked.append(self.procedure.request.text)
            self.procedure.answer(reply)


ACKED, NAKED = Reply(acknowledged=True), Reply(end=End.NAK)


def checked() -> DriveState:
    return MCodeState(MCode(em=1, checksum=1, escape=1))


def test_a_damaged_frame_is_repeated_and_a_refused_one_never():
    state = checked()
    script = Script(MCodeFamily(state).perform("MR 1"), NAKED, Reply(("0",)), ACKED)
    assert script.asked == ["MR 1", 'PR ER,"~"', "MR 1"]
    assert script.procedure.result == ()
    with pytest.raises(Refused, match="error 21"):
        Script(MCodeFamily(state).perform("MR 1"), NAKED, Reply(("21",)), Reply(("0",)))


@pytest.mark.parametrize(
    ("before", "code", "runs"),
    [(True, "21", "0"), (False, "86", "0"), (False, "21", "1")],
    ids=["the flag was set", "a stall comes by itself", "a program runs"],
)
def test_a_nak_while_an_error_may_have_stood_does_not_tell_and_is_never_repeated(before, code, runs):
    state = checked()
    state.error = before
    talk = send_until_answered(state, state.codec.request("", "MR 1"))
    assert next(talk).text == "MR 1"
    assert talk.send(NAKED).text == 'PR ER,"~"'
    with pytest.raises(NoAnswer, match="not known whether 'MR 1' was executed; it was sent once"):
        for answer in (code, runs):
            asked = talk.send(Reply((f"{answer}~",))).text
    assert runs == "0" or asked == 'PR BY,"~"'


def test_while_a_program_runs_the_flag_is_looked_at_before_a_command_with_a_checksum():
    state = checked()
    script = Script(MCodeFamily(state).perform("EX AA"), ACKED)
    assert script.asked == ["EX AA"] and state.running
    script = Script(MCodeFamily(state).perform("MR 1"), Reply(("0 1~",)), ACKED)
    assert script.asked == ['PR EF," ",BY,"~"', "MR 1"] and state.running
    script = Script(MCodeFamily(state).perform("MR 1"), Reply(("1 0~",)), Reply(("86~",)), ACKED)
    assert script.asked == ['PR EF," ",BY,"~"', 'PR ER,"~"', "MR 1"] and not state.running
    assert "error 86" in state.notes[0] and "an old error" in state.notes[0]
    assert Script(MCodeFamily(state).perform("MR 1"), ACKED).asked == ["MR 1"]


def test_a_unit_that_says_nak_while_an_error_stands_is_read_all_the_same():
    state = checked()
    script = Script(MCodeFamily(state).perform("PR R1"), Reply(("5~",), flagged=True))
    assert script.procedure.result == ("5",) and state.error
    script = Script(MCodeFamily(state).perform("MR 1"), Reply(("86~",), flagged=True), ACKED)
    assert script.asked == ['PR ER,"~"', "MR 1"] and not state.error


def test_a_frame_is_repeated_three_times_at_most():
    state = checked()
    damaged = [NAKED, Reply(("0",))] * 4
    with pytest.raises(NoAnswer, match="arrived damaged 4 times and was not executed"):
        Script(MCodeFamily(state).perform("MR 1"), *damaged)


def test_a_nak_whose_reason_cannot_be_read_is_not_repeated():
    state = checked()
    with pytest.raises(NoAnswer, match="the reason could not be read: it is not known whether 'MR 1' was executed"):
        Script(MCodeFamily(state).perform("MR 1"), NAKED, Reply(end=End.DAMAGED))


def test_a_damaged_answer_is_not_asked_again():
    state = checked()
    with pytest.raises(NoAnswer, match="may have been executed and was not sent again"):
        Script(MCodeFamily(state).perform("MR 1"), Reply(end=End.DAMAGED, detail="x"))


def test_a_running_program_under_ck_2_sends_no_ack_and_silence_is_checked():
    state = MCodeState(MCode(em=1, checksum=2, escape=1))
    script = Script(MCodeFamily(state).perform("VM=5000"), Reply(end=End.SILENT), Reply(("0 1",)))
    assert script.asked == ["VM=5000", 'PR EF," ",BY,"~"']


def test_silence_of_a_drive_that_runs_no_program_is_a_lost_command():
    state = MCodeState(MCode(em=1, checksum=2, escape=1))
    with pytest.raises(NoAnswer, match="not known whether 'VM=5000' was executed; it was sent once"):
        Script(
            MCodeFamily(state).perform("VM=5000"),
            Reply(end=End.SILENT),
            Reply(("0 0",), raw=b"\x060 0\xd0\r\n"),
        )


@pytest.mark.parametrize(
    ("check", "text", "told", "raw", "done"),
    [
        (0, "VM=5000", "0 1", b"0 1~\r\n", False),  # without a checksum a running program leaves no sign out
        (0, "VM=5000", "0 1", b"Log\r\nLog\r\n0 1~\r\n", False),  # its prints are none
        (0, "E", "0 1", b"0 1~\r\n", False),
        (0, "E", "0 0", b"\r\n0 0~\r\n", True),
        (2, "E", "0 1", b"0 1~\xb0\r\n", False),
        (2, "E", "0 0", b"\x060 0~\xb1\r\n", True),
    ],
)
def test_silence_is_success_only_where_it_must_be(check, text, told, raw, done):
    state = MCodeState(MCode(em=1, checksum=check, escape=1))
    try:
        Script(MCodeFamily(state).perform(text), Reply(end=End.SILENT), Reply((told,), raw=raw))
    except NoAnswer as error:
        assert not done and "not known whether" in str(error)
    else:
        assert done


@pytest.mark.parametrize(("check", "raw"), [(0, b"\r\n\r\n0 0\r\n"), (2, b"\x06\x060 0\xd0\r\n")])
def test_a_sign_that_came_late_is_still_one(check, raw):
    state = MCodeState(MCode(em=1, checksum=check, escape=1))
    script = Script(MCodeFamily(state).perform("VM=5000"), Reply(end=End.SILENT), Reply(("0 0",), raw=raw))
    assert len(script.asked) == 2


def test_a_print_that_comes_to_nothing_is_not_taken_for_an_answer():
    for state in (MCodeState(MCode(em=1, escape=1)), MCodeState(MCode(em=3, escape=1))):
        with pytest.raises(NoAnswer, match="printed nothing for 'PR R1'"):
            Script(MCodeFamily(state).perform("PR R1"), Reply(end=End.SILENT), Reply(("0",)))


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_drive_that_runs_a_program_is_spoken_to_in_every_mode(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    for device in desk.devices.values():
        for line in ("PG 1", "LB AA", "R2=R2+1", "H 5", "BR AA", "PG"):
            device.execute(line, desk.now)
    for line in ("EX AA", "R1=5", "VM=600000"):
        assert desk.type(state, line) == ()
    with pytest.raises(Refused, match="error 35"):
        desk.type(state, "PR ZZ")
    assert (desk.type(state, "PR R1"), desk.type(state, "PR BY")) == (("5",), ("1",))
    assert desk.run(MCodeFamily(state).motion(Priority.POLL))[0].velocity == 0
    assert desk.type(state, "E") == () and desk.type(state, "PR BY") == ("0",)


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_wire_setting_is_followed_and_taken_back(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    for new in (0, 1, 2, 3, em):
        desk.type(state, f"EM={new}")
        assert state.codec.em == new
        assert desk.type(state, "PR P") == ("0",)
    for new in (1, 2, 0, check):
        desk.type(state, f"CK={new}")
        assert desk.type(state, "PR CK") == (str(new),)


def test_a_new_name_is_used_from_then_on(bench):
    desk, state = one_drive(bench, 1, True, 1)
    desk.type(state, 'DN="q"')
    assert state.address == "q"
    assert desk.type(state, "PR P") == ("0",)


def test_a_drive_is_taken_into_and_out_of_party_mode(bench):
    desk, state = one_drive(bench, 1, False, 0)
    state.name = "!"
    desk.type(state, "PY=1")
    assert (state.address, state.codec.party) == ("!", True)
    assert desk.type(state, "PR P") == ("0",)
    desk.type(state, "PY=0")
    assert state.address == ""
    assert desk.type(state, "PR P") == ("0",)


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_typed_program_mode_stores_lines_and_asks_nothing_in_between(bench, em, party, check):
    desk, state = one_drive(bench, em, party, check)
    desk.type(state, "PG 1")
    assert state.programming
    start = len(desk.written)
    for line in ("LB G1", "R1=R1+1", "E"):
        assert desk.type(state, line) == ()
    assert len(desk.written) == start + 3
    desk.type(state, "PG")
    assert not state.programming
    assert state.codec.em == em
    desk.type(state, "EX G1")
    desk.wait(0.5)
    assert desk.type(state, "PR R1") == ("1",)


@pytest.mark.parametrize("text", ["MR 5", "PR P", "EM=1", "R1=5"])
@pytest.mark.parametrize(
    ("party", "signs", "shown"),
    [(True, False, "~a{}"), (True, True, '~{}"a"'), (False, False, "~{}")],
)
def test_no_line_follows_a_lost_reply_without_a_mark_and_each_mark_is_another(text, party, signs, shown):
    state = MCodeState(MCode(em=1, party=party), "a" if party else "!")
    state.signature_seen(signs)
    state.reply_outstanding()
    marks = [ProcedureRunner(MCodeFamily(state).perform(text)).request for _ in range(3)]
    assert [each.text.startswith('PR "~') for each in marks] == [True] * 3
    late = [shown.format(number) for number in (1, 2, 3)]
    assert [[re.fullmatch(each.expect, line) is not None for line in late] for each in marks] == [
        [True, False, False],
        [False, True, False],
        [False, False, True],
    ]
    assert not any(re.fullmatch(each.expect, line) for each in marks for line in ("0", '0"a"', "5~a", ""))


def test_a_refused_line_in_program_mode_is_told_and_not_stored(bench):
    desk, state = one_drive(bench)
    desk.type(state, "PG 1")
    with pytest.raises(Refused, match="in program mode; it is not stored"):
        desk.type(state, "XYZZY 5")
    desk.type(state, "E")
    desk.type(state, "PG")
    assert [line.split()[1] for line in desk.type(state, "L")] == ["E"]


def test_pg_alone_is_not_sent_to_a_drive_that_is_not_in_program_mode(bench):
    desk, state = one_drive(bench)
    with pytest.raises(Refused, match="not in program mode"):
        desk.type(state, "PG")
    assert desk.written == []


def test_position_and_velocity_come_in_one_print(bench):
    desk, state = one_drive(bench, 1, True, 1)
    desk.type(state, "MR 512000")
    desk.wait(0.5)
    [axis] = desk.run(MCodeFamily(state).motion(Priority.POLL))
    assert 0 < axis.position < 512000
    assert axis.velocity > 100000
    assert desk.written[-1].startswith(b'aPR P,"~a",V')


def test_a_command_to_all_waits_for_no_answer(bench):
    desk, _ = one_drive(bench, 1, True, 1)
    everyone = MCodeState(MCode(em=1, party=True, checksum=1), "*")
    assert desk.type(everyone, "R1=9") == ()
    state = MCodeState(MCode(em=1, party=True, checksum=1), "a")
    assert desk.type(state, "PR R1") == ("9",)


def test_a_stop_thrown_into_a_conversation_ends_it():
    state = checked()
    procedure = ProcedureRunner(MCodeFamily(state).perform("MR 1"))
    with pytest.raises(Stopped):
        procedure.fail(Stopped("stopped"))
    assert procedure.request is None


def test_a_stop_in_a_question_before_a_line_names_the_line_as_not_sent():
    state = checked()
    state.program_read(error=False, running=True)
    procedure = ProcedureRunner(MCodeFamily(state).perform("R2=1"))
    assert procedure.request.text.startswith("PR EF")
    with pytest.raises(Stopped, match="stopped; 'R2=1' was not sent"):
        procedure.fail(Stopped("stopped"))


def test_a_stop_in_the_question_for_the_prompt_names_the_line_for_program_mode_as_not_sent():
    state = checked()
    state.may_be_in_program_mode()
    state.reply_outstanding()
    procedure = ProcedureRunner(MCodeFamily(state).perform("R1=7"))
    assert procedure.request.text == ""
    with pytest.raises(Stopped, match="stopped; 'R1=7' was not sent"):
        procedure.fail(Stopped("stopped"))


def test_a_line_is_not_sent_after_a_stop_that_came_as_the_echo_mode_was_put_back():
    state = checked()
    state.owes(Owed(3, "", "LMDCM", "", ""))
    procedure = ProcedureRunner(MCodeFamily(state).perform("MR 1"))
    assert procedure.request.text == "EM=3"
    with pytest.raises(Stopped):
        procedure.fail(Stopped("stopped"))
    assert procedure.request is None and state.restore is not None
    assert any("may be EM=0 now: stopped" in note for note in state.notes)


def test_where_a_stop_prevents_that_program_mode_is_left_the_mode_is_read_before_the_next_line():
    state = MCodeState(MCode())
    state.entered_program_mode(300)
    procedure = ProcedureRunner(take_out(state, "taken out"))
    assert procedure.request.text == "PG"
    with pytest.raises(Stopped):
        procedure.fail(Stopped("stopped"))
    assert ProcedureRunner(MCodeFamily(state).perform("MR 1")).request.text == ""


@pytest.mark.parametrize(("silent", "error"), [(0, False), (1, True)])
def test_the_error_of_a_pg_too_many_is_read_before_the_next_line(silent, error):
    """The late reply to the first PG ends program mode; that to the second, which is refused, comes behind it."""
    state = MCodeState(MCode())
    state.entered_program_mode(300)
    procedure = ProcedureRunner(take_out(state, "taken out"))
    for _ in range(silent):
        procedure.answer(Reply((), end=End.TIMEOUT))
        procedure.answer(Reply((), end=End.TIMEOUT))  # the mark
    assert procedure.request.text == "PG"
    procedure.answer(Reply((), prompt=">"))
    assert procedure.request is None and not state.programming
    assert state.error is error


@pytest.mark.parametrize("check", [0, 1])
def test_a_stop_in_a_reading_without_a_checksum_leaves_an_error_that_no_line_is_blamed_for(check):
    for reading in (lambda state: MCodeFamily(state).motion(Priority.OPERATOR), lambda state: listed(state, "PR UV")):
        state = MCodeState(MCode(em=1, checksum=check))
        with pytest.raises(Stopped):
            ProcedureRunner(reading(state)).fail(Stopped("stopped"))
        assert state.error is (check == 0)


def test_the_error_of_a_list_that_noise_made_another_line_is_read_before_the_next_line():
    state = MCodeState(MCode())
    procedure = ProcedureRunner(listed(state, "PR UV"))
    procedure.answer(Reply((), end=End.REFUSED, prompt="?"))
    while procedure.request is not None:
        mark = procedure.request.text.startswith('PR "~')
        lines = (procedure.request.text.split('"')[1],) if mark else ("G1 = 1",)
        procedure.answer(Reply(lines, prompt="?"))
    assert procedure.result == ("G1 = 1",) and state.error


# --- opening


@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_how_a_drive_is_set_is_found_out_and_nothing_moves(bench, em, party, check):
    from multidrop.dialects import Hints

    desk = bench([{"name": "a" if party else "!", "party": party, "set": {"EM": em, "CK": check, "ES": 1}}])
    hints = Hints(drives=("a",), party=True) if party else Hints()
    [state] = desk.run(MCodeFamily.identify(hints))
    assert state.codec == MCode(em=em, party=party, checksum=check, escape=1)
    assert (state.product, state.name) == ("LMDCM", "a" if party else "!")
    device = next(iter(desk.devices.values()))
    assert not device.memory.error_flag
    assert not any(word in frame for frame in desk.written for word in (b"ER", b"\x1b", b"\x05", b"\x03"))


def test_several_names_imply_party_mode_and_a_missing_drive_is_told(bench):
    from multidrop.dialects import Hints

    desk = bench([{"name": n, "party": True, "set": {"EM": 1, "CK": 1}} for n in "ab"], baud=9600)
    a, b, c = desk.run(MCodeFamily.identify(Hints(drives=("a", "b", "c"))))
    assert (a.product, b.product, c.product) == ("LMDCM", "LMDCM", "")
    assert c.notes == ["c does not reply"]
    assert c.codec.checksum == 1


def test_an_ethernet_drive_is_not_asked_what_it_would_refuse(bench):
    from multidrop.dialects import Hints

    desk = bench([{"personality": "LMDCE"}])
    [state] = desk.run(MCodeFamily.identify(Hints()))
    assert (state.product, state.address) == ("LMDCE", "")
    assert not desk.devices["!"].memory.error_flag
    assert not any(word in frame for frame in desk.written for word in (b"PY", b"CK", b"DN", b"BD"))


@pytest.mark.parametrize(("em", "party", "check"), [m for m in MODES if m[0] in (0, 1)])
def test_a_drive_left_in_program_mode_is_taken_out_and_that_is_said(bench, em, party, check):
    from multidrop.dialects import Hints

    desk = bench([{"name": "a" if party else "!", "party": party, "set": {"EM": em, "CK": check}}])
    next(iter(desk.devices.values())).execute("PG 1", 0.0)
    hints = Hints(drives=("a",), party=True) if party else Hints()
    [state] = desk.run(MCodeFamily.identify(hints))
    assert next(iter(desk.devices.values())).programming is None
    assert any("was in program mode" in note for note in desk.notes + state.notes)


def test_nobody_there_is_told(bench):
    from multidrop.dialects import Hints

    desk = bench([{"name": "a", "party": True}])
    with pytest.raises(NoAnswer, match="none of the drives x, y replies"):
        desk.run(MCodeFamily.identify(Hints(drives=("x", "y"))))


def test_a_standing_error_is_found_without_clearing_it(bench):
    from multidrop.dialects import Hints

    desk = bench([{}])
    desk.devices["!"].fail(86, 0.0)
    [state] = desk.run(MCodeFamily.identify(Hints()))
    assert state.error
    assert desk.devices["!"].memory.error_flag


def test_a_kind_is_told_from_the_words(bench):
    kinds = {"PR P": Kind.PRINT, "PR AL": Kind.LIST, "pr uv": Kind.LIST, "L": Kind.LIST, "L G1": Kind.LIST}
    kinds |= {
        "LB G1": Kind.COMMAND,
        "LM=2": Kind.COMMAND,
        "EM=1": Kind.SETTING,
        "EM=9": Kind.COMMAND,
        "FD": Kind.SETTING,
    }
    for text, kind in kinds.items():
        assert MCode().request("", text).kind is kind, text
