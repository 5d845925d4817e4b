"""Engineering units: a scale says how far an axis goes in one turn of its motor, or in one of the drive's own counts.

A person writes a quantity (`12.5 mm`, `300 rpm`); a drive takes whole counts of its own. What one count is rests on
settings of the drive (`Basis`), so a `Measure` converts: a scale with the basis as last read. Values are fractions:
nothing is lost but by rounding to a whole count, and a value that rounding spoils is refused. In a scale `turn` is the
motor's turn and `step` the drive's own count. As units `turn` and `rpm` are the load's, `mturn` and `mrpm` the motor's;
these have the drive's own sign and zero.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.text import DECIMAL
from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.state import OfDrive

LENGTH, ANGLE, MOTOR = "length", "angle", "motor"
"""The kinds of units; each own word is a kind of its own."""
TURN, STEP = "turn", "step"
PLACES: Mapping[str, tuple[str, Fraction]] = {
    "m": (LENGTH, Fraction(1)),
    "cm": (LENGTH, Fraction(1, 100)),
    "mm": (LENGTH, Fraction(1, 1000)),
    "um": (LENGTH, Fraction(1, 1_000_000)),
    "in": (LENGTH, Fraction(254, 10_000)),
    "deg": (ANGLE, Fraction(1, 360)),
    "rad": (ANGLE, 1 / (2 * Fraction(math.pi))),
    "turn": (ANGLE, Fraction(1)),
    "mturn": (MOTOR, Fraction(1)),
}
"""Units of places and distances: the kind, and the factor to its base unit (m, turns)."""
TIMES = {"/s": (1, Fraction(1)), "/min": (1, Fraction(1, 60)), "/s2": (2, Fraction(1))}
"""What may follow such a unit: how often it is a distance in a time, and the factor to seconds."""
SHORT = {"rpm": "turn/min", "mrpm": "mturn/min"}
SPOILT = Fraction(1, 100)
"""The greatest part of a value by which rounding to a count may change it."""
DIGITS = 3
"""The least number of digits that a shown value has: typed back, it is not spoilt."""
LOW, HIGH = -(2**31), 2**31 - 1
"""The numbers that every family takes; a word may take fewer, as its drive then says."""
MOST_DECIMAL_PLACES = 16
"""The greatest number of decimal places."""
QUANTITY = re.compile(rf"\{{(?P<number>{DECIMAL}) (?P<unit>[A-Za-z][A-Za-z0-9_/]*)\}}", re.ASCII)
"""A quantity in a line; any other braces are none."""
_VALUE = re.compile(rf"\s*({DECIMAL})\s+(\S+)\s*", re.ASCII)
_SCALE = re.compile(rf"\s*({DECIMAL})\s+([^\s/]+)\s*/\s*(\S+)\s*", re.ASCII)
_TRAVEL = re.compile(rf"\s*({DECIMAL})\s*\.\.\s*({DECIMAL})\s+(\S+)\s*", re.ASCII)
_COMMA = re.compile(r"\d,\d")
_OWN = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
KEYS = ("scale", "zero", "travel", "full_steps")
FULL_STEPS = 200
"""Full steps in a turn of a motor of 1.8 degrees, the usual one."""


class Takes(Enum):
    """What a word of a drive takes, where it takes a quantity. The value names it for a person."""

    PLACE = "a position"
    DISTANCE = "a distance"
    VELOCITY = "a velocity"
    SPEED = "a velocity without sign"
    ACCELERATION = "an acceleration without sign"
    TARGET = "a position or a distance"
    """As a mode of the drive says, which is read."""

    @property
    def per(self) -> int:
        """How often it is a distance in a time: 0, 1, 2."""
        return {Takes.VELOCITY: 1, Takes.SPEED: 1, Takes.ACCELERATION: 2}.get(self, 0)

    @property
    def unsigned(self) -> bool:
        return self in (Takes.SPEED, Takes.ACCELERATION)


EXAMPLES = {0: "{12.5 mm}", 1: "{50 mm/s}", 2: "{2 m/s2}"}


@dataclass(frozen=True)
class Unit:
    """A unit. `factor` leads to its kind's base unit and seconds; `per` as in `Takes`."""

    name: str
    kind: str
    factor: Fraction
    per: int = 0


