"""Verbs of the screen, which a front end without one refuses."""

from __future__ import annotations

from dialects import Diagnostic
from shell.verbs.registry import Call, verb
from shell.workspace import Workspace


def _on_screen(workspace: Workspace) -> bool:
    return workspace.screen is not None


@verb("/page NAME", immediate=True, fits=_on_screen)
async def page(call: Call) -> None:
    """Show a page of the screen: /page drives shows all drives of all lines.

    Escape goes back. A name that is no page is answered with the names of all.
    """
    (name,) = call.words(1, 1)
    if call.workspace.screen is None:
        raise Diagnostic("only the screen has pages", call.verb.name, "multidrop tui opens it")
    await call.workspace.screen(name)
