"""The reply that a typed MCode line will get, and the settings that it changes."""

from __future__ import annotations

import re
from dataclasses import dataclass

from multidrop.dialects.codec import Kind
from multidrop.dialects.family import Referencing
from multidrop.dialects.mcode.manual.grammar import Argument, LineError, Name, Number, Statement, Text, parse, tokens
from multidrop.dialects.mcode.manual.statements import device_name
from multidrop.dialects.mcode.manual.table import PRINTS_LINES, lookup
from multidrop.dialects.state import DriveState

WORD = re.compile(r"\s*([A-Za-z_]+)\s*=?\s*(.*)", re.S)
BLANK = re.compile(r'\s*PR[\s,"]*;?', re.I)
SLOW = {"S", "IP", "CP", "FD"}
"""Words that write to flash memory; the drive replies late (MCode reference 5.1.113)."""
WIRE = {"EM": r"[0-3]", "PY": r"[01]", "CK": r"[0-2]", "ES": r"[0-3]", "DN": r"[A-Za-z0-9]"}
"""Communication settings, and the values that a drive accepts for them."""
WHOLE = {"FD", "IP"}
"""Words that restore all settings at once."""
HOMINGS = {"HM", "HI"}
STEPS = {"IC", "DC"}
SCALE = {"P", "C1", "C2", "MS", "EE", "AS", "RD"}
"""Words that change what positions count."""


@dataclass(frozen=True)
class Setting:
    """A communication setting that a line makes. `value` is None where the line does not show it (`EM=R1`)."""

    name: str
    value: str | None = None


def word_of(text: str) -> tuple[str, str]:
    """Split a line into its mnemonic, in capitals, and the rest."""
    found = WORD.match(text)
    return (found.group(1).upper(), found.group(2).strip()) if found else ("", text.strip())


def _statement(text: str) -> Statement | None:
    try:
        return parse(text)
    except LineError:
        return None


def referencing(state: DriveState, text: str) -> Referencing | None:
    """Find out whether a line homes the axis or sets its position; the same over Modbus."""
    word, rest = word_of(text)
    if word in HOMINGS or (word == "P" and rest):
        return Referencing("", word in HOMINGS)
    return None


def setting_of(text: str) -> Setting | None:
    """Find the communication setting that a line makes; None for any other line and for a value that drives refuse."""
    statement = _statement(text)
    if statement is None:  # a drive may find a setting in a line that this grammar does not parse
        word, rest = word_of(text)
        return Setting(word) if word in WHOLE or (word in WIRE and rest) else None
    word, arguments = statement.word, statement.arguments
    if word in WHOLE:
        return Setting(word)
    if word in STEPS and arguments and isinstance(arguments[0], Name) and arguments[0].word in WIRE:
        return Setting(arguments[0].word)
    if word not in WIRE or not arguments:
        return None
    value = _literal(word, arguments[0]) if len(arguments) == 1 else None
    if value is None:
        return Setting(word)
    return Setting(word, value) if re.fullmatch(WIRE[word], value) else None


def _literal(word: str, argument: Argument | None) -> str | None:
    if word == "DN":
        return device_name(argument, quoted_only=False) if isinstance(argument, Text | Number) else None
    return str(int(argument.value)) if isinstance(argument, Number) else None


def kind_of(text: str) -> Kind:
    """Predict the reply of a line."""
    word, rest = word_of(text)
    if word[:2] == "PR":
        words = {token.text.upper() for token in tokens(word[2:] + " " + rest) if token.kind == "word"}
        return Kind.LIST if words & PRINTS_LINES else Kind.PRINT
    if word == "L":
        return Kind.LIST
    if word == "PG":
        return Kind.PROGRAM
    return Kind.SETTING if setting_of(text) else Kind.COMMAND


def may_be_blank(text: str, expect: str | None) -> bool:
    """Whether a PR with this expectation may print nothing, or an empty line."""
    return not expect and (text.endswith(";") or BLANK.fullmatch(text) is not None)


def enters_program(text: str) -> bool:
    """Whether the line is `PG` with an address, which enters program mode."""
    word, rest = word_of(text)
    return word == "PG" and bool(rest)


def leaves_program(text: str) -> bool:
    """Whether the line is `PG` alone, which ends program mode."""
    return word_of(text) == ("PG", "")


def acts_on_program(text: str) -> bool:
    """Whether a line may start or end a program, or its single step: anything but a value that is set, or a print."""
    statement = _statement(text)
    if statement is None or kind_of(text) in (Kind.PRINT, Kind.LIST):
        return statement is None
    row = lookup(statement.word)
    sets = bool(statement.arguments) and (row is None or row.kind in ("variable", "flag") or row.name == "BP")
    return not sets or (row is not None and row.starts)


def starts_motion(text: str) -> bool:
    """Whether a line that is executed at once can start motion or a program; an unknown word can."""
    try:
        statement = parse(text)
    except LineError:
        return True
    row = lookup(statement.word) if statement is not None else None
    return statement is not None and (row is None or row.starts)


def may_displace(text: str) -> bool:
    """Whether a line may change where the drive goes, or what its positions count."""
    return starts_motion(text) or word_of(text)[0] in SCALE


def target_of(text: str, rest: int | None) -> int | None:
    """The end of the move that a line starts from a position at rest; None where that is not known."""
    statement = _statement(text)
    first = statement.arguments[0] if statement is not None and statement.arguments else None
    if statement is None or not isinstance(first, Number) or not isinstance(first.value, int):
        return None
    if statement.word == "MA":
        return first.value
    return rest + first.value if statement.word == "MR" and rest is not None else None
