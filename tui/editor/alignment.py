"""The lines of a file and those in a drive: which line of the file has which address, where both hold one program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from dialects.program_files import Part

Parts = Callable[[str], Sequence[Part]]


def aligned(text: str, rows: Sequence[tuple[int, str]], parts: Parts) -> Mapping[int, int]:
    """Return the line of the file, from 0, by address; empty unless the lines of the drive are there once, in a row."""
    file = [(number, bare) for number, line in enumerate(text.split("\n")) if (bare := _bare(line, parts))]
    held = [_bare(line, parts) for _, line in rows]
    size = len(held)
    found = [at for at in range(len(file) - size + 1) if size and [bare for _, bare in file[at : at + size]] == held]
    if len(found) != 1:
        return {}
    return {address: number for (address, _), (number, _) in zip(rows, file[found[0] :], strict=False)}


def _bare(line: str, parts: Parts) -> str:
    """A line without its remark and its blanks, in capitals; `=` is a blank in most places."""
    end = next((part.start for part in parts(line) if part.kind == "remark"), len(line))
    return "".join(line[:end].upper().replace("=", " ").split())
