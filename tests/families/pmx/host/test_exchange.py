"""What is typed to a PMX controller: bytes, answers, refusals in words, late answers, opening, the stop."""

import csv

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer, Refused
from multidrop.dialects import End, Hints, Priority, Reply
from multidrop.dialects.codec import copy_with
from multidrop.families.pmx.host.codec import Pmx, PmxState
from multidrop.families.pmx.host.family import PmxFamily
from multidrop.families.pmx.manual import table
from multidrop.families.pmx.manual.help import LANGUAGE
from tests.support.paths import FACTS
from tests.support.procedure import ProcedureRunner

ANSWERS = {"ID": "Performax-2ED-SA", "VER": "V128BL", "DN": "2ED00"}
RESTING = {"PX": "10", "PY": "-20", "PSX": "0", "PSY": "0", "MSTX": "0", "MSTY": "0", "SLSX": "12", "SLSY": "12"}


class Far:
    """Controllers by number (or "") that answer from a table; what is not in it is not understood. `sent` is kept."""

    def __init__(self, *numbers, doubtful=(), **answers):
        self.numbers, self.sent, self.doubtful = numbers or ("00",), [], doubtful
        self.answers = ANSWERS | RESTING | {"SASTAT0": "0", "SASTAT1": "0"} | answers

    def __call__(self, request):
        data = request.codec.encode(request)
        self.sent.append(data)
        text = self.answers.get(request.text, f"?{request.text}")
        silent = request.address not in self.numbers or text is None
        heard = b"" if silent else text.encode("latin-1") + b"\r"
        found = request.codec.decode(request, heard) or request.codec.on_timeout(request, heard)
        return copy_with(found.reply, raw=heard, doubtful=len(self.sent) in self.doubtful)


def say(talk, far):
    procedure = ProcedureRunner(talk)
    while procedure.request is not None:
        procedure.answer(far(procedure.request))
    return procedure.result


def type_(text, far, known=None):
    known = known or PmxState(Pmx(), "00")
    return say(PmxFamily(known).perform(text), far)


# On the wire


@pytest.mark.parametrize(
    ("codec", "address", "text", "sent"),
    [
        (Pmx(), "00", "POLX", b"@00POLX\r"),
        (Pmx(), "07", " X1000Y-2000 ", b"@07X1000Y-2000\r"),
        (Pmx(), "99", "hspd=5", b"@99hspd=5\r"),
        (Pmx(addressed=False), "", "DI", b"DI\r"),
    ],
)
def test_a_command_goes_out_as_typed_behind_its_number(codec, address, text, sent):
    assert codec.encode(codec.request(address, text)) == sent


@pytest.mark.parametrize(
    ("address", "text"), [("0", "PX"), ("a", "PX"), ("٠٠", "PX"), ("00", "µ"), ("00", "V1=" + "9" * 60)]
)
def test_what_cannot_be_sent_is_said(address, text):
    with pytest.raises(Inexpressible):
        Pmx().request(address, text)


@pytest.mark.parametrize(
    ("heard", "line"),
    [
        (b"7\r", "7"),
        (b"\n7\r", "7"),
        (b"\0\0007\0\r\0\0", "7"),
        (b"@00POLX\r7\r", "7"),
    ],
)
def test_an_answer_is_the_first_line_that_is_no_command(heard, line):
    asked = Pmx().request("00", "POLX")
    assert Pmx().decode(asked, heard).reply.lines == (line,)


@given(
    st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126, blacklist_characters="@"), max_size=30).filter(
        lambda text: text.strip("OK")
    ),
    st.data(),
)
def test_an_answer_is_the_same_whole_and_byte_by_byte(text, data):
    codec, asked = Pmx(), Pmx().request("00", "PX")
    whole = text.encode() + b"\r"
    cut = data.draw(st.integers(0, len(whole) - 1))
    assert codec.decode(asked, whole[:cut]) is None
    assert codec.decode(asked, whole).used == len(whole)


