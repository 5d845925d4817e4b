"""The options that `/plot` and `multidrop plot` share: each is declared here, and used by what it changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from multidrop.base.errors import Diagnostic
from multidrop.base.text import real
from multidrop.shell.operations.parameter import Argument

MAX = "max"
SLOWEST = 0.01
"""The lowest rate, samples a second."""


@dataclass(frozen=True, kw_only=True)
class PlotOptions:
    """How a plot reads. Raises Diagnostic for a wrong rate."""

    rate: Annotated[
        str | None,
        Argument(
            "samples a second of each drive, at most (default: 50); max: as fast as the line allows",
            metavar="N|max",
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.rate in (None, MAX):
            return
        from multidrop.drives.telemetry import SHORTEST_PERIOD

        if not SLOWEST <= (real(self.rate or "") or 0.0) <= 1 / SHORTEST_PERIOD:
            valid = f"valid: {SLOWEST:g} to {1 / SHORTEST_PERIOD:g} samples a second of each drive, or {MAX}"
            raise Diagnostic(f"invalid rate {self.rate!r}", "--rate", valid)

    @property
    def period(self) -> float:
        """The time between two samples of a drive, s; 0: as fast as the line allows."""
        if self.rate is None:
            from multidrop.drives.telemetry import MODEST

            return MODEST
        return 0.0 if self.rate == MAX else 1 / float(self.rate)

    @property
    def shown(self) -> str:
        from multidrop.drives.telemetry import SHORTEST_PERIOD

        if self.period <= SHORTEST_PERIOD:
            return "as fast as the line allows"
        return f"at most {1 / self.period:g} samples a second of each drive"
