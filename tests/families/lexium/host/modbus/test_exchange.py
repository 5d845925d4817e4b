"""What is typed over Modbus: its requests, what is printed, refusals and silence; the conditions of a drive."""

from __future__ import annotations

from typing import Any

import pytest

from multidrop.base.errors import Inexpressible, NoAnswer, Refused
from multidrop.dialects import End, Hints, Kind, Priority, Procedure, Reply
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.host.modbus.family import ModbusFamily
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.families.lexium.simulator.ports.modbus import ModbusPort
from tests.support.cases import for_each
from tests.support.lexium import drive
from tests.support.procedure import ProcedureRunner

OBJECTS = {0: "SEM USA", 1: "LMDCE571", 2: "6.0.0.2", 3: "www", 4: "Lexium", 5: "0401", 6: "LMDCE 6.002, Hw: 3.2"}


class Far:
    """A drive that holds words by address; `raises` are exceptions by name, `silent` names that are not answered."""

    def __init__(self, **values):
        self.words = dict.fromkeys((a for row in REGISTERS.values() for a in row.addresses), 0)
        self.raises, self.silent, self.specific = {}, set(), {}
        self.sent = []
        for name, value in values.items():
            self.put(name, value)

    def put(self, name, value):
        row = REGISTERS[name]
        self.words |= dict(zip(row.addresses, framing.words_of(value, row.count), strict=True))

    def get(self, name):
        row = REGISTERS[name]
        return mapping.value_of(row, [self.words[a] for a in row.addresses])

    def __call__(self, request):
        pdu = request.body
        self.sent.append((pdu[0], pdu[1:].hex()))
        name = mapping.place(pdu).partition("(")[2].rstrip(")")
        if name in self.silent:
            return Reply(end=End.TIMEOUT)
        if name in self.raises:
            exception, error = self.raises[name]
            if error:
                self.put("EF", 1), self.put("ER", error)
            return Reply(end=End.REFUSED, body=bytes((pdu[0] | 0x80, exception)))
        return Reply(acknowledged=True, body=self.answer(pdu, name))

    def answer(self, pdu, name):
        address, count = int.from_bytes(pdu[1:3]), int.from_bytes(pdu[3:5])
        if pdu[0] == framing.READ_REGISTERS:
            found = b"".join(self.words[a].to_bytes(2) for a in range(address, address + count))
            if name == "ER":
                self.put("ER", 0), self.put("EF", 0)
            return pdu[:1] + bytes((len(found),)) + found
        if pdu[0] == framing.WRITE_REGISTERS:
            for at in range(count):
                self.words[address + at] = int.from_bytes(pdu[6 + 2 * at : 8 + 2 * at])
            return pdu[:5]
        if pdu[0] in (framing.READ_INPUTS, framing.READ_COILS):
            return pdu[:1] + b"\x01\x01"
        if pdu[0] == framing.IDENTIFY:
            chosen = {pdu[3]: OBJECTS[pdu[3]]} if pdu[2] == 4 else OBJECTS
            listed = b"".join(bytes((n, len(text))) + text.encode() for n, text in chosen.items())
            return pdu[:3] + bytes((0x83, 0, 0, len(chosen))) + listed
        if pdu[0] == framing.READ_SPECIFIC:
            text = self.specific.get(name, "").encode()
            return pdu[:1] + bytes((len(text),)) + text
        return pdu[:5] if pdu[0] == framing.WRITE_COIL else pdu[:1] + pdu[5:6] + pdu[1:5]


def say(talk, far):
    procedure = ProcedureRunner(talk)
    while procedure.request is not None:
        procedure.answer(far(procedure.request))
    return procedure.result


def state(**more):
    return ModbusState(Modbus(), product="LMDCE", stranger="", **more)


def type_(text, far, drive=None):
    drive = drive or state()
    return say(ModbusFamily(drive).perform(text), far)


LOOK = (3, "001f0001")
"""The look at EF behind a command."""


@pytest.fixture
def far():
    return Far()


