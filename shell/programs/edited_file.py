r"""A text file under editing: read once, saved whole, never over what another program has written meanwhile.

An editor splits a text at more characters than a program file does, and a terminal acts upon control characters. So
the edited text has a stand-in for each of them, from U+F700 on; a saved file has the characters again.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.base.files import bytes_of, decoded, why
from multidrop.base.store import digest
from multidrop.base.text import ACTING

LARGEST_FILE = 512 * 1024
"""Bytes; many times what a drive holds, and as much as an editor takes with ease."""
_ACT = [code for low, high in ACTING if low != 0xD800 for code in range(low, high + 1) if chr(code) not in "\n\t"]
_STAND_IN_OF = {code: chr(0xF700 + number) for number, code in enumerate(_ACT)}
_REAL = {ord(shown): chr(code) for code, shown in _STAND_IN_OF.items()}
STAND_INS = "".join(_STAND_IN_OF.values())
"""The characters of an edited text that stand for others."""
_OTHER = b"\0"
"""A content that no file under editing has."""


class ChangedMeanwhile(Diagnostic):
    """The file on the disk is not the one that was opened. `seen` is what it holds now; None: there is no file."""

    def __init__(self, message: str, where: str, seen: bytes | None) -> None:
        super().__init__(message, where)
        self.seen = seen


class EditedFile:
    """A file and its content when it was last read or written. `text` has LF line ends and stand-ins."""

    def __init__(self, path: str | Path) -> None:
        """Read the file; one that does not exist is empty. Raises Diagnostic."""
        self._take(Path(path), _content(Path(path)))

    @classmethod
    def _of(cls, path: Path, data: bytes) -> EditedFile:
        made = cls.__new__(cls)
        made._take(path, data)
        return made

    def _take(self, path: Path, data: bytes | None) -> None:
        """Take the content of a file. Raises Diagnostic for one that no editor can hold."""
        self.path, self._data = path, data
        text, self.encoding = decoded(data or b"")
        if _REAL.keys() & set(map(ord, text)):
            raise Diagnostic("holds characters of the private area U+F700", str(self.path), "edit it elsewhere")
        ends = re.findall(_end(text), text)
        self.newline = max(set(ends), key=ends.count) if ends else "\n"
        self.mixed = len(set(ends)) > 1
        """The line ends differ; a save makes them one kind."""
        self.text = edited(text)

    @property
    def data(self) -> bytes | None:
        """The content of the file when it was last read or written; None: there was no file."""
        return self._data

    def look(self) -> Outside:
        """Compare the file on the disk, byte by byte, with what was last read or written. For a thread."""
        try:
            data = _content(self.path)
            if data == self._data:
                return Outside()
            if data is None:
                return Outside("is gone from the disk", gone=True)
            now = EditedFile._of(self.path, data)
        except Diagnostic as problem:
            return Outside(f"cannot be read again: {problem.message}")
        return Outside("is new on the disk" if self._data is None else "has changed on the disk", now)

    @property
    def digest(self) -> str:
        """A short name for the content when it was last read or written; the same for every file that is not there."""
        return digest((self._data or b"").decode("latin-1"), 32)

    def outdated(self) -> None:
        """Note that the text under editing was made of another content than the file has: a save asks."""
        self._data = _OTHER

    def lost(self) -> None:
        """Note that the file is gone from the disk: its text is not saved any more."""
        self._data, self.text = None, ""

    @property
    def new(self) -> bool:
        """True if the file did not exist when it was last read or written."""
        return self._data is None

    def save(self, text: str, over: ChangedMeanwhile | None = None) -> None:
        """Write the text, whole or not at all. `over`: also over the content that a person was told about.

        Raises ChangedMeanwhile, or Diagnostic where it cannot be written; the file is then as it was.
        """
        from multidrop.base.atomic import create_atomically, write_atomically

        data = self._encoded(text)
        now = _content(self.path)
        if now not in (self._data, data) and (over is None or now != over.seen):
            what = "is new on the disk" if self._data is None else "has changed on the disk since it was read"
            raise ChangedMeanwhile(what if now is not None else "is gone from the disk", str(self.path), now)
        if now == data != self._data:  # another program has saved this text
            self._data, self.text, self.mixed = data, text, False
            return
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


@dataclass(frozen=True)
class Outside:
    """What another program did to an open file, in words (empty: it is as it was), and the file as it is now."""

    said: str = ""
    now: EditedFile | None = None
    """None: it cannot be read."""
    gone: bool = False


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
    if len(data) > LARGEST_FILE:
        raise Diagnostic(f"is larger than {LARGEST_FILE // 1024} KB", str(path), "no drive holds such a program")
    if b"\0" in data:
        raise Diagnostic("is not a text file", str(path), "a program is plain text")
    return data
