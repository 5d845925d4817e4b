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


def lender(port: str) -> Lent | None:
    """What is lent under a name; None: it is a serial port. Raises Diagnostic where its feature is not there."""
    named = _NAMED.match(port)
    if named is None:
        return None
    feature = registry.with_word(f"relay {named[1]}")
    if feature is None:
        from multidrop.shell.configuration import IGNORED

        registry.load_others(own=not IGNORED.get())
    adds = (each for known in ([feature] if feature else registry.by_others()) for each in known.adds)
    return next((each for each in adds if isinstance(each, Lent) and each.name == named[1]), None)


def ports() -> str:
    """What PORT may be, for its help."""
    added = (f"; {each.name} is {each.meaning}" for each in registry.added(Lent))
    return f"a serial port of this machine{''.join(added)}"
