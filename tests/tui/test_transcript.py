"""The transcript: fifty thousand lines, of which those in view are styled."""

import time
from collections.abc import Iterable

import pytest
from textual.app import App, ComposeResult
from textual.pilot import Pilot

from multidrop.shell.raw import ByteForm
from multidrop.tui.screen_model import MOST_FRESH_RECORDS, Record
from multidrop.tui.widgets.transcript import Clocks, Transcript, rows_of
from multidrop.tui.widgets.viewport import Picked

pytestmark = pytest.mark.tui
GUTTER = Clocks("clock", str).gutter


class Reader(App[None]):
    CSS = "Transcript { height: 1fr; }"

    def compose(self) -> ComposeResult:
        yield Transcript(lambda at: f"{at:08.1f}")

    @property
    def page(self) -> Transcript:
        return self.query_one(Transcript)


def numbered(numbers: Iterable[int]) -> list[Record]:
    return [Record(float(n), "a", "", f"line {n}") for n in numbers]


async def shown(pilot: Pilot[None], page: Transcript) -> list[str]:
    await pilot.pause()
    return page.plain.split("\n")


async def test_the_newest_line_is_in_view() -> None:
    app = Reader()
    async with app.run_test(size=(40, 5)) as pilot:
        app.page.extend(numbered(range(100)))
        lines = await shown(pilot, app.page)
        assert len(lines) == 5
        assert lines[-1].endswith("line 99")
        app.page.extend(numbered([100]))
        assert (await shown(pilot, app.page))[-1].endswith("line 100")


async def test_who_looks_back_is_not_disturbed_and_is_told_of_more() -> None:
    app = Reader()
    async with app.run_test(size=(60, 6)) as pilot:
        app.page.extend(numbered(range(100)))
        app.page.look(-10)
        before = await shown(pilot, app.page)
        assert "10 more below" in before[-1]
        app.page.extend(numbered(range(100, 150)))
        after = await shown(pilot, app.page)
        assert after[:-1] == before[:-1]
        assert "60 more below" in after[-1]
        app.page.look_end(newest=True)
        assert (await shown(pilot, app.page))[-1].endswith("line 149")
        assert app.page.sight.following


async def test_lines_that_come_before_the_first_layout_are_taken() -> None:
    """A line that is typed right at the start of the screen comes before the view has a size."""
    app = Reader()
    app.CSS = "Transcript { height: 0; }"
    async with app.run_test(size=(40, 5)) as pilot:
        app.page.extend(numbered(range(4)))
        assert "".join(await shown(pilot, app.page)) == ""
        app.page.styles.height = 5
        assert (await shown(pilot, app.page))[-1].endswith("line 3")


async def test_pages_overlap_so_that_no_line_is_missed() -> None:
    app = Reader()
    async with app.run_test(size=(40, 6)) as pilot:
        app.page.extend(numbered(range(40)))
        seen = set(await shown(pilot, app.page))
        for _ in range(12):
            app.page.look_page(-1)
            seen |= set(await shown(pilot, app.page))
        assert {line.split()[-1] for line in seen if "line" in line and "more" not in line} == {
            str(n) for n in range(40)
        }
        for _ in range(12):
            app.page.look_page(1)
        assert app.page.sight.following


async def test_the_oldest_line_can_be_reached_and_not_passed() -> None:
    app = Reader()
    async with app.run_test(size=(40, 6)) as pilot:
        app.page.extend(numbered(range(40)))
        app.page.look_end(newest=False)
        first = await shown(pilot, app.page)
        assert first[0].endswith("line 0")
        app.page.look(-5)
        assert await shown(pilot, app.page) == first


async def test_the_oldest_are_dropped_and_a_reader_moves_on_with_them() -> None:
    app = Reader()
    async with app.run_test(size=(40, 6)) as pilot:
        app.page.extend(numbered(range(MOST_FRESH_RECORDS)))
        app.page.look_end(newest=False)
        app.page.extend(numbered(range(MOST_FRESH_RECORDS, MOST_FRESH_RECORDS + 1000)))
        assert len(app.page.records) == MOST_FRESH_RECORDS
        await pilot.resize_terminal(80, 6)
        assert (await shown(pilot, app.page))[-1].startswith(" 1000 older lines were dropped")
        assert (await shown(pilot, app.page))[0].endswith("line 1000")


async def test_what_is_taken_in_of_a_flood_appears_with_the_next_painting() -> None:
    app = Reader()
    async with app.run_test(size=(40, 5)) as pilot:
        app.page.extend(numbered(range(10)))
        before = await shown(pilot, app.page)
        app.page.take(numbered(range(10, 5000)))
        assert await shown(pilot, app.page) == before
        app.page.show_new()
        assert [line[GUTTER:].strip() for line in await shown(pilot, app.page)] == [
            f"line {n}" for n in range(4995, 5000)
        ]