@pytest.mark.parametrize(
    ("text", "heard", "found"),
    [
        ("V2=5", b"0\rOK\r", "OK"),
        ("X1000", b"1\rOK\r", "OK"),
        ("V1", b"OK\r7\r", "7"),
        ("V1", b"K\r7\r", "7"),
        ("V1", b"OOK\r7\r", "7"),
        ("V1", b"\r7\r", "7"),
        ("X1000", b"?~~~\rOK\r", "OK"),
    ],
)
def test_a_late_answer_of_the_other_kind_is_none(text, heard, found):
    codec = Pmx()
    request = codec.request("00", text)
    decoded = codec.decode(request, heard)
    assert decoded.reply.lines == (found,) and len(decoded.strays) == 1
    assert codec.decode(request, heard[: heard.index(b"\r") + 1]) is None


def test_an_answer_that_is_damaged_is_told_from_none():
    asked = Pmx().request("00", "PX")
    assert Pmx().on_timeout(asked, b"").reply.end is Pmx().on_timeout(asked, b"\n\0").reply.end is End.TIMEOUT
    assert Pmx().on_timeout(asked, b"12").reply.end is Pmx().decode(asked, b"1\xb52\r").reply.end is End.DAMAGED
    assert Pmx().decode(asked, b"U" * 62 + b"7\r").reply.end is End.DAMAGED  # of a baud rate that differs
    assert "echo=local" in Pmx().on_timeout(asked, b"@00PX\r").reply.detail


# What is printed


def test_a_value_is_printed_and_ok_prints_nothing():
    far = Far(**{"PX": "-1000", "HSPD=5000": "OK", "SA7": ""})
    assert (type_("PX", far), type_("HSPD=5000", far), type_("SA7", far)) == (("-1000",), (), ("",))
    assert far.sent == [b"@00PX\r", b"@00HSPD=5000\r", b"@00SA7\r"]


@pytest.mark.parametrize(
    ("text", "answer", "told"),
    [
        ("X1000", "?Moving", "00 refused 'X1000': ?Moving: the motor is moving (wait until it is at rest, or STOP"),
        ("SSPDX=5", "?S-Curve On", "SCVX=0"),
        ("GS3", "?Sub not Initialized", "no subroutine of that number"),
        ("hspd=5000", "?hspd=5000", "it reads capitals only: HSPD=5000"),
        ("HS=5000", "?HS=5000", "it is HSPD"),
        ("HSX", "?HSX", "it is HSPD"),
        ("DI=1", "?DI=1", "DI cannot be set"),
        ("HSPD = 5", "?HSPD = 5", "no spaces: HSPD=5"),
        ("X1000", "?X1000", "it does not take that now (an axis with a limit error takes no move"),
        ("JX+", "?JX+", "CLRX and CLRY clear it"),
        ("LSPD=7000000", "?Low speed out of range", "LSPD takes 1 to 6000000 pulses/s"),
        ("LSPDY=7000000", "?Low speed out of range", "LSPDY takes 1 to 6000000 pulses/s"),
        ("X1000", "?Low speed out of range", "LSPD, or LSPDX and LSPDY, may not be above HSPD"),
        ("ACC=0", "?Invalid Answer", "ACC takes 1 ms or more"),
        ("DO=256", "?Invalid Answer", "DO takes 0 to 255"),
        ("POLX=99999", "?Invalid Answer", "POLX takes the sum of its bits, 0 to 16383"),
        ("V64=1", "?Index out of Range", "valid: V0 to V63"),
        ("DI9", "?Index out of Range", "valid: DI, DI1 to DI8"),
        ("X3000000000", "?X3000000000", "3000000000 is beyond the range, -2147483648 to 2147483647"),
        ("x1000", "?x1000", "it reads capitals only: X1000"),
        ("MSTZ", "?MSTZ", "perhaps"),
        ("QQQ", "?QQQ", "?QQQ: it does not know that command"),
    ],
)
def test_a_refusal_says_what_it_means_and_what_to_do(text, answer, told):
    with pytest.raises(Refused) as caught:
        type_(text, Far(**{text: answer}))
    assert told in str(caught.value) and str(caught.value).startswith(f"00 refused '{text}'")


