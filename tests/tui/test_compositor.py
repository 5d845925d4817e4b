"""What the compositor leaves out is covered: its pictures are those of Textual's own."""

import pytest
from rich.segment import Segment
from textual._compositor import ChopsUpdate, Compositor
from textual.geometry import Region

from multidrop.tui.app import MultidropApp
from multidrop.tui.terminal.canvas import FrontCompositor, pieces_of
from multidrop.tui.widgets.transcript import Transcript
from tests.support.fake_session import demo_session, make_app, settle

pytestmark = pytest.mark.tui


def picture(app: MultidropApp, kind: type[Compositor], crop: Region, rows: set[int]) -> dict[int, list[object]]:
    """The pieces of these rows as the terminal is shown them."""
    compositor = app.screen._compositor
    chops = kind._render_chops(compositor, crop, rows.__contains__)  # type: ignore[arg-type]
    spans = [(y, crop.x, crop.right) for y in sorted(rows)]
    update = ChopsUpdate(chops, spans, [cuts[1:] for cuts in compositor.cuts])  # type: ignore[arg-type]
    return {y: [(x, list(Segment.simplify(piece))) for x, piece in found] for y, found in pieces_of(update).items()}


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_the_picture_is_that_of_textual(size: tuple[int, int]) -> None:
    app = make_app(demo_session())
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        for keys in (["M"], ["ctrl+l"], ["ctrl+a"], ["escape"], ["f1"]):
            await pilot.press(*keys)
            await settle(pilot)
            screen = app.screen.size.region
            for crop in (screen, Region(0, 3, *screen.size).intersection(screen), Region(7, 2, 20, 9)):
                for rows in ({0, crop.bottom - 1}, set(crop.line_range)):
                    expected = picture(app, Compositor, crop, rows & set(crop.line_range))
                    assert picture(app, FrontCompositor, crop, rows & set(crop.line_range)) == expected, keys


async def test_a_widget_whose_rows_are_not_painted_is_not_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    app, rendered = make_app(demo_session()), []
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        render = Transcript.render_lines
        monkeypatch.setattr(Transcript, "render_lines", lambda self, crop: (rendered.append(1), render(self, crop))[1])
        picture(app, FrontCompositor, app.screen.size.region, {0, 39})
        assert rendered == []
        picture(app, FrontCompositor, app.screen.size.region, {5})
        assert rendered == [1]
