"""What a stop leaves on the wire: pieces of the answer and the echo that it cut off, and answers to the stop itself.

None of that is a line of a program's, and none is shown. A line that may as well be one is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from dialects import Request

LASTS = 0.5
"""Seconds behind a stop's last byte for which its debris may come."""
GARBLED = re.compile(r"[^\t -~]")
"""Two drives that answered at once; a print has no such characters unless it wants them."""
SCRAP = re.compile(r'[-\w]{0,2}["!~]+[-\w]{0,2}')
"""A piece of the name between two values, and of what ran into it."""


@dataclass
class Wreck:
    """`sent` is what was written last, the stop and the request that it cut off; `asked` is that request."""

    sent: str = ""
    asked: Request | None = None
    until: float = float("-inf")

    def holds(self, text: str, sign: str, now: float) -> bool:
        """Whether a line that nobody asked for is debris; `sign` is what ends a drive's answer to a stop."""
        if now > self.until:
            return False
        text = text.lstrip(">?").strip()
        ends = bool(sign) and text.endswith(sign)
        scrap = GARBLED.search(text) or SCRAP.fullmatch(text)
        return ends or text in self.sent or scrap is not None or self._answers(text)

    def _answers(self, text: str) -> bool:
        expect = self.asked.expect if self.asked is not None else None
        return expect is not None and re.fullmatch(expect, text) is not None