@pytest.mark.parametrize("reply", ["?HSQD=5000", "?AT", "?X200"])
def test_a_refusal_of_another_line_is_none_of_ours(reply):
    why = "came for 'X100': .*another program.*not known whether 'X100' was executed; it was sent once"
    with pytest.raises(NoAnswer, match=why):
        type_("X100", Far(X100=reply))


def test_what_acts_after_a_power_cycle_is_said():
    known = PmxState(Pmx(), "00")
    type_("DN=2ED05", Far(**{"DN=2ED05": "OK"}), known)
    assert known.remarks == ["00: DN acts after STORE and a power cycle"]


def test_silence_is_told_and_the_next_line_waits_for_a_mark():
    known, far = PmxState(Pmx(), "00"), Far(X1000=None)
    with pytest.raises(NoAnswer, match="not known whether 'X1000' was executed; it was sent once"):
        type_("X1000", far, known)
    assert type_("PX", far, known) == ("10",)
    assert far.sent == [b"@00X1000\r", b"@00Q00001\r", b"@00PX\r"] and not known.reply_pending


def test_after_a_damaged_reply_too_the_next_line_waits_for_a_mark():
    known, far = PmxState(Pmx(), "00"), Far()
    procedure = ProcedureRunner(PmxFamily(known).perform("X1000"))
    with pytest.raises(NoAnswer, match="it may have been executed and was not sent again"):
        procedure.answer(Reply((), end=End.DAMAGED))
    assert type_("PX", far, known) == ("10",)
    assert far.sent == [b"@00Q00001\r", b"@00PX\r"]


def test_each_mark_is_another():
    known, far = PmxState(Pmx(), "07"), Far()
    for _ in range(2):
        known.reply_pending = True
        with pytest.raises(NoAnswer, match="'PX' was not sent"):
            type_("PX", far, known)
    assert far.sent == [b"@07Q07001\r", b"@07Q07002\r"]


def test_an_answer_that_may_be_anothers_is_made_sure_of():
    assert type_("PX", far := Far(doubtful=[1])) == ("10",)
    assert far.sent == [b"@00PX\r", b"@00Q00001\r"]
    with pytest.raises(NoAnswer, match="a late reply came"):
        type_("PX", Far(doubtful=[1], Q00001="10\r?Q00001"))


# Motion and status


def test_a_poll_reads_both_axes_and_no_speed_of_one_that_rests():
    known, far = PmxState(Pmx(), "00"), Far(MSTX="4", PSX="-500", MSTY="128")
    x, y = say(PmxFamily(known).motion(Priority.POLL), far)
    assert (x.axis, x.position, x.velocity, x.trouble) == ("x", 10, -500, "")
    assert (y.axis, y.position, y.velocity, y.trouble) == ("y", -20, 0, "plus limit error")
    assert b"@00PSY\r" not in far.sent and len(far.sent) == 5


def test_after_a_stop_the_speed_itself_is_read():
    known, far = PmxState(Pmx(), "00"), Far()
    say(PmxFamily(known).motion(Priority.OPERATOR), far)
    assert {b"@00PSX\r", b"@00PSY\r"} < set(far.sent)


def test_a_doubtful_poll_is_made_sure_of_once():
    known, far = PmxState(Pmx(), "00"), Far(doubtful=[1, 2, 3, 4])
    say(PmxFamily(known).motion(Priority.POLL), far)
    assert far.sent[4:] == [b"@00Q00001\r"]


@pytest.mark.parametrize(("answers", "moving"), [({}, False), ({"MSTY": "2"}, True), ({"MSTX": "112"}, False)])
def test_moving_is_what_makes_pulses(answers, moving):
    known = PmxState(Pmx(), "00")
    assert say(PmxFamily(known).moving(), Far(**answers)) is moving


@pytest.mark.parametrize(("state", "busy"), [("0", False), ("1", True), ("2", False), ("4", False)])
def test_busy_is_a_program_that_runs(state, busy):
    known = PmxState(Pmx(), "00")
    assert say(PmxFamily(known).busy(), Far(SASTAT1=state)) is busy


