"""Text files as people write them."""

from __future__ import annotations

from pathlib import Path

from dialects.errors import Diagnostic

LARGEST = 16 * 1024 * 1024
"""Bytes of a file that a person wrote, and far more; a device file has no end."""


def bytes_of(path: str | Path) -> bytes:
    """What is in a file. Raises Diagnostic."""
    where = str(path) or '""'
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise Diagnostic(f"cannot be read: {reason}", where) from error
    if len(data) > LARGEST:
        raise Diagnostic(f"is larger than {LARGEST // 1024**2} MB", where, "this is not a file that multidrop reads")
    return data


def text_of(path: str | Path) -> str:
    """A file's text, UTF-8 or Latin-1. Raises Diagnostic, also where it is no readable text."""
    data = bytes_of(path)
    if b"\0" in data:
        raise Diagnostic("is no text file", str(path), "a program is plain text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
