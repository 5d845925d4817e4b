"""Program files by language: what loads and checks one, and makes one of what is in a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from dialects.base import DriveState, Procedure, SourceLine
from dialects.mcode.host import upload as mcode
from dialects.pmx.host import upload as pmx
from dialects.problems import Problem


class Source(Protocol):
    """Program files of one language."""

    @property
    def ENDINGS(self) -> tuple[str, ...]:  # noqa: N802
        """What the names of its files end in."""

    def load(self, path: str | Path) -> Sequence[SourceLine]:
        """The lines to download. Raises Diagnostic."""

    def check(self, text: str, product: str = "") -> list[Problem]:
        """Everything that is wrong, as far as the text tells, on a product where that matters."""

    def measure(self, text: str) -> str:
        """How long a program is that is right, for a person. Raises Diagnostic where it is not."""

    def readable(self, state: DriveState) -> Procedure[tuple[str, ...]]:
        """The program in a drive, to be read."""

    def upload(self, state: DriveState, raw: bool) -> Procedure[tuple[str, ...]]:
        """The program in a drive as the lines of a file that can be downloaded. Raises Diagnostic: there is none."""


SOURCES: Mapping[str, Source] = {"mcode": mcode, "pmx": pmx}
"""By `Dialect.language`."""
NAMES: Mapping[str, str] = {"mcode": "MCode", "pmx": "A-SCRIPT"}
DEFAULT = "mcode"


def language_of(path: str | Path) -> str:
    """The language of a file by the end of its name."""
    ending = Path(path).suffix.lower()
    return next((name for name, source in SOURCES.items() if ending in source.ENDINGS), DEFAULT)
