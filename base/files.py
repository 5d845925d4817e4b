"""Text files that people write: read within limits, divided into lines by one rule, TOML parsed.

No file makes a program wait or fills its memory, and no line is hidden from a person who reads it in an editor. `rows`
are those of our own tables.
"""

from __future__ import annotations

import os
import re
import stat
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

from multidrop.base.comments import behind_number, grouped_at
from multidrop.base.errors import Diagnostic

if TYPE_CHECKING:
    from pathlib import Path

LARGEST_FILE = 1024 * 1024
"""Bytes of a script, a configuration, a macro or a cell; more than a person writes into one."""
LARGEST_PROGRAM = 16 * LARGEST_FILE
"""Bytes of a program file, remarks included."""
MOST_LINES = 20_000
"""Lines of a program file; no drive holds as many."""
DEEPEST_TABLES = 50
"""The deepest nesting of tables, arrays and dotted keys in TOML: a parser's time grows with it."""

_OWN = re.compile(r"/dev/(stdin|fd/\d+)|/proc/self/fd/\d+")
"""Names of our own standard input and of pipes that a shell opened for us."""
_WRONG = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]")
"""Characters that end a line for one program and not for another, or that no editor shows. A TAB is fine."""
_NAMES = {
    "\r": "carriage return without a line feed", "\x0b": "vertical tab", "\x0c": "form feed", "\x1a": "Ctrl+Z",
    "\x85": "next line", "\u2028": "line separator", "\u2029": "paragraph separator",
}  # fmt: skip


@dataclass(frozen=True)
class SourceLine:
    """A line of a program file, without its remark: its number from 1, and the text to send to the drive."""

    number: int
    text: str


def bytes_of(path: str | Path, largest: int = LARGEST_FILE) -> bytes:
    """Read a regular file, or our own standard input by its name. Raises Diagnostic, also for one that is too large."""
    where = str(path) or '""'
    try:
        with opened(path) as file:
            return bounded(file, where, largest)
    except (OSError, ValueError) as error:
        raise Diagnostic(f"cannot be read: {why(error)}", where) from error


def opened(path: str | Path) -> IO[bytes]:
    """Open a regular file, or our own standard input by its name. Raises Diagnostic for a pipe or a device; OSError."""
    mode = os.stat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or _OWN.fullmatch(str(path))):
        raise Diagnostic("is not a regular file", str(path), "a pipe or a device may have no end; copy it into a file")
    return open(path, "rb")


def bounded(file: IO[bytes], where: str, largest: int = LARGEST_FILE) -> bytes:
    """Read a stream to its end. Raises Diagnostic for one that is too large, and OSError."""
    data = file.read(largest + 1)
    if len(data) > largest:
        raise Diagnostic(f"is larger than {largest // 1024**2} MB", where, "this is not a file that multidrop reads")
    return data


def text_of(path: str | Path) -> str:
    return _decoded(bytes_of(path), str(path))[0]


def utf8_of(path: str | Path) -> str:
    return utf8(bytes_of(path), str(path))


