r"""A text file under editing: read once, saved whole, never over what another program has written meanwhile.

An editor splits a text at more characters than a program file does, and a terminal acts upon control characters. So
the edited text has a stand-in for each of them, from U+F700 on; a saved file has the characters again.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import bytes_of, decoded, why
from multidrop.dialects.text import ACTING

LARGEST = 512 * 1024
"""Bytes; many times what a drive holds, and as much as an editor takes with ease."""
_ACT = [code for low, high in ACTING if low != 0xD800 for code in range(low, high + 1) if chr(code) not in "\n\t"]
_STAND_IN_OF = {code: chr(0xF700 + number) for number, code in enumerate(_ACT)}
_REAL = {ord(shown): chr(code) for code, shown in _STAND_IN_OF.items()}
STAND_INS = "".join(_STAND_IN_OF.values())
"""The characters of an edited text that stand for others."""


class ChangedMeanwhile(Diagnostic):
    """The file on the disk is not the one that was opened."""


class EditedFile:
    """A file and its content when it was last read or written. `text` has LF line ends and stand-ins."""

    def __init__(self, path: str | Path) -> None:
        """Read the file; one that does not exist is empty. Raises Diagnostic."""
        self.path = Path(path)
        self._data = _content(self.path)
        text, self.encoding = decoded(self._data or b"")
        if _REAL.keys() & set(map(ord, text)):
            raise Diagnostic("holds characters of the private area U+F700", str(self.path), "edit it elsewhere")
        ends = re.findall(_end(text), text)
        self.newline = max(set(ends), key=ends.count) if ends else "\n"
        self.mixed = len(set(ends)) > 1
        """The line ends differ; a save makes them one kind."""
        self.text = edited(text)

    @property
    def new(self) -> bool:
        """True if the file did not exist when it was last read or written."""
        return self._data is None

    def save(self, text: str, over: bool = False) -> None:
        """Write the text, whole or not at all. `over`: also over a file that changed meanwhile.

        Raises ChangedMeanwhile, or Diagnostic where it cannot be written; the file is then as it was.
        """
        from multidrop.macros.atomic import create_atomically, write_atomically

        data = self._encoded(text)
        now = _content(self.path)
        if now != self._data and not over:
            what = "is new on the disk" if self._data is None else "has changed on the disk since it was read"
            raise ChangedMeanwhile(what if now is not None else "is gone from the disk", str(self.path))
        if now is not None and not os.access(self.path, os.W_OK):  # a replacement would not heed that
            raise Diagnostic("cannot be written: it is read-only", str(self.path), "the file is as it was")
        try:
            if now is None:
                create_atomically(self.path, data)
            else:
                write_atomically(self.path, data)
        except (OSError, ValueError) as problem:
            hint = "nothing was saved" if now is None else "the file is as it was"
            raise Diagnostic(f"cannot be written: {why(problem)}", str(self.path), hint) from None
        self._data, self.text, self.mixed = data, text, False

    def _encoded(self, text: str) -> bytes:
        real = real_text(text)
        try:
            return real.replace("\n", self.newline).encode(self.encoding)
        except UnicodeEncodeError as problem:
            line = real.count("\n", 0, problem.start) + 1
            what = f"{real[problem.start]!r} cannot be written: the file is {self.encoding}"
            raise Diagnostic(what, f"{self.path}:{line}", "nothing was saved; replace the character") from None


def edited(text: str) -> str:
    """Return a text for an editor: LF line ends, and stand-ins for characters that act."""
    return re.sub(_end(text), "\n", text).translate(_STAND_IN_OF)


def _end(text: str) -> str:
    """Match the line ends of a text as `split_lines` divides it."""
    return "\r?\n" if "\n" in text else "\r"


def real_text(text: str) -> str:
    """Return an edited text with the characters for which others stand in, and LF line ends."""
    return text.translate(_REAL)


def _content(path: Path) -> bytes | None:
    """Read a file; None without one. Raises Diagnostic, also for a file that is not text."""
    if not os.path.lexists(path):
        return None
    if not path.is_file():
        raise Diagnostic("is not a regular file", str(path), "name a text file")
    data = bytes_of(path)
    if len(data) > LARGEST:
        raise Diagnostic(f"is larger than {LARGEST // 1024} KB", str(path), "no drive holds such a program")
    if b"\0" in data:
        raise Diagnostic("is not a text file", str(path), "a program is plain text")
    return data
