"""Changes of macros' files, for verbs and the command line: each returns what was done, in lines for a person."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from multidrop.base import new_file
from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import text_of
from multidrop.base.text import counted
from multidrop.macros import FIRST_PAGE, MacroStore, format_macro
from multidrop.macros.vendor import REMARK, STOP, exported, imported, is_key_name

OFF = "off"
"""In place of a macro: the key is freed."""
EDITORS = ("notepad",) if sys.platform == "win32" else ("nano", "vi")


def editor() -> list[str]:
    """The command of the person's editor. Raises Diagnostic where there is none."""
    for name in ("VISUAL", "EDITOR"):
        if command := os.environ.get(name, "").strip():
            try:
                return shlex.split(command, posix=sys.platform != "win32")
            except ValueError:
                raise Diagnostic(f"{name}: a quotation mark is not closed", hint="correct it") from None
    for editor in EDITORS:
        if sys.stdin.isatty() and sys.stdout.isatty() and shutil.which(editor):
            return [editor]
    raise Diagnostic("no editor is known", hint="set VISUAL or EDITOR to its command")


def rename(store: MacroStore, name: str, new: str) -> list[str]:
    path = store.rename(name, new)
    return [f"macro {name} is {new} now, in {path}", *_callers(store, name)]


def describe(store: MacroStore, name: str, note: str) -> list[str]:
    store.describe(name, note)
    return [f"macro {name}: {note}" if note else f"macro {name} has no note now"]


def copy(store: MacroStore, name: str, new: str, project: bool = False) -> list[str]:
    """Copy a macro; `project`: into the folder beside the project."""
    path = store.copy(name, new, store.project if project else store.folder)
    return [f"macro {new}: a copy of {name} in {path}; it is on no key"]


class Deletion(NamedTuple):
    """A macro that a person is asked about: the file that the question names, and what it holds."""

    name: str
    path: Path
    data: bytes | None

    @property
    def what(self) -> str:
        """The effect, for the question before it."""
        return f"deletes macro {self.name}, the file {self.path}"


def delete(store: MacroStore, agreed: Deletion) -> list[str]:
    """Delete the macro that a person has agreed to. Raises Diagnostic if its file is another one by now."""
    name = agreed.name
    if (store.path(name), store.contents(name)) != (agreed.path, agreed.data):
        raise Diagnostic("has changed since you were asked; nothing was deleted", str(agreed.path), "look at it again")
    path = store.delete(name)
    return [f"macro {name} is deleted, with {path}", *_callers(store, name)]


def check(store: MacroStore, name: str) -> None:
    """Raise Diagnostic for an unknown macro; it names the known ones."""
    if store.contents(name) is None:
        store.load(name)


def deletion(store: MacroStore, name: str) -> Deletion:
    """What a deletion would delete, for the question before it. Raises Diagnostic for an unknown macro."""
    check(store, name)
    return Deletion(name, store.path(name), store.contents(name))


def set_key(store: MacroStore, key: str, name: str, page: str = FIRST_PAGE) -> tuple[str, list[str]]:
    """Put a macro on a key of a page, or free the key (`off`); what was on it is on no key then.

    Returns what was done, and a line for each file that cannot be read.
    """
    key = key.upper()
    shown = key if page == FIRST_PAGE else f"{key} of page {page}"
    if name != OFF:
        store.load(name)
    changed, broken = store.on_key(key, page)
    before = [macro.name for macro in changed if macro.name != name]
    if name == OFF and not before:
        raise broken[0] if broken else Diagnostic(f"nothing is on {shown}", "/key")
    for other in before:
        store.set_key(other, "")
    if name != OFF:
        store.set_key(name, key, page)
    off = f"; no longer on it: {', '.join(before)}" if before else ""
    plays = "nothing" if name == OFF else name
    return f"{shown} plays {plays}{off}", [f"{problem}: it may be on {shown} too" for problem in broken]


def import_(store: MacroStore, file: str, force: bool = False) -> list[str]:
    """Make macros of a file of function keys: all of them or none. `force`: in place of those of their names."""
    return import_text(store, text_of(file), file, force)


def import_text(store: MacroStore, text: str, file: str, force: bool = False) -> list[str]:
    """Make macros of the text of such a file; `file` names it in messages."""
    macros = imported(text, file, store.names())
    before = {macro.name: store.contents(macro.name) for macro in macros}
    if there := [name for name, data in before.items() if data is not None and not force]:
        names, verb = ", ".join(there), "exists" if len(there) == 1 else "exist"
        raise Diagnostic(f"{names} {verb} already; nothing was imported", file, "--force replaces them")
    for name in (name for name, data in before.items() if data is not None):
        store.load(name)  # what cannot be read is never replaced
    lines, written = [], list[str]()
    for macro in macros:
        try:
            others = store.on_key(macro.key, macro.page)[0] if macro.key else []
            taken = any(each.name != macro.name for each in others)
            path = store.save(replace(macro, key="") if taken else macro, before[macro.name])
        except Diagnostic as problem:
            for name in written:  # the files are put back as they were
                data = before[name]
                if data is None:
                    store.delete(name)
                else:
                    write_atomically(store.path(name), data)
            raise Diagnostic(f"{problem.message}; nothing was imported", problem.where, problem.hint) from None
        written.append(macro.name)
        lines.append(f"macro {macro.name}: {macro.length} in {path}")
        if taken:
            lines.append(f"macro {macro.name}: {macro.key} plays another macro already, so it is on no key")
        if any(step.line == STOP for step in macro.steps):
            lines.append(f"macro {macro.name}: {REMARK}; /stop stops every drive")
    return lines


def export(store: MacroStore, file: str, names: Sequence[str], output: Callable[[str], None]) -> list[str]:
    """Write macros into a new file of function keys; by default those that are on a key, or named as one.

    `output` takes the lines of the file `-`.
    """
    new_file.check(file, printed=True)
    loaded = [store.load(name) for name in names or store.names()]
    chosen = [macro for macro in loaded if names or macro.key or is_key_name(macro.name)]
    if not chosen:
        raise Diagnostic("no macro is on a function key", file, "/key F3 MACRO puts one there, or name the macros")
    text = exported(chosen)
    new_file.write(file, text, output)
    count = text.count("\n")
    return [f"{counted(count, 'macro')}{new_file.place(file)}"]


def text_of_macro(store: MacroStore, name: str) -> list[str]:
    """A macro in the form of its file."""
    return format_macro(store.load(name)).rstrip("\n").split("\n")


def _callers(store: MacroStore, name: str) -> list[str]:
    """A line for each macro that plays the one that is gone."""
    lines = []
    for other in store.names():
        try:
            macro = store.load(other)
        except Diagnostic:
            continue
        for number, line in enumerate(macro.lines, 1):
            if line.split()[:2] in (["/play", name], ["/call", name]):
                lines.append(f"macro {other}, step {number}, plays {name}, which is gone")
    return lines
