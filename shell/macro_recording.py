"""The end of a recording: the macro is saved, and waits are offered in place of its pauses."""

from __future__ import annotations

from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.macros import Macro, parse_macro
from multidrop.macros.recorder import WaitOffer, with_waits
from multidrop.shell.macro_arguments import roles_in
from multidrop.shell.workspace import Workspace


async def keep(workspace: Workspace, waits: bool) -> None:
    """Save the recording, in another file if its own was changed meanwhile; then offer waits."""
    store = workspace.macros
    macro, before = workspace.recorder.macro(), workspace.recorder.before
    wanted, recorded = macro.name, workspace.recorder.offers
    if waits:
        macro = with_waits(macro, recorded)
    macro = replace(macro, roles=roles_in(macro, list(workspace.buses)))
    try:
        if store.contents(wanted) != before:
            macro, before = replace(macro, name=store.free_name(wanted)), None
        if before is not None:
            macro = _in_place_of(before, macro)
        path = store.save(macro, before)
    except Diagnostic as problem:
        hint = "nothing is lost, the recording goes on; correct this and type /record stop again"
        raise Diagnostic(problem.message, problem.where, hint) from None
    workspace.recorder.discard()
    if macro.name != wanted:
        workspace.notify(f"{wanted} was changed meanwhile and stays unchanged", warning=True)
    workspace.notify(f"macro {macro.name}: {macro.length} in {path}")
    if waits:
        for offer in recorded:
            workspace.notify(f"macro {macro.name}: {offer.text}")
    elif recorded:
        await _offer(workspace, macro, recorded)


async def _offer(workspace: Workspace, macro: Macro, found: list[WaitOffer]) -> None:
    """Ask whether waits go in place of the pauses; say how where no person can be asked, and after a no."""
    store, saved = workspace.macros, workspace.macros.contents(macro.name)
    changes = "; ".join(offer.text for offer in found)
    if await workspace.questions.agrees(f"macro {macro.name}: put waits in place of pauses: {changes}"):
        store.save(with_waits(macro, found), saved)
        workspace.notify(f"macro {macro.name}: {counted(len(found), 'pause')} replaced")
        return
    for offer in found:
        workspace.notify(f"macro {macro.name}: {offer.text} would fit; /macro edit {macro.name} changes it")


def _in_place_of(before: bytes, macro: Macro) -> Macro:
    """The macro with the key, the note and the on_early_end lines of the one before it, if that one can be read."""
    try:
        old = parse_macro(before.decode("utf-8-sig", "replace"))
    except Diagnostic:
        return macro
    kept = replace(macro, key=old.key, page=old.page, note=old.note)
    return replace(kept, on_early_end=old.on_early_end, on_early_end_moves=old.on_early_end_moves)
