"""The language server of `multidrop lsp`: program files in editors that speak the Language Server Protocol."""

from __future__ import annotations

import sys
from typing import Annotated

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, OneOf
from multidrop.shell.streams.stdout import write

SERVED = OneOf("served")
Product = Annotated[
    str,
    Argument(arguments.edited_personality, metavar="P", read=str.upper, choices=arguments.CheckedPersonalities),
]
Tcp = Annotated[
    tuple[str, int] | None,
    Argument("serve one client there", metavar="[HOST:]PORT", read=arguments.address, one_of=SERVED),
]
Stdio = Annotated[bool, Argument("serve standard input and output, as without it", one_of=SERVED)]


def _serve(*, personality: Product = "", tcp: Tcp = None, stdio: Stdio = False) -> int:
    try:
        from multidrop.features.lsp.serving import serve
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        what = "the language server needs pygls, which is not installed"
        raise Diagnostic(what, hint="pipx install 'multidrop[lsp]'") from None
    if tcp is None and sys.stdin.isatty():
        write(sys.stderr, "multidrop lsp speaks to an editor, which starts it; see docs/editors.md")
    return serve(personality or arguments.usual_personality(), tcp)


FEATURE = Feature(
    "lsp",
    "program files in editors",
    adds=(
        Operation(
            _serve,
            command="lsp",
            meaning="serve an editor: check, help, completion and renaming in program files (Language Server Protocol)",
            connection=True,
            examples=(
                "lsp",
                "lsp --personality MDI",
                "lsp --tcp 9257",
            ),
            after="help",
        ),
    ),
    extras={"lsp": "pygls"},
)
