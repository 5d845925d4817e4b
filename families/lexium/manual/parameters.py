"""The settings of each MCode product: what S keeps, how PR prints it, and what cannot be read.

Counters, armed trips and error flags are states of the moment and no settings: S does not keep them (MCode reference
5.1.113). A product refuses a word that it lacks, and a refusal runs a resident OE subroutine, so the list of a product
has the words of its table only, and those of firmware 6 only from that firmware on.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from enum import Enum
from functools import lru_cache
from math import isfinite

from multidrop.dialects.values import IO, PARAMETERS, VARIABLES, Reading, Scalar, Value
from multidrop.families.lexium.manual.groups import LISTS, STATES, TRIPS, UNIT, WIRE
from multidrop.families.lexium.manual.mnemonic import (
    CLOSED_LOOP,
    ENCODER,
    EVERY,
    FLOAT_HIGH,
    LEXIUM,
    MDRIVE_ENCODER,
    Mnemonic,
)
from multidrop.families.lexium.manual.point_types import FRESH
from multidrop.families.lexium.manual.supported import lacks
from multidrop.families.lexium.manual.table import MNEMONICS, lookup, words
from multidrop.families.lexium.manual.value_forms import value_form

ANALOG_UNREAD = ("IS5", "PR IS does not print it")
HANDLER_UNREAD = ("OE", "no drive prints it")


class SettingForm(Enum):
    """How PR prints a setting, as a regular expression."""

    DIGIT = r"\d"
    WHOLE = r"-?\d{1,10}"
    FRACTION = r" *-?\d+(?:\.\d*)?(?:[Ee][+-]?\d+)? *"
    FIELDS = r" *-?\d+(?: *, *-?\d+)+"
    TRIP = r"-?[A-Z0-9]+(?: *, *-?[A-Z0-9]+)*"


@lru_cache(maxsize=64)
def settings(product: str, version: str = "", part: str = "") -> tuple[Mnemonic, ...]:
    """The settings that a drive prints beside others, in the order of their forms."""
    lacks, forms, known = _lacking(version, part) | STATES | {"DN"}, list(SettingForm), product in EVERY
    rows = [row for row in words(product).values() if row.access == "RW" and row.valued]
    rows = [row for row in rows if (product in row.products if known else row.products >= LEXIUM)]
    rows = [row for row in rows if not row.lines and row.name not in lacks]
    return tuple(sorted(rows, key=lambda row: forms.index(form_of(row))))


def lists(product: str, version: str = "") -> dict[str, tuple[int, ...]]:
    """The words of a drive that print a line for each number; input 6 is the index mark of an encoder."""
    if product not in LEXIUM and product in EVERY:
        return {}
    lacks = _lacking(version, "")
    return {
        word: tuple(n for n in numbers if (word, n) != ("IS", 6) or product in ENCODER)
        for word, numbers in LISTS.items()
        if word not in lacks
    }


def unread(product: str) -> tuple[tuple[str, str], ...]:
    if product not in EVERY:
        return (HANDLER_UNREAD, ("other words", f"the product '{product}' is not known: every Lexium has these words"))
    return (HANDLER_UNREAD, *((ANALOG_UNREAD,) if product in LEXIUM - {"LMM"} else ()))


def counting(values: Mapping[str, Value | None]) -> bool:
    """Whether the unit of motion is the encoder count: EE=1, and no hMT (3.4.2)."""
    return bool(values.get("EE")) and not values.get("AS")


def locks_resolution(product: str) -> bool:
    """Whether MS is locked while the unit of motion is the encoder count (7.3.7)."""
    return product in CLOSED_LOOP | MDRIVE_ENCODER


def fresh(name: str) -> Value | None:
    """The default of a set-up; None for any other word."""
    if name in FRESH:
        return FRESH[name]
    if name in TRIPS:
        return 0
    if POINT.fullmatch(name):
        return (0, 0, 0)
    match = _SETUP.fullmatch(name)
    if match is not None:
        return (16, 0) if match[1] == "OS" else (0, 0)
    default = MNEMONICS[name].default if name in MNEMONICS else None
    return tuple(map(int, default.split(","))) if isinstance(default, str) and "," in default else None


def section(name: str) -> str:
    """The part of a drive's settings to which a word belongs."""
    if re.fullmatch(r"[RF]\d", name):
        return VARIABLES
    return IO if name in TRIPS or re.fullmatch(r"(?:IS|OS|S)\d+", name) else PARAMETERS


