"""The reply that a typed MCode line will get: its kind, the line that a PR prints, the settings that it changes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

from multidrop.dialects.codec import Kind, Started
from multidrop.families.lexium.manual import errors
from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import (
    Argument,
    LineError,
    NameTerm,
    Number,
    Statement,
    Text,
    parse,
    parsed,
    tokens,
)
from multidrop.families.lexium.manual.groups import (
    DECLARING,
    FORM_OF_LINES,
    HOMINGS,
    MOTIONS,
    OPTIONED,
    PRINTS_LINES,
    RECOUNTING,
    RESTORING,
    SEVERAL,
    SIGNS_OF_FAILURE,
    STEPPING,
)
from multidrop.families.lexium.manual.mnemonic import FormKind, Mnemonic
from multidrop.families.lexium.manual.statements import device_name
from multidrop.families.lexium.manual.table import lookup

WORD = re.compile(r"\s*([A-Za-z_]+)\s*=?\s*(.*)", re.S)
BLANK = re.compile(r'\s*PR[\s,"]*;?', re.I)


@dataclass(frozen=True)
class LineSetting:
    """A communication setting that a line makes. `value` is None where the line does not show it (`EM=R1`)."""

    name: str
    value: str | None = None


@lru_cache(maxsize=256)
def word_of(text: str) -> tuple[str, str]:
    """Split a line into its mnemonic, in capitals, and the rest."""
    match = WORD.match(text)
    return (match.group(1).upper(), match.group(2).strip()) if match else ("", text.strip())


@lru_cache(maxsize=256)
def setting_of(text: str) -> LineSetting | None:
    """Find the communication setting that a line makes; None for any other line and for a value that drives refuse."""
    statement = parsed(text)
    if statement is None:  # a drive may find a setting in a line that this grammar does not parse
        word, rest = word_of(text)
        return LineSetting(word) if word in RESTORING or (word in FORM_OF_LINES and rest) else None
    word, arguments = statement.word, statement.arguments
    if word in RESTORING:
        return LineSetting(word)
    if word in STEPPING and arguments and isinstance(arguments[0], NameTerm) and arguments[0].word in FORM_OF_LINES:
        return LineSetting(arguments[0].word)
    if word not in FORM_OF_LINES or not arguments:
        return None
    value = _literal(word, arguments[0]) if len(arguments) == 1 else None
    if value is None:
        return LineSetting(word)
    return LineSetting(word, value) if _takes(word, value) else None


def _takes(word: str, value: str) -> bool:
    """Whether drives accept a literal for a communication setting; the literal of DN is a name that they take."""
    row = lookup(word)
    return row is not None and (row.setup.form is FormKind.TEXT or row.accepts(int(value))) and value != ""


def _literal(word: str, argument: Argument | None) -> str | None:
    if word == "DN":
        return device_name(argument, quoted_only=False) if isinstance(argument, Text | Number) else None
    return str(int(argument.value)) if isinstance(argument, Number) else None


@lru_cache(maxsize=256)
def kind_of(text: str) -> Kind:
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


@lru_cache(maxsize=256)
def acts_on_program(text: str) -> bool:
    """Whether a line may start or end a program, or its single step: anything but a value that is set, or a print."""
    statement = parsed(text)
    if statement is None or kind_of(text) in (Kind.PRINT, Kind.LIST):
        return statement is None
    row = lookup(statement.word)
    sets = bool(statement.arguments) and (row is None or row.valued or row.name == "BP")
    return not sets or (row is not None and row.starts)


@lru_cache(maxsize=256)
def starts_motion(text: str) -> bool:
    """Whether a line that is executed at once can start motion or a program; an unknown word can."""
    try:
        statement = parse(text)
    except LineError:
        return True
    row = lookup(statement.word) if statement is not None else None
    return statement is not None and (row is None or row.starts)


@lru_cache(maxsize=256)
def started(text: str) -> Started:
    """What a line that is executed at once can start; the same over Modbus."""
    statement = parsed(text)
    word = statement.word if statement is not None else ""
    if word in MOTIONS:
        return Started(None, program=False, lasts=False)
    return Started(None, program=True, lasts=False) if word == "EX" else Started()


@lru_cache(maxsize=256)
def vouched(text: str, product: str) -> bool:
    """Whether the tables show nothing for which a drive would refuse a line; its state may be such a thing."""
    statement = parsed(text)
    if statement is None or statement.word == "EX":
        return False
    row = lookup(statement.word, product)
    if statement.word == "PR":
        names = [argument for argument in statement.arguments if not isinstance(argument, (Text, Number))]
        rows = [lookup(name.word, product) if isinstance(name, NameTerm) else None for name in names]
        return all(mnemonic is not None and mnemonic.access != "-" for mnemonic in rows)
    return (
        row is not None
        and len(statement.arguments) <= 1
        and all(
            isinstance(argument, Number) and row.accepts(argument.value) and row.access != "RO"
            for argument in statement.arguments
        )
    )


@lru_cache(maxsize=256)
def refused_by_tables(text: str, product: str) -> bool:
    """Whether a drive refuses a line for sure: its word is unknown, or a number is out of range."""
    statement = parsed(text)
    row = lookup(statement.word, product) if statement is not None else None
    if statement is None or row is None:
        return True
    numbers = [argument.value for argument in statement.arguments[:1] if isinstance(argument, Number)]
    return any(not (row.accepts(number) or row.accepts(number, encoder=True)) for number in numbers)


OF_DEFINITIONS = frozenset({E.NAME_EXISTS, E.NAME_IS_COMMAND, E.NAME_TABLE_FULL})
OF_MOVES = errors.BY_ITSELF | {
    E.OUT_OF_RANGE,
    E.ILLEGAL_DATA,
    E.NOT_AVAILABLE,
    E.NO_SEPARATOR,
    E.MAKE_UP_FREQUENCY,
    E.VELOCITY_TOO_HIGH,
    E.HOMING_OR_MOVING,
    E.MOVE_WHILE_CALIBRATING,
    E.VELOCITY_TOO_LOW,
    E.STILL_CORRECTING,
    E.DRIVE_DISABLED,
    E.DIRECTION_WHILE_MOVING,
    E.FINAL_VELOCITY_BELOW_VI,
    E.NO_ACCELERATION_FITS,
    E.NO_DECELERATION_FITS,
    E.NOT_TESTED,
    E.MAKE_UP_OFF,
}
"""The errors of a move without a label or a user variable; every other one is another line's."""