@pytest.mark.parametrize(
    ("text", "sent", "printed"),
    [
        ("PR P", [(3, "00570002")], "-5"),
        ("pr p", [(3, "00570002")], "-5"),
        ('PR P," ",V', [(3, "00570002"), (3, "00850002")], "-5 1000"),
        ('PR "at ",P," steps"', [(3, "00570002")], "at -5 steps"),
        ('PR "nothing asked"', [], "nothing asked"),
        ("PR P 7", [(3, "00570002")], "-57"),
        ("PR I3", [(2, "00020001")], "1"),
        ("PR HT", [(3, "002c0001")], "65535"),
        ("PR MU", [(3, "00a00001")], "0"),
        ("PR TR", [(0x41, "20205254")], "100, k1"),
        ("PR VR", [(0x2B, "0e0406")], "LMDCE 6.002, Hw: 3.2"),
        ("PR SN", [(0x2B, "0e0405")], "0401"),
        ("PR R1,R2", [(3, "005f0002"), (3, "00610002")], "00"),
    ],
)
def test_prints(text, sent, printed):
    far = Far(P=-5, V=1000, HT=65535)
    far.specific = {"TR": "100, k1"}
    assert type_(text, far) == (printed,)
    assert far.sent == sent


@for_each(
    ("text", "sent"),
    [
        ("VM=600000", (0x10, "008b00020427c00009")),
        ("vm 600000", (0x10, "008b00020427c00009")),
        ("P=-1", (0x10, "0057000204ffffffff")),
        ("MR -51200", (0x10, "00460002043800ffff")),
        ("MA51200", (0x10, "0043000204c8000000")),
        ("SL 0", (0x10, "007800020400000000")),
        ("HM 1", (0x10, "002b0001020001")),
        ("HI=4", (0x10, "002a0001020004")),
        ("S", (0x10, "00760001020001")),
        ("IP", (0x10, "003c0001020001")),
        ("CF", (0x10, "00930001020001")),
        ("IC R1", (0x10, "0037000102005f")),
        ("DC V8", (0x10, "001b00010200b6")),
        ("V1 5", (0x10, "00a800020400050000")),
        ("HC=5", (0x10, "00290001020005")),
        ("O1=1", (5, "0000ff00")),
        ("O3 0", (5, "00020000")),
        ("OT=5", (0x10, "00560001020005")),
        ("IS=1,2,0", (0x42, "20205349063d312c322c30")),
        ("is = 5, 9, 1", (0x42, "20205349063d352c392c31")),
        ("OS=1,17", (0x42, "2020534f053d312c3137")),
        ("TR=65000,k1", (0x42, "20205254093d36353030302c4b31")),
        ("MU=2,0", (0x42, "2020554d043d322c30")),
        ("EX A3", (0x42, "20205845024133")),
        ("EX 100", (0x42, "2020584503313030")),
        ("PS", (0x42, "2020535000")),
        ("RS", (0x42, "2020535200")),
        ("E", (0x41, "20202045")),
    ],
)
def test_commands_print_nothing_and_are_followed_by_a_look_at_the_error_flag(text, sent):
    far = Far()
    assert type_(text, far) == ()
    assert far.sent == [sent, LOOK]


