"""The user's configuration: one TOML file in the platform's configuration folder, checked as a whole.

[connections.press]
url = "serial:/dev/ttyUSB0?drives=a,b"
names = { a = "gantry", b = "clamp" }
units = { a = "5 mm/turn", b = { scale = "0.4 um/step", zero = "120 mm", travel = "0..300 mm", full_steps = 200 } }

[guards]
off = ["BD", "*"]           # guards that ask no more; "*": what can start every drive of a line
also = ["S", "EX"]          # words that ask, too

[log]
always = true               # a log of each session, in the state folder
megabytes = 16              # the size at which a part is full
files = 8                   # the parts that are kept

[screen]
theme = "multidrop-light"
signs = "ascii"             # auto, full, boxes, ascii
times = "last"              # of the lines in a transcript: off, clock, start, last

[keys]                      # keys by the names of functions
palette = "^G"
panel-plot = "F9"

`own_units = ["pallet"]`, above all tables, names further units. An axis of a controller is `"00.x"` in `units`.
A relative path begins at the folder of the configuration file. `MULTIDROP_CONFIG_DIR` moves the configuration and the
macros; `MULTIDROP_STATE_DIR` moves the history, `MULTIDROP_DATA_DIR` the backups.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multidrop.base import registry
from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.file_owners import other_writer, places
from multidrop.base.files import toml_of, utf8_of, why
from multidrop.base.places import config_file, config_folder, configuration_ignored, data_folder, state_folder
from multidrop.base.text import NOT_FIRST, acts_first, visible
from multidrop.shell.broken_configuration import WrongConfiguration, salvage
from multidrop.shell.roles import TIMES
from multidrop.shell.sections import Section, sections, text_list, valid

if TYPE_CHECKING:
    from multidrop.dialects import Family
    from multidrop.dialects.units import Scale

MEGABYTE = 1_000_000
CHOICES = {"signs": ("auto", "full", "boxes", "ascii"), "times": tuple(TIMES)}
"""The settings that have one of a few words."""
TRAVEL = "TRAVEL"
"""The guard on moves that leave the travel of their axis, which no family knows."""


@dataclass(frozen=True)
class SavedConnection:
    """A named URL; names for its drives by address, and scales by address or `ADDRESS.AXIS`."""

    name: str
    url: str
    names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, Scale] = field(default_factory=dict)
    folder: str = ""
    """The folder of the configuration file, where a relative path in the URL starts; empty: the current one."""


@dataclass(frozen=True)
class Guarding:
    """The changes of the configuration to the families' guards, in capitals."""

    off: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()

    def what(self, family: Family, text: str) -> str:
        """The effect of a line that a drive executes, if a person must agree to it; empty: it needs no yes."""
        guard = family.guard(text)
        if guard is not None and guard.name not in self.off:
            return guard.what
        word = family.word_of(text) if self.also else ""
        return f"'{text.strip()}' is sent: [guards] also has {word}" if word in self.also else ""


@dataclass(frozen=True)
class LogSettings:
    """The keeping of logs; `size` is that of a part, bytes."""

    always: bool = False
    size: int = 16 * MEGABYTE
    files: int = 8


@dataclass(frozen=True)
class ScreenSettings:
    """The settings of the screen. The screen itself checks the names of themes, functions and keys."""

    theme: str = ""
    signs: str = "auto"
    keys: Mapping[str, str] = field(default_factory=dict)
    where: str = ""
    """The file, for messages."""
    times: str = "clock"


DEFAULT_SCREEN = ScreenSettings()


@dataclass(frozen=True)
class Settings:
    """The contents of the configuration file, and the places of the user's files."""

    connections: Mapping[str, SavedConnection] = field(default_factory=dict)
    folder: Path = field(default_factory=lambda: config_folder())
    state: Path = field(default_factory=lambda: state_folder())
    guards: Guarding = Guarding()
    log: LogSettings = LogSettings()
    screen: ScreenSettings = DEFAULT_SCREEN
    allowed: tuple[Path, ...] = ()
    """Further folders to which paths of cell files may lead, in `simulator.allow`."""
    sections: Mapping[str, Any] = field(default_factory=dict)
    """What features read of the tables that they have there, by the names of these."""
    own_units: tuple[str, ...] = ()
    """Units beside those that every session knows."""
    problems: tuple[Diagnostic, ...] = ()
    """The errors of the file, of which only what is right counts."""
    in_doubt: Mapping[str, str] = field(default_factory=dict)
    """The errors that take names, units or guards from a saved connection; an empty name: from every line."""
    data: Path = field(default_factory=lambda: data_folder())
    """The folder of what belongs to the user and is never deleted here: backups."""

    def section(self, name: str) -> Any:
        """What the feature with this table read of it, also where the file has no such table."""
        if name not in self.sections:
            return sections()[name].read({}, "")
        return self.sections[name]

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


