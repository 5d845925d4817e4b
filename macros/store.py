"""Macros as files that a person can read and edit: `NAME.toml` in one folder, written whole or not at all.

What a person wrote into a file stays there when its key is changed. A macro is replaced only where that was asked for,
and only while its file is as it was then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dialects.errors import Diagnostic
from dialects.files import toml_of
from macros.edit import with_value
from macros.model import KEYS, Macro, Step, check, check_name, clash
from macros.writing import write_whole

_HEAD = "# a macro of multidrop: lines as typed, with the seconds after the line before\n"
_SHORT = {"\\": "\\\\", '"': '\\"', "\t": "\\t", "\n": "\\n", "\r": "\\r", "\b": "\\b", "\f": "\\f"}
_KEYS = {"name": str, "key": str, "note": str, "step": list}
_STEP_KEYS = {"after": float, "line": str}
_MOST = 10**15
"""Of whole numbers; a float has no room for one of some hundred digits."""
_CALLED = {str: "text in quotes", float: "a number", list: "[[step]] tables", dict: "a table"}


class MacroStore:
    """The macros in a folder, which need not be there yet. Methods raise Diagnostic with the file's name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        """Where the macro is kept. Raises Diagnostic for a name that cannot be."""
        check_name(name)
        return self.folder / f"{name}.toml"

    def names(self) -> list[str]:
        """The names of all macro files in order, readable or not; none where there is no folder."""
        try:
            found = [entry.stem for entry in self.folder.iterdir() if entry.suffix == ".toml"]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise _unreadable(self.folder, error) from None
        return sorted(name for name in found if not name.startswith("."))

    def load(self, name: str) -> Macro:
        """The macro of that name."""
        path = self.path(name)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            names = ", ".join(self.names())
            hint = f"there are {names}" if names else "none has been recorded"
            raise Diagnostic(f"no macro {name!r}", str(self.folder), hint) from None
        except OSError as error:
            raise _unreadable(path, error) from None
        macro = parse(_text(data, str(path)), str(path))
        if macro.name != name:
            raise Diagnostic(
                f"name = {macro.name!r} in the file of {name!r}",
                str(path),
                "make the name and the file's agree",
            )
        return macro

    def contents(self, name: str) -> bytes | None:
        """What is in the macro's file; None where there is none. For `save`."""
        path = self.path(name)
        try:
            return path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise _unreadable(path, error) from None

    def by_key(self, key: str) -> Macro | None:
        """The macro on a key, or None.

        Raises Diagnostic where two are on it, or none is and a file could not be read: it may be that one.
        """
        found, broken = self.on_key(key)
        if len(found) > 1:
            raise Diagnostic(
                clash(key.upper(), [macro.name for macro in found]), str(self.folder), "give one another key"
            )
        if not found and broken:
            raise broken[0]
        return found[0] if found else None

    def on_key(self, key: str) -> tuple[list[Macro], list[Diagnostic]]:
        """Every macro on a key, and the files that could not be read."""
        found, broken = self._read()
        return [macro for macro in found if macro.key == key.upper()], broken

    def clashes(self) -> list[str]:
        """A line for each key that several macros are on; files that cannot be read are left out."""
        by_key: dict[str, list[str]] = {}
        for macro in self._read()[0]:
            by_key.setdefault(macro.key, []).append(macro.name)
        return [clash(key, by_key[key]) for key in KEYS if len(by_key.get(key, ())) > 1]

    def _read(self) -> tuple[list[Macro], list[Diagnostic]]:
        found, broken = [], []
        for name in self.names():
            try:
                found.append(self.load(name))
            except Diagnostic as problem:
                broken.append(problem)
        return found, broken

    def save(self, macro: Macro, before: bytes | None = None) -> Path:
        """Write the macro's file, whole or not at all; gives its path.

        It takes the place of a file whose `contents` are `before`; None: there must be none. Raises Diagnostic where
        there is another file, the macro is wrong, another is on its key, or the file cannot be written.
        """
        path = self.path(macro.name)
        check(macro, str(path))
        self._check_free(macro.key, macro.name, path)
        if self.contents(macro.name) != before:
            raise Diagnostic("the file was changed meanwhile" if before else "is there already", str(path))
        self._write(path, dump(macro))
        return path

    def put_on_key(self, name: str, key: str) -> None:
        """Change a macro's key (empty: none) in its file, and nothing else there. Raises Diagnostic as `save` does."""
        path = self.path(name)
        changed = replace(self.load(name), key=key)
        check(changed, str(path))
        self._check_free(key, name, path)
        text = (self.contents(name) or b"").decode("utf-8")
        self._write(path, with_value(text, "key", key, str(path)))

    def free_name(self, name: str) -> str:
        """A name like that one, of which there is no macro."""
        taken, number = self.names(), 2
        while f"{name[:60]}-{number}" in taken:
            number += 1
        return f"{name[:60]}-{number}"

    def _check_free(self, key: str, name: str, path: Path) -> None:
        others = [other.name for other in self.on_key(key)[0] if other.name != name] if key else []
        if others:
            raise Diagnostic(
                f"{key} already plays {others[0]}", str(path), "take another key, or none, for one of them"
            )

    def _write(self, path: Path, text: str) -> None:
        try:
            write_whole(path, text.encode("utf-8"))
        except OSError as error:
            raise Diagnostic(
                f"cannot write it ({error.strerror or error})", str(path), "what was there is as it was"
            ) from None

    def delete(self, name: str) -> None:
        """Remove the macro's file."""
        path = self.path(name)
        try:
            path.unlink()
        except FileNotFoundError:
            raise Diagnostic(f"no macro {name!r}", str(self.folder)) from None
        except OSError as error:
            raise Diagnostic(f"cannot remove it ({error.strerror})", str(path)) from None