def unit_of(text: str, own: Sequence[str] = ()) -> Unit:
    """Find a unit by its name. Raises Diagnostic with those that are valid."""
    place, slash, rest = SHORT.get(text, text).partition("/")
    per, factor = TIMES.get(slash + rest, (0, Fraction(1)))
    if bool(slash) == bool(per):
        if place in PLACES:
            kind, size = PLACES[place]
            return Unit(text, kind, size * factor, per)
        if place in own:
            return Unit(text, place, factor, per)
    valid = ", ".join((*PLACES, *own))
    raise Diagnostic(f"no unit {text}", "", f"valid: {valid}, each also with /s, /min or /s2, and {', '.join(SHORT)}")


def check_own(words: Sequence[str]) -> None:
    """Raise Diagnostic for an own unit that no line could name, or that is one already."""
    for word in words:
        if not _OWN.fullmatch(word) or word in PLACES or word in SHORT or word == STEP:
            raise Diagnostic(f"{word!r} is no name of an own unit", "", "valid: letters and digits, and no known unit")


@dataclass(frozen=True)
class Quantity:
    """A number with its unit, as a person writes it."""

    value: Fraction
    unit: Unit

    def __str__(self) -> str:
        return f"{decimal(self.value)} {self.unit.name}"

    @property
    def base(self) -> Fraction:
        """In its kind's base unit and seconds."""
        return self.value * self.unit.factor


def quantity(text: str, own: Sequence[str] = ()) -> Quantity:
    """Read `12.5 mm`. Raises Diagnostic."""
    if _COMMA.search(text):
        raise Diagnostic(f"{text.strip()}: a number has no comma", "", "write 12.5, as in 12.5 mm")
    match = _VALUE.fullmatch(text)
    if match is None:
        raise Diagnostic(f"{text.strip()!r} is no number with a unit", "", "valid: NUMBER SPACE UNIT, as in 12.5 mm")
    return Quantity(Fraction(match[1]), unit_of(match[2], own))


def decimal(value: Fraction, places: int = MOST_DECIMAL_PLACES) -> str:
    """The number with up to so many decimal places, without an exponent and without zeros at its end."""
    whole = round(abs(value) * 10**places)
    text = f"{whole:0{places + 1}}"
    head, tail = (text[:-places], text[-places:].rstrip("0")) if places else (text, "")
    return ("-" if value < 0 and whole else "") + head + ("." + tail if tail else "")


@dataclass(frozen=True)
class Scale:
    """What an axis does for one turn of its motor, or one count: shown = scale x position + zero."""

    value: Fraction
    """In `unit`, signed; never 0."""
    unit: Unit
    of: str
    """TURN or STEP."""
    zero: Fraction = Fraction(0)
    """Where position 0 is, in base units. So are the ends of the travel."""
    travel: tuple[Fraction, Fraction] | None = None
    full_steps: int | None = None
    """Full steps of the motor's turn, where a person gave them."""
    anchored: bool = False
    """It has a zero or a travel: its places are those of the machine, so they need a reference."""

    def __str__(self) -> str:
        return f"{decimal(self.value)} {self.unit.name}/{self.of}"

    @property
    def kind(self) -> str:
        return self.unit.kind

    def shown(self, base: Fraction) -> str:
        """A place in base units, in the scale's unit."""
        return f"{decimal(base / self.unit.factor, 9)} {self.unit.name}"

    @property
    def shown_travel(self) -> str:
        """The travel as it is typed, `0..300 mm`; empty without one."""
        ends = [decimal(end / self.unit.factor) for end in self.travel or ()]
        return f"{'..'.join(ends)} {self.unit.name}" if ends else ""

    def with_zero(self, at: Fraction) -> Scale:
        """The same scale whose position 0 is elsewhere."""
        return Scale(self.value, self.unit, self.of, at, self.travel, self.full_steps, True)


