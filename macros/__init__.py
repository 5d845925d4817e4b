"""Macros: record, keep and play lines of text. Knows times, files and a `run(line)` that it is given."""

from macros.model import KEYS, Macro, Step, check, check_name, escape, fill, names_in
from macros.player import lines, play
from macros.recorder import Recorder
from macros.store import MacroStore, dump, parse

__all__ = [
    "KEYS",
    "Macro",
    "MacroStore",
    "Recorder",
    "Step",
    "check",
    "check_name",
    "dump",
    "escape",
    "fill",
    "lines",
    "names_in",
    "parse",
    "play",
]
