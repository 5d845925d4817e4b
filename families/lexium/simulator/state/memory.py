"""Working memory of a simulated MCode drive, the ranges of its words, its units of motion, and what NVM keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument
from multidrop.families.lexium.manual.groups import BANKED, COUNTED, STATES, UNIT
from multidrop.families.lexium.manual.mnemonic import Mnemonic
from multidrop.families.lexium.manual.table import lookup, words
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.expressions import Value, whole
from multidrop.families.lexium.simulator.state.models import MODELS
from multidrop.families.lexium.simulator.state.program_memory import ProgramContents


class Trip(NamedTuple):
    """What one trip waits for (input, position, ms, distance or mask), its target, and how often it repeats."""

    value: int
    target: Argument | None
    repeats: int = 0


STATOR_BOUNDS = (1.1, 1.3, 1.5, 1.7)
"""Full steps between rotor and stator, by CB (manual 5.1.18)."""
TABLE_SIZE = 192
"""Labels and user variables together (manual 3.3.1)."""
ENCODER_MS = 256
"""MS of all but an LMM while it counts (manual 7.3.7)."""


@dataclass
class NonVolatileMemory:
    """Everything that NVM keeps (manual 5.1.113)."""

    values: dict[str, Value] = field(default_factory=dict)
    bank: dict[str, Value] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    users: dict[str, Value] = field(default_factory=dict)
    inputs: dict[int, tuple[int, ...]] = field(default_factory=dict)
    outputs: dict[int, tuple[int, ...]] = field(default_factory=dict)
    limits: dict[int, tuple[int, ...]] = field(default_factory=dict)
    trips: dict[int, Trip] = field(default_factory=dict)
    program: ProgramContents = field(default_factory=ProgramContents)


def slot(name: str) -> str:
    """The key of a user's variable, which differs from a word of another product."""
    return name.lower() if lookup(name) else name


@lru_cache
def _factory_values(product: str) -> Mapping[str, Value]:
    """The values of a product's variables and flags from the factory."""
    values: dict[str, Value] = {}
    for name, row in words(product).items():
        ranged = row.kind in ("variable", "flag") and (row.values or row.low is not None)
        if ranged and product in row.products:
            values[name] = row.default if isinstance(row.default, (int, float)) else 0
    return values


@lru_cache(maxsize=4096)
def row_of(word: str, product: str) -> Mnemonic | None:
    """The table's row of a word that a product knows; None where it is a free name. Raises DriveFault (37)."""
    row = lookup(word, product)
    if row is not None and product not in row.products:
        raise DriveFault(E.NOT_AVAILABLE)
    return row


def within(value: Value, low: Value, high: Value) -> Value:
    """A value in a range. Raises DriveFault (21)."""
    if not low <= value <= high:
        raise DriveFault(E.OUT_OF_RANGE)
    return value


