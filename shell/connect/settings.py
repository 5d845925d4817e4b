"""The user's configuration: one TOML file in the platform's configuration folder, checked as a whole.

    [connections.press]
    url = "serial:/dev/ttyUSB0?drives=a,b"
    names = { a = "gantry", b = "clamp" }

    [guards]                    # which lines need a yes (`settings_tables`)
    off = ["BD"]
    also = ["S"]

    [log]                       # the session log (`settings_tables`)
    always = true

    [mqtt]                      # the login for a broker (`settings_tables`)
    username = "shop-7"

    [screen]                    # colours and signs, and [keys] (`settings_tables`)
    theme = "multidrop-light"

`MULTIDROP_CONFIG_DIR` moves the configuration and the macros; `MULTIDROP_STATE_DIR` moves the history.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import split_lines, toml_of, utf8_of, why
from multidrop.dialects.text import visible
from multidrop.macros.atomic import write_atomically
from multidrop.shell.connect.settings_tables import (
    DEFAULT_LOOK,
    Guarding,
    LogSettings,
    Look,
    MqttSettings,
    read_guards,
    read_log,
    read_look,
    read_mqtt,
)

# The line of a key in a TOML file, for messages: the parser that reads the values does not report it.


def line_of(text: str, key: Sequence[str]) -> int:
    """The number of the line with a key, given with its tables (`screen`, `theme`), or with its table; 0: not found."""
    table: tuple[str, ...] = ()
    best = 0
    for number, line in enumerate(split_lines(text), 1):
        if header := re.match(r"\s*\[\[?([^\]]+)\]", line):
            table = _parts(header[1])
            found = table
        elif pair := re.match(r"\s*([^=#]+?)\s*=", line):
            found = (*table, *_parts(pair[1]))
        else:
            continue
        if found == tuple(key):
            return number
        if not best and found and found == tuple(key[: len(found)]):
            best = number
    return best


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


@dataclass(frozen=True)
class SavedConnection:
    """A named URL, and names for its drives by address."""

    name: str
    url: str
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Settings:
    """The contents of the configuration file, and the places of the user's files."""

    connections: Mapping[str, SavedConnection] = field(default_factory=dict)
    folder: Path = field(default_factory=lambda: config_folder())
    state: Path = field(default_factory=lambda: state_folder())
    guards: Guarding = Guarding()
    log: LogSettings = LogSettings()
    look: Look = DEFAULT_LOOK
    mqtt: MqttSettings = MqttSettings()
    allowed: tuple[Path, ...] = ()
    """Where paths of cell files may lead, too, in `simulator.allow`."""
    clusters: tuple[str, ...] = ()
    """The addresses of the schedulers that may run code here, in `sweep.clusters`."""

    @property
    def macros(self) -> Path:
        return self.folder / "macros"

    @property
    def project_macros(self) -> Path:
        """The folder of the macros beside a project: in the current folder."""
        return Path("macros")

    @property
    def macro_drafts(self) -> Path:
        """The folder of copies of macros that an editor has."""
        return self.state / "macro-drafts"

    @property
    def history(self) -> Path:
        """The file of the history, which the prompt and the TUI share."""
        return self.state / "history"


def config_folder() -> Path:
    """The folder of the configuration file and the macros; may not exist."""
    if given := os.environ.get("MULTIDROP_CONFIG_DIR"):
        return Path(given)
    from platformdirs import user_config_path

    return user_config_path("multidrop", appauthor=False)


def state_folder() -> Path:
    """The folder of the state kept between runs; may not exist."""
    if given := os.environ.get("MULTIDROP_STATE_DIR"):
        return Path(given)
    from platformdirs import user_state_path

    return user_state_path("multidrop", appauthor=False)


def config_file() -> Path:
    """The configuration file; may not exist."""
    return config_folder() / "multidrop.toml"


def load() -> Settings:
    """Read the configuration; a missing file counts as empty. Raises Diagnostic with file and key."""
    path = config_file()
    try:
        return parse(utf8_of(path), str(path))
    except Diagnostic as problem:
        if isinstance(problem.__cause__, FileNotFoundError):
            return Settings()
        raise


def parse(text: str, where: str) -> Settings:
    """Parse a configuration file. Raises Diagnostic with file, line and key."""
    document = toml_of(text, where)
    try:
        return _read(document, where)
    except Diagnostic as failure:
        raise placed(failure.message, text, where, failure.hint) from None


