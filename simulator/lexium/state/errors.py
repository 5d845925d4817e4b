"""What goes wrong in a simulated MCode drive."""

from __future__ import annotations

from dataclasses import dataclass


class Fault(Exception):
    """A drive's error, with its code (manual, section 10). `fatal` ends a program that has no error handler."""

    def __init__(self, code: int, fatal: bool = False) -> None:
        super().__init__(f"error {code}")
        self.code, self.fatal = code, fatal


@dataclass
class Failure:
    """An error that the drive has met: when, its code, the line of `Interpreter.code` it belongs to, and whether
    the subroutine of OE was called for it.
    """

    t: float
    code: int
    line: int
    handled: bool = False
