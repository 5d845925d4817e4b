"""Macros: record, store and play lines of text. The room knows times, files and a `run(line)` that it is given."""

from macros.model import KEYS, Macro, Step, check, check_name, escape, fill, value_names
from macros.player import filled_lines, play
from macros.recorder import Recorder
from macros.store import MacroStore
from macros.toml_format import format_macro, parse_macro

__all__ = [
    "KEYS",
    "Macro",
    "MacroStore",
    "Recorder",
    "Step",
    "check",
    "check_name",
    "escape",
    "fill",
    "filled_lines",
    "format_macro",
    "parse_macro",
    "play",
    "value_names",
]
