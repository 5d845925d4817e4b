"""The result of each executed line, for reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from shell.scripts.model import ScriptLine


@dataclass(frozen=True)
class Result:
    """What one line did. `sent` is the line with its values; `bus` and `drive` are empty for a verb."""

    line: ScriptLine
    sent: str
    time: datetime
    seconds: float
    printed: tuple[str, ...] = ()
    bus: str = ""
    drive: str = ""
    error: str = ""
    """Empty: the line succeeded."""
    failed_check: bool = False
    """The line is a check, and the check failed."""

    @property
    def ok(self) -> bool:
        """Whether the line succeeded."""
        return not self.error

    @property
    def check(self) -> bool:
        """Whether the line checks something."""
        return bool(self.line.file) and self.line.word in ("/assert", "/expect")

    def fact(self) -> dict[str, Any]:
        """The result as an object for programs; what is empty is left out."""
        place = {"file": self.line.file} if self.line.file else {}
        where = {key: value for key, value in (("bus", self.bus), ("drive", self.drive)) if value}
        time = {"time": self.time.isoformat(timespec="milliseconds")}
        error = {"error": self.error} if self.error else {}
        fields = {"line": self.line.number, "sent": self.sent, "printed": list(self.printed), "ok": self.ok}
        return place | fields | where | time | error


Executed = Callable[[Result], None]
"""Takes the result of each line as it ends."""