def utf8(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise Diagnostic("not UTF-8 text", _at(where, line), "save it as UTF-8") from None


def program_text_of(path: str | Path) -> str:
    """Read a program file. Raises Diagnostic."""
    return encoded_program_of(path)[0]


def encoded_program_of(path: str | Path) -> tuple[str, str]:
    """Read a program file; return its text, and the encoding that gives the same bytes again. Raises Diagnostic."""
    return program_of(bytes_of(path, LARGEST_PROGRAM), str(path))


def program_of(data: bytes, where: str) -> tuple[str, str]:
    """Decode a program file; see `encoded_program_of`. Raises Diagnostic."""
    text, encoding = _decoded(data, where)
    check_program_text(text, where)
    return text, encoding


def check_program_text(text: str, where: str) -> None:
    """Raise Diagnostic for a text that no program file holds. `where`: its file."""
    if "\0" in text:
        raise Diagnostic("is not a text file", where, "a program is plain text")
    if max(text.count("\n"), text.count("\r")) > MOST_LINES:
        raise Diagnostic(f"has more than {MOST_LINES} lines", where, "no drive holds such a program")


def _decoded(data: bytes, where: str) -> tuple[str, str]:
    if b"\0" in data:
        raise Diagnostic("is not a text file", where, "a program is plain text")
    return decoded(data)


def decoded(data: bytes) -> tuple[str, str]:
    """Decode a text, UTF-8 or of Windows; return it with the encoding that gives the same bytes again."""
    for encoding in ("utf-8-sig" if data.startswith(BOM_UTF8) else "utf-8", "cp1252"):
        try:
            return data.decode(encoding), encoding
        except UnicodeDecodeError:
            pass
    return data.decode("latin-1"), "latin-1"


# Lines


def split_lines(text: str) -> list[str]:
    """Divide a text, without a byte order mark and the Ctrl+Z of an old editor, at LF or CR LF.

    A CR alone ends lines where there is no LF at all: terminals paste LF as CR. After the last line end is a last line.
    """
    body = text.removeprefix("\ufeff").removesuffix("\x1a")
    return re.split(r"\r?\n", body) if "\n" in body else body.split("\r")


def lines_of_text(text: str, _: object = None) -> tuple[str, ...]:
    """The lines of a file that a person edits, without the end of file of an old editor."""
    return tuple(split_lines(text.removesuffix("\x1a").removesuffix("\n")))


def wrong_characters(lines: Iterable[str]) -> Iterator[tuple[int, int, str]]:
    """Name the first character of each line that no line may have: line and column from 1, and its name."""
    for number, line in enumerate(lines, 1):
        if match := _WRONG.search(line):
            yield number, match.start() + 1, named(match[0])


def named(character: str) -> str:
    return f"{_NAMES.get(character, 'control character')} (U+{ord(character):04X})"


def lines_of(text: str, where: str = "") -> list[str]:
    """Divide a text into lines. Raises Diagnostic with its line (`where:3`) for a character that no line may have."""
    lines = split_lines(text)
    for number, line in enumerate(lines, 1):
        check_line(line, where, number)
    return lines


def check_line(line: str, where: str = "", number: int = 1) -> None:
    """Raise Diagnostic for a character that no line may have."""
    if match := _WRONG.search(line):
        raise Diagnostic(f"{named(match[0])} in the line", _at(where, number), "delete it: lines end at LF or CR LF")


def escaped_toml(text: str) -> str:
    """Write out what `lines_of` refuses in TOML that a program made: only its texts in quotes hold any."""
    return _WRONG.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def why(problem: OSError | ValueError) -> str:
    """Describe why a file cannot be opened. ValueError: its name contains a NUL."""
    number = getattr(problem, "errno", None)
    return os.strerror(number) if number else str(problem)  # on Windows `strerror` is in the language of the system


_TOML = re.compile(
    r"""(?:["]{3}(?:\\.|[^\\])*?(?:["]{3}|\Z) | '{3}.*?(?:'{3}|\Z) | "(?:\\.|[^"\\\n])*"? | '[^'\n]*'? | \#[^\n]*)
      | (?P<mark>[][{}.\n=,])""",
    re.VERBOSE | re.DOTALL,
)
"""A text, a remark, or a mark that opens or ends a level. What is not closed extends to the end."""
_PLACE = re.compile(r" \(at line (\d+), column \d+\)$")
_LONG_NUMBER = re.compile(r"\d{1000}")


def toml_of(text: str, where: str) -> dict[str, Any]:
    """Parse TOML. Raises Diagnostic with the file (`where`), and the line where it is known."""
    import tomllib  # in 5 ms, which a command without TOML is spared

    lines_of(text, where)
    _check_marks(text, where)
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as error:
        problem = str(error)
        if place := _PLACE.search(problem):
            where, problem = _at(where, int(place[1])), problem[: place.start()]
        raise Diagnostic(f"not TOML: {problem}", where, "correct the line") from None
    except RecursionError:
        raise Diagnostic("not TOML: brackets without end", where, "correct the line") from None
    except ValueError:  # a number with more digits than Python reads
        if match := _LONG_NUMBER.search(text):
            where = _at(where, text.count("\n", 0, match.start()) + 1)
        raise Diagnostic("not TOML: a number without end", where, "correct the line") from None


Way = tuple[tuple[str, int], ...]
"""The way to a table or a key: names, each with its number in a list of tables; 0: it is no list."""


def toml_keys(text: str) -> Iterator[tuple[Way, int, bool]]:
    """Yield the way to each head and key of a TOML text that begins a line, its line, and whether it is a key."""
    counts: dict[str, int] = {}
    here: Way = ()
    for number, line in enumerate(split_lines(text), 1):
        if head := re.match(r"\s*\[(\[?)\s*([^\]]+?)\s*\]", line):
            names = toml_names(head[2])
            if head[1]:
                place = ".".join(names)
                counts = {key_path: n for key_path, n in counts.items() if not key_path.startswith(f"{place}.")}
                counts[place] = counts.get(place, 0) + 1
            here = tuple((name, counts.get(".".join(names[: n + 1]), 0)) for n, name in enumerate(names))
            yield here, number, False
        elif pair := re.match(r"\s*([^=#]+?)\s*=", line):
            yield (*here, *((name, 0) for name in toml_names(pair[1]))), number, True


def toml_names(dotted: str) -> list[str]:
    """The names of a head or a dotted key."""
    return [part.strip().strip("\"'") for part in dotted.split(".")]


def _check_marks(text: str, where: str) -> None:
    """Raise Diagnostic for brackets and dotted keys deeper than `DEEPEST_TABLES`, without parsing.

    Also raises it for a comment that divides a number in groups of digits: `position = 51#200`.
    """
    brackets = dots = 0
    for match in _TOML.finditer(text):
        mark = match["mark"]
        if mark is None:
            if match[0].startswith("#") and behind_number(text, at := match.start()):
                before = text[text.rfind("\n", 0, at) + 1 : at]
                if (divides := grouped_at(before + match[0], len(before))) is not None:
                    line = _at(where, text.count("\n", 0, at) + 1)
                    raise Diagnostic(f"not TOML: {divides.why}", line, "put a blank before a comment")
            continue
        if mark == ".":
            dots += 1
        elif mark in "[{":
            brackets += 1
        elif mark in "]}":
            brackets = max(brackets - 1, 0)
        if mark not in ".[]":
            dots = 0
        if brackets + dots > DEEPEST_TABLES:
            line = _at(where, text.count("\n", 0, match.start()) + 1)
            raise Diagnostic(f"not TOML: nested deeper than {DEEPEST_TABLES} levels", line, "flatten it")


def _at(where: str, line: int) -> str:
    return f"{where}:{line}" if where else f"line {line}"


def rows(module: str, name: str) -> Iterator[dict[str, str]]:
    """The rows of a table of a manual by its head line: a `.csv` file beside a module, whose `__file__` is given.

    There is a row for each word or number; it may leave out empty cells at its end.
    """
    import csv  # only who reads a table waits for it

    with open(os.path.join(os.path.dirname(module), name), encoding="utf-8", newline="") as table:
        yield from csv.DictReader(table, restval="")
