"""Transcripts of the verbs: the files in `said` have each typed line after `> `, and below it all that is said.

`!` marks a warning, `=` an outcome, `-` another notice, and `x` the error that ends the line. `SAID=renew` in the
environment writes the files anew (`tests.support.said.compare`). Those of the features are beside their tests.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cell_session import CellSession, bus, drive
from tests.support.said import PLANT, compare

pytestmark = pytest.mark.virtual

PLAIN = (bus("line", drive("LMDCM"), baud=0),)
SCALES = {"a": {"scale": "5 mm/turn", "zero": "120 mm", "travel": "0..300 mm"}, "00.x": "1 mm/step"}
FILES = {
    "p.mxt": "PG 100\nLB Ga\nR1=5\nH 2000\nR2=R1+1\nE\nPG\n",
    "q.mxt": "PG 100\nLB Gb\nXX 5\nE\nPG\n",
    "x.prg": "PRG 0\nX1000\nEND\n",
}
NO = {"macros"}
"""Where the answer to every question is no."""


SAID = Path(__file__).parent / "said"


@pytest.mark.parametrize("name", sorted(each.stem for each in SAID.glob("*.txt")))
async def test_each_line_says_this_and_nothing_else(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for path, text in FILES.items():
        (tmp_path / path).write_text(text)
    units = SCALES if name in ("units", "travel") else {}
    async with CellSession(tmp_path, *(PLAIN if name == "steps" else PLANT), units=units) as shop:
        shop.session.questions.agreed = name not in NO
        await compare(shop, SAID / f"{name}.txt", tmp_path)
