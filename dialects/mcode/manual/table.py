"""Every mnemonic and operator of MCode, in one table for each firmware, and the lookup."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Unpack

from multidrop.dialects.mcode.manual.mnemonic import (
    ENCODER,
    EVERY,
    EXPANDED,
    LEXIUM,
    MDRIVE_ENCODER,
    MDRIVE_PLUS,
    NOT_STEPPABLE,
    NOWHERE,
    READ_ONLY,
    Fields,
    Mnemonic,
    flag,
    mode,
    number,
    status,
)
from multidrop.dialects.mcode.manual.table_motion import IO, MOTION
from multidrop.dialects.mcode.manual.table_system import MATH, PROGRAM, SYSTEM

# The words of an MDrivePlus with Motion Control, firmware 3.010: base, with encoder, and the Plus2 with expanded I/O.
#
# Most are a Lexium's words with another range, default or place; a row has only the differences. Sections are the
# pages of the MCode reference of 2012 (R062812). Words of the Hybrid's firmware, and words new in the Lexium, are
# absent. The base unit knows the words of expanded I/O and refuses them (37). So does a unit without an encoder with
# the nine encoder words, of which it prints three as 0.


_LEXIUM: Mapping[str, Mnemonic] = {row.name: row for row in (*MOTION, *IO, *SYSTEM, *PROGRAM, *MATH)}
FASTEST = 5000000
"""The highest VM for any MS, steps/s."""
_TYPES = (
    "types: 0 user, 1 home, 2 limit +, 3 limit -, 4 go, 5 soft stop, 6 pause, 7 jog +, 8 jog -, 11 reset; "
    "16 output, 17 moving, 18 error, 19 stall, 20 velocity changing, 23 moving to a position"
)
_EXPANDED = "expanded I/O only"
_ENCODED = "needs the encoder"
_FILTER = "0 50 ns, 1 150, 2 200, 3 300, 4 500, 5 900, 6 1.7 µs, 7 3.3, 8 6.5, 9 12.9"


def replace(row: Mnemonic, **changes: Any) -> Mnemonic:
    """Copy a row with changes; `dataclasses.replace` takes three times as long, at every start."""
    return Mnemonic(**{**vars(row), **changes})


def _like(name: str, section: str, **changes: Unpack[Fields]) -> Mnemonic:
    """The row of a Lexium's word as it is on an MDrivePlus."""
    ours: Fields = {"products": MDRIVE_PLUS, "reserved_on": MDRIVE_PLUS, "note": ""}
    merged: Fields = {**ours, **changes}
    return replace(_LEXIUM[name], section=section, **merged)


def _own(row: Mnemonic, products: frozenset[str] = MDRIVE_PLUS) -> Mnemonic:
    """A word that no Lexium has, or that has another meaning there."""
    return replace(row, products=products, reserved_on=MDRIVE_PLUS)


def _read_as_zero(row: Mnemonic) -> Mnemonic:
    """A word of the encoder that a unit without one prints as 0, and does not take."""
    return replace(row, zero_on=MDRIVE_PLUS - MDRIVE_ENCODER)


def _reserved(name: str, section: str) -> Mnemonic:
    what = "reserved for the maker; no name for a variable or a label (error 24)"
    return _own(Mnemonic(name, "Reserved", what, section, kind="reserved", immediate=False, program=False))


def _operator(name: str) -> Mnemonic:
    return _like(name, "4-8")


