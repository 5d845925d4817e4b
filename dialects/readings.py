"""Values of drives that a host may read again and again: what a family offers of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.state import DriveState

S = TypeVar("S", bound=DriveState)


@dataclass(frozen=True)
class Readings(Generic[S]):
    """Values by their words. No reading clears or starts anything in the drive."""

    check: Callable[[S, str], str]
    """Return the word as the drive spells it; nothing is sent. Raises Diagnostic for a word that must not be polled."""
    first: Callable[[S, str], Procedure[float]]
    """Read a value for a person, and make sure that the drive has it. Raises Refused, NoAnswer or Stopped."""
    again: Callable[[S, str, Priority], Procedure[float]]
    """Read a value that was read before. Raises NoAnswer or Stopped, and Refused where the drive lost the value."""
    own: Callable[[S, str], bool] = lambda state, word: True
    """Whether a checked word belongs to the language; any other would be a name that a person gave."""


def number(who: str, word: str, text: str) -> float:
    """Convert a printed value. Raises ValueError with one line for a person where it is not one number."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{who}: {word} is not a number: {text.strip() or 'nothing'}") from None
