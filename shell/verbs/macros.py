"""The verb that plays macros."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from multidrop.dialects import Diagnostic, Stopped
from multidrop.dialects.text import whole
from multidrop.macros import Macro
from multidrop.shell.events import By
from multidrop.shell.macro_arguments import settled
from multidrop.shell.playing import FOREVER
from multidrop.shell.verbs.registry import Call, as_typed, verb
from multidrop.shell.workspace import LATCHED

MOST_ROUNDS = 10**9
"""The largest number of rounds."""
EXECUTOR = "multidrop.shell.scripts.executor"
"""What plays macros. It executes verbs, so this one has only its name."""
PLAY = "/play MACRO [NAME=VALUE ...] [--times N|forever] [--fast] | stop [MACRO]"
Wrong = Callable[[str], Diagnostic]
"""Makes the Diagnostic for wrong words."""


@dataclass(frozen=True)
class PlayCall:
    """The words after `/play`."""

    macro: str
    given: Mapping[str, str]
    """Values and roles."""
    times: int | None = 1
    """None: until it is ended."""
    fast: bool = False

    def divided(self, macro: Macro) -> tuple[dict[str, str], dict[str, str]]:
        """The values, and the buses of the roles."""
        roles = {name: value for name, value in self.given.items() if name in macro.roles}
        return {name: value for name, value in self.given.items() if name not in roles}, roles


def play_call(words: Sequence[str], wrong: Wrong) -> PlayCall:
    """Read the words after `/play`. Raises Diagnostic."""
    name, *rest = words
    given: dict[str, str] = {}
    times: int | None = 1
    fast = False
    while rest:
        word = rest.pop(0)
        if word == "--fast":
            fast = True
        elif word == "--times":
            times = rounds(rest.pop(0) if rest else "", wrong)
        else:
            name_of, sign, value = word.partition("=")
            if not (name_of and sign):
                raise wrong(f"no value {word}; valid: NAME=VALUE")
            given[name_of] = value
    return PlayCall(name, given, times, fast)


def rounds(text: str, wrong: Wrong) -> int | None:
    """Read a number of rounds; None: without an end. Raises the Diagnostic that `wrong` returns."""
    if text == FOREVER:
        return None
    number = whole(text, 1, MOST_ROUNDS)
    if number is None:
        raise wrong(f"no number of rounds {text}".rstrip() + f"; valid: 1 to {MOST_ROUNDS}, or {FOREVER}")
    return number


@verb(
    PLAY,
    recorded=as_typed,
    concurrent=True,
    words={
        "stop": "end what plays, and stop what it set in motion",
        "--times": "play several rounds",
        FOREVER: "play until it is ended",
        "--fast": "leave out the recorded pauses",
    },
)
async def play(call: Call) -> None:
    """Play a macro; {NAME} in its lines takes the given value. The first failure ends it.

    A role of the macro takes the name of an open bus. What is missing is asked for. `/play stop` ends what plays and
    stops the drives that it set in motion; its on_stop lines follow. After Ctrl+X they do not.
    """
    words, workspace = call.words(1), call.workspace
    if words[0] == "stop":
        _end(call, words[1:])
        return
    chosen = play_call(words, call.wrong)
    if workspace.latched:
        raise Stopped(LATCHED)
    if call.by is By.OPERATOR and any(each.name == chosen.macro for each in workspace.playing):
        raise Diagnostic(f"macro {chosen.macro} is playing", "/play", f"/play stop {chosen.macro} ends it")
    macro = workspace.macros.load(chosen.macro)
    values, roles = await settled(workspace, macro, chosen.given)
    executor = importlib.import_module(EXECUTOR)
    await executor.play(call.session, macro, values, times=chosen.times, fast=chosen.fast, roles=roles)


def _end(call: Call, names: Sequence[str]) -> None:
    """End the macros of these names, or all of them."""
    if len(names) > 1:
        raise call.wrong()
    found = [each for each in call.workspace.playing if each.name in names or not names]
    if not found:
        raise Diagnostic(f"macro {names[0]} does not play" if names else "no macro plays", "/play stop")
    for each in found:
        each.end()
