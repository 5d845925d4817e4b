"""What is believed of a reply: NAK, ACK, prompts, restarts, prints that come to nothing, lists that come late."""

from dataclasses import replace

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.dialects import End, Kind, Priority, Reply
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.exchange import fresh_mark
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.framing import sealed
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.simulator.cell.spec import Faults
from tests.support.cases import for_each
from tests.support.faults import disturb
from tests.support.mcode_drives import MODES, Desk
from tests.support.procedure import ProcedureRunner

ACK, NAK = b"\x06", b"\x15"


def answer(em, check, data, text="MR 51200", party=False):
    codec = MCode(em=em, checksum=check, party=party)
    request = codec.request("a" if party else "", text)
    return codec.decode(request, data) or codec.on_quiet(request, data)


NAKED, CLEAR = Reply((), end=End.NAK), Reply(("0~a",))


@pytest.mark.parametrize(
    ("readings", "repeats"),
    [
        ([CLEAR], True),
        ([NAKED, CLEAR], True),
        ([replace(CLEAR, surplus=True)], False),
        ([replace(CLEAR, doubtful=True)], False),
        ([replace(NAKED, surplus=True), CLEAR], False),
        ([replace(NAKED, doubtful=True), NAKED, CLEAR], False),
        ([Reply((), end=End.TIMEOUT)], False),
        ([NAKED] * 4, False),
        ([replace(NAKED, detail="among a program's prints")], False),
    ],
)
@pytest.mark.parametrize("text", ["MR 51200", "EX G1", "R1=5"])
def test_a_line_is_repeated_after_a_nak_only_if_no_ack_came_before_its_error_was_read_as_none(readings, repeats, text):
    state = MCodeState(MCode(em=1, party=True, checksum=1), "a")
    procedure = ProcedureRunner(MCodeFamily(state).perform(text))
    assert procedure.request.text == text
    procedure.answer(NAKED)
    *before, last = readings
    for each in before:
        assert procedure.request.text == 'PR ER,"~a"'
        procedure.answer(each)
    if repeats:
        procedure.answer(last)
        assert procedure.request.text == text
    else:
        with pytest.raises(NoAnswer, match="it was sent once"):
            procedure.answer(last)


def test_a_nak_or_an_ack_that_may_be_another_drives_proves_nothing():
    for text in ("MR 51200", "R1=5"):
        state = MCodeState(MCode(em=1, party=True, checksum=1), "a")
        procedure = ProcedureRunner(MCodeFamily(state).perform(text))
        with pytest.raises(NoAnswer, match="it was sent once"):
            procedure.answer(replace(NAKED, doubtful=True))
        assert state.reply_pending
        for doubtful, asks in ((False, False), (True, True)):
            state = MCodeState(MCode(em=1, party=True, checksum=1), "a")
            procedure = ProcedureRunner(MCodeFamily(state).perform(text))
            procedure.answer(Reply((), acknowledged=True, doubtful=doubtful))
            assert (procedure.request is not None and procedure.request.text.startswith("PR EF")) is asks


@pytest.mark.parametrize(
    ("em", "data"),
    [
        (3, b"MR " + NAK + b"1200\xc9" + ACK),  # the 5 of EM=3's repetition, a bit of it flipped
        (1, b"Log " + NAK + b"\xa0\r\n" + ACK),  # the same in a running program's print
        (1, NAK + ACK),  # another drive's late NAK
        (1, NAK + NAK),
        (0, b"MR 51200" + NAK + ACK + b">"),
    ],
)
def test_a_nak_that_is_not_the_whole_answer_is_no_reason_to_repeat(em, data):
    found = answer(em, 1, data)
    assert found is None or found.reply.end is End.DAMAGED


def test_an_ack_made_of_the_check_byte_of_a_repetition_is_none():
    text = next(text for text in (f"P={n}" for n in range(9999)) if sealed(text.encode())[-1] == 0x86)  # a bit from ACK
    found = answer(3, 1, text.encode() + ACK + NAK, text)
    assert found is not None and found.reply.end is End.DAMAGED