def test_status_in_words():
    known = PmxState(Pmx(), "00")
    far = Far(MSTX="17", MSTY="256", SLSY="10", SASTAT1="4", DI="129", DO="0", EO="2")
    assert say(PmxFamily(known).status(), far) == (
        "X: accelerating, plus limit switch on; StepNLoop off",
        "Y: at rest, minus limit error; StepNLoop error: stalled",
        "program 0: idle",
        "program 1: stopped by an error",
        "inputs on: 1, 8",
        "outputs on: none",
        "motor drivers on: 2",
    )


# Opening and the stop


def test_opening_only_asks():
    far = Far("00", "01", MSTX="256", SLSY="9")
    first, second = say(PmxFamily.identify(Hints(drives=("00", "01"))), far)
    assert (first.product, first.version, first.name) == ("PMX-2ED-SA", "V128BL", "2ED00")
    assert "00: X has a minus limit error; CLRX clears it" in first.notes
    assert any("StepNLoop of Y" in note and "too many" in note for note in first.notes)
    assert "01: its DN is 2ED00, so it will answer at 00 after a power cycle" in second.notes
    assert not [data for data in far.sent if b"=" in data or data[3:] not in
                (b"ID\r", b"VER\r", b"DN\r", b"MSTX\r", b"MSTY\r", b"SLSX\r", b"SLSY\r")]  # fmt: skip


def test_one_that_is_missing_is_said_and_kept():
    here, gone = say(PmxFamily.identify(Hints(drives=("00", "05"))), Far("00"))
    assert here.product and not gone.product and gone.notes == ["05 does not reply"]


def test_behind_a_gateway_no_number_is_needed():
    (known,) = say(PmxFamily.identify(Hints(addressed=False)), Far(""))
    assert (known.address, known.codec) == ("", Pmx(addressed=False))
    (known,) = say(PmxFamily.identify(Hints()), far := Far(""))
    assert known.codec == Pmx(addressed=False) and far.sent[0] == b"@00ID\r"


def test_nobody_there():
    with pytest.raises(NoAnswer, match="no controller replies at 00, 01"):
        say(PmxFamily.identify(Hints(drives=("00", "01"))), Far("99"))
    with pytest.raises(Inexpressible, match="00 to 99"):
        say(PmxFamily.identify(Hints(drives=("a",))), Far())
    with pytest.raises(Inexpressible, match="for MCode"):
        say(PmxFamily.identify(Hints(em=1)), Far())


def test_the_stop_aborts_each_and_ends_its_programs_in_pieces():
    codec = Pmx()
    assert codec.stop(["03", "07"]) == b"@03ABORT\r"
    pieces = [piece.data for piece in codec.stop_again(["03", "07"])]
    assert pieces[:2] == [b"@07ABORT\r", b"@03ABORT\r"]
    assert pieces[2:5] == [b"@03SR0=0\r", b"@03SR1=0\r", b"@03ABORT\r"]
    assert pieces[5:] == [b"@07SR0=0\r", b"@07SR1=0\r", b"@07ABORT\r"]
    assert all(piece.count(b"\r") == 1 for piece in pieces)
    assert codec.stop([]) == b"ABORT\r@00ABORT\r" and codec.stop(["00"], half_sent=True) == b""
    assert Pmx(addressed=False).stop([""]) == b"ABORT\r"


# Programs


class Line:
    def __init__(self, number, text):
        self.number, self.text = number, text


def test_raw_lines_are_written_and_read_back():
    known, done = PmxState(Pmx(), "00"), []
    far = Far(**{"SA0=PS0": "OK", "SA0": "PS0", "SA1=XX0": "OK", "SA1": "XX0"})
    lines = [Line(1, "SA0=PS0"), Line(2, "SA1=XX0")]
    say(PmxFamily(known).programs.download(lines, None, lambda at, total: done.append((at, total))), far)
    assert done == [(1, 2), (2, 2)] and far.sent[2:4] == [b"@00SA0=PS0\r", b"@00SA0\r"]


