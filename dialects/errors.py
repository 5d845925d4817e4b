"""The errors that a person meets: a drive said no or nothing, a stop came, or what was typed is wrong."""

from __future__ import annotations


class DriveError(Exception):
    """A request did not do what was asked: refused, unanswered, damaged or stopped. One line, for a person."""


class Refused(DriveError):
    """The drive refused. `code` is its own error number (MCode: section 10), None where it gives none."""

    def __init__(self, message: str, code: int | None = None) -> None:
        super().__init__(message)
        self.code = code


class NoAnswer(DriveError):
    """No answer, or a damaged one: it is not known whether the command was executed."""


class Stopped(DriveError):
    """A stop came before the answer did, or stands against automation (see `/resume`)."""


class Inexpressible(DriveError):
    """The drive's language cannot say this: a line too long, a control character, a name it cannot bear."""


class Diagnostic(Exception):
    """Text that a person wrote is wrong: what, where (`file:line`, bus, verb) and what to do about it."""

    def __init__(self, message: str, where: str = "", hint: str = "") -> None:
        self.message, self.where, self.hint = message, where, hint
        super().__init__(message)

    def __str__(self) -> str:
        """The whole as one line."""
        head = f"{self.where}: " if self.where else ""
        tail = f"; {self.hint}" if self.hint else ""
        return f"{head}{self.message}{tail}"
