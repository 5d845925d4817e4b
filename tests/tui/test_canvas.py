"""What is written makes the terminal's screen the new picture, with few bytes; the compositor leaves none out."""

from __future__ import annotations

import unicodedata

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.color import ColorSystem
from rich.segment import Segment
from rich.style import Style
from textual._compositor import ChopsUpdate, Compositor, LayoutUpdate
from textual.geometry import Region
from textual.strip import Strip

from multidrop.tui.app import MultidropApp
from multidrop.tui.terminal.canvas import Canvas, FrontCompositor, Pens, pieces_of
from tests.support.fake_session import compositor_of, demo_session, make_app, press, settle

WIDTH, HEIGHT = 30, 8
STYLES = [
    Style.parse(text)
    for text in (
        "#d0d0d0 on #121212",
        "#8a8a8a on #121212",
        "bold #ffffff on #af0000",
        "bold #d0d0d0 on #121212",
        "underline #5fafd7 on #121212",
        "reverse",
        "cyan",
        "dim italic",
    )
]
TEXTS = st.text(st.sampled_from("ab1 .─⠒日本"), max_size=12) | st.just("e\u0301tat")
ROW = st.lists(st.tuples(TEXTS, st.sampled_from(STYLES)), max_size=5)
PICTURES = st.lists(st.lists(ROW, min_size=HEIGHT, max_size=HEIGHT), min_size=1, max_size=4)


class Terminal:
    """A terminal, and a canvas that draws on it."""

    def __init__(self, system: ColorSystem | None = ColorSystem.TRUECOLOR) -> None:
        self.screen = pyte.Screen(WIDTH, HEIGHT)
        self.stream = pyte.Stream(self.screen)
        self.canvas = Canvas(system)

    def show(self, rows: list[Strip]) -> str:
        """Draw a picture; return what was written."""
        written = self.canvas.draw(pieces_of(LayoutUpdate([[row] for row in rows], picture_region())), WIDTH, HEIGHT)
        self.stream.feed(written)
        return written

    @property
    def lines(self) -> list[str]:
        """The text of the screen."""
        return [line.rstrip() for line in self.screen.display]

    def looks(self) -> list[list[tuple[object, ...]]]:
        """Each cell as a person sees it: on a blank the colour of letters does not count."""
        return [[look(self.screen.buffer[y][x]) for x in range(WIDTH)] for y in range(HEIGHT)]


def look(char: pyte.screens.Char) -> tuple[object, ...]:
    """What is seen of a cell."""
    if char.data == " " and not (char.reverse or char.underscore or char.strikethrough):
        return (" ", char.bg)
    return tuple(char)


def picture_region() -> Region:
    """The whole screen."""
    return Region(0, 0, WIDTH, HEIGHT)


def strip(*spans: tuple[str, Style]) -> Strip:
    """A row of the screen's width."""
    return Strip([Segment(text, style) for text, style in spans]).adjust_cell_length(WIDTH, STYLES[0])


def plain(text: str) -> Strip:
    """A row in one style."""
    return strip((text, STYLES[0]))


@pytest.fixture
def terminal():
    return Terminal()


@given(PICTURES)
def test_after_each_picture_the_terminal_looks_as_if_it_had_been_drawn_afresh(pictures: object) -> None:
    terminal = Terminal()
    for picture in pictures:  # type: ignore[attr-defined]
        rows = [strip(*row) for row in picture]
        terminal.show(rows)
        afresh = Terminal()
        afresh.show(rows)
        assert terminal.looks() == afresh.looks()


def test_afresh_is_what_the_rows_say(terminal: Terminal) -> None:
    terminal.show([plain("one"), strip(("two", STYLES[2]), (" three", STYLES[4]))] + [plain("")] * 6)
    assert terminal.lines[:3] == ["one", "two three", ""]
    cell = terminal.screen.buffer[1][1]
    assert (cell.fg, cell.bg, cell.bold) == ("ffffff", "af0000", True)
    assert terminal.screen.buffer[1][5].underscore


