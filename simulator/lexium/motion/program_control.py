"""The operations that motion needs on the running program."""

from __future__ import annotations

from typing import Protocol

from multidrop.dialects.mcode.manual.grammar import Argument


class ProgramControl(Protocol):
    """The running program, as motion sees it; the interpreter is one."""

    def raise_error(self, code: int) -> None:
        """Set an error that no line has caused, and call its handler."""

    def interrupt(self, target: Argument | None, t: float) -> None:
        """Call a subroutine before the next line; None: call nothing."""

    def finish(self) -> None:
        """End the program."""

    def drop_motion(self) -> None:
        """Forget the motion that a pause has stopped: RS does not take it up."""
