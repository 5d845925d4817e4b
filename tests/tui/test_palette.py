"""The palette: everyday words find their function."""

from __future__ import annotations

import pytest

from multidrop.shell.operations.table import VERBS
from multidrop.tui.app import bindings
from multidrop.tui.keymap import FunctionKeys, keymap
from multidrop.tui.palette import SYNONYMS, PaletteCommand, all_commands, commands_like
from tests.support.fake_session import FakeMacro, FakeMacros, demo_session

FINDS = {
    "baud": "Open a connection",
    "find drive": "Open a connection",
    "backup": "Back up the settings",
    "restore": "Restore the settings",
    "compare": "Compare the settings",
    "diff": "Compare the settings",
    "reconnect": "Open a connection",
    "connect": "Open a connection",
    "disconnect": "Close bus press",
    "reset": "Why",
    "limit": "Why",
    "error": "Why",
    "fault": "Why",
    "trigger": "Plots",
    "graph": "Plots",
    "csv": "Plots",
    "export": "Plots",
    "dark": "Theme",
    "light": "Theme",
    "theme": "Theme",
    "checksum": "Parameters",
    "speed": "Parameters",
    "current": "Parameters",
    "settings": "Parameters",
    "homing": "Controls",
    "jog": "Controls",
    "units": "Units",
    "millimetres": "Units",
    "mm": "Units",
    "save": "Save the transcript",
    "record": "Record a macro",
    "log": "Begin a log",
    "quit": "Quit",
    "exit": "Quit",
    "help": "Help",
    "undo": "Program",
    "editor": "Program",
    "copy": "Copy lines",
    "version": "/drives",
    "firmware": "/drives",
    "port": "Open a connection",
    "serial": "Open a connection",
    "address": "Choose a drive",
    "party line": "All drives",
    "rename": "Rename press",
    "stop": "Stop all",
    "emergency": "Stop all",
    "tour": "Tour",
    "tutorial": "Tour",
    "sniff": "Traffic",
    "hotkey": "Macros",
}
"""The first function of the palette for a typed text, on the demo cell."""


def commands() -> list[PaletteCommand]:
    macros = FunctionKeys()
    macros.read(FakeMacros(FakeMacro("lift", "F3")))
    verbs = [(verb.name, verb.usage, verb.lines[0]) for verb in VERBS.values()]
    return [*all_commands(demo_session(), macros, verbs, keymap(bindings(), {}), {"polling": True, "mouse": True})]


@pytest.mark.parametrize("typed", FINDS)
def test_an_everyday_word_finds_its_function_first(typed: str) -> None:
    offered = commands()
    found = commands_like(offered, typed, 80)
    titles = [offered[int(match.key)].title for match in found]
    assert titles[:1] == [FINDS[typed]], titles[:5]


def test_each_row_of_everyday_words_is_of_a_function_that_exists() -> None:
    titles = [command.title for command in commands()]
    lost = [head for head in SYNONYMS if not any(title.startswith(head) for title in titles)]
    assert lost == ["End the log"]  # while there is one