OF_NO_SETTING = frozenset(
    {
        E.INSTRUCTION_NOT_SETTABLE,
        E.NOT_EXECUTABLE,
        E.NOT_PRINTABLE,
        E.NO_PROGRAM_RUNNING,
        E.NO_SUCH_ADDRESS,
        E.STACK_FULL,
        E.NOT_IN_PROGRAM_MODE,
    }
)
"""The errors of executing, printing or storing: a line that gives a variable a number has none of them."""


@lru_cache(maxsize=256)
def may_cause(text: str, code: int, product: str) -> bool:
    """Whether a line can be refused with this error; False: another line has caused it, another program's perhaps."""
    statement = parsed(text)
    if statement is None or statement.word == "EX" or refused_by_tables(text, product):
        return True
    if uses_own_name(text):
        return True
    if code in OF_DEFINITIONS:
        return statement.word in DECLARING
    row = lookup(statement.word, product)
    if code in OF_NO_SETTING and row is not None and row.valued and statement.arguments:
        return False
    return code != E.NO_SUCH_NAME and (statement.word not in MOTIONS - HOMINGS or code in OF_MOVES)


def may_displace(text: str) -> bool:
    """Whether a line may change where the drive goes, or what its positions count."""
    return starts_motion(text) or written_word(text) in RECOUNTING


@lru_cache(maxsize=256)
def uses_own_name(text: str) -> bool:
    """Whether a line has a word that is none of the manual's: a label, or a user variable."""
    return any(lookup(token.text) is None for token in tokens(text) if token.kind == "word")


def written_word(text: str) -> str:
    """Return the variable to which a line gives a value, also by IC and DC; empty: it gives none."""
    statement = parsed(text)
    if statement is None or not statement.arguments or statement.word == "PR":
        return ""
    first = statement.arguments[0]
    return first.word if statement.word in STEPPING and isinstance(first, NameTerm) else statement.word


def target_of(text: str, rest: int | None) -> int | None:
    """The end of the move that a line starts from a position at rest; None where that is not known."""
    statement = parsed(text)
    first = statement.arguments[0] if statement is not None and statement.arguments else None
    if statement is None or not isinstance(first, Number) or not isinstance(first.value, int):
        return None
    if statement.word == "MA":
        return first.value
    return rest + first.value if statement.word == "MR" and rest is not None else None


