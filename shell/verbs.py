"""The verbs: `VERBS["/open"]`, and `find` for what was typed. Importing this registers all of them."""

from __future__ import annotations

import difflib

from dialects import Diagnostic
from shell import verbs_buses, verbs_drives, verbs_macros, verbs_modbus, verbs_plot, verbs_session
from shell.registry import VERBS, Call, Verb

__all__ = ["VERBS", "Call", "Verb", "find"]
_MODULES = (verbs_buses, verbs_session, verbs_drives, verbs_modbus, verbs_macros, verbs_plot)


def find(name: str) -> Verb:
    """The verb of that name. Raises Diagnostic with the nearest ones."""
    if name in VERBS:
        return VERBS[name]
    near = difflib.get_close_matches(name, VERBS, 2) or ["/help"]
    raise Diagnostic(f"no verb {name}", hint=f"try {' or '.join(near)}")
