"""Roles: names in a macro's lines that stand for buses, bound to open ones when it is played."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from macros.model import Macro

_PLACE = re.compile(r"(?<![\w:/.-])(?P<role>[A-Za-z0-9_-]+):")
_HEAD = re.compile(r"^\s*@(?P<role>[A-Za-z0-9_-]+):")


def cast(macro: Macro, buses: Mapping[str, str]) -> Macro:
    """The macro with a bus in place of each role: `@gantry:a` becomes `@press:a`.

    Text for a drive stays as it is; a verb names drives anywhere in its line.
    """
    steps = tuple(replace(step, line=_cast(step.line, buses)) for step in macro.steps)
    return replace(macro, steps=steps, on_stop=tuple(_cast(line, buses) for line in macro.on_stop), roles=())


def _cast(line: str, buses: Mapping[str, str]) -> str:
    verb = line.lstrip().startswith("/")

    def one(match: re.Match[str]) -> str:
        role = match["role"]
        return match[0].replace(role, buses[role], 1) if role in buses else match[0]

    return _PLACE.sub(one, line) if verb else _HEAD.sub(one, line, count=1)
