"""The record of the PMX family: Performax controllers on a serial line or through a gateway.

Guarded commands are in the PMX-2ED-SA manual 6.2.2, 6.3, 7.20; a stop is never guarded. A move follows its mode, which
stays set.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.dialects.family import ADDRESSES, EVERYONE, Family, Guard, Guards, to_all
from multidrop.families.pmx.host import operations
from multidrop.families.pmx.host.codec import STOP_BYTES, Pmx, PmxState
from multidrop.families.pmx.host.operations import identify
from multidrop.families.pmx.manual import help
from multidrop.families.pmx.manual.table import head, lookup, reads, starts_motion

FIRST = "X"
"""The first axis."""


def move(axis: str, steps: int | str) -> tuple[str, ...]:
    return "INC", f"{axis.upper() or FIRST}{steps}"


def move_to(axis: str, position: int | str) -> tuple[str, ...]:
    return "ABS", f"{axis.upper() or FIRST}{position}"


GUARDS: Mapping[str, str] = {
    "STORE": "writes the present settings over the kept ones, device name and baud rate included",
    "DN": "changes the number by which the controller is addressed, after STORE and a power cycle",
    "DB": "changes the baud rate, after STORE and a power cycle",
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its commands do."""
QUIET: Mapping[str, frozenset[str]] = {"SR": frozenset({"0", "2"}), "EO": frozenset({"0"}), "SL": frozenset({"0"})}
"""Values that stop a program, a motor or its correction: no address makes them a guarded command."""
_NUMBER = re.compile(r"\A\s*@\d{2}", re.ASCII)
_ADDRESSED = re.compile(r"\s*@?(\d{2})\s*(?=[A-Za-z])", re.ASCII)


def guarded(text: str, address: str) -> Guard | None:
    """Find the guard of a command for a controller; None: the command needs no agreement."""
    line = text.strip()
    word, value = word_of(line), line.partition("=")[2].strip()
    if word == "STORE" or (word in GUARDS and value):
        return Guard(word, f"'{line}' {GUARDS[word]}")
    quiet = value in QUIET.get(word, ())
    return to_all(line) if address in ADDRESSES and starts_motion(line) and not quiet else None


def only_ends(text: str) -> bool:
    """Whether a command of motion can only end it: that ends a program (SR)."""
    return word_of(text.strip()) == "SR" and text.partition("=")[2].strip() in QUIET["SR"]


def addressed(text: str, product: str) -> tuple[str, str] | None:
    """Split a line into a device number and a command (`01PX`, as on the wire, with its @ or without)."""
    found = _ADDRESSED.match(text)
    rest = text[found.end() :] if found is not None else ""
    return (found[1], rest) if found is not None and lookup(rest.upper()) is not None else None


def word_of(text: str) -> str:
    """The name of a command without its axis or number, and without a device number before it, in capitals."""
    command = _NUMBER.sub("", text)
    row = lookup(command)
    return row.name if row is not None else head(command)


PMX = Family(
    name=Pmx.family,
    codec=Pmx(),
    new_state=PmxState,
    identify=identify,
    perform=operations.perform,
    check=operations.check,
    motion=operations.motion,
    moving=operations.moving,
    busy=operations.busy,
    status=operations.status,
    referencing=operations.referencing,
    homed=operations.homed,
    language=help,
    rests_in_place=False,
    question=lambda word: word if reads(word) else None,
    move=move,
    move_to=move_to,
    assign="{}={}".format,
    programs_at="multidrop.families.pmx.host.programs:PROGRAM_FILES",
    guards=Guards(GUARDS, lambda state, text: guarded(text, state.address), word_of, only_ends, reads),
    scan_at="multidrop.families.pmx.host.operations:SCAN",
    debugging_at="multidrop.families.pmx.host.programs:DEBUGGING",
    certifying_at="multidrop.families.pmx.host.operations:CERTIFYING",
    motions_at="multidrop.families.pmx.host.motions:MOTIONS",
    values_at="multidrop.families.pmx.host.values:VALUES",
    units_at="multidrop.families.pmx.host.units:UNITS",
    stop_bytes=STOP_BYTES,
    addressed=addressed,
)
