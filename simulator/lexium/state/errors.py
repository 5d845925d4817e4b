"""Errors of a simulated MCode drive: raised by a line, and recorded for a program run."""

from __future__ import annotations

from dataclasses import dataclass


class Fault(Exception):
    """A drive's error, with its code (manual, section 10). `fatal` ends a program that has no error handler."""

    def __init__(self, code: int, fatal: bool = False) -> None:
        super().__init__(f"error {code}")
        self.code, self.fatal = code, fatal


@dataclass
class Failure:
    """A recorded error: its time, code and line of the linked program. `handled`: OE's subroutine was called."""

    t: float
    code: int
    line: int
    handled: bool = False
