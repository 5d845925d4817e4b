"""The lines of the acts in each language: settings and motions with values that no other line has."""

from __future__ import annotations

from dataclasses import dataclass, replace

STOP = b"\x18"
"""The stop key."""


@dataclass(frozen=True)
class Phrases:
    """The lines of a language. `{}` takes a number; `first` and `first_motion` are the least ones."""

    value: str
    first: int
    motion: str
    first_motion: int
    print: str
    """Prints the value."""
    question: str
    """The same in an expression."""
    wrong: str
    """Refused by the drive."""
    settings: str
    """A file of settings with the value."""
    restored: str
    """What a restore of it sends."""
    guarded: tuple[str, ...] = ()
    """Lines that ask first, and that leave a drive usable after a yes."""
    denied: tuple[str, ...] = ()
    """Lines that ask first, and get no yes here."""
    program: str = ""
    """A program with the value; `{label}` takes a name."""
    acting: str = ""
    """A line before it that starts motion."""
    ending: str = ""
    by_hand: tuple[str, ...] = ()
    """Lines that store a program by hand."""
    endless: bool = False
    """The motion goes on until something ends it."""


PHRASES = {
    "mcode": Phrases(
        "R2={}",
        40_000_000,
        "SL {}",
        100_000,
        "PR R2",
        "R2",
        "VM=-1",
        '[drive]\nlanguage = "MCode"\n[variables]\nR2 = {}\n',
        "R2={}",
        ("IP", "CP", "BD=19"),
        ("FD", 'DN="z"', "LK=1", "AS=3", "UG"),
        "PG 300\nLB K{label}\nR2={value}\nMR {value}\nH\nE\nPG\n",
        "SL {}\n",
        ".mxt",
        ("PG 500", "LB H{label}", "R2={value}", "MR {value}", "E", "PG"),
        True,
    ),
    "pmx": Phrases(
        "V2={}",
        40_000_000,
        "X{}",
        50_000_000,
        "V2",
        "V2",
        "JOYENA=1",
        '[drive]\nlanguage = "PMX"\n[parameters]\nV40 = {}\n',
        "V40={}",
        ("STORE",),
        ("DN=77", "DB=3"),
        "V5={value}\nDELAY={label}\nEND\n",
        "",
        ".prg",
    ),
    "tmcl": Phrases(
        "SAP 194, 0, {}",
        900_000,
        "MVP ABS, 0, {}",
        800_000,
        "GAP 194, 0",
        "[GAP 194, 0]",
        "SAP 140, 0, 99",
        '[drive]\nlanguage = "TMCL"\n[parameters]\n194 = {}\n',
        "SAP 194, 0, {}",
        ("STAP 4, 0",),
        ("SGP 66, 0, 9", "SGP 65, 0, 3"),
    ),
}
PHRASES["modbus"] = replace(
    PHRASES["mcode"], guarded=("IP",), denied=("AS=3",), program="", acting="", ending="", by_hand=(), endless=False
)