def test_a_blank_line_sends_nothing_and_a_comment_is_refused(far):
    assert type_("  ", far) == ()
    for text in ("' only a comment", "VM=2 'x", "MA 51`200", "MA 51\\200", "PR P \\"):
        with pytest.raises(Inexpressible, match="nothing was sent"):
            type_(text, far)
    assert far.sent == []


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("PR UV", "UV has no Modbus register; MCode/TCP"),
        ("PR CK", "CK has no Modbus register; MCode/TCP"),
        ("CW=1", "MCode/TCP"),
        ("PR Q7", "only R1 to R4 and V1 to V8"),
        ("VM=R1*2", "expressions are not evaluated over Modbus"),
        ("VM=R1", "expressions are not evaluated over Modbus"),
        ("PR -P,V", "MCode/TCP"),
        ("PR AB P", "MCode/TCP"),
        ("MA 5,1", "MCode/TCP"),
        ("VM=1.5", "takes whole numbers"),
        ("VM=3000000000", "does not fit into the 32 bits of VM"),
        ("HC=70000", "does not fit into the 16 bits of HC"),
        ("HT=-1", "-1 does not fit into the 16 bits of HT, which have no sign; nothing was sent"),
        ("SF=-600", "-600 does not fit into the 16 bits of SF, which have no sign; nothing was sent"),
        ("HM -1", "-1 does not fit into the 16 bits of HM, which have no sign; nothing was sent"),
        ("MA", "needs a value"),
        ("O1=2", "0 or 1"),
        ("E 5", "takes no value"),
        ("PG 100", "MCode/TCP"),
        ("L", "MCode/TCP"),
        ("IC Q7", "no Modbus register"),
        ("TR=1234567890,ABCDEFGHIJKLMNOPQRS", "28"),
        ("IS", "needs its parameters"),
        ("5", "MCode/TCP"),
        ('PR "open', "quotation mark"),
        ("VM=1 2", "comma"),
    ],
)
def test_what_no_register_can_carry_is_said_and_nothing_is_sent(text, named, far):
    with pytest.raises(Inexpressible, match=named.replace("(", r"\(")) as caught:
        type_(text, far)
    assert far.sent == [] and "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "code"), [("V=5", 25), ("BY=1", 25), ("PR MA", 35), ("PR O1", 35), ("PR E", 35)])
def test_what_the_drive_would_refuse_by_its_nature_is_refused_with_its_number(text, code, far):
    with pytest.raises(Refused, match=f"error {code}") as caught:
        type_(text, far)
    assert caught.value.code == code and far.sent == []


def test_an_exception_is_told_with_number_name_and_register(far):
    far.raises = {"P": (2, 0)}
    with pytest.raises(Refused) as caught:
        type_("PR P", far)
    assert str(caught.value) == ("the drive refused 'PR P': exception 02 illegal data address at register 0x0057 (P)")
    assert caught.value.code is None and far.sent == [(3, "00570002")]


def test_a_value_out_of_range_names_the_range(far):
    far.raises = {"HC": (3, 0)}
    with pytest.raises(
        Refused, match=r"exception 03 illegal data value at register 0x0029 \(HC\), which takes 0 to 100"
    ):
        type_("HC=101", far)


def test_a_limit_of_the_unit_is_named_in_place_of_a_range_that_has_the_value():
    """VM=5 is in the register's range VI+1..5000000 of a drive at VI=1000."""
    far = Far(VI=1000, MS=256)
    far.raises = {"VM": (3, 77)}
    with pytest.raises(Refused, match=r"which takes 1001 to 2560000 now \(VI=1000, MS=256, EE=0, AS=0\); error 77: "):
        type_("VM=5", far)
    far.raises, far.words[REGISTERS["MS"].address] = {"SL": (3, 0)}, 1
    with pytest.raises(Refused, match=r"which takes -10000 to 10000 now \(MS=1, EE=0, AS=0\)$"):
        type_("SL 4000000", far)
    far.raises = {"RC": (3, 0)}
    with pytest.raises(
        Refused, match=r"\(RC\): 50 is in the range of the register, and this unit does not take it now$"
    ):
        type_("RC=50", far)


def test_a_limit_that_cannot_be_read_is_not_named_and_nothing_else_is_said_of_the_value():
    far = Far(VI=1000, MS=256)
    far.raises, far.silent = {"VM": (3, 0)}, {"VI"}
    with pytest.raises(Refused, match=r"0x008B \(VM\): 5 is in the range of the register, and this unit does not"):
        type_("VM=5", far)