MOTION_WORDS: tuple[Mnemonic, ...] = (
    *(
        _like(
            name, page, low=91, high=1525878997, low_encoder=91, high_encoder=61035160, default_encoder=40000,
        )
        for name, page in (("A", "5-1"), ("D", "5-16"))
    ),
    _like("C1", "5-7"),
    _read_as_zero(_like("C2", "5-7", products=MDRIVE_ENCODER, note=_ENCODED)),
    _own(
        flag("CM", "Clock mode", "1 switches the clock on points 7 and 8 on", "5-13", 0, starts=True,
             note=f"{_EXPANDED}; limits do nothing meanwhile, and a jog is error 87"),
        EXPANDED,
    ),
    _own(
        number("CR", "Clock ratio", "motor steps for each pulse of the clock on points 7 and 8", "5-14",
               low=0.001, high=2.0, unit="ratio", default=1.0, step=NOT_STEPPABLE, note=_EXPANDED),
        EXPANDED,
    ),
    _like("DB", "5-18", products=MDRIVE_ENCODER, note=_ENCODED),
    replace(_like("DE", "5-19", note="a move with DE=0 is counted and turns nothing"),
        meaning="0 switches the output bridges off"),
    _read_as_zero(_like("EE", "5-21", products=MDRIVE_ENCODER,
        note=f"{_ENCODED}; MS is 256 and locked while it is 1; VI or VM too low for counts is error 90")),
    _like("EL", "5-22", low=50, high=6400, default=512, products=EXPANDED, note=_EXPANDED),
    _like("HC", "5-28"),
    _like("HI", "5-29", products=MDRIVE_ENCODER, note=_LEXIUM["HI"].note),
    _like("HM", "5-30", note=_LEXIUM["HM"].note),
    _like("HT", "5-32", gap=(1,), note="0 keeps the run current; HT and MT together at most 65535"),
    _like("JE", "5-39"),
    _like("LM", "5-43"),
    _like("MA", "5-45", note=_LEXIUM["MA"].note),
    _like("MD", "5-45", note="NE repeats it"),
    replace(_like("MP", "5-46"), meaning="1 during MA and MR, and through MT after them"),
    _like("MR", "5-47", note=_LEXIUM["MR"].note),
    _like("MS", "5-48", note="EE=1 makes it 256 and locks it"),
    _like("MT", "5-49", high=65000, note="HT and MT together at most 65535"),
    replace(_like("MV", "5-50"), meaning="1 while the axis moves, whatever moves it, and through MT after that"),
    _like("NE", "5-51", default=1),
    _like("P", "5-54"),
    replace(_like("PC", "5-55", program=False, products=EXPANDED, note=f"{_EXPANDED}; a program may read it"),
        meaning="position at the last trip, unless that was TP"),
    _like("PM", "5-56", products=MDRIVE_ENCODER, note=_ENCODED),
    _like("RC", "5-61"),
    _like("SF", "5-68", products=MDRIVE_ENCODER, note=_ENCODED),
    _like("SL", "5-68", note="does not heed VM"),
    _like("SM", "5-69", products=MDRIVE_ENCODER, note=_ENCODED),
    _read_as_zero(
        _like("ST", "5-70", access="RW", products=MDRIVE_ENCODER, note=f"{_ENCODED}; reading ER does not clear it"),
    ),
    _like("V", "5-77"),
    _like("VC", "5-78"),
    _like("VF", "5-79", note="for torque, which it has not: taken, without effect"),
    _like("VI", "5-79", high=FASTEST - 1, default_encoder=40, note="less than VM"),
    _like("VM", "5-80", high=FASTEST, default_encoder=30720, note="more than VI; acts from the next move on"),
)  # fmt: skip


def _input(n: int, products: frozenset[str]) -> Mnemonic:
    row = status(f"I{n}", f"Input {n}", f"1 while the input is active, filtered, as S{n} sets it",
                 "5-33" if n < 5 else "5-35", kind="variable")  # fmt: skip
    return _own(row, products)


def _output(n: int, products: frozenset[str]) -> Mnemonic:
    row = mode(f"O{n}", f"Output {n}", "1 makes the output active, 0 inactive, in either sense",
               "5-51" if n < 5 else "5-52", access="WO", low=0, high=1, syntax=f"O{n}=<0/1>",
               note=f"for a point of type 16 (S{n}=16,<active>)")  # fmt: skip
    return _own(row, products)


