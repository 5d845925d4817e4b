"""Program files as people write them, in `tests/programs`. The first line of an MCode file names its product."""

from __future__ import annotations

from pathlib import Path

from tests.support.paths import ROOT

FOLDER = ROOT / "tests" / "programs"
MCODE = sorted(FOLDER.glob("*.mxt"))
PMX = sorted(FOLDER.glob("*.prg"))
TMCL = sorted(FOLDER.glob("*.tmc"))


def product_of(file: Path) -> str:
    """The product that a file is for."""
    return "PMX" if file in PMX else file.read_text().splitlines()[0].split()[-1]