@pytest.mark.parametrize(
    ("address", "values", "named"),
    [
        (0x58, (5,), "which is a part of P: write both registers, as in /register 0x0057 =VALUE"),
        (0x57, (5, 1), "P): 65541 is in the range"),
        (0x8D, (85, 2), r"which takes 0 to 84"),
        (0x8D, (84, 9), r"which takes 0 to 3"),
    ],
)
def test_a_refused_write_of_raw_registers_names_the_value_that_is_wrong(address, values, named):
    def far(asked):
        if asked.body[0] == framing.WRITE_REGISTERS:
            return Reply(end=End.REFUSED, body=bytes((0x90, 3)))
        return Reply(body=b"\x03\x02\0\0")

    with pytest.raises(Refused) as caught:
        say(ModbusFamily(state()).registers.write(address, values), far)
    assert named in str(caught.value)


NAMES = {4: "device failure", 5: "acknowledge", 8: "unknown", 11: "gateway target does not respond", 255: "unknown"}


@pytest.mark.parametrize(
    ("number", "text"),
    [(number, text) for number in NAMES for text in ("MR 5", "EX A3", "O1=1")]
    + [(number, text) for number in (5, 11) for text in ("PR P", "PR IS")],
)
def test_an_exception_of_a_request_that_may_be_executed_is_no_refusal(number, text, far):
    def answer(asked):
        return Reply(end=End.REFUSED, body=bytes((asked.body[0] | 0x80, number)))

    with pytest.raises(NoAnswer, match=f"'{text}' has no result: exception {number:02} {NAMES[number]} at ") as caught:
        say(ModbusFamily(state()).perform(text), answer)
    assert ("it was sent once" in str(caught.value)) != text.startswith("PR")
    assert ("the gateway got no reply" in str(caught.value)) == (number == 11)


@pytest.mark.parametrize("text", ["MR 5", "EX A3", "O1=1", "PR P"])
def test_a_gateway_without_a_path_is_not_called_the_drives_refusal(text, far):
    def answer(asked):
        return Reply(end=End.REFUSED, body=bytes((asked.body[0] | 0x80, 10)))

    with pytest.raises(Refused, match=f"^'{text}' did not reach the drive: exception 10 .*the gateway did not pass"):
        say(ModbusFamily(state()).perform(text), answer)


@pytest.mark.parametrize("number", [5, 10, 11])
def test_a_gateway_that_replies_in_place_of_a_drive_makes_no_stranger_of_it(number):
    def answer(asked):
        return Reply(end=End.REFUSED, body=bytes((asked.body[0] | 0x80, number)))

    with pytest.raises(NoAnswer, match=f"exception {number:02}"):
        say(ModbusFamily.identify(Hints()), answer)


@pytest.mark.parametrize("number", [1, 2, 3, 4, 6, 8])
def test_a_device_without_an_identification_is_a_stranger(number):
    def answer(asked):
        return Reply(end=End.REFUSED, body=bytes((asked.body[0] | 0x80, number)))

    [found] = say(ModbusFamily.identify(Hints()), answer)
    assert found.stranger


def test_a_busy_gateway_does_not_hide_the_error_flag(far):
    """Exception 06 at EF says nothing of the flag: an error that a drive has is not taken for the next line's."""
    drive = state()
    far.raises = {"MR": (4, 0), "EF": (6, 0)}
    with pytest.raises(NoAnswer, match="exception 04"):
        type_("MR 5", far, drive)
    assert drive.error


@pytest.mark.parametrize(
    ("text", "reads"), [("PR O1", "/coil 1 reads it"), ("PR O3", "/coil 3 reads it"), ("PR OT", "/coil 3 read it")]
)
def test_a_print_of_an_output_says_what_reads_it(text, reads, far):
    with pytest.raises(Refused, match=f"error 35: .*; .*{reads}$"):
        type_(text, far)
    assert far.sent == []


def test_silence_says_which_number_came(far):
    def answer(asked):
        return Reply(end=End.TIMEOUT, detail="a reply with transaction number 0 came, and the request has 7")

    with pytest.raises(
        NoAnswer, match=r"does not reply \(a reply with transaction number 0 came, .* 7\): it is not kn"
    ):
        say(ModbusFamily(state()).perform("MR 5"), answer)


