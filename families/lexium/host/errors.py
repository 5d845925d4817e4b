"""What a Lexium drive reported as its error, in words."""

from __future__ import annotations

from multidrop.dialects.state import DriveState
from multidrop.families.lexium.manual import errors


def report_error(state: DriveState, code: int) -> None:
    """Record an error that a person has read, and say what its number means."""
    state.error_flag_read(False, code)
    state.remark(described(code, state) + (", now cleared" if code else ""))


def earlier_error(code: int, state: DriveState) -> str:
    """Say what an error was that was read before a line, which is not to blame for it.

    An error of a line, such as 20 for one that a stop has cut off, is that of a program's motion at most.
    """
    known = state.errors
    if known.moving and (known.program or code in errors.BY_ITSELF):  # an older one was cleared as the motion began
        return f"an error since the last motion began, now cleared: {described(code, state)}"
    return f"an old error, now cleared: {described(code, state)}"


def described(code: int, state: DriveState) -> str:
    advice = errors.hint(code, state.product)
    return f"error {code}: {errors.text(code, state.product)}" + (f" ({advice})" if advice else "")
