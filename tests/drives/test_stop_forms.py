"""The bytes of a stop: which languages it is made in, in which order, with which gaps, and whom it leaves out."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.dialects import Started, StopPiece
from multidrop.drives.stop_forms import StopForms, single_forms, stop_forms


@dataclass(frozen=True)
class Language:
    """A language as far as a stop is made in it."""

    name: str
    stop_replies: bool = False
    framed: bool = False
    harmless: bytes = b"~"
    late: float = 0.0
    fails: bool = False
    single: bool = True

    def stop(self, names: Any, sure: bool = True, half_sent: bool = False) -> bytes:
        if self.fails:
            raise ValueError("no stop")
        return f"[{self.name}{'' if sure else '?'}{'-' if half_sent else ''}:{','.join(names)}]".encode()

    def stop_again(self, names: Any, sure: bool = True) -> list[StopPiece]:
        late = [StopPiece(f"{self.name}late".encode(), self.late)] if self.late else []
        return [StopPiece(f"{self.name}{each}".encode(), 0.03) for each in (1, 2)] + late

    def invalidate(self) -> bytes:
        return self.harmless

    def stop_started(self, address: str, what: Any) -> list[StopPiece]:
        return [StopPiece(f"{address}{each}".encode(), 0.02) for each in "xy"] if self.single else []


@dataclass(eq=False)
class Drive:
    codec: Any
    address: str
    settings_unknown: bool = False
    programming: bool = False
    missing: bool = False
    name: str = ""
    state: Any = field(init=False)

    def __post_init__(self) -> None:
        self.state = SimpleNamespace(
            codec=self.codec, settings_unknown=self.settings_unknown, address=self.address, name=self.name
        )


def roster(*drives: Any, probing: tuple[str, ...] = (), sweep: tuple[StopPiece, ...] = ()) -> Any:
    return SimpleNamespace(
        all_drives=list(drives),
        probing=probing,
        sweep=sweep,
        family=SimpleNamespace(codec=Language("D")),
        link=SimpleNamespace(name="w"),
    )


A, B, FRAMED = Language("A"), Language("B", harmless=b"#"), Language("F", framed=True)
REPLIES, ALSO = Language("R", stop_replies=True), Language("S", stop_replies=True)


def pieces(*texts: str) -> tuple[StopPiece, ...]:
    return tuple(StopPiece(each.encode(), 0.03) for each in texts)


def test_drives_of_one_language_and_setting_share_their_stop():
    made = stop_forms(roster(Drive(A, "a"), Drive(A, "", name="n"), Drive(A, "c", settings_unknown=True)))
    assert made == StopForms(b"[A:a,n][A?:c]", b"[A-:a,n][A?-:c]", pieces("A1", "A1", "A2", "A2"), b"~", False, (), 0.0)


def test_each_language_has_its_part_in_turn_and_its_way_to_make_a_line_harmless():
    made = stop_forms(roster(Drive(A, "a"), Drive(B, "b"), Drive(FRAMED, "f")))
    assert made.immediate == b"[A:a][B:b][F:f]" and made.invalidate == b"~#" and made.framed
    assert made.repeats == pieces("A1", "B1", "F1", "A2", "B2", "F2")
    assert not stop_forms(roster(Drive(A, "a"), Drive(B, "b"))).framed


def test_a_stop_that_drives_reply_to_is_not_written_right_behind_another():
    made = stop_forms(roster(Drive(REPLIES, "r"), Drive(ALSO, "s")))
    assert made.immediate == b"[R:r]" and made.unterminated == b"[R-:r]" and made.gap == 0.03
    assert made.repeats == (StopPiece(b"R1", 0.03), StopPiece(b"[S:s]", 0.03), *pieces("R2", "S1", "S2"))
    mixed = stop_forms(roster(Drive(A, "a"), Drive(REPLIES, "r")))
    assert mixed.immediate == b"[A:a]" and StopPiece(b"[R:r]", 0.03) in mixed.repeats
    assert stop_forms(roster(Drive(REPLIES, "r"), Drive(A, "a"))).immediate == b"[R:r][A:a]"
    assert stop_forms(roster(Drive(A, "a"))).gap == 0.0


def test_what_is_repeated_after_a_pause_comes_after_everything_else_and_then_the_addresses_that_were_asked():
    first, second = Language("A", late=0.6), Language("B", late=0.7)
    sweep = (StopPiece(b"sweep", 0.1),)
    made = stop_forms(roster(Drive(first, "a"), Drive(second, "b"), sweep=sweep))
    assert made.repeats == (
        *pieces("A1", "B1", "A2", "B2"),
        StopPiece(b"Alate", 0.6),
        StopPiece(b"Blate", 0.7),
        *sweep,
    )
    some = roster(Drive(first, "a"), sweep=sweep)
    assert stop_forms(some, some.all_drives).repeats == (*pieces("A1", "A2"), StopPiece(b"Alate", 0.6))


def test_a_stop_of_some_has_no_part_for_the_others():
    every = roster(Drive(A, "a"), Drive(B, "b"), probing=("p",))
    assert stop_forms(every, every.all_drives[:1]).immediate == b"[A:a]"
    assert stop_forms(every, []).immediate == b""


@pytest.mark.parametrize(
    ("drives", "probing", "immediate"),
    [
        ([], (), b"[D?:]"),
        ([], ("p", "q"), b"[D?:p,q]"),
        ([Drive(A, "a")], ("p",), b"[A:a][D?:p]"),
        ([Drive(A, "a")], (), b"[A:a]"),
        ([Drive(Language("D"), "d", settings_unknown=True)], ("p",), b"[D?:d,p]"),
    ],
)
def test_drives_that_are_looked_for_are_stopped_in_the_language_of_the_search(drives, probing, immediate):
    assert stop_forms(roster(*drives, probing=probing)).immediate == immediate


def test_drives_whose_language_fails_are_missed_and_the_others_stopped():
    bad = Language("X", fails=True, framed=True)
    lost, also, good = Drive(bad, "x"), Drive(bad, "y"), Drive(A, "a")
    made = stop_forms(roster(lost, good, also))
    assert made.missed == (lost, also) and made.immediate == b"[A:a]" and made.framed
    assert made.repeats == pieces("A1", "A2")


@pytest.mark.parametrize(
    ("cut", "invalidate", "expected"),
    [
        (False, b"~", (b"now", False)),
        (True, b"~", (b"un~now", True)),
        (True, b"", (b"now", False)),
    ],
)
def test_a_line_that_may_be_cut_in_two_is_made_harmless_between_two_stops(cut, invalidate, expected):
    assert StopForms(b"now", b"un", (), invalidate, False).written(cut) == expected


def test_the_pieces_have_the_first_bytes_once():
    forms = StopForms(b"now", b"un", pieces("x", "now"), b"", False, gap=0.2)
    assert forms.pieces == pieces("x", "now")
    forms = StopForms(b"now", b"un", pieces("x"), b"", False, gap=0.2)
    assert forms.pieces == (StopPiece(b"now", 0.2), *pieces("x"))


# What was started alone


def single(*drives: Drive) -> StopForms | None:
    started: Any = {each: Started() for each in drives}
    return single_forms(started)


def test_what_was_started_is_stopped_piece_by_piece_twice():
    x, y = StopPiece(b"ax", 0.02), StopPiece(b"ay", 0.02)
    assert single(Drive(A, "a")) == StopForms(b"ax", b"ax", (y, x, y), b"", False, gap=0.0)


def test_where_drives_reply_there_is_a_gap_and_frames_stay_whole():
    made = single(Drive(REPLIES, "r"), Drive(FRAMED, "f"))
    assert made is not None
    assert (made.framed, made.gap, made.immediate) == (True, 0.02, b"rx")
    assert [each.data for each in made.repeats] == [b"ry", b"fx", b"fy", b"rx", b"ry", b"fx", b"fy"]


@pytest.mark.parametrize("how", ["settings_unknown", "programming", "missing"])
def test_a_drive_that_may_not_read_lines_has_no_such_stop(how):
    assert single(Drive(A, "a"), Drive(A, "b", **{how: True})) is None


def test_nor_has_a_language_without_one():
    assert single(Drive(A, "a"), Drive(Language("N", single=False), "n")) is None