def reading_of(name: str, value: Value, row: Mnemonic | None, counts: bool) -> Reading:
    """Put section, unit and default to a value. `counts`: the unit of motion is the encoder count."""
    default, unit, value = fresh(name), "", whole_setup(name, value)
    if row is not None:
        unit = (counts and row.unit_encoder) or row.unit
        if default is None:
            default = row.default_encoder if counts and row.default_encoder is not None else row.default
    return Reading(name, value, section(name), unit, default, name in WIRE | UNIT)


def whole_setup(name: str, value: Value) -> Value:
    """The three fields of S13, of which the manual prints two."""
    return (*value, 0) if name == "S13" and isinstance(value, tuple) and len(value) == 2 else value


def _lacking(version: str, part: str) -> frozenset[str]:
    """The words that a Lexium of this firmware and size lacks."""
    return frozenset(name for name, row in MNEMONICS.items() if lacks(row, version, part))


def form_of(row: Mnemonic) -> SettingForm:
    if row.name in TRIPS:
        return SettingForm.TRIP
    if row.low is None:
        return SettingForm.FIELDS
    if isinstance(row.default, float):
        return SettingForm.FRACTION
    small = isinstance(row.high, int) and row.low >= 0 and row.high <= 9
    return SettingForm.DIGIT if small else SettingForm.WHOLE


# The rules for writing one setting of an MCode drive: the line, its range, and what needs a person's word.
#
# A plain restore leaves alone what can move the motor or start a program by itself, what belongs to the motor unit,
# and what sets up communication. `risk` of the plan gives the reason. (MCode reference, section 5; docs/rulings.md.)


TORQUE = 3
"""The hMT mode that turns the motor by itself."""
GO, JOG_PLUS, JOG_MINUS, RESET = 4, 7, 8, 11
"""Types of inputs that start a program, turn the motor, or restart the drive."""
CLOCKS = frozenset({13, 14, 15, 33, 34, 35, 49, 50, 51})
"""Types of points that are a clock; both points of a pair have one."""
SHARED = frozenset({0, 16}) | CLOCKS
"""Types that several points may have."""
LONGEST_NUMBER = 40
_SETUP = re.compile(r"(IS|OS|LS)(\d)")
POINT = re.compile(r"S\d+")


def row_of(name: str, product: str) -> Mnemonic | None:
    """The row of a setting's word; `IS1` is a setting of IS. None for a user's variable."""
    match = _SETUP.fullmatch(name)
    return lookup(match[1] if match else name, product if product in EVERY else "")


def line(name: str, value: Value, new: bool = False) -> str:
    """The line that gives a setting a value; `new`: a user's variable that the drive lacks."""
    match = _SETUP.fullmatch(name)
    if match is not None:
        return f"{match[1]}={match[2]},{_fields(value)}"
    if name == "DN":
        return f'DN="{value}"'
    return f"{'VA ' if new else ''}{name}={_fields(value)}"


def _fields(value: Value) -> str:
    return ",".join(map(_scalar, value if isinstance(value, tuple) else (value,)))


def _scalar(value: Scalar) -> str:
    if not isinstance(value, float):
        return str(value)
    text = repr(value)
    return f"{value:.17f}".rstrip("0") if "e" in text and abs(value) < 1 else text


def checked(name: str, value: Value, product: str, counts: bool, labels: Collection[str]) -> Value:
    """Return the value as the drive takes it. Raises Diagnostic for a value out of range."""
    row, value = row_of(name, product), whole_setup(name, value)
    if isinstance(value, float) and value.is_integer() and not (row is not None and isinstance(row.default, float)):
        value = int(value)
    value_form(name, row, product, counts, labels).check(value)
    return value


def writable(value: Value) -> bool:
    """Whether a drive's line can hold a number of this size."""
    exact = value if isinstance(value, float) else 0.0
    return isfinite(exact) and abs(exact) <= FLOAT_HIGH and len(_scalar(exact)) <= LONGEST_NUMBER
