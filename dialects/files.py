"""Text files as people write them."""

from __future__ import annotations

from pathlib import Path

from dialects.errors import Diagnostic


def text_of(path: str | Path) -> str:
    """A file's text, UTF-8 or Latin-1. Raises Diagnostic, also where it is no readable text."""
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise Diagnostic(f"cannot be read: {reason}", str(path)) from error
    if b"\0" in data:
        raise Diagnostic("is no text file", str(path), "a program is plain text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