def test_anything_else_is_refused_before_something_is_written():
    known, far = PmxState(Pmx(), "00"), Far()
    with pytest.raises(Diagnostic, match="program:2:1: 'X1000' is not a compiled line"):
        say(
            PmxFamily(known).programs.download([Line(1, "SA0=PS0"), Line(2, "X1000")], None, lambda at, total: None),
            far,
        )
    with pytest.raises(Refused, match="program 1 runs"):
        say(
            PmxFamily(known).programs.download([Line(1, "SA0=PS0")], None, lambda at, total: None),
            Far(SASTAT1="1"),
        )
    assert far.sent == []


def test_a_line_that_was_not_kept_is_seen():
    known, far = PmxState(Pmx(), "00"), Far(**{"SA0=PS0": "OK", "SA0": "PS1"})
    with pytest.raises(NoAnswer, match="has 'PS1' at SA0"):
        say(PmxFamily(known).programs.download([Line(1, "SA0=PS0")], None, lambda at, total: None), far)


def test_a_download_that_is_refused_half_way_says_what_is_stored():
    known = PmxState(Pmx(), "00")
    far = Far(**{"SA0=PS0": "OK", "SA0": "PS0", "SA1=XX0": "?SA1=XX0"})
    lines = [Line(1, "SA0=PS0"), Line(2, "SA1=XX0")]
    with pytest.raises(Refused, match=r"^line 2: .*; 1 of 2 lines are stored: the program in 00 is incomplete$"):
        say(PmxFamily(known).programs.download(lines, None, lambda at, total: None), far)


def test_a_listing_ends_where_nothing_is_stored():
    known = PmxState(Pmx(), "00")
    stored = {f"SA{n}": "" for n in range(40)} | {"SA0": "PS0", "SA2": "XX1"}
    assert say(PmxFamily(known).programs.listing(""), Far(**stored)) == ("SA0=PS0", "SA1=", "SA2=XX1")


# Tables


@pytest.mark.skipif(not FACTS.is_dir(), reason="the facts are not here")
def test_every_command_and_every_refusal_of_the_manual_is_known():
    with open(FACTS / "pmx-ascii-commands.csv") as file:
        for row in csv.DictReader(file):
            name = row["command"].partition("=")[0]
            for shape, given in (("[axis]", "X"), ("[X axis]: [Y axis]", "1:2"), ("[value]", "5"), ("[+/-]", "+")):
                name = name.replace(shape, given)
            name = name.replace("[target X] Y[target Y]", "1Y2")
            name = name.partition("[")[0] + name.partition("[")[2].partition("-")[0]
            assert table.lookup(name) is not None, row["command"]
    with open(FACTS / "pmx-errors.csv") as file:
        assert {row["reply"] for row in csv.DictReader(file)} - set(table.MEANINGS) == {"?[Command]"}


def test_help_names_syntax_value_and_place_in_the_manual():
    lines = LANGUAGE.describe("hspdx")
    assert lines[0].startswith("HSPD: ") and any("HSPDX, HSPDY" in line for line in lines)
    with pytest.raises(Diagnostic, match="HSPD"):
        LANGUAGE.describe("HSX")
    assert ("MSTX", table.COMMANDS["MST"].meaning) in LANGUAGE.complete("ms")
    assert (
        LANGUAGE.hint("X1000").startswith("X1000")
        and "capitals" in LANGUAGE.hint("mstx")
        and LANGUAGE.hint("???") == ""
    )


def test_words_of_a_motor_status():
    assert table.status_words(0) == ("at rest",)
    assert table.status_words(0b1) == ("accelerating",)
    assert table.status_words(1 << 7 | 1 << 4) == ("at rest", "plus limit error", "plus limit switch on")


def test_a_mark_that_lost_its_end_is_no_refusal_of_the_line_whose_reply_it_swallowed():
    codec = Pmx()
    found = codec.decode(codec.request("01", "X5"), b"?Q03001OK\r")
    assert found is not None and (found.reply.end, found.reply.detail) == (End.DAMAGED, "heard '?Q03001OK'")
    found = codec.decode(codec.request("02", "V1"), b"9786678?Q01004\r")
    assert found is not None and (found.reply.end, found.reply.detail) == (End.DAMAGED, "heard '9786678?Q01004'")
    typed = codec.decode(codec.request("01", "Q1234"), b"?Q1234\r")
    assert typed is not None and typed.reply.end is End.REFUSED
