"""The verb that records a macro."""

from __future__ import annotations

from dataclasses import replace

from dialects import Diagnostic
from macros import Macro, check_name, parse_macro
from shell.verbs.registry import Call, verb


@verb(
    "/record [MACRO [--replace] | stop]",
    immediate=True,
    words={"stop": "end, and save it", "--replace": "in place of the macro of that name"},
)
async def record(call: Call) -> None:
    """Record the typed lines as a macro, until `/record stop`.

    Without a word it shows the recording. With `--replace` it replaces the macro of that name and keeps its key.
    """
    words, workspace = call.words(0, 2), call.workspace
    if len(words) == 2 and words[1] != "--replace":
        raise call.wrong()
    if not words:
        workspace.output(f"recording: {workspace.recording or 'nothing'}")
    elif words == ["stop"]:
        _keep(call)
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
    time = workspace.wall(workspace.now()).isoformat(" ", "seconds")
    workspace.recorder.start(name, workspace.now(), before, time)
    workspace.notify(f"recording {name}; /record stop ends it")


def _keep(call: Call) -> None:
    """Save the recording, in another file if its own was changed meanwhile."""
    workspace, store = call.workspace, call.workspace.macros
    macro, before = workspace.recorder.macro(), workspace.recorder.before
    wanted = macro.name
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


def _in_place_of(before: bytes, macro: Macro) -> Macro:
    """The macro with the key and the note of the one before it, if that one can be read."""
    try:
        old = parse_macro(before.decode("utf-8-sig", "replace"))
    except Diagnostic:
        return macro
    return replace(macro, key=old.key, page=old.page, note=old.note)
