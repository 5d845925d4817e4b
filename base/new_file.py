"""Text files that appear whole or not at all, and replace no other file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.base.files import why

STANDARD_OUTPUT = "-"
"""The file that is standard output, wherever a text is written."""


def check(path: str | Path, *, printed: bool = False) -> None:
    """Check that a new file can have this name, before there is a text for it. Raises Diagnostic.

    `printed`: `-` is standard output; otherwise it is refused, and no file has this name.
    """
    if path == STANDARD_OUTPUT:
        if not printed:
            raise Diagnostic("is standard output, which is not written to here", path, "name a new file")
        return
    check_folder(path)
    if not os.path.basename(path):
        raise Diagnostic("is not a file's name", str(path) or '""', "name a new file")
    try:
        os.lstat(path)
    except FileNotFoundError:
        return
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    raise Diagnostic("exists already", str(path), "name a new file")


def check_space(path: str, size: int) -> None:
    """Check that the disk takes a new file of this size, before there is a text for it. Raises Diagnostic."""
    check(path, printed=True)
    if path == STANDARD_OUTPUT:
        return
    from multidrop.base.atomic import create_atomically

    probe = Path(path).with_name(f".{os.path.basename(path)}.{os.urandom(4).hex()}")
    try:
        create_atomically(probe, bytes(size))
        probe.unlink()
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", path) from None


def check_folder(path: str | Path) -> None:
    """Raise Diagnostic where the folder of a file to write does not exist: a wrong name makes no folders."""
    if not os.path.isdir(os.path.dirname(os.path.abspath(path))):
        raise Diagnostic("its folder does not exist", str(path), "make the folder first")


def place(path: str) -> str:
    """The words for where a text is now: ` in FILE`, or nothing on standard output."""
    return "" if path == STANDARD_OUTPUT else f" in {path}"


def write(path: str | Path, text: str, output: Callable[[str], None] | None = None) -> None:
    """Write it. Raises Diagnostic; then there is no such file, or it is another's. `output` takes the lines of `-`."""
    if path == STANDARD_OUTPUT and output is not None:
        for line in text.removesuffix("\n").split("\n"):
            output(line)
        return
    check(path)
    from multidrop.base.atomic import create_atomically  # more than most commands need

    try:
        create_atomically(Path(path), text.encode())
    except FileExistsError:
        raise Diagnostic("exists already", str(path), "name a new file") from None
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
