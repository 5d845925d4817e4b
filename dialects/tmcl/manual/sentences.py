"""The lines of TMCL that a program needs: moves. Values have numbers, not words: SAP and SGP set them."""

from __future__ import annotations

FIRST = "0"
"""The first motor."""


def move(axis: str, steps: int) -> tuple[str, ...]:
    """Move a motor by a distance."""
    return (f"MVP REL, {axis or FIRST}, {steps}",)


def move_to(axis: str, position: int) -> tuple[str, ...]:
    """Move a motor to a position."""
    return (f"MVP ABS, {axis or FIRST}, {position}",)
