"""Amounts that a person types on a page: in a unit, as `1 mm`, `1mm` or `{1 mm}`, or as the drive counts, `10240`.

An amount in a unit stays one in the line that is sent, so the drive's settings are read again right before the line.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import DECIMAL
from multidrop.dialects.units import HIGH, LOW, Measure, Quantity, Takes, decimal, quantity

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.units import SessionUnits

_AMOUNT = re.compile(rf"({DECIMAL})\s*([A-Za-z][\w/]*)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)
_LEVELS = range(-6, 10)
"""The powers of ten among which a longer and a shorter amount are found."""


@dataclass(frozen=True)
class Amount:
    """A number of the drive, and the quantity that a person gave for it, if it was one."""

    number: int
    given: Quantity | None = None

    @property
    def typed(self) -> str:
        """As a person types it: `1 mm`, `10240`."""
        return str(self.given) if self.given is not None else str(self.number)

    @property
    def text(self) -> str:
        """As it is written in a line: `{1 mm}`, `10240`."""
        return f"{{{self.given}}}" if self.given is not None else str(self.number)

    def times(self, sign: int) -> Amount:
        """The same amount with its sign, or with the other one for -1."""
        given = self.given
        return Amount(sign * self.number, Quantity(sign * given.value, given.unit) if given is not None else None)

    def level(self, by: int) -> str:
        """The next power of ten above (1) or below (-1), with the same unit, as typed; itself at the ends."""
        value = self.given.value if self.given is not None else Fraction(self.number)
        sizes = [Fraction(10) ** n for n in _LEVELS if n >= 0 or self.given is not None]
        wanted = [size for size in sizes if size > value][:1]
        if by < 0:
            wanted = [size for size in sizes if size < value][-1:]
        unit = f" {self.given.unit.name}" if self.given is not None else ""
        return f"{decimal(wanted[0])}{unit}" if wanted else self.typed


class AmountReader:
    """Reads amounts for one axis of a drive. `counts`: what the drive's own numbers are, as in `steps`."""

    def __init__(self, units: SessionUnits, drive: Drive, axis: str, counts: str) -> None:
        self._units, self._drive, self._axis, self._counts = units, drive, axis, counts
        scaled = units.of(drive, axis)
        self.measure: Measure | None = scaled.current if scaled is not None else None
        """None: the axis has no scale, or none that can be used now."""
        self._missing = "the axis has no scale" if scaled is None else scaled.problem or "its scale does not hold"

    def unit(self, takes: Takes) -> str:
        """The unit that a person would give; empty: only the drive's own numbers can be given."""
        measure = self.measure
        return measure.unit_for(takes) if measure is not None and measure.counts(takes) else ""

    def asks(self, takes: Takes) -> str:
        """What can be typed, with an example: `mm or steps, such as 1 mm or 10240`."""
        counts = self.counts(takes)
        unit = self.unit(takes)
        return f"{unit} or {counts}, such as 1 {unit} or 10240" if unit else f"{counts}, such as 10240"

    def counts(self, takes: Takes) -> str:
        """What the drive's own numbers are."""
        return self._counts + ("", "/s", "/s2")[takes.per]

    def read(self, text: str, takes: Takes) -> Amount:
        """Read what a person typed. Raises Diagnostic with one line that says what is wrong."""
        bare = text.strip()
        if bare.startswith("{") and bare.endswith("}"):
            bare = bare[1:-1].strip()
        if not bare:
            raise Diagnostic("nothing was typed", "", f"type {self.asks(takes)}")
        if re.search(r"\d,\d", bare):
            raise Diagnostic(f"{bare[:20]}: a number has no comma", "", "write 12.5, as in 12.5 mm")
        match = _AMOUNT.fullmatch(bare)
        if match is None:
            raise Diagnostic(f"{bare[:20]} is no number with a unit", "", f"type {self.asks(takes)}")
        counts = self.counts(takes)
        if match[2] is None or match[2] in (counts, counts.removesuffix("s")):
            return self._own(match[1], takes)
        return self._converted(match[1], match[2], takes)

    def _own(self, text: str, takes: Takes) -> Amount:
        if not _WHOLE.fullmatch(text):
            raise Diagnostic(f"{text} has no unit, and {self.counts(takes)} are whole", "", f"type {self.asks(takes)}")
        number = int(text)
        if not LOW <= number <= HIGH:
            raise Diagnostic(f"{number} is out of range", "", f"valid: {LOW} to {HIGH}")
        if takes.unsigned and number < 0:
            raise Diagnostic(f"{number}: it takes {takes.value}")
        return Amount(number)

    def _converted(self, number: str, unit: str, takes: Takes) -> Amount:
        given = quantity(f"{number} {unit}", self._units.own)
        if self.measure is None:
            raise Diagnostic(f"{given}: {self._missing}", "", f"type {self.counts(takes)}, or give it a scale: /setup")
        if takes is Takes.PLACE and not self._units.referenced(self._drive, self._axis):
            raise Diagnostic(f"{given}: the position is not referenced", "", f"home it, or type {self.counts(takes)}")
        return Amount(self.measure.native(given, takes), given)

    def other(self, amount: Amount, takes: Takes) -> str:
        """The amount the other way: in the drive's own numbers, or in the unit; empty where there is no unit."""
        if amount.given is not None:
            return f"{amount.number} {self.counts(takes)}"
        measure = self.measure
        return measure.shown(amount.number, takes) if measure is not None and measure.counts(takes) else ""
