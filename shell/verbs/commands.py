"""The verbs: `VERBS["/open"]`, and `find` for what was typed. Importing this registers all of them."""

from __future__ import annotations

import difflib

from dialects import Diagnostic
from shell.verbs import buses, drives, macros, plot, registers, session
from shell.verbs.registry import VERBS, Call, Verb

__all__ = ["VERBS", "Call", "Verb", "find"]
_MODULES = (buses, session, drives, registers, macros, plot)


def find(name: str) -> Verb:
    """The verb of that name. Raises Diagnostic with the nearest ones."""
    if name in VERBS:
        return VERBS[name]
    near = difflib.get_close_matches(name, VERBS, 2) or ["/help"]
    raise Diagnostic(f"no verb {name}", hint=f"try {' or '.join(near)}")
