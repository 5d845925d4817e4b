"""The texts of the messages: JSON with a time, in the form that the session log has."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime

from multidrop.dialects.values import UNREAD, Conditions
from multidrop.shell.log.entries import Entry, line_of
from multidrop.shell.streams.stdout import shortened

ONLINE, LOST, BYE = "online", "lost", "bye"
"""Plain words: the states of this program, and of a line."""
MOVING, AT_REST, NO_CURRENT, SILENT = "moving", "at rest", "no current", "silent"
"""The states of a drive; or LOST, with its line. NO_CURRENT: an axis is at rest, and nothing holds its load."""
Fields = Mapping[str, int | str]
"""`value`, and more facts."""


def value(time: datetime, fields: Fields) -> str:
    """A value with its time. An axis without a name is left out."""
    found = {name: each for name, each in fields.items() if (name, each) != ("axis", "")}
    return json.dumps({"time": time.isoformat(timespec="microseconds"), **found})


def error(conditions: Iterable[Conditions]) -> Fields:
    """A drive's error: that of the first axis that has one; 0: none."""
    found = next((each for each in conditions if each.error), None)
    if found is None:
        return {"value": 0, "text": ""}
    text = "set; to read its number would clear it" if found.error == UNREAD else found.error_text
    return {"value": found.error, "text": text, "axis": found.axis}


def program(conditions: Iterable[Conditions]) -> str:
    """The label of the program that runs; empty: none."""
    return next((each.program for each in conditions if each.program), "")


def line(entry: Entry) -> str:
    """A line of a transcript: an entry of the session log, shortened."""
    return line_of(replace(entry, text=shortened(entry.text))).decode().rstrip("\n")
