"""Macros as files in one folder: `NAME.toml`, written whole or not at all.

Text that a person wrote into a file stays there when its key changes. A macro replaces another only on request, and
only if the file is as it was at that time.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from dialects.errors import Diagnostic
from macros.atomic import write_atomically
from macros.model import KEYS, Macro, check, check_name, describe_clash
from macros.toml_edit import with_value
from macros.toml_format import format_macro, parse_macro


class MacroStore:
    """The macros in a folder, which may not exist yet. Methods raise Diagnostic with the name of the file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        """The path of a macro's file. Raises Diagnostic for an invalid name."""
        check_name(name)
        return self.folder / f"{name}.toml"

    def names(self) -> list[str]:
        """The names of all macro files in order, readable or not; empty without a folder."""
        try:
            found = [entry.stem for entry in self.folder.iterdir() if entry.suffix == ".toml"]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise _unreadable(self.folder, error) from None
        return sorted(name for name in found if not name.startswith("."))

    def load(self, name: str) -> Macro:
        """Read the macro of that name."""
        path = self.path(name)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            names = ", ".join(self.names())
            hint = f"valid: {names}" if names else "no macro has been recorded"
            raise Diagnostic(f"no macro {name!r}", str(self.folder), hint) from None
        except OSError as error:
            raise _unreadable(path, error) from None
        macro = parse_macro(_text(data, str(path)), str(path))
        if macro.name != name:
            raise Diagnostic(
                f"name = {macro.name!r} in the file of {name!r}",
                str(path),
                "make the name and the file's agree",
            )
        return macro

    def contents(self, name: str) -> bytes | None:
        """Read the bytes of a macro's file, for `save`; None without a file."""
        path = self.path(name)
        try:
            return path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise _unreadable(path, error) from None

    def by_key(self, key: str) -> Macro | None:
        """The macro on a key, or None.

        Raises Diagnostic if several macros are on it, or if there is none and a file is unreadable: that may be it.
        """
        found, broken = self.on_key(key)
        if len(found) > 1:
            problem = describe_clash(key.upper(), [macro.name for macro in found])
            raise Diagnostic(problem, str(self.folder), "give one another key")
        if not found and broken:
            raise broken[0]
        return found[0] if found else None

    def on_key(self, key: str) -> tuple[list[Macro], list[Diagnostic]]:
        """Every macro on a key, and the problems of the files that are unreadable."""
        found, broken = self._read()
        return [macro for macro in found if macro.key == key.upper()], broken

    def clashes(self) -> list[str]:
        """A line for each key with several macros; unreadable files are left out."""
        by_key: dict[str, list[str]] = {}
        for macro in self._read()[0]:
            by_key.setdefault(macro.key, []).append(macro.name)
        return [describe_clash(key, by_key[key]) for key in KEYS if len(by_key.get(key, ())) > 1]

    def _read(self) -> tuple[list[Macro], list[Diagnostic]]:
        found, broken = [], []
        for name in self.names():
            try:
                found.append(self.load(name))
            except Diagnostic as problem:
                broken.append(problem)
        return found, broken

    def save(self, macro: Macro, before: bytes | None = None) -> Path:
        """Write the macro's file, whole or not at all; return its path.

        It replaces a file whose `contents` are `before`; None: there must be no file. Raises Diagnostic for another
        file, an invalid macro, a key that is taken, or a file that cannot be written.
        """
        path = self.path(macro.name)
        check(macro, str(path))
        self._check_free(macro.key, macro.name, path)
        if self.contents(macro.name) != before:
            raise Diagnostic("the file has changed meanwhile" if before else "the file exists already", str(path))
        self._write(path, format_macro(macro))
        return path

    def set_key(self, name: str, key: str) -> None:
        """Change the key in a macro's file (empty: none), and nothing else. Raises Diagnostic as `save` does."""
        path = self.path(name)
        changed = replace(self.load(name), key=key)
        check(changed, str(path))
        self._check_free(key, name, path)
        text = (self.contents(name) or b"").decode("utf-8")
        self._write(path, with_value(text, "key", key, str(path)))

    def free_name(self, name: str) -> str:
        """A name like this one that no macro has."""
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
            write_atomically(path, text.encode("utf-8"))
        except OSError as error:
            raise Diagnostic(
                f"cannot write the file ({error.strerror or error})", str(path), "the old file is unchanged"
            ) from None

    def delete(self, name: str) -> None:
        """Delete the macro's file."""
        path = self.path(name)
        try:
            path.unlink()
        except FileNotFoundError:
            raise Diagnostic(f"no macro {name!r}", str(self.folder)) from None
        except OSError as error:
            raise Diagnostic(f"cannot delete the file ({error.strerror})", str(path)) from None


def _text(data: bytes, where: str) -> str:
    try:
        return data.decode("utf-8-sig")  # an editor may have put a byte order mark in front
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise Diagnostic("not UTF-8 text", f"{where}:{line}", "save it as UTF-8") from None


def _unreadable(path: Path, error: OSError) -> Diagnostic:
    return Diagnostic(f"cannot read it ({error.strerror or error})", str(path))