def dump(macro: Macro) -> str:
    """The macro as the text of its file."""
    parts = [_HEAD]
    parts += [f"{key} = {_quoted(getattr(macro, key))}\n" for key in ("name", "key", "note")]
    for step in macro.steps:
        parts.append(f"\n[[step]]\nafter = {float(step.after)!r}\nline = {_quoted(step.line)}\n")
    return "".join(parts)


def parse(text: str, where: str = "") -> Macro:
    """The macro in a file's text. Raises Diagnostic with `where` for anything that is not one."""
    table = toml_of(text, where)
    _check_table(table, _KEYS, "", where)
    if "name" not in table:
        raise Diagnostic("no name", where, 'add name = "..."')
    steps = tuple(_step(each, f"step {number}: ", where) for number, each in enumerate(table.get("step", []), 1))
    macro = Macro(table["name"], steps, table.get("key", "").upper(), table.get("note", ""))
    check(macro, where)
    return macro


def _step(table: Any, which: str, where: str) -> Step:
    if not isinstance(table, dict):
        raise Diagnostic(f"{which}must be a table", where, "write [[step]], then after = and line =")
    _check_table(table, _STEP_KEYS, which, where)
    if "line" not in table:
        raise Diagnostic(f"{which}no line", where, 'add line = "..."')
    return Step(float(table.get("after", 0.0)), table["line"])


def _check_table(table: dict[str, Any], keys: Mapping[str, type], which: str, where: str) -> None:
    for key, value in table.items():
        if key not in keys:
            raise Diagnostic(f"{which}unknown key {key!r}", where, f"the keys are {', '.join(keys)}")
        kind = keys[key]
        right = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
        if not right or (isinstance(value, int) and abs(value) > _MOST):
            raise Diagnostic(f"{which}{key} must be {_CALLED[kind]}", where)


def _quoted(text: str) -> str:
    """A TOML basic string: quotes, backslashes and all that TOML or a terminal would act upon escaped."""
    return '"' + "".join(_SHORT.get(char) or (char if _plain(char) else _coded(char)) for char in text) + '"'


def _plain(char: str) -> bool:
    return char == " " or char.isprintable()


def _coded(char: str) -> str:
    return f"\\u{ord(char):04x}" if ord(char) < 0x10000 else f"\\U{ord(char):08x}"


def _text(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")  # an editor may have put a byte order mark in front
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise Diagnostic("not UTF-8 text", f"{where}:{line}", "save it as UTF-8") from None


def _unreadable(path: Path, error: OSError) -> Diagnostic:
    return Diagnostic(f"cannot read it ({error.strerror or error})", str(path))
