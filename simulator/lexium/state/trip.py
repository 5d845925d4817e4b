"""What a trip waits for, and the subroutine that it calls (manual 5.1.122 to 5.1.132)."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.dialects.mcode.manual.grammar import Argument


class Trip(NamedTuple):
    """What one trip waits for (input, position, ms, distance or mask), its target, and how often it repeats."""

    value: int
    target: Argument | None
    repeats: int = 0
