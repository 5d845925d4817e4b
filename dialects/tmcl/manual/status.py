"""The status byte of a reply: what each code means and what to do (TMCL firmware manuals, "Reply format")."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType


class Status(IntEnum):
    """Byte 2 of a reply. Below 100 the command was refused and changed nothing; 101 is as good as a refusal."""

    WRONG_CHECKSUM = 1
    INVALID_COMMAND = 2
    WRONG_TYPE = 3
    INVALID_VALUE = 4
    EEPROM_LOCKED = 5
    NOT_AVAILABLE = 6
    MAXIMUM_EXCEEDED = 9
    DONE = 100
    STORED = 101
    TARGET_REACHED = 128


def accepted(status: int) -> bool:
    """Whether the module has executed the command."""
    return status >= Status.DONE and status != Status.STORED


@dataclass(frozen=True)
class Refusal:
    """Meaning of a code and what to do, for a person."""

    text: str
    advice: str


REFUSALS: Mapping[int, Refusal] = MappingProxyType(
    {
        Status.WRONG_CHECKSUM: Refusal("wrong checksum", "the line is disturbed: check wiring and baud"),
        Status.INVALID_COMMAND: Refusal("invalid command", "this module has no such command"),
        Status.WRONG_TYPE: Refusal("wrong type", "this module has no such parameter or type"),
        Status.INVALID_VALUE: Refusal("invalid value", "check the range of the value, and the motor's number"),
        Status.EEPROM_LOCKED: Refusal("the EEPROM is locked", "unlock it with the vendor's tool"),
        Status.NOT_AVAILABLE: Refusal("command not available", "this module has it not in this state or equipment"),
        Status.MAXIMUM_EXCEEDED: Refusal("maximum exceeded", "too many of them; check the value"),
        Status.STORED: Refusal(
            "stored as a program line, not executed",
            "the module is in download mode; 133 0, 0, 0 or a stop ends that",
        ),
    }
)
