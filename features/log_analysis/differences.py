"""The first difference between the last sessions of two logs, in less time than reading all their entries takes."""

from __future__ import annotations

import re
from collections import defaultdict, deque
from functools import partial
from itertools import islice
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.features.log_analysis.log_parts import BLOCK, LogBlock, blocks_back, newest, open_part, rotated, steady
from multidrop.shell.log.files import LogLine, entry_of, parts

_PLACE = rb'(?:, "bus": "(?:[^"\\]|\\.)*")?(?:, "drive": "(?:[^"\\]|\\.)*")?'
_STEP = re.compile(rb'"kind": "(?:typed|printed|unsolicited|failed|stop)"[^\n]*\}(?=\r?$)', re.MULTILINE)
_STEP_PLACE = re.compile(rb'"kind": "[a-z]+"' + _PLACE)
_BY = tuple(f', "by": "{word}"'.encode() for word in ("operator", "macro", "script"))


class Run:
    """The steps of the last session in a log: lines typed and printed, failures, stops; without times and origins."""

    def __init__(self, path: Path) -> None:
        """Read it. Raises Diagnostic."""
        steady(path, partial(self._read, path))

    def _read(self, path: Path) -> None:
        self._blocks: list[tuple[Path, int, int, int]] = []
        """Of each block the part, its offset, its size and its lines."""
        found: list[list[bytes]] = []
        readable = False
        for block in blocks_back(parts(path)):
            readable = readable or next(newest(block), None) is not None
            found.append(_STEP.findall(block.data))
            self._blocks.append((block.path, block.offset, len(block.data), block.data.count(b"\n")))
        self._counts = [len(each) for each in reversed(found)]
        self._blocks.reverse()
        self.steps = [step for each in reversed(found) for step in each]
        if not readable:
            raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")

    def line(self, index: int) -> LogLine:
        """The line of a step. Raises Diagnostic where that is no entry, or the log was rotated since it was read."""
        step = self.steps[index]
        before: dict[Path, int] = {}
        for (path, offset, size, lines), count in zip(self._blocks, self._counts, strict=True):
            if path not in before:
                before[path] = _count(path, offset)
            if index < count:
                number = before[path]
                with open_part(path) as file:
                    file.seek(offset)
                    block = LogBlock(path, offset, file.read(size), False)
                match = next(islice(_STEP.finditer(block.data), index, None), None)
                if match is None or match[0] != step:
                    raise rotated(path)
                begin, data = block.line(match.start())
                line = LogLine(path, number + block.data.count(b"\n", 0, begin) + 1, data, entry_of(data))
                if line.entry is None:
                    raise Diagnostic("is not an entry of a session log", line.where, "the log is damaged there")
                return line
            index -= count
            before[path] += lines
        raise IndexError(index)


def _count(path: Path, size: int) -> int:
    """The lines in the first bytes of a file."""
    with open_part(path) as file:
        file.seek(0)
        return sum(file.read(min(BLOCK, size - begin)).count(b"\n") for begin in range(0, size, BLOCK))


def _bare(step: bytes) -> bytes:
    """A step without its origin."""
    for word in _BY:
        step = step.replace(word, b"")
    return step


def first_difference(one: Run, other: Run) -> tuple[int | None, int | None] | None:
    """The indices of the first steps that differ, None where a run has no step any more; None: there is no difference.

    Each drive has an order of its own: a step is compared with that of the same place.
    """
    runs = one.steps, other.steps
    low, high = 0, min(map(len, runs))
    while low < high:  # the longest equal beginning
        middle = (low + high + 1) // 2
        low, high = (middle, high) if runs[0][low:middle] == runs[1][low:middle] else (low, middle - 1)
    waiting: dict[bytes, tuple[deque[int], deque[int]]] = defaultdict(lambda: (deque(), deque()))
    for index in range(low, max(map(len, runs))):
        for side, steps in enumerate(runs):
            if index >= len(steps):
                continue
            match = _STEP_PLACE.match(steps[index])
            queues = waiting[match[0].partition(b",")[2] if match else b""]
            if not queues[1 - side]:
                queues[side].append(index)
            elif _bare(runs[1 - side][before := queues[1 - side].popleft()]) != _bare(steps[index]):
                return (index, before) if side == 0 else (before, index)
    rests = [(queue[0], side) for queues in waiting.values() for side, queue in enumerate(queues) if queue]
    if not rests:
        return None
    index, side = min(rests)
    return (index, None) if side == 0 else (None, index)
