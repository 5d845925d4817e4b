"""Compiled programs in a controller: lines `SA0` to `SA1274`, read and written one by one.

What stands in them is the business of the compiler; here a line is a short token that is kept as it is. Every line that
is written is read back, as nothing else tells that the flash took it. (PMX-2ED-SA manual 7.19.1, table 9.0.)
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from dialects.base import Known, Progress, SourceLine, Talk
from dialects.errors import NoAnswer, Refused
from dialects.pmx.asking import answered, number, pmx, who

LINES = 1275
EMPTY = frozenset({"", "0", "XX0", "FF", "-1"})
"""What a line may say that was never written."""
BLANK = 16
"""So many empty lines one after another are the end of what is stored."""
RAW = re.compile(r"SA(\d{1,4})=(\S.*)", re.ASCII)


def listing(known: Known, start: str = "") -> Talk[tuple[str, ...]]:
    """`SAn=TOKEN` for every line that is stored, from a number on."""
    found: list[str] = []
    blank = 0
    for at in range(int(start) if start.isascii() and start.isdigit() else 0, LINES):
        token = yield from read_line(known, at)
        blank = blank + 1 if token in EMPTY else 0
        found.append(f"SA{at}={token}")
        if blank == BLANK:
            break
    return tuple(found[: len(found) - blank])


def read_line(known: Known, at: int) -> Talk[str]:
    """One stored line."""
    request = pmx(known).request(known.address, f"SA{at}")
    reply = yield from answered(known, request)
    return reply.text.strip()


def download(known: Known, lines: Sequence[SourceLine], progress: Progress) -> Talk[None]:
    """Write raw lines, each read back. Both programs must stand. Raises Refused or NoAnswer.

    Text that is no `SAn=TOKEN` is refused before anything is written: no compiler can know the codes of a real unit.
    """
    raw = []
    for line in lines:
        match = RAW.fullmatch(line.text.strip())
        if match is None:
            raise Refused(
                f"line {line.number}: '{line.text.strip()}' is no compiled line (SA0=...): this controller's codes are "
                "not public, so only lines that came from a unit are written; nothing was written"
            )
        raw.append((line.number, int(match[1]), match[2].strip()))
    for program in (0, 1):
        if (yield from number(known, f"SASTAT{program}")) in (1, 2):
            raise Refused(f"{who(known)}: program {program} runs; SR{program}=0 ends it (nothing was written)")
    for done, (source, at, token) in enumerate(raw, 1):
        yield from _write(known, source, at, token)
        progress(done, len(raw))


def _write(known: Known, source: int, at: int, token: str) -> Talk[None]:
    request = pmx(known).request(known.address, f"SA{at}={token}")
    try:
        yield from answered(known, request)
    except Refused as refused:
        raise Refused(f"line {source}: {refused}") from None
    written = yield from read_line(known, at)
    if written != token:
        raise NoAnswer(f"line {source}: {who(known)} has {written!r} at SA{at} after {token!r} was written")
