"""Verbs for the files of macros: list, change, assign to a key."""

from __future__ import annotations

import shlex
from collections.abc import Awaitable, Callable

from multidrop.dialects import Diagnostic
from multidrop.macros import FIRST_PAGE, KEYS
from multidrop.macros.store import listed
from multidrop.shell import macro_changes
from multidrop.shell.events import By
from multidrop.shell.verbs.registry import Call, verb

Work = Callable[[Call, list[str]], Awaitable[list[str]]]
PAGE_MEANING = "on another page of keys"


@verb("/macros", immediate=True)
async def macros(call: Call) -> None:
    """List the macros: name, key and page, number of lines, values, note.

    Macros beside a project, in the folder `macros` of the current folder, come before the user's own.
    """
    call.words(0, 0)
    found = listed(call.workspace.macros)
    for line in found.lines:
        call.workspace.output(line, columns=True)
    for line in (*found.warnings, *map(str, found.broken[:-1])):
        call.workspace.notify(line, warning=True)
    if found.broken:
        raise found.broken[-1]


@verb(
    "/macro show MACRO | edit MACRO | describe MACRO TEXT ... | rename MACRO NAME | copy MACRO NAME [--project] | "
    "delete MACRO | import FILE [--force] | export FILE [MACRO ...]",
    immediate=True,
    words={
        "show": "print its file",
        "edit": "open its file in the editor of the screen",
        "describe": "change its note",
        "rename": "give it another name",
        "copy": "copy it under another name",
        "--project": "into the folder macros of the current folder",
        "delete": "delete its file",
        "import": "make macros of function-key strings, one a line: F2 STRING ; comment",
        "--force": "in place of the macros of these names",
        "export": "write macros as function-key strings",
    },
)
async def macro(call: Call) -> None:
    """Show, describe, rename, copy or delete a macro; import or export function-key strings.

    Remarks in a file stay, whatever else of it changes. Without a screen `multidrop macro edit` in another
    terminal opens an editor.
    """
    words = call.words(2)
    if call.by is By.MACRO:
        raise Diagnostic("a macro does not change macros", "/macro", "type the line")
    work = _WORKS.get(words[0])
    if work is None:
        raise call.wrong()
    for line in await work(call, words[1:]):
        call.workspace.notify(line)
    call.workspace.changed()


def _plain(count: int, work: Callable[..., list[str]], flag: str = "") -> Work:
    """A change that takes its words as they are, and a flag at the end."""

    async def run(call: Call, words: list[str]) -> list[str]:
        flags = [True] if flag and words[-1] == flag else []
        given = words[: len(words) - len(flags)]
        if len(given) != count or any(word.startswith("--") for word in given):
            raise call.wrong()
        return work(call.workspace.macros, *given, *flags)

    return run


async def _show(call: Call, words: list[str]) -> list[str]:
    for line in macro_changes.text_of_macro(call.workspace.macros, _name(call, words)):
        call.workspace.output(line)
    return []


async def _describe(call: Call, words: list[str]) -> list[str]:
    return macro_changes.describe(call.workspace.macros, words[0], " ".join(words[1:]))


async def _delete(call: Call, words: list[str]) -> list[str]:
    store, name = call.workspace.macros, _name(call, words)
    await call.workspace.confirm(macro_changes.deletion(store, name), so_far="nothing was deleted")
    return macro_changes.delete(store, name)


async def _export(call: Call, words: list[str]) -> list[str]:
    file, workspace = call.output_file(words[0]), call.workspace
    return macro_changes.export(workspace.macros, file, words[1:], workspace.output)


async def _edit(call: Call, words: list[str]) -> list[str]:
    """Open the screen's editor. Elsewhere name the command: an editor on this terminal would take the stop key."""
    name, workspace = _name(call, words), call.workspace
    macro_changes.check(workspace.macros, name)
    if workspace.edit is not None:
        await workspace.edit(str(workspace.macros.path(name)))
        return []
    hint = f"in another terminal: multidrop macro edit {shlex.quote(name)}"
    raise Diagnostic("an editor would take Ctrl+X, which must stop the drives", f"/macro edit {name}", hint)


def _name(call: Call, words: list[str]) -> str:
    if len(words) > 1:
        raise call.wrong()
    return words[0]


_WORKS: dict[str, Work] = {
    "show": _show,
    "edit": _edit,
    "describe": _describe,
    "rename": _plain(2, macro_changes.rename),
    "copy": _plain(2, macro_changes.copy, "--project"),
    "delete": _delete,
    "import": _plain(1, macro_changes.import_, "--force"),
    "export": _export,
}


@verb("/key F2..F12 MACRO|off [--page PAGE]", immediate=True, words={"off": "free the key", "--page": PAGE_MEANING})
async def key(call: Call) -> None:
    """Assign a macro to a function key, or free the key.

    Keys are in pages, each a number or a word; the default is 1. Only key and page in the macro's file change.
    """
    words, store = call.words(2, 4), call.workspace.macros
    if len(words) == 3 or (len(words) == 4 and words[2] != "--page"):
        raise call.wrong()
    if words[0].upper() not in KEYS:
        raise call.wrong(f"no key {words[0]}; valid: F2 to F12")
    page = words[3] if len(words) == 4 else FIRST_PAGE
    done, doubtful = macro_changes.set_key(store, words[0], words[1], page)
    call.workspace.notify(done)
    for each in doubtful:
        call.workspace.notify(each, warning=True)
    call.workspace.changed()