def _point(n: int, products: frozenset[str]) -> Mnemonic:
    row = mode(f"S{n}", f"I/O point {n} setup", "type, active level, and sink (0) or source (1), of an I/O point",
               "5-63", syntax=f"S{n}=<type>,<0/1>[,<0/1>], PR S{n}", starts=True, note=_TYPES)  # fmt: skip
    return _own(row, products)


def _group(name: str, title: str, meaning: str, section: str, high: int, products: frozenset[str]) -> Mnemonic:
    if name[0] == "I":
        row = number(name, title, meaning, section, access="RO", step=READ_ONLY, low=0, high=high, syntax=f"PR {name}")
    else:
        row = mode(name, title, meaning, section, access="WO", low=0, high=high, syntax=f"{name}=<0-{high}>")
    return _own(row, products)


_GENERAL = ((1, MDRIVE_PLUS), (2, MDRIVE_PLUS), (3, MDRIVE_PLUS), (4, MDRIVE_PLUS),
            (9, EXPANDED), (10, EXPANDED), (11, EXPANDED), (12, EXPANDED))  # fmt: skip

POINT_WORDS: tuple[Mnemonic, ...] = (
    *(_input(n, products) for n, products in _GENERAL),
    *(_output(n, products) for n, products in _GENERAL),
    *(_point(n, products) for n, products in _GENERAL),
    *(
        _own(number(f"D{n}", f"Filter of input {n}", "how long a new level must last; 0: no filter",
                    "5-16" if n < 5 else "5-17", low=0, high=255, unit="ms", default=0), products)
        for n, products in _GENERAL
    ),
    _like("D5", "5-17", high=255),
    replace(_like("I5", "5-34", high=1023), meaning="reading of the 10-bit analog input"),
    _like("I6", "5-34", products=MDRIVE_ENCODER, note=_ENCODED),
    _own(
        mode("S5", "Analog input setup", "9 voltage (0: 5 V, 1: 10 V) or 10 current (0: 0-20 mA, 1: 4-20 mA)", "5-65",
             syntax="S5=<9/10>[,<0/1>], PR S5"),
    ),
    *(
        _own(mode(f"S{n}", "Clock setup", "type and active level of points 7 and 8, which are set up as a pair", "5-66",
                  syntax=f"S{n}=<type>,<0/1>, PR S{n}", starts=True,
                  note=f"{_EXPANDED}; in 33 step and direction, 34 quadrature, 35 up and down; out 49, 50, 51"),
             EXPANDED)
        for n in (7, 8)
    ),
    _own(
        mode("S13", "Capture and trip setup", "type and active level of the high-speed point 13", "5-67",
             syntax="S13=<60/61>,<0/1>[,<0/1>], PR S13",
             note=f"{_EXPANDED}; 60 capture input, 61 trip output; a third field as of S1"),
        EXPANDED,
    ),
    _group("IL", "Inputs, low group", "levels of points 1 to 4, point 1 the lowest bit; not filtered", "5-36", 15,
        MDRIVE_PLUS),
    _group("IH", "Inputs, high group", "levels of points 9 to 12, point 9 the lowest bit; not filtered", "5-37", 15,
        EXPANDED),
    _group("IN", "Inputs as a group", "levels of points 1 to 4 and 9 to 12, point 1 the lowest bit", "5-37", 255,
        MDRIVE_PLUS),
    _group("OL", "Outputs, low group", "sets points 1 to 4 at once, point 1 the lowest bit", "5-53", 15, MDRIVE_PLUS),
    _group("OH", "Outputs, high group", "sets points 9 to 12 at once, point 9 the lowest bit", "5-53", 15, EXPANDED),
    _group("OT", "Outputs as a group", "sets points 1 to 4 and 9 to 12 at once, point 1 the lowest bit", "5-54", 255,
        MDRIVE_PLUS),
    _like("FC", "5-25", note=f"modes: {_FILTER}; of point 13"),
    replace(_like("FM", "5-26", default=2, products=EXPANDED, note=f"modes: {_FILTER}; {_EXPANDED}"),
        meaning="shortest pulse that counts on points 7 and 8"),
    _like("CW", "5-15", products=EXPANDED, note=_EXPANDED),
    *(_reserved(f"I{n}", page) for n, page in ((7, "5-34"), (8, "5-34"), (13, "5-35"))),
)  # fmt: skip

