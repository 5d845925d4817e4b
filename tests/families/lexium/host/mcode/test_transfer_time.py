"""The time that transfers take on the wire, in virtual time: without a fixed wait between their lines."""

import pytest

from multidrop.dialects import Kind, Request
from multidrop.dialects.program_files import Held
from multidrop.families.lexium.host.mcode import codec as codecs
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.quiet import EXECUTED, EXECUTING, LIST_QUIET, PATIENT, SHORT, WITHIN_REPLY
from multidrop.families.lexium.manual import program_file
from tests.support.mcode_drives import one_drive

PROGRAM = "VA Q1=3\n" + "VM=400000\n" * 9 + "PG 1\nLB G1\nR1=R1+12\nMR 51200\nH\n" + "R1=R1+12\n" * 46 + "E\nPG\n"


def took(desk, procedure, state):
    begin = desk.now
    result = desk.run(procedure, state)
    return desk.now - begin, result


def transfers(bench, em, party, check, baud):
    """Seconds of a download and of an upload, and the file that the upload made."""
    desk, state = one_drive(bench, em, party, check, "LMDCM", baud)
    lines = program_file.read(PROGRAM, "x.mxt")
    down, _ = took(desk, MCodeFamily(state).programs.download(lines, Held(), lambda done, total: None), state)
    up, made = took(desk, MCodeFamily(state).programs.upload(True), state)
    return down, up, made


@pytest.mark.parametrize(
    ("em", "party", "check", "baud"),
    [(1, False, 0, 9600), (1, True, 1, 115200), (2, False, 0, 115200), (2, True, 2, 9600), (3, True, 0, 115200)],
)
def test_transfers_in_any_echo_mode_take_little_longer_than_with_all_echoed(bench, em, party, check, baud):
    down, up, made = transfers(bench, em, party, check, baud)
    bare_down, bare_up, expected = transfers(bench, 0, party, check, baud)
    assert made == expected
    assert down <= 1.35 * bare_down
    assert up <= 1.45 * bare_up


@pytest.mark.parametrize("em", [1, 2, 3])
def test_a_program_that_the_file_starts_saves_the_echo_mode_that_was_there(bench, em):
    desk, state = one_drive(bench, em, True, 1, "LMDCM", 0)
    text = "VM=400000\nPG 1\nLB G1\nS\nE\nPG\nVM=300000\nEX G1\n"
    desk.run(
        MCodeFamily(state).programs.download(program_file.read(text, "x.mxt"), None, lambda done, total: None), state
    )
    desk.wait(2.0)
    device = desk.devices["a"]
    assert (state.restore, state.codec.em, device.memory.echo_mode) == (None, em, em)
    device.reset(device.now)
    assert (device.memory.echo_mode, device.program.lines != {}) == (em, True)


@pytest.mark.parametrize(
    ("em", "check", "text", "buffer", "seconds"),
    [
        (1, 0, "EM=0", b"", PATIENT),
        (1, 0, "EM=0", b"\r\n", EXECUTED),
        (1, 0, "EM=0", b"\r\n>", 0.0),
        (0, 0, "EM=1", b"EM=1", PATIENT),
        (0, 0, "EM=1", b"EM=1\r\n>", 0.0),
        (0, 0, "EM=1", b"EM=1\r\n?", SHORT),
        (1, 1, "EM=0", b"\x06", EXECUTED),
        (1, 1, "EM=0", b"\r\n", PATIENT),
        (1, 1, "EM=0", b"\x15", PATIENT),
        (2, 0, "EM=0", b"", EXECUTING),
        (2, 0, "EM=0", b"7", PATIENT),
        (1, 0, "PY=1", b"\r\n", PATIENT),
        (1, 0, "PR UV", b"\r\n", LIST_QUIET),
        (1, 0, "PR UV", b"\r\n\r\n", EXECUTED),
        (1, 0, "PR UV", b"\r\nQ1 = G 3\r\n", LIST_QUIET),
        (1, 0, "PR UV", b"\r\nQ1 = G 3\r\n\r\n", EXECUTED),
        (2, 0, "PR UV", b"\r\n", EXECUTED),
        (1, 1, "PR UV", b"\x06\x80\r\n", EXECUTED),
        (1, 1, "PR UV", b"\x06Q1 = G 3\xe7\r\n", LIST_QUIET),
        (1, 1, "PR UV", b"\x06Q1 = G 3\xe7\r\n\x80\r\n", EXECUTED),
        (1, 0, "L", b"\r\n1  LB G1\r\n", LIST_QUIET),
        (1, 0, "L", b"\r\n1  LB G1\r\n6  E\r\n", SHORT),
        (1, 1, "L", b"\x061  LB G1\xdf\r\n6  E\xc5\r\n", SHORT),
        (1, 0, "L", b"\r\n1  LB G1\r\n6  E\r\n8", LIST_QUIET),
    ],
)
def test_the_quiet_time_by_what_has_come(em, check, text, buffer, seconds):
    codec = MCode(em, False, check, 1)
    assert codec.quiet_time(codec.request("", text), buffer) == seconds


@pytest.mark.parametrize(
    ("buffer", "seconds"),
    [(b"\x06", WITHIN_REPLY), (b"\x0642", WITHIN_REPLY), (b"\x0642\r", WITHIN_REPLY), (b"\x0642\r\n", SHORT)],
)
def test_a_print_of_unknown_modes_waits_for_its_line_end_as_long_as_a_slow_gateway_takes(buffer, seconds):
    request = Request("", "PR Q1", Kind.QUIET, MCode(), expect="42")
    assert MCode().quiet_time(request, buffer) == seconds


def test_a_list_is_parsed_once_however_its_bytes_come(monkeypatch):
    parsed = []

    class Counted(codecs.ReplyParser):
        def __init__(self, *arguments):
            parsed.append(len(arguments[-1]))
            super().__init__(*arguments)

    monkeypatch.setattr(codecs, "ReplyParser", Counted)
    listed = b"".join(b"%d  R1=R1+12\r\n" % (7 * n + 1) for n in range(80))
    for em, reply in ((0, b"L\r\n" + listed + b">"), (1, b"\r\n" + listed), (2, listed), (3, b"L\r\n" + listed)):
        parsed.clear()
        codec = MCode(em)
        request = codec.request("", "L")
        assert request.kind is Kind.LIST
        found = next((done for at in range(1, len(reply) + 1) if (done := codec.decode(request, reply[:at]))), None)
        found = found or codec.on_quiet(request, reply)
        assert (len(found.reply.lines), parsed) == (80, [len(reply)])


def test_an_empty_line_of_a_program_does_not_cut_a_list_short(bench):
    desk, state = one_drive(bench, 1, False, 0, "LMDCM", 9600)
    desk.run(
        MCodeFamily(state).programs.download(program_file.read(PROGRAM, "x.mxt"), None, lambda done, total: None), state
    )
    printed = []

    def prints(desk):
        if not printed and desk.written[-1] == b"PR UV\r" and desk.line.inbox.buffer.endswith(b"G1 = 1\r\n"):
            printed.append(desk.now)
            desk.line.receive(b"\r\n\r\n", desk.now)

    listed = desk.run(MCodeFamily(state).perform("PR UV"), state, at=prints)
    assert printed and [line for line in listed if "=" in line] == ["G1 = 1", "Q1 = G 3"]
