"""A transcript of `/twin`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cell_session import CellSession
from tests.support.said import PLANT, compare

pytestmark = pytest.mark.virtual
SAID = Path(__file__).with_name("said.txt")


async def test_each_line_says_this_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written as the files of `tests/shell/said`."""
    monkeypatch.chdir(tmp_path)
    async with CellSession(tmp_path, *PLANT) as shop:
        shop.session.questions.agreed = True
        await compare(shop, SAID, tmp_path)