TRIP_WORDS: tuple[Mnemonic, ...] = (
    replace(_like("TC", "5-72", products=EXPANDED, note=f"TE=4 arms it; {_EXPANDED}: S13=60"),
        meaning="run a subroutine when point 13, of type capture, turns active"),
    replace(_like("TE", "5-73", high=63, note="1, 2 and 8 on the base unit; a trip that is not set up is error 27"),
        meaning="armed trips: 1 TI, 2 TP, 4 TC, 8 TT, 16 TR"),
    _like("TI", "5-73", high=12, gap=tuple(range(5, 9)),
        note="inputs 1 to 4, and 9 to 12 with expanded I/O; TE=1 arms it, and is cleared"),
    _like("TP", "5-74", unit_encoder="steps",
        note="in motor steps always; TE=2 arms it, and is cleared; not together with TR (error 39)"),
    _like("TR", "5-75", products=EXPANDED,
        note=f"TE=16 arms it; repeats 0 is for ever, else up to 65000; label 0: output only; {_EXPANDED}: S13=61"),
    _like("TT", "5-76", note="TE=8 arms it"),
)  # fmt: skip

SYSTEM_WORDS: tuple[Mnemonic, ...] = (
    _like("AL", "5-1"),
    _reserved("AT", "5-3"),
    _like("BD", "5-4", note="acts after S and a reset"),
    _like("CE", "5-11"),
    _like("CK", "5-12"),
    _like("DG", "5-19", note="several answers at once garble each other"),
    _like("DN", "5-20", syntax='DN="<character>", DN=<code>, PR DN',
        note='case counts; a code is a character\'s number, such as 65 for A; FD restores "!"'),
    _like("EF", "5-21", access="RO", note="reading EF itself clears nothing"),
    _like("EM", "5-22"),
    _like("ER", "5-23", access="RW", high=109, note="may also be set; 0 clears"),
    _like("ES", "5-23"),
    _like("FD", "5-26", program=False, note="at once, without asking; not while moving (error 73)"),
    _reserved("FT", "5-27"),
    _like("IP", "5-38", note="not while moving (error 74)"),
    replace(_like("IT", "5-38", low=-55, high=125, syntax="PR IT", products=NOWHERE, note="size 34 only"),
        meaning="temperature inside"),
    _like("PN", "5-56", program=False),
    _like("PY", "5-59", note="a line feed activates it and ends every command"),
    _like("QD", "5-60", program=False),
    _like("S", "5-62", note="not during MA or MR (error 73); programs are kept as they are typed, without it"),
    _like("SN", "5-69"),
    _like("UG", "5-77", program=False, note="for the maker's upgrade program only"),
    _like("VR", "5-80"),
    _like("WT", "5-81", note="acts where IT is: size 34 only"),
)  # fmt: skip

