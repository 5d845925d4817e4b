"""What a reply or an unsolicited line is not taken for: doubt, the debris of a stop, leftovers, and the buffer."""

import re
from dataclasses import dataclass, replace
from typing import Any

import pytest

from multidrop.dialects import Decoded, End, Kind, Reply, Request
from multidrop.drives.echoes import LONGEST_TAIL
from multidrop.drives.inbox import (
    CERTAIN,
    DEBRIS_LASTS,
    LATE_WITHIN,
    LONGEST_WAIT_FOR_QUIET,
    MOST_EVIDENCE,
    TAIL,
    Debris,
    Doubt,
    Inbox,
    Leftovers,
    Weight,
)
from multidrop.families.lexium.host.mcode.codec import MCode

DOUBTFUL = Weight(doubtful=True)
MARK = Weight(ends_wait=True)


@dataclass(frozen=True)
class Lines(MCode):
    """A toy language: lines with CR LF; one that begins with `!` is damaged, one that begins with `=` a late reply."""

    counted: bool = False

    @property
    def numbered(self) -> bool:  # type: ignore[override]
        return self.counted

    @property
    def framed(self) -> bool:  # type: ignore[override]
        return self.counted

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        *lines, rest = buffer.split(b"\r\n")
        return tuple(each.decode("latin-1") for each in lines), len(buffer) - len(rest)

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The first whole line that is the expected one; those before it are strays."""
        lines, _ = self.parse_unsolicited(buffer)
        for at, line in enumerate(lines):
            if re.fullmatch(request.expect or "", line):
                used = sum(len(each) + 2 for each in lines[: at + 1])
                return Decoded(Reply((line,)), used, strays=lines[:at])
        return None

    def damaged(self, line: str) -> bool:
        return line.startswith("!")

    def answers(self, request: Request, line: str) -> bool:
        return line == f"={request.text}"

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        return True


def asked(address: str = "a", text: str = "PR P", kind: Kind = Kind.PRINT, **more: Any) -> Request:
    return Request(address, text, kind, Lines(), **({"expect": r"-?\d+"} | more))


def mark(address: str = "a") -> Request:
    return asked(address, kind=Kind.QUIET, expect="~1", gather=True, signed=True)


def command(address: str = "a") -> Request:
    return asked(address, "MR 1", Kind.COMMAND, expect=None)


NONE = Reply(end=End.TIMEOUT)
DONE = Reply(acknowledged=True)
VALUE = Reply(("5",), acknowledged=True)


def doubt(*late: tuple[Request, Reply, bytes]) -> Doubt:
    """What is outstanding after these requests at time 0."""
    made = Doubt()
    for request, reply, heard in late:
        made.weigh(request, reply, 0.0, heard)
    return made


# Doubt


@pytest.mark.parametrize(
    ("request_", "reply", "outstanding"),
    [
        (asked(), VALUE, False),
        (command(), DONE, False),
        (command(), NONE, True),
        (command(), Reply(end=End.DAMAGED), True),
        (command(), Reply(end=End.STOPPED), True),
        (command(), Reply(end=End.NAK), True),
        (command(), Reply(end=End.SILENT), True),
        (command(), Reply(end=End.REFUSED), False),
        (asked(kind=Kind.QUIET), Reply(("5",)), True),
        (asked(kind=Kind.QUIET), Reply(("5",), acknowledged=True), False),
        (asked(kind=Kind.QUIET), Reply(end=End.SILENT), True),
        (asked(kind=Kind.QUIET, expect=None), Reply(end=End.SILENT), False),
    ],
)
def test_a_reply_that_did_not_come_makes_the_next_mark_of_its_drive_end_the_wait(request_, reply, outstanding):
    waits = doubt((request_, reply, b""))
    assert waits.weigh(mark(), Reply(("~1",), acknowledged=True), 1.0, b"") == (
        Weight(False, True) if outstanding else CERTAIN
    )
    assert waits.weigh(mark(), Reply(("~1",), acknowledged=True), 1.0, b"") == CERTAIN


def test_a_language_that_numbers_its_replies_has_no_doubt():
    waits = doubt((asked(), NONE, b""))
    numbered = replace(asked(), codec=Lines(counted=True))
    assert waits.weigh(numbered, VALUE, 1.0, b"") == CERTAIN


@pytest.mark.parametrize(
    ("late", "request_", "reply", "weight"),
    [
        (asked("b"), asked(), VALUE, DOUBTFUL),
        (asked("b", expect="x"), asked(), VALUE, CERTAIN),
        (asked("b", expect=None), asked(), VALUE, DOUBTFUL),
        (asked("b"), asked(signed=True), VALUE, CERTAIN),
        (asked("b", expect="x"), command(), DONE, DOUBTFUL),
        (asked("b", expect="x"), asked(), Reply(("5",), End.REFUSED), DOUBTFUL),
        (asked("b", expect="x"), asked(signed=True), Reply(("5",), End.REFUSED), DOUBTFUL),
        (asked("b"), asked(), Reply(("x", "5")), DOUBTFUL),
    ],
)
def test_a_reply_is_doubtful_where_it_may_be_the_one_that_is_outstanding(late, request_, reply, weight):
    assert doubt((late, NONE, b"")).weigh(request_, reply, 1.0, b"") == weight


def test_a_late_reply_is_awaited_for_a_while():
    assert doubt((asked("b"), NONE, b"")).weigh(asked(), VALUE, LATE_WITHIN - 0.1, b"") == DOUBTFUL
    assert doubt((asked("b"), NONE, b"")).weigh(asked(), VALUE, LATE_WITHIN, b"") == CERTAIN


@pytest.mark.parametrize(
    ("end", "heard", "weight"),
    [
        (End.DAMAGED, b"12", DOUBTFUL),
        (End.STOPPED, b"12", DOUBTFUL),
        (End.STOPPED, b"12\r", CERTAIN),
        (End.STOPPED, b"12\n", CERTAIN),
        (End.STOPPED, b"", CERTAIN),
        (End.TIMEOUT, b"12", CERTAIN),
    ],
)
def test_the_rest_of_a_reply_that_had_begun_looks_like_any_other(end, heard, weight):
    waits = doubt((asked("b", expect="x"), Reply(end=end), heard))
    assert waits.weigh(asked(), VALUE, 1.0, b"") == weight


def test_a_print_that_is_certainly_its_own_ends_the_wait_for_its_drive_alone():
    waits = doubt((asked("a", expect="x"), NONE, b""), (asked("b"), NONE, b""))
    assert waits.weigh(asked("a", expect="y"), Reply(("y",)), 1.0, b"") == CERTAIN
    assert waits.weigh(asked("c"), VALUE, 1.0, b"") == DOUBTFUL
    waits = doubt((asked("a", expect="x"), NONE, b""))
    waits.weigh(asked("a", expect="y"), Reply(("y",)), 1.0, b"")
    assert waits.weigh(command("a"), DONE, 1.0, b"") == CERTAIN


def test_a_doubtful_print_ends_no_wait_and_a_mark_does():
    waits = doubt((asked(), NONE, b""))
    assert waits.weigh(asked(), VALUE, 1.0, b"") == DOUBTFUL
    assert waits.weigh(asked(), VALUE, 1.0, b"") == DOUBTFUL
    assert waits.weigh(mark(), Reply(("~1",), acknowledged=True), 1.0, b"") == MARK
    assert waits.weigh(asked(), VALUE, 1.0, b"") == CERTAIN


@pytest.mark.parametrize(
    ("reply", "ends"),
    [
        (Reply(("~1",)), False),
        (Reply(("~1",), acknowledged=True), True),
        (Reply(("~1",), flagged=True), True),
        (Reply(("~1",), End.NAK, flagged=True), True),
        (Reply(("~1",), End.SILENT, acknowledged=True), False),
    ],
)
def test_a_mark_must_be_executed_to_end_the_wait(reply, ends):
    waits = doubt((asked(expect="x"), NONE, b""))
    assert waits.weigh(mark(), reply, 1.0, b"").ends_wait is ends


def test_a_doubtful_reply_makes_the_wait_longer():
    waits = doubt((asked(), NONE, b""))
    assert waits.weigh(asked(), VALUE, 6.0, b"") == DOUBTFUL
    assert waits.weigh(asked(), VALUE, 6.0 + LATE_WITHIN - 0.1, b"") == DOUBTFUL


def test_the_mark_of_a_drive_whose_nak_may_have_been_anothers_is_doubtful():
    waits = doubt((command("b"), Reply(end=End.NAK), b""))
    assert waits.weigh(command("a"), DONE, 1.0, b"") == DOUBTFUL
    assert waits.weigh(mark("b"), Reply(("~1",), acknowledged=True), 1.0, b"") == Weight(True, True)


@pytest.mark.parametrize("end", [End.TIMEOUT, End.DAMAGED])
def test_a_reply_that_is_only_missing_was_not_taken_for_anothers(end):
    waits = doubt((command("b"), Reply(end=end), b""))
    assert waits.weigh(command("a"), DONE, 1.0, b"") == DOUBTFUL
    assert waits.weigh(mark("b"), Reply(("~1",), acknowledged=True), 1.0, b"") == MARK


def test_a_reply_with_more_than_one_sign_takes_that_of_another_drive():
    waits = doubt((command("b"), Reply(end=End.NAK), b""))
    surplus = replace(VALUE, surplus=True)
    assert waits.weigh(asked("a", signed=True), surplus, 1.0, b"") == CERTAIN
    assert waits.weigh(mark("b"), Reply(("~1",), acknowledged=True), 1.0, b"") == Weight(True, True)


def test_a_printed_value_takes_no_sign_of_another_drive():
    waits = doubt((command("b"), Reply(end=End.NAK), b""))
    assert waits.weigh(asked("a"), VALUE, 1.0, b"") == DOUBTFUL
    assert waits.weigh(mark("b"), Reply(("~1",), acknowledged=True), 1.0, b"") == MARK


def test_a_late_reply_is_removed_from_the_prints_once():
    waits = doubt((asked(text="P"), NONE, b""), (asked(text="V"), NONE, b""))
    assert waits.without_late(("=V", "x", "=V", "=P", "=P")) == ("x", "=V", "=P")
    assert waits.without_late(("=P",)) == ("=P",)


def test_what_came_behind_a_doubtful_reply_stands_before_the_mark():
    waits = doubt((asked(), NONE, b""))
    assert waits.with_evidence(asked(), replace(VALUE, doubtful=True)) == replace(VALUE, doubtful=True)
    waits.stray(("late",))
    waits.stray(("more",))
    found = waits.with_evidence(mark(), Reply(("~1",)))
    assert found == Reply(("late", "more", "~1"))
    assert waits.with_evidence(mark(), Reply(("~1",))) == Reply(("~1",))


def test_only_so_much_is_kept_of_it():
    waits = Doubt()
    waits.with_evidence(asked(), replace(VALUE, doubtful=True))
    waits.stray(tuple("abcdef"))
    waits.stray(tuple("ghijkl"))
    assert waits.with_evidence(mark(), Reply(("~1",))).lines == (*"abcdefgh", "~1")
    assert MOST_EVIDENCE == 8


@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        (asked(), VALUE),
        (mark(), Reply(("~1",), End.TIMEOUT)),
        (mark("b"), Reply(("~1",))),
    ],
)
def test_any_other_reply_has_no_such_lines(request_, reply):
    waits = Doubt()
    waits.with_evidence(asked(), replace(VALUE, doubtful=True))
    waits.stray(("late",))
    assert waits.with_evidence(request_, reply) == reply


@pytest.mark.parametrize(
    ("request_", "reply", "lines"),
    [
        (asked("b"), VALUE, ()),
        (asked("b"), replace(VALUE, doubtful=True), ("5",)),
        (mark("b"), Reply(("x", "~1")), ("x", "~1")),
        (asked("b"), Reply(doubtful=True), ()),
    ],
)
def test_the_mark_and_the_doubtful_reply_of_another_drive_may_be_the_owed_one(request_, reply, lines):
    waits = Doubt()
    waits.with_evidence(asked(), replace(VALUE, doubtful=True))
    waits.with_evidence(request_, reply)
    assert waits.with_evidence(mark(), Reply(("~1",))).lines == (*lines, "~1")


def test_a_doubtful_reply_without_lines_begins_no_evidence():
    waits = Doubt()
    waits.with_evidence(asked(), Reply(doubtful=True))
    waits.stray(("x",))
    assert waits.with_evidence(mark(), Reply(("~1",))).lines == ("~1",)


# Debris


def after_stop(now: float = 10.0) -> Debris:
    debris = Debris()
    debris.request_written(b"aPR P\r", asked(), 9.0)
    debris.stop_written(b"\x1bname", now)
    return debris


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("a print", True),
        ("PR P", False),
        ("> PR P ", False),
        ("??R P", False),
        ("name", False),
        ("12", False),
        ("-12", False),
        ("12a", True),
        ("stop replied", False),
        ("stop replied twice", True),
        ("caf\xe9", False),
        ('a"', False),
        ("5!", False),
        ("abc!", True),
        ("", False),
    ],
)
def test_for_a_while_after_a_stop_its_debris_is_not_shown(line, shown):
    known = re.compile("stop replied")
    assert after_stop().removed((line, "tail."), known, 10.0) == ((line, "tail.") if shown else ("tail.",))
    assert after_stop().removed((line,), known, 10.0 + DEBRIS_LASTS) == ((line,) if shown else ())
    assert after_stop().removed((line,), known, 10.1 + DEBRIS_LASTS) == (line,)


def test_what_a_language_does_not_know_as_debris_is_shown():
    assert after_stop().removed(("stop replied",), None, 10.0) == ("stop replied",)


def test_without_a_request_no_value_is_debris():
    debris = Debris()
    debris.stop_written(b"", 10.0)
    assert debris.removed(("12", "PR P"), None, 10.0) == ("12", "PR P")


def test_a_request_without_an_expected_print_makes_no_value_debris():
    debris = Debris()
    debris.stop_written(b"", 10.0)
    debris.request_written(b"aMR 1\r", command(), 10.0)
    assert debris.removed(("12", "MR 1"), None, 10.0) == ("12",)


def test_what_was_written_before_the_stop_counts_until_its_debris_is_over():
    debris = after_stop()
    debris.request_written(b"aPR V\r", asked(), 10.0 + DEBRIS_LASTS)
    debris.stop_written(b"", 11.0)
    assert debris.removed(("PR P", "PR V"), None, 11.0) == ()
    debris.request_written(b"aPR A\r", asked(), 12.0)
    debris.stop_written(b"", 12.0)
    assert debris.removed(("PR P", "PR V", "PR A"), None, 12.0) == ("PR P", "PR V")


def test_debris_may_come_after_a_stop_alone():
    debris = Debris()
    assert not debris.may_come(0.0)
    debris.stop_written(b"\x1b", 1.0)
    assert debris.may_come(1.0 + DEBRIS_LASTS) and not debris.may_come(1.1 + DEBRIS_LASTS)


# Leftovers


def answers(line: str) -> bool:
    return line.startswith("=")


@pytest.mark.parametrize(
    ("now", "lines", "left"),
    [(0.0, ("x",), ("=1",)), (LATE_WITHIN, ("x",), ("=1",)), (LATE_WITHIN + 0.1, ("x", "=1"), ())],
)
def test_a_reply_to_a_session_before_may_come_for_a_while(now, lines, left):
    leftovers = Leftovers()
    leftovers.opened(0.0)
    assert leftovers.divided(("x", "=1"), answers, now) == (lines, left)


def test_once_the_drives_were_found_nothing_of_a_session_before_comes():
    leftovers = Leftovers()
    assert leftovers.divided(("=1",), answers, 0.0) == (("=1",), ())
    leftovers.opened(0.0)
    leftovers.drives_found()
    assert leftovers.divided(("=1",), answers, 1.0) == (("=1",), ())


def test_while_a_session_before_is_cleared_up_all_that_comes_is_its_own():
    leftovers = Leftovers()
    leftovers.recovering = True
    assert leftovers.divided(("x", "=1"), answers, 100.0) == ((), ("x", "=1"))


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("aPR P", False),
        ("aPR P\x81", False),
        (">aPR P", False),
        ("12? aPR P", False),
        ("aPR P\raPR P", False),
        ("aPR PaPR P\x81", False),
        ("xaPR P", True),
        ("aPR Px", True),
        ("PR P", True),
        (">", True),
        ("", True),
    ],
)
def test_an_echo_of_what_was_sent_is_no_print(line, shown):
    leftovers = Leftovers()
    leftovers.request_written(b"aPR P\x81\r", 0.0)
    assert leftovers.divided((line, "print"), answers, LATE_WITHIN) == ((line, "print") if shown else ("print",), ())
    assert leftovers.divided((line,), answers, LATE_WITHIN + 0.1) == ((line,), ())


def test_a_request_of_one_character_has_no_echo():
    leftovers = Leftovers()
    leftovers.request_written(b"\n", 0.0)
    leftovers.request_written(b"E\r", 0.0)
    assert leftovers.divided(("E",), answers, 0.0) == (("E",), ())
    leftovers.request_written(b"PG\r", 0.0)
    assert leftovers.divided(("PG",), answers, 0.0) == ((), ())


def test_echoes_in_parts_are_none_either_and_what_stands_between_them_is_kept_in_order():
    leftovers = Leftovers()
    leftovers.request_written(b"P R P,1\r", 0.0)
    lines = ("one", "P", "R", "P,1", "two", "PR", "P, 1", "three", "P", "R", "P", ",1")
    kept = ("one", "two", "three", "P", "R", "P", ",1")
    assert leftovers.divided(lines, answers, 0.0) == (kept, ())


# The buffer


class Box:
    """An inbox, and what it has published."""

    def __init__(self, echo: bool = False, counted: bool = False) -> None:
        self.published: list[tuple[float, tuple[str, ...]]] = []
        self.found = 0
        self.codec = Lines(counted=counted)
        self.inbox = Inbox(self.codec, echo, self._publish, self._on_echo)

    def _publish(self, now: float, lines: Any) -> None:
        self.published.append((now, tuple(lines)))

    def _on_echo(self) -> None:
        self.found += 1

    @property
    def lines(self) -> list[str]:
        return [line for _, lines in self.published for line in lines if line]


def test_whole_lines_are_published_and_the_rest_once_it_is_overdue():
    box = Box()
    box.inbox.receive(b"one\r\ntwo\r\nth", 1.0)
    box.inbox.sort(1.0)
    assert box.published == [(1.0, ("one", "two"))] and box.inbox.buffer == b"th"
    assert box.inbox.tail_at() == 1.0 + TAIL and box.inbox.awaits_tail(1.0)
    box.inbox.receive(b"ree", 1.04)
    box.inbox.sort(1.04 + TAIL)
    assert box.published[1:] == [(1.04 + TAIL, ()), (1.04 + TAIL, ("three",))]
    assert box.inbox.buffer == b"" and box.inbox.tail_at() is None and not box.inbox.awaits_tail(9.0)


def test_a_line_that_never_ends_is_published_in_pieces():
    box = Box()
    for tenth in range(11):
        box.inbox.receive(b"x", tenth / 10)
    assert box.inbox.tail_at() == LONGEST_WAIT_FOR_QUIET
    box.inbox.sort(0.99)
    assert box.lines == []
    box.inbox.sort(1.0)
    assert box.lines == ["x" * 11]


@pytest.mark.parametrize(("length", "shown"), [(LONGEST_TAIL, False), (LONGEST_TAIL + 1, True)])
def test_a_line_that_is_too_long_is_published_at_once(length, shown):
    box = Box()
    box.inbox.receive(b"x" * length, 1.0)
    box.inbox.sort(1.0)
    assert box.lines == (["x" * length] if shown else [])


def test_after_a_reply_the_wait_for_the_rest_begins_again():
    box = Box()
    box.inbox.receive(b"5\r\nrest", 0.0)
    box.inbox.consume(3, 0.5)
    box.inbox.receive(b".", 0.9)
    assert box.inbox.buffer == b"rest." and box.inbox.tail_at() == 0.9 + TAIL
    box.inbox.receive(b".", 1.49)
    assert box.inbox.tail_at() == 0.5 + LONGEST_WAIT_FOR_QUIET


def test_a_numbered_language_keeps_the_rest_whatever_happens():
    box = Box(counted=True)
    box.inbox.receive(b"one\r\nha", 1.0)
    box.inbox.sort(9.0)
    assert box.lines == ["one"] and box.inbox.buffer == b"ha" and box.inbox.tail_at() is None
    box.inbox.resume()
    box.inbox.stop(asked())
    assert box.inbox.buffer == b"ha"
    box.inbox.cut_off(9.0)
    assert box.lines == ["one", b"ha".hex(" ")] and box.inbox.buffer == b""


def test_after_a_pause_the_rest_of_any_other_is_forgotten():
    box = Box()
    box.inbox.receive(b"ha", 1.0)
    box.inbox.resume()
    assert box.inbox.buffer == b"" and box.published == []


def test_a_loss_publishes_what_came_and_forgets_our_own_bytes():
    box = Box(echo=True)
    box.inbox.note_written(b"PR P\r", 1.0)
    box.inbox.receive(b"one\r\nPR", 1.0)
    box.inbox.cut_off(2.0)
    assert box.published[-1] == (2.0, ("one", "PR")) and box.lines == ["one", "PR"]
    assert box.inbox.echo is not None and box.inbox.echo.own == box.inbox.buffer == b""


def test_what_was_under_way_before_our_own_bytes_is_no_reply():
    box = Box(echo=True)
    box.inbox.note_written(b"PR P\r", 1.0)
    box.inbox.receive(b"one\r\ntw", 1.01)
    assert box.inbox.tail_at() == 1.01 + TAIL
    box.inbox.receive(b"PR P\r5", 1.02)
    assert box.lines == ["one", "tw"] and box.inbox.buffer == b"5"


def test_what_is_no_repetition_of_ours_is_published_once_it_is_quiet():
    box = Box(echo=True)
    box.inbox.note_written(b"PR P\r", 1.0)
    box.inbox.receive(b"one\r\n", 1.01)
    box.inbox.sort(1.01 + TAIL - 0.001)
    assert box.lines == []
    box.inbox.sort(1.01 + TAIL)
    assert box.lines == ["one"] and box.inbox.echo is not None and box.inbox.echo.held == b""
    box.inbox.note_written(b"PR V\r", 2.0)
    box.inbox.receive(b"two", 2.0)
    box.inbox.note_written(b"PR P\r", 2.1)
    assert box.lines == ["one", "two"]


def test_a_stop_keeps_the_reply_that_it_interrupts_and_its_rest_is_no_print():
    box = Box()
    box.inbox.receive(b"old\r\n-1", 1.0)
    box.inbox.stop(asked())
    assert box.inbox.buffer == b"old\r\n-1"
    box.inbox.sort(1.0)
    assert box.lines == []
    box.inbox.receive(b"2\r\nnew\r\n", 1.01)
    box.inbox.sort(1.01)
    assert box.lines == ["old", "new"]
    box.inbox.receive(b"3\r\n", 1.02)
    box.inbox.sort(1.02)
    assert box.lines == ["old", "new", "3"]


def test_where_the_rest_does_not_come_what_came_after_the_stop_is_a_print():
    box = Box()
    box.inbox.receive(b"-1", 1.0)
    box.inbox.stop(asked())
    box.inbox.receive(b"print", 1.0)
    box.inbox.sort(1.0 + TAIL)
    assert box.lines == ["print"]


def test_a_flood_behind_a_reply_that_was_cut_off_is_not_kept():
    box = Box()
    box.inbox.stop(asked())
    box.inbox.receive(b"x" * LONGEST_TAIL, 1.0)
    box.inbox.sort(1.0)
    assert box.lines == []
    box.inbox.receive(b"x", 1.0)
    box.inbox.sort(1.0)
    assert box.lines == ["x" * (LONGEST_TAIL + 1)]


@pytest.mark.parametrize("request_", [None, command(), asked(expect=None)])
def test_a_stop_forgets_what_came_before_it_where_no_print_is_in_flight(request_):
    box = Box()
    box.inbox.receive(b"old\r\n-1", 1.0)
    box.inbox.stop(request_)
    assert box.inbox.buffer == b""


def test_a_second_stop_keeps_the_reply_that_the_first_has_interrupted():
    box = Box()
    box.inbox.receive(b"-1", 1.0)
    box.inbox.stop(asked())
    box.inbox.stop(None)
    assert box.inbox.buffer == b"-1"
    box.inbox.cut_off(1.0)
    box.inbox.receive(b"2\r\n", 1.0)
    box.inbox.sort(1.0)
    assert box.lines == ["-1", "2"]


def test_behind_an_adapter_that_repeats_a_stop_forgets_everything():
    box = Box(echo=True)
    box.inbox.receive(b"-1", 1.0)
    box.inbox.stop(asked())
    assert box.inbox.buffer == b""


def test_a_repetition_that_was_found_and_stays_away_is_looked_for_again_and_a_given_one_is_not():
    box = Box()
    box.inbox.note_written(b"PR P\r", 1.0, box.codec)
    box.inbox.receive(b"one\r\nPR P\r5", 1.0)
    assert box.found == 1 and box.lines == ["one"] and box.inbox.buffer == b"5"
    box.inbox.doubt_echo()
    assert box.inbox.echo is None
    box.inbox.note_written(b"PR V\r", 2.0, box.codec)
    box.inbox.forget()
    box.inbox.receive(b"PR V\r6", 2.0)
    assert box.found == 2 and box.inbox.buffer == b"6"
    given = Box(echo=True)
    given.inbox.doubt_echo()
    assert given.inbox.echo is not None
