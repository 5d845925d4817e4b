"""The pages of outputs and of programs: a key shows the line, Enter sends it, and the drive does it."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.tui.screens.lines_page import LinesPage
from multidrop.tui.screens.outputs import OutputsPage
from multidrop.tui.screens.programs import ProgramsPage
from tests.support.cell_session import bus, drive, party
from tests.support.fake_session import press
from tests.support.real_screen import real_screen, until

pytestmark = pytest.mark.tui
SIZES = pytest.mark.parametrize("size", [(80, 24), (120, 40)])


async def opened(pilot: Pilot[int], name: str) -> LinesPage:
    await until(pilot, lambda: pilot.app.session.selected)  # type: ignore[attr-defined]
    await pilot.app.run_action(f"act.page('{name}')")
    page = pilot.app.screen
    assert isinstance(page, LinesPage)
    await until(pilot, lambda: page.rows())
    return page


def shown(page: LinesPage) -> str:
    return page.lines("rows").plain


@SIZES
async def test_an_output_of_a_controller_is_switched_by_its_key_and_enter(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    async with real_screen(tmp_path, "sim:#pmx", size) as pilot:
        page = await opened(pilot, "outputs")
        assert isinstance(page, OutputsPage)
        await until(pilot, lambda: "3   output 3" in shown(page) and "○ off" in shown(page))
        await press(pilot, "3")
        assert page.said[0].startswith("Enter sends DO3=1 - on")
        assert "DO3=1" not in pilot.app.main.transcript.plain  # type: ignore[attr-defined]
        await press(pilot, "enter")
        await until(pilot, lambda: shown(page).count("● on") == 1)
        await press(pilot, "3")
        assert "DO3=0" in page.said[0]
        await press(pilot, "3")
        assert "DO3=1" in page.said[0], "the same key again is the other state"
        await press(pilot, "escape")
        assert page.said[0] == "nothing was sent" and pilot.app.screen is page
        await press(pilot, "escape")
        assert pilot.app.screen is not page


async def test_a_stop_and_another_key_send_nothing(tmp_path: Path) -> None:
    async with real_screen(tmp_path, "sim:#pmx") as pilot:
        page = await opened(pilot, "outputs")
        await press(pilot, "1")
        await press(pilot, "ctrl+x")
        assert page.begun is None and "stopped; nothing was sent" in page.said[0]
        await press(pilot, "9")
        assert page.said[0] == "no output 9"
        await press(pilot, "2")
        await press(pilot, "down")
        assert page.begun is None and page.said[0] == "nothing was sent"
        assert "DO" not in pilot.app.main.transcript.plain  # type: ignore[attr-defined]


async def test_a_point_that_is_an_input_or_shows_a_state_is_not_switched(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("press", party("a", "io = { OS1 = [16, 1], OS2 = [17, 1] }"), baud=0))
    async with real_screen(tmp_path) as pilot:
        page = await opened(pilot, "outputs")
        assert isinstance(page, OutputsPage)
        await until(pilot, lambda: "not reported" in shown(page) or "switches it" in shown(page))
        assert [row.label.split()[0] for row in page.rows()] == ["1", "2", "3"]


async def test_the_outputs_of_a_module_begin_at_0(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("slide", drive("TMCM-1140", "1"), baud=0))
    async with real_screen(tmp_path, f"sim:{tmp_path / 'cell.toml'}") as pilot:
        page = await opened(pilot, "outputs")
        await press(pilot, "0")
        assert page.said[0].startswith("Enter sends SIO 0, 2, 1")
        await press(pilot, "enter")
        await until(pilot, lambda: "SIO 0, 2, 1" in pilot.app.main.transcript.plain)  # type: ignore[attr-defined]


LOOP = 'program_text = """\nPRG 0\nWHILE 1=1\nDELAY=100\nENDWHILE\nEND\n"""'


@SIZES
async def test_a_program_of_a_controller_runs_pauses_continues_and_stops(tmp_path: Path, size: tuple[int, int]) -> None:
    async with real_screen(tmp_path, "sim:#pmx", size) as pilot:
        page = await opened(pilot, "programs")
        assert isinstance(page, ProgramsPage)
        await until(pilot, lambda: "idle" in shown(page))
        groups = list(dict.fromkeys(row.group for row in page.rows()))
        assert [group.split()[:2] for group in groups] == [["program", "0"], ["program", "1"]]
        assert [row.line for row in page.rows()] == [f"SR{n}={value}" for n in (0, 1) for value in (1, 2, 3, 0)]
        await press(pilot, "enter")
        assert page.said[0].startswith("Enter sends SR0=1")
        await press(pilot, "escape")
        await press(pilot, "up", "down", "enter")
        await press(pilot, "enter")
        await until(pilot, lambda: "SR0=2" in pilot.app.main.transcript.plain)  # type: ignore[attr-defined]


async def test_the_program_of_a_drive_is_paused_and_ended(tmp_path: Path) -> None:
    async with real_screen(tmp_path) as pilot:
        page = await opened(pilot, "programs")
        await until(pilot, lambda: "none runs" in shown(page) or "running" in shown(page))
        assert [row.line for row in page.rows()] == ["PS", "RS", "E"]
