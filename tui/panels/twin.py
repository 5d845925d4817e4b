"""The twin of an axis in rows and in few words: the prediction, the difference, and its possible causes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multidrop.tui.readout import Readout
from multidrop.tui.text import at_words, digits
from multidrop.tui.widgets.lines import Row, Span, spread

SIGN = "≠"
"""The drive differs from its twin by more than the limit."""
CAUSES = 3
"""Most rows of causes."""


def twin_rows(axis: Readout, unit: str, number: int, width: int, *, dim: bool) -> Iterator[Row]:
    """The predicted position and velocity, and the difference, each below what was measured; `number`: their width."""
    twin = axis.twin
    if twin is None or twin.predicted is None:
        return
    predicted, diverged = twin.predicted, twin.diverged
    role = "dim" if dim or twin.behind(axis.last) else "text"
    velocity: list[Span] = [(digits(predicted.velocity), role), (f" {unit}/s ", "dim")]
    yield spread([(f" {predicted.position:>{number}} ", role), ("twin", "dim")], velocity, width)
    if diverged is None:
        yield ((f" {predicted.difference:>+{number}} ", role), ("difference", "dim"))
        return
    alarm = "dim" if role == "dim" else "error"
    limit: list[Span] = [(f"limit {digits(diverged.limit)} ", "dim")]
    yield spread([(f" {SIGN} {predicted.difference:>+{number - 2}} ", alarm), ("difference", alarm)], limit, width)
    for text in at_words(", ".join(diverged.causes), width - 4)[:CAUSES]:
        yield ((f"   {text}", alarm),)


def differs(axis: Readout, *, causes: bool = True) -> str:
    """`≠ +8112 stall, load`: the difference from the twin while it is above the limit; empty otherwise."""
    twin = axis.twin
    if twin is None or twin.diverged is None:
        return ""
    now = (twin.predicted or twin.diverged).difference
    return f"{SIGN} {now:+} {', '.join(twin.diverged.causes) if causes else ''}".rstrip()


def alarm_words(trouble: str, axes: Sequence[Readout], room: int) -> str:
    """`≠ +8112 stall, load`, or `✗ error ≠ +8112`, or `✗ error ≠` where there is no room; empty without an alarm."""
    if not trouble:
        return "; ".join(filter(None, map(differs, axes)))
    found = "; ".join(filter(None, (differs(each, causes=False) for each in axes)))
    whole = f"✗ {trouble} {found}".rstrip()
    return whole if len(whole) <= room or not found else f"✗ {trouble} {SIGN}"


def difference_words(axis: Readout) -> str:
    """`twin +14`, where a twin runs from which the drive does not differ."""
    twin = axis.twin
    if twin is None or twin.predicted is None or twin.diverged is not None:
        return ""
    return f"twin {twin.predicted.difference:+}"
