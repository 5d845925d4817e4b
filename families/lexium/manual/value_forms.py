"""The forms of a setting's value, each a class that checks a value before it is sent.

A word's row names its form (`Mnemonic.setup`); `FORMS` has the class of each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import Scalar, Value
from multidrop.families.lexium.manual.grammar import is_name
from multidrop.families.lexium.manual.mnemonic import EVERY, INT_HIGH, INT_LOW, FormKind, Mnemonic

MOST_REPEATS = 65000
SETUP_FIELDS = 2
"""The fields of a set-up for one number of a list, such as `IS1`, besides that number."""


@dataclass(frozen=True)
class ValueForm(ABC):
    """The form of one setting's value. `name` is the setting's, `IS1` for one of a list."""

    name: str

    @abstractmethod
    def check(self, value: Value) -> None:
        """Raise Diagnostic for a value that the drive would refuse."""

    def refused(self, value: Value, why: str) -> Diagnostic:
        return Diagnostic(f"{self.name} = {value}: {why}")


@dataclass(frozen=True)
class VariableForm(ValueForm):
    """The value of a user's variable. `labels` are those of the program in the drive."""

    labels: Collection[str]

    def check(self, value: Value) -> None:
        if not is_name(self.name):
            raise Diagnostic(f"{self.name}: is neither a word of the drive nor a name for a variable")
        if self.name in self.labels:
            raise Diagnostic(f"{self.name}: is a label of the program in the drive, so no variable can have that name")
        if not (isinstance(value, int) and INT_LOW <= value <= INT_HIGH):
            raise self.refused(value, f"a variable takes a whole number from {INT_LOW} to {INT_HIGH}")


@dataclass(frozen=True)
class WordForm(ValueForm):
    """The value of a word. `counts`: the unit of motion is the encoder count."""

    row: Mnemonic
    counts: bool


class NumberForm(WordForm):
    """One number in the range of its word."""

    def check(self, value: Value) -> None:
        row = self.row
        if isinstance(value, (int, float)) and row.accepts(value, self.counts):
            return
        low, high = row.bounds(self.counts)
        numbers = ", ".join(map(str, row.values)) if row.values else f"{low} to {high}"
        raise self.refused(value, f"valid: {numbers}{' (with EE=1)' if self.counts and row.low_encoder else ''}")


class NameForm(WordForm):
    """The name of the drive."""

    def check(self, value: Value) -> None:
        if not (isinstance(value, str) and len(value) == 1 and value.isascii() and value.isalnum()):
            raise self.refused(value, "takes one letter or digit")


class FieldsForm(WordForm):
    """Several numbers, each up to a greatest one if the row limits them."""

    def check(self, value: Value) -> None:
        self._check(value, *self.row.setup.numbers)

    def _check(self, value: Value, count: int, *greatest: int) -> None:
        numbers = [each for each in value if isinstance(each, int)] if isinstance(value, tuple) else []
        if not (isinstance(value, tuple) and len(value) == len(numbers) == count):
            raise self.refused(value, f"takes {count} whole numbers, as in {self.name} = {[0] * count}")
        if any(not 0 <= number <= most for number, most in zip(numbers, greatest, strict=False)):
            raise Diagnostic(f"{self.name} = {numbers}: valid: up to {[*greatest]}")


class ListForm(FieldsForm):
    """The set-up of one number of a list. The word alone takes any number in its range."""

    def check(self, value: Value) -> None:
        if self.name == self.row.name:
            NumberForm(self.name, self.row, self.counts).check(value)
        else:
            self._check(value, SETUP_FIELDS)


class TripForm(WordForm):
    """A target alone, or what the trip waits for, a target, and how often it repeats where it does. 0 is no trip."""

    def check(self, value: Value) -> None:
        if value != 0 and not self._complete(value if isinstance(value, tuple) else (value,)):
            raise self.refused(value, f"takes {self.row.syntax.partition(', PR')[0]}")

    def _complete(self, fields: tuple[Scalar, ...]) -> bool:
        """Whether these are all fields of a trip, each a valid one."""
        row = self.row
        awaited, target, repeats = fields[: row.place], fields[row.place : row.place + 1], fields[row.place + 1 :]
        return (
            all(
                isinstance(each, int) and row.accepts(each) and not (row.setup.repeated and each == 0)
                for each in awaited
            )
            and len(target) == 1
            and isinstance(target[0], (int, str))
            and len(repeats) <= row.setup.repeated
            and all(isinstance(repeat, int) and 0 <= repeat <= MOST_REPEATS for repeat in repeats)
        )


FORMS: Mapping[FormKind, Callable[[str, Mnemonic, bool], WordForm]] = {
    FormKind.NUMBER: NumberForm,
    FormKind.OPTION: NumberForm,
    FormKind.TEXT: NameForm,
    FormKind.FIELDS: FieldsForm,
    FormKind.LIST: ListForm,
    FormKind.TRIP: TripForm,
}


def value_form(name: str, row: Mnemonic | None, product: str, counts: bool, labels: Collection[str]) -> ValueForm:
    """Return the form of a setting's value on a product; `row` is None for a user's variable.

    Raises Diagnostic for a word that is not a setting of the product.
    """
    if row is None:
        return VariableForm(name, labels)
    if product in EVERY and product not in row.products:
        raise Diagnostic(f"{name}: an {product} lacks it")
    if row.access != "RW" or not row.valued:
        raise Diagnostic(f"{name}: is not a setting ({row.title})")
    return FORMS[row.setup.form](name, row, counts)
