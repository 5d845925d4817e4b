"""What goes wrong in a simulated MCode drive."""

from __future__ import annotations


class Fault(Exception):
    """A drive's error, with its code (manual, section 10). `fatal` ends a program that has no error handler."""

    def __init__(self, code: int, fatal: bool = False) -> None:
        super().__init__(f"error {code}")
        self.code, self.fatal = code, fatal
