"""Operations on the bytes of a line: raw mode, what is shown of it, and bytes that are sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations import arguments, conditions
from multidrop.shell.operations.argument_types import Switch, UrlForm
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument

if TYPE_CHECKING:
    from multidrop.shell import raw
    from multidrop.shell.raw import RawLine
    from multidrop.shell.session import Call

BREAK = 250
"""The length of a break, ms."""
LONGEST_BREAK = 2000
"""The same, at most: a break holds back a stop, which is then repeated."""
HIGHEST_BAUD = 10_000_000
Baud = Annotated[int, Argument(metavar="N", read=partial(arguments.number, low=1, high=HIGHEST_BAUD))]
Milliseconds = Annotated[int, Argument(metavar="MS", read=partial(arguments.number, low=1, high=LONGEST_BREAK))]
Pin = Annotated[str, Argument(words={"dtr": "switch the DTR line", "rts": "switch the RTS line"})]
Terminator = Annotated[str, Argument(words={"cr": "", "lf": "", "crlf": "", "none": ""})]
Form = Annotated[str, Argument(words={"text": "", "hex": "", "both": ""})]
Shown = Annotated[
    str,
    Argument(
        words={
            "on": "show the bytes both ways, as text and in hex",
            "off": "show lines only",
            "text": "show the bytes as text",
            "hex": "show the bytes in hex",
            "both": "show the bytes as text and in hex",
        }
    ),
]
Bytes = Annotated[str, Argument(metavar="BYTE ...", rest=True)]


def in_raw_mode(call: Call) -> RawLine:
    """The selected bus in raw mode. Raises Diagnostic for any other."""
    bus = call.session.bus()
    raw = call.session.raw.get(bus.name)
    if raw is None:
        raise Diagnostic(f"{bus.name} is not in raw mode", call.verb.name, "/raw on begins it")
    return raw


def forms() -> Mapping[str, raw.ByteForm]:
    """The forms in which bytes are shown, by their words."""
    from multidrop.shell import raw

    return {form.value[0]: form for form in raw.ByteForm}


async def begin(call: Call) -> None:
    bus = call.session.bus()
    if bus.name in call.session.raw:
        raise Diagnostic(f"{bus.name} is already in raw mode", call.verb.name)
    await call.session.openings.raw_on(bus)


async def end(call: Call) -> None:
    bus = call.session.bus()
    if bus.name not in call.session.raw:
        raise Diagnostic(f"{bus.name} is not in raw mode", call.verb.name)
    await call.session.openings.raw_off(bus)


async def open_(call: Call, url: UrlForm) -> None:
    before = {*call.session.buses}
    await call.session.open(url, raw=True)
    call.session.select("", next(name for name in call.session.buses if name not in before))


async def baud(call: Call, number: Baud) -> None:
    line = in_raw_mode(call)
    await _set(line, f"the baud rate {number}", lambda: line.control().set_baud(number))
    line.bus.set_baud(number)
    call.session.notify(f"{line.bus.name}: {number} baud")


async def switch(call: Call, pin: Pin, state: Switch) -> None:
    line, on = in_raw_mode(call), state == "on"
    control = line.control()
    await _set(line, pin.upper(), lambda: (control.set_dtr if pin == "dtr" else control.set_rts)(on))
    call.session.notify(f"{line.bus.name}: {pin.upper()} {state}")


async def send_break(call: Call, length: Milliseconds = BREAK) -> None:
    import asyncio

    line = in_raw_mode(call)
    control = line.control()
    try:
        await _set(line, "break", lambda: control.set_break(True))
        await asyncio.sleep(length / 1000)
    finally:  # also when a stop ends the wait: a break holds back what is written
        await _set(line, "break", lambda: control.set_break(False))
    call.session.notify(f"{line.bus.name}: a break of {length} ms was sent")


def terminate(call: Call, terminator: Terminator) -> None:
    from multidrop.shell.raw import TERMINATORS

    line = in_raw_mode(call)
    line.end = TERMINATORS[terminator]
    call.session.notify(f"{line.bus.name}: {terminator} follows a typed text")


def show(call: Call, form: Form) -> None:
    line = in_raw_mode(call)
    line.form = forms()[form]
    call.session.notify(f"{line.bus.name}: bytes are shown as {form}")


async def _set(line: RawLine, what: str, change: Callable[[], None]) -> None:
    """Change a setting of the port, in a thread: a server may have to confirm it. Raises Diagnostic."""
    import asyncio

    try:
        await asyncio.to_thread(change)
    except OSError as error:
        why = error.strerror or str(error)
        raise Diagnostic(f"the port does not take {what} ({why})", line.bus.name, "nothing was changed") from None


async def show_bytes(call: Call, form: Shown = "") -> None:
    from multidrop.shell.raw import Watched

    workspace = call.session
    bus = workspace.bus()
    if bus.name in workspace.raw:
        raise Diagnostic(f"{bus.name} is raw: its bytes are shown", call.verb.name, "/raw show text|hex|both")
    record = workspace.of(bus)
    shown = record.bytes_shown
    word = form or ("off" if shown else "on")
    if word == "off":
        if shown is not None:
            shown.close()
            record.bytes_shown = None
        workspace.notify(f"{bus.name}: bytes are not shown")
        return
    if shown is None:
        shown = record.bytes_shown = Watched(bus, workspace.publish, workspace.wall)
        shown.open()
    shown.form = forms()["both" if word == "on" else word]
    workspace.notify(f"{bus.name}: bytes are shown as {shown.form.value[0]}, without polls; /hex off ends it")


async def send_bytes(call: Call, text: Bytes) -> None:
    from multidrop.shell.raw import parse_bytes

    line, data = in_raw_mode(call), parse_bytes(text)
    if not data:
        raise call.wrong()
    await call.session.path.send_bytes(line.bus, data, call.origin)


OPERATIONS = (
    Operation(
        begin,
        verb="/raw",
        group=Group.BYTES,
        changes=True,
        help="""
