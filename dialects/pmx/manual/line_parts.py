"""The parts of a line of A-SCRIPT for an editor, and the programs of a file."""

from __future__ import annotations

import re

from multidrop.dialects.pmx.manual.script_words import AXES, BLOCKS, WORDS
from multidrop.dialects.program_editing import Word
from multidrop.dialects.program_files import Entry, Part

_WORD = re.compile(r"[A-Za-z]\w*[+-]?", re.ASCII)
MOVE = re.compile(rf"([{AXES}](V?\d+)?)+", re.ASCII)
_PROGRAM = re.compile(r"PRG\s*(\d+)", re.ASCII)
_STARTS = re.compile(r"(HOME|HLHOME|LHOME|ZHOME|ZOME|JOG)[XY]|SR\d|JOYENA", re.ASCII)
_NUMBERED = ("PRG", "SUB", "GOSUB")


def parts(line: str) -> list[Part]:
    """Return the parts of a line that differ from plain text. Never fails."""
    code, semicolon, _ = line.partition(";")
    found = [
        Part(word.start, word.stop, kind)
        for word in words(line)
        if (kind := kind_of(word.text, not code[: word.start].strip()))
    ]
    return [*found, Part(len(code), len(line), "remark")] if semicolon else found


def words(line: str) -> list[Word]:
    """Return the words of a line; a sign at the end belongs to the words that have one."""
    found = []
    for match in _WORD.finditer(line.partition(";")[0]):
        text = match[0] if match[0] in WORDS else match[0].rstrip("+-")
        found.append(Word(match.start(), match.start() + len(text), text))
    return found


def kind_of(word: str, first: bool) -> str:
    """Return the kind of a word; `first`: it begins its line. Empty for an unknown word."""
    if first and (_STARTS.match(word) or MOVE.fullmatch(word)):
        return "starts"
    if word in BLOCKS:
        return "label" if word in _NUMBERED else "word"
    return "word" if word in WORDS or word[:4] == "WAIT" else ""


def entries(text: str) -> list[Entry]:
    """Return the numbers of the programs in a file, in order; lines without a PRG are program 0."""
    lines = [line.partition(";")[0].strip() for line in re.split(r"\r\n|\n|\r", text)]
    found = [
        Entry(match[1], number, f"SR{match[1]}=1")
        for number, line in enumerate(lines, 1)
        if (match := _PROGRAM.fullmatch(line))
    ]
    first = next((number for number, line in enumerate(lines, 1) if line), 0)
    return found or ([Entry("0", first, "SR0=1")] if first else [])
