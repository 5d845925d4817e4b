"""`multidrop config` and `report`: what counts on this machine, what is wrong, and what a bug report needs."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from datetime import date, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import multidrop
from multidrop.base import places, registry
from multidrop.base.errors import Diagnostic
from multidrop.base.files import bounded, opened, split_lines, toml_of, utf8_of, why
from multidrop.base.new_file import STANDARD_OUTPUT
from multidrop.base.text import visible
from multidrop.macros import MacroStore
from multidrop.shell import configuration
from multidrop.shell.configuration import Settings
from multidrop.shell.operations.table import load_others
from multidrop.shell.secrets import holds_password, toml_without_secrets, url_without_secrets, without_secrets
from multidrop.shell.sections import sections
from multidrop.shell.streams.stdout import write

REFUSED = "   # default; the file's does not count"
WRONG = 2
"""The exit code of a configuration that cannot be used as it is."""


def say_not_in_force() -> None:
    """Say on standard error what of the configuration file is not in force with `--no-config`."""
    if text := not_in_force(configuration.load(lenient=True)):
        write(sys.stderr, f"--no-config: not in force: {text}")


def not_in_force(found: Settings) -> str:
    """What a session without the configuration lacks, for a person: guards, names and units; empty: nothing."""
    guards = found.guards
    parts = [f"the guards on {', '.join(sorted(guards.also))}"] if guards.also else []
    parts += [f"'off' of the guards {', '.join(sorted(guards.off))}"] if guards.off else []
    for name, connection in found.connections.items():
        parts += [f"the names of {name}"] if connection.names else []
        parts += [f"the units of {name}"] if connection.units else []
    parts += [f"what has errors in the file: {len(found.problems)}"] if found.problems else []
    return ", ".join(parts)


def path() -> int:
    write(sys.stdout, str(places.config_file()))
    return 0


def show() -> int:
    """Print every setting as TOML; a remark marks those that the file does not set."""
    settings = configuration.load()
    for line in shown(settings, _keys(settings), _text(places.config_file())):
        write(sys.stdout, line)
    return 0


def shown(found: Settings, keys: dict[str, str], text: str) -> list[str]:
    """The settings, line by line. `keys`: those that count; `text`: the file."""
    import tomlkit

    from multidrop.tui.widgets.theme import wrong_theme

    given = toml_of(text, "")

    def rows(table: str, values: Mapping[str, object], refused: Collection[str] = ()) -> list[str]:
        has = given.get(table, {})
        remarks = {key: REFUSED if key in refused else "" if key in has else "   # default" for key in values}
        return ["", f"[{table}]", *(f"{key} = {tomlkit.item(values[key]).as_string()}{remarks[key]}" for key in values)]

    lines = [f"# {places.config_file()}" + ("" if text else " does not exist: all settings are the defaults")]
    for name, connection in found.connections.items():
        url = url_without_secrets(connection.url) if holds_password(connection.url) else connection.url
        lines += ["", f"[connections.{name}]", f"url = {tomlkit.item(url).as_string()}"]
        if connection.names:
            names = ", ".join(f"{key} = {tomlkit.item(value).as_string()}" for key, value in connection.names.items())
            lines.append(f"names = {{ {names} }}")
    screen, log, guards = found.screen, found.log, found.guards
    wrong = {"theme"} if wrong_theme(screen.theme) else set[str]()
    theme = "by the terminal" if wrong else screen.theme or "by the terminal"
    lines += rows("screen", {"theme": theme, "signs": screen.signs, "times": screen.times}, wrong)
    lines += rows("keys", keys, {name for name, text in screen.keys.items() if keys.get(name) != text})
    lines += rows("log", {"always": log.always, "megabytes": log.size / 1e6, "files": log.files})
    tables = {name: section.shown(found.section(name)) for name, section in sections().items()}
    tables["simulator"] = {"allow": list(map(str, found.allowed))}
    for name, values in sorted(tables.items()):
        lines += rows(name, values)
    return lines + rows("guards", {"off": sorted(guards.off), "also": sorted(guards.also)})


def check() -> int:
    """Report what is wrong; exit code 0 if nothing is."""
    settings = configuration.load(lenient=True)
    text = _text(places.config_file())
    from multidrop.tui.app import configuration_troubles

    troubles = configuration_troubles(settings, text, str(places.config_file()))
    write(sys.stderr, *map(str, (*settings.problems, *troubles)))
    if not (troubles or settings.problems):
        state = "is right" if text else "does not exist: all settings are the defaults"
        write(sys.stdout, f"{places.config_file()} {state}")
    return WRONG if troubles or settings.problems else 0


def _keys(found: Settings) -> dict[str, str]:
    """The keys that count by the names of their functions: as the file writes them, else the program's own."""
    from multidrop.tui.app import bindings
    from multidrop.tui.keymap import keymap

    kept = keymap(bindings(), found.screen.keys)
    return {name: found.screen.keys[name] if name in kept.changed else kept.shown(name) for name in sorted(kept.keys)}


def _text(file: Path) -> str:
    return utf8_of(file) if file.exists() else ""


TERMINAL = ("TERM", "COLORTERM", "TERM_PROGRAM", "LANG", "LC_ALL", "LC_CTYPE", "NO_COLOR", "PYTHONUTF8")
PRESENT = ("SSH_CONNECTION", "TMUX", "STY")
"""Variables of which only the presence matters: they hold addresses and paths."""
MOST_LISTED_LINES = 200
"""Lines of a file in the report; the rest is counted."""


