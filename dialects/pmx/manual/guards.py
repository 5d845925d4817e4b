"""The commands of a controller that a person must agree to before they are sent. (PMX-2ED-SA manual 6.2.2, 6.3, 7.20.)

A stop is never guarded.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from multidrop.dialects.guards import ADDRESSES, EVERYONE, Guard, to_all
from multidrop.dialects.pmx.manual.table import head, lookup, starts_motion

NAMES: Mapping[str, str] = MappingProxyType(
    {
        "STORE": "writes the present settings over the kept ones, device name and baud rate included",
        "DN": "changes the number by which the controller is addressed, after STORE and a power cycle",
        "DB": "changes the baud rate, after STORE and a power cycle",
        EVERYONE: "can start every drive of the line",
    }
)
"""Every guard, and what its commands do."""
QUIET: Mapping[str, frozenset[str]] = MappingProxyType(
    {"SR": frozenset({"0", "2"}), "EO": frozenset({"0"}), "SL": frozenset({"0"})}
)
"""Values that stop a program, a motor or its correction: no address makes them a guarded command."""
_NUMBER = re.compile(r"\A\s*@\d{2}", re.ASCII)


def find(text: str, address: str) -> Guard | None:
    """Find the guard of a command for a controller; None: the command needs no agreement."""
    line = text.strip()
    word, value = word_of(line), line.partition("=")[2].strip()
    if word == "STORE" or (word in NAMES and value):
        return Guard(word, f"'{line}' {NAMES[word]}")
    quiet = value in QUIET.get(word, ())
    return to_all(line) if address in ADDRESSES and starts_motion(line) and not quiet else None


def only_ends(text: str) -> bool:
    """Whether a command of motion can only end it: that ends a program (SR)."""
    return word_of(text.strip()) == "SR" and text.partition("=")[2].strip() in QUIET["SR"]


def word_of(text: str) -> str:
    """The name of a command without its axis or number, and without a device number before it, in capitals."""
    command = _NUMBER.sub("", text)
    row = lookup(command)
    return row.name if row is not None else head(command)
