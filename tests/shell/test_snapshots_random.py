"""Snapshots of drives with any settings: opened and taken again, they give the same file."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.manual.table import words
from multidrop.families.lexium.simulator.family import KEY_OF
from multidrop.families.lexium.simulator.state.models import MODELS
from multidrop.shell import snapshots
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from tests.shell.test_snapshots import taken
from tests.support.cell_session import CellSession, bus

pytestmark = [pytest.mark.virtual, pytest.mark.nightly]


def settings(personality: str, rng: random.Random) -> Iterator[str]:
    """Some words that a product takes, each with a value of its range."""
    rows = [row for row in words(personality).values() if personality in row.products and row.name not in KEY_OF]
    rows = [row for row in rows if row.access == "RW" and row.kind in ("variable", "flag") and row.name != "LK"]
    rows = [row for row in rows if row.low is not None and not row.lines]
    for row in rng.sample(rows, rng.randint(1, 14)):
        low, high = (int(each or 0) for each in row.bounds())
        yield f"{row.name} = {rng.choice([*row.values] or [low, high, rng.randint(low, high)])}\n"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("personality", MODELS)
async def test_any_settings_are_the_same_when_they_are_taken_again(tmp_path, personality, seed):
    rng = random.Random(f"{personality} {seed}")
    for _ in range(100):
        text = bus("x", f'personality = "{personality}"\n[bus.drive.set]\n{"".join(settings(personality, rng))}')
        try:
            Floor(cells.read(text))
            break
        except Diagnostic:
            continue  # settings that exclude each other
    async with CellSession(tmp_path, text) as cell:
        await snapshots.save(cell.session, str(tmp_path / "one.toml"))
    first = (tmp_path / "one.toml").read_text()
    assert (await taken(tmp_path, f"sim:{tmp_path / 'one.toml'}", "two.toml"))[0] == first