def test_an_equal_picture_writes_nothing_and_a_changed_digit_only_that(terminal: Terminal) -> None:
    rows = [plain(f"line {n}") for n in range(HEIGHT)]
    terminal.show(rows)
    assert terminal.show(rows) == ""
    rows[3] = plain("line 7")
    assert terminal.show(rows) == "\x1b[4;6H\x1b[38;5;252;48;5;233m7\x1b[m"


def test_rows_that_move_up_are_moved_by_the_terminal(terminal: Terminal) -> None:
    rows = [plain("top")] + [plain(f"the line {n * n}") for n in range(6)] + [plain("bottom")]
    terminal.show(rows)
    moved = [rows[0], *rows[2:7], plain("the line that is new"), rows[7]]
    written = terminal.show(moved)
    assert terminal.lines == [row.text.rstrip() for row in moved]
    assert "\x1b[2;7r\x1b[7;1H\n\x1b[r" in written
    assert "the line 16" not in written
    assert len(written) < 100


def test_a_row_that_stands_still_among_rows_that_move_stays(terminal: Terminal) -> None:
    rows = [plain(f"the line {n * n}") for n in range(HEIGHT)]
    terminal.show(rows)
    moved = [rows[1], rows[2], rows[3], rows[3], rows[5], rows[6], rows[7], plain("new")]
    terminal.show(moved)
    assert terminal.lines == [row.text.rstrip() for row in moved]


def test_a_piece_of_a_row_leaves_the_rest(terminal: Terminal) -> None:
    terminal.show([plain("left      right") for _ in range(HEIGHT)])
    chops: list[dict[int, Strip | None]] = [{0: None, 10: None} for _ in range(HEIGHT)]
    chops[2] = {0: None, 10: Strip([Segment("wrong", STYLES[2])])}
    update = ChopsUpdate(chops, [(2, 10, 15)], [[10, WIDTH] for _ in range(HEIGHT)])
    written = terminal.canvas.draw(pieces_of(update), WIDTH, HEIGHT)
    terminal.stream.feed(written)
    assert terminal.lines[1:4] == ["left      right", "left      wrong", "left      right"]


def test_letters_that_share_a_cell_are_written_as_they_are_and_the_row_again_the_next_time(terminal: Terminal) -> None:
    terminal.show([plain("e\u0301tat"), *[plain("")] * 7])
    assert terminal.lines[0] == "état"
    terminal.show([plain("other"), *[plain("")] * 7])
    assert terminal.lines[0] == "other"


def test_rows_that_move_leave_a_row_of_letters_that_share_a_cell_in_its_place(terminal: Terminal) -> None:
    rows = [plain(f"the line {n * n}") for n in range(HEIGHT)]
    terminal.show(rows)
    moved = [*rows[1:4], plain("e\u0301tat"), *rows[5:8], plain("new")]
    terminal.show(moved)
    assert terminal.lines == [unicodedata.normalize("NFC", row.text.rstrip()) for row in moved]


def test_letters_that_share_the_last_cell_of_the_screen_do_not_scroll_it(terminal: Terminal) -> None:
    terminal.show([plain("")] * 7 + [plain("1" * (WIDTH - 1) + "e\u0301tat")])
    assert terminal.lines == [""] * 7 + ["1" * (WIDTH - 1) + "é"]
    terminal.show([plain("")] * HEIGHT)
    assert terminal.lines == [""] * HEIGHT


@pytest.mark.parametrize("text", ["right" * 8, "e\u0301tat" * 8])
@pytest.mark.parametrize("x", [WIDTH - 2, WIDTH, WIDTH + 20])
def test_a_picture_of_a_wider_terminal_is_cut(text: str, x: int, terminal: Terminal) -> None:
    row = [plain("left").adjust_cell_length(x, STYLES[0]), Strip([Segment(text, STYLES[2])])]
    update = LayoutUpdate([row], Region(0, 0, WIDTH + 30, 1))
    terminal.stream.feed(terminal.canvas.draw(pieces_of(update), WIDTH, HEIGHT))
    assert terminal.lines[0].split() == ["left", unicodedata.normalize("NFC", text)[:2]][: 2 if x < WIDTH else 1]
    assert terminal.lines[1] == ""