# The line that a typed PR prints, and the same PR with the host's signature after its values.
#
# A line that does not match comes from a running program or another drive. Some lines match by chance: the reply to
# `PR P` looks like any number that a program prints. The host then appends an item: the drive's own name, or a mark
# (`exchange.Sign`). (MCode reference 5.1.102.)


NOTHING = r"(?!)"
"""Matches no line."""
INTEGER = r"-?\d{1,10}"
"""A value of 32 bits. A longer one is two lines that ran into each other."""
INTEGERS = r"-?\d[\d-]*"
"""Several values without separators."""
FREE = r"[ -~]*"
_ESCAPE = re.compile(r"\\(.?)", re.S)
_CODES = {"r": "", "t": r"\t?", "b": r"[\b]?", "e": r"\x1b?", "g": r"\x07?", "c": r"\x03?"}


@lru_cache(maxsize=256)
def print_form(text: str) -> str | None:
    """Return a regular expression for the line that a PR prints; None where it is unknown, or prints several lines."""
    statement = _printing(text)
    if statement is None:
        return None
    pieces: list[str] = []
    arguments = [argument for argument in statement.arguments if argument is not None]
    while arguments:
        item = arguments.pop(0)
        if isinstance(item, NameTerm) and item.word in OPTIONED and arguments and isinstance(arguments[0], Number):
            arguments.pop(0)
        pieces.append(_item_form(item))
    # Join the parts so that no two can match the same characters: a long line then matches fast.
    if FREE in pieces:
        first, last = pieces.index(FREE), len(pieces) - 1 - pieces[::-1].index(FREE)
        pieces = [*pieces[:first], FREE, *pieces[last + 1 :]]
    out = [""]
    for piece in pieces:
        digits = piece == INTEGER or re.fullmatch(r"(?:\d|\\-)+", piece) is not None
        if out[-1] in (INTEGER, INTEGERS) and (digits or piece == FREE):
            out[-1] = INTEGERS if digits else FREE
        elif out[-1] != FREE or piece != INTEGER:
            out.append(piece)
    return "".join(out)


def reads_error(text: str) -> bool:
    """Whether a line prints ER and nothing else, which clears the error."""
    statement = _printing(text)
    return statement is not None and [getattr(argument, "word", "") for argument in statement.arguments] == ["ER"]


def with_item(text: str, item: str) -> str | None:
    """Append an item to the values of a PR; None where it prints no value, or is not a PR of one line."""
    statement = _printing(text)
    if statement is None or all(isinstance(argument, (Text, Number)) for argument in statement.arguments):
        return None
    return f"{text.rstrip().removesuffix(';').rstrip()},{item}{';' * statement.quiet}"


def plain_form(text: str) -> str | None:
    """Return a regular expression for a PR that only reads whole numbers; None for any other.

    The repetition of the line in EM=0 does not match it.
    """
    statement = _printing(text)
    if statement is None or statement.quiet or not isinstance(statement.arguments[-1], NameTerm):
        return None
    words = [argument.word for argument in statement.arguments if isinstance(argument, NameTerm)]
    rows = [lookup(word) for word in words if word not in SIGNS_OF_FAILURE]
    plain = all(isinstance(argument, (NameTerm, Text)) for argument in statement.arguments)
    whole = len(rows) == len(words) and all(row is not None and _is_whole_number(row) for row in rows)
    return print_form(text) if plain and whole else None


def _printing(text: str) -> Statement | None:
    statement = parsed(text)
    if statement is None or statement.word != "PR" or not statement.arguments:
        return None
    texts = [argument.value for argument in statement.arguments if isinstance(argument, Text)]
    names = [lookup(argument.word) for argument in statement.arguments if isinstance(argument, NameTerm)]
    broken = any(r"\n" in each for each in texts) or any(row is not None and row.lines for row in names)
    return None if broken else statement


def _item_form(item: object) -> str:
    if isinstance(item, Text):
        # Match a text in quotation marks; units either execute a control code or print it.
        out, at = [], 0
        for match in _ESCAPE.finditer(item.value):
            code = _CODES.get(match[1], re.escape(match[1]))
            out += [re.escape(item.value[at : match.start()]), f"(?:{code}|{re.escape(match[0])})"]
            at = match.end()
        return "".join((*out, re.escape(item.value[at:])))
    if isinstance(item, Number):
        return re.escape(str(item.value))
    if isinstance(item, NameTerm):
        row = lookup(item.word)
        return INTEGER if row is None or _is_whole_number(row) else FREE
    return FREE


def _is_whole_number(row: Mnemonic) -> bool:
    return row.valued and row.whole and row.name not in SEVERAL
