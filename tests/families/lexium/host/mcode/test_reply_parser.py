"""Answers of an MCode drive in every echo, party and checksum mode, whole and byte by byte."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Inexpressible
from multidrop.dialects import Decoded, End, Kind, Reply
from multidrop.families.lexium.host.mcode.codec import MCode, only_strays, short_reply, without_end
from multidrop.families.lexium.host.mcode.framing import checksum, pieces, printable, sealed, unasked, unsealed
from multidrop.families.lexium.host.mcode.reply_parser import ReplyParser
from tests.support.cases import for_each

S = {text: sealed(text) for text in (b"0", b"aPR P", b"PR P", b"aMR 1", b"MR 1", b"12", b"Logic 000", b"PR ES")}
A, N = b"\x06", b"\x15"

# em, party, checksum, text, bytes of the drive, end, lines, acknowledged
ANSWERS = [
    # table 7.1: no party mode, no checksum
    (0, 0, 0, "MR 1", b"MR 1\r\n>", End.DONE, (), True),
    (0, 0, 0, "MR 1", b"MR 1\r\n?", End.REFUSED, (), False),
    (0, 0, 0, "PR P", b"PR P\r\n0\r\n>", End.DONE, ("0",), True),
    (0, 0, 0, "PR P", b"PR P\r\n0\r\n?", End.DONE, ("0",), False),
    (0, 0, 0, "PR ZZ", b"PR ZZ\r\n?", End.REFUSED, (), False),
    (0, 0, 0, 'PR ">"', b'PR ">"\r\n>\r\n>', End.DONE, (">",), True),
    (0, 0, 0, "PG 1", b"PG 1\r\n1  ", End.DONE, (), True),
    (1, 0, 0, "MR 1", b"\r\n", End.DONE, (), False),
    (1, 0, 0, "PR P", b"\r\n0\r\n", End.DONE, ("0",), False),
    (1, 0, 0, "PR P", b"0\r\n", End.DONE, ("0",), False),  # while a program runs
    (1, 0, 0, 'PR ""', b"\r\n\r\n", End.DONE, ("",), False),
    (2, 0, 0, "PR P", b"0\r\n", End.DONE, ("0",), False),
    (3, 0, 0, "MR 1", b"MR 1\r\n", End.DONE, (), False),
    (3, 0, 0, "PR P", b"PR P\r\n0\r\n", End.DONE, ("0",), False),
    # table 7.2: party mode
    (0, 1, 0, "MR 1", b"aMR 1\r\n>", End.DONE, (), True),
    (0, 1, 0, "PR P", b"aPR P\r\n0\r\n>", End.DONE, ("0",), True),
    (1, 1, 0, "MR 1", b"\r\n", End.DONE, (), False),
    (1, 1, 0, "PR P", b"\r\n0\r\n", End.DONE, ("0",), False),
    (2, 1, 0, "PR P", b"0\r\n", End.DONE, ("0",), False),
    (3, 1, 0, "MR 1", b"MR 1\r\n", End.DONE, (), False),
    (3, 1, 0, "MR 1", b"aMR 1\r\n", End.DONE, (), False),
    (3, 1, 0, "PR P", b"PR P\r\n0\r\n", End.DONE, ("0",), False),
    # tables 7.3 and 7.4: with checksum, ACK and NAK in the place of the first CRLF
    (0, 0, 1, "MR 1", S[b"MR 1"] + A + b">", End.DONE, (), True),
    (0, 1, 1, "MR 1", S[b"aMR 1"] + A + b">", End.DONE, (), True),
    (0, 1, 1, "MR 1", b"aMR 1" + A + b">", End.DONE, (), True),  # the check byte not echoed
    (0, 1, 1, "MR 1", S[b"aMR 1"] + N + b"?", End.NAK, (), False),
    (0, 1, 1, "MR 1", S[b"aMR 1"] + N + b">", End.NAK, (), False),
    (0, 1, 1, "PR P", S[b"aPR P"] + A + S[b"12"] + b"\r\n>", End.DONE, ("12",), True),
    (1, 1, 1, "MR 1", A, End.DONE, (), True),
    (1, 1, 1, "MR 1", N, End.NAK, (), False),
    (1, 1, 1, "PR P", A + S[b"0"] + b"\r\n", End.DONE, ("0",), True),
    (1, 0, 1, "PR ER", N + b"23\x9b\r\n", End.DONE, ("23",), False),  # units that say NAK while an error stands
    (0, 0, 1, "PR P", S[b"PR P"] + N + S[b"0"] + b"\r\n?", End.DONE, ("0",), False),
    (3, 0, 1, "PR P", S[b"PR P"] + N + S[b"0"] + b"\r\n", End.DONE, ("0",), False),
    (1, 0, 2, "PR P", N + S[b"0"] + b"\r\n", End.DONE, ("0",), False),
    (2, 1, 1, "PR P", S[b"0"] + b"\r\n", End.DONE, ("0",), False),
    (3, 1, 1, "MR 1", S[b"aMR 1"] + A, End.DONE, (), True),
    (3, 1, 1, "MR 1", S[b"MR 1"] + N, End.NAK, (), False),
    (3, 1, 1, "PR P", S[b"aPR P"] + A + S[b"0"] + b"\r\n", End.DONE, ("0",), True),
    (1, 1, 2, "MR 1", A, End.DONE, (), True),
    (1, 1, 2, "MR 1", N, End.NAK, (), False),
    (1, 1, 2, "PR P", A + S[b"0"] + b"\r\n", End.DONE, ("0",), True),
]


def asked(em: int, party: int, check: int, text: str, **changes: object):
    codec = MCode(em=em, party=bool(party), checksum=check)
    return codec, codec.request("a" if party else "", text, **changes)


@for_each(("em", "party", "check", "text", "data", "end", "lines", "ack"), ANSWERS)
def test_an_answer_is_whole_at_its_last_byte_and_not_before(em, party, check, text, data, end, lines, ack):
    codec, request = asked(em, party, check, text)
    for cut in range(len(data)):
        assert codec.decode(request, data[:cut]) is None, data[:cut]
    found = codec.decode(request, data)
    if end in (End.REFUSED, End.NAK) and found is None:  # believed only when nothing follows
        found = codec.on_quiet(request, data)
    assert found is not None
    assert (found.reply.end, found.reply.lines, found.reply.acknowledged) == (end, lines, ack)
    assert found.used == len(data)


NUMBERS = [row for row in ANSWERS if row[3] == "PR P"]
COMMANDS = [row for row in ANSWERS if row[3] == "MR 1" and row[0] != 0]


@for_each(("em", "party", "check", "text", "data", "end", "lines", "ack"), NUMBERS + COMMANDS)
def test_a_running_programs_print_is_told_from_the_answer(em, party, check, text, data, end, lines, ack):
    codec, request = asked(em, party, check, text)
    if request.kind is Kind.PRINT:
        request = replace(request, expect=r"-?\d+")
    stray = (S[b"Logic 000"] if check else b"Logic 000") + b"\r\n"
    at = data.index(b"\r\n") + 2 if em == 0 else 0
    data = data[:at] + stray + data[at:]
    found = codec.decode(request, data) or codec.on_quiet(request, data)
    assert found is not None
    assert (found.reply.end, found.reply.lines, found.strays) == (end, lines, ("Logic 000",))


def settled(em: int, party: int, check: int, text: str, data: bytes) -> Decoded | None:
    codec, request = asked(em, party, check, text)
    assert codec.decode(request, data) is None
    return codec.on_quiet(request, data)


def test_silence_after_a_command_is_success_only_where_nothing_is_to_be_expected():
    for em, check, silent in ((2, 0, True), (2, 1, True), (1, 0, True), (1, 2, True), (1, 1, False), (0, 0, False)):
        found = settled(em, 1, check, "MR 1", b"")
        assert (found is not None and found.reply.end is End.SILENT) is silent, (em, check)


def test_a_refused_print_without_a_prompt_is_told_by_its_line_feed_alone():
    found = settled(1, 0, 0, "PR ZZ", b"\r\n")
    assert found is not None
    assert (found.reply.end, found.reply.lines) == (End.SILENT, ())


def test_a_print_without_a_line_end_is_taken_when_it_is_quiet():
    found = settled(0, 0, 0, 'PR "abc";', b'PR "abc";\r\nabc>')
    assert found is not None
    assert (found.reply.lines, found.reply.prompt) == (("abc",), ">")
    found = settled(1, 0, 0, 'PR "abc";', b"\r\nabc")
    assert found is not None
    assert found.reply.lines == ("abc",)


def test_a_print_with_a_wrong_checksum_is_damaged():
    found = settled(1, 1, 1, "PR P", A + b"12\x81\r\n")
    assert found is not None
    assert found.reply.end is End.DAMAGED
    assert found.reply.lines == ()


def test_an_address_as_prompt_shows_program_mode():
    found = settled(0, 1, 0, "PR P", b"aPR P\r\n7  ")
    assert found is not None
    assert (found.reply.prompt, found.reply.lines) == ("7  ", ())


def test_the_device_name_at_a_moves_end_may_stand_behind_the_prompt():
    codec, request = asked(0, 0, 0, "MA 100,1")
    found = codec.decode(request, b"MA 100,1\r\n>!\r\n")
    assert found is not None
    assert found.used == len(b"MA 100,1\r\n>")
    assert codec.parse_unsolicited(b"!\r\n") == (("!",), 3)


def test_a_list_ends_at_the_prompt_with_echo_and_in_quiet_without():
    codec, request = asked(0, 0, 0, "L")
    data = b"L\r\n1  LB G1\r\n4  E\r\n>"
    found = codec.decode(request, data)
    assert found is not None
    assert found.reply.lines == ("1  LB G1", "4  E")
    found = settled(1, 0, 0, "L", b"\r\n1  LB G1\r\n4  E\r\n")
    assert found is not None
    assert found.reply.lines == ("1  LB G1", "4  E")


def test_idle_lines_lose_prompts_and_checksums_and_keep_unfinished_ones():
    assert MCode(em=0).parse_unsolicited(b"\r\n>") == ((), 3)
    assert MCode(em=0).parse_unsolicited(b">!\r\n") == (("!",), 4)
    assert MCode(em=1, checksum=1).parse_unsolicited(S[b"12"] + b"\r\nab") == (("12",), 5)
    assert MCode(em=1).parse_unsolicited(b"Logic 0") == ((), 0)


@pytest.mark.parametrize(
    ("em", "party", "check", "text", "frame"),
    [
        (0, 0, 0, "MR 51200", b"MR 51200\r"),
        (0, 1, 0, "MR 51200", b"aMR 51200\n"),
        (1, 0, 1, "MR 51200", b"MR 51200\xc9\r"),
        (1, 0, 2, "MR 1", b"MR 1\x90\r"),
        (1, 0, 1, "CK=0", b"CK=0\x85\r"),
        (1, 1, 1, "PR P  ", b"aPR P" + bytes([checksum(b"aPR P")]) + b"\n"),
        (1, 1, 0, "", b"a\n"),
    ],
)
def test_frames_carry_name_checksum_and_terminator(em, party, check, text, frame):
    codec, request = asked(em, party, check, text)
    assert codec.encode(request) == frame


def test_the_global_name_is_summed_too():
    codec = MCode(party=True, checksum=1)
    assert codec.encode(codec.request("*", "FD")) == b"*FD\xcc\n"


def test_a_line_that_no_drive_can_take_is_not_sent():
    codec = MCode(party=True)
    codec.request("a", "x" * 63)
    with pytest.raises(Inexpressible, match="65 characters .* a drive takes 64"):
        codec.request("a", "x" * 64)
    with pytest.raises(Inexpressible, match="printable ASCII"):
        codec.request("a", "PR \x1b")


def test_a_prompt_alone_is_no_answer_to_what_must_print_a_number():
    codec, request = asked(0, 0, 0, "PR ER")
    found = codec.on_quiet(replace(request, expect=r"-?\d+"), b"PR ER\r\n>")
    assert found is not None and found.reply.end is End.DAMAGED


@pytest.mark.parametrize(
    ("check", "text", "data"),
    [
        (0, "PR R1", b"PR R9\r\n1000\r\n>"),
        (0, "PR R1", b"PR R9\r\n1\r\n>"),
        (1, "R1=1", b"R1=9\xae\x1510  "),
    ],
)
def test_a_damaged_echo_is_not_completed_from_the_answer(check, text, data):
    codec, request = asked(0, 0, check, text)
    request = replace(request, kind=Kind.PROGRAM) if check else request
    found = codec.decode(request, data) or codec.on_quiet(request, data) or codec.on_timeout(request, data)
    assert found.reply.end is End.DAMAGED


def test_a_print_within_an_echo_may_begin_with_the_character_that_is_to_come():
    codec, request = asked(0, 0, 0, "MR 1")
    found = codec.decode(request, b"MRoll 1\r\nRR\r\n>R 1\r\n>")
    assert found is not None and found.reply.end is End.DONE
    assert found.strays == ("Roll 1", "RR")


def test_a_repetition_that_came_damaged_is_not_the_answer():
    codec, request = asked(3, 0, 0, "PR R1")
    assert codec.decode(request, b"P2 R1\r\n5\r\n") is None
    assert codec.on_timeout(request, b"P2 R1\r\n5\r\n").reply.end is End.DAMAGED


@pytest.mark.parametrize(
    ("escape", "names", "expected"),
    [
        (0, ["a", "b"], b"\x05"),
        (1, ["a", "b"], b"\x1b"),
        (2, ["a", "b"], b"a\x05b\x05\n"),
        (3, ["a"], b"a\x1b\n"),
        (None, ["a"], b"\x1b\x05a\x05a\x1b\n\x1b\x05"),
    ],
)
def test_the_stop_is_what_the_drives_escape_mode_asks_for(escape, names, expected):
    assert MCode(party=True, escape=escape).stop(names) == expected


@given(st.text(st.characters(max_codepoint=0x7F), max_size=40), st.data())
def test_a_sealed_line_is_unsealed_to_itself_and_any_flipped_bit_is_noticed(text, draw):
    data = text.encode()
    assert unsealed(sealed(data)) == data
    damaged = bytearray(sealed(data))
    damaged[draw.draw(st.integers(0, len(data)))] ^= 1 << draw.draw(st.integers(0, 7))
    assert unsealed(bytes(damaged)) is None
    assert 0x80 <= checksum(data) <= 0xFF
    assert (sum(sealed(data)) & 0x7F) == 0


@given(
    st.integers(0, 3),
    st.booleans(),
    st.integers(0, 2),
    st.sampled_from(["MR 1", "PR P", "L", "EM=1", "PG 1", "PG"]),
    st.lists(st.sampled_from([b"aMR 1", b"PR P", A, N, b"\r\n", b">", b"?", b"7  ", S[b"0"], b"0", b"\xff"])),
)
def test_any_bytes_decode_to_an_answer_or_to_nothing(em, party, check, text, parts):
    codec, request = asked(em, party, check, text)
    data = b"".join(parts)
    for found in (codec.decode(request, data), codec.on_quiet(request, data), codec.on_timeout(request, data)):
        if found is not None:
            assert 0 <= found.used <= len(data)
            assert isinstance(found.reply, Reply)


# Lines that no request asked for


BYTES = st.text(alphabet="ab>?\r\n\x06\x15\xe9 ", max_size=40).map(lambda text: text.encode("latin-1"))


@given(BYTES, st.sampled_from([0, 1, 2, 3]))
def test_lines_taken_at_once_are_those_taken_piece_by_piece(buffer, echo):
    used, lines = 0, []
    for piece in pieces(buffer, 0, acknowledged=False):
        prompt = echo == 0 and piece.shown[:1] in (b">", b"?")
        if piece.what == "rest" and not (prompt and len(piece.shown) == 1):
            break
        used = piece.end
        lines.append(printable(piece.data)[1 if prompt else 0 :])
    assert unasked(buffer, echo, 0) == (tuple(filter(None, lines)), used)


def test_a_thousand_lines_are_taken_at_once():
    text = "".join(f"{n}\r\n" for n in range(1000)) + "half"
    assert unasked(text.encode(), 1, 0) == (tuple(map(str, range(1000))), len(text) - 4)


# A reply that is read at once


PIECES = st.sampled_from(
    [
        b"\r\n",
        b"\n",
        b"\r",
        b"5",
        b"-51200",
        b'12"a"0',
        b">",
        b"?",
        b"Copyright 2010 Schneider",
        b"\x06",
        b"\x15",
        b"x y",
    ]
)
BUFFERS = st.lists(PIECES, max_size=5).map(b"".join)
ASKED = ["PR P", "PR P,DN,V", 'PR "x y"', "PR AL", "PR S1", "MR 5", "VM=5", "L", 'PR "Copyright"']


@given(buffer=BUFFERS, em=st.sampled_from([1, 2]), text=st.sampled_from(ASKED), gather=st.booleans())
def test_it_is_what_the_parser_finds(buffer, em, text, gather):
    codec = MCode(em=em)
    request = codec.request("", text)
    request = replace(request, gather=gather, expect=request.expect if gather else request.expect or ".*")
    found = short_reply(request, buffer)
    assert found is None or found == ReplyParser(request, em, 0, text.encode(), buffer).whole()


@given(buffer=BUFFERS, em=st.sampled_from([1, 2]), text=st.sampled_from(ASKED), gather=st.booleans())
def test_among_strays_only_the_parser_finds_no_reply(buffer, em, text, gather):
    request = replace(MCode(em=em).request("", text), gather=gather)
    if only_strays(request, buffer):
        assert ReplyParser(request, em, 0, text.encode(), buffer).whole() is None


@given(
    buffer=BUFFERS,
    em=st.sampled_from([0, 1, 2, 3]),
    checksum=st.sampled_from([0, 1, 2]),
    text=st.sampled_from([*ASKED, "PG 100", "PR P;"]),
    head=st.sampled_from([b"", b"MR 5", b"PR P", b"PG 100"]),
)
def test_without_an_end_the_parser_finds_no_reply(buffer, em, checksum, text, head):
    request = MCode(em=em, checksum=checksum).request("", text)
    if without_end(request, head + buffer, em, checksum):
        assert ReplyParser(request, em, checksum, text.encode(), head + buffer).whole() is None


def test_a_flood_of_prints_is_known_to_hold_no_reply():
    request = MCode(em=1).request("", "PR P")
    flood = b"".join(b"tick %d\r\n" % n for n in range(100))
    assert only_strays(request, flood + b"51200")
    assert not only_strays(request, flood + b"51200\r\n")
    assert not only_strays(request, flood + b"tick\r51200\r\n"), "a lost line feed"


@pytest.mark.parametrize("buffer", [b"\r\n51200\r\n", b"51200\r\n"])
def test_a_plain_print_is_read_at_once(buffer):
    request = MCode(em=1).request("", "PR P")
    assert request.kind is Kind.PRINT
    found = short_reply(request, buffer)
    assert found is not None and found.reply.lines == ("51200",) and found.used == len(buffer)


@pytest.mark.parametrize("buffer", [b"", b"\r\n", b"51200", b"51200\r", b"\r\n\r\n5\r\n", b"5\r\n6\r\n", b"ten\r\n"])
def test_anything_else_is_left_to_the_parser(buffer):
    assert short_reply(MCode(em=1).request("", "PR P"), buffer) is None


@pytest.mark.parametrize("em", [1, 3])
def test_with_an_ack_to_come_no_number_of_prints_before_it_is_the_reply(em):
    codec, request = asked(em, 1, 1, "PR P")
    prints = 4 * (S[b"12"] + b"\r\n")
    assert codec.decode(request, prints) is None
    repeated = S[b"aPR P"] if em == 3 else b""
    found = codec.decode(request, prints + repeated + A + S[b"0"] + b"\r\n")
    assert found is not None
    assert (found.reply.lines, found.reply.end) == (("0",), End.DONE)


@pytest.mark.parametrize("em", [1, 3])
def test_with_an_ack_to_come_blank_lines_before_it_are_no_empty_reply_whatever_is_printed_after_them(em):
    codec, request = asked(em, 0, 1, 'PR ""')
    prints = 4 * (S[b"12"] + b"\r\n")
    for count in range(3):
        assert codec.decode(request, count * b"\r\n" + prints) is None, count
