"""A new connection in the configuration file, which keeps its remarks and its layout."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from dialects import Diagnostic
from shell.connect import settings


def check_new(name: str) -> None:
    """Check that a connection can be saved under a name. Raises Diagnostic."""
    _with_connection(name, "sim:")


def save(name: str, url: str) -> Path:
    """Add a connection; return the file, which is replaced as a whole. Raises Diagnostic."""
    text = _with_connection(name, url)
    path = settings.config_file().resolve()
    new = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
        with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, mode), "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as problem:
        with contextlib.suppress(OSError):
            new.unlink(missing_ok=True)
        raise Diagnostic(f"cannot be written: {problem.strerror or problem}", str(path)) from None
    return path


def _with_connection(name: str, url: str) -> str:
    """Return the text of the file with a new connection, which is read again to make sure. Raises Diagnostic."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    path = settings.config_file()
    if name in settings.load().connections:
        raise Diagnostic(f"a connection {name} exists already", str(path), "give another name")
    try:
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        document = tomlkit.parse(text)
    except (OSError, UnicodeDecodeError, TOMLKitError) as problem:
        raise Diagnostic(f"cannot be read: {problem}", str(path)) from None
    if "connections" not in document:
        document["connections"] = tomlkit.table(is_super_table=True)
    table = tomlkit.table()
    table["url"] = url
    document["connections"][name] = table
    result = tomlkit.dumps(document)
    settings.parse(result, str(path))
    return result
