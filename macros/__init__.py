"""Macros: record, store and play lines of text. The room knows times, files and a `run(line)` that it is given."""

from multidrop.macros.model import (
    FIRST_PAGE,
    KEYS,
    Macro,
    Parameter,
    Step,
    check,
    check_name,
    checked_values,
    escape,
    fill,
    filled,
    is_role,
    missing,
    page_order,
    value_names,
)
from multidrop.macros.recorder import Recorder
from multidrop.macros.store import MacroStore
from multidrop.macros.toml_format import format_macro, parse_macro

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
