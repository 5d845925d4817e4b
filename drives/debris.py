"""Debris of a stop on the wire: pieces of the reply and echo that it cut off, and replies to the stop itself.

None of it is program output, and none is shown. A line that may be program output is shown.
"""

from __future__ import annotations

import re

from dialects import Request

LASTS = 0.5
"""How long after the last byte of a stop its debris may come, s."""
GARBLED = re.compile(r"[^\t -~]")
"""Two drives that replied at once; a print has no such characters unless it wants them."""
SCRAP = re.compile(r'[-\w]{0,2}["!~]+[-\w ]{0,2}"?')
"""A piece of the name between two values, with what ran into it: a digit and the sign of a stop make a space."""


class Debris:
    """What was written last, and how long the debris of a stop may come. Times are seconds."""

    def __init__(self) -> None:
        self._sent = ""
        self._asked: Request | None = None
        self._until = float("-inf")

    def request_written(self, data: bytes, request: Request, now: float) -> None:
        """Note a request that the next stop may cut off. Within the debris of a stop, what was written adds up."""
        text = data.decode("latin-1")
        self._sent = self._sent + text if now <= self._until else text
        self._asked = request

    def stop_written(self, data: bytes, transmitted: float) -> None:
        """Note a stop. `transmitted`: when its last byte has left."""
        self._sent += data.decode("latin-1")
        self._until = transmitted + LASTS

    def stop_repeated(self, transmitted: float) -> None:
        """Note that the stop was written once more."""
        self._until = transmitted + LASTS

    def removed(self, lines: tuple[str, ...], stop_sign: str, now: float) -> tuple[str, ...]:
        """Unsolicited lines without debris. `stop_sign` is what ends a drive's reply to a stop."""
        if now > self._until:
            return lines
        return tuple(text for text in lines if not self._holds(text, stop_sign))

    def _holds(self, text: str, stop_sign: str) -> bool:
        text = text.lstrip(">?").strip()
        return (
            (bool(stop_sign) and text.endswith(stop_sign))
            or text in self._sent
            or GARBLED.search(text) is not None
            or SCRAP.fullmatch(text) is not None
            or self._answers(text)
        )

    def _answers(self, text: str) -> bool:
        expect = self._asked.expect if self._asked is not None else None
        return expect is not None and re.fullmatch(expect, text) is not None
