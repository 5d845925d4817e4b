"""The verb that records a macro."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects import Diagnostic
from multidrop.macros import Macro, check_name, parse_macro
from multidrop.macros.recorder import Offer, with_waits
from multidrop.shell.macro_arguments import roles_in
from multidrop.shell.verbs.registry import Call, verb
from multidrop.shell.workspace import Workspace


@verb(
    "/record [MACRO [--replace] | stop [--waits]]",
    immediate=True,
    words={
        "stop": "end, and save it",
        "--replace": "in place of the macro of that name",
        "--waits": "put waits in place of long pauses",
    },
)
async def record(call: Call) -> None:
    """Record the typed lines as a macro, until `/record stop`.

    Without a word it shows the recording. With `--replace` it replaces the macro of that name and keeps its key. At the
    end, waits are offered in place of long pauses: for the end of a motion, an input, or a text that was printed.
    """
    words, workspace = call.words(0, 2), call.workspace
    if len(words) == 2 and words[1] != ("--waits" if words[0] == "stop" else "--replace"):
        raise call.wrong()
    if not words:
        workspace.output(f"recording: {workspace.recording or 'nothing'}")
    elif words[0] == "stop":
        await _keep(call, waits=len(words) == 2)
    else:
        _begin(call, words[0], replacing=len(words) == 2)
    workspace.changed()


def _begin(call: Call, name: str, replacing: bool) -> None:
    workspace = call.workspace
    check_name(name, "/record")
    before = workspace.macros.contents(name)
    if before is not None and not replacing:
        hint = f"use another name; /record {name} --replace replaces it"
        raise Diagnostic(f"macro {name} exists already", "/record", hint)
    if before is not None:
        workspace.macros.load(name)  # what cannot be read is never replaced
    time = workspace.wall(workspace.now()).isoformat(" ", "seconds")
    workspace.recorder.start(name, workspace.now(), before, time)
    workspace.notify(f"recording {name}; /record stop ends it")


async def _keep(call: Call, waits: bool) -> None:
    """Save the recording, in another file if its own was changed meanwhile; then offer waits."""
    workspace, store = call.workspace, call.workspace.macros
    macro, before = workspace.recorder.macro(), workspace.recorder.before
    wanted, found = macro.name, workspace.recorder.offers
    if waits:
        macro = with_waits(macro, found)
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
        for offer in found:
            workspace.notify(f"macro {macro.name}: {offer.text}")
    elif found:
        await _offer(workspace, macro, found)


async def _offer(workspace: Workspace, macro: Macro, found: list[Offer]) -> None:
    """Ask whether waits go in place of the pauses; say how where no person can be asked, and after a no."""
    store, saved = workspace.macros, workspace.macros.contents(macro.name)
    changes = "; ".join(offer.text for offer in found)
    if await workspace.agrees(f"macro {macro.name}: put waits in place of pauses: {changes}"):
        store.save(with_waits(macro, found), saved)
        workspace.notify(f"macro {macro.name}: {len(found)} {'pause' if len(found) == 1 else 'pauses'} replaced")
        return
    for offer in found:
        workspace.notify(f"macro {macro.name}: {offer.text} would fit; /macro edit {macro.name} changes it")


def _in_place_of(before: bytes, macro: Macro) -> Macro:
    """The macro with the key, the note and the on_stop lines of the one before it, if that one can be read."""
    try:
        old = parse_macro(before.decode("utf-8-sig", "replace"))
    except Diagnostic:
        return macro
    kept = replace(macro, key=old.key, page=old.page, note=old.note)
    return replace(kept, on_stop=old.on_stop, on_stop_moves=old.on_stop_moves)
