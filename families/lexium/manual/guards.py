"""The lines of MCode that a person must agree to before they are sent: the rows of their words say what they do.

A guarded line erases, takes the drive out of reach, or starts it in a way that its word does not show. A stop is never
guarded. (MCode reference 5.1.6, 5.1.9, 5.1.23, 5.1.33, 5.1.45, 5.1.63, 5.1.75, 5.1.105, 5.1.133.)

And what may guard a unit itself: the cyber security of newer Lexium Ethernet units, which carry a CSE mark, as far as
users report it. Until a person disables it with the unit's access code, the unit does not reply; or it prints and
moves, and refuses every value. Nothing of its bytes is public.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from multidrop.dialects.family import ADDRESSES, EVERYONE, Guard, Protection, to_all
from multidrop.families.lexium.manual.grammar import LineError, NameTerm, Number, Text, parse, parsed
from multidrop.families.lexium.manual.groups import ENDING_AT_0, GUARDED, STOPPING_AT_0
from multidrop.families.lexium.manual.mnemonic import ETHERNET
from multidrop.families.lexium.manual.program_file import bare
from multidrop.families.lexium.manual.table import MNEMONICS, lookup, words

RESETS = "prints Ctrl+C: every drive of the party line that hears it resets"
NAMES: Mapping[str, str] = {
    **{word: row.guard for word, row in GUARDED.items()},
    "PR": rf"with \c {RESETS}",
    EVERYONE: "can start every drive of the line",
}
"""Every guard, and what its lines do."""
_WORD = re.compile(r"\s*([A-Za-z]{2})(?![A-Za-z0-9])\s*=?\s*(.*)", re.DOTALL)
_ANY = re.compile("|".join((*GUARDED, r"\\c")), re.IGNORECASE)
_RESET = re.compile(r"(?<!\\)(?:\\\\)*\\c")
_NAMED = re.compile(r"([!-~])[ \t]*(?=[A-Za-z])")


def find(text: str, *, address: str, party: bool, product: str, starts: Callable[[str], bool]) -> Guard | None:
    """Find the guard of a line for a drive; None: the line needs no agreement.

    `starts` says whether a line can start motion or a program.
    """
    if address not in ADDRESSES and not text.lstrip().startswith(ADDRESSES) and _ANY.search(text) is None:
        return None  # as of nearly every line, without parsing it
    line = bare(text)
    name, word, value = _head(line, product)
    if word == "PY" and not (party or name):
        return None
    if word == "PR" and (party or name) and prints_reset(line):
        return Guard(word, f"'{line}' {RESETS}")
    row = GUARDED.get(word)
    if row is not None and (not row.valued or (value != "" and value not in row.harmless)):  # an expression may be any
        meaning = row.guard
        if word == "CP":
            meaning = _erased(line.removeprefix(name), product) or meaning
        return Guard(word, f"'{line}' {meaning}")
    if name in ADDRESSES or address in ADDRESSES:
        stops = word in STOPPING_AT_0 and value == 0
        sent = line.removeprefix(name) if name in ADDRESSES else line
        return to_all(line) if starts(sent) and not stops else None
    return None


def prints_reset(line: str) -> bool:
    """Whether a PR has Ctrl+C in a text (5.1.102): other drives of a party line may take it for theirs (5.1.19)."""
    statement = parsed(line)
    texts = (
        [argument.value for argument in statement.arguments if isinstance(argument, Text)]
        if statement is not None
        else [line]
    )
    return any(_RESET.search(text) for text in texts)


def _erased(line: str, product: str) -> str:
    """Say what CP with parameters erases; empty for CP alone, and where the drive would refuse it.

    From a label on means to the end of memory, the programs behind it too. An MDrivePlus takes only a place.
    """
    statement = parsed(line)
    arguments = statement.arguments if statement is not None else ()
    option, places = None, arguments
    if words(product) is MNEMONICS and (
        len(arguments) == 2 or arguments in ((Number(0),), (Number(1),), (NameTerm("S"),))
    ):
        option, places = arguments[0], arguments[1:]
    what = "the program"
    match places:
        case (NameTerm(word),):
            what = f"everything from {word} to the end of program memory"
        case (Number(value),):
            what = f"everything from address {value} to the end of program memory"
        case (_, *_):
            return ""
    more = {Number(1): " and every user variable", NameTerm("S"): ", and saves that"}
    return f"erases {what}{more.get(option, '') if isinstance(option, (NameTerm, Number)) else ''}" if arguments else ""


def addressed(text: str, product: str) -> tuple[str, str] | None:
    """Split a line into a drive's name and a command, where it is one only so (`bMR 5`, as manuals have it)."""
    line = bare(text)
    if (match := _NAMED.match(line)) is None or _read(line, product) is not None:
        return None
    if match.end() > 1 and parsed(line) is not None:
        return None  # `b R1` may set a variable of a program
    rest = line[match.end() :]
    statement = parsed(rest)
    known = statement is not None and lookup(statement.word, product) is not None
    return (match[1], rest) if known else None


