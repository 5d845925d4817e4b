"""What a feature does as a session begins. It is called by `Session`; a verb or an option needs nothing of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from multidrop.base.feature import Kinds


class AtSession(NamedTuple):
    """What is done as a session begins, before anything is open: subscribe to its events (`Session.subscribe`).

    `session_hooks.SessionHooks`, the session's `hooks`, has lists of functions that take a line.
    """

    begin: Callable[[Any], None]
    """Takes the `Session`, of a floor above this one; a feature's function names it, and mypy checks its body."""

    def passes(self) -> Mapping[str, Kinds]:
        """See `base.foreign`: `begin` below takes whatever it raises."""
        return {"begin": (Exception, SystemExit)}
