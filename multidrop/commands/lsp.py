"""`multidrop lsp`: the language server for editors."""

from __future__ import annotations

import argparse
import sys

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.shell.output import write

INSTALL = "pipx install 'multidrop[lsp]'"


def run(chosen: argparse.Namespace) -> int:
    """Serve one editor until it ends the session."""
    try:
        try:
            from multidrop.lsp.serving import serve
        except ModuleNotFoundError as missing:
            if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
                raise
            raise Diagnostic("the language server needs pygls, which is not installed", hint=INSTALL) from None
        if chosen.tcp is None and sys.stdin.isatty():
            write(sys.stderr, "multidrop lsp speaks to an editor, which starts it; see docs/editors.md")
        return serve(chosen.personality, chosen.tcp)
    except Diagnostic as problem:
        return fail(problem)