def test_a_failure_is_told_with_the_drives_own_error_which_is_cleared(far):
    far.raises = {"MA": (4, 94)}
    with pytest.raises(
        Refused, match=r"exception 04 device failure at register 0x0043 \(MA\); error 94: .*disabled"
    ) as e:
        type_("MA 5", far)
    assert e.value.code == 94
    assert (far.get("EF"), far.get("ER")) == (0, 0)
    assert [name for name, _ in far.sent] == [0x10, 3, 3]


@pytest.mark.parametrize("number", [20, 21, 83, 85])
def test_an_error_behind_a_write_that_was_accepted_is_no_refusal(number):
    far = Far(EF=1, ER=number)
    told = f"accepted 'MR 5' and then showed error {number}: .*it is not known whether it was executed"
    with pytest.raises(NoAnswer, match=told):
        type_("MR 5", far)


def test_an_error_of_the_machine_behind_a_setting_is_no_refusal_of_it():
    far, drive = Far(EF=1, ER=86), state()
    assert type_("R1=777", far, drive) == ()
    [note] = drive.notes
    assert note.startswith("the drive: 'R1=777' was executed, and meanwhile: error 86: stall")


def test_an_error_from_before_is_read_and_told_first():
    far, drive = Far(EF=1, ER=86), state(error=True)
    assert type_("MR 5", far, drive) == ()
    assert drive.notes == ["the drive: an old error, now cleared: error 86: stall (check the load, RC "
                           "and A; ST=0 clears the flag)"]  # fmt: skip
    assert not drive.error and [data for _, data in far.sent][:2] == ["001f0001", "00210001"]


def test_an_error_whose_flag_could_not_be_read_is_told_before_the_next_command_and_not_blamed_on_it():
    far, drive = Far(), state()
    far.raises, far.silent = {"SL": (4, 85)}, {"EF"}
    with pytest.raises(NoAnswer, match="exception 04"):
        type_("SL 5000", far, drive)
    far.raises, far.silent = {}, set()
    assert type_("R2=5", far, drive) == ()
    assert any("an old error, now cleared: error 85" in note for note in drive.notes)


def test_an_error_whose_flag_could_not_be_read_before_a_command_may_be_older_than_it():
    far, drive = Far(EF=1, ER=85), state(error=True)
    procedure = ProcedureRunner(ModbusFamily(drive).perform("R2=5"))
    procedure.answer(Reply(end=End.TIMEOUT))
    with pytest.raises(NoAnswer, match=r"error 85: .*may be older than 'R2=5'.*not known whether 'R2=5' was executed"):
        while procedure.request is not None:
            procedure.answer(far(procedure.request))
    assert far.get("R2") == 5 and not drive.error


def test_the_error_of_a_command_that_was_not_answered_in_time_is_not_blamed_on_the_next():
    far, drive = Far(), state()
    far.silent = {"MR"}
    with pytest.raises(NoAnswer):
        type_("MR 5", far, drive)
    far.put("EF", 1), far.put("ER", 85)
    assert type_("R2=5", far, drive) == ()
    assert any("an old error, now cleared: error 85" in note for note in drive.notes)


def test_silence_is_told_and_nothing_is_sent_again(far):
    far.silent = {"MR"}
    with pytest.raises(NoAnswer, match="not known whether 'MR 5' was executed; it was sent once"):
        type_("MR 5", far)
    assert len(far.sent) == 1


def test_a_device_without_an_error_flag_is_believed(far):
    far.raises = {"EF": (2, 0)}
    assert type_("VM=5000", far) == ()


def test_printing_er_clears_it_and_the_next_command_is_not_held_up():
    far, drive = Far(EF=1, ER=86), state(error=True)
    assert type_("PR ER", far, drive) == ("86",)
    assert not drive.error


