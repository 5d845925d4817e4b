"""The work of the verbs on macros: play, list, change, record."""

from __future__ import annotations

import shlex
from dataclasses import replace

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.base.text import counted
from multidrop.macros import FIRST_PAGE, KEYS, Macro, check_name, parse_macro
from multidrop.macros.recorder import Offer, with_waits
from multidrop.macros.store import listed
from multidrop.shell import macro_changes
from multidrop.shell.events import By
from multidrop.shell.line_syntax import divided
from multidrop.shell.macro_arguments import roles_in, settled
from multidrop.shell.scripts import executor
from multidrop.shell.scripts.words import play_call
from multidrop.shell.verbs.call import Call
from multidrop.shell.workspace import LATCHED, Workspace


async def play(call: Call) -> None:
    words, workspace = call.words(), call.session
    if words[0] == "stop":
        if len(words) > 2:
            raise call.wrong()
        found = [each for each in workspace.playing if each.name in words[1:] or not words[1:]]
        if not found:
            raise Diagnostic(f"macro {words[1]} does not play" if words[1:] else "no macro plays", "/play stop")
        for each in found:
            each.end()
        return
    chosen = play_call(words, call.wrong)
    if workspace.latched:
        raise Stopped(LATCHED)
    if call.by is By.OPERATOR and any(each.name == chosen.macro for each in workspace.playing):
        raise Diagnostic(f"macro {chosen.macro} is playing", "/play", f"/play stop {chosen.macro} ends it")
    macro = workspace.macros.load(chosen.macro)
    if workspace.front.unsaved is not None:
        call.warn_of_editor(workspace.macros.path(macro.name))
    if isinstance(call.shown, Macro) and macro != call.shown:
        what = f"macro {macro.name} has changed on the disk since it was shown here; nothing was sent"
        raise Diagnostic(
            what, str(workspace.macros.path(macro.name)), "look at it; play it again to play it as it is now"
        )
    values, roles = await settled(workspace, macro, chosen.given)
    await executor.play(call.session, macro, values, times=chosen.times, fast=chosen.fast, roles=roles)


async def macros(call: Call) -> None:
    call.words()
    found = listed(call.session.macros)
    for line in found.lines:
        call.session.output(line, columns=True)
    for line in (*found.warnings, *map(str, found.broken[:-1])):
        call.session.notify(line, warning=True)
    if found.broken:
        raise found.broken[-1]


async def macro(call: Call) -> None:
    words, workspace = call.words(), call.session
    if call.by is By.MACRO:
        raise Diagnostic("a macro does not change macros", "/macro", "type the line")
    store, plain = workspace.macros, not any(word.startswith("--") for word in words[:-1])
    done: list[str] = []
    match words:
        case ["show", name]:
            for line in macro_changes.text_of_macro(store, name):
                workspace.output(line)
        case ["edit", name]:
            await _edit(workspace, name)
        case ["describe", name, *text]:
            typed = divided(divided(call.rest)[1])[1]
            done = macro_changes.describe(store, name, text[0] if len(text) == 1 else typed)
        case ["copy", name, new, "--project"] if plain:
            done = macro_changes.copy(store, name, new, True)
        case ["import", file, "--force"] if plain:
            done = macro_changes.import_(store, file, True)
        case [("rename" | "copy") as what, name, new] if plain and not new.startswith("--"):
            done = (macro_changes.rename if what == "rename" else macro_changes.copy)(store, name, new)
        case ["import", file] if not file.startswith("--"):
            done = macro_changes.import_(store, file)
        case ["delete", name]:
            doomed = macro_changes.deletion(store, name)
            await workspace.questions.confirm(doomed.what, so_far="nothing was deleted")
            done = macro_changes.delete(store, doomed)
        case ["export", file, *names]:
            done = macro_changes.export(store, call.output_file(file), names, workspace.output)
        case _:
            raise call.wrong()
    for line in done:
        workspace.notify(line)
    workspace.changed()


async def _edit(workspace: Workspace, name: str) -> None:
    """Open the screen's editor. Elsewhere name the command: an editor on this terminal would take the stop key."""
    macro_changes.check(workspace.macros, name)
    if workspace.front.edit is not None:
        return await workspace.front.edit(str(workspace.macros.path(name)))
    hint = f"in another terminal: multidrop macro edit {shlex.quote(name)}"
    raise Diagnostic("an editor would take Ctrl+X, which must stop the drives", f"/macro edit {name}", hint)


async def key(call: Call) -> None:
    words, store = call.words(), call.session.macros
    if len(words) == 3 or (len(words) == 4 and words[2] != "--page"):
        raise call.wrong()
    if words[0].upper() not in KEYS:
        raise call.wrong(f"no key {words[0]}; valid: F2 to F12")
    page = words[3] if len(words) == 4 else FIRST_PAGE
    done, doubtful = macro_changes.set_key(store, words[0], words[1], page)
    call.session.notify(done)
    for each in doubtful:
        call.session.notify(each, warning=True)
    call.session.changed()


async def record(call: Call) -> None:
    words, workspace = call.words(), call.session
    if len(words) == 2 and words[1] != ("--waits" if words[0] == "stop" else "--replace"):
        raise call.wrong()
    if not words:
        workspace.output(f"recording: {workspace.recording or 'nothing'}")
    elif words[0] == "stop":
        await _keep(call, waits=len(words) == 2)
    else:
        name = words[0]
        check_name(name, "/record")
        before = workspace.macros.contents(name)
        if before is not None and len(words) == 1:
            hint = f"use another name; /record {name} --replace replaces it"
            raise Diagnostic(f"macro {name} exists already", "/record", hint)
        if before is not None:
            workspace.macros.load(name)  # what cannot be read is never replaced
        time = workspace.wall(workspace.now()).isoformat(" ", "seconds")
        workspace.recorder.start(name, workspace.now(), before, time)
        workspace.notify(f"recording {name}; /record stop ends it")
    workspace.changed()


async def _keep(call: Call, waits: bool) -> None:
    """Save the recording, in another file if its own was changed meanwhile; then offer waits."""
    workspace, store = call.session, call.session.macros
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
