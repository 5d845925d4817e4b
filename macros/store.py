"""Macros as files: `NAME.toml` in the user's folder, or in one beside a project, written whole or not at all.

A project's macro hides the user's of the same name. Text that a person wrote into a file stays there when the program
changes a value. A macro replaces another only on request, and only if the file is as it was at that time.

A draft is a copy of a macro's file that a person edits. The macro changes only once the whole text is right. A draft
that is wrong stays, so that nothing typed is lost; the next edit goes on with it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from multidrop.base.atomic import create_atomically, make_folder, write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import bounded, opened, utf8
from multidrop.base.text import visible
from multidrop.macros.model import FIRST_PAGE, KEYS, Macro, check, check_name, describe_clash, page_order
from multidrop.macros.toml_format import format_macro, parse_macro, with_values


class MacroStore:
    """The macros in two folders, which may not exist yet. Methods raise Diagnostic with the name of the file."""

    def __init__(self, folder: Path, project: Path | None = None) -> None:
        self.folder = folder
        self.project = project
        """The folder beside a project; its macros come first."""
        with contextlib.suppress(OSError):
            if project is not None and project.resolve() == folder.resolve():
                self.project = None

    @property
    def folders(self) -> tuple[Path, ...]:
        return (self.folder,) if self.project is None else (self.project, self.folder)

    def path(self, name: str) -> Path:
        """The path of a macro's file, the user's where there is none. Raises Diagnostic for an invalid name."""
        check_name(name)
        paths = [folder / f"{name}.toml" for folder in self.folders]
        return next((path for path in paths if path.exists()), paths[-1])

    def names(self) -> list[str]:
        """The names of all macro files in order, readable or not; empty without a folder."""
        return sorted(set[str]().union(*map(self._names_in, self.folders)))

    def hidden(self) -> list[str]:
        """A line for each name that both folders have: the project's macro hides the user's."""
        both = self._names_in(self.folder) & self._names_in(self.project) if self.project else set[str]()
        return [_hiding(name, self.folders) for name in sorted(both)]

    def hides(self, name: str) -> str:
        """Say that a macro beside the project hides the user's of the same name; empty: it hides none."""
        hides = self.is_project(name) and (self.folder / f"{name}.toml").exists()
        return _hiding(name, self.folders) if hides else ""

    def is_project(self, name: str) -> bool:
        return self.path(name).parent == self.project

    def _names_in(self, folder: Path) -> set[str]:
        try:
            names = {entry.stem for entry in folder.iterdir() if entry.suffix == ".toml"}
        except FileNotFoundError:
            return set()
        except OSError as error:
            if folder == self.project and isinstance(error, NotADirectoryError):
                return set()
            raise _unreadable(folder, error) from None
        return {name for name in names if not name.startswith(".")}

    def load(self, name: str) -> Macro:
        return self._loaded(name)[0]

    def _loaded(self, name: str) -> tuple[Macro, bytes]:
        """A macro, and the bytes of its file that it was read from."""
        path = self.path(name)
        try:
            data = _bytes(path)
        except FileNotFoundError:
            if path.is_symlink():
                what = "a link to a file that is not there"
                raise Diagnostic(what, str(path), "correct or delete the link") from None
            names = ", ".join(self.names())
            hint = f"valid: {names}" if names else "no macro has been recorded"
            where = " and ".join(map(str, self.folders))
            raise Diagnostic(f"no macro {name!r}", where, hint) from None
        except OSError as error:
            raise _unreadable(path, error) from None
        macro = parse_macro(utf8(data, str(path)), str(path))
        if macro.name != name:
            what = f"name = {macro.name!r} in the file of {name!r}"
            raise Diagnostic(what, str(path), "make the name and the file's agree")
        return macro, data

    def contents(self, name: str) -> bytes | None:
        """Read the bytes of a macro's file, for `save`; None without a file."""
        path = self.path(name)
        try:
            return _bytes(path)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise _unreadable(path, error) from None

    def on_key(self, key: str, page: str = FIRST_PAGE) -> tuple[list[Macro], list[Diagnostic]]:
        """Every macro on a key of a page, and the problems of the files that are unreadable."""
        macros, broken = self._read()
        return [macro for macro in macros if (macro.key, macro.page) == (key.upper(), page)], broken

    def pages(self) -> list[str]:
        """The pages with a macro on a key, the first one always; unreadable files are left out."""
        return sorted({FIRST_PAGE, *(macro.page for macro in self._read()[0] if macro.key)}, key=page_order)

    def clashes(self) -> list[str]:
        """A line for each key with several macros; unreadable files are left out."""
        by_key: dict[tuple[str, str], list[str]] = {}
        for macro in self._read()[0]:
            by_key.setdefault((macro.page, macro.key), []).append(macro.name)
        pages = sorted({page for page, _ in by_key}, key=page_order)
        return [
            describe_clash(key if page == FIRST_PAGE else f"{key} of page {page}", names)
            for page in pages
            for key in KEYS
            if len(names := by_key.get((page, key), [])) > 1
        ]

    def _read(self) -> tuple[list[Macro], list[Diagnostic]]:
        macros, broken = [], []
        for name in self.names():
            try:
                macros.append(self.load(name))
            except Diagnostic as problem:
                broken.append(problem)
        return macros, broken

    def save(self, macro: Macro, before: bytes | None = None) -> Path:
        """Write the macro's file, whole or not at all; return its path.

        It replaces a file whose `contents` are `before`; None: there must be no file. Raises Diagnostic for another
        file, an invalid macro, a key that is taken, or a file that cannot be written.
        """
        return self.save_text(macro, format_macro(macro), before)

    def save_text(self, macro: Macro, text: str, before: bytes | None) -> Path:
        """Write the text of a macro as `save` does; what a person wrote into it stays."""
        path = self._checked_path(macro)
        if self.contents(macro.name) != before:
            raise Diagnostic("the file has changed meanwhile" if before else "the file exists already", str(path))
        if before is None:
            _create(path, text)
        else:
            _write(path, text)
        return path

    def set_key(self, name: str, key: str, page: str = FIRST_PAGE) -> None:
        """Change key (empty: none) and page in a macro's file, and nothing else. Raises Diagnostic as `save` does."""
        macro, data = self._loaded(name)
        page = page if key else macro.page
        changes = {"key": key} if page == macro.page else {"key": key, "page": page}
        self._change(replace(macro, key=key, page=page), changes, data)

    def describe(self, name: str, note: str) -> None:
        """Change the note in a macro's file, and nothing else."""
        macro, data = self._loaded(name)
        self._change(replace(macro, note=note), {"note": note}, data)

    def _change(self, macro: Macro, changes: Mapping[str, str], data: bytes) -> None:
        """Change values in the file that was read as `data`. Raises Diagnostic if it holds something else by now."""
        path = self._checked_path(macro)
        text = with_values(data.decode("utf-8"), changes, str(path))
        if self.contents(macro.name) != data:
            raise Diagnostic("the file has changed meanwhile", str(path), "it is as it is now; do it again")
        _write(path, text)

    def copy(self, name: str, new: str, into: Path | None = None, keep_key: bool = False) -> Path:
        """Create a file of a new name with the same text, beside the old one or in another folder.

        Only one macro can have the key, so the copy has none unless `keep_key` is set.
        """
        check_name(new)
        macro, data = self._loaded(name)
        old = self.path(name)
        path = (into or old.parent) / f"{new}.toml"
        changes = {"name": new, "key": macro.key if keep_key else ""}
        wanted = {key: value for key, value in changes.items() if getattr(macro, key) != value}
        _create(path, with_values(data.decode("utf-8"), wanted, str(old)))
        return path

    def rename(self, name: str, new: str) -> Path:
        """Give a macro another name: in the file, and of the file. Its key stays."""
        path = self.copy(name, new, keep_key=True)
        self.delete(name)
        return path

    def free_name(self, name: str) -> str:
        """A name like this one that no macro has."""
        taken, number = self.names(), 2
        while f"{name[:60]}-{number}" in taken:
            number += 1
        return f"{name[:60]}-{number}"

    def _checked_path(self, macro: Macro) -> Path:
        """The path of a macro's file. Raises Diagnostic for an invalid macro, and a key that is taken."""
        path = self.path(macro.name)
        check(macro, str(path))
        for other in self.on_key(macro.key, macro.page)[0] if macro.key else ():
            if other.name != macro.name:
                what = f"{macro.place} already plays {other.name}"
                raise Diagnostic(what, str(path), "take another key, or none, for one of them")
        return path

    def delete(self, name: str) -> Path:
        path = self.path(name)
        try:
            path.unlink()
        except FileNotFoundError:
            raise Diagnostic(f"no macro {path.stem!r}", str(path.parent)) from None
        except OSError as error:
            raise Diagnostic(f"cannot delete the file ({error.strerror})", str(path)) from None
        return path


