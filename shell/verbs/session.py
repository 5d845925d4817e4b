"""Verbs for the session itself: help, stop, log, the end."""

from __future__ import annotations

import difflib

from dialects import Diagnostic, Stopped
from shell import stops
from shell.events import By
from shell.verbs.registry import VERBS, Call, verb

WIDTH = 28
"""Columns for usages in the overview."""


@verb("/help [WORD|NUMBER]", immediate=True)
async def help_(call: Call) -> None:
    """Show what a verb, a command of the drives or an error number means; all verbs where none is named.

    Lines without a slash go to the selected drive, `@ADDR TEXT` goes to another one, `@* TEXT` to all of a bus.
    """
    words = call.words(0, 1)
    selected = call.session.selected
    language, product = (selected.codec.language, selected.product) if selected else ("", "")
    if words and words[0].isdecimal() and words[0].isascii():
        lines = error_described(words[0], language, product)
    else:
        lines = described(words[0], language, product) if words else overview()
    for line in lines:
        call.session.output(line, columns=True)


def overview() -> list[str]:
    """All verbs, a line each; a long usage has a line of its own."""
    lines = []
    for each in VERBS.values():
        if len(each.usage) > WIDTH:
            lines.append(each.usage)
        lines.append(f"{each.usage if len(each.usage) <= WIDTH else '':<{WIDTH}}  {each.meaning}")
    return lines


def error_described(number: str, language: str, product: str) -> list[str]:
    """What an error number of a drive means. Raises Diagnostic where there is no such number."""
    from dialects.languages import DEFAULT, LANGUAGES

    return LANGUAGES[language or DEFAULT].describe_error(int(number[:9]), product)


def described(name: str, language: str = "", product: str = "") -> list[str]:
    """What a verb (with or without its slash) or a command means, in the selected drive's language before others.

    What its product makes of a word is told too.

    Raises Diagnostic where there is none of that name.
    """
    from dialects.languages import DEFAULT, LANGUAGES

    if name.startswith("/") and name in VERBS:
        return VERBS[name].described()
    own = LANGUAGES[language or DEFAULT]
    for each in (own, *LANGUAGES.values()):
        if each.knows(name):
            return each.describe(name, product if each is own else "")
    if f"/{name}" in VERBS:
        return described(f"/{name}")
    near = difflib.get_close_matches(name.upper(), [*own.names(), *(key.upper() for key in VERBS)], 3)
    hint = f"near it are {', '.join(near).lower() if name.startswith('/') else ', '.join(near)}" if near else ""
    raise Diagnostic(f"no verb and no command is called {name}", "/help", hint or "/help lists the verbs")


@verb("/stop", immediate=True)
async def stop(call: Call) -> None:
    """Stop every drive on every bus, and macros, scripts and waits; Ctrl+X does the same from anywhere.

    Macros and scripts stay refused until /resume.
    """
    call.words(0, 0)
    call.session.stop("/stop")


@verb("/resume", immediate=True)
async def resume(call: Call) -> None:
    """Let macros and scripts run again after a stop."""
    call.words(0, 0)
    if call.by is not By.OPERATOR:
        raise Stopped("/resume is for a person to type")
    state = f"; {stops.words(call.session.tally())}" if call.session.latched else ""
    call.session.resume()
    call.session.notify(f"macros and scripts may run again{state}")


@verb("/log [FILE|off]", immediate=True, words={"off": "end the log"})
async def log(call: Call) -> None:
    """Keep everything that is typed and printed in a file, with the time of day; it is added to.

    Signs: > sent, < printed, * what went on, ! failed. `/log` alone tells which file it is.
    """
    from shell.log import SessionLog

    words, session = call.words(0, 1), call.session
    if not words:
        session.output(f"log: {session.log.path if session.log else 'off'}")
        return
    if session.log is not None:
        session.log.close()
        session.log = None
    if words[0] != "off":
        session.log = SessionLog(session, words[0])
    session.notify(f"log: {words[0]}")


@verb("/quit", immediate=True)
async def quit_(call: Call) -> None:
    """End multidrop. At a terminal it asks first while drives move, and names them; those go on moving."""
    call.words(0, 0)
    ask = call.session.before_quit
    if ask is None or await ask():
        call.session.quit()
