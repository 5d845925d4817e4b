"""Whole numbers from typed text: `int` raises for very long texts, and accepts digits other than 0 to 9."""

from __future__ import annotations

_MOST_DIGITS = 24
"""Leading zeros included; no value needs more."""


def whole(text: str, low: int, high: int) -> int | None:
    """Return the number in a text of digits (0-9) with an optional sign; None unless it is from `low` to `high`."""
    digits = text[1:] if text[:1] in ("+", "-") else text
    if not (digits.isascii() and digits.isdigit()) or len(digits) > _MOST_DIGITS:
        return None
    number = int(text)
    return number if low <= number <= high else None
