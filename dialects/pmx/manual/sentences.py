"""The lines of the PMX that a program needs: moves and assignments. A move follows its mode, which stays set."""

from __future__ import annotations

FIRST = "X"
"""The first axis."""


def move(axis: str, steps: int) -> tuple[str, ...]:
    """Move an axis by a distance."""
    return "INC", f"{axis.upper() or FIRST}{steps}"


def move_to(axis: str, position: int) -> tuple[str, ...]:
    """Move an axis to a position."""
    return "ABS", f"{axis.upper() or FIRST}{position}"


def assign(word: str, value: str) -> str:
    """Give a word a value."""
    return f"{word}={value}"