def test_pr_al_reads_every_readable_register_once():
    far = Far(P=-7)
    far.specific = {"IS": "IS = 1, 0, 0\r\nIS = 2, 0, 0", "OS": "OS = 1, 16, 1"}
    far.raises = {"AS": (2, 0)}
    lines = type_("PR AL", far)
    assert "P = -7" in lines and "IS = 2, 0, 0" in lines and "ER = 0" in lines
    readable = {row.name for row in REGISTERS.values() if row.readable} - {"AS"} - {f"V{n}" for n in range(1, 9)}
    assert {line.partition(" ")[0] for line in lines} == readable | {"IS", "OS"}
    assert list(lines) == sorted(lines, key=lambda line: line.partition(" ")[0])
    assert all(function in (2, 3, 0x41) for function, _ in far.sent)


def test_pr_al_asks_an_open_loop_drive_for_nothing_that_it_has_not():
    drive = state()
    drive.product = "LMDOE"
    lines = type_("PR AL", Far(), drive)
    assert [line for line in lines if REGISTERS.get(line.partition(" ")[0], REGISTERS["P"]).only] == []
    assert len(lines) > 40


def test_a_trip_that_is_not_set_up_prints_as_over_mcode(far):
    far.specific = {"TR": "0, 0, 0"}
    assert type_("PR TR", far) == ("0",)


def test_pr_al_clears_no_error():
    far, drive = Far(EF=1, ER=86), state()
    lines = type_("PR AL", far, drive)
    assert far.get("ER") == 86 and "EF = 1" in lines and not [line for line in lines if line.startswith("ER")]
    assert "ER is left out" in drive.notes[0]


def test_motion_is_two_requests_of_two_registers():
    far, drive = Far(P=-51200, V=-300), state()
    (motion,) = say(ModbusFamily(drive).motion(Priority.POLL), far)
    assert (motion.position, motion.velocity) == (-51200, -300)
    assert far.sent == [(3, "00570002"), (3, "00850002")]


@pytest.mark.parametrize(("name", "ask"), [("BY", "busy"), ("MV", "moving")])
def test_flags(name, ask):
    drive = state()
    talk = getattr(ModbusFamily(drive), ask)
    assert say(talk(), Far(**{name: 1})) is True
    assert say(talk(), Far()) is False


def test_programs_are_for_mcode():
    assert not ModbusFamily.offers("programs") and "over Modbus; MCode/TCP" in ModbusFamily.no_programs


def test_opening_only_reads_and_clears_nothing():
    far = Far(EF=1, ER=86)
    (drive,) = say(ModbusFamily.identify(Hints()), far)
    assert (drive.product, drive.version, drive.part) == ("LMDCE", "LMDCE 6.002, Hw: 3.2", "LMDCE571")
    assert drive.error and "EF=1" in drive.notes[0]
    assert far.sent == [(0x2B, "0e0300"), LOOK] and far.get("ER") == 86


def test_a_device_that_does_not_identify_itself_is_opened_and_said_so():
    def far(request):
        code = request.body[0] | 0x80
        return Reply(end=End.REFUSED, body=bytes((code, 1)))

    (drive,) = say(ModbusFamily.identify(Hints()), far)
    assert drive.product == "" and "did not identify itself as a Lexium drive" in drive.notes[0] and not drive.error


def test_an_identification_in_two_parts_is_put_together():
    parts = {0: (1, 2, {0: "a", 1: "LMDOE"}), 2: (0, 0, {6: "LMDOE 6.0"})}

    def far(request):
        if request.body[0] != framing.IDENTIFY:
            return Reply(body=b"\x03\x02\0\0")
        more, following, held = parts[request.body[3]]
        listed = b"".join(bytes((n, len(text))) + text.encode() for n, text in held.items())
        return Reply(body=request.body[:3] + bytes((0x83, 255 * more, following, len(held))) + listed)

    (drive,) = say(ModbusFamily.identify(Hints()), far)
    assert (drive.product, drive.version) == ("LMDOE", "LMDOE 6.0")


def test_silence_while_opening_is_no_drive():
    with pytest.raises(NoAnswer):
        say(ModbusFamily.identify(Hints()), lambda request: Reply(end=End.TIMEOUT))