def test_after_forget_everything_is_written_again(terminal: Terminal) -> None:
    rows = [plain(f"line {n}") for n in range(HEIGHT)]
    first = terminal.show(rows)
    terminal.screen.reset()
    terminal.canvas.forget()
    assert terminal.show(rows) == first
    assert terminal.lines == [row.text.rstrip() for row in rows]


@pytest.mark.parametrize(
    ("system", "code"),
    [
        (ColorSystem.TRUECOLOR, "\x1b[38;2;224;95;95m"),
        (ColorSystem.EIGHT_BIT, "\x1b[38;5;167m"),
        (ColorSystem.STANDARD, "\x1b[91m"),
        (None, "\x1b[m"),
    ],
)
def test_a_colour_is_told_in_what_the_terminal_has(system: ColorSystem | None, code: str) -> None:
    pens = Pens(system)
    assert (pens.change(0, pens.number(Style.parse("#e05f5f"))) or "\x1b[m") == code


def test_a_colour_that_is_one_of_the_256_is_told_by_its_number() -> None:
    pens = Pens(ColorSystem.TRUECOLOR)
    assert pens.change(0, pens.number(Style.parse("#5fafd7 on #121212"))) == "\x1b[38;5;74;48;5;233m"


def test_the_pen_changes_by_as_little_as_possible() -> None:
    pens = Pens(ColorSystem.TRUECOLOR)
    text, strong, dim = (
        pens.number(Style.parse(each))
        for each in ("#d0d0d0 on #121212", "bold #d0d0d0 on #121212", "#8a8a8a on #121212")
    )
    assert pens.change(text, strong) == "\x1b[1m"
    assert pens.change(strong, text) == "\x1b[22m"
    assert pens.change(strong, dim) == "\x1b[22;38;5;245m"
    assert pens.change(dim, 0) == "\x1b[m"


# The compositor


def picture(app: MultidropApp, kind: type[Compositor], crop: Region, rows: set[int]) -> dict[int, list[object]]:
    """The pieces of these rows as the terminal is shown them."""
    compositor = compositor_of(app.screen)
    chops = kind._render_chops(compositor, crop, rows.__contains__)  # type: ignore[arg-type]
    spans = [(y, crop.x, crop.right) for y in sorted(rows)]
    update = ChopsUpdate(chops, spans, [cuts[1:] for cuts in compositor.cuts])  # type: ignore[arg-type]
    return {y: [(x, list(Segment.simplify(piece))) for x, piece in found] for y, found in pieces_of(update).items()}


@pytest.mark.tui
@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_the_picture_is_that_of_textual(size: tuple[int, int]) -> None:
    app = make_app(demo_session())
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        for keys in (["M"], ["ctrl+l"], ["ctrl+a"], ["escape"], ["f1"]):
            await press(pilot, *keys)
            screen = app.screen.size.region
            for crop in (screen, Region(0, 3, *screen.size).intersection(screen), Region(7, 2, 20, 9)):
                for rows in ({0, crop.bottom - 1}, set(crop.line_range)):
                    expected = picture(app, Compositor, crop, rows & set(crop.line_range))
                    assert picture(app, FrontCompositor, crop, rows & set(crop.line_range)) == expected, keys


@pytest.mark.tui
async def test_a_widget_whose_rows_are_not_painted_is_not_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    app, rendered = make_app(demo_session()), []
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        render = app.main.transcript.render_lines
        monkeypatch.setattr(app.main.transcript, "render_lines", lambda crop: (rendered.append(1), render(crop))[1])
        picture(app, FrontCompositor, app.screen.size.region, {0, 39})
        assert rendered == []
        picture(app, FrontCompositor, app.screen.size.region, {5})
        assert rendered == [1]
