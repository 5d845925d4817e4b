"""The record of a line that a person must agree to before it is sent."""

from __future__ import annotations

from typing import NamedTuple

EVERYONE = "*"
"""The name of the guard on lines that can start motion of every drive on a line."""
ADDRESSES = ("*", "^")
"""The addresses that mean every drive of a line."""


class Guard(NamedTuple):
    """One guarded line: the name of its guard in the configuration, and what the line does, for a person."""

    name: str
    what: str


def to_all(line: str) -> Guard:
    """Guard a line that can start motion of every drive."""
    return Guard(EVERYONE, f"'{line}' can start every drive of the line")
