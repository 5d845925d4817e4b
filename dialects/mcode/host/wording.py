"""Phrases that several messages about an MCode drive share."""

from __future__ import annotations

from multidrop.dialects.codec import Request
from multidrop.dialects.mcode.manual import errors
from multidrop.dialects.state import DriveState


def who(state: DriveState) -> str:
    """Name a drive in a message."""
    return state.address or "the drive"


def unknown(state: DriveState, request: Request) -> str:
    """Report a command that had no reply."""
    return f"{who(state)} does not reply: it is not known whether '{request.text}' was executed; it was sent once"


def described(code: int, state: DriveState) -> str:
    """Number, meaning and remedy of an error."""
    advice = errors.hint(code, state.product)
    return f"error {code}: {errors.text(code, state.product)}" + (f" ({advice})" if advice else "")