PROGRAM_WORDS: tuple[Mnemonic, ...] = (
    _like("BP", "5-5", syntax="BP <label/address>,<count>, BP=0", note="BP=0 removes it"),
    _like("BR", "5-6", immediate=False, note=_LEXIUM["BR"].note),
    _like("BY", "5-6", program=False, note="a program may read it"),
    _like("CL", "5-13", immediate=True, note=f"typed only while a program runs (error 40); {_LEXIUM['CL'].note}"),
    _like("CP", "5-14; 4-4", syntax="CP, CP <label/address>",
        note="keeps global variables; not while moving (error 74)"),
    _like("DC", "5-18", note=_LEXIUM["DC"].note),
    _like("E", "5-20", note="in a program: its last line"),
    _like("EX", "5-24", note=_LEXIUM["EX"].note),
    _like("H", "5-27", immediate=True, low=0, note="0 is as none; typed only while a program runs (error 40)"),
    _like("IC", "5-35", note=_LEXIUM["IC"].note),
    _like("IF", "5-36", access="RO", note="0 clears it"),
    _like("IV", "5-39", immediate=True, note="wait for it with BR on IF=1"),
    _like("L", "5-40", note="error 44 while locked"),
    _like("LB", "5-40", note="a letter, then nothing, a letter or a digit; in any case; LB SU runs at power-up"),
    _like("LK", "5-42", program=False, note="once saved, only CP of everything or FD opens it"),
    _like("OE", "5-52", immediate=False, syntax="OE <label/address>, OE 0",
        note="it runs on errors of immediate commands too; 0, CP or FD ends it"),
    _like("PG", "5-55", note=_LEXIUM["PG"].note),
    _like("PR", "5-57", note=_LEXIUM["PR"].note),
    _like("PS", "5-57", program=False, note="RS goes on"),
    _like("RS", "5-61", program=False),
    _like("RT", "5-62"),
    _like("SU", "5-71", immediate=False, note=_LEXIUM["SU"].note),
    _like("UV", "5-77"),
    _like("VA", "5-78", note="a letter, then nothing, a letter or a digit; 192 names together with labels"),
)  # fmt: skip

MATH_WORDS: tuple[Mnemonic, ...] = (
    *(_like(f"R{n}", "5-60") for n in range(1, 5)),
    *map(_operator, ("+", "-", "*", "/", "=", "<>", "<", "<=", ">", ">=", "&", "|", "^", "!")),
)

WORDS: tuple[Mnemonic, ...] = MOTION_WORDS + POINT_WORDS + TRIP_WORDS + SYSTEM_WORDS + PROGRAM_WORDS + MATH_WORDS


# Lexium: MCode reference, section 5. MDrivePlus: above. A word that a product's table lacks is a free name.


__all__ = [
    "ENCODER", "EVERY", "LEXIUM", "MDRIVE", "MDRIVE_PLUS", "MNEMONICS", "NO_STEP", "PRINTS_LINES",
    "Mnemonic", "lookup", "words",
]  # fmt: skip


def _table(rows: Iterable[Mnemonic]) -> Mapping[str, Mnemonic]:
    return MappingProxyType({row.name: row for row in sorted(rows, key=lambda row: row.name)})


MNEMONICS = _table((*MOTION, *IO, *SYSTEM, *PROGRAM, *MATH))
"""The Lexium's words by name, in capitals; each indexed word has its own row (`D1`, `O3`, `F8`)."""
MDRIVE = _table(WORDS)
"""The MDrivePlus's words by name."""

PRINTS_LINES = frozenset(name for name, row in MNEMONICS.items() if row.lines)
"""The words whose PR prints several lines without an end of their own."""

NO_STEP: Mapping[str, int] = MappingProxyType({name: row.step for name, row in MNEMONICS.items() if row.step})
"""The error of `IC` and `DC` on a word that cannot be stepped: 25 or 26 (section 5.1.29)."""


def words(product: str) -> Mapping[str, Mnemonic]:
    """The table of a product, by the beginning of its name; the Lexium's for an unknown product."""
    return MDRIVE if product.startswith("MDI") else MNEMONICS


def lookup(word: str, product: str = "") -> Mnemonic | None:
    """Find the row of a word in any case; None where the product leaves it free. Without a product: any table's row."""
    name = word.strip().upper()
    if not product:
        return MNEMONICS.get(name) or MDRIVE.get(name)
    row = words(product).get(name)
    state = product in EVERY
    return None if row is None or (state and product not in row.reserved_on) else row
