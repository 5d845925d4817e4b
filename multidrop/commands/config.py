"""`multidrop config`: where the configuration is, what counts, and what is wrong with it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.files import toml_of, utf8_of
from multidrop.shell.connect import settings
from multidrop.shell.connect.settings import Settings
from multidrop.shell.output import write
from multidrop.shell.secrets import HIDDEN, holds_password, url_without_secrets

REFUSED = "   # default; the file's does not count"
WRONG = 2
"""The exit code of a configuration that cannot be used as it is."""


def path(chosen: argparse.Namespace) -> int:
    """Print the path of the file."""
    write(sys.stdout, str(settings.config_file()))
    return 0


def show(chosen: argparse.Namespace) -> int:
    """Print every setting as TOML; a remark marks those that the file does not set."""
    try:
        found = settings.load()
    except Diagnostic as failure:
        return fail(failure)
    for line in shown(found, _keys(found), _text(settings.config_file())):
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

    lines = [f"# {settings.config_file()}" + ("" if text else " does not exist: all settings are the defaults")]
    for name, each in found.connections.items():
        url = url_without_secrets(each.url) if holds_password(each.url) else each.url
        lines += ["", f"[connections.{name}]", f"url = {tomlkit.item(url).as_string()}"]
        if each.names:
            names = ", ".join(f"{key} = {tomlkit.item(value).as_string()}" for key, value in each.names.items())
            lines.append(f"names = {{ {names} }}")
    look, log, guards = found.look, found.log, found.guards
    wrong = {"theme"} if wrong_theme(look.theme) else set[str]()
    theme = "by the terminal" if wrong else look.theme or "by the terminal"
    lines += rows("screen", {"theme": theme, "signs": look.signs, "times": look.times}, wrong)
    lines += rows("keys", keys, {name for name, text in look.keys.items() if keys.get(name) != text})
    lines += rows("log", {"always": log.always, "megabytes": log.size / 1e6, "files": log.files})
    login = {key: HIDDEN if key == "password" and value else value for key, value in asdict(found.mqtt).items()}
    lines += rows("mqtt", login)
    lines += rows("simulator", {"allow": list(map(str, found.allowed))})
    lines += rows("sweep", {"clusters": list(found.clusters)})
    return lines + rows("guards", {"off": sorted(guards.off), "also": sorted(guards.also)})


def check(chosen: argparse.Namespace) -> int:
    """Report what is wrong; exit code 0 if nothing is."""
    try:
        found = settings.load()
    except Diagnostic as failure:
        return fail(failure)
    text = _text(settings.config_file())
    troubles = _troubles(found)
    for trouble in troubles:
        write(sys.stderr, str(settings.placed(trouble, text, str(settings.config_file()))))
    if not troubles:
        state = "is right" if text else "does not exist: all settings are the defaults"
        write(sys.stdout, f"{settings.config_file()} {state}")
    return WRONG if troubles else 0


def _troubles(found: Settings) -> list[str]:
    """The errors in keys and theme, which only the screen knows, and files that cannot be read."""
    from multidrop.tui.app import bindings
    from multidrop.tui.keymap import keymap
    from multidrop.tui.widgets.theme import wrong_theme

    look = found.look
    return [*keymap(bindings(), look.keys).troubles, *wrong_theme(look.theme), *found.mqtt.unreadable()]


def _keys(found: Settings) -> dict[str, str]:
    """The keys that count by the names of their functions: as the file writes them, else the program's own."""
    from multidrop.tui.app import bindings
    from multidrop.tui.keymap import keymap

    kept = keymap(bindings(), found.look.keys)
    return {name: found.look.keys[name] if name in kept.changed else kept.shown(name) for name in sorted(kept.keys)}


def _text(file: Path) -> str:
    return utf8_of(file) if file.exists() else ""
