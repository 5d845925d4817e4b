"""What the package in `examples/plugin` counts, in the process of the test and in virtual time."""

from __future__ import annotations

import importlib.metadata
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.shell.events import Output
from multidrop.shell.prompt.complete import complete
from tests.support.cell_session import bus, party, pmx, session_on
from tests.support.paths import ROOT

pytestmark = pytest.mark.virtual
THERE_AND_BACK = ("@a MR 51200", "/wait stopped", "@a MR -51200", "/wait stopped")


@pytest.fixture
async def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Any]:
    """A session with the plugin, on a line with two drives, of which `a` has a scale, and a controller."""
    found = SimpleNamespace(
        name="mileage",
        value="multidrop_mileage:FEATURE",
        dist=SimpleNamespace(name="multidrop-mileage", version="1.0"),
    )
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "plugin"))
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [found])
    for name, empty in (("_others", {}), ("_failed", {}), ("_untold", [])):
        monkeypatch.setattr(registry, name, empty)
    cell = bus("press", party("a", 'units = "-5 mm/turn"'), party("b"), baud=0) + bus("pmx", pmx("00"), baud=0)
    async with session_on(tmp_path, cell) as made:
        yield made


async def shown(session: Any, *lines: str) -> dict[str, str]:
    """Run lines; what `/mileage` then says, by drive and axis."""
    for line in lines:
        await session.run(line)
    session.events.clear()
    await session.run("/mileage")
    return dict(each.text.split(": ") for each in session.events if isinstance(each, Output))


async def test_there_and_back_counts_twice_on_each_axis(session: Any) -> None:
    found = await shown(session, *THERE_AND_BACK, "@b MR -300", "@pmx:00 X20", "/sleep 2")
    wanted = {"press:a": "102400 steps (10 mm)", "press:b": "300 steps", "pmx:00.x": "20 steps", "pmx:00.y": "0 steps"}
    assert found == wanted
    await session.run("/close pmx")
    assert list(await shown(session)) == ["a", "b"]


async def test_what_moves_nothing_counts_nothing(session: Any) -> None:
    sets = ["@press:b P=1000000", "/sleep 0.5", "@press:b P=5", "@press:a P={7 mm}", "@pmx:00 PX=99"]
    found = await shown(session, *sets, "/sleep 0.5", "@press:b MR 10", "/sleep 2")
    assert found["press:b"] == "10 steps" and found["press:a"] == "0 steps (0 mm)" and found["pmx:00.x"] == "0 steps"
    found = await shown(session, "/sim power press:b off", "/sleep 3", "/sim power press:b on", "/sleep 5")
    assert found["press:b"] == "10 steps"


async def test_a_shuttle_is_never_more_than_it_moved_and_hardly_less(session: Any) -> None:
    lines = [f"@press:b MR {way}" for way in (5000, -5000) * 10]
    found = await shown(session, *(each for line in lines for each in (line, "/wait stopped")))
    assert 99000 <= int(found["press:b"].split()[0]) <= 100000


async def test_a_drive_that_does_not_reply_holds_it_up_for_two_seconds(session: Any) -> None:
    await session.run("/sim power pmx:00 off")
    began = session.now()
    assert (await shown(session, "@press:b MR 10"))["press:b"] == "10 steps"
    assert session.now() - began < 3


async def test_drives_complete_and_wrong_words_are_refused(session: Any) -> None:
    assert {"a", "b", "pmx:00"} <= {each.text for each in complete(session, "/mileage ")}
    assert "/mileage" in {each.text for each in complete(session, "/mil")}
    with pytest.raises(Diagnostic, match="no drive press:z; /drives lists them"):
        await session.run("/mileage press:z")
    with pytest.raises(Diagnostic, match=r"usage: /mileage \[ADDR\]"):
        await session.run("/mileage a b")
