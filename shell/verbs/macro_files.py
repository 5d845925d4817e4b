"""Verbs for the files of macros: list, assign to a key."""

from __future__ import annotations

from dialects import Diagnostic
from macros import FIRST_PAGE, KEYS
from shell.verbs.registry import Call, verb

PAGE_MEANING = "on another page of keys"


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


@verb("/key F2..F12 MACRO|off [--page PAGE]", immediate=True, words={"off": "free the key", "--page": PAGE_MEANING})
async def key(call: Call) -> None:
    """Assign a macro to a function key, or free the key.

    Keys are in pages, each a number or a word; 1 unless told. Only key and page in the macro's file change.
    """
    words, store = call.words(2, 4), call.workspace.macros
    name, wanted, page = words[0].upper(), words[1], FIRST_PAGE
    if name not in KEYS:
        raise call.wrong(f"no key {words[0]}; valid: F2 to F12")
    if len(words) == 4 and words[2] == "--page":
        page = words[3]
    elif len(words) > 2:
        raise call.wrong()
    shown = name if page == FIRST_PAGE else f"{name} of page {page}"
    if wanted != "off":
        store.load(wanted)
    found, broken = store.on_key(name, page)
    before = [macro.name for macro in found if macro.name != wanted]
    if wanted == "off" and not before:
        raise broken[0] if broken else Diagnostic(f"nothing is on {shown}", "/key")
    for other in before:
        store.set_key(other, "")
    if wanted != "off":
        store.set_key(wanted, name, page)
    off = f", {' and '.join(before)} no more" if before else ""
    call.workspace.notify(f"{shown} plays nothing{off}" if wanted == "off" else f"{shown} plays {wanted}{off}")
    for each in broken:
        call.workspace.notify(f"{each}: it may be on {name} too", warning=True)
    call.workspace.changed()
