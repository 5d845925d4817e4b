"""Published values have their quantity in units."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from tests.features.publishing.test_publish_feed import published
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual
PRESS = bus("press", party("a", 'units = "5 mm/turn"'), party("b"))


async def test_published_values_have_the_unit_as_a_further_field(tmp_path: Path) -> None:
    async with CellSession(tmp_path, PRESS) as shop:
        await shop.session.run("@a MR {10 mm}")
        await shop.session.run("/wait stopped")
        async with published(shop) as broker:
            await asyncio.sleep(6)
        last: dict[str, Any] = json.loads(broker.texts("p/press/a/position")[-1])
        assert {key: last[key] for key in ("value", "quantity", "unit")} == {
            "value": 102400,
            "quantity": 10.0,
            "unit": "mm",
        }
        assert json.loads(broker.texts("p/press/a/velocity")[-1])["unit"] == "mm/s"
        assert set(json.loads(broker.texts("p/press/b/position")[-1])) == {"time", "value"}