def scale(found: Any, own: Sequence[str] = ()) -> Scale:
    """Read a scale: `5 mm/turn`, or a table with `scale` and what belongs to it. Raises Diagnostic."""
    table = {"scale": found} if isinstance(found, str) else found
    if not isinstance(table, Mapping) or not isinstance(table.get("scale"), str):
        raise Diagnostic("no scale", "", 'valid: "5 mm/turn", or { scale = "5 mm/turn", zero = "120 mm" }')
    for key in table:
        if key not in KEYS:
            raise Diagnostic(f"no key {key}", "", f"valid: {', '.join(KEYS)}")
    text = table["scale"]
    if _COMMA.search(text):
        raise Diagnostic(f"{text}: a number has no comma", "", "write 2.5, as in 2.5 mm/turn")
    match = _SCALE.fullmatch(text)
    if match is None or match[3] not in (TURN, STEP):
        raise Diagnostic(f"{text!r} is no scale", "", "valid: NUMBER UNIT/turn (the motor's) or NUMBER UNIT/step")
    value, unit = Fraction(match[1]), unit_of(match[2], own)
    if unit.kind == MOTOR or unit.per:
        raise Diagnostic(f"{text!r}: {unit.name} is no unit of the load", "", f"valid: {', '.join(_loads(own))}")
    if not value:
        raise Diagnostic(f"{text!r}: the scale is zero", "", "valid: any other number; its sign gives the direction")
    steps = table.get("full_steps")
    if steps is not None and (not isinstance(steps, int) or isinstance(steps, bool) or not 1 <= steps <= 100_000):
        raise Diagnostic(f"full_steps = {steps!r} is not a whole number from 1", "", "200 for a motor of 1.8 degrees")
    zero, travel = table.get("zero"), table.get("travel")
    at = _alike("zero", quantity(_text("zero", zero), own), unit) if zero is not None else Fraction(0)
    ends = _travel(_text("travel", travel), unit, own) if travel is not None else None
    return Scale(value, unit, match[3], at, ends, steps, zero is not None or travel is not None)


def _text(key: str, value: object) -> str:
    if not isinstance(value, str):
        raise Diagnostic(f"{key} = {value!r} has no unit", "", f'as in {key} = "{_FORMS[key]}"')
    return value


_FORMS = {"zero": "120 mm", "travel": "0..300 mm"}


def _travel(text: str, unit: Unit, own: Sequence[str]) -> tuple[Fraction, Fraction]:
    match = _TRAVEL.fullmatch(text)
    if match is None:
        raise Diagnostic(f"travel = {text!r} is no range", "", "valid: LOW..HIGH UNIT with points, as in 0..300 mm")
    low, high = (_alike("travel", quantity(f"{match[end]} {match[3]}", own), unit) for end in (1, 2))
    if low >= high:
        raise Diagnostic(f"travel = {text!r} ends where it begins, or before", "", "write the lower end first")
    return low, high


def _alike(key: str, given: Quantity, unit: Unit) -> Fraction:
    """The base value of a place of the scale's kind."""
    if given.unit.kind != unit.kind or given.unit.per:
        valid = [name for name, (kind, _) in PLACES.items() if kind == unit.kind] or [unit.name]
        raise Diagnostic(f"{key} = {given}: the scale is in {unit.name}", "", f"valid: {', '.join(valid)}")
    return given.base


def _loads(own: Sequence[str]) -> tuple[str, ...]:
    return (*(name for name, (kind, _) in PLACES.items() if kind != MOTOR), *own)


Settings = tuple[tuple[str, str], ...]
"""Names and values."""


@dataclass(frozen=True)
class Basis:
    """What the counting of an axis rests on, as read from its drive."""

    settings: Settings = ()
    """Names and values; where one differs later, no quantity is sent."""
    turn: Fraction | None = None
    """Counts of one turn of the motor; None where nothing tells."""
    speed: Fraction | None = Fraction(1)
    """The drive's unit of velocity for 1 count/s; None: not known."""
    acceleration: Fraction | None = Fraction(1)
    """The same of acceleration, for 1 count/s2."""
    assumed: str = ""
    """What no reading shows, for a person."""
    missing: str = ""
    """Why `turn` is not known, for a person."""

    def __str__(self) -> str:
        return ", ".join(f"{name}={value}" for name, value in self.settings)


