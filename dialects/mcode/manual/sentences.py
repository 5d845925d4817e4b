"""The lines of MCode that a program needs: moves and assignments. The drive has one axis."""

from __future__ import annotations


def move(axis: str, steps: int) -> tuple[str, ...]:
    """Move by a distance."""
    return (f"MR {steps}",)


def move_to(axis: str, position: int) -> tuple[str, ...]:
    """Move to a position."""
    return (f"MA {position}",)


def assign(word: str, value: str) -> str:
    """Give a word a value."""
    return f"{word}={value}"