def report(output: str, agreed: bool) -> int:
    # All sections, without control characters and secrets.
    parts = []
    for title, lines in SECTIONS.items():
        parts += [f"== {title}", *(f"  {visible(without_secrets(line), tabs=True)}" for line in lines()), ""]
    text = "\n".join(parts).rstrip() + "\n"
    for line in text.splitlines():
        write(sys.stdout, line)
    if output == STANDARD_OUTPUT:
        return 0
    asked = sys.stdin.isatty() and sys.stdout.isatty()
    if not (output or asked):
        return 0
    path = Path(output or f"multidrop-report-{date.today().isoformat()}.txt")
    if not agreed and not asked:
        raise Diagnostic("not written: this is not a terminal", str(path), "read the report above, then add --yes")
    if not agreed:
        sys.stderr.write(f"\nWrite the report to {path}? [y/N] ")
        sys.stderr.flush()
        try:
            agreed = input().strip().lower() in ("y", "yes")
        except EOFError:
            agreed = False
    if not agreed:
        write(sys.stderr, "nothing was written")
        return 0
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise Diagnostic("exists already", str(path), "choose another name with -o") from None
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
    write(sys.stderr, f"the report is in {path}")
    return 0


def _program() -> Iterator[str]:
    import multidrop

    yield f"multidrop {multidrop.__version__} in {Path(multidrop.__file__).parent.parent}"
    yield f"{platform.python_implementation()} {platform.python_version()} ({sys.executable})"
    yield " ".join((platform.system(), platform.release(), platform.machine(), *platform.libc_ver()))
    yield f"time {datetime.now().astimezone().isoformat(timespec='seconds')}"


def _packages() -> Iterator[str]:
    try:
        needed = requires("multidrop") or []
    except PackageNotFoundError:
        yield "not installed: it runs from a source tree"
        return
    for need in needed:
        name = need.partition(";")[0].split("<")[0].split(">")[0].split("=")[0].split("[")[0].strip()
        extra = need.partition("extra ==")[2].strip(" '\"")
        try:
            installed = version(name)
        except PackageNotFoundError:
            installed = "not installed"
        yield f"{name} {installed}" + (f" (extra {extra})" if extra else "")


def _terminal() -> Iterator[str]:
    columns, rows = shutil.get_terminal_size()
    streams = [name for name in ("stdin", "stdout", "stderr") if getattr(sys, name).isatty()]
    yield f"terminals: {', '.join(streams) or 'none'}; {columns}x{rows}; encoding {sys.stdout.encoding}"
    if sys.platform == "win32":
        from multidrop.shell.console import facts

        yield from facts()
    for name in TERMINAL:
        if name in os.environ:
            yield f"{name}={os.environ[name]}"
    for name in PRESENT:
        if name in os.environ:
            yield f"{name} is set"


def _configuration() -> Iterator[str]:
    path = places.config_file()
    yield str(path)
    try:
        with opened(path) as file:
            text = bounded(file, str(path)).decode("utf-8", "backslashreplace")
        lines = split_lines(toml_without_secrets(text))
    except FileNotFoundError:
        yield "no such file"
    except OSError as problem:
        yield f"problem: {why(problem)}"
    except Diagnostic as problem:
        yield f"problem: {problem}"
    else:
        yield from lines[:MOST_LISTED_LINES]
        if len(lines) > MOST_LISTED_LINES:
            yield f"... {len(lines) - MOST_LISTED_LINES} more lines"
    try:
        yield from (f"problem: {problem}" for problem in configuration.load(lenient=True).problems)
    except Diagnostic as problem:
        yield f"problem: {problem}"


def _macros() -> Iterator[str]:
    """The names of the macros; the problem of a file in place of its contents."""
    store = MacroStore(places.config_folder() / "macros")
    yield str(store.folder)
    try:
        names = store.names()
    except Diagnostic as problem:
        yield f"problem: {problem}"
        return
    for name in names:
        try:
            macro = store.load(name)
        except Diagnostic as problem:
            yield f"problem: {problem}"
        else:
            yield f"{macro.name} {macro.key}".rstrip()


def _ports() -> Iterator[str]:
    from multidrop.shell.connect.schemes import local_ports

    ports_there = [*local_ports()]
    for port in ports_there:
        yield "  ".join(part for part in (port.device, port.stable_name, port.description) if part)
    if not ports_there:
        yield "no serial port"


def _state() -> Iterator[str]:
    """The files of the state folder. Their contents stay: the history has what was typed."""
    folder = places.state_folder()
    yield str(folder)
    try:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        for path in files[:MOST_LISTED_LINES]:
            yield f"{path.stat().st_size:>10} {path.relative_to(folder)}"
    except OSError as problem:
        yield f"problem: {why(problem)}"


def features(as_json: bool) -> int:
    """List every feature. One that cannot be loaded is listed with its error; the exit code is 0 all the same."""
    import json

    load_others()  # their warnings are in the list
    states = list(registry.states(multidrop.__version__))
    if as_json:
        for entry, meaning, state in states:
            facts = {"name": entry.name, "source": entry.source, "version": entry.version, "state": state}
            write(sys.stdout, json.dumps(facts | {"meaning": meaning}))
        return 0
    rows = [(entry.name, f"{entry.source} {entry.version}".strip(), state, meaning) for entry, meaning, state in states]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True))
        write(sys.stdout, visible("  ".join(cells).rstrip()))
    return 0


SECTIONS: dict[str, Callable[[], Iterator[str]]] = {
    "multidrop": _program,
    "packages": _packages,
    "terminal": _terminal,
    "configuration": _configuration,
    "macros": _macros,
    "serial ports": _ports,
    "state folder": _state,
}
