"""What a Lexium drive says of its motion over any protocol, by the flags of MCode."""

from __future__ import annotations

from abc import ABC, abstractmethod

from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import Referencing
from multidrop.dialects.state import OfDrive
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.manual.groups import HOMINGS


class LexiumOperations(OfDrive, ABC):
    """What a Lexium drive says of its motion; a protocol reads a flag in its own way."""

    @abstractmethod
    def flag(self, name: str) -> Procedure[bool]:
        """Whether a flag of the drive, such as MV, is 1."""

    def moving(self) -> Procedure[bool]:
        return self.flag("MV")

    def busy(self) -> Procedure[bool]:
        return self.flag("BY")

    def homed(self) -> Procedure[bool]:
        return not (yield from self.flag("EF"))

    def referencing(self, text: str) -> Referencing | None:
        """Find out whether a line homes the axis or sets its position; the same over Modbus."""
        word, rest = classify.word_of(text)
        if word in HOMINGS or (word == "P" and rest):
            return Referencing("", word in HOMINGS)
        return None
