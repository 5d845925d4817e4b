"""The stop of a program's call, and its report."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from multidrop.shell import stop_report
from multidrop.shell.automation import settled

if TYPE_CHECKING:
    from multidrop.shell.session import Session as Shell


@dataclass(frozen=True)
class StopReport:
    """The state of the drives after a stop, as far as it is known. It reads as one line."""

    at_rest: bool
    """Every drive that it was for was read at velocity 0 since."""
    text: str

    def __str__(self) -> str:
        """Return the line."""
        return self.text


class Stopping:
    """A stop that is written. Await it for its report; it works without that, too."""

    def __init__(self, shell: Shell, tally: Callable[[], stop_report.Tally]) -> None:
        self._shell, self._tally = shell, tally

    def __await__(self) -> Generator[Any, None, StopReport]:
        """Wait until the stop is confirmed or not, 3 s at most."""
        return self._report().__await__()

    async def _report(self) -> StopReport:
        await settled(self._shell)
        tally = self._tally()
        return StopReport(tally.stand, stop_report.words(tally))
