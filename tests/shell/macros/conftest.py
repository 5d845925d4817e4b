"""Sessions for the tests of macros: without a bus, and on a cell."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from tests.support.macro_shop import Shop


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[Session]:
    session = Session(Settings({}, tmp_path, tmp_path / "state"))
    yield session
    session.buses.clear()
    await session.close()


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[Shop]:
    async with Shop(tmp_path) as shop:
        yield shop