def placed(message: str, text: str, where: str, hint: str = "") -> Diagnostic:
    """A Diagnostic with the line of the key that the message begins with: `no key screen.x`, `log.files is not ...`."""
    key = re.match(r"(?:no key )?([\w.-]+)", message)
    line = line_of(text, key[1].rstrip(".").split(".")) if key else 0
    return Diagnostic(message, f"{where}:{line}" if line else where, hint)


def _read(document: Mapping[str, Any], where: str) -> Settings:
    _only(document, {"connections", "guards", "keys", "log", "mqtt", "screen", "simulator", "sweep"}, where, "")
    tables = document.get("connections", {})
    if not isinstance(tables, dict):
        raise Diagnostic("connections is not a table", where, "write [connections.NAME]")
    connections = {name: _connection(name, table, where) for name, table in tables.items()}
    return Settings(
        connections,
        guards=read_guards(document.get("guards", {}), where),
        log=read_log(document.get("log", {}), where),
        look=read_look(document.get("screen", {}), document.get("keys", {}), where),
        mqtt=read_mqtt(document.get("mqtt", {}), where),
        allowed=tuple(
            Path(where).parent / os.path.expanduser(each) for each in _texts(document, "simulator", "allow", where)
        ),
        clusters=_texts(document, "sweep", "clusters", where),
    )


def _connection(name: str, table: Any, where: str) -> SavedConnection:
    key = f"connections.{name}"
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise Diagnostic(f"{key}: not a name", where, "valid: letters, digits, - and _")
    if not isinstance(table, dict):
        raise Diagnostic(f"{key} is not a table", where, f"write [{key}] with url = ...")
    _only(table, {"url", "names"}, where, f"{key}.")
    url = table.get("url")
    if not isinstance(url, str) or not url:
        raise Diagnostic(f"{key}.url is missing or not text", where)
    names = table.get("names", {})
    if not isinstance(names, dict) or not all(isinstance(label, str) and label for label in names.values()):
        raise Diagnostic(f"{key}.names is not a table of names", where, 'as in { a = "gantry" }')
    for label in names.values():
        if not re.fullmatch(r"[^\s:@/]+", label) or visible(label) != label:
            hint = "invalid: spaces, control characters, :, @ and /"
            raise Diagnostic(f"{key}.names: {label!r} is not a name", where, hint)
    return SavedConnection(name, url, names)


def _texts(document: Mapping[str, Any], name: str, key: str, where: str) -> tuple[str, ...]:
    """The list of texts that is the only key of a table."""
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise Diagnostic(f"{name} is not a table", where, f"write [{name}] with {key} = [...]")
    _only(table, {key}, where, f"{name}.")
    found = table.get(key, [])
    if not isinstance(found, list) or not all(isinstance(each, str) and each for each in found):
        raise Diagnostic(f"{name}.{key} is not a list of texts", where, f'as in {key} = ["..."]')
    return tuple(found)


def _only(table: Mapping[str, Any], known: set[str], where: str, prefix: str) -> None:
    for key in table:
        if key not in known:
            raise Diagnostic(f"no key {prefix}{key}", where, f"valid: {', '.join(sorted(known))}")


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
    path = config_file().resolve()
    try:
        write_atomically(path, text.encode())
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    return path


def _document() -> Any:
    """The file as it is, with its remarks and its layout. Raises Diagnostic."""
    import tomlkit

    path = config_file()
    text = utf8_of(path) if path.exists() else ""
    toml_of(text, str(path))  # tomlkit takes its time over what is wrong, and names no line
    return tomlkit.parse(text)


def _checked(document: Any) -> str:
    """The text of a changed file, which is read again to make sure. Raises Diagnostic."""
    import tomlkit

    text = tomlkit.dumps(document)
    parse(text, str(config_file()))
    return text


def _with_connection(name: str, url: str) -> str:
    """Return the text of the file with a new connection. Raises Diagnostic."""
    import tomlkit

    if name in load().connections:
        raise Diagnostic(f"a connection {name} exists already", str(config_file()), "give another name")
    document = _document()
    if "connections" not in document:
        document["connections"] = tomlkit.table(is_super_table=True)
    table = tomlkit.table()
    table["url"] = url
    document["connections"][name] = table
    return _checked(document)
