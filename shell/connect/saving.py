"""A new connection in the configuration file, which keeps its remarks and its layout."""

from __future__ import annotations

from pathlib import Path

from dialects import Diagnostic
from dialects.files import why
from macros.atomic import write_atomically
from shell.connect import settings


def check_new(name: str) -> None:
    """Check that a connection can be saved under a name. Raises Diagnostic."""
    _with_connection(name, "sim:")


def save(name: str, url: str) -> Path:
    """Add a connection; return the file, which is replaced as a whole. Raises Diagnostic."""
    text = _with_connection(name, url)
    path = settings.config_file().resolve()
    try:
        write_atomically(path, text.encode())
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
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
