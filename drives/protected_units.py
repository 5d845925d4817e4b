"""Failures that a unit's protection may cause: the message of a drive behind a network port names it.

A protected unit is silent, or refuses every value. The host cannot tell that from another cause, so it says "may".
"""

from __future__ import annotations

from typing import TypeVar

from multidrop.base.errors import Refused
from multidrop.dialects.family import Family, Protection
from multidrop.drives.link import Link

E = TypeVar("E", bound=Exception)
ENOUGH = 2
"""Different words whose values were refused, while none was taken, from which on a refusal names the protection."""


def protection(link: Link, family: type[Family] | Family) -> Protection | None:
    """What may protect the drives of a link; None: nothing that is known."""
    return family.protection if link.transport.network else None


def silent(error: E, link: Link, family: type[Family] | Family, product: str = "") -> E:
    """Return the failure, with the protection that may cause it where nothing was ever received on the link."""
    known = protection(link, family) if link.unheard else None
    text = known.text(product) if known is not None else ""
    return type(error)(f"{error}; {known.besides}{text}") if known is not None and text else error


class TakenValues:
    """The values that a drive has taken or refused in this session."""

    def __init__(self) -> None:
        self._refused: set[str] = set()
        self._taken = False

    def took(self, known: Protection | None, line: str) -> None:
        if known is not None and not self._taken:
            self._taken = bool(known.word(line))

    def refused(self, known: Protection | None, line: str, error: Refused, product: str) -> Refused:
        """Return the refusal, with the protection that may cause it where every value so far was refused."""
        if known is None or self._taken or not (word := known.word(line)):
            return error
        self._refused.add(word)
        text = known.text(product) if len(self._refused) >= ENOUGH else ""
        return (
            Refused(f"{error}; every value so far was refused: {text}", error.code, certain=error.certain)
            if text
            else error
        )
