"""The lines of a program with their addresses and remarks, those around one, and what is published of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from multidrop.dialects.program_files import Stored
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.programs import MCodePrograms
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.shell.events import Phase, ProgramRead, ProgramSeen
from multidrop.shell.program_listing import ListingSight, ProgramListing
from tests.support.cases import for_each

PROGRAMS: Any = MCodePrograms(MCodeState(MCode()))
ROWS = tuple(Stored(at, text) for at, text in ((1, "LB G1"), (5, "MR 51200"), (12, "H"), (14, "MR -51200"), (21, "H"),
                                              (23, "BR G1"), (27, "E"), (100, "LB G2")))  # fmt: skip


@pytest.fixture
def listing(tmp_path: Path) -> ProgramListing:
    return ProgramListing(tmp_path, PROGRAMS, ROWS)


def test_a_line_holds_the_addresses_up_to_the_next_one(listing: ProgramListing) -> None:
    assert [listing.row(at) for at in (1, 4, 5, 11, 12, 99, 100, 1000)] == [
        *(ROWS[n] for n in (0, 0, 1, 1, 2, 6, 7, 7)),
    ]
    assert listing.row(0) == Stored(0, "")


def test_every_line_has_its_address(listing: ProgramListing) -> None:
    assert listing.lines == tuple((row.at, row.text) for row in ROWS)
    assert listing.shown(ROWS[1]) == "5  MR 51200"
    assert listing.shown(Stored(5, "")) == "5"


@for_each(
    "address, first, last, current",
    [(14, 0, 7, 3), (20, 0, 7, 3), (1, 0, 4, 0), (5, 0, 5, 1), (12, 0, 6, 2), (21, 1, 8, 4), (100, 4, 8, 7)],
)
def test_three_lines_before_and_after_the_current_one_are_shown(
    listing: ProgramListing, address: int, first: int, last: int, current: int
) -> None:
    width = len(str(ROWS[last - 1].at))
    marks = {row.at: "->" if n == current else "  " for n, row in enumerate(ROWS)}
    wanted = [f"{marks[row.at]} {row.at:{width}}  {row.text}" for row in ROWS[first:last]]
    assert listing.around(address) == wanted


@for_each("address", [None, 0])
def test_around_no_line_there_is_nothing(listing: ProgramListing, address: int | None) -> None:
    assert listing.around(address) == []


def test_without_a_program_there_is_no_line(tmp_path: Path) -> None:
    empty = ProgramListing(tmp_path, PROGRAMS)
    assert empty.lines == () and empty.around(5) == [] and empty.row(5) == Stored(5, "")


class Place:
    """A channel, and the drive of it."""

    name, address = "press", "a"

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.link = self

    def now(self) -> float:
        return 7.0

    def publish(self, event: object) -> None:
        self.told.append(event)


def test_what_is_seen_of_a_program_is_published_with_its_break_point(listing: ProgramListing) -> None:
    place: Any = Place()
    sight = ListingSight(place, place)
    sight.read(listing)
    sight.changes()
    sight.breaks("G1")
    sight.seen(5)
    sight.seen(12, Phase.AFTER)
    sight.breaks("")
    sight.seen(None)
    assert place.told == [
        ProgramRead(7.0, "press", "a", listing.lines),
        ProgramRead(7.0, "press", "a", (), known=False),
        ProgramSeen(7.0, "press", "a", None, Phase.EXECUTES, "G1"),
        ProgramSeen(7.0, "press", "a", 5, Phase.EXECUTES, "G1"),
        ProgramSeen(7.0, "press", "a", 12, Phase.AFTER, "G1"),
        ProgramSeen(7.0, "press", "a", 12, Phase.AFTER, ""),
        ProgramSeen(7.0, "press", "a", None, Phase.EXECUTES, ""),
    ]