def _hiding(name: str, folders: Sequence[Path]) -> str:
    return f"macro {name}: the one in {folders[0]} is played, not that in {folders[-1]}"


def _bytes(path: Path) -> bytes:
    """Read a file. Raises OSError, and Diagnostic for a pipe, a device or a file that is too large."""
    with opened(path) as file:
        return bounded(file, str(path))


def _create(path: Path, text: str) -> None:
    if path.is_symlink():
        return _write(path, text)  # it leads nowhere yet: the file is elsewhere
    try:
        make_folder(path.parent)
    except OSError as error:
        raise Diagnostic(f"cannot make the folder ({error.strerror or error})", str(path.parent)) from None
    try:
        create_atomically(path, text.encode("utf-8"))
    except FileExistsError:
        raise Diagnostic("the file exists already", str(path), "use another name") from None
    except OSError as error:
        raise Diagnostic(f"cannot write the file ({error.strerror or error})", str(path)) from None


def _write(path: Path, text: str) -> None:
    try:
        write_atomically(path, text.encode("utf-8"))
    except OSError as error:
        what = f"cannot write the file ({error.strerror or error})"
        raise Diagnostic(what, str(path), "the old file is unchanged") from None


def _unreadable(path: Path, error: OSError) -> Diagnostic:
    return Diagnostic(f"cannot read it ({error.strerror or error})", str(path))


