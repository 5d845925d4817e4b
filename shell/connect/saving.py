"""Changes of the configuration file by the program; the file keeps its remarks and its layout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import toml_of, utf8_of, why
from multidrop.macros.atomic import write_atomically
from multidrop.shell.connect import settings


def check_new(name: str) -> None:
    """Check that a connection can be saved under a name. Raises Diagnostic."""
    _with_connection(name, "sim:")


def save(name: str, url: str) -> Path:
    """Add a connection; return the file, which is replaced as a whole. Raises Diagnostic."""
    return _write(_with_connection(name, url))


def keep(table: str, key: str, value: str | list[str]) -> Path:
    """Set one value of a table; return the file, which is replaced as a whole. Raises Diagnostic."""
    import tomlkit

    document = _document()
    if table not in document:
        document[table] = tomlkit.table()
    document[table][key] = value
    return _write(_checked(document))


def _write(text: str) -> Path:
    path = settings.config_file().resolve()
    try:
        write_atomically(path, text.encode())
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    return path


def _document() -> Any:
    """The file as it is, with its remarks and its layout. Raises Diagnostic."""
    import tomlkit

    path = settings.config_file()
    text = utf8_of(path) if path.exists() else ""
    toml_of(text, str(path))  # tomlkit takes its time over what is wrong, and names no line
    return tomlkit.parse(text)


def _checked(document: Any) -> str:
    """The text of a changed file, which is read again to make sure. Raises Diagnostic."""
    import tomlkit

    text = tomlkit.dumps(document)
    settings.parse(text, str(settings.config_file()))
    return text


def _with_connection(name: str, url: str) -> str:
    """Return the text of the file with a new connection. Raises Diagnostic."""
    import tomlkit

    if name in settings.load().connections:
        raise Diagnostic(f"a connection {name} exists already", str(settings.config_file()), "give another name")
    document = _document()
    if "connections" not in document:
        document["connections"] = tomlkit.table(is_super_table=True)
    table = tomlkit.table()
    table["url"] = url
    document["connections"][name] = table
    return _checked(document)