Talk to the selected port itself, whatever is on it: bytes both ways, with times.

In raw mode a typed line goes out as it is, with CR after it (/raw end lf changes that), also a line that begins
with @. Bytes are shown as text and in hex. /bytes sends any bytes: /bytes ESC 0D "PR P" ^C. No drive is asked
anything, polled or recognised. Ctrl+X sends the stop of the language of the URL (dialect=, or the usual one).
/raw off finds the drives. /raw open URL opens a port in raw mode and selects it. baud, dtr, rts and break need a
serial port, rfc2217:// or ssh://. MS is 250 unless given.
""",
    ),
    Operation(
        begin, verb="/raw on", changes=True, help="typed text goes to the port as it is, and every byte is shown"
    ),
    Operation(end, verb="/raw off", help="find the drives, and talk to them again"),
    Operation(open_, verb="/raw open", help="open a port where nothing answers"),
    Operation(baud, verb="/raw baud", help="change the baud rate of the port"),
    Operation(switch, verb="/raw"),
    Operation(send_break, verb="/raw break", help="send a break"),
    Operation(terminate, verb="/raw end", help="what follows a typed text"),
    Operation(show, verb="/raw show", help="how bytes are shown"),
    Operation(
        show_bytes,
        verb="/hex",
        group=Group.BYTES,
        immediate=True,
        help="""
Show the bytes on the selected line, both ways, beside its lines; without a word, or no longer.

Bytes of polls are left out. In raw mode bytes are always shown: see /raw show. /bytes sends bytes there.
""",
    ),
    Operation(
        send_bytes,
        verb="/bytes",
        group=Group.BYTES,
        fits=conditions.is_raw,
        changes=True,
        help="""
Send bytes on the selected line in raw mode, and nothing after them: /bytes 0D 0A, /bytes ESC "PR P" CR ^C.

BYTE is two hex digits (or more pairs, 1B5B), the name of a control byte (ESC, CR, LF, NUL, ETX), ^ and a letter,
or a text in quotation marks.
""",
    ),
)
