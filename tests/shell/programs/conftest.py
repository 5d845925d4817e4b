"""Sessions on cells: one whose drive is debugged, one whose drives take programs."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.support.cell_session import CellSession
from tests.support.debugged import cell, ethernet
from tests.support.transfers import shop_with


@pytest.fixture
async def it(tmp_path: Path) -> AsyncIterator[CellSession]:
    async with cell(tmp_path, ethernet()) as it:
        yield it


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[CellSession]:
    async with shop_with(tmp_path) as shop:
        yield shop
