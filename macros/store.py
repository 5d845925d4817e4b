"""Macros as files that a person can read and edit: `NAME.toml` in one folder, written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dialects.errors import Diagnostic
from macros.model import Macro, Step, check, check_name

_HEAD = "# a macro of multidrop: lines as typed, with the seconds after the line before\n"
_SHORT = {"\\": "\\\\", '"': '\\"', "\t": "\\t", "\n": "\\n", "\r": "\\r", "\b": "\\b", "\f": "\\f"}
_KEYS = {"name": str, "key": str, "note": str, "step": list}
_STEP_KEYS = {"after": float, "line": str}
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
            known = ", ".join(self.names())
            hint = f"there are {known}" if known else "none has been recorded"
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

    def by_key(self, key: str) -> Macro | None:
        """The macro on a key, or None.

        Raises Diagnostic where two are on it, or none is and a file could not be read: it may be that one.
        """
        found, broken = self._on_key(key.upper())
        if len(found) > 1:
            both = " and ".join(macro.name for macro in found)
            raise Diagnostic(f"{both} are both on {key.upper()}", str(self.folder), "give one another key")
        if not found and broken:
            raise broken[0]
        return found[0] if found else None

    def _on_key(self, key: str) -> tuple[list[Macro], list[Diagnostic]]:
        found, broken = [], []
        for name in self.names():
            try:
                macro = self.load(name)
            except Diagnostic as problem:
                broken.append(problem)
                continue
            if macro.key == key:
                found.append(macro)
        return found, broken

    def save(self, macro: Macro) -> Path:
        """Write the macro's file, whole or not at all, in place of one of the same name; gives its path.

        Raises Diagnostic where the macro is wrong, another is on its key, or the file cannot be written.
        """
        path = self.path(macro.name)
        check(macro, str(path))
        if macro.key:
            others = [other.name for other in self._on_key(macro.key)[0] if other.name != macro.name]
            if others:
                raise Diagnostic(
                    f"{macro.key} already plays {others[0]}",
                    str(path),
                    "take another key, or none, for one of them",
                )
        try:
            _write_whole(path, dump(macro).encode("utf-8"))
        except OSError as error:
            raise Diagnostic(
                f"cannot write it ({error.strerror or error})", str(path), "what was there is as it was"
            ) from None
        return path

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
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(error, where) from None
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
        if not right:
            raise Diagnostic(f"{which}{key} must be {_CALLED[kind]}", where)


def _not_toml(error: tomllib.TOMLDecodeError, where: str) -> Diagnostic:
    text = str(error)
    place = re.search(r" \(at line (\d+), column \d+\)$", text)
    if place:
        where, text = f"{where}:{place[1]}" if where else f"line {place[1]}", text[: place.start()]
    return Diagnostic(f"not TOML: {text}", where, "correct the line")


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


def _write_whole(path: Path, data: bytes) -> None:
    """A new file beside the old one takes its place only when all of it is on the disk. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    target = Path(os.path.realpath(path))  # a link to a file elsewhere stays a link
    beside = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    _sync_folder(target.parent)


def _sync_folder(folder: Path) -> None:
    """Make the new name last through a power cut, where folders can be synced; the file is whole already."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
