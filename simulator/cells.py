"""Cell files with drives of every simulated family."""

from __future__ import annotations

from importlib import resources

from simulator.cell.reader import Reader
from simulator.cell.spec import Cell
from simulator.families import BY_PERSONALITY

_READER = Reader(BY_PERSONALITY)
load = _READER.load
read = _READER.read


def demo() -> Cell:
    """Read the cell that comes with the program."""
    folder = resources.files("simulator")
    return read(folder.joinpath("demo.toml").read_text(encoding="utf-8"), "demo cell", folder)
