"""Verbs for macros: record, play, list, put on a key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from dialects import Diagnostic, Stopped
from macros import KEYS, Macro, check_name
from macros import play as play_macro
from shell import waits
from shell.events import By
from shell.registry import Call, as_typed, verb

if TYPE_CHECKING:
    from shell.session import Session


@verb("/record [NAME | stop]", quick=True)
async def record(call: Call) -> None:
    """Record what is typed as a macro, until `/record stop`; alone it tells what is being recorded.

    A macro of that name is replaced, and stays on its key.
    """
    words, session = call.words(0, 1), call.session
    if not words:
        session.output(f"recording: {session.recording or 'nothing'}")
    elif words[0] == "stop":
        _keep(call)
    else:
        check_name(words[0], "/record")
        session.recorder.start(words[0], session.now())
        session.narrate(f"recording {words[0]}; /record stop ends it")
    session.changed()


def _keep(call: Call) -> None:
    session = call.session
    macro = session.recorder.stop()
    if macro.name in session.macros.names():
        macro = replace(macro, key=session.macros.load(macro.name).key)
    path = session.macros.save(macro)
    session.narrate(f"macro {macro.name}: {counted(len(macro.steps))} in {path}")


@verb("/play NAME [NAME=VALUE ...]", recorded=as_typed, aside=True)
async def play(call: Call) -> None:
    """Play a macro; {NAME} in its lines takes the value given. The first failure ends it."""
    words, session = call.words(1), call.session
    if session.latched:
        raise Stopped("stopped; /resume lets macros and scripts run again")
    if session.playing and (call.by is By.OPERATOR or words[0] in session.playing):
        raise Diagnostic(f"macro {session.playing[-1]} is playing", "/play", "let it end, or stop it")
    values = dict(split_value(word, call) for word in words[1:])
    await play_through(session, session.macros.load(words[0]), values)


async def play_through(session: Session, macro: Macro, values: Mapping[str, str]) -> None:
    """Play a macro to its end; `session.playing` says so meanwhile."""
    session.playing.append(macro.name)
    session.changed()
    try:
        await play_macro(macro, lambda line: session.run(line, By.MACRO), waits.sleep, values, session.now)
    finally:
        session.playing.remove(macro.name)
        session.changed()


def split_value(word: str, call: Call) -> tuple[str, str]:
    """`NAME=VALUE` in two."""
    name, sign, value = word.partition("=")
    if not sign or not name:
        raise call.wrong(f"{word} is not NAME=VALUE")
    return name, value


@verb("/macros", quick=True)
async def macros(call: Call) -> None:
    """List the macros: name, key, number of lines."""
    call.words(0, 0)
    for name in call.session.macros.names():
        call.session.output(summary(call.session.macros.load(name)))


def counted(lines: int) -> str:
    """`1 line`, `5 lines`."""
    return f"{lines} line" if lines == 1 else f"{lines} lines"


def summary(macro: Macro) -> str:
    """A macro as one line."""
    return f"{macro.name:<16} {macro.key or '-':<4} {counted(len(macro.steps))}  {macro.note}".rstrip()


@verb("/key F2..F12 NAME | off", quick=True)
async def key(call: Call) -> None:
    """Put a macro on a function key, or take what is on it off."""
    words, store = call.words(2, 2), call.session.macros
    name = words[0].upper()
    if name not in KEYS:
        raise call.wrong(f"no macro can be on {words[0]}")
    before = store.by_key(name)
    if words[1] == "off":
        if before is None:
            raise Diagnostic(f"nothing is on {name}", "/key")
        store.save(replace(before, key=""))
        call.session.narrate(f"{name} plays nothing")
    else:
        macro = store.load(words[1])
        if before is not None and before.name != macro.name:
            store.save(replace(before, key=""))
        store.save(replace(macro, key=name))
        call.session.narrate(f"{name} plays {macro.name}")
    call.session.changed()
