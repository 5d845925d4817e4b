"""The rate of a plot: how often each of its drives is read, at most."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.drives.telemetry import FASTEST, MODEST

MAX = "max"
SLOWEST = 0.01
"""The lowest rate, samples a second."""
DEFAULT = f"{1 / MODEST:g}"


def parse_rate(text: str) -> float:
    """The period between two samples of a drive, s; 0 for `max`. Raises Diagnostic."""
    if text == MAX:
        return 0.0
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not SLOWEST <= rate <= 1 / FASTEST:
        valid = f"valid: {SLOWEST:g} to {1 / FASTEST:g} samples a second of each drive, or {MAX}"
        raise Diagnostic(f"invalid rate {text!r}", "--rate", valid)
    return 1 / rate


def shown(period: float) -> str:
    """The rate of a period, for a person."""
    if period <= FASTEST:
        return "as fast as the line allows"
    return f"at most {1 / period:g} samples a second of each drive"
