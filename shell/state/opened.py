"""The URLs opened last, in the state folder."""

from __future__ import annotations

import contextlib
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from multidrop.base.store import Store

MOST_OPENED = 12
OPENED = "opened.json"


@dataclass(frozen=True)
class RecentOpening:
    """A URL as it was typed, or the name of a saved connection, and when it was opened (s since 1970)."""

    url: str
    at: float


def lately(folder: Path) -> list[RecentOpening]:
    """The URLs opened last, the newest first."""

    def parse(found: Any) -> list[RecentOpening]:
        return [RecentOpening(str(row["url"]), float(row["at"])) for row in found["opened"]][:MOST_OPENED]

    return Store(folder).find(OPENED, parse) or []


def note(folder: Path, url: str) -> None:
    rows = [RecentOpening(url, time.time()), *(opened for opened in lately(folder) if opened.url != url)][:MOST_OPENED]
    with contextlib.suppress(OSError):
        Store(folder).write(OPENED, {"opened": list(map(asdict, rows))}, 1)
