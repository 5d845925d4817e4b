"""Text files that people write."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from typing import TYPE_CHECKING, Any, Protocol

from dialects.errors import Diagnostic

if TYPE_CHECKING:
    from pathlib import Path

LARGEST = 16 * 1024 * 1024
"""Bytes; more than any such file has, since a device file has no end."""


class SourceLine(Protocol):
    """A line of a program file, without comments."""

    @property
    def number(self) -> int:
        """Its line in the file, from 1."""

    @property
    def text(self) -> str:
        """The text to send to the drive."""


def bytes_of(path: str | Path) -> bytes:
    """Read a file. Raises Diagnostic."""
    where = str(path) or '""'
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        raise Diagnostic(f"cannot be read: {why(error)}", where) from error
    if len(data) > LARGEST:
        raise Diagnostic(f"is larger than {LARGEST // 1024**2} MB", where, "this is not a file that multidrop reads")
    return data


def text_of(path: str | Path) -> str:
    """Read a text file, UTF-8 or Latin-1. Raises Diagnostic, also for a binary file."""
    return encoded_text_of(path)[0]


def encoded_text_of(path: str | Path) -> tuple[str, str]:
    """Read a text file; return its text, and the encoding that gives the same bytes again. Raises Diagnostic."""
    data = bytes_of(path)
    if b"\0" in data:
        raise Diagnostic("is not a text file", str(path), "a program is plain text")
    encoding = "utf-8-sig" if data.startswith(BOM_UTF8) else "utf-8"
    try:
        return data.decode(encoding), encoding
    except UnicodeDecodeError:
        return data.decode("latin-1"), "latin-1"


def why(problem: OSError | ValueError) -> str:
    """Describe why a file cannot be opened. ValueError: its name contains a NUL."""
    return getattr(problem, "strerror", None) or str(problem)


_PLACE = re.compile(r" \(at line (\d+), column \d+\)$")
_LONG_NUMBER = re.compile(r"\d{1000}")


def toml_of(text: str, where: str) -> dict[str, Any]:
    """Parse TOML. Raises Diagnostic with the file (`where`), and the line where it is known."""
    import tomllib  # in 5 ms, which a command without TOML is spared

    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem = str(error)
        if place := _PLACE.search(problem):
            where, problem = _at(where, int(place[1])), problem[: place.start()]
        raise Diagnostic(f"not TOML: {problem}", where, "correct the line") from None
    except RecursionError:
        raise Diagnostic("not TOML: brackets without end", where, "correct the line") from None
    except ValueError:  # a number with more digits than Python reads
        if found := _LONG_NUMBER.search(text):
            where = _at(where, text.count("\n", 0, found.start()) + 1)
        raise Diagnostic("not TOML: a number without end", where, "correct the line") from None


def _at(where: str, line: int) -> str:
    return f"{where}:{line}" if where else f"line {line}"
