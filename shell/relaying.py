"""What `multidrop relay` lends besides serial ports: features add it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from multidrop.base import registry

_NAMED = re.compile(r"([a-z][a-z0-9]*:)(?!//)")


class Lent(NamedTuple):
    """What `multidrop relay NAME:REST` lends."""

    name: str
    """With the colon: `screen:`."""
    meaning: str
    """What it is, for the help on PORT."""
    lend: Callable[[str], None]
    """Lends it to the other end of standard input and output until that is gone; from REST.

    Raises Diagnostic, Unreachable.
    """

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return (f"relay {self.name}",)


def lender(port: str) -> Lent | None:
    """What is lent under a name; None: it is a serial port. Raises Diagnostic where its feature is not there."""
    named = _NAMED.match(port)
    if named is None:
        return None
    return next((lent for lent in registry.answering(Lent, f"relay {named[1]}") if lent.name == named[1]), None)


def ports() -> str:
    """What PORT may be, for its help."""
    added = (f"; {lent.name} is {lent.meaning}" for lent in registry.added(Lent))
    return f"a serial port of this machine{''.join(added)}"
