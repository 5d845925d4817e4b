"""The language server of `multidrop lsp`: program files in editors that speak the Language Server Protocol."""

from __future__ import annotations

import argparse
import sys

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation
from multidrop.shell.streams.stdout import write


def _serve(chosen: argparse.Namespace) -> int:
    try:
        from multidrop.features.lsp.serving import serve
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        what = "the language server needs pygls, which is not installed"
        raise Diagnostic(what, hint="pipx install 'multidrop[lsp]'") from None
    if chosen.tcp is None and sys.stdin.isatty():
        write(sys.stderr, "multidrop lsp speaks to an editor, which starts it; see docs/editors.md")
    return serve(chosen.personality, chosen.tcp)


FEATURE = Feature(
    "lsp",
    "program files in editors",
    adds=(
        Operation(
            command="lsp",
            meaning="serve an editor: check, help, completion and renaming in program files (Language Server Protocol)",
            run=_serve,
            connection=True,
            examples=(
                "lsp",
                "lsp --personality MDI",
                "lsp --tcp 9257",
            ),
            arguments={
                "--personality P": arguments.edited_personality,
                "[--tcp | --stdio]": {
                    "--tcp [HOST:]PORT": {
                        "help": "serve one client there",
                        "type": arguments.address,
                    },
                    "--stdio": "serve standard input and output, as without it",
                },
            },
            after="help",
        ),
    ),
    extras={"lsp": "pygls"},
)