async def test_a_row_in_view_is_made_once_while_it_scrolls(monkeypatch: pytest.MonkeyPatch) -> None:
    app, made = Reader(), []
    async with app.run_test(size=(40, 5)) as pilot:
        rows_of = app.page.rows_of
        monkeypatch.setattr(
            app.page, "rows_of", lambda record, above, width: made.append(record) or rows_of(record, above, width)
        )
        for number in range(20):
            app.page.extend(numbered([number]))
            await shown(pilot, app.page)
        assert [record.text for record in made] == [f"line {n}" for n in range(20)]
        await pilot.resize_terminal(30, 5)
        assert (await shown(pilot, app.page))[-1].endswith("line 19")
        assert len(made) > 20, "another width is another wrapping"


async def test_a_long_line_is_wrapped_beside_its_address() -> None:
    app = Reader()
    async with app.run_test(size=(GUTTER + 21, 4)) as pilot:
        app.page.extend([Record(1, "a", "<", "x" * 45)])
        lines = await shown(pilot, app.page)
        assert [line[GUTTER:] for line in lines] == ["x" * 20, "x" * 20, "x" * 5]
        assert lines[1][:GUTTER].strip() == ""


async def test_what_we_say_is_broken_between_words_and_what_a_drive_says_is_not() -> None:
    app = Reader()
    async with app.run_test(size=(GUTTER + 13, 6)) as pilot:
        app.page.extend([Record(1, "a", mark, "VM not above VI: raise it") for mark in ("x", "")])
        lines = [line[GUTTER:].rstrip() for line in await shown(pilot, app.page)]
        assert [line for line in lines if line] == ["VM not above", "VI: raise it", "VM not above", " VI: raise i", "t"]


async def test_sent_reply_failure_and_unsolicited_differ_without_colour() -> None:
    app = Reader()
    async with app.run_test(size=(60, 6)) as pilot:
        app.page.extend([Record(1, "a", mark, "same") for mark in (">", "»", "", "<", "x", ".")])
        signs = [line[GUTTER - 2] for line in await shown(pilot, app.page)]
        assert signs == ["›", "»", " ", "«", "✗", "·"]


async def test_a_hundred_thousand_lines_are_taken_in_within_a_second() -> None:
    app = Reader()
    async with app.run_test(size=(80, 24)) as pilot:
        batch = numbered(range(3400))
        began = time.process_time()
        for _ in range(30):
            app.page.extend(batch)
            await pilot.pause()
        assert time.process_time() - began < 1.0 * 5  # CPU seconds; five times what is asked, for a slow machine
        assert (await shown(pilot, app.page))[-1].endswith("line 3399")


async def test_raw_bytes_stand_in_columns_with_milliseconds_and_the_gutter_is_as_wide_as_a_name() -> None:
    clocks = Clocks("clock", lambda at: "12:41:05.100")
    sent = [Record(0.0, "", "↑", row, columns=True) for row in ByteForm.BOTH.rows(b"PR P\r")]
    got = [Record(0.0, "", "↓", row, columns=True) for row in ByteForm.BOTH.rows(bytes(range(12)) + b"abc")]
    rows = ["".join(text for text, _ in row) for each in sent + got for row in rows_of(each, None, clocks, 80)]
    assert rows == [
        " 12:41:05.100  ↑ PR P\\r                   50 52 20 50 0D",
        " 12:41:05.100  ↓ \\x00\\x01\\x02\\x03\\x04\\x05 00 01 02 03 04 05",
        " 12:41:05.100  ↓ \\x06\\x07\\x08\\t\\n\\x0babc  06 07 08 09 0A 0B 61 62 63",
    ]
    page = Transcript(lambda at: "12:41:05.100")
    page.take([Record(0.0, "a", ">", "PR P", name="gantry-left")])
    assert page.clocks.gutter == clocks.gutter + len("gantry-left") - 3
    (row,) = page.rows_of(page.records[0], None, 60)
    assert "".join(text for text, _ in row) == " 12:41:05  gantry-left › PR P"


async def test_a_record_with_details_has_one_row_until_it_is_picked() -> None:
    drives = tuple(f"drive{n} {n}.000 mm" for n in range(12))
    stop = Record(1.0, "", "■", "   ".join(("press: 12 of 12 at rest", *drives)), details=drives)
    app = Reader()
    async with app.run_test(size=(60, 20)) as pilot:
        app.page.extend([Record(0.5, "", ".", "before"), stop])
        rows = [row for row in await shown(pilot, app.page) if row]
        assert len(rows) == 2 and "■ press: 12 of 12 at rest   drive0 0.000 mm" in rows[1] and rows[1].endswith("…")
        app.page.picked = Picked(app.page.sight)
        app.page.changed()
        rows = [row for row in await shown(pilot, app.page) if row]
        assert len(rows) == 14 and rows[-1].endswith("drive11 11.000 mm")
