"""The screen on a Modbus device that is no Lexium drive: nothing is polled, and the panel says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.fake_session import painted
from tests.support.foreign_device import device
from tests.support.real_screen import real_screen, until

pytestmark = [pytest.mark.tui, pytest.mark.real]


async def test_nothing_is_polled_and_a_typed_line_is_all_that_is_sent(tmp_path: Path) -> None:
    with device() as plc:
        async with real_screen(tmp_path, plc.url, (110, 30)) as pilot:
            session = pilot.app.session  # type: ignore[attr-defined]
            await until(pilot, lambda: session.selected is not None)
            await pilot.pause(0.3)
            assert not plc.received
            await pilot.press(*"MA 100", "enter")
            await until(pilot, lambda: plc.received)
            await pilot.pause(0.3)
            assert plc.received == ["10 0043"]
            shown = "\n".join(line.text for line in painted(pilot.app.screen))
            assert "not identified" in shown and "did not identify itself" in shown