# Raw registers


@pytest.mark.parametrize(
    ("address", "count", "printed"),
    [
        (0x57, None, ("0x0057 = 65531 (0xFFFB)", "0x0058 = 65535 (0xFFFF)", "P = -5")),
        (0x57, 1, ("0x0057 = 65531 (0xFFFB)",)),
        (0x58, None, ("0x0058 = 65535 (0xFFFF)",)),
        (0x29, None, ("0x0029 = 5 (0x0005)", "HC = 5")),
    ],
)
def test_raw_registers(address, count, printed):
    drive = state()
    assert say(ModbusFamily(drive).registers.read(address, count), Far(P=-5, HC=5)) == printed


@pytest.mark.parametrize(
    ("address", "values", "sent"),
    [
        (0x57, [-2], "0057000204fffeffff"),
        (0x57, [1, 2], "005700020400010002"),
        (0x58, [7], "00580001020007"),
        (0x29, [50], "00290001020032"),
    ],
)
def test_raw_writes(address, values, sent):
    far, drive = Far(), state()
    assert say(ModbusFamily(drive).registers.write(address, values), far) == ()
    assert far.sent == [(0x10, sent), LOOK]


@pytest.mark.parametrize("count", [0, 3, 70000])
def test_more_than_two_registers_are_not_asked_for(count):
    drive = state()
    with pytest.raises(Inexpressible, match="1 or 2 registers"):
        say(ModbusFamily(drive).registers.read(0x57, count), Far())


def test_outputs_and_identification():
    far, drive = Far(), state()
    assert say(ModbusFamily(drive).registers.read_coil(3), far) == ("O3 = 1",)
    assert say(ModbusFamily(drive).registers.write_coil(2, True), far) == ()
    assert far.sent[:2] == [(1, "00020001"), (5, "0001ff00")]
    lines = say(ModbusFamily(drive).registers.device(), far)
    assert lines[:2] == ("vendor: SEM USA", "part number: LMDCE571") and len(lines) == 7


def test_requests_say_what_they_are_to_a_person():
    drive = state()
    talk = ModbusFamily(drive).perform("MR 5")
    request = next(talk)
    assert (request.text, request.kind) == ("MR 5", Kind.COMMAND)


# Conditions


def carried(port: Any, procedure: Procedure[Any]) -> Any:
    runner = ProcedureRunner(procedure)
    while (request := runner.request) is not None:
        assert request.kind is Kind.PRINT
        found = request.codec.decode(request, port.receive(request.codec.encode(request), 0.0))
        assert found is not None
        runner.answer(found.reply)
    return runner.result


def test_flags_points_settings_and_set_ups_make_the_conditions() -> None:
    device = drive("IS=1,1,0", "OS=2,18,1", "OS=1,16,1", "O1=1", "RC=60", personality="LMDCE")
    port = ModbusPort(device)
    state = ModbusState(Modbus(), product="LMDCE", version="LMDCE 6.002")
    reader = ModbusFamily(state).values
    facts: dict[str, Any] = {}
    for part in reader.parts(facts):
        facts |= carried(port, part.read())
    (found,) = reader.fold(facts)
    shown = [(lamp.name, lamp.function, lamp.on) for lamp in found.lamps]
    assert shown[0] == ("1", "home", False)
    assert shown[-3:] == [("1", "", True), ("2", "error", False), ("3", "", False)]
    assert (found.error, found.program, found.run_current, found.hold_current) == (0, "", 60, 5)
    assert not device.memory.error_flag


def test_a_disabled_drive_is_read_with_its_flags() -> None:
    port = ModbusPort(drive("DE=0", personality="LMDCE"))
    state = ModbusState(Modbus(), product="LMDCE", version="LMDCE 6.002")
    reader = ModbusFamily(state).values
    quick = next(part for part in reader.parts({}) if part.name == "state")
    assert not quick.slow
    assert reader.fold(carried(port, quick.read()))[0].disabled == "DE=0"
