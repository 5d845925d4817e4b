"""The panels of the program, the traffic and the log: rows from facts, which never claim more than was read."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.dialects.values import Conditions
from multidrop.drives.events import Traffic
from multidrop.shell.events import Phase
from multidrop.tui.panels.program import listing_rows, program_rows, program_title, state_words
from multidrop.tui.panels.table import log_rows, log_title, piece_rows, size_words, traffic_rows
from multidrop.tui.panels.view import Glance, View
from multidrop.tui.readout import ProgramFacts, Readout
from multidrop.tui.screen_model import ScreenModel, TrafficPiece
from tests.support.fake_session import demo_session

LINES = tuple((1 + 5 * number, f"MR {number}") for number in range(30))


def text(rows: list[Any]) -> list[str]:
    return ["".join(part for part, _ in row) for row in rows]


def glance(readout: Readout, **more: Any) -> Glance:
    return Glance("a", "", "LMDCM", "6", readout, selected=True, **more)


def view(*glances: Glance, now: float = 100.0, log: Any = None) -> View:
    session = demo_session()
    session.log = log
    model = ScreenModel(lambda: "press", lambda: session.buses)
    return View(session, model, glances, now, True)


def seen(line: int | None, phase: Phase, at: float = 100.0) -> Readout:
    return Readout(program=ProgramFacts(LINES, 90.0, line, phase, "", at))


@pytest.mark.parametrize(
    ("phase", "sign", "words"),
    [
        (Phase.EXECUTES, "▶", "executes 51"),
        (Phase.BEFORE, "║", "waits before 51"),
        (Phase.AFTER, "✓", "waits after 51"),
    ],
)
def test_the_current_line_is_in_the_middle_with_its_sign_and_in_the_title_in_words(
    phase: Phase, sign: str, words: str
) -> None:
    shown = view(glance(seen(51, phase)))
    rows = text(program_rows(shown, 40, 7))
    assert len(rows) == 7 and rows[3].startswith(f" {sign}  51  MR 10")
    assert words in text([program_title(shown)])[0]


def test_an_address_inside_a_compiled_line_belongs_to_the_line_before_it() -> None:
    assert text(listing_rows(seen(53, Phase.EXECUTES), 40, 3))[1].startswith(" ▶  51")


def test_at_the_ends_of_a_program_the_view_stays_inside() -> None:
    assert text(listing_rows(seen(1, Phase.EXECUTES), 40, 5))[0].startswith(" ▶   1")
    assert text(listing_rows(seen(146, Phase.EXECUTES), 40, 5))[-1].startswith(" ▶ 146")


def test_what_was_not_read_is_said_and_not_guessed() -> None:
    assert "not read yet" in text(program_rows(view(glance(Readout())), 40, 5))[0]
    assert "holds no program" in text(program_rows(view(glance(Readout(program=ProgramFacts((), 90.0)))), 40, 5))[0]
    assert state_words(glance(Readout()), 100.0) == ""


def test_a_lost_or_silent_drive_has_no_state_and_an_old_one_has_its_age() -> None:
    running = Readout()
    running.condition(100.0, [Conditions(program="G1", runs=True)])
    assert state_words(glance(running), 100.0) == "runs G1"
    assert state_words(glance(running), 130.0) == "ran G1 30 s ago"
    assert state_words(glance(running, lost=True), 100.0) == ""
    running.silent_since = 99.0
    assert state_words(glance(running), 100.0) == ""
    assert state_words(glance(seen(51, Phase.EXECUTES)), 110.0) == "executes 51, seen 10 s ago"
    assert state_words(glance(seen(51, Phase.BEFORE)), 110.0) == "waits before 51"


def test_the_place_of_a_program_that_the_drive_reports_is_its_line() -> None:
    readout = seen(None, Phase.EXECUTES)
    readout.condition(100.0, [Conditions(program="running", runs=True, line="11")])
    assert text(program_rows(view(glance(readout)), 40, 3))[1].startswith(" ▶  11")


def test_bytes_are_hex_and_text_where_there_is_room_and_text_alone_where_not() -> None:
    wall = demo_session().wall
    (row,) = text(piece_rows(TrafficPiece(67.25, True, b"aPR P\n", "a"), wall, 80, {}))
    assert row == " 12:41:07.250 ↑ a   aPR P·         61 50 52 20 50 0A"
    (row,) = text(piece_rows(TrafficPiece(67.25, False, b"7\r\n"), wall, 40, {}))
    assert row.startswith(" 07.250 ↓ ") and row.endswith("7\\r\\n")


def test_bytes_stand_beside_the_name_that_a_person_gave_to_the_drive() -> None:
    wall, names = demo_session().wall, {"a": "gantry", "b": "a name of more than twelve cells"}
    rows = [piece_rows(TrafficPiece(67.25, True, b"P\n", each), wall, 80, names)[0] for each in "abc"]
    shown = ["gantry      ", "a name of m…", "c           "]
    assert text(rows) == [f" 12:41:07.250 ↑ {each} P·           50 0A" for each in shown]


@pytest.mark.parametrize("width", [40, 80])
def test_no_byte_of_a_long_piece_is_left_out(width: int) -> None:
    rows = text(piece_rows(TrafficPiece(1.0, False, bytes(range(256))), demo_session().wall, width, {}))
    assert max(map(len, rows)) <= width
    shown = " ".join(rows)
    assert all((f"{code:02X}" if width == 80 else f"\\x{code:02x}") in shown for code in (0x01, 0x7F, 0xFF))


def test_the_panel_of_traffic_leaves_out_polls_and_shows_the_newest() -> None:
    shown = view()
    store = shown.model.bus("press").traffic
    for number in range(9):
        store.take(Traffic(number, True, f"{number}\n".encode()))
    store.pieces.append(TrafficPiece(9.0, True, b"poll", "a", True))
    assert [row.split()[-1] for row in text(traffic_rows(shown, 40, 3))] == ["6\\n", "7\\n", "8\\n"]


def test_the_log_shows_where_it_is_how_large_and_its_last_entries() -> None:
    assert "off" in text([log_title(view())])[0] and "/log on" in "".join(text(log_rows(view(), 40, 5)))
    log = SimpleNamespace(path=Path("/var/" + "x" * 60 + "/today.jsonl"), size=34_000, last=lambda n: ["a", "b"][-n:])
    shown = view(log=log)
    assert "34 kB" in text([log_title(shown)])[0]
    rows = text(log_rows(shown, 40, 3))
    assert rows[0].endswith("today.jsonl") and len(rows[0]) <= 40 and [row.strip() for row in rows[1:]] == ["a", "b"]
    assert [size_words(size) for size in (999, 12_345, 3_400_000)] == ["999 B", "12 kB", "3.4 MB"]
