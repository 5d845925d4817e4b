"""Text files that appear whole or not at all, and replace no other file."""

from __future__ import annotations

import os
from pathlib import Path

from dialects import Diagnostic
from dialects.files import why


def check(path: str | Path) -> None:
    """Check that a new file can have this name, before there is a text for it. Raises Diagnostic."""
    if os.path.lexists(path):
        raise Diagnostic("exists already", str(path), "name a new file")
    if not os.path.isdir(os.path.dirname(os.path.abspath(path))):
        raise Diagnostic("its folder does not exist", str(path), "make the folder first")


def write(path: str | Path, text: str) -> None:
    """Write it. Raises Diagnostic; then there is no such file, or it is another's."""
    from macros.atomic import create_atomically  # more than most commands need

    try:
        create_atomically(Path(path), text.encode())
    except FileExistsError:
        raise Diagnostic("exists already", str(path), "name a new file") from None
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
