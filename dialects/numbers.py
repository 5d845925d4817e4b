"""Whole numbers as people type them: `int` raises for a text of some thousand digits, and takes more than 0 to 9."""

from __future__ import annotations

_MOST_DIGITS = 24
"""Zeros in front included; no value here needs more."""


def whole(text: str, low: int, high: int) -> int | None:
    """The number in a text of digits (0-9) and perhaps a sign; None where it is none from `low` to `high`."""
    digits = text[1:] if text[:1] in ("+", "-") else text
    if not (digits.isascii() and digits.isdigit()) or len(digits) > _MOST_DIGITS:
        return None
    number = int(text)
    return number if low <= number <= high else None
