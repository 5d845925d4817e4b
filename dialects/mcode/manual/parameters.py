"""The settings of each MCode product: what S keeps, how PR prints it, and what cannot be read.

Counters, armed trips and error flags are states of the moment and no settings: S does not keep them (MCode reference
5.1.113). A product refuses a word that it lacks, and a refusal runs a resident OE subroutine, so the list of a product
has the words of its table only, and those of firmware 6 only from that firmware on.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from multidrop.dialects.mcode.manual.mnemonic import CLOSED_LOOP, ENCODER, EVERY, LEXIUM, MDRIVE_ENCODER, Mnemonic
from multidrop.dialects.mcode.manual.table import words
from multidrop.dialects.mcode.manual.table_system import COMMUNICATION
from multidrop.dialects.parameters import IO, PARAMETERS, VARIABLES, Reading, Value

WIRE = frozenset(row.name for row in COMMUNICATION)
"""Communication settings."""
STATES = frozenset({"C1", "C2", "ER", "IF", "P", "ST", "TE"})
"""Words that can be written and are no settings."""
LISTS = {"IS": (1, 2, 3, 4, 6), "OS": (1, 2, 3), "LS": (0, 1)}
"""The words whose PR prints a line for each number, and those numbers."""
COUNTED = frozenset({"A", "D", "VI", "VM", "MS"})
"""Settings with another value while the unit of motion is the encoder count (7.3.7)."""
TRIPS = frozenset({"TA", "TC", "TI", "TM", "TP", "TR", "TT"})
UNIT = frozenset({"FS", "PW"})
"""Settings of the motor unit itself, which FD keeps (5.1.45)."""
FIRMWARE_6 = frozenset(
    {"AJ", "AT", "BE", "BL", "BM", "DJ", "DT", "FL", "FM", "FS", "LS", "PF", "RA", *(f"F{n}" for n in range(1, 9))}
)
SMALL = frozenset({"D4", "FC", "TC"})
"""Words of inputs that a NEMA 17 lacks."""
ANALOG_UNREAD = ("IS5", "PR IS does not print it")
HANDLER_UNREAD = ("OE", "no drive prints it")
_SMALL_PART = re.compile(r"<?LMD[A-Z]{2}42")
_VERSION = re.compile(r"LM\w+ (\d+)")


class Form(Enum):
    """How PR prints a setting, as a regular expression."""

    DIGIT = r"\d"
    WHOLE = r"-?\d{1,10}"
    FRACTION = r" *-?\d+(?:\.\d*)?(?:[Ee][+-]?\d+)? *"
    FIELDS = r" *-?\d+(?: *, *-?\d+)+"
    TRIP = r"-?[A-Z0-9]+(?: *, *-?[A-Z0-9]+)*"


@dataclass(frozen=True)
class Setting:
    """A setting that PR prints beside others on one line."""

    row: Mnemonic
    form: Form

    @property
    def name(self) -> str:
        """The word."""
        return self.row.name


def exact(product: str) -> bool:
    """Whether a product has a table of its own; others get the words of every Lexium."""
    return product in EVERY


@lru_cache(maxsize=64)
def settings(product: str, version: str = "", part: str = "") -> tuple[Setting, ...]:
    """The settings that a drive prints beside others, in the order of their forms."""
    lacks, forms = _lacking(version, part), list(Form)
    rows = [row for row in words(product).values() if _settable(row, product) and row.name not in lacks]
    return tuple(sorted((Setting(row, form_of(row)) for row in rows), key=lambda each: forms.index(each.form)))


def lists(product: str, version: str = "") -> dict[str, tuple[int, ...]]:
    """The words of a drive that print a line for each number; input 6 is the index mark of an encoder."""
    if product not in LEXIUM and exact(product):
        return {}
    lacks = _lacking(version, "")
    return {
        word: tuple(n for n in numbers if (word, n) != ("IS", 6) or product in ENCODER)
        for word, numbers in LISTS.items()
        if word not in lacks
    }


def unread(product: str) -> tuple[tuple[str, str], ...]:
    """The settings of a product that it does not print."""
    if not exact(product):
        return (HANDLER_UNREAD, ("other words", f"the product '{product}' is not known: every Lexium has these words"))
    return (HANDLER_UNREAD, *((ANALOG_UNREAD,) if product in LEXIUM - {"LMM"} else ()))


def has_encoder(product: str) -> bool:
    """Whether EE is a word of a product."""
    return product in ENCODER | MDRIVE_ENCODER


def counting(values: Mapping[str, Value | None]) -> bool:
    """Whether the unit of motion is the encoder count: EE=1, and no hMT (3.4.2)."""
    return bool(values.get("EE")) and not values.get("AS")


def locks_resolution(product: str) -> bool:
    """Whether MS is locked while the unit of motion is the encoder count (7.3.7)."""
    return product in CLOSED_LOOP | MDRIVE_ENCODER


def fresh(name: str) -> Value | None:
    """The default of a set-up; None for any other word."""
    special: dict[str, Value] = {"S5": (9, 0), "S7": (33, 0), "S8": (33, 0), "S13": (60, 0), "PF": (10, 6, 0, 0)}
    if name in special:
        return special[name]
    if name in TRIPS:
        return 0
    if re.fullmatch(r"S\d+", name):
        return (0, 0, 0)
    found = re.fullmatch(r"(IS|OS|LS)\d", name)
    return None if found is None else {"IS": (0, 0), "OS": (16, 0), "LS": (0, 0)}[found[1]]


def section(name: str) -> str:
    """The part of a drive's settings to which a word belongs."""
    if re.fullmatch(r"[RF]\d", name):
        return VARIABLES
    return IO if name in TRIPS or re.fullmatch(r"(?:IS|OS|S)\d+", name) else PARAMETERS


def fixed(name: str) -> bool:
    """Whether a word is only written when a person names it."""
    return name in WIRE or name in UNIT


def reading_of(name: str, value: Value, row: Mnemonic | None, counts: bool) -> Reading:
    """Put section, unit and default to a value. `counts`: the unit of motion is the encoder count."""
    default, unit = fresh(name), ""
    if row is not None:
        unit = (counts and row.unit_encoder) or row.unit
        if default is None:
            default = row.default_encoder if counts and row.default_encoder is not None else row.default
    return Reading(name, value, section(name), unit, default, fixed(name))


def _settable(row: Mnemonic, product: str) -> bool:
    has = product in row.products if exact(product) else row.products >= LEXIUM
    kept = row.access == "RW" and row.kind in ("variable", "flag")
    return has and kept and not row.lines and row.name not in STATES | {"DN"}


def _lacking(version: str, part: str) -> frozenset[str]:
    """The words that a drive of this firmware and size lacks."""
    found = _VERSION.match(version)
    older = FIRMWARE_6 if found and int(found[1]) < 6 else frozenset()
    return older | (SMALL if _SMALL_PART.match(part) else frozenset())


def form_of(row: Mnemonic) -> Form:
    """How PR prints a word."""
    if row.name in TRIPS:
        return Form.TRIP
    if row.low is None:
        return Form.FIELDS
    if isinstance(row.default, float):
        return Form.FRACTION
    small = isinstance(row.high, int) and row.low >= 0 and row.high <= 9
    return Form.DIGIT if small else Form.WHOLE