def load(lenient: bool = False) -> Settings:
    """Read the configuration; a missing file counts as empty, as every file does with --no-config.

    `lenient`: what is right in a file with errors counts. Raises Diagnostic with file and key, and all `problems`.
    """
    path = config_file()
    if configuration_ignored():
        return Settings()
    try:
        text = utf8_of(path)
    except Diagnostic as problem:
        if isinstance(problem.__cause__, FileNotFoundError):
            return Settings()
        raise
    if writer := other_writer(path):
        hint = f"chmod go-w {' '.join(map(str, places(path)))}, or give them to your account"
        unused = Diagnostic(f"can be changed by {writer}, so it is not used", str(path), hint)
        if lenient:
            return Settings(problems=(unused,), in_doubt={"": str(unused)})
        raise WrongConfiguration((unused,))
    return parse(text, str(path), lenient)


def parse(text: str, where: str, lenient: bool = False) -> Settings:
    """Parse a configuration file. Raises Diagnostic with file, line and key; its `problems` are all errors."""
    try:
        return _read(toml_of(text, where), where)
    except Diagnostic:
        settings, problems, doubts = salvage(text, where, _read)
        if lenient:
            return replace(settings, problems=problems, in_doubt=doubts)
        raise WrongConfiguration(problems) from None


def _read(document: Mapping[str, Any], where: str) -> Settings:
    """Check a parsed file. Raises Diagnostic, whose message begins with the key."""
    if not document.keys() <= {*valid()}:  # a table of a feature by others
        registry.load_others()
    _table(document, "", valid(), where, "")
    tables = document.get("connections", {})
    if not isinstance(tables, dict):
        raise Diagnostic("connections is not a table", where, "write [connections.NAME]")
    own = _own_units(document.get("own_units", []), where)
    connections = {name: _connection(name, table, where, own) for name, table in tables.items()}
    guards, log = _guards(document.get("guards", {}), where), _log(document.get("log", {}), where)
    screen_settings = _screen_settings(document.get("screen", {}), document.get("keys", {}), where)
    hint = "write [simulator] with allow = [...]"
    simulator = _table(document.get("simulator", {}), "simulator", ("allow",), where, hint)
    allowed = text_list(simulator, "simulator", "allow", where)
    read = {name: _section(document[name], section, where) for name, section in sections().items() if name in document}
    return Settings(
        connections,
        guards=guards,
        log=log,
        screen=screen_settings,
        allowed=tuple(Path(where).parent / os.path.expanduser(path) for path in allowed),
        sections=read,
        own_units=own,
    )


def _table(found: Any, name: str, keys: Sequence[str], where: str, hint: str) -> Mapping[str, Any]:
    """A table with no keys but these; an empty name is that of the whole file. Raises Diagnostic."""
    if not isinstance(found, dict):
        raise Diagnostic(f"{name} is not a table", where, hint)
    for key in found:
        if key not in keys:
            raise Diagnostic(f"no key {f'{name}.' if name else ''}{key}", where, f"valid: {', '.join(keys)}")
    return found


def _section(found: Any, section: Section, where: str) -> Any:
    """What a feature reads of its table. Raises Diagnostic, whose message begins with the name of the table."""
    table = _table(found, section.name, section.keys, where, f"write {section.example}")
    try:
        return section.read(table, where)
    except Diagnostic as problem:
        if re.match(rf"{re.escape(section.name)}(?![\w-])", problem.message):
            raise
        raise Diagnostic(f"{section.name}: {problem.message}", problem.where or where, problem.hint) from problem


def _own_units(found: Any, where: str) -> tuple[str, ...]:
    if not isinstance(found, list) or not all(isinstance(word, str) for word in found):
        raise Diagnostic("own_units is not a list of words", where, 'as in own_units = ["pallet"]')
    if found:
        from multidrop.dialects.units import check_own

        try:
            check_own(found)
        except Diagnostic as problem:
            raise Diagnostic(f"own_units: {problem.message}", where, problem.hint) from None
    return tuple(found)


def _units(key: str, found: Any, where: str, own: Sequence[str]) -> dict[str, Scale]:
    if not isinstance(found, dict):
        raise Diagnostic(f"{key} is not a table of scales", where, 'as in { a = "5 mm/turn" }')
    if not found:
        return {}
    from multidrop.dialects.units import scale

    scales = {}
    for axis, given in found.items():
        try:
            scales[axis] = scale(given, own)
        except Diagnostic as problem:
            raise Diagnostic(f"{key}.{axis}: {problem.message}", where, problem.hint) from None
    return scales


def check_label(label: str) -> None:
    """Raise Diagnostic for a text that cannot be the name of a drive."""
    if not re.fullmatch(r"[^\s:@/]+", label) or visible(label) != label or acts_first(label):
        raise Diagnostic(
            f"{label!r} is not a name", "", f"invalid: spaces, control characters, :, @ and /; {NOT_FIRST}"
        )


