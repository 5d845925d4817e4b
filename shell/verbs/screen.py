"""Verbs of the screen, which a front end without one refuses."""

from __future__ import annotations

from multidrop.dialects import Diagnostic
from multidrop.shell.verbs.registry import Call, verb
from multidrop.shell.workspace import Workspace


def _on_screen(workspace: Workspace) -> bool:
    return workspace.screen is not None


@verb("/page NAME", immediate=True, fits=_on_screen)
async def page(call: Call) -> None:
    """Show a page of the screen: /page drives shows all drives of all lines.

    Escape goes back. A name that is not a page is answered with the names of all.
    """
    (name,) = call.words(1, 1)
    await _show(call, name)


@verb("/tour", immediate=True, fits=_on_screen)
async def tour(call: Call) -> None:
    """Walk through the product in two minutes, on the demo cell.

    Each step names what to type or press, and goes on when it was done. Escape ends the tour.
    """
    call.words(0, 0)
    await _show(call, "tour")


async def _show(call: Call, name: str) -> None:
    if call.workspace.screen is None:
        raise Diagnostic("this front end has no screen", call.verb.name, "multidrop tui opens it")
    await call.workspace.screen(name)
