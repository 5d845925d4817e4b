"""All verbs: `VERBS["/open"]`, and `find` for a typed name. The import of this module registers them."""

from __future__ import annotations

import difflib

from multidrop.dialects import Diagnostic
from multidrop.shell.verbs import (
    buses,
    checks,
    debugging,
    help,
    macro_files,
    macros,
    params,
    plot,
    programs,
    raw,
    recording,
    registers,
    screen,
    session,
    simulator,
    snapshot,
    tabs,
    transcript,
    twin,
    waiting,
)
from multidrop.shell.verbs.registry import VERBS, Call, Verb
from multidrop.shell.verbs.script_words import SCRIPT_WORDS

__all__ = ["GROUPS", "VERBS", "Call", "Verb", "find"]
GROUPS = (
    buses,
    checks,
    debugging,
    help,
    macro_files,
    macros,
    params,
    plot,
    programs,
    raw,
    recording,
    registers,
    screen,
    session,
    simulator,
    snapshot,
    tabs,
    transcript,
    twin,
    waiting,
)


def find(name: str) -> Verb:
    """Find a verb by name. Raises Diagnostic with similar names."""
    if name in VERBS:
        return VERBS[name]
    if name in SCRIPT_WORDS:
        raise Diagnostic(f"{name} is a verb of scripts", hint="multidrop run SCRIPT, or run - for standard input")
    near = difflib.get_close_matches(name, VERBS, 2) or ["/help"]
    raise Diagnostic(f"no verb {name}", hint=f"try {' or '.join(near)}")
