"""Breadth-first walks through the statements of a program, which are numbered."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping

Ways = Callable[[int], Iterable[int]]
"""Gives the statements that may be executed after a statement."""


def walk(starts: Iterable[int], ways: Ways) -> dict[int, int | None]:
    """Return the statements that are reached, nearest first, each with the one before it; None for a start."""
    before: dict[int, int | None] = dict.fromkeys(starts)
    queue = deque(before)
    while queue:
        place = queue.popleft()
        for each in ways(place):
            if each not in before:
                before[each] = place
                queue.append(each)
    return before


def way_to(place: int, before: Mapping[int, int | None]) -> Iterator[tuple[int, int]]:
    """Yield the steps of a walk to a statement, the last one first: from where, and to where."""
    while (previous := before[place]) is not None:
        yield previous, place
        place = previous


def nearest(starts: Iterable[int], ways: Ways, wanted: Callable[[int], bool], most: int) -> int | None:
    """Find the nearest wanted statement; None if none is among the first `most` ones."""
    seen = dict.fromkeys(starts)
    queue = deque(seen)
    while queue and len(seen) <= most:
        place = queue.popleft()
        if wanted(place):
            return place
        for each in ways(place):
            if each not in seen:
                seen[each] = None
                queue.append(each)
    return None
