"""The drive's side of the wire, in bytes: tables 7.1 to 7.4 of the MCode manual, and what stands around them."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.simulator.ports.mcode import MCodePort
from multidrop.families.lexium.simulator.ports.replies import checksum
from multidrop.simulator.wire import Transmission
from tests.support.cases import for_each


@dataclass(frozen=True)
class Said:
    lines: tuple[str, ...] = ()
    tail: str = ""
    refused: bool = False


class Drive:
    """A drive that knows `PR x`, settings, `BAD` (refused), `PG`, and a program that is run by the test."""

    def __init__(self, **settings: object) -> None:
        self.powered = True
        self.boots = 0
        self.thread = self.bridges = self.power_unit = self.memory = self.model = self.core = self.printer = self
        self.name, self.party, self.checksum, self.echo_mode = "a", False, 0, 0
        self.escape_mode, self.reset_mode, self.quiet_global, self.queued = 1, 1, True, False
        self.error_flag = self.running = self.stepping = self.flags_by_nak = False
        self.wakes_by_line = self.echoes_before_value = False
        self.programming: int | None = None
        self.did: list[str] = []
        self.said: list[tuple[float, str]] = []
        self.ends_at: float | None = None
        for name, value in settings.items():
            assert hasattr(self, name)
            setattr(self, name, value)

    def enter(self, now: float) -> None:
        pass

    @property
    def values(self) -> dict[str, int]:
        words = {
            "EM": "echo_mode",
            "PY": "party",
            "CK": "checksum",
            "QD": "queued",
            "DG": "quiet_global",
            "CE": "reset_mode",
        }
        return {word: int(getattr(self, name)) for word, name in words.items()}

    @property
    def texts(self) -> dict[str, str]:
        return {"DN": self.name}

    @property
    def printed(self) -> list[tuple[float, str]]:
        return self.said

    @property
    def deadline(self) -> float | None:
        return self.ends_at

    def quiet(self, now: float, running: bool) -> bool:
        return self.running == running and not self.said and (self.ends_at is None or self.ends_at > now)

    def proceed(self, now: float) -> float | None:
        ended = self.ends_at
        if ended is None or now < ended:
            return None
        self.said.append((ended, "bye\r\n"))
        self.ends_at, self.running = None, False
        return ended

    def execute(self, text: str, now: float) -> Said:
        self.did.append(text)
        word, _, rest = text.replace("=", " ").partition(" ")
        settings = {"EM": "echo_mode", "CK": "checksum", "PY": "party"}
        if word == "PR":
            return Said(tuple(rest.split(",")) if not rest.endswith(";") else (), rest[:-1] if ";" in rest else "")
        if word == "BAD":
            self.error_flag = True
            return Said(refused=True)
        if word == "PG":
            self.programming = int(rest) if rest else None
        elif self.programming is not None:
            self.programming += 2
        elif word in settings:
            setattr(self, settings[word], int(rest))
        elif word == "DN":
            self.name = rest.strip('"')
        return Said()

    def take(self) -> list[tuple[float, str]]:
        said, self.said = self.said, []
        return said

    def fail(self, code: int, now: float) -> None:
        self.did.append(f"error {code}")
        self.error_flag = True

    def escape(self, now: float) -> None:
        self.did.append("escape")
        self.running = False

    def reset(self, now: float) -> None:
        self.did.append("reset")
        self.boots += 1
        self.said.append((now, "Copyright\xa9\r\n"))

    def step(self, key: str, now: float) -> None:
        self.did.append(f"step {key!r}")


def sealed(text: bytes) -> bytes:
    return text + bytes([checksum(text)])


def line(drive: Drive, text: bytes) -> bytes:
    """A whole line for this drive, as its settings want it."""
    body = drive.name.encode() + text if drive.party else text
    return (sealed(body) if drive.checksum else body) + (b"\n" if drive.party else b"\r")


def active(drive: Drive) -> MCodePort:
    """A port whose party mode, if any, has seen its first LF."""
    port = MCodePort(drive)
    if drive.party:
        port.receive(b"\n", 0.0)
        assert port.advance(0.0) == b""
    return port


def ask(port: MCodePort, data: bytes, now: float = 1.0) -> bytes:
    port.receive(data, now)
    return port.advance(now)


ZERO, ACK, NAK = sealed(b"0"), b"\x06", b"\x15"
COMBINATIONS = [(em, py, ck) for em in range(4) for py in (0, 1) for ck in range(3)]


def expected(em: int, py: int, ck: int, text: bytes, data: bytes, good: bool = True) -> bytes:
    """The rows of tables 7.1 to 7.4 with the rulings on them, written out a second time and differently."""
    name = b"a" if py else b""
    seal = sealed(name + text)[-1:] if ck else b""
    taken = (ACK if good else NAK) if ck else b"\r\n"
    body = (sealed(data) if ck else data) + b"\r\n" if data else b""
    return {
        0: name + text + seal + taken + body + (b">" if good else b"?"),
        1: taken + body,
        2: body,
        3: text + seal + taken + body,
    }[em]


@for_each("em,py,ck", COMBINATIONS)
@pytest.mark.parametrize("text,data,good", [(b"MR 51200", b"", True), (b"PR 0", b"0", True), (b"BAD", b"", False)])
def test_every_combination_answers_as_the_tables_say(
    em: int, py: int, ck: int, text: bytes, data: bytes, good: bool
) -> None:
    drive = Drive(echo_mode=em, party=bool(py), checksum=ck)
    port = active(drive)
    assert ask(port, line(drive, text)) == expected(em, py, ck, text, data, good)
    assert drive.did == [text.decode()]


@for_each("em,py,ck", COMBINATIONS)
def test_bytes_one_by_one_give_the_same_as_all_at_once(em: int, py: int, ck: int) -> None:
    drive = Drive(echo_mode=em, party=bool(py), checksum=ck)
    port = active(drive)
    heard = [ask(port, bytes([byte]), 1.0 + n) for n, byte in enumerate(line(drive, b"PR 0"))]
    assert b"".join(heard) == expected(em, py, ck, b"PR 0", b"0")
    typed = len(line(drive, b"PR 0")) - 1
    assert [len(each) for each in heard[:typed]] == [1 if em == 0 else 0] * typed


def test_known_checksums() -> None:
    assert (checksum(b"MR 1"), checksum(b"MR 51200"), checksum(b"CK=0"), checksum(b"*FD")) == (
        0x90,
        0xC9,
        0x85,
        0xCC,
    )


def test_a_sum_of_zero_has_the_checksum_0x80_and_is_not_optional() -> None:
    text = b"PR A"
    text += bytes([128 - sum(text) % 128])
    drive = Drive(echo_mode=1, checksum=1)
    port = MCodePort(drive)
    assert sum(text) % 128 == 0 and checksum(text) == 0x80
    assert ask(port, text + b"\r") == NAK
    assert ask(port, text + b"\x80\r")[:1] == ACK


@pytest.mark.parametrize("em,answer", [(0, b"a" + b"MR 1\x91\x15>"), (1, NAK), (2, b""), (3, b"MR 1\x91\x15")])
def test_a_wrong_checksum_is_a_nak_and_nothing_is_executed(em: int, answer: bytes) -> None:
    drive = Drive(echo_mode=em, party=True, checksum=2)
    port = active(drive)
    assert ask(port, b"aMR 1\x91\n") == answer
    assert drive.did == []


def test_without_its_name_in_the_sum_a_party_line_is_damaged() -> None:
    drive = Drive(echo_mode=1, party=True, checksum=1)
    port = active(drive)
    assert ask(port, b"aMR 1\x90\n") == NAK
    assert ask(port, b"\r\n") == b""


@pytest.mark.parametrize("ck,command,printed", [(1, ACK, ACK + ZERO + b"\r\n"), (2, b"", ZERO + b"\r\n")])
def test_ck_2_sends_no_ack_while_a_program_runs(ck: int, command: bytes, printed: bytes) -> None:
    drive = Drive(echo_mode=1, checksum=ck, running=True)
    port = MCodePort(drive)
    assert ask(port, sealed(b"MR 1") + b"\r") == command
    assert ask(port, sealed(b"PR 0") + b"\r") == printed
    assert ask(port, sealed(b"BAD") + b"\r") == NAK
    assert ask(port, b"MR 1\r") == NAK


def test_em_1_leaves_out_the_crlf_before_a_print_while_a_program_runs() -> None:
    port = MCodePort(Drive(echo_mode=1, running=True))
    assert ask(port, b"PR 0\r") == b"0\r\n"
    assert ask(port, b"MR 1\r") == b"\r\n"


def test_prints_of_several_lines_each_carry_a_checksum() -> None:
    port = MCodePort(Drive(echo_mode=1, checksum=1))
    assert ask(port, sealed(b"PR 1,22") + b"\r") == ACK + sealed(b"1") + b"\r\n" + sealed(b"22") + b"\r\n"


def test_a_print_without_a_line_end_has_none() -> None:
    assert ask(MCodePort(Drive(echo_mode=0)), b"PR x;\r") == b"PR x;\r\nx>"


@pytest.mark.parametrize("em,answer", [(0, b"a\r\n>"), (1, b"\r\n"), (2, b""), (3, b"\r\n")])
def test_the_name_alone_is_a_ping(em: int, answer: bytes) -> None:
    drive = Drive(echo_mode=em, party=True)
    assert ask(active(drive), b"a\n") == answer
    assert drive.did == []


def test_a_ping_in_checksum_mode_needs_its_checksum() -> None:
    port = active(Drive(echo_mode=1, party=True, checksum=1))
    assert ask(port, sealed(b"a") + b"\n") == ACK
    assert ask(port, b"a\n") == NAK


def test_other_names_are_not_ours_and_case_counts() -> None:
    drive = Drive(party=True)
    port = active(drive)
    assert ask(port, b"bMR 1\nAMR 1\n\r\n ^MR 1\n") == b""
    assert drive.did == []
    assert ask(port, b"aMR 1\r\n") == b"aMR 1\r\n>"


def test_global_commands_are_obeyed_in_silence_unless_dg_is_0() -> None:
    drive = Drive(party=True)
    port = active(drive)
    assert ask(port, b"*PR 1\n") == b""
    drive.quiet_global = False
    assert ask(port, b"*PR 1\n") == b"*PR 1\r\n1\r\n>"
    assert drive.did == ["PR 1", "PR 1"]


def test_queued_drives_answer_to_the_caret_likewise() -> None:
    drive = Drive(party=True, queued=True, checksum=1)
    port = active(drive)
    assert ask(port, sealed(b"^MA 0") + b"\n" + b"^MA 0\n") == b""
    assert drive.did == ["MA 0"]


def test_party_mode_is_deaf_until_one_lf_after_it_was_set() -> None:
    drive = Drive()
    port = MCodePort(drive)
    assert ask(port, b"PY=1\r") == b"PY=1\r\n>"
    assert ask(port, b"aMR 1\n") == b""
    assert ask(port, b"aMR 2\n") == b"aMR 2\r\n>"
    assert ask(port, b"aPY=0\n") == b"aPY=0\r\n>"
    assert ask(port, b"MR 3\r\n") == b"MR 3\r\n>\n"
    assert drive.did == ["PY=1", "MR 2", "PY=0", "MR 3"]


def test_party_mode_is_deaf_until_one_lf_after_power_up_and_reset() -> None:
    drive = Drive(party=True, echo_mode=1)
    port = MCodePort(drive)
    assert ask(port, b"aMR 1\naMR 2\n") == b"\r\n"
    assert ask(port, b"\x03") == b"Copyright\xa9\r\n"
    assert ask(port, b"aMR 3\naMR 4\n") == b"\r\n"
    drive.reset(0.0)  # by a hand, an input or a line
    assert ask(port, b"aMR 5\naMR 6\n") == b"Copyright\xa9\r\n\r\n"
    assert drive.did == ["MR 2", "reset", "MR 4", "reset", "MR 6"]


@pytest.mark.parametrize(
    ("em", "answer"), [(0, b"aPR 5\r\n5\r\n>"), (1, b"\r\n5\r\n"), (2, b"5\r\n"), (3, b"PR 5\r\n5\r\n")]
)
@pytest.mark.parametrize("ck", [0, 1])
def test_where_the_first_line_wakes_party_mode_it_is_carried_out(em: int, answer: bytes, ck: int) -> None:
    sent = sealed(b"aPR 5") if ck else b"aPR 5"
    if ck:
        head = {0: sent + ACK, 1: ACK, 2: b"", 3: sent[1:] + ACK}[em]
        answer = head + sealed(b"5") + b"\r\n" + b">" * (em == 0)
    for reset in (b"", b"\x03"):
        for grouped in (True, False):
            port = MCodePort(Drive(party=True, echo_mode=em, checksum=ck, wakes_by_line=True))
            assert not reset or ask(port, reset).startswith(b"Copyright")
            pieces = [sent + b"\n"] if grouped else [bytes([each]) for each in sent + b"\n"]
            assert b"".join(ask(port, each) for each in pieces) == answer, (reset, grouped)


def test_where_the_first_line_wakes_party_mode_it_may_be_several_commands_and_another_drives() -> None:
    drive = Drive(wakes_by_line=True)
    port = MCodePort(drive)
    assert ask(port, b"PY=1\raMR 1\raMR 2\n") == b"PY=1\r\n>aMR 1aMR 2\r\n>\r\n>"
    assert drive.did == ["PY=1", "MR 1", "MR 2"]
    other = Drive(party=True, echo_mode=1, wakes_by_line=True)
    port = MCodePort(other)
    assert ask(port, b"bMR 1\nMR 2\n*MR 3\naMR 4\n") == b"\r\n"
    assert other.did == ["MR 3", "MR 4"]


def test_a_setting_changes_the_answers_from_the_next_line_on() -> None:
    port = MCodePort(Drive())
    assert ask(port, b"EM=1\r") == b"EM=1\r\n>"
    assert ask(port, b"PR 0\r") == b"\r\n0\r\n"


@pytest.mark.parametrize("body", [b"CK=1", sealed(b"CK=1")], ids=["plain", "with its check byte"])
@pytest.mark.parametrize("em", range(4))
def test_a_line_that_changes_ck_is_answered_as_the_new_ck_wants_it(em: int, body: bytes) -> None:
    port = MCodePort(Drive(echo_mode=em))
    echo, prompt = body * (em in (0, 3)), b">" * (em == 0)
    assert ask(port, body + b"\r") == echo + ACK * (em != 2) + prompt
    echo = sealed(b"CK=0") * (em in (0, 3))
    assert ask(port, sealed(b"CK=0") + b"\r") == echo + b"\r\n" * (em != 2) + prompt


@pytest.mark.parametrize("em", range(4))
@pytest.mark.parametrize("check", [b"\x80", b"\x90", b"\xff"])
def test_without_checksum_one_byte_of_0x80_and_above_is_taken_for_a_check_byte(em: int, check: bytes) -> None:
    drive = Drive(echo_mode=em)
    answers = {0: b"MR 1" + check + b"\r\n>", 1: b"\r\n", 2: b"", 3: b"MR 1" + check + b"\r\n"}
    port, data = MCodePort(drive), b"MR 1" + check + b"\r"
    assert ask(port, data) == answers[em]
    assert b"".join(ask(port, bytes([byte])) for byte in data) == answers[em]
    ask(port, b"MR 1\x90\x90\r")  # one, not two
    assert drive.did == ["MR 1", "MR 1", "MR 1\x90"]


@pytest.mark.parametrize("check", [0, 1, 2])
@pytest.mark.parametrize("end", [b"", b"\r"])
@pytest.mark.parametrize("grouped", [True, False])
def test_a_check_byte_behind_a_key_belongs_to_it(check: int, end: bytes, grouped: bool) -> None:
    drive = Drive(echo_mode=1, checksum=check)
    port, data = MCodePort(drive), sealed(b"\x1b") + end
    heard = ask(port, data) if grouped else b"".join(ask(port, bytes([byte])) for byte in data)
    assert (heard, drive.did) == (b"\r\n", ["escape"])
    assert ask(port, line(drive, b"MR 1")) == (ACK if check else b"\r\n")


def test_a_unit_that_flags_by_nak_carries_out_and_prints_what_it_says_nak_to() -> None:
    for em, head in ((0, sealed(b"PR 23") + NAK), (1, NAK), (2, b""), (3, sealed(b"PR 23") + NAK)):
        drive = Drive(echo_mode=em, checksum=1, error_flag=True, flags_by_nak=True)
        prompt = b"?" * (em == 0)
        assert ask(MCodePort(drive), sealed(b"PR 23") + b"\r") == head + b"23\x9b\r\n" + prompt
        ask(MCodePort(drive), sealed(b"MR 1") + b"\r")
        assert drive.did == ["PR 23", "MR 1"]
    drive = Drive(echo_mode=1, checksum=1, error_flag=True)
    assert ask(MCodePort(drive), sealed(b"MR 1") + b"\r") == ACK


@pytest.mark.parametrize("em,answer", [(0, b"MR 5#\r\n>"), (1, b"\r\n"), (2, b""), (3, b"\r\n")])
def test_escape_in_the_middle_of_a_line_drops_the_line(em: int, answer: bytes) -> None:
    drive = Drive(echo_mode=em)
    port = MCodePort(drive)
    assert ask(port, b"MR 5\x1b") == answer
    port.receive(b"MR 6\r", 2.0)
    assert drive.did == ["escape", "MR 6"]


def test_escape_shows_the_error_flag() -> None:
    assert ask(MCodePort(Drive(error_flag=True)), b"\x1b") == b"#\r\n?"


@pytest.mark.parametrize(
    "es,party,keys,escapes",
    [
        (0, False, b"\x1b\x05", 1),
        (1, True, b"\x05\x1b", 1),
        (2, True, b"\x05\x1bb\x05a\x1b", 0),
        (2, True, b"a\x05", 1),
        (3, True, b"\x1ba\x05bxa\x1b", 1),
    ],
)
def test_escape_modes(es: int, party: bool, keys: bytes, escapes: int) -> None:
    drive = Drive(escape_mode=es, party=party, echo_mode=1)
    port = active(drive)
    assert ask(port, keys) == b"\r\n" * escapes
    assert drive.did == ["escape"] * escapes


@pytest.mark.parametrize(
    "ce,party,keys,resets",
    [
        (0, False, b"\x03", 0),
        (1, True, b"\x03", 1),
        (2, False, b"\x03", 1),
        (2, True, b"\x03b\x03", 0),
        (2, True, b"a\x03", 1),
    ],
)
def test_reset_modes(ce: int, party: bool, keys: bytes, resets: int) -> None:
    drive = Drive(reset_mode=ce, party=party, echo_mode=1)
    assert ask(active(drive), keys) == b"Copyright\xa9\r\n" * resets


@pytest.mark.parametrize("em,answer", [(0, b"~" * 64 + b"\r\n?"), (1, b"\r\n"), (2, b""), (3, b"~" * 64 + b"\r\n")])
def test_the_65th_character_is_refused_and_the_rest_of_the_line_dropped(em: int, answer: bytes) -> None:
    drive = Drive(echo_mode=em)
    port = MCodePort(drive)
    assert ask(port, b"~" * 65) == answer
    assert ask(port, b"MR 1\r") == b""
    port.receive(b"MR 2\r", 2.0)
    assert drive.did == ["error 20", "MR 2"]


def test_64_characters_fit() -> None:
    drive = Drive(echo_mode=1)
    assert ask(MCodePort(drive), b"x" * 64 + b"\r") == b"\r\n"
    assert drive.did == ["x" * 64]


def test_with_checksum_a_line_that_is_too_long_is_a_nak() -> None:
    drive = Drive(echo_mode=1, party=True, checksum=1)
    port = active(drive)
    assert ask(port, sealed(b"a" + b"x" * 63) + b"\n") == NAK
    assert drive.did == ["error 20"]


def test_program_mode_prompts_with_the_next_address() -> None:
    port = MCodePort(Drive())
    assert ask(port, b"PG 100\r") == b"PG 100\r\n100  "
    assert ask(port, b"LB Aa\r") == b"LB Aa\r\n102  "
    assert ask(port, b"BAD\r") == b"BAD\r\n?"
    assert ask(port, b"\r") == b"\r\n102  "
    assert ask(port, b"PG\r") == b"PG\r\n?"


@pytest.mark.parametrize("em,said", [(0, [b"bye\r\n", b"\r\n>"]), (1, [b"bye\r\n"])])
def test_a_program_that_ends_says_so_in_em_0_only_and_at_its_time(em: int, said: list[bytes]) -> None:
    port = MCodePort(Drive(echo_mode=em, running=True, ends_at=2.5))
    assert port.advance(2.0) == b""
    assert port.sent(3.0) == [Transmission(2.5, part) for part in said]
    assert port.advance(3.0) == b""


def test_prints_of_a_program_carry_checksums_across_their_pieces() -> None:
    drive = Drive(echo_mode=1, checksum=1)
    port = MCodePort(drive)
    drive.said = [(0.5, "V="), (0.6, "7\r\nnext\r\n")]
    seal = sealed(b"V=7")[-1:]
    ended = b"7" + seal + b"\r\n" + sealed(b"next") + b"\r\n"
    assert port.sent(1.0) == [Transmission(0.5, b"V="), Transmission(0.6, ended)]


def test_stepping_keys_go_to_the_program_and_lines_stay_lines() -> None:
    drive = Drive(stepping=True)
    port = MCodePort(drive)
    assert ask(port, b" \rPR 1\r") == b"PR 1\r\n1\r\n>"
    assert drive.did == ["step ' '", "step '\\r'", "PR 1"]


def test_a_drive_without_power_is_silent_and_forgets_its_line() -> None:
    drive = Drive()
    port = MCodePort(drive)
    assert ask(port, b"MR 1") == b"MR 1"
    drive.powered = False
    assert ask(port, b"2\r\x1b\x03") == b""
    drive.powered = True
    assert ask(port, b"\r") == b"\r\n>"
    assert drive.did == []


def test_an_ethernet_port_knows_no_party_mode_and_no_checksum() -> None:
    drive = Drive(party=True, checksum=1, echo_mode=1)
    port = MCodePort(drive, serial=False)
    assert ask(port, b"PR 0\r") == b"\r\n0\r\n"


@given(st.binary(max_size=200), st.integers(0, 3), st.booleans(), st.integers(0, 2))
def test_garbage_in_pieces_is_heard_like_garbage_at_once(data: bytes, em: int, party: bool, ck: int) -> None:
    whole, pieces = (Drive(echo_mode=em, party=party, checksum=ck) for _ in range(2))
    one, other = MCodePort(whole), MCodePort(pieces)
    at_once = ask(one, data)
    one_by_one = b"".join(ask(other, bytes([byte])) for byte in data)
    assert at_once == one_by_one
    assert whole.did == pieces.did


# Keys of a terminal within a line


@for_each("em,py,ck", COMBINATIONS)
@pytest.mark.parametrize("key", [b"\x08", b"\x7f"])
def test_backspace_and_delete_take_back_the_character_before_them(em: int, py: int, ck: int, key: bytes) -> None:
    """`PX`, the key, `R 9`, the key, `0`: the line is `PR 0`, and the echo has every byte as it came."""
    drive = Drive(echo_mode=em, party=bool(py), checksum=ck)
    port = active(drive)
    whole = line(drive, b"PR 0")
    name, end = (b"a" if py else b""), whole[-2:] if ck else whole[-1:]
    heard = ask(port, name + b"PX" + key + b"R 9" + key + b"0" + end)
    typed = name + b"PX" + key + b"R 9" + key + b"0" + (end[:1] if ck else b"")
    plain = expected(em, py, ck, b"PR 0", b"0")
    seal = end[:1] if ck else b""
    assert heard == (plain.replace(name + b"PR 0" + seal, typed, 1) if em == 0 else plain)
    assert drive.did == ["PR 0"]


def test_a_client_may_begin_every_line_with_a_backspace() -> None:
    drive = Drive(echo_mode=0)
    port = MCodePort(drive)
    for _ in range(2):
        assert ask(port, b"\x08PR 0\r\n") == b"\x08PR 0\r\n0\r\n>\n"
    party = Drive(party=True)
    assert ask(active(party), b"\x08aPR 0\n") == b"aPR 0\r\n0\r\n>"
    assert drive.did == ["PR 0"] * 2 and party.did == ["PR 0"]


def test_keys_take_back_no_more_than_the_command_and_never_the_name() -> None:
    drive = Drive(echo_mode=1, party=True)
    port = active(drive)
    assert ask(port, b"aMR 5\x08\x08\x08\x08\x08\x08\x08PR 0\n") == b"\r\n0\r\n"
    assert ask(port, b"b\x08aPR 0\n") == b""  # the line of b has begun, and stays its line
    assert drive.did == ["PR 0"]


def test_what_was_taken_back_needs_no_room_in_the_line() -> None:
    drive = Drive(echo_mode=1)
    port = MCodePort(drive)
    assert ask(port, b"x" * 64 + b"\x08" * 64 + b"PR 0\r") == b"\r\n0\r\n"
    assert ask(port, b"x" * 65 + b"\x08" * 65 + b"PR 0\r")[:2] == b"\r\n" and drive.did[1:] == ["error 20"]


@given(st.lists(st.sampled_from([b"PR ", b"0", b"9", b"\x08", b"\x7f"]), max_size=30), st.integers(1, 7))
def test_keys_act_alike_however_the_bytes_are_grouped(typed: list[bytes], size: int) -> None:
    data = b"".join(typed) + b"\r"
    kept = bytearray()
    for byte in data[:-1]:
        if byte in b"\x08\x7f":
            del kept[-1:]
        elif len(kept) < 64:
            kept.append(byte)
    one, other = Drive(echo_mode=0), Drive(echo_mode=0)
    port = MCodePort(other)
    heard = b"".join(ask(port, data[n : n + size]) for n in range(0, len(data), size))
    assert heard == ask(MCodePort(one), data)
    assert one.did == other.did
    if len(data) <= 64:
        assert one.did == ([kept.decode()] if kept.strip() else [])


# A LF behind the CR, on an MDrivePlus


def test_an_mdrive_gives_the_line_feed_back_before_the_value_and_a_lexium_after_the_prompt() -> None:
    for before, text, heard in (
        (True, b"PR 0", b"PR 0\r\n\n0\r\n>"),
        (True, b"MR 1", b"MR 1\r\n\n>"),
        (True, b"BAD", b"BAD\r\n\n?"),
        (False, b"PR 0", b"PR 0\r\n0\r\n>\n"),
        (False, b"MR 1", b"MR 1\r\n>\n"),
    ):
        port = MCodePort(Drive(echo_mode=0, echoes_before_value=before))
        assert ask(port, text + b"\r\n") == heard
        assert ask(port, text + b"\r") == heard.replace(b"\n\n", b"\n").removesuffix(b"\n")


@for_each("em,py,ck", [each for each in COMBINATIONS if each != (0, 0, 0)])
def test_no_other_mode_of_an_mdrive_knows_that(em: int, py: int, ck: int) -> None:
    one, other = (
        Drive(echo_mode=em, party=bool(py), checksum=ck, echoes_before_value=before) for before in (True, False)
    )
    for drive in (one, other):
        assert ask(active(drive), line(drive, b"PR 0")) == expected(em, py, ck, b"PR 0", b"0")


def test_on_a_paced_wire_the_line_feed_comes_a_byte_later_and_a_late_one_after_the_prompt() -> None:
    byte = 10 / 9600
    for gap, heard in ((1.0, b"\r\n\n0\r\n>"), (2.5, b"\r\n0\r\n>\n")):
        port = MCodePort(Drive(echo_mode=0, echoes_before_value=True), baud=9600)
        out = b""
        for n, each in enumerate(b"PR 0\r"):
            out += ask(port, bytes([each]), 1.0 + n * byte)
        at = 1.0 + 4 * byte
        assert out == b"PR 0\r\n" and port.deadline == pytest.approx(at + 2 * byte)
        out = port.advance(at + 2 * byte) if gap > 2 else b""
        out += ask(port, b"\n", at + gap * byte) + port.advance(at + 9.0)
        assert b"\r\n" + out == heard
        assert port.deadline is None


def test_what_comes_behind_the_line_is_echoed_after_its_reply() -> None:
    port = MCodePort(Drive(echo_mode=0, echoes_before_value=True), baud=9600)
    assert ask(port, b"PR 0\rPR 0\r\n") + port.advance(2.0) == b"PR 0\r\n0\r\n>PR 0\r\n\n0\r\n>"