def acts(text: str) -> bool:
    """Whether a line starts motion or a program at once; a setting, OE and what ends a motion do not.

    TE is no setting: it enables trips, and one that is due executes its subroutine.
    """
    _, word, value = _head(bare(text), "")
    row = lookup(word)
    if word == "TE":
        return value not in ("", 0)
    return row is not None and row.starts and row.kind == "instruction" and word != "OE" and not only_ends(text)


def word_of(text: str, product: str = "") -> str:
    return _head(bare(text), product)[1]


def only_ends(text: str) -> bool:
    """Whether a line is a command of motion that can only end it; one that takes torque away may let a load fall."""
    _, word, value = _head(bare(text), "")
    return word in ENDING_AT_0 and value == 0


def only_reads(text: str) -> bool:
    """Whether a line only asks for values. Asking for ER clears it (section 5.1.41)."""
    word = _head(bare(text), "")[1]
    return word == "PR" and not re.search(r"\bER\b", text.upper()) and not prints_reset(bare(text))


def _head(line: str, product: str) -> tuple[str, str, int | str]:
    """Read the head of a line: a drive's name where one is typed, the word, and the value.

    The value is a whole number, other text, or nothing. A head that has a meaning by itself begins with no name.
    """
    if (statement := _read(line, product)) is not None:
        return "", *statement
    if (named := _NAMED.match(line)) is not None:
        return named[1], *(_read(line[named.end() :], product) or ("", ""))
    return "", "", ""


def _read(line: str, product: str) -> tuple[str, int | str] | None:
    try:
        statement = parse(line)
    except LineError:
        match = _WORD.match(line)
        known = match is not None and lookup(match[1], product) is not None
        return (match[1].upper(), match[2].strip()) if match is not None and known else None
    if statement is None or lookup(statement.word, product) is None:
        return None
    match statement.arguments:
        case ():
            return statement.word, ""
        case (Number(value),) if value == int(value):
            return statement.word, int(value)
    return statement.word, "?"


TEXT = (
    "cyber security may be on: a newer Lexium Ethernet unit (CSE mark) does not reply, or refuses every value, until "
    "it is disabled in the maker's software"
)


def _text(product: str) -> str:
    return TEXT if not product or ETHERNET.match(product) else ""


def _word(text: str) -> str:
    """The variable or flag to which a line gives a value; empty: it gives none."""
    statement = parsed(text)
    row = lookup(statement.word) if statement is not None and statement.arguments else None
    return row.name if row is not None and row.valued else ""


ANOTHER = "another program or a PLC may hold the only connection that the drive serves: close it there; or "
"""Another cause of a silent drive: the network opens a connection that the drive does not serve."""
CYBER_SECURITY = Protection(_text, _word, ANOTHER)
