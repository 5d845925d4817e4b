"""The errors that a person reads: a refusal, a missing reply, a stop, a lost connection, or wrong input."""

from __future__ import annotations

from contextlib import suppress


class DriveError(Exception):
    """A request failed: refused, unanswered, damaged or stopped. One line, for a person."""


class Refused(DriveError):
    """The drive refused. `code` is its own error number, None where it gives none.

    Not `certain`: the error may be another's, and the line may have been executed.
    """

    def __init__(self, message: str, code: int | None = None, *, certain: bool = True) -> None:
        super().__init__(message)
        self.code = code
        self.certain = certain


class NoAnswer(DriveError):
    """No reply, or a damaged one: it is not known whether the command was executed."""


class Stopped(DriveError):
    """A stop came before the reply, or bars automation (see `/resume`)."""


class Inexpressible(DriveError):
    """The drive's language cannot express this: a line too long, a control character, an impossible name."""


class Differs(DriveError):
    """A drive does not hold what it should hold."""


class Timeout(DriveError, TimeoutError):
    """A wait ran out. What it waited for may still happen."""


class MotionFailed(DriveError):
    """A motion did not end as it should: at a limit, by a stall, by a stop of someone else, or nobody knows how.

    `position` and `target` are in the drive's own units, None where they are not known. `outcome` is the word that
    `/wait ended` gives (`limit`, `stall`, ...).
    """

    def __init__(
        self,
        message: str,
        reason: str = "",
        position: int | None = None,
        target: int | None = None,
        outcome: str = "unknown",
    ) -> None:
        super().__init__(message)
        self.reason, self.position, self.target, self.outcome = reason, position, target, outcome


class Unreferenced(DriveError):
    """A drive may have been restarted or moved while its line was lost, so nothing that moves it was sent."""


class TransportLost(Exception):
    """The pipe broke, or could not be opened. The text names the pipe and the reason."""

    unproven = ""
    """The command of which it is not known whether it was executed."""
    executed = ""
    """The last command that is known to be executed, where no other one is in doubt."""

    def again(self) -> TransportLost:
        """The same loss for another caller: places are noted on what each one is raised."""
        return type(self)(*self.args)


class Diagnostic(Exception):
    """Text that a person wrote is wrong: what, where (`file:line`, bus, verb) and the remedy."""

    def __init__(self, message: str, where: str = "", hint: str = "") -> None:
        self.message, self.where, self.hint = message, where, hint
        super().__init__(message)

    def __str__(self) -> str:
        head = f"{self.where}: " if self.where else ""
        tail = f"; {self.hint}" if self.hint else ""
        return f"{head}{self.message}{tail}"


class FeatureFailed(Diagnostic):
    """A function of a feature by others failed. If a log of defects is kept, its traceback is there already."""


PUBLIC = (
    DriveError,
    Refused,
    NoAnswer,
    Stopped,
    Inexpressible,
    Differs,
    Timeout,
    MotionFailed,
    Unreferenced,
    Diagnostic,
    TransportLost,
)
for _each in PUBLIC:
    _each.__module__ = "multidrop"  # a traceback shows the name by which a program catches it


def kind_and_text(failure: BaseException) -> str:
    """The kind of an error and its text, in one line. A text that raises is left out: others may have written it."""
    text = ""
    with suppress(Exception):
        text = " ".join(str(failure).split())
    return f"{type(failure).__name__}: {text}" if text else type(failure).__name__