@dataclass(frozen=True)
class Measure:
    """A scale with what it rests on: quantities to the drive's own whole numbers and back."""

    scale: Scale
    basis: Basis

    def __post_init__(self) -> None:
        """Raise Diagnostic where the scale is by the turn and nothing tells how many counts that has."""
        if self.scale.of == TURN and not self.basis.turn:
            raise Diagnostic(f"the scale {self.scale} is by the motor's turn: {self.basis.missing}", "", BY_STEP)

    @cached_property
    def count(self) -> Fraction:
        """Base units of one count, signed."""
        by = self.basis.turn if self.scale.of == TURN else None
        return self.scale.value * self.scale.unit.factor / (by or 1)

    def native(self, given: Quantity, takes: Takes) -> int:
        """The drive's number for a quantity. Raises Diagnostic where it cannot be that, or rounding spoils it."""
        count, zero = self._factors(given, takes)
        number = round((given.base - zero) / count)
        if not LOW <= number <= HIGH:
            raise Diagnostic(f"{given} is {number} for the drive", "", f"its numbers go from {LOW} to {HIGH}")
        back = number * count + zero
        if given.value and abs(back - given.base) > SPOILT * abs(given.base):
            near = f"{decimal(back / given.unit.factor, 9)} {given.unit.name}"
            one = f"{decimal(abs(count) / given.unit.factor, 9)} {given.unit.name}"
            raise Diagnostic(f"{given} would be {near} after rounding", "", f"one step of the drive is {one}")
        return number

    def number(self, given: Quantity, takes: Takes) -> float:
        """The same without rounding, to be compared with a number of the drive. Raises Diagnostic."""
        count, zero = self._factors(given, takes)
        return float((given.base - zero) / count)

    def base(self, number: float, takes: Takes, one: Quantity) -> Fraction:
        """A number of the drive in a unit, of which `one` is 1. Raises Diagnostic for one of another kind."""
        count, zero = self._factors(one, takes)
        return (Fraction(number) * count + zero) / one.base

    def _factors(self, given: Quantity, takes: Takes) -> tuple[Fraction, Fraction]:
        """The drive's unit, and its zero, in the base unit of a quantity's kind. Raises Diagnostic."""
        if given.unit.per != takes.per:
            other = ("a distance", "a velocity", "an acceleration")[given.unit.per]
            raise Diagnostic(f"{given} is {other}, not {takes.value}", "", f"as in {EXAMPLES[takes.per]}")
        if takes.unsigned and given.value < 0:
            raise Diagnostic(f"{given}: it takes {takes.value}", "", "the direction is that of the move")
        count = self._count_of(given, takes) / self._rate(takes.per)
        zero = self.scale.zero if takes is Takes.PLACE and given.unit.kind == self.scale.kind else Fraction(0)
        return (abs(count) if takes.unsigned else count), zero

    def _count_of(self, given: Quantity, takes: Takes) -> Fraction:
        """One count in the base unit of a quantity's kind."""
        if given.unit.kind == self.scale.kind:
            return self.count
        if given.unit.kind != MOTOR:
            turns = f"; {'m' + given.unit.name} is the motor's" if given.unit.name in ("turn", "rpm") else ""
            valid = f"valid: {self.unit}{('', '/s', '/s2')[takes.per]} and units of its kind{turns}"
            raise Diagnostic(f"{given}: the scale of the axis is {self.scale}", "", valid)
        if not self.basis.turn:
            raise Diagnostic(f"{given} is the motor's: {self.basis.missing}", "", BY_STEP)
        if takes is Takes.PLACE and self.scale.zero:
            raise Diagnostic(f"{given}: positions of the axis have a zero of their own", "", f"use {self.unit}")
        return 1 / self.basis.turn

    def _rate(self, per: int) -> Fraction:
        rate = (Fraction(1), self.basis.speed, self.basis.acceleration)[per]
        if rate is None:
            raise Diagnostic(f"the drive counts velocities in units of its own ({self.basis})", "", "use its numbers")
        return rate

    def counts(self, takes: Takes) -> bool:
        """Whether numbers of this sort can be converted."""
        return (True, self.basis.speed is not None, self.basis.acceleration is not None)[takes.per]

    # The drive's own numbers, shown

    @property
    def unit(self) -> str:
        return self.scale.unit.name

    def value(self, number: float, takes: Takes = Takes.PLACE) -> float:
        """A number of the drive in the scale's unit, for curves and files."""
        factor, zero = self._floats[takes]
        return number * factor + zero

    @cached_property
    def _floats(self) -> dict[Takes, tuple[float, float]]:
        units = self.scale.unit.factor
        return {
            takes: (float(self._signed(takes) / units), float(self.scale.zero / units) if takes is Takes.PLACE else 0.0)
            for takes in Takes
            if self.counts(takes)
        }

    def _signed(self, takes: Takes) -> Fraction:
        count = self.count / self._rate(takes.per)
        return abs(count) if takes.unsigned else count

    def exact(self, number: float, takes: Takes = Takes.PLACE) -> Fraction:
        """A number of the drive in base units."""
        return Fraction(number) * self._signed(takes) + (self.scale.zero if takes is Takes.PLACE else 0)

    def shown(self, number: float, takes: Takes = Takes.PLACE) -> str:
        """A number of the drive with its unit; in braces it gives the same number again."""
        value = self.exact(number, takes) / self.scale.unit.factor
        one = abs(self._signed(takes)) / self.scale.unit.factor
        needed = max(_places(one) + 1, _places(abs(value)) + DIGITS - 1 if value else 0, 0)
        return f"{decimal(value, min(needed, MOST_DECIMAL_PLACES))} {self.unit_for(takes)}"

    def unit_for(self, takes: Takes) -> str:
        return self.unit + ("", "/s", "/s2")[takes.per]

    def steps(self, given: Quantity) -> float:
        """A place of the world in motor steps from its origin, by the scale without its zero."""
        return float(given.base / self._count_of(given, Takes.DISTANCE))


