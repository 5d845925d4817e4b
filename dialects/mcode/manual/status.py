"""A drive's state in words, from the values of P, V, MV, BY, EF and IN."""

from __future__ import annotations

from collections.abc import Sequence

INPUTS = (1, 2, 3, 4)
EXPANDED_INPUTS = (*INPUTS, 9, 10, 11, 12)
"""The inputs of IN, lowest bit first."""
STATUS = ("P", "V", "MV", "BY", "EF", "IN")
"""The words to read for a status, in the order of `in_words`."""


def in_words(
    position: int, velocity: int, moving: int, busy: int, error: int, inputs: int, *, points: Sequence[int] = INPUTS
) -> tuple[str, ...]:
    """Describe P, V, MV, BY, EF and IN, one line for each matter; `points` are the inputs of IN, lowest bit first."""
    return (
        f"moving: V={velocity}, P={position}" if moving or velocity else f"at rest: P={position}",
        "program: running" if busy else "program: none runs",
        "error: set (EF=1); PR ER shows and clears it" if error else "error: none",
        "inputs: " + ", ".join(f"{n} {'high' if inputs >> i & 1 else 'low'}" for i, n in enumerate(points)),
    )
