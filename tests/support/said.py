"""What a line has a session say: everything that is printed, narrated or refused, marked by its kind."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.shell.events import By, Failed, Notified, Output, Printed
from tests.support.cell_session import CellSession, bus, drive, party, pmx

PLANT = (
    bus("press", party("a"), party("b"), baud=0),
    bus("pmx", pmx("00"), baud=0),
    bus("slide", drive("TMCM-1140", "1"), baud=0),
)
"""The lines on which transcripts are made."""

_CHANGING = (
    (r"usage: .*", "usage: ..."),
    (r"\d{4}-\d\d-\d\d[T -]\d\d:?\d\d:?\d\d(\+00:00)?", "TIME"),
    (r"(backups/TIME-[a-z-]*?)-\d+\.mxt", r"\1.mxt"),
    (r"since \d\d:\d\d:\d\d", "since TIME"),
)


async def said(shop: CellSession, line: str, by: By = By.OPERATOR) -> list[str]:
    """Run a line. `! ` marks a warning, `= ` an outcome, `- ` another notice, `x ` the error that ends the line."""
    shop.events.clear()
    refused = []
    try:
        await shop.session.run(line, replace(shop.session.origin, by=by))
    except (Diagnostic, DriveError, TransportLost) as error:
        refused = [f"x {error}"]
    return [*texts(shop), *refused]


def texts(shop: CellSession) -> list[str]:
    """What was said until now, marked in the same way."""
    found = []
    for event in shop.events:
        if isinstance(event, Output | Printed):
            found.append(event.text)
        elif isinstance(event, Notified):
            found.append(f"{'!' if event.warning else '=' if event.outcome else '-'} {event.text}")
    return found


async def transcript(shop: CellSession, lines: list[str], folder: Path) -> list[str]:
    """Run lines; return each after `> `, with what was said. The folder is `DIR`, a time of day `TIME`."""
    found = []
    for line in lines:
        found.append(f"> {line}")
        for text in await said(shop, line):
            for pattern, words in ((re.escape(str(folder)), "DIR"), *_CHANGING):
                text = re.sub(pattern, words, text)
            text = text.replace(os.sep, "/")
            found.append(f"  {text}".rstrip())
        failed = [each.text for each in shop.events if isinstance(each, Failed)]
        assert failed == [] or len(failed) == 1, "a line fails once"
    return found


async def compare(shop: CellSession, file: Path, folder: Path) -> None:
    """Run the lines of a transcript: each says what is there, and nothing else.

    With `SAID=renew` in the environment the file is written anew: look at each change.
    """
    expected = file.read_text(encoding="utf-8").splitlines()
    found = await transcript(shop, [each.removeprefix("> ") for each in expected if each.startswith("> ")], folder)
    if os.environ.get("SAID") == "renew":
        file.write_text("\n".join([*found, ""]), encoding="utf-8")
    assert found == expected