BY_STEP = "give the scale by the step, as in 0.4 um/step, or full_steps"


def strange_brace(text: str) -> str:
    """The first brace of a line, with what it encloses, that is of no quantity; empty: there is none.

    What is in quotation marks is a text. No language of a drive has braces.
    """
    bare = QUANTITY.sub("", re.sub(r'"[^"]*(?:"|$)', '""', text))
    match = re.search(r"\{[^{}]*\}?|\}", bare)
    return match[0].strip() if match is not None else ""


def unsendable(text: str) -> str:
    """The reason for which a line with braces must not go to a drive as it is; empty: its braces are in a text."""
    for match in quantities(text):
        return f"{match[0]} is not converted here"
    brace = strange_brace(text)
    return f"{brace} is not a quantity" if brace else ""


def _places(value: Fraction) -> int:
    """Decimal places that the first digit of a value has; negative for whole numbers of several digits."""
    return -math.floor(math.log10(value))


def quantities(text: str) -> Iterator[re.Match[str]]:
    """Find the quantities of a line, outside quotation marks."""
    quoted = [match.span() for match in re.finditer(r'"[^"]*("|$)', text)]
    for match in QUANTITY.finditer(text):
        if not any(low < match.start() < high for low, high in quoted):
            yield match


def with_numbers(text: str) -> str:
    """The line with a number in place of each quantity, to be read by its grammar before it is converted."""
    for match in reversed(list(quantities(text))):
        text = f"{text[: match.start()]}1{text[match.end() :]}"
    return text


# What the lines of a family take.


VALUE = r"(\{[^{}]*\}|[+-]?\d+)"
"""A quantity or a whole number, in the pattern of a line that takes either."""


class Field(NamedTuple):
    """A place in a line that takes a quantity. `moves`: the axis goes there, or that far."""

    axis: str
    takes: Takes
    start: int
    stop: int
    moves: bool = False


class Units(OfDrive):
    """The quantities in the lines of a family, and what the counting of an axis rests on. By default there are none."""

    words: ClassVar[str] = ""
    """The words that take one, for a person."""

    def axes(self) -> Sequence[str]:
        """The axes of the drive, as in `Motion.axis`."""
        return ("",)

    def fields(self, text: str) -> Sequence[Field]:
        """The places of a line that take a quantity; a whole number in them is found, too."""
        return ()

    def basis(self, axis: str, full_steps: int | None) -> Procedure[Basis]:
        """Read what the counting of an axis rests on. `full_steps`: of a turn, where a person gave them."""
        return Basis(missing="nothing tells how it counts")
        yield  # a conversation

    def disturbs(self, text: str) -> Collection[str]:
        """The axes whose positions may count from elsewhere, or otherwise, after a line."""
        return ()

    def recounts(self, request: Request) -> bool:
        """Whether a request, once executed, may change what the counting of an axis rests on."""
        return False

    def reads(self, text: str) -> tuple[str, Takes] | None:
        """What a question prints: its axis, and how that counts; None: no quantity."""
        return None

    def setting(self, name: str) -> tuple[str, Takes] | None:
        """What a setting holds: its axis, and how that counts; None: no quantity. Else as the line that sets it."""
        return None

    def setting_name(self, axis: str, name: str) -> str:
        """The name among the settings of a drive of one that the counting of an axis rests on."""
        return name

    def target(self) -> Procedure[Takes]:
        """Read what a field of `Takes.TARGET` means now."""
        return Takes.PLACE
        yield
