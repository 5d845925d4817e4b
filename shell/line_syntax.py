"""The syntax of a typed line: a verb, or text for a drive, and which drive.

`/word rest` is a verb. `@ADDR text` and `@BUS:ADDR text` address one drive; `@*` and `@^` address all drives of a bus.
`@BUS:` addresses the drive selected there, or the only one if the bus uses no addresses. Anything else goes to the
selected drive. This module does not know what is open.

A line is parsed once, at its Enter. What depends on the drive is asked of the parsed line when its turn comes; each
grammar keeps the texts that it has read.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from multidrop.base.errors import Diagnostic

if TYPE_CHECKING:
    from multidrop.macros import Macro

EVERYONE = ("*", "^")
WAITS = ("/wait", "/sleep")
ENDS = " \t\r\n"
"""What goes at both ends of a line. Any other character that does not show is the line's, and a drive takes none."""


class Place(NamedTuple):
    """A drive on a bus, by their names; empty where none is meant."""

    bus: str = ""
    address: str = ""


NOWHERE = Place()


@dataclass(frozen=True)
class VerbLine:
    """A host command: its name with the slash, and the rest of the line."""

    name: str
    rest: str
    typed: str = field(default="", compare=False)
    """The whole line."""
    shown: str | Macro | None = field(default=None, compare=False)
    """What a person was shown of the file that the line names: the text of a program, or a macro.

    It is used instead of the file, which may have changed since. None: nothing was shown, and the file is read.
    """


@dataclass(frozen=True)
class DriveLine:
    """Text for a drive. An empty bus means the selected one; an address of None means the selected drive."""

    text: str
    bus: str = ""
    address: str | None = None
    typed: str = field(default="", compare=False)
    """The whole line."""


TypedLine = VerbLine | DriveLine


def showing(line: str, shown: str | Macro) -> TypedLine | None:
    """Parse a line whose file a person was shown: a verb that is given what was shown. Raises Diagnostic."""
    parsed = parse(line)
    return replace(parsed, shown=shown) if isinstance(parsed, VerbLine) else parsed


def parse(line: str) -> TypedLine | None:
    """Parse a line; None for an empty one. Raises Diagnostic for an address without text."""
    typed, line = line, line.strip(ENDS)
    if not line:
        return None
    if line.startswith("/"):
        return VerbLine(*divided(line), typed)
    if line.startswith("@"):
        target, text = divided(line[1:])
        bus, address = split_target(target)
        if not target:
            raise Diagnostic("no address after the @", line, "valid: @ADDR TEXT or @BUS:ADDR TEXT")
        if not text:
            raise Diagnostic(
                f"nothing to send to {target}",
                f"@{target}",
                f"valid: @ADDR TEXT, with a blank between them; /use {target} selects it",
            )
        if text.startswith("/"):
            raise Diagnostic(f"{text.split()[0]} is a verb and takes no @{target}", line, f"/help {text.split()[0]}")
        return DriveLine(text, bus, address or None, typed)
    return DriveLine(line, typed=typed)


def each_names_one_drive(lines: Iterable[str]) -> bool:
    """True if every line goes to one drive, or waits for those; a line that cannot be parsed does not."""
    try:
        parsed = [parse(line) for line in lines]
    except Diagnostic:
        return False
    return all(
        line.name in WAITS if isinstance(line, VerbLine) else line is None or line.address not in EVERYONE
        for line in parsed
    )


def targets(lines: Iterable[str]) -> tuple[str, ...]:
    """The targets of lines, where every line for a drive names one, else none.

    A line without a target goes to the first drive of a bus. The targets of others must not decide which one that is.
    """
    try:
        parsed = [line for line in map(parse, lines) if isinstance(line, DriveLine)]
    except Diagnostic:
        return ()
    if any(line.address is None or line.address in EVERYONE for line in parsed):
        return ()
    return tuple(dict.fromkeys(f"{line.bus}:{line.address}" if line.bus else str(line.address) for line in parsed))


def divided(line: str) -> tuple[str, str]:
    """Divide a line at its first blanks: its first word, and all that follows it."""
    word, *rest = re.split(r"[ \t]+", line, maxsplit=1)
    return word, "".join(rest).strip(ENDS)


def split(text: str, where: str) -> list[str]:
    """Split text into words, without their quotation marks. Raises Diagnostic for a mark that is not closed."""
    splitter = shlex.shlex(text, posix=True)
    splitter.whitespace_split, splitter.escape, splitter.commenters = True, "", ""
    try:
        return list(splitter)
    except ValueError:
        raise Diagnostic("a quotation mark is not closed", where) from None


def split_target(target: str) -> tuple[str, str]:
    """Split a target: `press:a` into ("press", "a"), `a` into ("", "a"), `press:` into ("press", "")."""
    bus, colon, address = target.rpartition(":")
    return (bus, address) if colon else ("", address)


def pinned(line: str, bus: str, address: str) -> str:
    """Add the address to a line that was typed while that drive was selected.

    A verb and a malformed line stay unchanged.
    """
    try:
        parsed = parse(line)
    except Diagnostic:
        return line
    if not isinstance(parsed, DriveLine) or not bus:
        return line
    if parsed.address is not None:
        target = join_target(parsed.bus or bus, parsed.address)
    else:
        target = f"{parsed.bus or bus}:{address if parsed.bus in ('', bus) else ''}"
    return f"@{target} {parsed.text}"


def join_target(bus: str, address: str) -> str:
    """The address as typed after an `@`, with the bus if one is given."""
    return f"{bus}:{address}" if bus else address