class MacroListing(NamedTuple):
    """A line for each macro, the warnings about them, and the problems of the files that cannot be read."""

    lines: list[str]
    warnings: list[str]
    broken: list[Diagnostic]


def listed(store: MacroStore) -> MacroListing:
    """List the macros: name, key and page, length, values, roles, note; and which are beside the project."""
    lines, broken = [], list[Diagnostic]()
    for name in store.names():
        try:
            summary = visible(store.load(name).summary)
        except Diagnostic as problem:
            broken.append(problem)
        else:
            lines.append(f"{summary}  [{store.project}]" if store.is_project(name) else summary)
    return MacroListing(lines, [*store.clashes(), *store.hidden()], broken)


class MacroDraft(NamedTuple):
    """A copy that is being edited."""

    name: str
    file: Path
    base: bytes
    """The macro's file when the copy was made."""
    remark: str = ""
    """A notice for the person before the edit."""


def begin_draft(store: MacroStore, folder: Path, name: str) -> MacroDraft:
    """Make a draft of a macro, or find the one that is left. Raises Diagnostic for an unknown macro."""
    current = store.contents(name)
    if current is None:
        store.load(name)  # raises, with the names that there are
        raise Diagnostic(f"no macro {name!r}", str(store.folder))
    file, kept = folder / f"{name}.toml", folder / f"{name}.base"
    try:
        if file.exists() and kept.exists() and kept.read_bytes() == current:
            changed = file.read_bytes() != current
            return MacroDraft(name, file, current, f"goes on with the text of the last edit, {file}" if changed else "")
        remark = ""
        if file.exists():  # a draft of a macro that has changed since: it stays under another name
            number = next(n for n in range(1, 10_000) if not file.with_suffix(f".{n}.toml").exists())
            other = file.rename(file.with_suffix(f".{number}.toml"))
            remark = f"{name} has changed since the last edit, whose text is in {other}"
        for path in (kept, file):
            write_atomically(path, current, 0o600)
    except OSError as error:
        what = f"cannot write the copy ({error.strerror or error})"
        raise Diagnostic(what, str(file), f"{name} is as it was") from None
    return MacroDraft(name, file, current, remark)


def finish_draft(store: MacroStore, draft: MacroDraft) -> str:
    """Put the text of a draft in place of the macro; return what was done, in one line.

    Raises Diagnostic for a wrong text and for a macro that changed meanwhile. The macro is as it was then, and the
    draft stays.
    """
    try:
        data = draft.file.read_bytes()
        if data != draft.base:
            text = utf8(data, str(draft.file))
            macro = parse_macro(text, str(draft.file))
            if macro.name != draft.name:
                hint = f"write name = {draft.name!r}; macro rename {draft.name} {macro.name} renames it"
                raise Diagnostic(f"name = {macro.name!r} in the macro {draft.name}", str(draft.file), hint)
            store.save_text(macro, text, draft.base)
    except OSError as error:
        what = f"cannot read it ({error.strerror or error})"
        raise Diagnostic(what, str(draft.file), f"{draft.name} is as it was") from None
    except Diagnostic as problem:
        kept = f"{draft.name} is as it was; your text is in {draft.file}, and macro edit {draft.name} goes on with it"
        raise Diagnostic(problem.message, problem.where, f"{problem.hint}; {kept}".removeprefix("; ")) from None
    for path in (draft.file, draft.file.with_suffix(".base")):
        with contextlib.suppress(OSError):
            path.unlink()
    if data == draft.base:
        return f"macro {draft.name}: unchanged"
    return f"macro {draft.name}: {store.load(draft.name).length} in {store.path(draft.name)}"
