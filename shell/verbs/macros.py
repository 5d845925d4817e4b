"""The verb that plays macros."""

from __future__ import annotations

from dialects import Diagnostic, Stopped
from macros import cast
from shell import casting
from shell.events import By
from shell.verbs.registry import Call, as_typed, verb
from shell.workspace import LATCHED


@verb("/play MACRO [NAME=VALUE ...]", recorded=as_typed, concurrent=True)
async def play(call: Call) -> None:
    """Play a macro; {NAME} in its lines takes the given value. The first failure ends it.

    A role of the macro takes the name of an open bus. What is missing is asked for.
    """
    words, workspace = call.words(1), call.workspace
    if workspace.latched:
        raise Stopped(LATCHED)
    if workspace.playing and (call.by is By.OPERATOR or words[0] in workspace.playing):
        raise Diagnostic(f"macro {workspace.playing[-1]} is playing", "/play", "wait for its end, or stop it")
    given = dict(split_value(word, call) for word in words[1:])
    macro = workspace.macros.load(words[0])
    values, roles = await casting.settled(workspace, macro, given)
    await call.commands.play(cast(macro, roles), values)


def split_value(word: str, call: Call) -> tuple[str, str]:
    """Split `NAME=VALUE`."""
    name, sign, value = word.partition("=")
    if not sign or not name:
        raise call.wrong(f"no value {word}; valid: NAME=VALUE")
    return name, value
