"""The lines of a macro with their places in its file, and what stands for a value that is not known yet."""

from __future__ import annotations

from collections.abc import Callable

from multidrop.dialects import Diagnostic
from multidrop.macros import Macro, MacroStore, parse_macro
from multidrop.macros.parameters import Parameter, plain, written
from multidrop.macros.places import in_text
from multidrop.shell.scripts.model import ScriptLine

UNKNOWN = "0"
"""Stands for a value that is only known when the line is executed."""


def steps_of(macro: Macro, macros: MacroStore | None) -> tuple[list[ScriptLine], list[ScriptLine]]:
    """The lines of a macro and of its end. Without a file of this macro their places are its steps alone."""
    at = _places(macro, macros)
    steps = [
        ScriptLine(*at("line", number), plain(step.line).strip(), macro.name, number, step.after)
        for number, step in enumerate(macro.steps, 1)
    ]
    on_stop = [ScriptLine(*at("on_stop", 0), plain(line).strip(), macro.name) for line in macro.on_stop]
    return steps, on_stop


def _places(macro: Macro, macros: MacroStore | None) -> Callable[[str, int], tuple[str, int]]:
    """The file and line of each key; no file for a macro that is in none."""
    data = macros.contents(macro.name) if macros is not None else None
    text = data.decode("utf-8-sig", "replace") if data is not None else ""
    try:
        same = data is not None and parse_macro(text) == macro
    except Diagnostic:
        same = False
    if macros is None or not same:
        return lambda key, step: ("", 0)
    file, find = str(macros.path(macro.name)), in_text(text, "-")

    def at(key: str, step: int) -> tuple[str, int]:
        place = find(key, step)
        return file, 0 if place == "-" else int(place.rpartition(":")[2])

    return at


def stand_in(parameter: Parameter) -> str:
    """A valid value in place of one that is only known when the line is executed."""
    if parameter.choices:
        return parameter.choices[0]
    if parameter.kind == "text":
        return UNKNOWN
    low, high = (0 if each is None else each for each in (parameter.low, parameter.high))
    return written(low if low > 0 else min(0, high) if parameter.high is not None else 0)
