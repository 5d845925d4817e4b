"""Verbs for macros: record, play, list, assign to a key."""

from __future__ import annotations

from dataclasses import replace

from dialects import Diagnostic, Stopped
from macros import KEYS, Macro, check_name, parse_macro
from shell.events import By
from shell.verbs.registry import Call, as_typed, verb
from shell.workspace import LATCHED


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
    workspace.recorder.start(name, workspace.now(), before)
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
    return replace(macro, key=old.key, note=old.note)


@verb("/play MACRO [NAME=VALUE ...]", recorded=as_typed, concurrent=True)
async def play(call: Call) -> None:
    """Play a macro; {NAME} in its lines takes the given value. The first failure ends it."""
    words, workspace = call.words(1), call.workspace
    if workspace.latched:
        raise Stopped(LATCHED)
    if workspace.playing and (call.by is By.OPERATOR or words[0] in workspace.playing):
        raise Diagnostic(f"macro {workspace.playing[-1]} is playing", "/play", "wait for its end, or stop it")
    values = dict(split_value(word, call) for word in words[1:])
    await call.commands.play(workspace.macros.load(words[0]), values)


def split_value(word: str, call: Call) -> tuple[str, str]:
    """Split `NAME=VALUE`."""
    name, sign, value = word.partition("=")
    if not sign or not name:
        raise call.wrong(f"no value {word}; valid: NAME=VALUE")
    return name, value


@verb("/macros", immediate=True)
async def macros(call: Call) -> None:
    """List the macros: name, key, number of lines."""
    call.words(0, 0)
    store, broken = call.workspace.macros, []
    for name in store.names():
        try:
            call.workspace.output(store.load(name).summary)
        except Diagnostic as problem:
            broken.append(problem)
    for line in store.clashes():
        call.workspace.notify(line, warning=True)
    for other in broken[:-1]:
        call.workspace.notify(str(other), warning=True)
    if broken:
        raise broken[-1]


@verb("/key F2..F12 MACRO|off", immediate=True, words={"off": "free the key"})
async def key(call: Call) -> None:
    """Assign a macro to a function key, or free the key.

    Only the key in the macro's file changes.
    """
    words, store = call.words(2, 2), call.workspace.macros
    name, wanted = words[0].upper(), words[1]
    if name not in KEYS:
        raise call.wrong(f"no key {words[0]}; valid: F2 to F12")
    if wanted != "off":
        store.load(wanted)
    found, broken = store.on_key(name)
    before = [macro.name for macro in found if macro.name != wanted]
    if wanted == "off" and not before:
        raise broken[0] if broken else Diagnostic(f"nothing is on {name}", "/key")
    for other in before:
        store.set_key(other, "")
    if wanted != "off":
        store.set_key(wanted, name)
    off = f", {' and '.join(before)} no more" if before else ""
    call.workspace.notify(f"{name} plays nothing{off}" if wanted == "off" else f"{name} plays {wanted}{off}")
    for each in broken:
        call.workspace.notify(f"{each}: it may be on {name} too", warning=True)
    call.workspace.changed()