def _connection(name: str, found: Any, where: str, own: Sequence[str]) -> SavedConnection:
    key = f"connections.{name}"
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name) or acts_first(name):
        raise Diagnostic(f"{key}: not a name", where, "valid: letters, digits, - and _, not - first")
    table = _table(found, key, ("names", "units", "url"), where, f"write [{key}] with url = ...")
    url = table.get("url")
    if not isinstance(url, str) or not url:
        raise Diagnostic(f"{key}.url is missing or not text", where)
    names = table.get("names", {})
    if not isinstance(names, dict) or not all(isinstance(label, str) and label for label in names.values()):
        raise Diagnostic(f"{key}.names is not a table of names", where, 'as in { a = "gantry" }')
    for label in names.values():
        try:
            check_label(label)
        except Diagnostic as problem:
            raise Diagnostic(f"{key}.names: {problem.message}", where, problem.hint) from None
    scales = _units(f"{key}.units", table.get("units", {}), where, own)
    return SavedConnection(name, url, names, scales, os.path.abspath(os.path.dirname(where)))


def _guards(found: Any, where: str) -> Guarding:
    table = _table(found, "guards", ("also", "off"), where, 'write [guards] with off = ["WORD"] or also = ["WORD"]')
    words: dict[str, frozenset[str]] = {}
    for key in ("off", "also"):
        given = table.get(key, [])
        if not isinstance(given, list) or not all(isinstance(word, str) for word in given):
            raise Diagnostic(f"guards.{key} is not a list of words", where, f'as in {key} = ["BD"]')
        words[key] = frozenset(word.upper() for word in given)
        if not given:
            continue  # only a configuration with guards imports all families
        from multidrop.dialects.families import FAMILIES

        named = {name for family in FAMILIES.values() for name in family.guards}
        known = sorted(named | {TRAVEL})
        for word in sorted(words[key]):
            if key == "off" and word not in known:
                raise Diagnostic(f"guards.off: no guard {word}", where, f"valid: {', '.join(known)}")
            if key == "also" and not any(family.language.knows(word) for family in FAMILIES.values()):
                raise Diagnostic(f"guards.also: no drive has a word {word}", where, "valid: words that /help lists")
    return Guarding(**words)


def _log(found: Any, where: str) -> LogSettings:
    table = _table(found, "log", ("always", "files", "megabytes"), where, "write [log]")
    always = table.get("always", False)
    if not isinstance(always, bool):
        raise Diagnostic("log.always is not true or false", where)
    numbers = []
    for key, default, least, most in (("megabytes", 16, 0.01, 10_000), ("files", 8, 1, 1000)):
        number = table.get(key, default)
        if isinstance(number, bool) or not isinstance(number, int | float) or not least <= number <= most:
            raise Diagnostic(f"log.{key} is not a number from {least:g} to {most:g}", where)
        numbers.append(number)
    size, files = numbers
    if files != int(files):
        raise Diagnostic("log.files is not a whole number", where)
    return LogSettings(always, int(size * MEGABYTE), int(files))


def _screen_settings(screen: Any, keys: Any, where: str) -> ScreenSettings:
    table = _table(screen, "screen", (*CHOICES, "theme"), where, "write [screen]")
    if not isinstance(keys, dict):
        raise Diagnostic("keys is not a table", where, "write [keys]")
    for key, value in table.items():
        if not isinstance(value, str):
            raise Diagnostic(f"screen.{key} is not text", where)
        if key in CHOICES and value not in CHOICES[key]:
            raise Diagnostic(f"screen.{key}: {value!r} is unknown", where, f"valid: {', '.join(CHOICES[key])}")
    for name, key in keys.items():
        if not isinstance(key, str):
            raise Diagnostic(f"keys.{name} is not text", where, 'write a key as in "^T" or "F9"')
    return ScreenSettings(**table, keys=keys, where=where)


# Changes


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


def change(edit: Callable[[Any], None]) -> tuple[Path, Settings]:
    """Change the file; `edit` is given its document, which keeps comments and layout, and all that it leaves alone.

    Return the file, which is replaced as a whole, and what it has now. Raises Diagnostic, and then nothing has changed.
    """
    document = _document()
    edit(document)
    text = _checked(document)
    return _write(text), parse(text, str(config_file()))


def _write(text: str) -> Path:
    path = config_file().resolve()
    if path.exists() and not (path.stat().st_mode & 0o222 and os.access(path, os.W_OK)):
        raise Diagnostic("is read-only, so nothing was changed", str(path), f"chmod u+w {path} allows it")
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

    document = _document()  # not what is in force: --no-config leaves out what the file has
    if name in document.get("connections", {}):
        raise Diagnostic(f"a connection {name} exists already", str(config_file()), "give another name")
    if "connections" not in document:
        document["connections"] = tomlkit.table(is_super_table=True)
    table = tomlkit.table()
    table["url"] = url
    document["connections"][name] = table
    return _checked(document)