def test_a_nak_that_a_running_programs_prints_follow_may_be_read_and_is_no_reason_to_repeat():
    line = sealed(b"Log 1") + b"\r\n"
    assert answer(1, 1, NAK).reply.detail == ""
    assert answer(1, 1, line + NAK).reply.detail == ""
    for lines in (1, 2):
        found = answer(1, 1, NAK + lines * line)
        assert (found.reply.end, found.reply.detail) == (End.NAK, "prints follow the NAK")
    state = MCodeState(MCode(em=1, checksum=1, escape=1))
    talk = MCodeFamily(state).perform("MR 1")
    next(talk)
    assert talk.send(Reply(end=End.NAK, detail="prints follow the NAK")).text.startswith("PR ER")
    with pytest.raises(NoAnswer, match="may have been executed and was not sent again"):
        talk.send(Reply(lines=("0~",)))


def test_an_error_is_not_read_twice_where_it_may_have_been_read_once():
    state = MCodeState(MCode(em=1, checksum=1, escape=1))
    talk = MCodeFamily(state).perform("MR 1")
    next(talk)
    assert talk.send(Reply(end=End.NAK)).text.startswith("PR ER")
    with pytest.raises(NoAnswer, match="the reason could not be read"):
        talk.send(Reply(end=End.NAK, detail="prints follow the NAK"))


def test_a_line_is_not_blamed_for_the_error_of_a_reading_that_noise_made_another_print():
    state = MCodeState(MCode(em=1, checksum=1, escape=1))
    talk = MCodeFamily(state).motion(Priority.OPERATOR)
    next(talk)
    with pytest.raises(NoAnswer):
        talk.send(Reply(end=End.NAK))
    assert next(MCodeFamily(state).perform("MR 1")).text.startswith("PR ER")


def test_a_line_whose_ack_came_late_is_not_blamed_for_an_error_that_came_beside_it():
    state = MCodeState(MCode(em=1, checksum=1, escape=1))
    talk = MCodeFamily(state).perform("MR 1")
    next(talk)
    assert talk.send(Reply(end=End.SILENT)).text.startswith("PR EF")
    read = ACK + ACK + sealed(b"1 0~") + b"\r\n"
    assert talk.send(Reply(lines=("1 0~",), raw=read)).text.startswith("PR ER")
    with pytest.raises(
        NoAnswer, match="error 60.* an ACK of 'MR 1' came, too: it is not known whether it was executed"
    ):
        talk.send(Reply(lines=("60~",)))


def test_a_prompt_in_front_of_a_print_may_be_a_part_of_it_and_acknowledges_nothing():
    for data in (b"MR 51200\r\n>hello\r\n", b"MR 51200\r\n>hello\r\nhello\r\n", b"MR 51200\r\n\r\n>> a\r\nb\r\n"):
        found = answer(0, 0, data)
        assert (found.reply.end, found.reply.acknowledged, found.reply.prompt) == (End.DONE, False, "")
    state = MCodeState(MCode(em=0, escape=1))
    talk = MCodeFamily(state).perform("MR 51200")
    next(talk)
    assert talk.send(found.reply).text.startswith("PR EF")


def test_a_print_that_begins_like_a_prompt_does_not_hide_a_refusal_in_front_of_it():
    codec = MCode(em=0)
    request = codec.request("", "VM=4")
    assert codec.decode(request, b"VM=4\r\n?>ok\r\n>") is None
    found = codec.on_quiet(request, b"VM=4\r\n?>ok\r\n>")
    assert not found.reply.acknowledged  # so EF is asked
    for more in (b">ok\r\n", b">ok\r\n>ok\r\n"):
        assert codec.decode(request, b"VM=4\r\n?>ok\r\n" + more).reply.end is End.REFUSED


def test_with_a_checksum_a_prompt_is_told_from_the_head_of_a_print():
    head = sealed(b"MR 51200") + NAK
    assert answer(0, 1, head + b">" + sealed(b"hello") + b"\r\n").reply.end is End.NAK
    assert answer(0, 1, head + sealed(b">hello") + b"\r\n") is None
    assert answer(0, 1, head + b"> x" + sealed(b"5> x")[-1:] + b"\r\n") is None  # was 5> x


def test_an_answer_without_its_ack_is_taken_while_a_program_prints_only_where_none_comes():
    lines = sealed(b"7") + b"\r\n" + 2 * (sealed(b"Log") + b"\r\n")
    for check, end in ((2, End.DONE), (1, None)):
        codec = MCode(em=1, checksum=check)
        found = codec.decode(codec.request("", "PR P"), lines)
        assert (found and found.reply.end) is end


def test_a_prompt_without_ack_does_not_say_that_a_sealed_command_was_executed():
    assert answer(0, 1, sealed(b"MR 51200") + b"\r\n>").reply.end is End.DAMAGED
    assert answer(0, 2, sealed(b"MR 51200") + b">").reply.end is End.SILENT


