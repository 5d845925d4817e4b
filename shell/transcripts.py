"""The requests of a person to the transcripts on a screen: a filter, the form of times, a file."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

TIMES: Mapping[str, str] = {
    "off": "no times: more room for the lines",
    "clock": "the time of day",
    "start": "seconds since the first line",
    "last": "seconds since the line above",
}
"""How the times of lines are shown, and what each form means."""


class Filter(NamedTuple):
    """A filter. An empty one shows all; each condition hides some lines.

    `address`: only the records of a drive. `errors`: only failures and warnings, each with the line that failed.
    `mine`: only what a person typed, with its replies, and warnings. `text`: only records that hold it.
    """

    address: str = ""
    errors: bool = False
    mine: bool = False
    text: str = ""

    def __bool__(self) -> bool:
        return self != EVERYTHING

    @property
    def words(self) -> str:
        """The filter in words: `only b, errors`; empty where it shows all."""
        parts = [self.address, "errors" * self.errors, "mine" * self.mine, f'"{self.text}"' if self.text else ""]
        return f"only {', '.join(filter(None, parts))}" if self else ""


EVERYTHING = Filter()


@dataclass
class Transcripts:
    """What the transcripts of a front end with a screen can be asked."""

    times: Callable[[], str]
    """Returns the form of the times, a word of `TIMES`."""
    set_times: Callable[[str], None]
    """Shows times in another form."""
    choose: Callable[[Filter], None]
    """Shows only some lines of the selected bus."""
    save: Callable[[str], Awaitable[str]]
    """Writes the shown lines of the selected bus to a new file; returns what was written. Raises Diagnostic."""
    offer_unsent: Callable[[], Awaitable[None]]
    """Offers the lines that were held back or dropped last to a person, to be sent. Raises Diagnostic."""
