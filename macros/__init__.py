"""Macros: record, store and play lines of text. The room knows times, files and a `run(line)` that it is given."""

from macros.braces import escape, fill, value_names
from macros.model import (
    FIRST_PAGE,
    KEYS,
    Macro,
    Step,
    check,
    check_name,
    checked_values,
    filled,
    is_role,
    missing,
    page_order,
)
from macros.parameters import Parameter
from macros.recorder import Recorder
from macros.store import MacroStore
from macros.toml_format import format_macro, parse_macro

__all__ = [
    "FIRST_PAGE",
    "KEYS",
    "Macro",
    "MacroStore",
    "Parameter",
    "Recorder",
    "Step",
    "check",
    "check_name",
    "checked_values",
    "escape",
    "fill",
    "filled",
    "format_macro",
    "is_role",
    "missing",
    "page_order",
    "parse_macro",
    "value_names",
]