def test_a_print_that_begins_like_a_prompt_is_not_the_end_of_a_command():
    found = answer(0, 0, b"MR 51200\r\n?what\r\n>")
    assert (found.reply.end, found.strays) == (End.DONE, ("?what",))
    found = answer(0, 0, b"MR 51200\r\n>>> hello\r\n?")
    assert found.reply.end is End.REFUSED


def test_a_restart_in_the_middle_is_no_answer():
    for em in (0, 1, 2, 3):
        codec = MCode(em=em)
        request = codec.request("", "PR P")
        data = "Copyright\xa9 2010 Schneider Electric Motion USA\r\n".encode("latin-1")
        found = codec.decode(request, data) or codec.on_quiet(request, data)
        assert found is None or (found.reply.end is End.DAMAGED and found.reply.lines == ()), em


@for_each(("em", "party", "check"), MODES)
def test_prints_that_come_to_nothing_or_end_without_a_line_end_are_answers(bench, em, party, check):
    desk = Desk(bench, (em, check), party=party)
    assert desk.type('PR ""') in ((), ("",))
    assert desk.type('PR "abc";') == ("abc",)
    assert desk.type('PR P," steps\\r"') == ("0 steps",)
    assert desk.type("PR P") == ("0",)


def test_kinds_of_lines_that_print_several(bench):
    for text in ("PR AL", 'PR "x",IS', "PRAL", "pr uv", "L1"):
        assert MCode().request("", text).kind is Kind.LIST, text
    assert MCode().request("", 'PR "AL"').kind is Kind.PRINT


# Lists whose bytes come late


LINES = ["LB G1", "R1=R1+1", "E", "LB G2", "RT"]


@pytest.mark.parametrize(
    ("em", "reply"),
    [
        (0, b"L\r\n1  LB G1\r\n"),
        (0, b"L\r\n1  LB G1\r\n6  "),
        (0, b"L\r\n1  LB G1\r\n6  R1=R"),
        (1, b"\r\n1  LB G1\r\n6  R1=R"),
        (2, b"1  LB G1\r\n6"),
        (3, b"L\r\n1  LB G1\r\n6  R1"),
    ],
)
def test_a_list_does_not_end_before_its_prompt_nor_within_a_line(em, reply):
    codec = MCode(em)
    assert codec.on_quiet(codec.request("", "L"), reply) is None
    assert codec.on_timeout(codec.request("", "L"), reply).reply.end is End.DAMAGED


@pytest.mark.parametrize("text", ["PR AL", "MR 5"])
def test_an_address_alone_is_the_prompt_of_program_mode(text):
    codec = MCode(0)
    found = codec.on_quiet(codec.request("", text), f"{text}\r\n41  ".encode())
    assert found is not None and found.reply.prompt == "41  "


@pytest.mark.parametrize("text", ["L", "L G1", "l 41"])
def test_after_l_an_address_alone_may_be_that_of_the_first_line(text):
    codec, heard = MCode(0), f"{text}\r\n41  ".encode()
    assert codec.on_quiet(codec.request("", text), heard) is None
    assert codec.on_timeout(codec.request("", text), heard).reply.end is End.DAMAGED


@pytest.mark.parametrize("em", [1, 2, 3])
def test_lines_that_come_after_the_mark_was_sent_belong_to_the_list(em):
    state = MCodeState(MCode(em))
    own = fresh_mark(state, "", party=False)
    request = state.codec.request("", f"PR {own.item}")
    request = replace(request, expect=own.shown, gather=True, signed=True)
    head = {1: "\r\n", 2: "", 3: f"PR {own.item}\r\n"}[em]
    reply = f"20  LB G2\r\n25  RT\r\n{head}{own.shown}\r\n".encode()
    found = state.codec.decode(request, reply)
    assert found is not None and found.reply.lines == ("20  LB G2", "25  RT", own.shown)


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_list_with_pauses_is_whole_or_said_to_be_incomplete(bench, em, party, check):
    whole = 0
    for seed in range(3):
        desk = Desk(bench, (em, check), party=party, baud=9600)
        for line in ("PG 1", *LINES, "PG"):
            desk.type(line)
        disturb(desk.bench.wire, Faults(late=0.02, late_by=(0.01, 0.4)), seed)
        try:
            listed = desk.type("L")
        except NoAnswer:
            continue
        whole += 1
        assert [line.split(None, 1)[1] for line in listed] == LINES
    assert whole
