"""Verbs for a line in raw mode: begin and end it, send bytes, set the port."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import whole
from multidrop.shell.raw import TERMINATORS, Form, RawLine, Watched, parse_bytes
from multidrop.shell.verbs.registry import Call, verb

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace

BREAK = 250
"""The length of a break, ms."""
LONGEST_BREAK = 2000
"""The same, at most: a break holds back a stop, which is then repeated."""
HIGHEST_BAUD = 10_000_000
SWITCH = {"on": True, "off": False}
FORMS = {form.value[0]: form for form in Form}


def _is_raw(workspace: Workspace) -> bool:
    return workspace.selected_bus in workspace.raw


def _raw(call: Call) -> RawLine:
    """The selected bus in raw mode. Raises Diagnostic for any other."""
    bus = call.workspace.bus()
    found = call.workspace.raw.get(bus.name)
    if found is None:
        raise Diagnostic(f"{bus.name} is not in raw mode", call.verb.name, "/raw on begins it")
    return found


@verb(
    "/raw [on|off] | open URL | baud N | dtr|rts on|off | break [MS] | end cr|lf|crlf|none | show text|hex|both",
    words={
        "on": "typed text goes to the port as it is, and every byte is shown",
        "off": "find the drives, and talk to them again",
        "open": "open a port where nothing answers",
        "baud": "change the baud rate of the port",
        "dtr": "switch the DTR line",
        "rts": "switch the RTS line",
        "break": "send a break",
        "end": "what follows a typed text",
        "show": "how bytes are shown",
    },
)
async def raw(call: Call) -> None:
    """Talk to the selected port itself, whatever is on it: bytes both ways, with times.

    In raw mode a typed line goes out as it is, with CR after it (/raw end lf changes that), also a line that begins
    with @. Bytes are shown as text and in hex. /bytes sends any bytes: /bytes ESC 0D "PR P" ^C. No drive is asked
    anything, polled or recognised. Ctrl+X sends the stop of the family of the URL (MCode unless it says dialect=).
    /raw off finds the drives. /raw open URL opens a port in raw mode and selects it. baud, dtr, rts and break need a
    serial port, rfc2217:// or ssh://. MS is 250 unless given.
    """
    what, *rest = call.words(0, 2) or ["on"]
    action = ACTIONS.get(what)
    if action is None or len(rest) not in action.takes:
        raise call.wrong()
    await action.run(call, what, *rest)


async def _switch(call: Call, what: str) -> None:
    bus, on = call.workspace.bus(), what == "on"
    if on == (bus.name in call.workspace.raw):
        raise Diagnostic(f"{bus.name} is {'already' if on else 'not'} in raw mode", call.verb.name)
    await (call.commands.raw_on(bus) if on else call.commands.raw_off(bus))


async def _open(call: Call, what: str, url: str) -> None:
    before = {*call.workspace.buses}
    await call.commands.open(url, raw=True)
    call.workspace.select("", next(name for name in call.workspace.buses if name not in before))


async def _set_baud(call: Call, what: str, text: str) -> None:
    line, baud = _raw(call), whole(text, 1, HIGHEST_BAUD)
    if baud is None:
        raise call.wrong(f"no baud rate {text}")
    await _set(line, f"the baud rate {baud}", lambda: line.control().set_baud(baud))
    line.bus.line.baud, line.bus.line.byte_time = baud, 10.0 / baud
    call.workspace.notify(f"{line.bus.name}: {baud} baud")


async def _set_line(call: Call, what: str, word: str) -> None:
    line = _raw(call)
    if word not in SWITCH:
        raise call.wrong()
    control = line.control()
    await _set(line, what.upper(), lambda: (control.set_dtr if what == "dtr" else control.set_rts)(SWITCH[word]))
    call.workspace.notify(f"{line.bus.name}: {what.upper()} {word}")


async def _send_break(call: Call, what: str, text: str = str(BREAK)) -> None:
    line = _raw(call)
    length = whole(text, 1, LONGEST_BREAK)
    if length is None:
        raise call.wrong(f"a break takes 1 to {LONGEST_BREAK} ms")
    control = line.control()
    try:
        await _set(line, "break", lambda: control.set_break(True))
        await asyncio.sleep(length / 1000)
    finally:  # also when a stop ends the wait: a break holds back what is written
        await _set(line, "break", lambda: control.set_break(False))
    call.workspace.notify(f"{line.bus.name}: a break of {length} ms was sent")


async def _set_end(call: Call, what: str, word: str) -> None:
    line = _raw(call)
    if word not in TERMINATORS:
        raise call.wrong()
    line.end = TERMINATORS[word]
    call.workspace.notify(f"{line.bus.name}: {word} follows a typed text")


async def _set_form(call: Call, what: str, word: str) -> None:
    line = _raw(call)
    if word not in FORMS:
        raise call.wrong()
    line.form = FORMS[word]
    call.workspace.notify(f"{line.bus.name}: bytes are shown as {word}")


async def _set(line: RawLine, what: str, change: Callable[[], None]) -> None:
    """Change a setting of the port, in a thread: a server may have to confirm it. Raises Diagnostic."""
    try:
        await asyncio.to_thread(change)
    except OSError as error:
        why = error.strerror or str(error)
        raise Diagnostic(f"the port does not take {what} ({why})", line.bus.name, "nothing was changed") from None


class Action(NamedTuple):
    """What a word after /raw does, and how many more words it takes."""

    run: Callable[..., Coroutine[Any, Any, None]]
    takes: tuple[int, ...] = (1,)


ACTIONS = {
    "on": Action(_switch, (0,)),
    "off": Action(_switch, (0,)),
    "open": Action(_open),
    "baud": Action(_set_baud),
    "dtr": Action(_set_line),
    "rts": Action(_set_line),
    "break": Action(_send_break, (0, 1)),
    "end": Action(_set_end),
    "show": Action(_set_form),
}


@verb(
    "/hex [on|off|text|hex|both]",
    immediate=True,
    words={
        "on": "show the bytes both ways, as text and in hex",
        "off": "show lines only",
        "text": "show the bytes as text",
        "hex": "show the bytes in hex",
        "both": "show the bytes as text and in hex",
    },
)
async def hex_(call: Call) -> None:
    """Show the bytes on the selected line, both ways, beside its lines; without a word, or no longer.

    Bytes of polls are left out. In raw mode bytes are always shown: see /raw show. /bytes sends bytes there.
    """
    words, workspace = call.words(0, 1), call.workspace
    bus = workspace.bus()
    if bus.name in workspace.raw:
        raise Diagnostic(f"{bus.name} is raw: its bytes are shown", call.verb.name, "/raw show text|hex|both")
    shown = workspace.byte_views.get(bus.name)
    word = words[0] if words else "off" if shown else "on"
    form = FORMS.get("both" if word == "on" else word)
    if form is None and word != "off":
        raise call.wrong()
    if form is None:
        if shown is not None:
            workspace.byte_views.pop(bus.name).close()
        workspace.notify(f"{bus.name}: bytes are not shown")
        return
    if shown is None:
        shown = workspace.byte_views[bus.name] = Watched(bus, workspace.publish, workspace.wall)
        shown.open()
    shown.form = form
    workspace.notify(f"{bus.name}: bytes are shown as {form.value[0]}, without polls; /hex off ends it")


@verb("/bytes BYTE ...", fits=_is_raw)
async def bytes_(call: Call) -> None:
    """Send bytes on the selected line in raw mode, and nothing after them: /bytes 0D 0A, /bytes ESC "PR P" CR ^C.

    BYTE is two hex digits (or more pairs, 1B5B), the name of a control byte (ESC, CR, LF, NUL, ETX), ^ and a letter,
    or a text in quotation marks.
    """
    line, data = _raw(call), parse_bytes(call.rest)
    if not data:
        raise call.wrong()
    await call.commands.send_bytes(line.bus, data, call.by)