class Memory:
    """Values by name, mnemonics and user variables alike: the one dictionary that compiled lines read and write.

    `scopes` gives the user's names: G for global ones, L for those that a program declared. `bank` holds
    the values of A, D, VI and VM for the state of EE that is not in force. `texts` are settings that are not numbers.
    `awaited` is the variable for which IV waits.
    """

    def __init__(self, product: str) -> None:
        self.product, self.model = product, MODELS[product]
        self.words = words(product)
        self.values: dict[str, Value] = {}
        self.bank: dict[str, Value] = {}
        self.texts: dict[str, str] = {}
        self.scopes: dict[str, str] = {}
        self.awaited = ""
        self.defaults()

    def defaults(self) -> None:
        """Reset everything to factory defaults, and delete user variables."""
        kept = {name: self.values[name] for name in UNIT if name in self.values}
        self.values.clear()
        self.scopes.clear()
        self.values.update(_factory_values(self.product))
        self.values.update(kept)
        self.bank = {name: self.words[name].default_encoder or 0 for name in BANKED}
        self.bank["MS"] = ENCODER_MS
        self.texts = {"DN": "!", "PF": "", "MD": "MA"}

    # Units of motion: motor steps, or encoder counts (manual 3.4.2).

    @property
    def counting(self) -> bool:
        """Return whether motion is in encoder counts: EE=1, and no hMT (manual 3.4.2)."""
        return bool(self.values.get("EE")) and not self.values.get("AS")

    @property
    def steps(self) -> dict[str, Value]:
        """A, D, VI, VM and MS in motor steps, whether they are in force or not."""
        return self.bank if self.counting else self.values

    @property
    def scale(self) -> float:
        """Motor steps in the unit that commands are in."""
        return self.steps_per_count if self.counting else 1.0

    @property
    def steps_per_turn(self) -> float:
        return self.values["MS"] * round(360 / self.values.get("SA", 1.8))

    @property
    def steps_per_count(self) -> float:
        """Motor steps in one encoder count."""
        return self.steps_per_turn / (self.values.get("EL", self.model.encoder_lines) * 4)

    @property
    def bound(self) -> float:
        """CB: the greatest distance between rotor and stator, steps."""
        return STATOR_BOUNDS[int(self.values.get("CB", 1))] * self.values["MS"]

    # Communication settings.

    @property
    def name(self) -> str:
        """DN (manual 5.1.33)."""
        return self.texts["DN"]

    @property
    def party(self) -> bool:
        """PY (manual 5.1.105)."""
        return bool(self.values.get("PY"))

    @property
    def checksum(self) -> int:
        """CK (manual 5.1.21)."""
        return int(self.values.get("CK", 0))

    @property
    def echo_mode(self) -> int:
        """EM (manual 5.1.37)."""
        return int(self.values["EM"])

    @property
    def escape_mode(self) -> int:
        """ES (manual 5.1.41)."""
        return int(self.values["ES"])

    @property
    def error_flag(self) -> bool:
        """EF (manual 5.1.39)."""
        return bool(self.values["EF"])

    # Ranges of words; those of motion depend on EE.

    def row(self, word: str) -> Mnemonic | None:
        """The row of a word, None for a free name. Raises DriveFault (37)."""
        return row_of(word, self.product)

    def readable(self, word: str) -> Mnemonic | None:
        """The row of a word that is only read: one that the product lacks may print 0. Raises DriveFault (37)."""
        row = lookup(word, self.product)
        return row if row is not None and self.product in row.zero_on else self.row(word)

    def checked(self, word: str, value: Value) -> int:
        """A whole number that a word takes. Raises DriveFault (21, 37)."""
        number, row = whole(value), self.row(word)
        if row is None or not row.accepts(number, self.counting):
            raise DriveFault(E.OUT_OF_RANGE)
        return number

    def flag(self, word: str, value: Value) -> int:
        """A value for a flag that the drive sets: 0 clears it, another value only where it may be written.

        Raises DriveFault (21).
        """
        row, number = self.row(word), whole(value)
        writable = row is not None and row.access == "RW" and row.accepts(number)
        if number != 0 and not writable:
            raise DriveFault(E.OUT_OF_RANGE)
        return number

    # Names that a user gives, and IV.

    def await_input(self, name: str) -> None:
        """Wait for a number for a variable (IV); an empty name: for none."""
        self.awaited, self.values["IF"] = name, int(name != "")

    def switch(self, word: str, value: int) -> None:
        """Change EE or AS. A change of unit exchanges the values of A, D, VI and VM, and of MS except on an LMM."""
        was = self.counting
        self.values[word] = value
        if self.counting != was:
            for name in BANKED if self.model.free_ms else COUNTED:
                self.values[name], self.bank[name] = self.bank[name], self.values[name]

    def declare(self, name: str, scope: str, value: Value) -> None:
        self.scopes[name] = scope
        self.values[slot(name)] = value

    def forget_local(self) -> None:
        """Drop what the last program declared (manual 3.2.2)."""
        for name in [name for name, scope in self.scopes.items() if scope == "L"]:
            self.forget(name)

    def forget(self, name: str) -> None:
        del self.scopes[name]
        self.values.pop(slot(name), None)

    def save(self, store: NonVolatileMemory) -> None:
        users = {slot(name) for name in self.scopes}
        store.values = {key: value for key, value in self.values.items() if key not in STATES and key not in users}
        store.bank, store.texts = dict(self.bank), {name: text for name, text in self.texts.items() if name != "MD"}
        store.users = {name: self.values[slot(name)] for name, scope in self.scopes.items() if scope == "G"}

    def load(self, store: NonVolatileMemory) -> None:
        """Take back what NVM keeps; global variables made since stay."""
        self.values.update(store.values)
        self.bank.update(store.bank)
        self.texts.update(store.texts)
        for name, value in store.users.items():
            self.declare(name, "G", value)
