"""Drafts: copies of macro files that a person edits. A macro changes only once the whole text is right.

A draft that is wrong stays, so that nothing typed is lost; the next edit goes on with it.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import NamedTuple

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.files import utf8
from multidrop.macros.atomic import write_atomically
from multidrop.macros.store import MacroStore
from multidrop.macros.toml_format import parse_macro

MODE = 0o600


class Draft(NamedTuple):
    """A copy that is being edited."""

    name: str
    file: Path
    base: bytes
    """The macro's file when the copy was made."""
    remark: str = ""
    """What a person must know before editing it."""


def begin(store: MacroStore, folder: Path, name: str) -> Draft:
    """Make a draft of a macro, or find the one that is left. Raises Diagnostic for an unknown macro."""
    current = store.contents(name)
    if current is None:
        store.load(name)  # raises, with the names that there are
        raise Diagnostic(f"no macro {name!r}", str(store.folder))
    file, kept = folder / f"{name}.toml", folder / f"{name}.base"
    try:
        if file.exists() and kept.exists() and kept.read_bytes() == current:
            changed = file.read_bytes() != current
            return Draft(name, file, current, f"goes on with the text of the last edit, {file}" if changed else "")
        remark = _aside(file, name) if file.exists() else ""
        write_atomically(kept, current, MODE)
        write_atomically(file, current, MODE)
    except OSError as error:
        raise Diagnostic(
            f"cannot write the copy ({error.strerror or error})", str(file), f"{name} is as it was"
        ) from None
    return Draft(name, file, current, remark)


def _aside(file: Path, name: str) -> str:
    """Keep a draft of a macro that has changed since under another name."""
    number = next(n for n in range(1, 10_000) if not file.with_suffix(f".{n}.toml").exists())
    other = file.with_suffix(f".{number}.toml")
    file.rename(other)
    return f"{name} has changed since the last edit, whose text is in {other}"


def finish(store: MacroStore, draft: Draft) -> str:
    """Put the text of a draft in place of the macro; return what was done, in one line.

    Raises Diagnostic for a wrong text and for a macro that changed meanwhile. The macro is as it was then, and the
    draft stays.
    """
    try:
        data = draft.file.read_bytes()
        if data != draft.base:
            _put(store, draft, data)
    except OSError as error:
        raise Diagnostic(
            f"cannot read it ({error.strerror or error})", str(draft.file), f"{draft.name} is as it was"
        ) from None
    except Diagnostic as problem:
        kept = f"{draft.name} is as it was; your text is in {draft.file}, and macro edit {draft.name} goes on with it"
        raise Diagnostic(problem.message, problem.where, f"{problem.hint}; {kept}".removeprefix("; ")) from None
    drop(draft)
    if data == draft.base:
        return f"macro {draft.name}: unchanged"
    return f"macro {draft.name}: {store.load(draft.name).length} in {store.path(draft.name)}"


def drop(draft: Draft) -> None:
    """Delete a draft."""
    for path in (draft.file, draft.file.with_suffix(".base")):
        with contextlib.suppress(OSError):
            path.unlink()


def _put(store: MacroStore, draft: Draft, data: bytes) -> None:
    text = utf8(data, str(draft.file))
    macro = parse_macro(text, str(draft.file))
    if macro.name != draft.name:
        hint = f"write name = {draft.name!r}; macro rename {draft.name} {macro.name} renames it"
        raise Diagnostic(f"name = {macro.name!r} in the macro {draft.name}", str(draft.file), hint)
    store.save_text(macro, text, draft.base)
